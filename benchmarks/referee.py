"""Who moves a joint rightly? Twelve tasks by engines and ways: errors of motion, force and work, and time.

    python benchmarks/referee.py [--quick]

Each task has a closed form, or a reference by equations derived by hand, which is held against a second method and its
energy account (``referee/tasks``).  Each way takes the best of its grid of settings at each step (``referee/engines``).
Errors are the largest at 40 instants, relative to the largest value.  Times are ratios to ``simulate`` with the same
step in the same round, and include reading the force at each step.  Engines that are not installed are left out.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from importlib import import_module
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from _measure import Row, command, number, quartiles
from referee.task import Answer, Task
from referee.tasks import TASKS
from referee.way import CannotError, Run, Way

ENGINES = (
    "ours",
    "mujoco_ways",
    "pinocchio_ways",
    "newton_ways",
    "drake_ways",
    "exudyn_ways",
    "rumoca_ways",
    "pythonfmu3_ways",
)
STEPS, QUICK_STEPS = (4e-3, 2e-3, 1e-3, 5e-4), (4e-3, 2e-3)
ASKED = (1e-10, 1e-9, 1e-9)  # of ours: motion, force, work
KINDS = ("motion", "force", "work")


@dataclass(frozen=True)
class Point:
    """The best of a grid at one step."""

    step: float
    setting: str
    errors: tuple[float, float, float]
    ratios: tuple[float, ...]  # of times


@dataclass(frozen=True)
class Line:
    """A task by one way: a point for each step, or why there is none."""

    task: Task
    way: Way
    points: Sequence[Point]
    refused: str = ""


def measure(quick: bool, plots: Path) -> list[Row]:
    steps, rounds = (QUICK_STEPS, 1) if quick else (STEPS, 3)
    ways = list(_ways())
    rows, lines = [], []
    for task in TASKS:
        rows += [Row("References, relative", f"{task.name}: {name}", float(v), "") for name, v in task.checks().items()]
        reference = task.answer(task.times)
        here = [_line(task, way, reference, steps, rounds) for way in ways]
        _plot(task, here, plots / f"referee_{task.name.replace(' ', '_')}.png")
        lines += here
    (plots / "referee_errors.txt").write_text(_table(lines, ways), encoding="utf-8")
    return rows + [row for line in lines for row in _rows(line)]


def _ways() -> list[Way]:
    found: list[Way] = []
    for name in ENGINES:
        try:
            found += import_module(f"referee.engines.{name}").WAYS
        except ImportError as error:
            print(f"without {name}: {error}", file=sys.stderr)
    return found


@cache
def _yardstick(name: str, step: float, round_: int) -> float:  # noqa: ARG001 - one for each round
    task = next(task for task in TASKS if task.name == name)
    return _ways()[0].run(task, step).seconds


def _line(task: Task, way: Way, reference: Answer, steps: Sequence[float], rounds: int) -> Line:
    points = []
    for step in steps:
        try:
            runs = [(setting, way.run(task, step, **setting)) for setting in way.settings]
        except CannotError as error:
            return Line(task, way, (), str(error))
        setting, best = min(runs, key=lambda run: _badness(run[1], reference))
        seconds = [best.seconds, *(way.run(task, step, **setting).seconds for _ in range(rounds - 1))]
        ratios = tuple(s / _yardstick(task.name, step, k) for k, s in enumerate(seconds))
        words = ", ".join(f"{name} {value}" for name, value in setting.items())
        points.append(Point(step, words, best.answer.errors(reference), ratios))
    return Line(task, way, points)


def _badness(run: Run, reference: Answer) -> float:
    error = run.answer.errors(reference)[0]
    return error if math.isfinite(error) else math.inf


def _rows(line: Line) -> list[Row]:
    case = f"{line.way.engine}: {line.way.name}"
    if not line.points:
        return [Row(line.task.name, case, math.nan, "", remark=line.refused)]
    last = line.points[-1]
    ours = line.way.engine == "liaisons"
    median = float(np.median(last.ratios))
    spread = quartiles(last.ratios) or (median, median)
    remark = f"force {_error(last.errors[1])}, work {_error(last.errors[2])}, {1e3 * last.step:g} ms"
    remark += f", {number(median)} × time of simulate ({number(spread[0])} .. {number(spread[1])})"
    remark += f", {last.setting}" * bool(last.setting)
    rows = [Row(line.task.name, case, last.errors[0], "", asked=f"<= {ASKED[0]:g}" if ours else "", remark=remark)]
    if ours:
        rows += [
            Row(line.task.name, f"{case}, {kind}", error, "", asked=f"<= {bound:g}")
            for kind, error, bound in zip(KINDS[1:], last.errors[1:], ASKED[1:], strict=True)
        ]
    return rows


def _error(value: float) -> str:
    return "not said" if math.isnan(value) else "lost" if value > 1e3 else f"{value:.0e}"


def _table(lines: Sequence[Line], ways: Sequence[Way]) -> str:
    """Task × way at the smallest step: errors of motion, force and work."""
    cells: Mapping[tuple[str, str, str], Line] = {(it.task.name, it.way.engine, it.way.name): it for it in lines}
    head = ["task", *(f"{way.engine}: {way.name}" for way in ways)]
    body = []
    for task in TASKS:
        row = [task.name]
        for way in ways:
            line = cells[task.name, way.engine, way.name]
            row.append(" / ".join(map(_error, line.points[-1].errors)) if line.points else line.refused)
        body.append(row)
    # Ways downwards: a page is not as wide as there are ways.
    table = [list(column) for column in zip(head, *body, strict=True)]
    return "\n".join(f"| {' | '.join(row)} |" for row in [table[0], ["---"] * len(table[0]), *table[1:]]) + "\n"


def _plot(task: Task, lines: Sequence[Line], path: Path) -> None:
    figure, axes = plt.subplots(1, 3, figsize=(13, 4), sharex=True, layout="constrained")
    for line in lines:
        if not line.points:
            continue
        times = [np.median(point.ratios) * _yardstick(task.name, point.step, 0) for point in line.points]
        for k, axis in enumerate(axes):
            errors = [np.clip(point.errors[k], 1e-16, 1e3) for point in line.points]
            label = f"{line.way.engine}: {line.way.name}" if k == 0 else None
            axis.loglog(times, errors, "o-" if line.way.engine == "liaisons" else ".-", label=label, linewidth=0.8)
    for kind, axis in zip(KINDS, axes, strict=True):
        axis.set(title=f"{task.name}: {kind}", xlabel="processor time [s]", ylabel="error, relative")
    figure.legend(loc="outside right center", fontsize="small")
    figure.savefig(path, dpi=80)
    plt.close(figure)


if __name__ == "__main__":
    command(measure)
