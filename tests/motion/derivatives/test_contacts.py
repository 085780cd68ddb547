"""Derivatives through impacts, sticking, slipping and release: against closed forms, which mpmath differentiates."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from itertools import pairwise
from typing import Any

import casadi as ca
import mpmath
import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.interpolate import PPoly

import liaisons_motion.jax
from liaisons import (
    ActiveCoordinate,
    Coordinate,
    Gravity,
    Mechanism,
    Parameter,
    System,
    dry_friction,
    gradient,
    identify,
    sensitivities,
    unilateral,
)
from liaisons.errors import SimulationError
from liaisons.models import BouncingBall, DryOscillator
from liaisons_motion.derivatives import Motion, motion_of

mp = mpmath.mp.clone()
mp.dps = 40


def slopes(function: Callable[..., Any], at: Mapping[str, float], by: str) -> float:
    """Derivative of a function of keywords."""
    return float(mp.diff(lambda x: function(**{**at, by: x}), at[by]))


# ---- one ball on a table

BALL = {"height_0": 1.0, "bounce": 0.8, "gravity": 9.81}


def impacts(count: int, *, height_0: Any, bounce: Any, gravity: Any) -> Any:
    """Instant of an impact [s], the first one being number 0."""
    return mp.sqrt(2 * height_0 / gravity) * (1 + 2 * sum((bounce**j for j in range(1, count + 1)), mp.mpf(0)))


def height(t: float, count: int, **at: Any) -> Any:
    """Height after so many impacts [m]."""
    if count == 0:
        return at["height_0"] - at["gravity"] / 2 * mp.mpf(t) ** 2
    since = t - impacts(count - 1, **at)
    return (at["bounce"] ** count * mp.sqrt(2 * at["height_0"] * at["gravity"]) - at["gravity"] / 2 * since) * since


@pytest.fixture(scope="module")
def flights() -> tuple[NDArray, list[int]]:
    """Times in the first ten flights, a microsecond from the impacts and between, and the number of the flight."""
    ends = [0.0, *(float(impacts(i, **BALL)) for i in range(10))]
    pairs = [(x, n) for n, (a, b) in enumerate(pairwise(ends)) for x in (a + 1e-6, (a + b) / 2, b - 1e-6)]
    return np.array([x for x, _ in pairs]), [n for _, n in pairs]


@pytest.mark.parametrize("by", BALL)
def test_heights_of_a_ball_also_within_a_microsecond_of_its_impacts(flights, by: str) -> None:
    times, counts = flights
    s = sensitivities("BouncingBall", list(BALL), times=times, record="height", start_values=BALL)
    assert s.method == "steps"
    exact = [slopes(lambda t=t, n=n, **at: height(t, n, **at), BALL, by) for t, n in zip(times, counts, strict=True)]
    np.testing.assert_allclose(s.derivative("height", by), exact, rtol=1e-9, atol=1e-9)
    assert not s.signals.warnings


def test_what_a_ball_loses_until_it_rests_and_behind() -> None:
    """The rest of infinitely many bounces is summed; a ball at rest has lost all."""
    s = sensitivities("BouncingBall", ["height_0", "bounce"], times=[4.0, 4.5], record=["height", "impact_loss"])
    np.testing.assert_allclose(s.derivative("impact_loss", "height_0")[-1], 9.81, rtol=1e-11)
    np.testing.assert_allclose(s.derivative("impact_loss", "bounce")[-1], 0, rtol=0, atol=1e-9)
    assert np.abs(s.derivatives[s.signals.names.index("height"), -1]).max() < 1e-12


def test_an_impact_at_a_recorded_time_has_two_derivatives() -> None:
    options: Any = {"by": ["height_0", "mass"], "times": [0.2, float(impacts(0, **BALL)), 1.0], "record": "height"}
    s = sensitivities("BouncingBall", **options)
    assert np.isnan(s.derivative("height", "height_0")).tolist() == [False, True, False]
    assert np.isfinite(s.derivative("height", "mass")).all()  # the instant does not depend on it
    (text,) = s.signals.warnings
    assert text.startswith(
        "BouncingBall: t = 0.451523641 s: two branches of the motion meet: derivatives by height_0 are"
    )
    assert np.isnan(gradient("BouncingBall", lambda m: m["height"][1], **options)["height_0"])
    later = gradient("BouncingBall", lambda m: m["height"][2], **options)["height_0"]
    assert later == pytest.approx(s.derivative("height", "height_0")[2], rel=1e-14)


def test_a_start_at_rest_alone() -> None:
    """On the table, which carries the weight."""
    s = sensitivities("BouncingBall", ["mass", "height_0"], times=[0.0], record=["gap_force", "height"], height_0=0.0)
    assert s["gap_force"] == pytest.approx([9.81])
    assert s.derivative("gap_force", "mass") == pytest.approx([9.81])
    assert np.isnan(s.derivative("height", "height_0")).all()  # above it is in the air, below it is nowhere


# ---- a table that moves

LIFT = PPoly(np.array([[-1.0], [2.0], [0.0]]), [0, 2.0])
"""1 - (t - 1)²: it stands still at 1 s, at a height of 1 m."""


@pytest.mark.parametrize("off", [1e-3, -1e-3])
def test_a_table_that_is_met_or_missed(off: float) -> None:
    """Without weight, the ball is met at 1 - δ, δ = √(1 - h), by 2δ; then h' = (1 + e) 2δ."""
    s = sensitivities(
        "BouncingBall",
        "height_0",
        times=[0.9, 1.5],
        record="height",
        inputs={"table": LIFT},
        height_0=1 + off,
        gravity=0.0,
    )

    def struck(h: Any) -> Any:
        early = mp.sqrt(1 - h)
        return h + mp.mpf(3.6) * early * (mp.mpf(0.5) + early)

    expected = [1, 1 if off > 0 else slopes(struck, {"h": 1 + off}, "h")]
    np.testing.assert_allclose(s.derivative("height", "height_0"), expected, rtol=1e-9)


