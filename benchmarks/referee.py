"""Who moves a joint rightly? Twelve tasks by engines and ways: errors of motion, force and work, and time.

    python benchmarks/referee.py [--quick]

Each task has a closed form, or a reference by Lagrange's equations from SymPy, which is held against a second method
and its energy account (``referee/tasks``).  Each way takes the best of its grid of settings at each step
(``referee/engines``).  Errors are the largest at 40 instants, relative to the largest value.  Times are ratios to our
FMU through FMPy with the same step in the same round, and include reading the force at each step.  What stands in
``results/referee`` is kept: take a file away to measure that engine again.  Engines that are not installed are said.
"""

from __future__ import annotations

import json
import math
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
from _measure import HERE, Row, command, number, quartiles

ENGINES = ("ours", "mujoco", "pinocchio", "newton", "drake", "exudyn", "rumoca", "pythonfmu3")
ASKED = {"motion": 1e-10, "force": 1e-9, "work": 1e-9}  # of ours


def measure(quick: bool, plots: Path) -> list[Row]:
    folder = plots / "referee"
    folder.mkdir(exist_ok=True)
    cells: dict[str, dict[str, dict[str, Any]]] = {}  # of ways and tasks
    for engine in ENGINES:
        words = [sys.executable, "-m", "referee.run", engine, str(folder), *["--quick"] * quick]
        subprocess.run(words, cwd=HERE, check=False)
        path = folder / f"{engine}.json"
        for task, found in json.loads(path.read_text(encoding="utf-8")).items() if path.exists() else ():
            for cell in found:
                cells.setdefault(f"{cell['engine']}: {cell['way']}", {})[task] = cell
    tasks = next(iter(cells.values()))
    for task in tasks:
        _plot(task, [column[task] for column in cells.values() if task in column], plots)
    (plots / "referee_errors.md").write_text(_tables(cells, [*tasks]), encoding="utf-8")
    if not (folder / "public.json").exists():
        subprocess.run([sys.executable, "-m", "referee.public", str(folder)], cwd=HERE, check=False)
    if (folder / "public.json").exists():
        (plots / "referee_public.md").write_text(_public(folder / "public.json"), encoding="utf-8")
    references = json.loads((folder / "references.json").read_text(encoding="utf-8"))
    rows = [
        Row("References, relative", f"{task}: {name}", value, "")
        for task, kept in references.items()
        for name, value in kept["checks"].items()
    ]
    return rows + [row for task in tasks for column in cells.values() if task in column for row in _rows(column[task])]


def _rows(cell: dict[str, Any]) -> list[Row]:
    task, case, points = cell["task"], f"{cell['engine']}: {cell['way']}", cell["points"]
    if not points:
        return [Row(task, case, math.nan, "", remark=cell["refused"])]
    last, ours = points[-1], cell["engine"] == "liaisons"
    low, high = quartiles(last["ratios"]) or (last["ratios"][0],) * 2
    words = [f"{name} {_error(error)}" for name, error in zip(ASKED, last["errors"], strict=True)][1:]
    words += [
        f"{1e3 * last['step']:g} ms",
        f"{number(np.median(last['ratios']))} × time ({number(low)} .. {number(high)})",
    ]
    words += [f"{name} {value}" for name, value in last["setting"].items()] + [f"page {cell['page']}"]
    rows = [Row(task, case, last["errors"][0], "", remark=", ".join(words))]
    if not ours:
        return rows
    return [
        Row(
            task,
            f"{case}, {kind}",
            error,
            "",
            asked=f"<= {ASKED[kind]:g}",
            remark=", ".join(words) * (kind == "motion"),
        )
        for kind, error in zip(ASKED, last["errors"], strict=True)
    ]


def _error(value: float | None) -> str:
    return (
        "–"
        if value is None
        else "> 1000"
        if value > 1e3
        else f"{value:.0e}".replace("e-0", "e-").replace("e+00", "").replace("e+0", "e")
    )


def _tables(cells: dict[str, dict[str, dict[str, Any]]], tasks: list[str]) -> str:
    """Motion and force by way and task, at the smallest step; time as a ratio, the median of tasks."""
    text = ""
    for k, kind in enumerate([*ASKED][:2]):
        lines = [[f"error of {kind}", *tasks, "time"], ["---"] * (len(tasks) + 2)]
        for way, column in cells.items():
            points = [cell["points"][-1] for cell in column.values() if cell["points"]]
            ratios = [float(np.median(point["ratios"])) for point in points]
            time = number(round(float(np.median(ratios)), 1)) if ratios else "–"
            if spread := quartiles(ratios):
                time += f" ({spread[0]:.1f} .. {spread[1]:.1f})"
            lines.append([way, *(_cell(column.get(task), k) for task in tasks), time])
        text += "\n".join(f"| {' | '.join(line)} |" for line in lines) + "\n\n"
    return text


def _public(path: Path) -> str:
    """Motion / force by file and way."""
    found = json.loads(path.read_text(encoding="utf-8"))
    lines = [["file", *next(iter(found.values()))], ["---"] * 6]
    for name, row in found.items():
        cells = [
            " / ".join(_error(None if math.isnan(e) else e) for e in said)
            if isinstance(said, list)
            else str(said or "no root joint")
            for said in row.values()
        ]
        lines.append([f"{name}.xml", *cells])
    return "\n".join(f"| {' | '.join(line[:6])} |" for line in lines) + "\n"


def _cell(cell: dict[str, Any] | None, kind: int) -> str:
    if cell is None:
        return "not measured"
    return _error(cell["points"][-1]["errors"][kind]) if cell["points"] else cell["refused"]


def _plot(task: str, cells: Sequence[dict[str, Any]], folder: Path) -> None:
    figure, axes = plt.subplots(1, 3, figsize=(13, 4), sharex=True, layout="constrained")
    for axis in axes:
        axis.set_prop_cycle(color=list(plt.colormaps["tab20"](range(20))))
    for cell in cells:
        times = [point["seconds"] for point in cell["points"]]
        for k, axis in enumerate(axes):
            errors = [np.clip(np.nan if (e := p["errors"][k]) is None else e, 1e-16, 1e3) for p in cell["points"]]
            label = f"{cell['engine']}: {cell['way']}" if k == 0 and times else None
            axis.loglog(times, errors, "o-" if cell["engine"] == "liaisons" else ".-", label=label, linewidth=0.8)
    for kind, axis in zip(ASKED, axes, strict=True):
        axis.set(title=f"{task}: {kind}", xlabel="processor time [s]", ylabel="error, relative")
    figure.legend(loc="outside right center", fontsize="small")
    figure.savefig(folder / f"referee_{task.replace(' ', '_')}.png", dpi=80)
    plt.close(figure)


if __name__ == "__main__":
    command(measure)
