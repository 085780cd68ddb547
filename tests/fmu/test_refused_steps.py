"""Refused steps, alike in FMI 2.0 and 3.0: Discard once where a shorter step exists, else Error; numbers are finite."""

from __future__ import annotations

import ctypes as c
import math
from collections.abc import Callable

import numpy as np
import pytest
from driver import CO_SIMULATION, DISCARD, ERROR, MODEL_EXCHANGE, OK, Instance, reals

LEAVING = {"length": 0.2, "length_dot": -3.0}
"""The length is 0 after 1/15 s."""
STATES = ("theta", "p_theta", "length")

Start = Callable[..., Instance]
"""An instance after initialization, values by name."""


@pytest.fixture
def start(pendulum_library) -> Start:
    return pendulum_library.start


@pytest.fixture
def falling(fall_library) -> Start:
    """The fall onto a centre, which ends after 1.1107 s."""
    return fall_library.start


# ---- which status ------------------------------------------------------------------------------------------------


def test_the_same_step_is_discarded_once(start) -> None:
    instance = start(**LEAVING)
    before = instance.get(*STATES)
    assert [instance.step(0.0, 0.1) for _ in range(3)] == [DISCARD, ERROR, ERROR]
    assert [entry[0] for entry in instance.log] == [DISCARD, ERROR, ERROR]
    assert len(set(instance.messages)) == 1
    np.testing.assert_array_equal(instance.get(*STATES), before)
    assert instance.step(0.0, 0.06) == OK


def test_a_longer_step_is_not_discarded_again_and_a_shorter_one_is(start) -> None:
    instance = start(**LEAVING)
    sizes = (0.1, 0.2, 0.08, 0.08, 0.07, 0.1)
    assert [instance.step(0.0, size) for size in sizes] == [DISCARD, ERROR, DISCARD, ERROR, DISCARD, ERROR]


def test_rounding_does_not_make_a_step_shorter(start) -> None:
    instance = start(**LEAVING)
    assert [instance.step(0.0, size) for size in (0.1, 0.1 * (1 - 1e-12))] == [DISCARD, ERROR]


def test_a_step_that_is_taken_forgets_the_discarded_one(start) -> None:
    instance = start(**LEAVING)
    assert [instance.step(0.0, size) for size in (0.1, 0.05)] == [DISCARD, OK]
    assert instance.step(0.05, 0.1) == DISCARD  # from another time
    assert instance.set(length_dot=0.0) == OK
    assert instance.step(0.05, 0.1) == OK
    assert instance.step(0.15, 0.1) == OK


@pytest.mark.parametrize("attempts", [1, 2])
def test_an_instance_goes_on_from_a_saved_state(start, attempts) -> None:
    """After Discard and after Error, to the numbers of one that was refused nothing; and may be discarded again."""
    instance, other = start(**LEAVING), start(**LEAVING)
    state = instance.save()
    for _ in range(attempts):
        instance.step(0.0, 0.1)
    assert instance.restore(state) == OK
    assert instance.step(0.0, 0.05) == other.step(0.0, 0.05) == OK
    np.testing.assert_array_equal(instance.get(*STATES), other.get(*STATES))
    assert instance.restore(state) == OK
    assert instance.step(0.0, 0.1) == DISCARD
    instance.drop(state)


def test_an_instance_goes_on_after_a_reset(start) -> None:
    instance = start(**LEAVING)
    assert [instance.step(0.0, 0.1) for _ in range(2)] == [DISCARD, ERROR]
    assert instance.call("Reset") == OK
    assert instance.initialize() == OK
    assert instance.set(LEAVING) == OK
    assert instance.call("ExitInitializationMode") == OK
    assert instance.step(0.0, 0.1) == DISCARD


@pytest.mark.parametrize("mode", [0, 1])
def test_an_input_outside_its_domain_is_an_error_at_once(start, mode) -> None:
    instance = start(input_reconstruction=mode)
    assert instance.step(0.0, 0.1) == OK
    assert instance.set(length=-1.0) == OK
    assert [instance.step(0.1, size) for size in (0.1, 0.01)] == [ERROR, ERROR]
    assert instance.set(length=1.0) == OK
    assert instance.step(0.1, 0.1) == OK


