"""Derivatives of motions against those of closed forms with 40 digits."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from typing import Any, NamedTuple

import mpmath as mp
import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.interpolate import PPoly

from liaisons_motion.derivatives import subjects as motions

DIGITS = 40
DIFFERENCE = mp.mpf("1e-13")  # truncation 1e-26 of a third derivative, rounding 1e-40/1e-13


class Values(dict[str, Any]):
    """Numbers of 40 digits by name: ``at["theta_0"]``."""

    def __missing__(self, name: str) -> Any:
        return mp.mpf(0)


Motion = Callable[[Any, Values], dict[str, Any]]
"""Time and values -> signals by name."""


class Case(NamedTuple):
    """A motion with a closed form; all of its values are varied but those in ``fixed``."""

    component: str
    motion: Motion
    values: Mapping[str, float]
    stop_time: float
    fixed: Mapping[str, float] = {}
    operators: Mapping[str, str] = {}
    inputs: Mapping[str, PPoly] = {}

    def motion_at(self, times: NDArray[np.float64]) -> motions.Motion:
        """What is tested, at steps as fine as they get."""
        return motions.motion_of(
            self.component,
            [*self.values],
            times,
            record=[*self.motion(mp.mpf(0), exact_values(self))],
            operators=self.operators,
            inputs=self.inputs,
            start_values={**self.values, **self.fixed},
            tolerance=1e-13,
        )


# ---- closed forms ----------------------------------------------------------------------------------------------------


def pendulum(t: Any, at: Values) -> dict[str, Any]:
    """θ'' = -Ω² sin θ by Jacobi's functions, swinging or turning over."""
    omega = mp.sqrt(at["gravity"] / at["length"])
    sine, speed = mp.sin(at["theta_0"] / 2), at["theta_dot_0"] / (2 * omega)
    k = mp.hypot(sine, speed)
    if k < 1:
        u = mp.ellipf(mp.atan2(sine, speed), k**2) + omega * t
        sn, cn = (mp.ellipfun(name, u, m=k**2) for name in ("sn", "cn"))
        return {"theta": 2 * mp.asin(k * sn), "theta_dot": 2 * omega * k * cn}
    m, sign = 1 / k**2, mp.sign(speed)
    u = mp.ellipf(at["theta_0"] / 2, m) + sign * k * omega * t
    sn, cn, dn = (mp.ellipfun(name, u, m=m) for name in ("sn", "cn", "dn"))
    whole = 2 * mp.pi * mp.nint(u / (4 * mp.ellipk(m)))
    return {"theta": 2 * (mp.atan2(sn, cn) + whole), "theta_dot": sign * 2 * omega * k * dn}


def oscillator(t: Any, at: Values) -> dict[str, Any]:
    """x'' + γx' + K/m (x - s) = F/m, s = offset + amplitude · sin(ωt + φ): exponentials."""
    square, gamma, omega = at["stiffness"] / at["mass"], at["damping"], at["support.angular_frequency"]
    constant = at["support.offset"] + at["support"] + at["x_force"] / at["stiffness"]
    phasor = -1j * at["support.amplitude"] * mp.expj(at["support.phase"])  # sin α = Re(-i e^iα)
    phasor *= square / (square - omega**2 + 1j * gamma * omega)
    start = at["x_0"] - constant - mp.re(phasor)
    rate = at["x_dot_0"] - mp.re(1j * omega * phasor)
    root = mp.sqrt(mp.mpc(gamma**2 / 4 - square))
    first, second = -gamma / 2 + root, -gamma / 2 - root
    a = (rate - second * start) / (first - second)
    forced = phasor * mp.expj(omega * t)
    terms = a * mp.exp(first * t), (start - a) * mp.exp(second * t), forced
    x = mp.re(mp.fsum(terms)) + constant
    return {"x": x, "x_dot": mp.re(terms[0] * first + terms[1] * second + 1j * omega * forced)}


FORCE, FULL = 0.5, 3.0
"""How fast a force grows [N/s], and until when [s]."""