def test_a_table_that_is_grazed_has_no_derivative() -> None:
    options: Any = {"times": [0.9, 1.5], "record": "height", "inputs": {"table": LIFT}, "height_0": 1.0, "gravity": 0.0}
    s = sensitivities("BouncingBall", ["height_0", "bounce"], **options)
    assert np.isnan(s.derivative("height", "height_0")).tolist() == [False, True]
    assert s.derivative("height", "bounce").tolist() == [0, 0]
    (text,) = s.signals.warnings
    begin, _, rest = text.partition(" s: ")
    assert float(begin.removeprefix("BouncingBall: t = ")) == pytest.approx(1, abs=1e-6)
    assert rest == "a contact is grazed: derivatives by height_0 are not-a-number from here on"
    assert np.isnan(gradient("BouncingBall", lambda m: m["height"][1], ["height_0"], **options)["height_0"])


def test_a_table_that_strikes_a_ball_at_rest() -> None:
    """Struck by a rate v at t_0, h = (1 + e) v τ - g τ²/2, τ = t - t_0, until it is back."""
    start = {"table.rate": 0.7, "table.start_time": 1.0, "bounce": 0.8, "height_0": 0.0}
    by = ["table.rate", "table.start_time", "bounce"]
    s = sensitivities(
        "BouncingBall", by, times=[0.5, 1.1], record="height", operators={"table": "Ramp"}, start_values=start
    )

    def struck(bounce: Any, **at: Any) -> Any:
        since = mp.mpf(1.1) - at["table.start_time"]
        return (1 + bounce) * at["table.rate"] * since - mp.mpf(9.81) / 2 * since**2

    for name in by:
        np.testing.assert_allclose(
            s.derivative("height", name), [0, slopes(struck, start, name)], rtol=1e-11, atol=1e-13
        )