def test_an_interpolated_input_belongs_to_the_end_of_the_step(start) -> None:
    """A value nearer to the present one may be in the domain: that is what a shorter step would be given."""
    instance = start(input_reconstruction=2)
    assert instance.set(length=-1.0) == OK
    assert [instance.step(0.0, size) for size in (0.1, 0.1, 0.05)] == [DISCARD, ERROR, DISCARD]
    assert instance.set(length=0.9) == OK
    assert instance.step(0.0, 0.025) == OK


def test_a_parameter_outside_its_domain_is_an_error_also_where_inputs_are_interpolated(start) -> None:
    instance = start(input_reconstruction=2)
    assert instance.set(friction=-1.0, length=-1.0) == OK
    assert instance.step(0.0, 0.1) == ERROR


def test_the_end_of_the_motion_is_discarded_once(falling) -> None:
    instance = falling()
    assert instance.step(0.0, 1.0) == OK
    assert [instance.step(1.0, size) for size in (0.5, 0.5, 0.2, 0.05)] == [DISCARD, ERROR, DISCARD, OK]


def test_a_start_that_leads_nowhere_is_an_error_at_once(start) -> None:
    """Friction overflows: no step, however short, has finite rates."""
    instance = start(friction=1e308, theta_dot_0=1e10)
    assert [instance.step(0.0, size) for size in (0.1, 1e-9)] == [ERROR, ERROR]
    assert "p_theta_dot = -inf at t = 0: the motion ends there" in instance.messages[0]


def test_a_motion_too_fast_for_the_step_is_discarded(start) -> None:
    """1e22 swings a second: a step of 0.1 s gets nowhere, one of 1e-25 s does."""
    instance = start(gravity=4e45)
    assert [instance.step(0.0, size) for size in (0.1, 0.1, 1e-25)] == [DISCARD, ERROR, OK]


def test_a_state_that_overflows_inside_a_step_is_named(start) -> None:
    """p grows by 1e306 a second."""
    instance = start(theta_force=1e306, mass=1e308, gravity=0.0)
    before = instance.get(*STATES)
    status = instance.step(0.0, 1e3)
    assert status in {DISCARD, ERROR}
    assert "inf" in instance.messages[0]
    np.testing.assert_array_equal(instance.get(*STATES), before)


# ---- times -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("time", [math.inf, -math.inf, math.nan])
def test_steps_begin_at_finite_times(start, time) -> None:
    instance = start()
    assert instance.step(time, 0.1) == ERROR
    assert instance.messages == [f"step from t = {time:g}: it must be finite"]
    assert instance.step(0.0, 0.1) == OK


@pytest.mark.parametrize("time", [1e300, -1e300, 1.7976931348623157e308])
def test_steps_begin_where_the_instance_is(start, time) -> None:
    instance = start()
    assert instance.step(time, 0.1) == ERROR
    assert instance.messages == [f"step from t = {time:.15g}: the instance is at t = 0"]
    assert instance.step(0.0, 0.1) == OK


def test_steps_end_at_finite_times(pendulum_library) -> None:
    largest = 1.7976931348623157e308
    instance = pendulum_library.instantiate()
    assert instance.initialize(start=largest) == OK
    assert instance.call("ExitInitializationMode") == OK
    assert instance.step(largest, largest) == ERROR
    assert instance.messages[-1].endswith("it must end at a finite time")
    assert instance.step(largest, 1.0) == ERROR
    assert instance.messages[-1] == f"step size = 1: it is too small to lead on from t = {largest:.15g}"


def test_steps_lead_on(start) -> None:
    instance = start()
    assert instance.step(0.0, 0.5) == OK
    assert instance.step(0.5, 1e-17) == ERROR
    assert instance.messages == ["step size = 1e-17: it is too small to lead on from t = 0.5"]
    assert instance.step(0.5, 1e-15) == OK


@pytest.mark.parametrize("number", [math.inf, -math.inf, math.nan])
def test_experiments_begin_and_end_at_finite_times(pendulum_library, number) -> None:
    for begin, end, word in ((number, None, "start"), (0.0, number, "stop")):
        instance = pendulum_library.instantiate()
        assert instance.initialize(start=begin, stop=end) == ERROR
        assert instance.messages == [f"{word} time = {number:g}: it must be finite"]
        assert instance.initialize() == OK


