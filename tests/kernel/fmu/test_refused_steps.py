"""Refused steps, alike in all FMUs: Discard once where a shorter step exists, else Error; numbers are finite."""

from __future__ import annotations

import ctypes as c
import math
import re
from collections.abc import Mapping
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np
import pytest
from driver import DISCARD, ERROR, MODEL_EXCHANGE, OK, reals

from liaisons.models import FourierSeries

HOLD, EXTRAPOLATE, INTERPOLATE = range(3)
LEAVING = {"length": 0.2, "length_dot": -3.0}
"""The length is 0 after 1/15 s."""
OUTPUTS = ("theta", "p_theta", "work", "energy", "length", "friction")
LARGEST = 1.7976931348623157e308
NOT_POSITIVE = r"length = (-\S+|0) at t = \S+: it must be > 0; the step from t = 0 is taken back"


class Refusal(NamedTuple):
    """Steps (time, size, status) of an instance with start values, and what is said of those that are refused."""

    start: dict[str, Any]
    steps: list[tuple[float, float, int]]
    said: str
    given: Mapping[str, float] = MappingProxyType({})  # set after initialization
    python: bool = True  # in Python, too; there every step is discarded first and an error when it is tried again


def tried(*steps: tuple[float, int]) -> list[tuple[float, float, int]]:
    return [(0.0, size, status) for size, status in steps]


SYMPLECTIC = "the symplectic step from t = 0 does not converge: symplectic_steps = 1 is not enough"
REFUSALS: dict[str, Refusal] = {
    # Where a shorter step exists
    "the same": Refusal(LEAVING, tried((0.1, DISCARD), (0.1, ERROR), (0.1, ERROR), (0.06, OK)), NOT_POSITIVE),
    "longer and shorter": Refusal(
        LEAVING,
        tried((0.1, DISCARD), (0.2, ERROR), (0.08, DISCARD), (0.08, ERROR), (0.07, DISCARD), (0.1, ERROR)),
        NOT_POSITIVE,
    ),
    "shorter by rounding": Refusal(LEAVING, tried((0.1, DISCARD), (0.1 * (1 - 1e-12), ERROR)), NOT_POSITIVE),
    "one that was taken between": Refusal(
        LEAVING,
        [(0.0, 0.1, DISCARD), (0.0, 0.05, OK), (0.05, 0.1, DISCARD)],
        r"length = -.* the step from t = 0(\.05)? is taken back",
    ),
    "driven through zero": Refusal({"length_dot": -2.0}, tried((1.0, DISCARD)), NOT_POSITIVE),
    "interpolated through zero": Refusal(  # positive at both ends, but not between them
        {"length_dot": -2.0, "input_reconstruction": INTERPOLATE},
        tried((1.0, DISCARD)),
        NOT_POSITIVE,
        {"length": 0.1, "length_dot": 2.0},
    ),
    "interpolated to below zero": Refusal(  # what belongs to the end of a shorter step may be nearer to the present
        {"input_reconstruction": INTERPOLATE},
        tried((0.1, DISCARD), (0.1, ERROR), (0.05, DISCARD)),
        NOT_POSITIVE,
        {"length": -1.0},
    ),
    "too fast": Refusal(  # 1e22 swings a second: a step of 0.1 s gets nowhere, one of 1e-25 s does
        {"gravity": 4e45}, tried((0.1, DISCARD), (0.1, ERROR), (1e-25, OK)), "", python=False
    ),
    "too many steps": Refusal(  # at 1e14 m/s2 the pendulum swings 1.6e6 times a second: some hundredths of a second
        {"gravity": 1e14},
        tried((1000.0, DISCARD), (1e-6, OK)),
        r"more than 100000 solver steps are needed beyond t = 0\.00",
        python=False,
    ),
    "symplectic": Refusal(  # with 1e6 m/s2 it makes 160 swings a second: 1 s is beyond the iteration
        {"gravity": 1e6, "symplectic_steps": 1}, tried((1.0, DISCARD), (1e-4, OK)), SYMPLECTIC, python=False
    ),
    "left behind the last stage of a symplectic step": Refusal(  # which is at 0.89 of it
        {**LEAVING, "theta_0": 0.0, "symplectic_steps": 1},
        tried((0.07, DISCARD), (0.07, ERROR), (0.05, OK)),
        NOT_POSITIVE,
        python=False,
    ),
    # Where none exists
    "not positive, held": Refusal(
        {"input_reconstruction": HOLD}, tried((0.1, ERROR), (0.01, ERROR)), NOT_POSITIVE, {"length": -1.0}
    ),
    "not positive, extrapolated": Refusal({}, tried((0.1, ERROR), (0.01, ERROR)), NOT_POSITIVE, {"length": -1.0}),
    "parameter": Refusal(
        {},
        tried((0.1, ERROR)),
        "friction = -1 at t = 0: it must be >= 0; the step from t = 0 is taken back",
        {"friction": -1.0},
        python=False,
    ),
    "parameter, while inputs are interpolated": Refusal(
        {"input_reconstruction": INTERPOLATE},
        tried((0.1, ERROR)),
        "friction = -1",
        {"friction": -1.0, "length": -1.0},
        python=False,
    ),
    "no finite rates": Refusal(
        {"friction": 1e308, "theta_dot_0": 1e10},
        tried((0.1, ERROR), (1e-9, ERROR)),
        "p_theta_dot = -inf at t = 0: the motion ends there",
        python=False,
    ),
    "overflow": Refusal(  # p grows by 1e306 a second
        {"theta_force": 1e306, "mass": 1e308, "gravity": 0.0}, tried((1e3, DISCARD)), "inf", python=False
    ),
    # Times
    **{
        f"size {size:g}": Refusal({}, tried((size, ERROR)), f"step size = {size:g}: it must be > 0")
        for size in (0.0, -0.1, math.nan, math.inf)
    },
    **{
        f"from {t:g}": Refusal({}, [(t, 0.1, ERROR)], f"step from t = {t:g}: it must be finite")
        for t in (math.inf, -math.inf, math.nan)
    },
    **{
        f"from {t:g}": Refusal({}, [(t, 0.1, ERROR)], r"step from t = \S+: the instance is at t = 0$")
        for t in (0.2, 1e300, -1e300, LARGEST)
    },
    "leads nowhere": Refusal(
        {},
        [(0.0, 0.5, OK), (0.5, 1e-17, ERROR), (0.5, 1e-15, OK)],
        r"step size = 1e-17: it is too small to lead on from t = 0\.5|from t = 0\.5 of size 1e-17: it must end later",
    ),
}