def test_what_a_table_does_not_touch_when_it_jumps() -> None:
    """It jumps from under the ball, which falls: h = -g (t - 1)²/2."""
    down = PPoly(np.array([[0.0, -0.5]]), [0, 1.0, 2.0])
    s = sensitivities(
        "BouncingBall", "gravity", times=[0.5, 0.9, 1.2], record="height", inputs={"table": down}, height_0=0.0
    )
    np.testing.assert_allclose(s.derivative("height", "gravity"), [0, 0, -0.02], rtol=1e-11, atol=1e-13)
    up = PPoly(np.array([[0.0, 0.5]]), [0, 1.0, 2.0])
    with pytest.raises(SimulationError, match=r"gap = -0\.5 at t = 1: bodies overlap"):
        sensitivities("BouncingBall", "gravity", times=[1.2], record="height", inputs={"table": up}, height_0=0.0)


def test_a_table_that_begins_to_rise_strikes_what_lies_on_it() -> None:
    """From 1 s on at 0.5 m/s: e/2 faster than the table it leaves, back after e/g, and e²/2 faster it leaves again."""
    rise = PPoly(np.array([[0.0, 0.5], [0.0, 0.0]]), [0, 1.0, 3.0])
    at, times = {"bounce": 0.6, "gravity": 9.81}, [0.9, 1.05, 1.09]
    s = sensitivities(
        "BouncingBall",
        list(at),
        times=times,
        record="height",
        inputs={"table": rise},
        height_0=0.0,
        start_values=at,
    )
    np.testing.assert_allclose(s["height"][:2], [0, 0.04 - 9.81 / 800], rtol=1e-11, atol=1e-13)

    def height_above(t: float, *, bounce: Any, gravity: Any) -> Any:
        rate, since = bounce / 2, mp.mpf(t) - 1
        if since > bounce / gravity:
            rate, since = bounce**2 / 2, since - bounce / gravity
        return (mp.mpf(t) - 1) / 2 + rate * since - gravity / 2 * since**2

    for by in at:
        exact = [slopes(lambda t=t, **x: height_above(t, **x), at, by) for t in times[1:]]
        np.testing.assert_allclose(s.derivative("height", by), [0, *exact], rtol=1e-9, atol=1e-13)


# ---- dry friction

BELT = {"mu_static": 0.3, "mu_sliding": 0.2, "belt_dot": 0.2, "x_0": 0.0, "x_dot_0": 0.2}


def stick_slip(*, mu_static: Any, mu_sliding: Any, belt_dot: Any, **_: Any) -> Any:
    """Its period [s], for m = 1 and k = 10."""
    reach, omega = (mu_static - mu_sliding) * mp.mpf(9.81) / 10, mp.sqrt(10)
    return 2 * reach / belt_dot + 2 / omega * (mp.pi - mp.atan(reach * omega / belt_dot))


@pytest.mark.parametrize("by", ["mu_static", "mu_sliding"])
def test_the_period_of_stick_slip(by: str) -> None:
    """While it sticks for the n-th time, x = c - δ + v (t - t_n): derivatives differ by -v ∂(t_n - t_m)."""
    period, first = float(stick_slip(**BELT)), (0.3 * 0.981 / 0.2)
    times = first + period * np.arange(1, 9) - 0.05
    s = sensitivities("DryOscillator", by, times=times, record=["x", "slip_sticks"], start_values=BELT)
    assert (s["slip_sticks"] == 1).all()
    found = -np.diff(s.derivative("x", by)) / BELT["belt_dot"]
    np.testing.assert_allclose(found, slopes(stick_slip, BELT, by), rtol=1e-9)


def test_friction_that_brakes_a_swing_to_rest() -> None:
    """Half swings about ± c, c = μ m g/k: x = (x_0 - (2n + 1) c) cos ωt + (-1)^n c; at rest after five."""
    times = np.array([0.4, 1.3, 2.4, 8.0])
    s = sensitivities("DryOscillator", ["x_0", "mu_sliding"], times=times, record="x", mu_static=0.1, mu_sliding=0.1)

    def position(t: float, swing: int, x_0: Any, mu_sliding: Any) -> Any:
        c, omega = mu_sliding * mp.mpf(9.81) / 10, mp.sqrt(10)
        if swing < 0:  # at rest, after five
            return -(x_0 - 10 * c)
        return (x_0 - (2 * swing + 1) * c) * mp.cos(omega * t) + (-1) ** swing * c

    at = {"x_0": 1.0, "mu_sliding": 0.1}
    for by in at:
        exact = [
            slopes(lambda t=t, n=n, **x: position(t, n, **x), at, by) for t, n in zip(times, (0, 1, 2, -1), strict=True)
        ]
        np.testing.assert_allclose(s.derivative("x", by), exact, rtol=1e-8, atol=1e-9)