@pytest.mark.parametrize("number", [math.inf, -math.inf, math.nan])
def test_times_of_model_exchange_are_finite(pendulum_library, number) -> None:
    instance = pendulum_library.start(MODEL_EXCHANGE)
    assert instance.call("SetTime", number) == DISCARD
    assert instance.messages == [f"time = {number:g}: set a finite number"]


# ---- numbers -----------------------------------------------------------------------------------------------------


def test_numbers_that_are_not_finite_are_refused_when_they_are_read(start) -> None:
    instance = start(length_dot=10.0, length_ddot=1e308)
    for _ in range(2):  # the second time they are known
        assert instance.read("theta", "power", "p_theta")[0] == ERROR
        (message,) = instance.messages
        assert message == "power = inf at t = 0: it must be finite; choose other start values or inputs"
        instance.messages.clear()
        assert instance.read("theta", "energy", "mass")[0] == OK


def test_a_start_whose_energy_is_not_finite_is_refused(pendulum_library) -> None:
    instance = pendulum_library.instantiate()
    assert instance.initialize() == OK
    assert instance.set(theta_dot_0=1e200) == OK
    assert instance.call("ExitInitializationMode") == ERROR
    assert instance.messages[-1].endswith("inf at t = 0: it must be finite; set another value and initialize again")
    assert instance.set(theta_dot_0=1.0) == OK
    assert instance.call("ExitInitializationMode") == OK


def test_numbers_that_are_not_finite_before_initialization_ends_are_put_down_to_their_cause(falling) -> None:
    instance = falling()
    assert instance.call("Reset") == OK
    assert instance.initialize() == OK
    assert instance.set(x_0=0.0) == OK
    assert instance.read("x", "a")[0] == ERROR
    assert instance.messages == ["x_0 = 0 at t = 0: it must be > 0; a = -inf"]


def test_arrays_with_a_number_that_is_not_finite_name_the_element(ring_library) -> None:
    instance = ring_library.start(x_0=[0.0, 1e308, -1e308], bond=[0.0, 0.0, 3.0])
    assert instance.read("x", "p_dot")[0] == ERROR
    assert instance.messages[-1].startswith("p_dot[2] = -inf at t = 0: it must be finite")
    assert instance.read("x")[0] == OK


def test_derivatives_that_are_not_finite_are_refused(pendulum_library) -> None:
    instance = pendulum_library.start(theta_dot_0=1e140, length_dot=1e50)
    unknowns, force, known = (
        instance.refs(names) for names in (["theta", "length_force"], ["length_force"], ["length"])
    )
    result, seed = (c.c_double * 2)(), reals([1e200])
    assert instance.call("GetDirectionalDerivative", unknowns, 2, known, 1, seed, 1, result, 2) == ERROR
    assert instance.messages[-1].startswith("derivative of length_force = ")
    assert instance.call("GetOutputDerivatives", force, 1, (c.c_int32 * 1)(1), result, 1) == ERROR
    assert instance.messages[-1].startswith("derivative by time of length_force = ")
    if instance.library.fmi == "3":
        assert instance.call("GetAdjointDerivative", force, 1, known, 1, seed, 1, result, 1) == ERROR
        assert instance.messages[-1].startswith("derivative by length = ")


def test_in_model_exchange_numbers_that_are_not_finite_are_discarded(pendulum_library) -> None:
    """As the standard has it: the importer's solver may try a shorter step."""
    instance = pendulum_library.start(MODEL_EXCHANGE)
    instance.go_on()
    assert instance.call("SetContinuousStates", reals([0.0, 1e200, 0.0, 0.0]), 4) == OK
    assert instance.read("theta", "energy")[0] == DISCARD
    assert instance.messages[-1].startswith("energy = inf")


# ---- the log -----------------------------------------------------------------------------------------------------


def test_refused_steps_are_said_where_logging_is_off(start) -> None:
    instance = start(CO_SIMULATION, options={"logging": False}, **LEAVING)
    assert [instance.step(0.0, 0.1) for _ in range(2)] == [DISCARD, ERROR]
    assert [entry[:2] for entry in instance.log] == [(DISCARD, "logStatusDiscard"), (ERROR, "logStatusError")]
