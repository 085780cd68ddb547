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
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
from _measure import HERE, Row, command, grid, number

ENGINES = ("ours", "mujoco", "pinocchio", "newton", "drake", "exudyn", "rumoca", "pythonfmu3")
ASKED = {"motion": "<= 1e-10", "force": "<= 1e-09", "work": "<= 1e-09"}  # of ours
Cell = Mapping[str, Any]


def measure(quick: bool, plots: Path) -> list[Row]:
    folder = plots / "referee"
    folder.mkdir(exist_ok=True)
    cells = [cell for engine in ENGINES for cell in _measured(engine, folder, *["--quick"] * quick)]
    public = [] if quick else _measured("public", folder)
    for k, kind in enumerate(ASKED):
        for name, found in (("referee", cells), ("referee_public", public)):
            (plots / f"{name}_{kind}.md").write_text(_table(found, kind, k), encoding="utf-8")
    references = json.loads((folder / "references.json").read_text(encoding="utf-8"))
    rows = [
        Row("References, relative", f"{task}: {name}", value, "")
        for task, kept in references.items()
        for name, value in kept["checks"].items()
    ]
    for task in _tasks(cells):
        found = [cell for cell in cells if cell["task"] == task]
        _plot(task, found, plots)
        rows += [row for cell in found for row in _rows(cell)]
    return rows


def _measured(engine: str, folder: Path, *options: str) -> list[Cell]:
    """Cells of an engine; one without a task if it is not installed."""
    subprocess.run([sys.executable, "-m", "referee.run", engine, str(folder), *options], cwd=HERE, check=False)
    path = folder / f"{engine}.json"
    if not path.exists():
        return [{"task": "", "engine": engine, "way": "any", "points": []}]
    return [cell for cells in json.loads(path.read_text(encoding="utf-8")).values() for cell in cells]


def _case(cell: Cell) -> str:
    return f"{cell['engine']}: {cell['way']}"


def _tasks(cells: Sequence[Cell]) -> list[str]:
    return [*dict.fromkeys(cell["task"] for cell in cells if cell["task"])]


def _rows(cell: Cell) -> Iterable[Row]:
    """Motion, force and work at the smallest step; with the motion, how they were measured."""
    if not cell["points"]:
        yield Row(cell["task"], _case(cell), math.nan, "", remark=cell["refused"])
        return
    last = cell["points"][-1]
    settings = [f"{name} {value}" for name, value in last["setting"].items()]
    how = [f"{1e3 * last['step']:g} ms, {_time(last['ratios'])} × time", *settings, f"page {cell['page']}"]
    for kind, error, remark in zip(ASKED, last["errors"], (", ".join(how), "", ""), strict=True):
        asked = ASKED[kind] if cell["engine"] == "liaisons" else ""
        figure = math.nan if error is None else error
        yield Row(cell["task"], f"{_case(cell)}, {kind}", figure, "", asked=asked, remark=remark)


def _table(cells: Sequence[Cell], kind: str, k: int) -> str:
    """Errors by way and task at the smallest step; time as a ratio, the median of tasks."""
    tasks = _tasks(cells)
    lines = [[f"error of {kind}", *tasks, "time"]]
    for way in dict.fromkeys(map(_case, cells)):
        column = {cell["task"]: cell for cell in cells if _case(cell) == way}
        timed = [cell["points"][-1]["ratios"] for cell in column.values() if cell["points"]]
        found = [_said(column[task], k) if task in column else "not installed" for task in tasks]
        lines.append([way, *found, _time([np.median(ratios) for ratios in timed if ratios])])
    return f"{grid(lines)}\n"


def _time(ratios: Sequence[float]) -> str:
    """Median and quartiles, of two digits."""
    if not ratios:
        return "not timed"
    low, median, high = (number(float(f"{value:.2g}")) for value in np.quantile(ratios, (0.25, 0.5, 0.75)))
    return f"{median} ({low} .. {high})"


def _said(cell: Cell, k: int) -> str:
    if not cell["points"]:
        return cell["refused"]
    error = cell["points"][-1]["errors"][k]
    if error is None:
        return "not given"
    return "> 1000" if error > 1e3 else f"{error:.1g}".replace("e-0", "e-").replace("e+0", "e")


def _plot(task: str, cells: Sequence[Cell], folder: Path) -> None:
    figure, axes = plt.subplots(1, 3, figsize=(13, 4), sharex=True, layout="constrained")
    for k, kind, axis in zip(range(3), ASKED, axes, strict=True):
        axis.set_prop_cycle(color=plt.colormaps["tab20"](range(20)))
        for cell in cells:
            seconds = [point["seconds"] for point in cell["points"]]
            errors = np.array([point["errors"][k] for point in cell["points"]], dtype=float)  # None: nan
            marker = "o-" if cell["engine"] == "liaisons" else ".-"
            axis.loglog(seconds, np.minimum(errors, 1e3), marker, label=_case(cell), linewidth=0.8)
        axis.set(title=f"{task}: {kind}", xlabel="processor time [s]", ylabel="error, relative")
    figure.legend(*axes[0].get_legend_handles_labels(), loc="outside right center", fontsize="small")
    figure.savefig(folder / f"referee_{task.replace(' ', '_')}.png", dpi=80)
    plt.close(figure)


if __name__ == "__main__":
    command(measure)