# ---- a rope, and balls on a line


def test_a_rope_that_goes_slack_and_taut() -> None:
    """From the lowest point at v the string goes slack at ψ, at the speed u: p_x = -m u sin ψ, until the tug."""
    at = {"x_dot_0": float(np.sqrt(3.5 * 9.81)), "gravity": 9.81, "mass": 1.3}
    start = at | {"x_0": 0.0, "z_0": -1.0}
    s = sensitivities(
        "StringPendulum", list(at), times=[0.7, 0.8, 1.5], record=["p_x", "impact_loss"], start_values=start
    )

    def momentum(*, x_dot_0: Any, gravity: Any, mass: Any) -> Any:
        sine = (x_dot_0**2 - 2 * gravity) / (3 * gravity)
        return -mass * mp.sqrt(gravity * sine) * sine

    def lost(*, x_dot_0: Any, gravity: Any, mass: Any) -> Any:
        psi = mp.asin((x_dot_0**2 - 2 * gravity) / (3 * gravity))
        radial = 3 * mp.cos(psi) * mp.sin(3 * psi) - mp.sin(psi) * mp.cos(3 * psi)
        return mass / 2 * gravity * mp.sin(psi) * radial**2

    for by in at:
        np.testing.assert_allclose(s.derivative("p_x", by)[1], slopes(momentum, at, by), rtol=1e-9)
        np.testing.assert_allclose(s.derivative("impact_loss", by)[[0, 2]], [0, slopes(lost, at, by)], rtol=1e-9)


def test_three_balls_that_strike_one_after_the_other() -> None:
    at = {"bounce": 0.6, "x_dot_0[1]": 1.0, "mass[1]": 1.0, "mass[2]": 2.0, "mass[3]": 0.5, "x_0[3]": 1.5}
    s = sensitivities("BallRow", list(at), times=[1.0, 3.0], record="x", start_values=at | {"x_0[2]": 1.0})

    def last(t: float, bounce: Any, **row: Any) -> Any:
        """Position of the third ball: 0.9 m and 0.5 m apart, less a diameter."""
        a, b, c = (row[f"mass[{i}]"] for i in (1, 2, 3))
        middle = (1 + bounce) * a / (a + b) * row["x_dot_0[1]"]
        struck = mp.mpf(0.9) / row["x_dot_0[1]"] + (row["x_0[3]"] - mp.mpf(1.1)) / middle
        return row["x_0[3]"] + (t - struck) * (1 + bounce) * b / (b + c) * middle

    for by in at:
        np.testing.assert_allclose(s.derivative("x[3]", by)[1], slopes(lambda **x: last(3.0, **x), at, by), rtol=1e-9)


def test_balls_that_touch_are_struck_as_one() -> None:
    """Moreau's rule: they leave at (1 + e) m_1 v/M.  What moves them apart has no derivative."""
    at = {"bounce": 0.6, "x_dot_0[1]": 1.0, "mass[1]": 1.0, "mass[2]": 2.0, "mass[3]": 0.5}
    by = [*at, "x_0[1]", "x_0[3]"]
    s = sensitivities("BallRow", by, times=[0.5, 3.0], record="x", start_values=at)

    def position(bounce: Any, **row: Any) -> Any:
        total, v = row["mass[1]"] + row["mass[2]"] + row["mass[3]"], row["x_dot_0[1]"]
        return 1 + (3 - mp.mpf(0.9) / v) * (1 + bounce) * row["mass[1]"] / total * v

    for name in at:
        np.testing.assert_allclose(s.derivative("x[2]", name)[1], slopes(position, at, name), rtol=1e-9)
        np.testing.assert_allclose(s.derivative("x[3]", name), s.derivative("x[2]", name), rtol=1e-9, atol=1e-12)
    assert np.isfinite(s.derivative("x[3]", "x_0[1]")).all()
    assert np.isnan(s.derivative("x[3]", "x_0[3]")).all()
    assert "t = 0 s: contacts act in another order or mode" in s.signals.warnings[0]


