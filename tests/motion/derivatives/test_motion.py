"""Derivatives of a motion: of the steps that were taken, forward and backwards."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy.interpolate import PPoly

from liaisons import System
from liaisons.errors import ComponentError, SimulationError
from liaisons_motion.derivatives import Motion, motion_of

TIMES = np.linspace(0.0, 4.0, 81)


def _double_pendulum() -> System:
    system = System("double pendulum")
    upper = system.add("upper", "Pendulum", theta_0=1.0)
    lower = system.add("lower", "Pendulum", theta_0=0.5)
    system.connect(upper["bob_x"], lower["pivot_x"])
    system.connect(upper["bob_z"], lower["pivot_z"])
    return system


_RAMP = {"theta_0": 1.0, "length.start_time": 1.31, "length.rate": 0.2, "length.offset": 1.0}
_SMOOTH = {"length.start_time": 1.31, "length.duration": 1.22, "length.start_value": 1.0, "length.end_value": 1.3}
_SINUSOID = {"theta_0": 1.0, "length.offset": 1.3, "length.amplitude": 0.2, "length.angular_frequency": 2.0}
_LINES = PPoly(np.array([[0.1, -0.05], [1.0, 1.1]]), [0.0, 1.0, 4.0])
_PARABOLAS = PPoly(np.array([[0.02, -0.02], [0.1, 0.16], [1.0, 1.195]]), [0.0, 1.5, 4.0])
_BOOKED = ["theta", "p_theta", "work", "energy_balance"]

MOTIONS: dict[str, tuple[Any, dict[str, float], dict[str, Any]]] = {
    "start values and a length at rest": ("Pendulum", {"theta_0": 2.0, "gravity": 9.81, "length": 1.0}, {}),
    "an instant at which a rate jumps": ("Pendulum", _RAMP, {"operators": {"length": "Ramp"}, "record": _BOOKED}),
    "a smooth step": ("Pendulum", {"theta_0": 1.0} | _SMOOTH, {"operators": {"length": "SmoothStep"}}),
    "an oscillating length": ("Pendulum", _SINUSOID, {"operators": {"length": "Sinusoid"}}),
    "a prescribed length": ("Pendulum", {"theta_0": 1.0, "mass": 2.0}, {"inputs": {"length": _PARABOLAS}}),
    "a rate that jumps": (
        "Pendulum",
        {"theta_0": 1.0, "mass": 2.0},
        {"inputs": {"length": _LINES}, "record": _BOOKED},
    ),
    "a length that jumps": (
        "Pendulum",
        {"theta_0": 1.0, "mass": 2.0, "gravity": 9.0},
        {"inputs": {"length": PPoly([[1.0, 1.2]], [0.0, 1.01, 4.0])}, "record": _BOOKED},
    ),
    "two parts": (
        _double_pendulum,
        {"upper.theta_0": 1.0, "lower.mass": 0.7, "lower.length": 1.1},
        {"record": ["lower.theta", "upper.energy"]},
    ),
    "a projected state": ("SpatialCat", {"mass": 4.0, "inertia_axial": 0.02}, {}),
}


@pytest.fixture(scope="module", params=MOTIONS)
def motion(request: pytest.FixtureRequest) -> Motion:
    subject, values, options = MOTIONS[request.param]
    moving: Any = subject() if callable(subject) else subject
    return motion_of(moving, list(values), TIMES, start_values=values, **options)


@pytest.mark.variants(core="a rate that jumps")
def test_differences_of_the_same_steps_agree(motion) -> None:
    at = motion.values
    signals, derivatives = motion.forward(at)
    frozen = motion.frozen(at)
    assert np.array_equal(frozen(at), signals)
    for i, value in enumerate(at):
        step = np.zeros(len(at))
        step[i] = 3e-4 * max(1.0, abs(value))
        a, b, c = ((frozen(at + n * step) - frozen(at - n * step)) / (2 * n * step[i]) for n in (1, 2, 3))
        assert np.abs(1.5 * a - 0.6 * b + 0.1 * c - derivatives[..., i]).max() < 1e-9 * (1 + np.abs(derivatives).max())


def test_backwards_as_forward(motion) -> None:
    signals, derivatives = motion.forward(motion.values)
    weights = np.random.default_rng(24).normal(size=signals.shape)
    found, back = motion.adjoint(motion.values, weights)
    assert np.array_equal(found, signals)
    np.testing.assert_allclose(back, np.einsum("zt,ztp->p", weights, derivatives), rtol=1e-11, atol=1e-12)
    _, squares = motion.adjoint(motion.values, lambda z: 2 * z)
    np.testing.assert_allclose(squares, np.einsum("zt,ztp->p", 2 * signals, derivatives), rtol=1e-11, atol=1e-12)


def test_rates_are_those_of_the_signals(motion) -> None:
    later = motion.at(TIMES[40] + np.array([-2e-3, -1e-3, 0.0, 1e-3, 2e-3]))
    signals = later(motion.values)
    slopes = (8 * (signals[:, 3] - signals[:, 1]) - (signals[:, 4] - signals[:, 0])) / 12e-3
    np.testing.assert_allclose(later.rates(motion.values)[:, 2], slopes, rtol=1e-7, atol=1e-7)


def test_a_jump_that_carries_states_along_is_refused() -> None:
    motion = motion_of("Pendulum", "mass", TIMES, inputs={"pivot_x": PPoly([[0.0, 0.1]], [0.0, 1.0, 4.0])})
    with pytest.raises(SimulationError, match="pivot_x jumps at t = 1 s and carries states along"):
        motion(motion.values)


def test_unknown_names_are_refused() -> None:
    with pytest.raises(ComponentError, match=r"no value 'thet_0' to set; did you mean 'theta_0'\?"):
        motion_of("Pendulum", "thet_0", TIMES)
    with pytest.raises(ComponentError, match="no output 'thet'"):
        motion_of("Pendulum", "theta_0", TIMES, record="thet")
    with pytest.raises(ComponentError, match="inputs: Pendulum has no input 'lengt'; did you mean 'length'"):
        motion_of("Pendulum", "theta_0", TIMES, inputs={"lengt": _LINES})


def test_values_outside_their_domain_are_refused() -> None:
    motion = motion_of("Pendulum", "mass", TIMES)
    with pytest.raises(SimulationError, match="mass = -1: must be > 0"):
        motion([-1.0])
    with pytest.raises(SimulationError, match="length must stay > 0"):
        motion_of("Pendulum", "mass", TIMES, inputs={"length": PPoly(np.array([[-0.5], [1.0]]), [0.0, 4.0])})([1.0])
