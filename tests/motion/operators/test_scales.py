"""Plans in other units: mass, length or time a thousand times as large or as small, and the same motion is found."""

from __future__ import annotations

from functools import cache
from math import cos, pi, sin
from typing import Any, NamedTuple

import numpy as np
import pytest

from liaisons import Plan, plan

from .conftest import SCALES, Scale, parameters, scaled, size, sizes, times

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


@cache
def planned(name: str, scale: Scale) -> Plan:
    """The plan of a problem in units that make its numbers so much larger."""
    mechanism, moves, _, duration, goal = PROBLEMS[name]
    of = sizes(mechanism, scale)
    values = {key: value for key, value in goal.items() if key in of}
    whole: dict[str, Any] = {"duration": times(duration, scale[2]), "intervals": 10, "accuracy": None, "tries": 1}
    whole |= {key: scaled(value, of) if isinstance(value, dict) else value for key, value in goal.items()}
    whole |= parameters(mechanism, scale, values, moves or of)
    return plan(mechanism, moves, **whole)


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
