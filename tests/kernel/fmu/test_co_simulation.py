"""Co-simulation: what the inputs do inside a step, jumps, derivatives of inputs and outputs."""

from __future__ import annotations

import ctypes as c

import numpy as np
import pytest
from driver import Instance, Library, reals
from handmade import GRAVITY, breathing, breathing_inputs, driven
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

HOLD, EXTRAPOLATE, INTERPOLATE = range(3)


def follow(library: Library, mode: int, size: float, *, duration: float = 10.0) -> float:
    """Error of (theta, p_theta) at the end with the breathing length, reconstructed in steps of a size."""
    instance = library.start(tolerance=1e-12, input_reconstruction=mode, **breathing_inputs(0.0))
    instance.follow(size, round(duration / size), breathing_inputs, ahead=mode == INTERPOLATE)
    return float(np.abs(instance.get("theta", "p_theta") - driven([duration], breathing)[:, 0]).max())


@pytest.mark.parametrize(("mode", "order", "sizes"), [(HOLD, 1, 0.1), (EXTRAPOLATE, 3, 0.1), (INTERPOLATE, 6, 0.4)])
def test_order_of_the_reconstruction(every_pendulum, mode, order, sizes) -> None:
    found = sizes / np.array([1, 2, 4])  # below, it is the reference whose error of 1e-12 is seen
    errors = [follow(every_pendulum, mode, size) for size in found]
    slope, _ = np.polyfit(np.log(found), np.log(errors), 1)
    if mode != INTERPOLATE:
        assert slope == pytest.approx(order, abs=0.3)  # the next order in H still shows: 0.1 * 2/s * a constant
    else:
        assert slope >= 5.5
        assert errors[-1] <= 1e-9


def test_forces_are_interpolated_linearly(every_pendulum) -> None:
    """Weightless: p is the integral of the torque, which goes from 1 to 2 and on to -1 N.m."""
    instance = every_pendulum.start(gravity=0.0, theta_0=0.0, theta_force=1.0, input_reconstruction=INTERPOLATE)
    for i, (torque, momentum) in enumerate([(2.0, 0.75), (-1.0, 1.0)]):
        instance.set(theta_force=torque)
        instance.step(0.5 * i, 0.5)
        assert instance["p_theta"] == pytest.approx(momentum, rel=1e-14)  # exact up to rounding
    instance.step(1.0, 0.5)  # nothing new is set: it stays
    assert instance["p_theta"] == pytest.approx(0.5, rel=1e-14)


def test_an_operator_that_rests_at_first_works_within_the_step(pendulum_library) -> None:
    """Weightless: the momentum stays, and pulled in to 0.8 m it has 1/0.8² times the energy."""
    instance = pendulum_library.start(gravity=0.0, theta_dot_0=1.0, input_reconstruction=INTERPOLATE, tolerance=1e-10)
    energy = instance["energy"]
    instance.set(length=0.8)
    instance.step(0.0, 0.5)
    assert instance["work"] == pytest.approx(energy * (1 / 0.8**2 - 1), abs=1e-9)  # ten times the tolerance


def test_inputs_read_back_as_they_were_set(every_pendulum, mode) -> None:
    instance = every_pendulum.start(input_reconstruction=mode)
    instance.set(length=1.5, length_dot=0.25)
    np.testing.assert_array_equal(instance.get("length", "length_dot"), [1.5, 0.25])
    instance.step(0.0, 0.1)
    np.testing.assert_array_equal(instance.get("length", "length_dot"), [1.5, 0.25])


def test_outputs_after_a_step_belong_to_its_end(every_pendulum) -> None:
    """Length and rate by the Taylor polynomial."""
    instance = every_pendulum.start(length_dot=0.5, length_ddot=0.2)
    instance.step(0.0, 0.1)
    theta, theta_dot = instance.get("theta", "theta_dot")
    length, rate = 1.0 + 0.05 + 0.001, 0.5 + 0.02
    kinetic = (rate**2 + (length * theta_dot) ** 2) / 2
    assert instance["energy"] == pytest.approx(kinetic - GRAVITY * length * np.cos(theta), rel=1e-14)  # some roundings


def test_hold_ignores_the_rates(every_pendulum) -> None:
    moving, still = (
        every_pendulum.start(tolerance=1e-10, input_reconstruction=HOLD, length_dot=rate) for rate in (0.5, 0.0)
    )
    moving.step(0.0, 0.1)
    still.step(0.0, 0.1)
    assert moving.get("theta", "p_theta") == pytest.approx(still.get("theta", "p_theta"), abs=1e-10)
    assert abs(moving["work"]) <= 1e-10  # the length has not moved


