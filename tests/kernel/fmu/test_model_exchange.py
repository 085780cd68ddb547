"""Model exchange: the same motion by the importer's solver, events, order of the calls."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
import pytest
from bodies import TwiceHeldBead
from driver import DISCARD, MODEL_EXCHANGE, Instance, reals
from handmade import breathing_inputs
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from liaisons.models import BouncingBall, PolarOscillator

Inputs = Callable[[float], dict[str, float]]


def rates(instance: Instance, t: float, y: Sequence[float] | NDArray) -> NDArray:
    instance.do("SetTime", t)
    instance.do("SetContinuousStates", reals(y), len(y))
    return instance.vector("GetContinuousStateDerivatives", len(y))


def integrate(instance: Instance, span: tuple[float, float], y: NDArray, inputs: Inputs | None = None) -> NDArray:
    """The states at the end of the span, which the instance has then."""

    def right_hand_side(t: float, y: NDArray) -> NDArray:
        if inputs is not None:
            instance.set(inputs(t))
        return rates(instance, t, y)

    y = solve_ivp(right_hand_side, span, y, method="DOP853", rtol=1e-12, atol=1e-12).y[:, -1]
    right_hand_side(span[1], y)
    return y


def test_motion_with_a_driven_length_is_that_of_co_simulation(pendulum_library) -> None:
    exchange = pendulum_library.running(**breathing_inputs(0.0))
    y = integrate(exchange, (0.0, 5.0), exchange.vector("GetContinuousStates", 4), breathing_inputs)
    simulated = pendulum_library.start(tolerance=1e-12, input_reconstruction=2, **breathing_inputs(0.0))
    simulated.follow(0.05, 100, breathing_inputs, ahead=True)
    # Sixth-order interpolation at H = 0.05 s: some 1e-12; SciPy at 1e-12 over 50 steps.
    np.testing.assert_allclose(simulated.get("theta", "p_theta", "work", "dissipated"), y, rtol=0, atol=1e-10)
    # Outputs belong to the states that were set, work up to rounding of energies of 10 J; the balance needs no event.
    assert exchange["theta"] == y[0]
    assert exchange["work"] == pytest.approx(y[2], abs=1e-14)
    assert abs(exchange["energy_balance"]) <= 1e-10


def test_completed_steps_ask_for_nothing(pendulum_library) -> None:
    instance = pendulum_library.running()
    event, end = instance.flags(1), instance.flags(1)
    instance.do("CompletedIntegratorStep", True, event, end)
    assert (event[0], end[0]) == (0, 0)


def test_sizes_of_the_states_follow_the_parameters(pendulum_library) -> None:
    instance = pendulum_library.start(MODEL_EXCHANGE, mass=3.0, length=2.0)
    np.testing.assert_array_equal(instance.vector("GetNominalsOfContinuousStates", 4), [1.0, 12.0, 3.0, 3.0])


@pytest.mark.parametrize(
    "function", ["GetNominalsOfContinuousStates", "GetContinuousStateDerivatives", "GetContinuousStates"]
)
def test_start_values_count_in_initialization_mode(library, function: str) -> None:
    """Nothing is read before that calculates them."""
    instance = library(PolarOscillator).initializing(MODEL_EXCHANGE, r_0=3.0, r_dot_0=0.7)
    early = instance.vector(function, instance.library.states)
    instance.exit_initialization()
    np.testing.assert_array_equal(early, instance.vector(function, instance.library.states))


def test_jump_of_an_input_in_event_mode_is_booked(pendulum_library) -> None:
    """A jump of l' by 0.3 m/s does the work m/2 0.3²; angle and momentum stay."""
    instance = pendulum_library.running(theta_0=0.8, friction=0.3)
    y = integrate(instance, (0.0, 1.0), instance.vector("GetContinuousStates", 4))
    instance.do("EnterEventMode")
    instance.set(length_dot=0.3)
    assert instance["work"] == pytest.approx(y[2] + 0.3**2 / 2, rel=1e-12)  # a difference of energies of 10 J
    assert instance.update() == (True, None)
    after = instance.vector("GetContinuousStates", 4)
    np.testing.assert_array_equal(after[:2], y[:2])
    assert after[2] == pytest.approx(y[2] + 0.3**2 / 2, rel=1e-12)
    assert not instance.go_on().states_changed
    y = integrate(instance, (1.0, 2.0), after, lambda t: {"length": 1 + 0.3 * (t - 1), "length_dot": 0.3})
    assert abs(instance["energy_balance"]) <= 1e-10  # 2 x 15 steps of SciPy's at 1e-12 * 10 J


def test_time_event(kick_library) -> None:
    """x' = 1, from the event at t_1 = 1 s on x' = 3; up to the event the left value holds."""
    instance = kick_library.start(MODEL_EXCHANGE, t_1=1.0)
    assert instance.go_on().next_time == 1.0
    assert rates(instance, 0.999, [0.999]) == 1.0
    assert rates(instance, 1.0, [1.0]) == 1.0
    assert instance["x_dot"] == 1.0
    instance.do("EnterEventMode")
    assert instance["x_dot"] == 3.0
    assert instance.go_on() == (True, None)  # the rate has jumped: who integrates starts again
    assert rates(instance, 1.0, [1.0]) == 3.0


