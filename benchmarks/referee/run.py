"""All tasks by the ways of one engine, written after each task, so that a run goes on where it was stopped.

cd benchmarks && python -m referee.run ENGINE FOLDER [--quick]
"""

from __future__ import annotations

import json
import sys
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np

from referee.engines import ours
from referee.task import Answer, Task
from referee.tasks import TASKS
from referee.way import CannotError, Run, Way

ROUNDS = 3  # at the smallest step


def main(engine: str, folder: str, *options: str) -> None:
    path, quick = Path(folder) / f"{engine}.json", "--quick" in options
    try:
        ways: Sequence[Way] = import_module(f"referee.engines.{engine}{'' if engine == 'ours' else '_ways'}").WAYS
    except ImportError as error:
        raise SystemExit(f"without {engine}: {error}") from None
    found = json.loads(path.read_text(encoding="utf-8")) if path.exists() else {}
    for task in TASKS[2:3] if quick else TASKS:
        kept = {cell["way"]: cell for cell in found.get(task.name, ())}
        if missing := [way for way in ways if way.name not in kept]:
            reference = _reference(task, Path(folder) / "references.json")
            kept |= {way.name: cell(task, way, reference, quick=quick) for way in missing}
            found[task.name] = [kept[way.name] for way in ways]
            path.write_text(json.dumps(found, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")
            print(f"{engine}: {task.name}", file=sys.stderr, flush=True)


def cell(task: Task, way: Way, reference: Answer, *, quick: bool) -> dict[str, Any]:
    """A task by a way: the best of its grid at each step, or why there is none."""
    points, refused = [], ""
    for step in way.steps[: 1 if quick else None]:
        found: list[tuple[Run, Mapping[str, Any]]] = []
        for setting in way.settings:
            try:
                found.append((way.run(task, step, **setting), setting))
            except CannotError as error:
                refused = str(error)
        if not found:
            break
        (best, setting), refused = min(found, key=lambda run: run[0].answer.errors(reference)[0] or 0.0), ""
        seconds, beside = [best.seconds], [ours.by_fmpy(task, step).seconds]
        for _ in range(ROUNDS - 1 if step == way.steps[-1] else 0):
            seconds.append(way.run(task, step, **setting).seconds)
            beside.append(ours.by_fmpy(task, step).seconds)
        ratios = [a / b for a, b in zip(seconds, beside, strict=True)]
        errors = best.answer.errors(reference)
        points.append({"step": step, "setting": setting, "errors": errors, "seconds": seconds[0], "ratios": ratios})
    return {
        "task": task.name,
        "engine": way.engine,
        "way": way.name,
        "page": way.page,
        "refused": refused,
        "points": points,
    }


def _reference(task: Task, path: Path) -> Answer:
    """The answer, kept with its checks."""
    kept = json.loads(path.read_text(encoding="utf-8")) if path.exists() else {}
    if task.name not in kept:
        answer = asdict(task.answer(task.times))
        kept[task.name] = {name: values.tolist() for name, values in answer.items()} | {"checks": task.checks()}
        path.write_text(json.dumps(kept) + "\n", encoding="utf-8")
    return Answer(*(np.array(kept[task.name][name]) for name in ("motion", "force", "work")))


if __name__ == "__main__":
    main(*sys.argv[1:])