@pytest.mark.variants(core=3)
def test_refused_steps_change_nothing_and_are_named(every_pendulum) -> None:
    for name, (start, steps, said, given, python) in REFUSALS.items():
        if every_pendulum.python and not python:
            continue
        instance = every_pendulum.start(**start, options={"logging": False})  # they are said all the same
        instance.set(given)
        here, last = 0.0, (math.nan, math.nan)  # where it is; the step that was refused
        for t, size, status in steps:
            before = instance.get(*OUTPUTS)
            instance.log.clear()
            again = t == last[0] and size > last[1] * (1 - 1e-9)
            step = instance.advance(t, size)
            if status == OK:
                assert not step.status, (name, instance.log)
                here, last = t + size, (math.nan, math.nan)
                continue
            assert step.status == ((ERROR if again else DISCARD) if every_pendulum.python else status), name
            if step.status == DISCARD and not every_pendulum.python:
                assert step.time == t
            ((logged, category, message),) = instance.log
            assert (logged, category) == (step.status, f"logStatus{'Error' if logged == ERROR else 'Discard'}")
            assert re.search(said, message), name
            if "input_reconstruction" not in start:
                np.testing.assert_array_equal(instance.get(*OUTPUTS), before)
            last = t, size
        # Once what is wrong is mended it goes on.
        instance.set(length=1.0, length_dot=0.0, friction=0.0)
        instance.step(here, 1e-12 * (start.get("gravity", 0) < 1e40) or 1e-25)


def test_a_refused_step_leaves_no_trace(every_pendulum) -> None:
    """To the last bit: from a saved state, from an instance that was refused nothing, after a mended input."""
    for attempts in (1, 2):
        instance, other = every_pendulum.start(**LEAVING), every_pendulum.start(**LEAVING)
        state = instance.save()
        for _ in range(attempts):
            assert instance.step(0.0, 0.1, None)
        instance.restore(state)
        instance.step(0.0, 0.1, DISCARD)  # as if it had not been tried
        instance.restore(state)
        instance.step(0.0, 0.05)
        other.step(0.0, 0.05)
        np.testing.assert_array_equal(instance.get(*OUTPUTS), other.get(*OUTPUTS))
        instance.restore(state)
        instance.step(0.0, 0.1, DISCARD)
        instance.drop(state)
    mended, untroubled = every_pendulum.start(theta_0=0.5), every_pendulum.start(theta_0=0.5)
    mended.step(0.0, 0.25)
    mended.set(length=-0.5)
    assert mended.step(0.25, 0.25, None)
    mended.set(length=1.0)
    mended.step(0.25, 0.25)
    untroubled.follow(0.25, 2)
    np.testing.assert_array_equal(mended.get(*OUTPUTS), untroubled.get(*OUTPUTS))


