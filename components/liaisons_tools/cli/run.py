"""``liaisons run``: scenarios and their verdicts."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from liaisons.base.project import ProjectError, relative_to_working_directory
from liaisons.errors import suggestion
from liaisons.scenario_files import scenario_files, scenario_themes
from liaisons_tools.cli._command import command, flag, option, print_scenarios, print_table
from liaisons_tools.cli._texts import requested_scenarios


@command("""
    liaisons run pumped_swing
    liaisons run
    liaisons run --theme contacts
    liaisons run --all
    liaisons run K122                                   those that verify equation 122 of Kneller
    liaisons run my_scenario.py --figures /tmp
""")
def run(
    context: typer.Context,
    targets: Annotated[
        list[str] | None,
        typer.Argument(
            metavar="NAME|NUMBER|FILE.py",
            autocompletion=lambda: list(scenario_files()),
            help="scenarios of this project, files, or numbers of the two texts (default: list the scenarios by theme)",
        ),
    ] = None,
    *,
    theme: Annotated[
        str | None,
        option("NAME", "run all scenarios of a theme", autocompletion=lambda: list(scenario_themes())),
    ] = None,
    every: Annotated[bool, flag("--all", "run every scenario of this project")] = False,
    figures: Annotated[
        Path | None,
        option(
            "DIR",
            "folder for figures (default: figures/ next to the scenario, or here for scenarios of the package)",
        ),
    ] = None,
) -> int:
    """Run scenarios: simulate, compare with closed forms, and draw.

    Without a name, list the scenarios by theme.  The exit status is 1 if a claim fails.
    """
    from liaisons_tools.scenarios import execute, load

    themes = scenario_themes()
    if theme not in (None, *themes):
        raise ProjectError(f"no theme is called {theme!r}{suggestion(theme, themes)}")
    named = [name for target in targets or () for name in requested_scenarios(target)]
    chosen = [*named, *(scenario_files() if every else themes[theme][1] if theme else ())]
    if not chosen:
        print_scenarios()
        return 0
    outcomes = []
    for scenario in [load(target) for target in chosen]:
        print(f"{scenario.name}: {scenario.claim}", flush=True)
        outcome = execute(scenario, figures, debug=context.obj)
        print(
            f"error: {outcome.error}" if outcome.error else f"figure: {relative_to_working_directory(outcome.figure)}",
            flush=True,
        )
        outcomes.append(outcome)
    print()
    print_table(row for outcome in outcomes for row in outcome.rows())
    return 0 if all(outcome.passed for outcome in outcomes) else 1
