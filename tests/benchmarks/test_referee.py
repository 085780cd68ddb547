"""References of the tasks against a second method and their energy account; what a cell of the tables says."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from referee.run import cell, main
from referee.task import Answer, Task
from referee.tasks import TASKS
from referee.way import CannotError, Run, Way

COUNTS = {"belt": ("pieces", 6), "shaken ball": ("impacts", 6)}
"""How often the belt grips or lets go, or the ball strikes the table."""


@pytest.mark.variants(core=0)
@pytest.mark.parametrize("task", TASKS, ids=lambda task: task.name)
def test_references_agree_with_another_method_and_their_energy(task: Task) -> None:
    assert task.reference is not None
    found = dict(task.reference(task.times)[1])
    if task.name in COUNTS:
        name, at_least = COUNTS[task.name]
        assert found.pop(name) >= at_least
    # Rounding of sums of some thousand steps; a pendulum that is shaken at 50 rad/s takes them up four times.
    assert max(found.values()) < 5e-13


def test_a_cell_has_the_best_of_the_grid_or_says_why_there_is_none() -> None:
    exact = Answer(np.ones((40, 1)), np.ones(40), np.ones(40))

    def run(_task: Task, _step: float, error: float) -> Run:
        if error > 1:
            raise CannotError("too far")
        return Answer(exact.motion + error, exact.force, None), 0.0

    def said(*errors: float) -> dict[str, Any]:
        task = Task("still", 1.0, {}, ["x"], "", file=Path("still.xml"))
        return cell(task, Way("engine", "way", "page", run, {"error": errors}, steps=(1.0,)), exact, quick=False)

    best = said(0.5, 2.0, 0.25, 0.75)
    [point] = best["points"]
    assert (point["setting"], point["errors"], best["refused"]) == ({"error": 0.25}, [0.25, 0.0, None], "")
    none = said(2.0, 3.0)
    assert (none["points"], none["refused"]) == ([], "too far")


def test_an_engine_that_is_not_installed_is_said(tmp_path: Path) -> None:
    with pytest.raises(SystemExit, match=r"^nothing is not installed: No module named"):
        main("nothing", str(tmp_path))
    assert not any(tmp_path.iterdir())