def test_forces_and_friction(every_pendulum) -> None:
    """p' = -m g l sin θ - η p + τ, with friction switched on at t = 1 s; against SciPy, work and heat too."""
    instance = every_pendulum.start(tolerance=1e-12, theta_0=1.0, theta_force=0.75)
    instance.step(0.0, 1.0)
    rate, momentum = instance.get("p_theta_dot", "p_theta")
    instance.set(friction=0.3)
    assert instance["p_theta_dot"] == pytest.approx(rate - 0.3 * momentum, rel=1e-15)
    instance.follow(1.0, 9, first=1)

    def rates(_: float, y: NDArray, friction: float) -> list[float]:
        theta, p, _, _ = y
        return [p, -GRAVITY * np.sin(theta) - friction * p + 0.75, 0.75 * p, friction * p**2]

    y = np.array([1.0, 0.0, 0.0, 0.0])
    for span, friction in (((0, 1), 0.0), ((1, 10), 0.3)):
        y = solve_ivp(rates, span, y, method="DOP853", rtol=1e-13, atol=1e-13, args=(friction,)).y[:, -1]
    # Some 60 steps, sizes of 3; the motion is stable.
    np.testing.assert_allclose(instance.get("theta", "p_theta", "work", "dissipated"), y, rtol=0, atol=1e-10)
    assert abs(instance["energy_balance"]) <= 1e-10


# ---- jumps -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("mode", [HOLD, EXTRAPOLATE])
def test_jump_of_a_rate_leaves_the_momentum_and_closes_the_balance(every_pendulum, mode) -> None:
    """A ramp switched on at t = 1 s: p_theta stays, an impulse does the work m/2 Δ(l'^2), the motion is right."""
    rate, jump_at, end = 0.3, 1.0, 2.0
    instance = every_pendulum.start(tolerance=1e-12, theta_0=0.8, input_reconstruction=mode)
    instance.step(0.0, jump_at)
    momentum, work = instance.get("p_theta", "work")
    instance.set(length_dot=rate)
    # p_theta is a state, which a jump of the rate does not touch: continuous to the last bit.
    assert instance["p_theta"] == momentum
    assert instance["work"] - work == pytest.approx(rate**2 / 2, rel=1e-12)  # a difference of energies of 10 J
    instance.step(jump_at, 1e-9)
    assert instance["p_theta"] == pytest.approx(momentum, abs=1e-8)  # |p'| = m g l sin θ < 10 N.m, for 1e-9 s
    assert instance["work"] - work == pytest.approx(rate**2 / 2, rel=1e-6)  # and 1e-9 s of power of 3 W
    t, steps = jump_at + 1e-9, 100
    for i in range(steps):
        instance.set(length=1.0 + rate * (t - jump_at))
        size = (end - t) / (steps - i)
        instance.step(t, size)
        t += size
    assert abs(instance["energy_balance"]) <= 1e-9  # 100 steps of 1e-12 * 10 J
    if mode == HOLD:  # of first order in the size of a step
        return
    expected = driven([jump_at, end], lambda t: (1 + rate * max(t - jump_at, 0), 0, 0), theta_0=0.8)
    # The reference goes over the kink with steps of its own: 1e-13 each, some 50 of them, sizes up to 10.
    np.testing.assert_allclose(instance.get("theta", "p_theta"), expected[:, 1], rtol=0, atol=1e-9)


def test_energy_balance_through_jumps(every_pendulum) -> None:
    instance = every_pendulum.start(tolerance=1e-10, theta_0=1.0)
    for i in range(20):
        instance.step(0.1 * i, 0.1)
        instance.set(length=1.0 + 0.1 * (-1) ** i, length_dot=0.5 * (-1) ** i)
        assert abs(instance["energy_balance"]) <= 1e-8  # energies of some 10 J, 10 tolerances each second
    assert abs(instance["work"]) > 0.1


def test_same_input_set_again_changes_nothing(pendulum_library) -> None:
    def end(*, again: bool) -> list[float]:
        instance = pendulum_library.start(theta_0=0.8, theta_force=0.5)
        for i in range(20):
            if again:
                instance.set(theta_force=0.5, length=1.0)
            instance.step(i * 0.1, 0.1)
        return list(instance.get("theta", "p_theta", "work", "energy_balance"))

    assert end(again=True) == end(again=False)


