"""``liaisons run``: scenarios and their verdicts."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from liaisons.cli._command import command
from liaisons.project import ProjectError, from_here
from liaisons.scenarios import execute, load, names, report

if TYPE_CHECKING:
    from liaisons.cli._command import Commands


def register(commands: Commands) -> None:
    """Add the command."""
    parser = command(
        commands,
        "run",
        _run,
        "run scenarios: simulate, compare with the closed form, draw; exit status 1 when a claim fails",
        "liaisons run pumped_swing\nliaisons run --all\nliaisons run my_scenario.py --figures /tmp",
    )
    parser.add_argument("targets", nargs="*", metavar="NAME|FILE.py", help=f"one of: {', '.join(names())}; or a file")
    parser.add_argument("--all", action="store_true", help="run every scenario of this project")
    parser.add_argument(
        "--figures",
        type=Path,
        metavar="DIR",
        help="where figures go (default: figures/ beside the scenario, or here for those that came with the package)",
    )


def _run(arguments: argparse.Namespace) -> int:
    targets = names() if arguments.all else arguments.targets
    if not targets:
        raise ProjectError(f"name a scenario or use --all; known: {', '.join(names()) or 'none'}")
    outcomes = []
    for scenario in [load(target) for target in targets]:
        print(f"{scenario.name}: {scenario.claim}", flush=True)
        outcome = execute(scenario, arguments.figures, debug=arguments.debug)
        print(f"error: {outcome.error}" if outcome.error else f"figure: {from_here(outcome.figure)}", flush=True)
        outcomes.append(outcome)
    print(f"\n{report(outcomes)}")
    return 0 if all(outcome.passed for outcome in outcomes) else 1
