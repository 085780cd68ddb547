"""``liaisons plan``: a goal in, files and verdicts out."""

from __future__ import annotations

import pytest

from liaisons import System
from liaisons.check import verdict
from liaisons_motion.planning import Plan

GOAL = """
mechanism = "Pendulum"
moves = ["pivot_x"]
start = { theta = 0 }
end = { theta = 0, theta_dot = 0, pivot_x = 0.5, pivot_x_dot = 0 }
duration = 3.0
minimize = "pivot_x_ddot**2"
intervals = 12
values = { length = 2.0 }
"""


@pytest.mark.variants(core=0)
def test_a_goal_becomes_plan_figure_motion_system_and_verdicts(runs, tmp_path) -> None:
    (tmp_path / "crane.toml").write_text(GOAL)
    said = runs("plan", "crane.toml", "--output", "found")
    assert "FAIL" not in said
    assert "the Hamiltonian is constant" in said
    for kind in ("json", "png", "gif", "ssp"):
        assert (tmp_path / "found" / f"crane.{kind}").stat().st_size > 1000
    motion, system = Plan.load(tmp_path / "found/crane.json"), System.from_ssp(tmp_path / "found/crane.ssp")
    assert said.startswith(f"{motion!r}"[1:-1])
    assert system.experiment == motion.system(interpolate=False).experiment  # for masters that step all at once


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ("durations = 3.0", "unknown key 'durations'; did you mean 'duration'?"),
        ("duration = ", "Invalid value"),
        ("intervals = 3", "duration is missing"),
        ('duration = 1.0\nminimize = "theta_dott**2"', "did you mean 'theta_dot'?"),
    ],
)
def test_what_a_goal_lacks_is_said_in_a_line(liaisons, tmp_path, line: str, words: str) -> None:
    (tmp_path / "goal.toml").write_text(f'mechanism = "Pendulum"\n{line}\n')
    reply = liaisons("plan", "goal.toml")
    assert reply.status == 2
    assert words in reply.err
    assert reply.err.count("\n") == 1


@pytest.mark.variants(core=0)
def test_a_verdict_that_fails_is_the_exit_status(liaisons, tmp_path, monkeypatch) -> None:
    (tmp_path / "crane.toml").write_text(GOAL)
    monkeypatch.setattr(Plan, "verify", lambda _: [verdict("it holds", error=1.0, tolerance=0.5)])
    reply = liaisons("plan", "crane.toml")
    assert reply.status == 1
    assert "FAIL" in reply.out
