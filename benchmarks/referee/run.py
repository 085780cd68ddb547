"""All tasks by the ways of one engine, written after each task, so that a run goes on where it was stopped.

cd benchmarks && python -m referee.run ENGINE FOLDER [--quick]
"""

from __future__ import annotations

import json
import sys
from importlib import import_module
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np

from referee.engines import ours_ways
from referee.task import Answer, Task
from referee.tasks import TASKS
from referee.way import CannotError, Way

ROUNDS = 3  # at the smallest step


def main(engine: str, folder: str, *options: str) -> None:
    try:
        module = import_module(f"referee.engines.{engine}_ways")
    except ImportError as error:
        raise SystemExit(f"{engine} is not installed: {error}") from None
    path, quick = Path(folder) / f"{engine}.json", "--quick" in options
    found = read(path)
    for task in TASKS[2:3] if quick else getattr(module, "TASKS", TASKS):
        if task.name not in found:
            exact = _reference(task, path.with_name("references.json"))
            found[task.name] = [cell(task, way, exact, quick=quick) for way in module.WAYS]
            write(path, found)
            print(f"{engine}: {task.name}", file=sys.stderr, flush=True)


def read(path: Path) -> dict[str, Any]:
    return json.loads(path.read_text(encoding="utf-8")) if path.exists() else {}


def write(path: Path, found: dict[str, Any], indent: int | None = 1) -> None:
    path.write_text(json.dumps(found, indent=indent, ensure_ascii=False) + "\n", encoding="utf-8")


def cell(task: Task, way: Way, exact: Answer, *, quick: bool) -> dict[str, Any]:
    """A task by a way: the best of its grid at each step, or why there is none."""
    points, refused = [], ""
    for step in way.steps[: 1 if quick else None]:
        tried = []
        for values in product(*way.grid.values()):
            setting = dict(zip(way.grid, values, strict=True))
            try:
                answer, seconds = way.run(task, step, **setting)
                tried.append({"setting": setting, "errors": answer.errors(exact), "seconds": seconds})
            except CannotError as error:
                refused = str(error)
        if not tried:
            break
        best, refused = min(tried, key=lambda point: point["errors"][0]), ""
        rounds = 0 if task.file else ROUNDS if step == way.steps[-1] else 1
        again = (way.run(task, step, **best["setting"])[1] if k else best["seconds"] for k in range(rounds))
        ratios = [seconds / ours_ways.by_fmpy(task, step)[1] for seconds in again]
        points.append({"step": step, **best, "ratios": ratios})
    said = {"task": task.name, "engine": way.engine, "way": way.name, "page": way.page}
    return said | {"refused": refused, "points": points}


def _reference(task: Task, path: Path) -> Answer:
    """The answer, kept with its checks."""
    kept = read(path)
    if task.name not in kept:
        answer, checks = task.reference(task.times)
        kept[task.name] = {name: values.tolist() for name, values in answer._asdict().items()} | {"checks": checks}
        write(path, kept, indent=None)
    return Answer(*(np.array(kept[task.name][name]) for name in Answer._fields))


if __name__ == "__main__":
    main(*sys.argv[1:])
