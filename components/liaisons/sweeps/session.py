"""One case after the other in one process: FMUs are loaded and instantiated once, and what goes wrong is put in words.

An FMU that cannot go back to its begin is instantiated anew for every case, and so is everything after a failure.  A
case over which a process has died is done with isolated FMUs, so that one that crashes is named.
"""

from __future__ import annotations

import logging
import tempfile
from collections.abc import Iterator, Mapping
from contextlib import ExitStack, contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Protocol, TypeAlias

from liaisons.cosim.running.run import Run
from liaisons.cosim.structure.components import SystemComponent
from liaisons.errors import EndedError, LiaisonsError
from liaisons.logs import collected_warnings, logger
from liaisons.sweeps.kept import evaluate
from liaisons.sweeps.outcome import Failure, Kept, Outcome, failure
from liaisons.sweeps.study import Study

Task: TypeAlias = tuple[Study, Mapping[Path, Path], str]
"""What a process needs to know: the sweep, where each FMU lies extracted, and a folder for what it leaves behind."""


class Simulate(Protocol):
    """Simulates one case; with FMUs in processes of their own if they are ``suspect``."""

    def __call__(self, case: int, /, *, suspect: bool = False) -> Outcome: ...


@contextmanager
def session(task: Task) -> Iterator[Simulate]:
    """A function that simulates one case, in a process that has no other purpose and may be killed in its midst."""
    study, folders, tempfile.tempdir = task
    logger.propagate = False  # warnings go with the case
    logger.addHandler(logging.NullHandler())
    with ExitStack() as held:
        run: Run | None = None

        def outcome(case: int, /, *, suspect: bool = False) -> Outcome:
            nonlocal run
            try:
                parts = study.starts(case)
            except LiaisonsError as error:  # a value that does not fit never will
                return Failure(str(error), refused=True)
            try:
                if suspect:
                    isolated = replace(study.simulation, parts={name: part.apart() for name, part in parts.items()})
                    with Run(isolated, folders) as alone:
                        return _kept(study, alone, parts)
                run = run or held.enter_context(Run(study.simulation, folders, again=True))
                kept = _kept(study, run, parts)
                if not run.repeats:
                    run = None
                    held.close()
                return kept
            except Exception as error:  # noqa: BLE001 - whatever it is, the other cases go on
                run = None
                held.close()
                return failure(error)

        yield outcome


def _kept(study: Study, run: Run, parts: Mapping[str, SystemComponent]) -> Kept:
    with collected_warnings() as warned:
        try:
            run.start(parts)
            run.finish()
        except EndedError as ended:
            if run.reached() is None:
                raise
            logger.warning("%s of %.10g s", ended, study.simulation.times[-1])
        return Kept(evaluate(study.keep, run.concluded()), warned.texts)