def test_interpolated_jump_is_no_jump(pendulum_library) -> None:
    """What is set belongs to the end of the step: the outputs at its beginning do not move."""
    instance = pendulum_library.start(input_reconstruction=INTERPOLATE)
    instance.step(0.0, 0.1)
    before = instance.get("energy", "work", "theta_dot")
    instance.set(length=1.2, length_dot=0.1)
    np.testing.assert_array_equal(instance.get("energy", "work", "theta_dot"), before)


# ---- derivatives of inputs and outputs ---------------------------------------------------------------------------


def set_input_derivatives(instance: Instance, name: str, *values: float) -> None:
    n = len(values)
    orders = (c.c_int * n)(*range(1, n + 1))
    instance.do("SetRealInputDerivatives", instance.refs([name] * n), n, orders, reals(values))


def test_input_derivatives_are_a_taylor_polynomial_for_one_step(pendulum2) -> None:
    """Weightless: p' = τ(t), so p is the integral of the polynomial; then the torque is constant again."""
    for mode in (HOLD, EXTRAPOLATE):
        instance = pendulum2.start(gravity=0.0, theta_0=0.0, input_reconstruction=mode)
        coefficients = [0.3, -0.2, 0.5, 0.7, -1.1, 2.0]  # value and derivatives of order 1 to 5
        instance.set(theta_force=coefficients[0])
        set_input_derivatives(instance, "theta_force", *coefficients[1:])
        instance.step(0.0, 0.5)
        integral, factor = 0.0, 1.0
        for j, coefficient in enumerate(coefficients, start=1):
            factor *= 0.5 / j
            integral += coefficient * factor
        # Quadrature of a polynomial of degree 5 by a method of order 8: exact up to rounding.
        assert instance["p_theta"] == pytest.approx(integral, rel=1e-14)
        instance.step(0.5, 0.5)
        assert instance["p_theta"] == pytest.approx(integral + 0.5 * coefficients[0], rel=1e-14)


def test_input_derivatives_of_one_input_do_not_wake_old_ones_of_another(pendulum2) -> None:
    instance = pendulum2.start(gravity=0.0, theta_0=0.0, theta_force=1.0)
    set_input_derivatives(instance, "theta_force", 2.0)
    instance.step(0.0, 0.5)
    momentum = instance["p_theta"]
    set_input_derivatives(instance, "length_ddot", 0.0)
    instance.step(0.5, 0.5)
    assert instance["p_theta"] - momentum == pytest.approx(0.5, rel=1e-14)  # the constant torque, exact to rounding


def test_output_derivatives_follow_the_input_derivatives_to_come(pendulum2) -> None:
    """p' = τ in weightlessness: p'' is what the torque is told to do."""
    instance = pendulum2.start(gravity=0.0)
    assert instance.output_derivatives("p_theta_dot") == 0.0
    set_input_derivatives(instance, "theta_force", 2.0)
    assert instance.output_derivatives("p_theta_dot") == 2.0


def test_output_derivatives_are_the_rates_of_the_outputs(pendulum_library) -> None:
    """Against central differences over ±1e-3 s: their error is 1e-6/6 times third derivatives of some 1e2."""
    names = ["theta", "theta_dot", "p_theta", "length_force", "energy", "work", "dissipated", "energy_balance"]
    h, start = 1e-3, {"theta_0": 0.9, "friction": 0.2, "length_dot": 0.3, "length_ddot": -0.8, "theta_force": 0.4}

    def at(t: float) -> NDArray:
        instance = pendulum_library.start(tolerance=1e-14, **start)
        instance.step(0.0, t)
        return instance.get(*names)

    central = (at(0.5 + h) - at(0.5 - h)) / (2 * h)
    instance = pendulum_library.start(tolerance=1e-14, **start)
    instance.step(0.0, 0.5)
    np.testing.assert_allclose(instance.output_derivatives(*names), central, rtol=0, atol=1e-4)
    rates = instance.get("theta_dot", "p_theta_dot", "power", "dissipation")
    derivatives = instance.output_derivatives("theta", "p_theta", "work", "dissipated")
    np.testing.assert_allclose(derivatives, rates, rtol=1e-13, atol=1e-14)  # the same sums in another order