# ---- redundant contacts


class Bench(Mechanism):
    """Bench that falls flat on three legs, two of them on one side."""

    mass = Parameter(2.0, "kg", "mass", above=0)
    bounce = Parameter(0.5, "1", "coefficient of restitution", minimum=0, maximum=1)
    reach = Parameter(1.3, "m", "half of its length", above=0)
    gravity = Gravity()
    z = Coordinate("m", "height", start=0.3)
    pitch = Coordinate("rad", "angle with the horizontal")

    def kinetic_energy(self) -> ca.SX:
        return self.mass / 2 * (self.dot(self.z) ** 2 + self.reach**2 * self.dot(self.pitch) ** 2 / 4)

    def potential_energy(self) -> ca.SX:
        return self.mass * self.gravity * self.z

    @unilateral("m", "height of the first leg", restitution="bounce")
    def first(self) -> ca.SX:
        return self.z - 0.8 * self.reach * ca.sin(self.pitch)

    @unilateral("m", "height of the second leg", restitution="bounce")
    def second(self) -> ca.SX:
        return self.z + 0.4 * self.reach * ca.sin(self.pitch)

    @unilateral("m", "height of the last leg", restitution="bounce")
    def last(self) -> ca.SX:
        return self.z + self.reach * ca.sin(self.pitch)


def test_legs_share_impulses_and_forces() -> None:
    """Forces and impulses are C (Cᵀ C)⁻¹ (their sum, 0), of the shortest length."""
    legs = ["first", "second", "last"]
    by = ["mass", "gravity", "z_0"]
    s = sensitivities(
        Bench, by, times=[0.3, 3.0], record=[f"{leg}_{end}" for leg in legs for end in ("impulse", "force")]
    )
    C = np.column_stack([np.ones(3), [-0.8, 0.4, 1.0]])
    shares = C @ np.linalg.solve(C.T @ C, [1, 0])
    fall = 1.5 * 2.0 * np.sqrt(2 * 9.81 * 0.3)
    for leg, share in zip(legs, shares, strict=True):
        expected = [share * fall / x for x in (2.0, 2 * 9.81, 2 * 0.3)]
        got = [s.derivative(f"{leg}_impulse", name)[0] for name in by]
        np.testing.assert_allclose(got, expected, rtol=1e-10)
        got = [s.derivative(f"{leg}_force", name)[1] for name in by]
        np.testing.assert_allclose(got, [share * 9.81, share * 2.0, 0], rtol=1e-10, atol=1e-10)
    assert not s.signals.warnings


# ---- both modes, and the doors


class ThrownBox(Mechanism):
    """Box on a spring, thrown onto a slope that moves along: it bounces, slides, sticks and slides back."""

    mass = Parameter(2.0, "kg", "mass", above=0)
    bounce = Parameter(0.5, "1", "coefficient of restitution", minimum=0, maximum=1)
    grip = Parameter(0.3, "1", "coefficient of static friction", minimum=0)
    drag = Parameter(0.25, "1", "coefficient of sliding friction", minimum=0)
    stiffness = Parameter(3.0, "N/m", "stiffness of the spring", above=0)
    gravity = Gravity()
    x = Coordinate("m", "position of the box")
    z = Coordinate("m", "height of the box", start=0.3)
    belt = ActiveCoordinate("m", "way of the slope")

    def kinetic_energy(self) -> ca.SX:
        return self.mass / 2 * self.speed_squared({"x": self.x, "z": self.z})

    def potential_energy(self) -> ca.SX:
        return self.mass * self.gravity * self.z + self.stiffness / 2 * self.x**2

    @unilateral("m", "distance of box and slope", restitution="bounce")
    def gap(self) -> ca.SX:
        return self.z - 0.1 * self.x

    @dry_friction("m/s", "sliding of the box", static="grip", sliding="drag", normal="gap")
    def slip(self) -> ca.SX:
        return self.dot(self.x - self.belt)


