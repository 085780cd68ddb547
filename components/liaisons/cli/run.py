"""``liaisons run``: scenarios and their verdicts."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from liaisons.cli._command import command, option, show
from liaisons.project import ProjectError, from_here, scenario_files


@command("""
    liaisons run pumped_swing
    liaisons run --all
    liaisons run my_scenario.py --figures /tmp
""")
def run(
    context: typer.Context,
    targets: Annotated[
        list[str] | None,
        typer.Argument(
            metavar="NAME|FILE.py",
            autocompletion=lambda: list(scenario_files()),
            help="scenarios of this project, which 'liaisons run' lists, or files",
        ),
    ] = None,
    *,
    every: Annotated[bool, typer.Option("--all", help="run every scenario of this project")] = False,
    figures: Annotated[
        Path | None,
        option(
            "DIR",
            "where figures go (default: figures/ beside the scenario, or here for those that came with the package)",
        ),
    ] = None,
) -> int:
    """Run scenarios: simulate, compare with the closed form, draw.

    Exit status 1 when a claim fails.
    """
    from liaisons.scenarios import execute, load

    chosen = list(scenario_files()) if every else targets
    if not chosen:
        raise ProjectError(f"name a scenario or use --all; known: {', '.join(scenario_files()) or 'none'}")
    outcomes = []
    for scenario in [load(target) for target in chosen]:
        print(f"{scenario.name}: {scenario.claim}", flush=True)
        outcome = execute(scenario, figures, debug=context.obj)
        print(f"error: {outcome.error}" if outcome.error else f"figure: {from_here(outcome.figure)}", flush=True)
        outcomes.append(outcome)
    print()
    show(row for outcome in outcomes for row in outcome.rows())
    return 0 if all(outcome.passed for outcome in outcomes) else 1
