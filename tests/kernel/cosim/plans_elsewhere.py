"""``python tests/kernel/cosim/plans_elsewhere.py``: archives of plans in masters that know nothing of us.

Prints a row for each plan and master: what is left at the end of what was wanted, the energy balance there, and how far
the outputs are from those of Jacobi's scheme call by call; our own Jacobi coupling also stops where the plan has knots.
"""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

sys.path.insert(0, str(Path(__file__).parent))

from masters import SWEEPS, compared, elsewhere, jacobi

from liaisons import Plan, plan

MASTERS = ("libcosimpy", "ecospy")


class Wanted(NamedTuple):
    """A plan, and what its end is, by the names of outputs."""

    plan: Callable[[], Plan]
    end: Mapping[str, float]


def _crane() -> Plan:
    end = {"theta": 0, "theta_dot": 0, "pivot_x": 0.5, "pivot_x_dot": 0}
    goal: Any = {"start": {"theta": 0}, "end": end, "duration": 3.0, "minimize": "pivot_x_ddot**2"}
    return plan("Pendulum", ["pivot_x"], length=2.0, **goal)


def _quickest() -> Plan:
    """Three switches, at which the acceleration jumps, on no multiple of a step."""
    end = {"theta": 0, "theta_dot": 0, "pivot_x": 0.5, "pivot_x_dot": 0}
    goal: Any = {"start": {"theta": 0}, "end": end, "duration": (0.1, 10), "minimize": "time"}
    return plan("Pendulum", ["pivot_x"], bounds={"pivot_x_ddot": (-2, 2)}, length=2.0, **goal)


def _satellite() -> Plan:
    goal: Any = {"end": {"attitude": (0, 0, 0, 1)}, "duration": 2.0, "intervals": 20, "accuracy": None}
    return plan("Satellite", ["wheel_1", "wheel_2"], J_xx=10.0, J_yy=10.0, **goal)


def _cat() -> Plan:
    goal: Any = {"start": {"phi": 0}, "end": {"phi": -1.047}, "closed": True, "duration": 0.9}
    return plan("PlanarCat", arm_1=0.25, arm_2=0.25, bounds={"psi_1": (-3, 3), "psi_2": (-3, 3)}, **goal)


PLANS = {
    "crane": Wanted(_crane, {"theta": 0.0, "p_theta": 0.0}),
    "quickest": Wanted(_quickest, {"theta": 0.0, "p_theta": 0.0}),
    "satellite": Wanted(_satellite, {"q_w": 0.0, "q_x": 0.0, "q_y": 0.0}),
    "cat": Wanted(_cat, {"phi": -1.047}),
}


class Outcome(NamedTuple):
    """At the end: rest of the goal, the energy balance [J], what the same calls made here differ by, relatively."""

    missed: float
    balance: float
    difference: float


def ours(found: Plan, end: Mapping[str, float]) -> Outcome:
    """Our Jacobi coupling."""
    system, name = found.system(interpolate=False), found.problem.name
    experiment = system.experiment
    result = system.simulate(experiment.stop_time, experiment.step_size, coupling="jacobi")
    values = {".".join(place): float(result[".".join(place)][-1]) for place in compared(system)}
    missed = max(abs(values[f"{name}.{output}"] - value) for output, value in end.items())
    return Outcome(missed, float(result[f"{name}.energy_balance"][-1]), 0.0)


def theirs(master: str, found: Plan, end: Mapping[str, float], folder: Path) -> Outcome:
    """Another master."""
    system, balance = found.system(interpolate=False), (found.problem.name, "energy_balance")
    experiment = system.experiment
    assert experiment.stop_time is not None
    assert experiment.step_size is not None
    steps = round(experiment.stop_time / experiment.step_size)
    values = elsewhere(master, system, folder, size=experiment.step_size, steps=steps, also=[balance])
    sweeps = SWEEPS[master](len(system.parts))
    expected = jacobi(system, folder, size=experiment.step_size, steps=steps, sweeps=sweeps)
    missed = max(abs(values[f"{found.problem.name}.{output}"] - value) for output, value in end.items())
    return Outcome(
        missed, values[".".join(balance)], max(abs(values[n] - v) / max(1.0, abs(v)) for n, v in expected.items())
    )


if __name__ == "__main__":
    print("| plan | master | misses the goal by | energy balance [J] | differs from the same calls |")  # noqa: T201
    print("|---|---|---:|---:|---:|")  # noqa: T201
    for title, wanted in PLANS.items():
        motion = wanted.plan()
        rows = {"liaisons": ours(motion, wanted.end)}
        with tempfile.TemporaryDirectory() as scratch:
            for other in MASTERS:
                rows[other] = theirs(other, motion, wanted.end, Path(scratch))
        for other, row in rows.items():
            print(f"| {title} | {other} | {' | '.join(f'{np.abs(value):.1e}' for value in row)} |")  # noqa: T201
