"""Who moves a joint rightly? Twelve tasks by engines and ways: errors of motion, force and work, and time.

    python benchmarks/referee.py [--quick]

Each task has a closed form, or a reference by Lagrange's equations from SymPy, which is held against a second method
and its energy account (``referee/tasks``).  Each way takes the best of its grid of settings at each step
(``referee/engines``).  Errors are the largest at 40 instants, relative to the largest value.  Times are ratios to our
FMU through FMPy with the same step in the same round, and include reading the force at each step.  What stands in
``results/referee`` is kept: take a file away to measure that engine again.
"""

from __future__ import annotations

import json
import math
import subprocess
import sys
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
from _measure import HERE, Row, command, number, quartiles

ENGINES = ("ours", "mujoco", "pinocchio", "newton", "drake", "exudyn", "rumoca", "pythonfmu3")
ASKED = {"motion": "<= 1e-10", "force": "<= 1e-09", "work": "<= 1e-09"}  # of ours
Cell = Mapping[str, Any]


def measure(quick: bool, plots: Path) -> list[Row]:
    folder = plots / "referee"
    folder.mkdir(exist_ok=True)
    ways: dict[str, dict[str, Cell]] = {}
    for engine in ENGINES:
        ways |= _measured(engine, folder, *["--quick"] * quick)
    public = {} if quick else _measured("public", folder)
    for kind in ASKED:
        (plots / f"referee_{kind}.md").write_text(_table(ways, kind), encoding="utf-8")
        (plots / f"referee_public_{kind}.md").write_text(_table(public, kind), encoding="utf-8")
    rows = []
    for task, kept in json.loads((folder / "references.json").read_text(encoding="utf-8")).items():
        rows += [Row("References, relative", f"{task}: {name}", value, "") for name, value in kept["checks"].items()]
    for task in _tasks(ways):
        cells = [column[task] for column in ways.values() if task in column]
        _plot(task, cells, plots)
        rows += [row for cell in cells for row in _rows(cell)]
    return rows


def _measured(engine: str, folder: Path, *options: str) -> dict[str, dict[str, Cell]]:
    """Cells of an engine by way and task."""
    subprocess.run([sys.executable, "-m", "referee.run", engine, str(folder), *options], cwd=HERE, check=False)
    path = folder / f"{engine}.json"
    if not path.exists():
        return {engine: {}}
    ways: dict[str, dict[str, Cell]] = {}
    for task, cells in json.loads(path.read_text(encoding="utf-8")).items():
        for cell in cells:
            ways.setdefault(f"{cell['engine']}: {cell['way']}", {})[task] = cell
    return ways


def _rows(cell: Cell) -> Iterable[Row]:
    """Motion, force and work at the smallest step; with the motion, how they were measured."""
    task, case = cell["task"], f"{cell['engine']}: {cell['way']}"
    if not cell["points"]:
        yield Row(task, case, math.nan, "", remark=cell["refused"])
        return
    last = cell["points"][-1]
    remark = [f"{1e3 * last['step']:g} ms", f"{_time(last['ratios'])} × time"]
    remark += [f"{name} {value}" for name, value in last["setting"].items()]
    remark = ", ".join([*remark, f"page {cell['page']}"])
    for (kind, bound), error in zip(ASKED.items(), last["errors"], strict=True):
        asked = bound if cell["engine"] == "liaisons" else ""
        yield Row(task, f"{case}, {kind}", math.nan if error is None else error, "", asked=asked, remark=remark)
        remark = ""


def _tasks(ways: Mapping[str, Mapping[str, Cell]]) -> list[str]:
    return [*dict.fromkeys(task for column in ways.values() for task in column)]


def _table(ways: Mapping[str, Mapping[str, Cell]], kind: str) -> str:
    """Errors by way and task at the smallest step; time as a ratio, the median of tasks."""
    tasks = _tasks(ways)
    lines = [[f"error of {kind}", *tasks, "time"], ["---"] * (len(tasks) + 2)]
    for way, column in ways.items():
        timed = [cell["points"][-1]["ratios"] for cell in column.values() if cell["points"]]
        ratios = [np.median(found) for found in timed if found]
        found = [_said(column[task], kind) if task in column else "not installed" for task in tasks]
        lines.append([way, *found, _time(ratios)])
    return "".join(f"| {' | '.join(line)} |\n" for line in lines)


def _time(ratios: list[Any]) -> str:
    """Median and quartiles, of two digits."""
    if not ratios:
        return "not timed"
    low, high = quartiles(ratios) or ratios * 2
    median, low, high = (number(float(f"{value:.2g}")) for value in (np.median(ratios), low, high))
    return f"{median} ({low} .. {high})"


def _said(cell: Cell, kind: str) -> str:
    if not cell["points"]:
        return cell["refused"]
    error = cell["points"][-1]["errors"][[*ASKED].index(kind)]
    if error is None:
        return "not given"
    return "> 1000" if error > 1e3 else f"{error:.1g}".replace("e-0", "e-").replace("e+0", "e")


def _plot(task: str, cells: Iterable[Cell], folder: Path) -> None:
    figure, axes = plt.subplots(1, 3, figsize=(13, 4), sharex=True, layout="constrained")
    for k, (kind, axis) in enumerate(zip(ASKED, axes, strict=True)):
        axis.set_prop_cycle(color=plt.colormaps["tab20"](range(20)))
        for cell in cells:
            points = [
                (p["seconds"], math.nan if (e := p["errors"][k]) is None else min(e, 1e3)) for p in cell["points"]
            ]
            marker = "o-" if cell["engine"] == "liaisons" else ".-"
            axis.loglog(
                *np.array(points).reshape(-1, 2).T, marker, label=f"{cell['engine']}: {cell['way']}", linewidth=0.8
            )
        axis.set(title=f"{task}: {kind}", xlabel="processor time [s]", ylabel="error, relative")
    figure.legend(*axes[0].get_legend_handles_labels(), loc="outside right center", fontsize="small")
    figure.savefig(folder / f"referee_{task.replace(' ', '_')}.png", dpi=80)
    plt.close(figure)


if __name__ == "__main__":
    command(measure)