def test_an_instance_goes_on_after_a_reset(every_pendulum) -> None:
    instance = every_pendulum.start(**LEAVING)
    instance.step(0.0, 0.1, DISCARD)
    instance.step(0.0, 0.1, ERROR)
    instance.do("Reset")
    instance.initialize()
    instance.set(LEAVING)
    instance.exit_initialization()
    instance.step(0.0, 0.1, DISCARD)


@pytest.mark.parametrize("symplectic", [0, 100])
def test_the_end_of_the_motion_is_discarded_once_and_named(every_fall, symplectic) -> None:
    """The fall onto a centre, x'' = -1/x² from x = 1, ends after π/√8 = 1.1107 s."""
    if every_fall.python and symplectic:
        return
    instance = every_fall.start(**({"symplectic_steps": symplectic} if symplectic else {}))
    instance.step(0.0, 1.0)
    before = instance.get("x", "v")
    for size, status in ((1.0, DISCARD), (1.0, ERROR), (0.5, DISCARD)):
        instance.step(1.0, size, status)
    np.testing.assert_array_equal(instance.get("x", "v"), before)
    assert instance.messages[0].endswith("the step from t = 1 is taken back")
    if not symplectic:
        assert instance.messages[0].startswith("x must stay > 0; at t = ")
        reached = float(instance.messages[0].split()[8])
        assert reached == pytest.approx(np.pi / np.sqrt(8), abs=1e-5)  # the last 2e-5 of x take 1e-7 s
    instance.step(1.0, 0.1)  # a step that ends before it does


# ---- times -------------------------------------------------------------------------------------------------------


def test_steps_follow_each_other_up_to_rounding(every_pendulum) -> None:
    instance = every_pendulum.start()
    instance.step(0.0, 0.1)
    instance.step(np.nextafter(0.1, 1), 0.1)  # an importer that counts time in its own way


def test_steps_end_at_finite_times(pendulum_library) -> None:
    instance = pendulum_library.instantiate()
    instance.initialize(start=LARGEST)
    instance.exit_initialization()
    instance.step(LARGEST, LARGEST, ERROR)
    assert instance.messages.pop().endswith("it must end at a finite time")
    instance.step(LARGEST, 1.0, ERROR, f"step size = 1: it is too small to lead on from t = {LARGEST:.15g}")


@pytest.mark.parametrize(
    ("experiment", "said"),
    [
        *(((None, x, None), f"start time = {x:g}: it must be finite") for x in (math.inf, -math.inf, math.nan)),
        *(((None, 0.0, x), f"stop time = {x:g}: it must be finite") for x in (math.inf, -math.inf, math.nan)),
        ((-1e-6, 0.0, None), "tolerance = -1e-06: it must be > 0 and finite"),
        ((None, 2.0, 1.0), "stop time = 1 lies before start time = 2"),
    ],
)
def test_experiments_that_make_no_sense(pendulum_library, experiment, said) -> None:
    instance = pendulum_library.instantiate()
    instance.initialize(*experiment, ERROR, said)
    instance.initialize()


def test_stop_time_is_not_stepped_over(pendulum3) -> None:
    """FMI 3.0 asks for an error; a clock that adds tenths up reaches 0.30000000000000004."""
    instance = pendulum3.instantiate()
    instance.initialize(stop=0.3)
    instance.exit_initialization()
    time = 0.0
    for _ in range(3):
        instance.step(time, 0.1)
        time += 0.1
    instance.step(time, 0.1, ERROR, "step from t = 0.3 to 0.4: the stop time is 0.3")


@pytest.mark.parametrize("number", [math.inf, -math.inf, math.nan])
def test_times_of_model_exchange_are_finite(pendulum_library, number) -> None:
    instance = pendulum_library.start(MODEL_EXCHANGE)
    instance.refuse(f"time = {number:g}: set a finite number", "SetTime", number, status=DISCARD)


