"""The archive of a plan in masters that know nothing of us: the goal is reached, with the numbers of our coupling."""

from __future__ import annotations

from pathlib import Path

import pytest
from plans_elsewhere import MASTERS, PLANS, ours, theirs


@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=[pytest.mark.slow] * (name in {"satellite", "cat"})) for name in PLANS]
)
@pytest.mark.variants(core=0)
def test_a_plan_is_performed_by_other_masters(
    name: str, tmp_path: Path, shared_folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("LIAISONS_FMUS", str(shared_folder))
    found = PLANS[name].plan()
    own = ours(found, PLANS[name].end)
    # Ours stops at knots and divides the steps that follow, in the middle of which accelerations are off by H.
    assert own.missed < 1e-7
    for master in MASTERS:
        outcome = theirs(master, found, PLANS[name].end, tmp_path)
        # all step at once: of third order, (T/4000)³ = 4e-10 at T = 3 s; kinks do not count
        assert outcome.missed < 1e-9
        assert abs(outcome.balance) < 1e-9  # tolerance of the solvers, and rounding of what is summed up
        # the very same calls; only the times are sums of steps there, and products here
        assert outcome.difference < 1e-12
