"""Cases one after the other in one process, whose FMUs are loaded and instantiated once.

An FMU that cannot be reset is instantiated again for every case, and so are all FMUs after a failure.  A case over
which a process has died is simulated with isolated FMUs, so that the one that crashes is named.
"""

from __future__ import annotations

import logging
import tempfile
from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import TypeAlias

from liaisons.base.logs import collected_warnings, logger
from liaisons.cosim import Run, SystemDocument
from liaisons.errors import EndedError, LiaisonsError
from liaisons_tools.sweeps.measures import evaluate_measures
from liaisons_tools.sweeps.study import Completed, Failure, Outcome, Study, failure_of

Task: TypeAlias = tuple[Study, Mapping[Path, Path], str]
"""The sweep, the folder of each extracted FMU, and a folder for temporary files."""


SimulateCase: TypeAlias = Callable[[int, bool], Outcome]
"""(case, whether to isolate its FMUs) -> its outcome."""


@contextmanager
def case_simulator(task: Task) -> Iterator[SimulateCase]:
    """Context of a function that simulates one case, with FMUs that are loaded once.

    The process may be killed at any time.
    """
    study, folders, tempfile.tempdir = task
    logger.logger.propagate = False  # warnings go with the case
    logger.logger.addHandler(logging.NullHandler())
    with ExitStack() as stack:
        run: Run | None = None

        def outcome(case: int, suspect: bool) -> Outcome:
            nonlocal run
            try:
                document = study.case_document(case)
            except LiaisonsError as error:  # an invalid start value stays invalid
                return Failure(str(error), refused=True)
            try:
                if suspect:
                    isolated = study.simulation.with_parts({n: p.isolated_copy() for n, p in document.parts.items()})
                    with Run(isolated, folders) as alone:
                        return _simulate_case(study, alone, document)
                run = run or stack.enter_context(Run(study.simulation, folders, again=True))
                completed: Outcome = _simulate_case(study, run, document)
                if run.repeats:
                    return completed
            except Exception as error:  # noqa: BLE001 - whatever it is, the other cases go on
                completed = failure_of(error)
            run = None
            stack.close()
            return completed

        yield outcome


def _simulate_case(study: Study, run: Run, case: SystemDocument) -> Completed:
    """Measures and warnings of a case, simulated in a run that exists."""
    with collected_warnings() as warned:
        try:
            run.start(case.parts)
            run.finish()
        except EndedError as ended:
            if run.reached() is None:
                raise
            logger.warning("%s of %.10g s", ended, study.simulation.times[-1])
        return Completed(evaluate_measures(study.keep, run.conclude()), warned.texts)
