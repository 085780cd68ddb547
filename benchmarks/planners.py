"""The crane and the satellite beside other planners: time, error of the least cost, and what a user writes.

    python benchmarks/planners.py [--quick]

Each file in ``planners/`` is what a user writes who has nothing but the package, without blanks and docstrings: **ours
begin with energies, those of the others with equations of motion derived by hand**, which have to be right, and with
a guess.  Rockit collocates as we do, at five Legendre points an interval; its controls are splines of fourth order,
with which it did best.  dymos has Radau points of fifth order, and of OpenMDAO's optimizers SLSQP, since no wheel
brings it IPOPT: it is given few intervals, and the crane only, since on the satellite SLSQP comes to its limit of
iterations 5 % above the least cost.  opty is left out: cyipopt, which it needs, has no wheel and builds only where
IPOPT is installed.  Times are processor times of all that is done after importing: equations, transcription,
derivatives, solution.
"""

from __future__ import annotations

import importlib
import sys
import tempfile
import time
from collections.abc import Callable
from contextlib import chdir
from functools import partial
from importlib.util import find_spec
from pathlib import Path

from _measure import HERE, Row, command, interleaved
from plans import PROBLEMS, Problem

FOLDER = HERE / "planners"
NAMES = {"crane": "crane, least ∫ a²", "satellite": "satellite, half a turn by two wheels"}
TOOLS = {"liaisons": (10, 20), "rockit": (10, 20), "dymos": (4,)}
"""Intervals that each is given."""


def measure(quick: bool, plots: Path) -> list[Row]:  # noqa: ARG001 - no diagram
    sys.path.insert(0, str(FOLDER))
    rows = []
    for name, of in NAMES.items():
        problem = next(problem for problem in PROBLEMS if problem.name == of)
        rows += _rows(name, _least(problem), 1 if quick else 3)
    return rows


def _least(problem: Problem) -> float:
    return problem.reference(problem.planned())


def _rows(name: str, least: float, rounds: int) -> list[Row]:
    there = [tool for tool in TOOLS if find_spec(tool) and (FOLDER / f"{name}_{tool}.py").exists()]
    costs: dict[str, float] = {}
    runs: dict[str, Callable[[], float]] = {}
    titles = {f"{tool}, {n} intervals": (tool, n) for tool in there for n in TOOLS[tool]}
    for title, (tool, n) in titles.items():
        solve = importlib.import_module(f"{name}_{tool}").solve
        runs[title] = partial(_seconds, title, solve, n, costs)
    times = interleaved(runs, rounds)
    yardstick = next(iter(titles))
    rows = []
    for title, values in times.items():
        lines = _lines(FOLDER / f"{name}_{titles[title][0]}.py")
        remark = f"error {abs(costs[title] / least - 1):.0e}, {lines} lines"
        beside = None if title == yardstick else times[yardstick]
        reference = "" if beside is None else yardstick
        rows.append(Row.of(NAMES[name], title, values, "s", yardstick=reference, beside=beside, remark=remark))
    return rows


def _seconds(title: str, solve: Callable[[int], float], intervals: int, costs: dict[str, float]) -> float:
    with tempfile.TemporaryDirectory() as folder, chdir(folder):  # dymos leaves reports behind
        begin = time.process_time()
        costs[title] = solve(intervals)
        return time.process_time() - begin


def _lines(path: Path) -> int:
    """Lines of code; docstrings and comments take whole lines there."""
    lines = map(str.strip, path.read_text(encoding="utf-8").splitlines())
    return sum(bool(line) and not line.startswith(('"""', "#")) for line in lines)


if __name__ == "__main__":
    command(measure)