def pushed(t: Any, at: Values) -> dict[str, Any]:
    """Beside it a force that grows evenly and then stays: two ramps."""
    square, gamma = at["stiffness"] / at["mass"], at["damping"]
    root = mp.sqrt(mp.mpc(gamma**2 / 4 - square))
    first, second = -gamma / 2 + root, -gamma / 2 - root
    a = (-1 / square - second * gamma / square**2) / (first - second)
    b = gamma / square**2 - a

    def ramp(t: Any) -> Any:
        """z and z' of z'' + γz' + Ω²z = t, from rest."""
        terms = a * mp.exp(first * t), b * mp.exp(second * t)
        z = t / square - gamma / square**2 + mp.re(mp.fsum(terms))
        return mp.matrix([z, 1 / square + mp.re(first * terms[0] + second * terms[1])])

    free = oscillator(t, at)
    forced = FORCE / at["mass"] * (ramp(t) - (ramp(t - FULL) if t > FULL else 0 * ramp(t)))
    return {"x": free["x"] + forced[0], "x_dot": free["x_dot"] + forced[1]}


def lengthening(t: Any, at: Values) -> dict[str, Any]:
    """Without weight l² θ' is constant; l = offset + rate · max(t - start_time, 0)."""
    offset, since = at["length.offset"], max(t - at["length.start_time"], mp.mpf(0))
    length = offset + at["length.rate"] * since
    turned = at["theta_dot_0"] * (min(t, at["length.start_time"]) + offset * since / length)
    return {"theta": at["theta_0"] + turned, "theta_dot": at["theta_dot_0"] * (offset / length) ** 2}


def jerked(t: Any, at: Values) -> dict[str, Any]:
    """Without weight θ' is constant but where the pivot starts to move: p_θ = m l² θ' + m l x_p' cos θ stays."""
    before, at_start = at["theta_dot_0"], at["pivot_x.start_time"]
    angle = at["theta_0"] + before * at_start
    after = before - at["pivot_x.rate"] * mp.cos(angle) / at["length"]
    if t < at_start:
        return {"theta": at["theta_0"] + before * t, "theta_dot": before}
    return {"theta": angle + after * (t - at_start), "theta_dot": after}


CASES = {
    "pendulum, ten large swings": Case("Pendulum", pendulum, {"theta_0": 2.0, "gravity": 9.81, "length": 1.0}, 29.0),
    "pendulum, pushed": Case(
        "Pendulum",
        pendulum,
        {"theta_0": -0.4, "theta_dot_0": 1.7, "gravity": 3.0, "length": 1.3, "mass": 2.0},
        20.0,
    ),
    "pendulum, turning over": Case(
        "Pendulum", pendulum, {"theta_0": 0.5, "theta_dot_0": -8.0, "gravity": 9.81, "length": 0.9}, 10.0
    ),
    "oscillator, loaded": Case(
        "Oscillator",
        oscillator,
        {"mass": 1.5, "stiffness": 4.0, "damping": 0.3, "x_0": 1.0, "x_dot_0": -0.5, "support": 0.2, "x_force": 0.7},
        20.0,
    ),
    "oscillator, over-damped": Case(
        "Oscillator",
        oscillator,
        {"mass": 0.8, "stiffness": 2.0, "damping": 6.0, "x_0": 0.4, "x_dot_0": 3.0},
        10.0,
    ),
    "oscillator, its support shaken": Case(
        "Oscillator",
        oscillator,
        {
            "mass": 1.0,
            "stiffness": 3.0,
            "damping": 0.2,
            "x_0": 0.3,
            "x_dot_0": 0.1,
            "support.amplitude": 0.4,
            "support.angular_frequency": 1.9,
            "support.phase": 0.6,
            "support.offset": -0.2,
        },
        20.0,
        operators={"support": "Sinusoid"},
    ),
    "oscillator, a force with a kink": Case(
        "Oscillator",
        pushed,
        {"mass": 1.2, "stiffness": 3.0, "damping": 0.4, "x_0": -0.3, "x_dot_0": 0.6},
        12.0,
        inputs={"x_force": PPoly([[FORCE, 0.0], [0.0, FORCE * FULL]], [0.0, FULL, 12.0])},
    ),
    "length that grows, weightless": Case(
        "Pendulum",
        lengthening,
        {"theta_0": 0.2, "theta_dot_0": 1.5, "length.offset": 1.2, "length.rate": 0.3, "length.start_time": 0.437},
        5.0,
        {"gravity": 0.0},
        {"length": "Ramp"},
    ),
    "pivot that starts at once, weightless": Case(
        "Pendulum",
        jerked,
        {"theta_0": 0.2, "theta_dot_0": 1.5, "length": 1.4, "pivot_x.rate": 0.6, "pivot_x.start_time": 1.234},
        5.0,
        {"gravity": 0.0},
        {"pivot_x": "Ramp"},
    ),
}


