"""Directional derivatives: analytic, in every mode; central differences converge to them with the square of h."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np
import pytest
from driver import CO_SIMULATION, ERROR, MODEL_EXCHANGE, OK, Instance, reals

OUTPUTS = ["theta", "theta_dot", "p_theta", "length_force", "energy", "work", "dissipated", "energy_balance"]
OUTPUTS += ["p_theta_dot", "power", "dissipation"]
START = {
    "theta_0": 0.9,
    "theta_dot_0": 0.4,
    "friction": 0.2,
    "length_dot": 0.3,
    "length_ddot": -0.2,
    "theta_force": 0.1,
}
DIRECTION = {"length": 0.3, "length_dot": -0.7, "length_ddot": 0.4, "theta_force": 1.3}


def check(instance: Instance, known: Mapping[str, float], shift: Callable[[float], None], names=OUTPUTS) -> None:
    """Compare with (f(+h) - f(-h))/2h: its error has to fall by 4 with each halving of h.

    h is so large that the error of order h², with third derivatives of some 10, stands far above rounding.
    """
    derivative = instance.derivative(names, known)
    differences = []
    for h in (0.02, 0.01):
        shift(h)
        above = instance.get(*names)
        shift(-h)
        below = instance.get(*names)
        shift(0.0)
        differences.append((above - below) / (2 * h))
    coarse, fine = (np.abs(difference - derivative) for difference in differences)
    extrapolated = (4 * differences[1] - differences[0]) / 3
    np.testing.assert_allclose(extrapolated, derivative, atol=1e-6)  # what is left is of order h⁴: 1e-8 times some 10
    seen = coarse > 1e-9
    assert seen.any()
    np.testing.assert_allclose(coarse[seen] / fine[seen], 4.0, rtol=0.01)  # the next order is h² = 4e-4 times some 10


def shifting(instance: Instance, known: Mapping[str, float]) -> Callable[[float], None]:
    base = {name: instance[name] for name in known}

    def shift(h: float) -> None:
        assert instance.set({name: base[name] + h * known[name] for name in known}) == OK

    return shift


@pytest.mark.parametrize("kind", [CO_SIMULATION, MODEL_EXCHANGE])
def test_at_initialization(pendulum_library, kind) -> None:
    """With respect to parameters and inputs, through the start values of the states."""
    instance = pendulum_library.instantiate(kind)
    assert instance.setup() == OK
    assert instance.call("EnterInitializationMode") == OK
    assert instance.set(START) == OK
    known = DIRECTION | {"mass": 0.5, "gravity": -2.0, "friction": 0.3, "theta_0": 1.0, "theta_dot_0": -0.6}
    check(instance, known, shifting(instance, known), [*OUTPUTS, "weight"])


def test_between_communication_steps(pendulum_library) -> None:
    """With respect to inputs: a jump of the length does work, so that work depends on it."""
    instance = pendulum_library.start(**START)
    assert instance.step(0.0, 0.5) == OK
    assert instance.set(length=1.1) == OK
    check(instance, DIRECTION, shifting(instance, DIRECTION))
    assert instance.derivative(["work"], {"length_dot": 1.0})[0] == pytest.approx(0.3, rel=1e-14)  # d/dv of v²/2


def test_effective_mass_is_a_derivative_of_an_output(pendulum_library) -> None:
    """Θ = ∂λ/∂σ̈ = m (M eq. 50)."""
    instance = pendulum_library.start(mass=2.5)
    assert instance.derivative(["length_force"], {"length_ddot": 1.0})[0] == 2.5


def test_in_event_mode(pendulum_library) -> None:
    instance = pendulum_library.start(MODEL_EXCHANGE, **START)
    check(instance, DIRECTION, shifting(instance, DIRECTION))


def test_in_continuous_time_mode(pendulum_library) -> None:
    """With respect to states and inputs; work and balance follow the motion there, whatever the inputs do."""
    instance = pendulum_library.start(MODEL_EXCHANGE, **START)
    instance.new_discrete_states()
    assert instance.call("EnterContinuousTimeMode") == OK
    states = {"theta": 0.5, "p_theta": -0.8, "work": 0.25, "dissipated": 2.0}
    base = instance.vector("GetContinuousStates", 4)
    shift_inputs = shifting(instance, DIRECTION)

    def shift(h: float) -> None:
        shift_inputs(h)
        y = base + h * np.array(list(states.values()))
        assert instance.call("SetContinuousStates", reals(y), 4) == OK

    check(instance, DIRECTION | states, shift)
    assert instance.derivative(["work"], {"length_dot": 1.0})[0] == pytest.approx(0.0, abs=1e-15)


def test_contributions_add_up(pendulum_library) -> None:
    instance = pendulum_library.start(**START)
    together = instance.derivative(OUTPUTS, DIRECTION)
    parts = [instance.derivative(OUTPUTS, {name: value}) for name, value in DIRECTION.items()]
    np.testing.assert_allclose(together, np.sum(parts, axis=0), atol=1e-13)  # sums of terms up to 10


@pytest.mark.parametrize(
    ("unknown", "known", "message"),
    [
        ("theta", "theta_dot", "theta_dot is not among the known variables now; they are parameters, inputs, states"),
        ("length", "length", "length is not an unknown variable: it is set, not calculated"),
    ],
)
def test_wrong_variables_are_named(pendulum_library, unknown, known, message) -> None:
    instance = pendulum_library.start()
    arguments = (instance.refs([unknown]), 1, instance.refs([known]), 1, reals([1.0]), reals([0.0]))
    assert instance.call("GetDirectionalDerivative", *arguments) == ERROR
    assert instance.messages == [message]