class SlidBox(Mechanism):
    """Box that falls onto a floor, and rubs on it while it is thrown back."""

    mass = Parameter(2.0, "kg", "mass", above=0)
    bounce = Parameter(0.5, "1", "coefficient of restitution", minimum=0, maximum=1)
    drag = Parameter(0.2, "1", "coefficient of friction", minimum=0)
    gravity = Gravity()
    x = Coordinate("m", "position of the box")
    z = Coordinate("m", "height of the box", start=0.3)

    def kinetic_energy(self) -> ca.SX:
        return self.mass / 2 * self.speed_squared({"x": self.x, "z": self.z})

    def potential_energy(self) -> ca.SX:
        return self.mass * self.gravity * self.z

    @unilateral("m", "distance of box and floor", restitution="bounce")
    def gap(self) -> ca.SX:
        return self.z

    @dry_friction("m/s", "sliding of the box", static="drag", sliding="drag", normal="gap")
    def slip(self) -> ca.SX:
        return self.dot(self.x)


def test_friction_brakes_by_the_impulse_of_an_impact() -> None:
    """By μ (1 + e) g τ at the instant τ; before and behind it nothing does."""
    at, times = {"drag": 0.2, "bounce": 0.5, "z_0": 0.3, "x_dot_0": 3.0}, [0.2, 0.4]
    s = sensitivities(SlidBox, list(at), times=times, record="x", start_values=at)

    def position(t: float, *, drag: Any, bounce: Any, z_0: Any, x_dot_0: Any) -> Any:
        struck = mp.sqrt(2 * z_0 / mp.mpf(9.81))
        braked = drag * (1 + bounce) * mp.mpf(9.81) * struck
        return x_dot_0 * t - (braked * (t - struck) if t > struck else 0)

    for by in at:
        exact = [slopes(lambda t=t, **x: position(t, **x), at, by) for t in times]
        np.testing.assert_allclose(s.derivative("x", by), exact, rtol=1e-10, atol=1e-12)


THROWN = {"bounce": 0.5, "grip": 0.3, "drag": 0.25, "mass": 2.0, "x_dot_0": 1.0, "z_0": 0.3}
SWUNG = {"mu_static": 0.3, "mu_sliding": 0.2, "belt_dot": 0.2, "x_0": -0.1}
ROWS = {"mass": (1.0, 2.0, 0.5), "x_0": (0.1, 1.0, 1.5), "x_dot_0": (1.0, 0.1, 0.2)}
SHAKEN = {"height_0": 0.3, "bounce": 0.5, "table.amplitude": 0.02, "table.angular_frequency": 15.0}
ROLLED = {f"{name}[{i}]": x for name, row in ROWS.items() for i, x in enumerate(row, 1)} | {"bounce": 0.6}
"""More values than are differentiated at once."""
MOTIONS: dict[str, tuple[Any, dict[str, float], dict[str, Any]]] = {
    "bounces that end": ("BouncingBall", BALL, {"record": ["height", "impact_loss", "gap_impulse", "energy"]}),
    "a table that moves": ("BouncingBall", SHAKEN, {"operators": {"table": "Sinusoid"}, "record": ["height", "work"]}),
    "stick-slip": ("DryOscillator", SWUNG, {"record": ["x", "x_dot", "dissipated"]}),
    "a thrown box": (ThrownBox, THROWN, {"record": ["x", "z", "impact_loss"], "start_values": {"belt_dot": 0.5}}),
    "balls": ("BallRow", ROLLED, {"record": ["x"]}),
}


QUICK = {"bounces that end", "stick-slip", "balls"}