@pytest.fixture(params=CASES)
def case(request: pytest.FixtureRequest) -> Case:
    return CASES[request.param]


@pytest.fixture(autouse=True)
def digits() -> Iterator[None]:
    with mp.workdps(DIGITS + 5):
        yield


def exact_values(case: Case) -> Values:
    return Values({name: mp.mpf(value) for name, value in {**case.values, **case.fixed}.items()})


def times_of(case: Case, count: int = 25) -> NDArray[np.float64]:
    """Not evenly spaced, none of them at an event."""
    return case.stop_time * np.linspace(0, 1, count) ** 1.1


def slopes(case: Case, times: NDArray[np.float64], name: str) -> dict[str, NDArray[np.float64]]:
    """Derivatives of the signals by one value, by a central difference of 40 digits."""
    at, rows = exact_values(case), []
    for t in times:
        up, down = (case.motion(mp.mpf(t), Values(at, **{name: at[name] + h})) for h in (DIFFERENCE, -DIFFERENCE))
        rows.append({signal: float((up[signal] - down[signal]) / (2 * DIFFERENCE)) for signal in up})
    return {signal: np.array([row[signal] for row in rows]) for signal in rows[0]}


def test_derivatives_are_those_of_the_closed_form(case: Case) -> None:
    times, at = times_of(case), exact_values(case)
    motion = case.motion_at(times)
    assert motion.names == tuple(case.values)
    np.testing.assert_array_equal(motion.values, [*case.values.values()])
    rows, derivatives = motion.forward(motion.values)
    exact = [case.motion(mp.mpf(t), at) for t in times]
    for row, signal in zip(rows, motion.signals, strict=True):
        expected = np.array([float(now[signal]) for now in exact])
        assert np.max(np.abs(row - expected)) <= 1e-10 * np.max(np.abs(expected)), signal
    for j, name in enumerate(motion.names):
        expected = slopes(case, times, name)
        for i, signal in enumerate(motion.signals):
            error = np.max(np.abs(derivatives[i, :, j] - expected[signal]))
            assert error <= 1e-9 * max(np.max(np.abs(expected[signal])), 1e-3), (name, signal)


def test_adjoint_is_the_weighted_sum_of_derivatives_of_the_closed_form(case: Case) -> None:
    times = times_of(case, 7)
    motion = case.motion_at(times)
    weights = np.random.default_rng(5).normal(size=(len(motion.signals), times.size))
    _, gradient = motion.adjoint(motion.values, weights)
    for j, name in enumerate(motion.names):
        expected = slopes(case, times, name)
        terms = [weight * expected[signal] for weight, signal in zip(weights, motion.signals, strict=True)]
        assert abs(gradient[j] - np.sum(terms)) <= 1e-9 * max(np.sum(np.abs(terms)), 1e-3), name


def test_rates_are_those_of_the_closed_form(case: Case) -> None:
    times, at = times_of(case)[1:], exact_values(case)
    motion = case.motion_at(times)
    for row, signal in zip(motion.rates(motion.values), motion.signals, strict=True):
        if f"{signal}_dot" in motion.signals:
            expected = np.array([float(case.motion(mp.mpf(t), at)[f"{signal}_dot"]) for t in times])
            assert np.max(np.abs(row - expected)) <= 1e-9 * np.max(np.abs(expected)), signal
