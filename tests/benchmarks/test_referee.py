"""References of the referee's tasks against a second method and their energy account."""

from __future__ import annotations

import pytest
from referee.task import Task
from referee.tasks import TASKS

COUNTS = {"belt": ("pieces", 6), "shaken ball": ("impacts", 6)}
"""How often the belt grips or lets go, or the ball strikes the table."""


@pytest.mark.variants(core=0)
@pytest.mark.parametrize("task", TASKS, ids=lambda task: task.name)
def test_references_agree_with_another_method_and_their_energy(task: Task) -> None:
    found = dict(task.checks())
    if task.name in COUNTS:
        name, at_least = COUNTS[task.name]
        assert found.pop(name) >= at_least
    # Rounding of sums of some thousand steps; a pendulum that is shaken at 50 rad/s takes them up four times.
    assert max(found.values()) < 5e-13
