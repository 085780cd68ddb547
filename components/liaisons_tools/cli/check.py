"""``liaisons check``: what must hold of every FMU, ours or not, and of a component's equations and closed form."""

from __future__ import annotations

import json
from itertools import chain
from typing import Annotated

import typer

from liaisons.library import fmu_file
from liaisons_tools.cli._command import command, print_verdicts, subject_argument


@command("""
    liaisons check fmus/Pendulum.fmu
    liaisons check fmus/fmi3/Pendulum.fmu
    liaisons check Pendulum
    liaisons check my_component.py --json
""")
def check(
    fmu: Annotated[str, subject_argument("FMU|NAME|FILE.py")],
    *,
    as_json: Annotated[bool, typer.Option("--json", help="print everything as one JSON object, for programs")] = False,
) -> int:
    """Check an FMU; or compare energies, equations, closed form and FMU of a component with each other.

    The exit status is 1 if a check fails.
    """
    from liaisons import Verdict, check_component, check_fmu
    from liaisons_tools.cli._reference_results import reference_verdicts

    verdicts, texts = [], list[str]()
    examination = None if fmu.endswith(".fmu") else check_component(fmu)
    if examination is None or examination.is_loaded:
        path = fmu_file(fmu)
        for report in chain(check_fmu(path), reference_verdicts(path)):
            if isinstance(report, Verdict):
                verdicts.append(report)
            else:
                texts.append(str(report))
    if examination is not None:
        verdicts += examination.verdicts
        texts += [f"not checked: {text}" for text in examination.unchecked]
        texts += [f"a change with which all agrees: {cause}" for cause in examination.causes]
    if as_json:
        whole = {"subject": fmu, "passed": all(one.passed for one in verdicts), "notes": texts}
        rows = [{**one.row(), "reason": one.reason, "passed": one.passed} for one in verdicts]
        component = {} if examination is None else {"component": examination.as_dictionary()}
        print(json.dumps({**whole, "verdicts": rows, **component}, indent=2, ensure_ascii=False))
        return 0 if whole["passed"] else 1
    for text in texts:
        print(text)
    return print_verdicts(verdicts)
