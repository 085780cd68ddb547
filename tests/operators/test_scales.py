"""Plans in other units: mass, length or time a thousand times as large or as small, and the same motion is found."""

from __future__ import annotations

from functools import cache
from math import cos, pi, prod, sin
from typing import Any, NamedTuple

import numpy as np
import pytest

from liaisons import Plan, plan
from liaisons.library import component, model
from liaisons.units import ANY, powers

Scale = tuple[float, float, float]
"""Of mass, length and time."""
SCALES: list[Scale] = [(1e-3, 1, 1), (1e3, 1, 1), (1, 1e-3, 1), (1, 1e3, 1), (1, 1, 1e-3), (1, 1, 1e3)]
ROUNDING = 1e-8
"""Problems are solved in units of their own numbers, from guesses in these: what differs is rounding, which IPOPT
multiplies by what it leaves, 1e-12, over its smallest step."""


class Problem(NamedTuple):
    """What is planned, and the unit of its cost."""

    mechanism: str
    moves: Any
    cost: str
    duration: Any
    goal: dict[str, Any]


WHEELS = {f"wheel_{k}_dot": 0 for k in (1, 2, 3)}
CAT = {"start": {"phi": 0}, "closed": True, "arm_1": 0.25, "arm_2": 0.25}
AT_REST = {"theta": 0, "theta_dot": 0, "pivot_x": 0.5, "pivot_x_dot": 0}
PROBLEMS = {
    "satellite": Problem(
        "Satellite",
        ["wheel_1", "wheel_2"],
        "kg.m2/s",
        2.0,
        {"end": {"attitude": (cos(0.5), 0, 0, sin(0.5))}, "J_yy": 10.0},
    ),
    "sphere": Problem(
        "Satellite",
        None,
        "kg2.m4/s3",
        2.0,
        {
            "end": {"attitude": (0, 0, 0, 1)} | WHEELS,
            "minimize": "effort",
            **dict.fromkeys(("J_xx", "J_yy", "J_zz"), 1.1),
            "J_wheel": 0.1,
        },
    ),
    "hoop": Problem(
        "CircularHoop",
        ["beta"],
        "1/s3",
        1.0,
        {"start": {"xi": 0.5, "xi_dot": 0}, "end": {"xi": 1.0, "xi_dot": 0}, "minimize": "beta_ddot**2"},
    ),
    "crane": Problem(
        "Pendulum",
        ["pivot_x"],
        "m2/s3",
        3.0,
        {"start": {"theta": 0}, "end": AT_REST, "minimize": "pivot_x_ddot**2", "length": 2.0},
    ),
    "planar cat": Problem("PlanarCat", None, "kg.m2/s", 0.9, {"end": {"phi": -0.7}, **CAT}),
    "spatial cat": Problem(
        "SpatialCat",
        None,
        "kg.m2/s",
        1.0,
        {
            "start": {"bend": (0.3, 2.8)},
            "end": lambda m: [m.q_w, m.azimuth - 2 * pi],
            "closed": ["bend", "twist"],
            "bounds": {"bend": (0.3, 2.8)},
        },
    ),
    "swing": Problem(
        "Pendulum",
        ["length"],
        "",
        (0.5, 3.0),
        {
            "start": {"theta": -0.5, "length": 1.1},
            "end": {"p_theta": 0, "theta": (0.3, 2)},
            "minimize": "-sin(theta)*theta_dot",
            "bounds": {"length": (1.0, 1.1), "length_ddot": (-30, 30)},
            "intervals": 15,
            "accuracy": 1e-8,
        },
    ),
    "time-optimal crane": Problem(
        "Pendulum",
        ["pivot_x"],
        "s",
        (1.0, 5.0),
        {
            "start": {"theta": 0},
            "end": AT_REST,
            "minimize": "time",
            "bounds": {"pivot_x_ddot": (-2, 2)},
            "accuracy": 1e-8,
            "length": 2.0,
        },
    ),
}


SYMMETRIC = {"planar cat", "spatial cat", "satellite"}
"""Of these, motions turned or mirrored cost the same, and rounding decides which is found."""


def times(given: Any, factor: float) -> Any:
    """A number, or several of them, times a factor."""
    return tuple(value * factor for value in given) if isinstance(given, tuple) else given * factor


def size(unit: str, scale: Scale) -> float:
    """By how much a number with a unit is larger."""
    return 1.0 if unit == ANY else prod(factor**power for factor, power in zip(scale, powers(unit)[:3], strict=True))


def sizes(mechanism: str, scale: Scale) -> dict[str, float]:
    """The same of all variables of a mechanism."""
    return {variable.name: size(variable.unit, scale) for variable in model(component(mechanism)).flat().variables}


@cache
def planned(name: str, scale: Scale) -> Plan:
    """The plan of a problem in units that make its numbers so much larger."""
    mechanism, moves, _, duration, goal = PROBLEMS[name]
    of, whole, moved = sizes(mechanism, scale), model(component(mechanism)), moves or ()
    own = {p.name for p in component(mechanism).parameters} | {a.value for a in whole.active if moves} - {*moved}
    values = {v.name: v.starts[0] for v in (*whole.parameters, *whole.inputs) if v.name in own}
    scaled: dict[str, Any] = {"duration": times(duration, scale[2]), "intervals": 10, "accuracy": None, "tries": 1}
    scaled |= {key: value * of[key] for key, value in (values | goal).items() if key in own}
    for key in goal.keys() - own:
        scaled[key] = goal[key]
        if isinstance(goal[key], dict):
            scaled[key] = {variable: times(value, of.get(variable, 1.0)) for variable, value in goal[key].items()}
    return plan(mechanism, moves, **scaled)


@pytest.mark.slow
@pytest.mark.parametrize("name", PROBLEMS)
@pytest.mark.parametrize("scale", SCALES)
def test_a_plan_is_the_same_in_all_units(name: str, scale: Scale) -> None:
    usual, other = planned(name, (1, 1, 1)), planned(name, scale)
    assert usual.solution.succeeded
    assert other.solution.succeeded
    assert other.cost == pytest.approx(usual.cost * size(PROBLEMS[name].cost, scale), rel=ROUNDING)
    assert other.duration == pytest.approx(usual.duration * scale[2], rel=ROUNDING)
    if name in SYMMETRIC:
        return
    of, parts = sizes(PROBLEMS[name].mechanism, scale), np.linspace(0, 1, 8)[1:-1]
    motion = usual.sigma(parts * usual.duration)
    again = other.sigma(parts * other.duration)
    for moved in usual.problem.moves:
        expected = motion[moved] * of[moved]
        np.testing.assert_allclose(again[moved], expected, rtol=0, atol=1e-5 * np.abs(expected).max(), err_msg=moved)