# ---- numbers -----------------------------------------------------------------------------------------------------


@pytest.mark.variants(core=3)
def test_numbers_that_are_not_finite_are_refused_when_they_are_read(every_pendulum) -> None:
    instance = every_pendulum.start(length_dot=10.0, length_ddot=1e308)
    message = "power = inf at t = 0: it must be finite; choose other start values or inputs"
    for _ in range(2):  # the second time they are known
        assert instance.read("theta", "power", "p_theta")[0] == ERROR
        instance.get("theta", "energy", "mass")
    if every_pendulum.python:  # which cannot refuse to be read: the next step answers for it
        instance.step(0.0, 0.1, DISCARD)
    assert instance.messages == [message] * (2 + every_pendulum.python)


def test_a_start_whose_energy_is_not_finite_is_refused(pendulum_library) -> None:
    instance = pendulum_library.initializing(theta_dot_0=1e200)
    instance.exit_initialization(ERROR)
    assert instance.messages[-1].endswith("inf at t = 0: it must be finite; set another value and initialize again")
    instance.set(theta_dot_0=1.0)
    instance.exit_initialization()


def test_numbers_that_are_not_finite_before_initialization_ends_are_put_down_to_their_cause(fall_library) -> None:
    instance = fall_library.initializing(x_0=0.0)
    assert instance.read("x", "a")[0] == ERROR
    assert instance.messages == ["x_0 = 0 at t = 0: it must be > 0; a = -inf"]


def test_arrays_with_a_number_that_is_not_finite_name_the_element(ring_library) -> None:
    instance = ring_library.start(x_0=[0.0, 1e308, -1e308], bond=[0.0, 0.0, 3.0])
    assert instance.read("x", "p_dot")[0] == ERROR
    assert instance.messages[-1].startswith("p_dot[2] = -inf at t = 0: it must be finite")
    instance.get("x")


def test_derivatives_that_are_not_finite_are_refused(pendulum_library) -> None:
    instance = pendulum_library.start(theta_dot_0=1e140, length_dot=1e50)
    unknowns, force, known = map(instance.refs, (["theta", "length_force"], ["length_force"], ["length"]))
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
    instance = pendulum_library.running(MODEL_EXCHANGE)
    instance.do("SetContinuousStates", reals([0.0, 1e200, 0.0, 0.0]), 4)
    assert instance.read("theta", "energy")[0] == DISCARD
    assert instance.messages[-1].startswith("energy = inf")


# ---- functions of time -------------------------------------------------------------------------------------------


@pytest.mark.parametrize("target", ["fmi2", "fmi3", "python"])
def test_a_start_time_at_which_functions_of_time_overflow_is_refused(library, target) -> None:
    instance = library(FourierSeries, target).instantiate(logging=True)
    instance.initialize(start=LARGEST)
    instance.exit_initialization(ERROR)
    assert "y = nan at t = 1.79769313e+308: it must be finite" in instance.messages[-1]


@pytest.mark.parametrize("target", ["fmi2", "fmi3"])
def test_a_step_to_where_functions_of_time_overflow_is_discarded(library, target) -> None:
    instance = library(FourierSeries, target).start(cos_1=1.0, options={"logging": True})
    instance.step(0.0, LARGEST, DISCARD)
    assert "y = nan at t = 1.79769313e+308: it must be finite; the step from t = 0 is taken back" in instance.messages
    instance.step(0.0, LARGEST, ERROR)
    assert instance["y"] == 1.0
    instance.step(0.0, np.pi)
    assert instance["y"] == pytest.approx(-1.0, rel=1e-15)


def test_a_step_that_leads_nowhere_is_given_up_by_its_pace(pendulum3) -> None:
    """At 1e14 m/s2 and 1000 s, 1e10 steps of the solver would be needed: a twelfth of the most tells."""
    options = {"observer": lambda _instance, _time: None}
    instance = pendulum3.start(options=options, gravity=1e14)
    instance.step(0.0, 1000.0, DISCARD)
    assert 1000 < len(instance.seen) <= 100_000 / 12
    even = pendulum3.start(options=options, gravity=1e3)
    even.step(0.0, 300.0)
    assert 20_000 < len(even.seen) < 100_000  # at one pace, which is looked at twice at least
