"""One case after the other in one process: FMUs are loaded and instantiated once, and what goes wrong is put in words.

An FMU that cannot go back to its begin is instantiated anew for every case, and so is everything after a failure.
"""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import TypeAlias

from liaisons.cosim.run import Run
from liaisons.errors import LiaisonsError
from liaisons.sweeps.kept import evaluate
from liaisons.sweeps.outcome import Failure, Outcome, failure
from liaisons.sweeps.study import Study

Task: TypeAlias = tuple[Study, Mapping[Path, Path], str]
"""What a process needs to know: the sweep, where each FMU lies extracted, and a folder for what it leaves behind."""


@contextmanager
def session(task: Task) -> Iterator[Callable[[int], Outcome]]:
    """A function that simulates one case, in a process that has no other purpose and may be killed in its midst."""
    study, folders, tempfile.tempdir = task
    with ExitStack() as held:
        run: Run | None = None

        def outcome(case: int) -> Outcome:
            nonlocal run
            try:
                parts = study.starts(case)
            except LiaisonsError as error:  # a value that does not fit never will
                return Failure(str(error), refused=True)
            try:
                run = run or held.enter_context(Run(study.simulation, folders, again=True))
                run.start(parts)
                run.finish()
                result = run.result()
                if not run.repeats:
                    run = None
                    held.close()
                return evaluate(study.keep, result)
            except Exception as error:  # noqa: BLE001 - whatever it is, the other cases go on
                run = None
                held.close()
                return failure(error)

        yield outcome
