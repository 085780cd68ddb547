"""``liaisons check``: what must hold of every FMU, ours or not."""

from __future__ import annotations

from itertools import chain
from typing import Annotated

from liaisons.library import fmu_file
from liaisons_tools.cli._command import command, print_verdicts, subject_argument


@command("""
    liaisons check fmus/Pendulum.fmu
    liaisons check fmus/fmi3/Pendulum.fmu
    liaisons check Pendulum
""")
def check(fmu: Annotated[str, subject_argument("FMU|NAME|FILE.py")]) -> int:
    """Check an FMU: validators, and what must hold of its default experiment.

    Exit status 1 when it fails.
    """
    from liaisons import Verdict, check_fmu
    from liaisons_tools.cli._reference_results import reference_verdicts

    verdicts, path = [], fmu_file(fmu)
    for report in chain(check_fmu(path), reference_verdicts(path)):
        if isinstance(report, Verdict):
            verdicts.append(report)
        else:
            print(report)
    return print_verdicts(verdicts)