@pytest.fixture(
    scope="module", params=[pytest.param(name, marks=() if name in QUICK else pytest.mark.slow) for name in MOTIONS]
)
def motion(request: pytest.FixtureRequest) -> Motion:
    subject, values, options = MOTIONS[request.param]
    starts = {**options.get("start_values", {}), **values}
    return motion_of(subject, list(values), np.linspace(0.0, 5.0, 37), **{**options, "start_values": starts})


def test_forward_is_adjoint(motion) -> None:
    signals, derivatives = motion.forward(motion.values)
    weights = np.random.default_rng(5).normal(size=signals.shape)
    _, backwards = motion.adjoint(motion.values, weights)
    terms = weights[..., None] * derivatives
    np.testing.assert_allclose(backwards, terms.sum(axis=(0, 1)), rtol=0, atol=1e-12 * np.abs(terms).sum())


def test_differences_agree(motion) -> None:
    _, derivatives = motion.forward(motion.values)
    for i, value in enumerate(motion.values):
        move = 1e-6 * value * np.eye(len(motion.values))[i]
        difference = (motion(motion.values + move) - motion(motion.values - move)) / (2e-6 * value)
        size = 1 + np.abs(derivatives[:, :, i]).max()
        np.testing.assert_allclose(difference, derivatives[:, :, i], rtol=0, atol=1e-5 * size)


def test_a_system_is_differentiated_as_its_parts_in_one() -> None:
    system = System("lift")
    ball = system.add("ball", "BouncingBall", height_0=0.3, bounce=0.5)
    lift = system.add("lift", "Sinusoid", amplitude=0.02, angular_frequency=15.0)
    system.connect(lift["y"], ball["table"])
    times, names = [0.5, 1.0, 2.0], ("height", "impact_loss")
    by = {"ball.height_0": "height_0", "lift.amplitude": "table.amplitude"}
    whole = sensitivities(system, list(by), times=times, record=[f"ball.{name}" for name in names])
    options: Any = {"operators": {"table": "Sinusoid"}, "start_values": SHAKEN}
    part = sensitivities("BouncingBall", list(by.values()), times=times, record=names, **options)
    assert whole.method == "steps"
    np.testing.assert_allclose(whole.derivatives, part.derivatives, rtol=1e-12, atol=1e-12)


@pytest.mark.parametrize(
    ("subject", "signal", "values", "others"),
    [
        ("BouncingBall", "height", {"bounce": 0.83, "height_0": 1.0}, {}),
        ("DryOscillator", "x", {"mu_static": 0.3, "mu_sliding": 0.2}, {"belt_dot": 0.2, "x_0": 0.0, "x_dot_0": 0.2}),
    ],
)
def test_fits_go_through_impacts_and_stick_slip(subject: str, signal: str, values: Any, others: Any) -> None:
    """Values from noisy heights of bounces, and from stick-slip, within four of their standard deviations."""
    times = np.linspace(0.03, 2.5, 60)
    closed_form = {"BouncingBall": BouncingBall, "DryOscillator": DryOscillator}[subject].exact
    noise = 1e-3 * np.random.default_rng(0).normal(size=len(times))
    data = {"time": times, signal: closed_form(times, **values, **others)[signal] + noise}
    near = {name: 1.03 * value for name, value in values.items()}
    fit = identify(subject, data, unknown=list(values), noise=1e-3, start_values=near | others, start_time=0.0)
    for (name, value), deviation in zip(values.items(), np.sqrt(np.diag(fit.covariance)), strict=True):
        assert abs(fit.values[name] - value) < 4 * deviation < 0.01


def test_jax_has_the_same() -> None:
    jax = pytest.importorskip("jax")
    with jax.enable_x64(True):
        ball = liaisons_motion.jax.motion("BouncingBall", [0.3, 1.0, 2.0], record="height")
        found = jax.grad(lambda x: (ball(x)["height"] ** 2).sum())(BALL)
    expected = gradient(
        "BouncingBall",
        lambda m: ca.sumsqr(m["height"]),
        list(BALL),
        times=[0.3, 1.0, 2.0],
        record="height",
        start_values=BALL,
    )
    for name in BALL:
        assert float(found[name]) == pytest.approx(expected[name], rel=1e-12)
