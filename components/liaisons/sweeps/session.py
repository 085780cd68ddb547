"""One case after the other in one process: FMUs are extracted, loaded and instantiated once.

An FMU that cannot go back to its begin is instantiated anew for every case, and so is everything after a failure.
"""

from __future__ import annotations

import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import TypeAlias, final

from liaisons.cosim.parts import Part
from liaisons.cosim.run import Run
from liaisons.errors import LiaisonsError
from liaisons.results import Result
from liaisons.sweeps.kept import evaluate
from liaisons.sweeps.outcome import Failure, Outcome, failure
from liaisons.sweeps.study import Study

Task: TypeAlias = tuple[Study, Mapping[Path, Path], str]
"""What a process needs to know: the sweep, where each FMU lies extracted, and a folder for what it leaves behind."""


@final
class Session:
    """A context manager that holds running FMUs.

    :param folders: where each FMU lies extracted; see :func:`liaisons.cosim.instances.extracted`.
    """

    def __init__(self, study: Study, folders: Mapping[Path, Path]) -> None:
        self._study = study
        self._folders = folders
        self._run: Run | None = None

    def __enter__(self) -> Session:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Release all instances; the next case makes new ones."""
        run, self._run = self._run, None
        if run is not None:
            run.close()

    def outcome(self, case: int) -> Outcome:
        """Simulate one case; what goes wrong comes back in words."""
        try:
            parts = self._study.starts(case)
        except LiaisonsError as error:  # a value that does not fit never will
            return Failure(str(error), refused=True)
        try:
            return evaluate(self._study.keep, self._result(parts))
        except Exception as error:  # noqa: BLE001 - whatever it is, the other cases go on
            self.close()
            return failure(error)

    def _result(self, parts: Mapping[str, Part]) -> Result:
        if self._run is None:
            self._run = Run(self._study.simulation, self._folders, again=True)
        self._run.start(parts)
        self._run.finish()
        result = self._run.result()
        if not self._run.repeats:
            self.close()
        return result


def session_of(task: Task) -> Session:
    """The session of a process that has no other purpose, and may be killed in its midst.

    What it puts into temporary folders is in that of the sweep, and goes with that.
    """
    study, folders, tempfile.tempdir = task
    return Session(study, folders)
