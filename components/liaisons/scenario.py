"""A scenario: a claim in a docstring, FMUs that are simulated, verdicts, one figure.

A scenario is one Python file::

    \"\"\"A pendulum of small amplitude swings with the period 2π√(l/g).\"\"\"

    def main(figure: Path) -> list[Verdict]:
        result = simulate("Pendulum", stop_time=10.0, theta_0=1e-4)
        ...
        return [verdict("period", error=..., tolerance=...)]

    if __name__ == "__main__":
        raise SystemExit(run_scenario(main))

``main`` simulates, draws its figure to the path that it is given, and returns one verdict a claim.
"""

from __future__ import annotations

import inspect
import time
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path

from liaisons.arguments import shown
from liaisons.check import Verdict, table
from liaisons.errors import suggestion
from liaisons.project import ProjectError, figures_directory, from_here, load_module, scenario_files

Main = Callable[[Path], list[Verdict]]


@dataclass(frozen=True, slots=True)
class Scenario:
    """A scenario that can be run: its name, the claim (first paragraph of its docstring), the file and its ``main``."""

    name: str
    claim: str
    path: Path
    main: Main


@dataclass(frozen=True, slots=True)
class Outcome:
    """What a scenario showed; ``error`` says why there are no verdicts."""

    scenario: Scenario
    figure: Path
    verdicts: tuple[Verdict, ...]
    seconds: float
    error: str = ""

    @property
    def passed(self) -> bool:
        """Whether there are verdicts and all of them pass."""
        return bool(self.verdicts) and all(verdict.passed for verdict in self.verdicts)

    def rows(self) -> list[Mapping[str, str]]:
        """One row of the table a verdict; scenario and time stand in the first."""
        rows = [verdict.row() for verdict in self.verdicts] or [{"claim": "(none: see its error)", "verdict": "ERROR"}]
        first = {"scenario": self.scenario.name, "time": f"{self.seconds:.1f} s"}
        columns = ("scenario", "claim", "error", "tolerance", "verdict", "time")
        return [{c: ((first if i == 0 else {}) | row).get(c, "") for c in columns} for i, row in enumerate(rows)]


def names() -> list[str]:
    """Names of the scenarios of this project."""
    return list(scenario_files())


def load(target: str) -> Scenario:
    """A scenario by its name or by the path of its file.

    :raises ProjectError: for an unknown name, a file that cannot be loaded, or one without docstring or ``main``.
    """
    known = scenario_files()
    if not target.endswith(".py") and target not in known:
        raise ProjectError(f"no scenario is called {target!r}{suggestion(target, known)}")
    path = Path(target) if target.endswith(".py") else known[target]
    module = load_module(path)
    main: Main | None = getattr(module, "main", None)
    if not callable(main):
        raise ProjectError(f"{path} is no scenario: define main(figure: Path) -> list[Verdict]")
    return _scenario(main, path, inspect.getdoc(module))


def execute(scenario: Scenario, figures: Path | None = None, *, debug: bool = False) -> Outcome:
    """Run a scenario.

    :param figures: directory for the figure; :func:`liaisons.project.figures_directory` unless given.
    :param debug: let errors of the scenario through instead of putting them into the outcome.
    """
    import matplotlib.pyplot as plt

    plt.switch_backend("Agg")
    figure = (figures or figures_directory(scenario.path)) / f"{scenario.name}.png"
    figure.parent.mkdir(parents=True, exist_ok=True)
    begin = time.perf_counter()
    verdicts: tuple[Verdict, ...] = ()
    reason = "main returned no verdict"
    try:
        verdicts = tuple(scenario.main(figure))
    except Exception as error:
        if debug:
            raise
        reason = f"{type(error).__name__}: {error}"
    finally:
        plt.close("all")
    return Outcome(scenario, figure, verdicts, time.perf_counter() - begin, "" if verdicts else reason)


def report(outcomes: Iterable[Outcome]) -> str:
    """The table that a run ends in: scenario, claim, error, tolerance, verdict, time."""
    return table([row for outcome in outcomes for row in outcome.rows()])


def run_scenario(main: Main) -> int:
    """Run the scenario that this function belongs to and print its verdicts; for ``python scenarios/NAME.py``.

    :returns: 0 if every claim holds, else 1.
    """
    if not inspect.isfunction(main):
        raise ProjectError(f"run_scenario: {shown(main)} is no function; give main(figure: Path) -> list[Verdict]")
    path = Path(inspect.getfile(main))
    outcome = execute(_scenario(main, path, inspect.getdoc(inspect.getmodule(main))), debug=True)
    print(report([outcome]))
    print(f"figure: {from_here(outcome.figure)}")
    return 0 if outcome.passed else 1


def _scenario(main: Main, path: Path, documentation: str | None) -> Scenario:
    if not documentation:
        raise ProjectError(f"{path} is no scenario: state its claim in the docstring of the file")
    claim = " ".join(documentation.split("\n\n")[0].split())
    return Scenario(path.stem, claim, path, main)