def test_outputs_are_those_after_an_event_in_which_none_was_read(kick_library) -> None:
    instance = kick_library.running(t_1=1.0)
    rates(instance, 1.0, [1.0])
    assert instance["x_dot"] == 1.0
    instance.do("EnterEventMode")
    instance.go_on()
    assert instance["x_dot"] == 3.0


@pytest.mark.parametrize("version", ["fmi2", "fmi3"])
def test_an_update_changes_outputs_once(library, version: str) -> None:
    """A ball of 1 kg hits the table with 1 m/s; its coefficient of restitution is 0.8."""
    instance = library(BouncingBall, version).running()
    instance.do("SetContinuousStates", reals([0.0, -1.0, 0.0, 0.0]), 4)
    instance.do("EnterEventMode")
    assert instance["height_dot"] == -1.0
    assert instance.update().states_changed
    assert instance["height_dot"] == pytest.approx(0.8, rel=1e-14)
    after = instance.vector("GetContinuousStates", 4)
    assert not instance.update().states_changed
    np.testing.assert_array_equal(instance.vector("GetContinuousStates", 4), after)


def test_derivatives_that_do_not_exist_are_refused(fall_library) -> None:
    instance = fall_library.running()
    instance.do("SetContinuousStates", reals([0.0, 0.0]), 2)
    message = "x must stay > 0; at t = 0 it does not (0)"
    instance.refuse(message, "GetContinuousStateDerivatives", reals([0.0, 0.0]), 2, status=DISCARD)
    message = "v = nan: set a finite number"
    instance.refuse(message, "SetContinuousStates", reals([1.0, np.nan]), 2, status=DISCARD)
    np.testing.assert_array_equal(instance.vector("GetContinuousStates", 2), [0.0, 0.0])


# ---- redundant constraints: a bead in a plane, on a cylinder and on a sphere -------------------------------------

FORCES = ("lambda_plane", "lambda_circle", "lambda_sphere")
STATES = ("x", "y", "z", "p_x", "p_y", "p_z")
AT, CLOCKWISE = np.array([0.6, 0.0, 0.8]), np.array([0.8, 0.0, -0.6])


def shared(angle: float, speed: float) -> NDArray:
    """The plane bears 2 N; cylinder and sphere share 9.81 z - v² to the centre by their gradients."""
    whole = (9.81 * np.sin(angle) - speed**2) / 2
    return np.array([2.0, whole * 16 / 28, whole * 12 / 28])


@pytest.mark.parametrize("off", [0.0, 1e-8, 1e-6, 1e-4, 1e-2])
def test_redundant_constraints_share_their_force_however_far_states_are_off(library, off: float) -> None:
    instance = library(TwiceHeldBead).running()
    y = np.concatenate([AT, 3 * CLOCKWISE, [0, 0]])
    y[:6] += off * np.random.default_rng(1).uniform(-1, 1, 6)
    rates(instance, 0.0, y)
    # As far along the circle as away from it: 9.81/2 N and v = 3 m/s times that.  Rounding of forces over 1e-10 of 16.
    np.testing.assert_allclose(instance.get(*FORCES), shared(np.arctan2(0.8, 0.6), 3.0), rtol=0, atol=2e-5 + 15 * off)
    np.testing.assert_array_equal(instance.get(*STATES), y[:6])
    np.testing.assert_allclose(instance.get("circle_residual", "sphere_residual"), 0, rtol=0, atol=1e-15)


def test_states_off_redundant_constraints_return_to_them(library) -> None:
    """At a rate of 20/s, across the circle."""
    instance = library(TwiceHeldBead).running()
    y = np.concatenate([1.001 * AT, 3 * CLOCKWISE, [0, 0]])
    off = rates(instance, 0.0, y)[:3] - 3 * CLOCKWISE
    np.testing.assert_allclose(off, -20 * 0.001 * AT, rtol=0, atol=20 * 0.001**2)


@pytest.mark.parametrize("off", [1e-6, 1e-3])
def test_derivatives_of_what_is_calculated_on_redundant_constraints(library, off: float) -> None:
    """Directional ones against differences, adjoint ones against these."""
    instance = library(TwiceHeldBead, "fmi3").running()
    random = np.random.default_rng(2)
    y = np.concatenate([AT, 3 * CLOCKWISE, [0.1, 0.2]])
    y += off * random.uniform(-1, 1, 8)
    rates(instance, 0.0, y)
    unknowns, knowns = ("x_dot", "z_dot", "p_x_dot", "p_z_dot", "lambda_circle", "energy", "work"), (*STATES, "z_force")
    weights, direction = random.normal(size=len(unknowns)), random.normal(size=len(knowns))
    found = instance.directional(unknowns, dict(zip(knowns, direction, strict=True)))
    back = instance.adjoint(dict(zip(unknowns, weights, strict=True)), knowns)

    def moved(h: float) -> NDArray:
        instance.set(z_force=h * direction[-1])
        rates(instance, 0.0, y + h * np.append(direction[:-1], [0, 0]))
        return instance.get(*unknowns)

    h = 1e-4
    differences = (8 * (moved(h) - moved(-h)) - moved(2 * h) + moved(-2 * h)) / (12 * h)
    # Rounding over h, of how a force is shared over 1e-10 of 16 as well; the next order is h⁴ times 100.
    allowed = [1e-2 if name in FORCES else 1e-9 for name in unknowns]
    np.testing.assert_array_less(np.abs(found - differences), allowed)
    # Rounding over 1e-10 of 16.
    assert weights @ found == pytest.approx(back @ direction, rel=1e-6)
