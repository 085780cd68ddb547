"""Scenarios by name, run one by one: their verdicts, their figure, the time they take."""

from __future__ import annotations

import inspect
import sys
import time
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import final

from liaisons import Verdict
from liaisons.base.arguments import shown
from liaisons.base.project import ProjectError, load_module, relative_to_working_directory
from liaisons.check import table
from liaisons.errors import suggestion
from liaisons.scenario_files import figures_directory, scenario_files
from liaisons_tools.scenarios.claims import Claims
from liaisons_tools.scenarios.drawing import save, save_panel


@final
@dataclass(frozen=True, slots=True)
class Scenario:
    """A scenario that can be run: its name, the claim (first paragraph of its docstring), the file and its ``main``."""

    name: str
    claim: str
    path: Path
    main: Callable[[Claims], None]


@final
@dataclass(frozen=True, slots=True)
class Outcome:
    """Result of a scenario; ``error`` is the reason if it did not finish."""

    scenario: Scenario
    figure: Path
    verdicts: tuple[Verdict, ...]
    seconds: float
    error: str = ""

    @property
    def passed(self) -> bool:
        """Whether the scenario finished and all of its claims hold."""
        return not self.error and all(verdict.passed for verdict in self.verdicts)

    def rows(self) -> list[Mapping[str, str]]:
        """Rows of :func:`report`, one for each verdict; the first one has the name of the scenario and its time."""
        rows = [verdict.row() for verdict in self.verdicts]
        rows += [{"claim": "(see its error)", "verdict": "ERROR"}] if self.error else []
        first = {"scenario": self.scenario.name, "time": f"{self.seconds:.1f} s"}
        columns = ("scenario", "claim", "error", "tolerance", "verdict", "time")
        return [{c: ((first if i == 0 else {}) | row).get(c, "") for c in columns} for i, row in enumerate(rows)]


def names() -> list[str]:
    """Names of the project's scenarios."""
    return list(scenario_files())


def scenario(main: Callable[[Claims], None]) -> Scenario:
    """Decorate the last function of a file: return its scenario, or run it if the file is run as a program.

    :raises ProjectError: if it is no function, something comes after it, or the file has no docstring.
    """
    if not inspect.isfunction(main):
        raise ProjectError(
            f"@scenario: {shown(main)} is no function; decorate main(claim: Claims) at the end of a file"
        )
    path, module = Path(inspect.getfile(main)), sys.modules[main.__module__]
    lines, first = inspect.getsourcelines(main)
    after = path.read_text(encoding="utf-8").splitlines()[first - 1 + len(lines) :]
    if any(after):
        raise ProjectError(f"{path}:{first}: {main.__name__} runs before what comes after it; put it last in the file")
    documentation = inspect.getdoc(module)
    if not documentation:
        raise ProjectError(f"{path} is no scenario: state its claim in the docstring of the file")
    made = Scenario(path.stem, " ".join(documentation.split("\n\n")[0].split()), path, main)
    if main.__module__ == "__main__":
        outcome = execute(made, debug=True)
        print(report([outcome]))
        print(f"figure: {relative_to_working_directory(outcome.figure)}")
        raise SystemExit(0 if outcome.passed else 1)
    return made


def load(target: str) -> Scenario:
    """Load a scenario by its name or by the path of its file.

    :raises ProjectError: for an unknown name, or a file that cannot be loaded or has no scenario.
    """
    files = scenario_files()
    if not target.endswith(".py") and target not in files:
        raise ProjectError(f"no scenario is called {target!r}{suggestion(target, files)}")
    path = Path(target) if target.endswith(".py") else files[target]
    module = load_module(path)
    for value in vars(module).values():
        if isinstance(value, Scenario):
            return replace(value, path=path)
    raise ProjectError(f"{path} is no scenario: put @scenario before its main(claim)")


def execute(
    scenario: Scenario,
    figures: Path | None = None,
    *,
    thumbnail: Path | None = None,
    panel: int = 0,
    debug: bool = False,
) -> Outcome:
    """Run a scenario, write its figure, and return its outcome.

    :param figures: directory for the figure; :func:`liaisons.base.project.figures_directory` unless given.
    :param thumbnail: file for one panel of the figure alone, and ``panel`` its number; None: none is written.
    :param debug: let errors of the scenario through instead of putting them into the outcome.
    """
    import matplotlib.pyplot as plt

    plt.switch_backend("Agg")
    figure = (figures or figures_directory(scenario.path)) / f"{scenario.name}.png"
    figure.parent.mkdir(parents=True, exist_ok=True)
    start, claims = time.perf_counter(), Claims()
    try:
        scenario.main(claims)
        save(figure)
        if thumbnail is not None:
            save_panel(thumbnail, panel)
        reason = "" if claims.verdicts else f"{scenario.path} claims nothing"
    except Exception as error:
        if debug:
            raise
        reason = f"{type(error).__name__}: {error}"
    finally:
        plt.close("all")
    return Outcome(scenario, figure, tuple(claims.verdicts), time.perf_counter() - start, reason)


def report(outcomes: Iterable[Outcome]) -> str:
    """Return a table of all verdicts: scenario, claim, error, tolerance, verdict, time."""
    return table([row for outcome in outcomes for row in outcome.rows()])
