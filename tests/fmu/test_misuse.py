"""Bad input: a status, one message that names what and why, and an instance that goes on as if nothing had been."""

from __future__ import annotations

import ctypes as c
import math
import struct

import numpy as np
import pytest
from driver import CO_SIMULATION, DISCARD, ERROR, MODEL_EXCHANGE, OK, WARNING, Instance, Library, reals

OUTPUTS = ("theta", "p_theta", "work", "energy", "length", "friction")


def initializing(library: Library, kind: int = CO_SIMULATION) -> Instance:
    instance = library.instantiate(kind)
    assert instance.setup() == OK
    assert instance.call("EnterInitializationMode") == OK
    return instance


def refused(instance: Instance, status: int, expected: int, message: str) -> None:
    """The call had this status and this message, and the instance can be read as before."""
    assert (status, instance.messages) == (expected, [message])
    instance.messages.clear()


# ---- values ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("value", "word"), [(math.nan, "nan"), (math.inf, "inf"), (-math.inf, "-inf")])
def test_numbers_that_are_not_finite_are_discarded(pendulum_library, value, word) -> None:
    for instance in (initializing(pendulum_library), pendulum_library.start()):
        before = instance.get(*OUTPUTS)
        status = instance.set(theta_force=1.0, length=value)  # nothing of the call is taken, the good value neither
        refused(instance, status, DISCARD, f"length = {word}: set a finite number; it stays 1")
        np.testing.assert_array_equal(instance.get(*OUTPUTS), before)


@pytest.mark.parametrize(
    ("name", "value", "domain"), [("mass", 0.0, "> 0"), ("mass", -1.0, "> 0"), ("friction", -0.5, ">= 0")]
)
def test_parameters_outside_their_domain_end_initialization_with_an_error(
    pendulum_library, name, value, domain
) -> None:
    instance = initializing(pendulum_library)
    assert instance.set({name: value}) == OK
    message = f"{name} = {value:g} at t = 0: it must be {domain}; set another value and initialize again"
    refused(instance, instance.call("ExitInitializationMode"), ERROR, message)
    assert instance.set({name: 1.0}) == OK
    assert instance.call("ExitInitializationMode") == OK
    assert instance.step(0.0, 0.1) == OK


def test_reset_after_a_failed_initialization(pendulum_library) -> None:
    instance = initializing(pendulum_library)
    assert instance.set(mass=-1.0) == OK
    assert instance.call("ExitInitializationMode") == ERROR
    assert instance.call("Reset") == OK
    assert instance.setup() == OK
    assert instance.call("EnterInitializationMode") == OK
    assert instance.call("ExitInitializationMode") == OK
    assert instance["mass"] == 1.0


def test_fixed_parameter_cannot_be_set_after_initialization(pendulum_library) -> None:
    instance = pendulum_library.start()
    message = "mass = 2: it is a fixed parameter; set it before initialization ends"
    refused(instance, instance.set(mass=2.0), ERROR, message)
    assert instance["mass"] == 1.0
    message = "input_reconstruction = 2: it is a fixed parameter; set it before initialization ends"
    refused(instance, instance.set_integer("input_reconstruction", 2), ERROR, message)


def test_outputs_cannot_be_set(pendulum_library) -> None:
    message = "theta = 2: it is calculated; set parameters and inputs"
    instance = initializing(pendulum_library)
    refused(instance, instance.set(theta=2.0), ERROR, message)


def test_tunable_parameter_outside_its_domain_takes_the_step_back(pendulum_library) -> None:
    instance = pendulum_library.start()
    assert instance.set(friction=-1.0) == OK
    message = "friction = -1 at t = 0: it must be >= 0; the step from t = 0 is taken back"
    refused(instance, instance.step(0.0, 0.1), ERROR, message)  # no shorter step would do
    assert instance.set(friction=0.0) == OK
    assert instance.step(0.0, 0.1) == OK


def test_reconstruction_that_does_not_exist(pendulum_library) -> None:
    instance = initializing(pendulum_library)
    message = "input_reconstruction = 3: set 0 (hold), 1 (extrapolate) or 2 (interpolate)"
    refused(instance, instance.set_integer("input_reconstruction", 3), ERROR, message)


# ---- inputs that leave their domain ------------------------------------------------------------------------------


def test_length_that_is_not_positive_takes_the_step_back(pendulum_library) -> None:
    instance = pendulum_library.start(theta_0=0.5)
    assert instance.step(0.0, 0.25) == OK
    assert instance.set(length=-0.5) == OK
    message = "length = -0.5 at t = 0.25: it must be > 0; the step from t = 0.25 is taken back"
    refused(instance, instance.step(0.25, 0.25), ERROR, message)  # no shorter step would do
    assert instance.set(length=1.0) == OK
    assert instance.step(0.25, 0.25) == OK
    untroubled = pendulum_library.start(theta_0=0.5)
    for i in range(2):
        assert untroubled.step(i * 0.25, 0.25) == OK
    np.testing.assert_array_equal(instance.get(*OUTPUTS), untroubled.get(*OUTPUTS))


@pytest.mark.parametrize("mode", [1, 2])
def test_length_driven_through_zero_discards_the_step(pendulum_library, mode) -> None:
    instance = pendulum_library.start(theta_0=0.5, length_dot=-2.0, input_reconstruction=mode)
    before = instance.get(*OUTPUTS)
    if mode == 2:
        assert instance.set(length=0.1, length_dot=2.0) == OK  # positive at both ends, but not between them
    assert instance.step(0.0, 1.0) == DISCARD
    (message,) = instance.messages
    assert message.startswith("length = -")
    assert message.endswith(": it must be > 0; the step from t = 0 is taken back")
    if mode == 1:
        np.testing.assert_array_equal(instance.get(*OUTPUTS), before)
    time = (c.c_double * 1)(math.nan)
    assert instance.call("GetRealStatus", 2, time) == OK  # fmi2LastSuccessfulTime
    assert time[0] == 0.0
    assert instance.set(length=1.0, length_dot=0.0) == OK
    assert instance.step(0.0, 1.0) == OK


# ---- steps -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("size", [0.0, -0.1, math.nan, math.inf])
def test_step_sizes_must_be_positive_and_finite(pendulum_library, size) -> None:
    instance = pendulum_library.start()
    status = instance.step(0.0, size)
    (message,) = instance.messages
    assert status == ERROR
    assert message == f"step size = {size:g}: it must be > 0 and finite"
    assert instance.step(0.0, 0.1) == OK


def test_steps_must_follow_each_other(pendulum_library) -> None:
    instance = pendulum_library.start()
    assert instance.step(0.0, 0.1) == OK
    refused(instance, instance.step(0.2, 0.1), ERROR, "step from t = 0.2: the instance is at t = 0.1")
    assert instance.step(np.nextafter(0.1, 1), 0.1) == OK  # an importer that counts time in its own way


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ((0, 0.0, math.nan, 0, 0.0), "start time = nan: it must be finite"),
        ((1, -1e-6, 0.0, 0, 0.0), "tolerance = -1e-06: it must be > 0 and finite"),
        ((0, 0.0, 2.0, 1, 1.0), "stop time = 1 lies before start time = 2"),
    ],
)
def test_experiments_that_make_no_sense(pendulum_library, arguments, message) -> None:
    instance = pendulum_library.instantiate()
    refused(instance, instance.call("SetupExperiment", *arguments), ERROR, message)


# ---- calls -------------------------------------------------------------------------------------------------------

_PHASES = {
    "before initialization": lambda library: library.instantiate(),
    "in initialization mode": initializing,
    "between communication steps": lambda library: library.start(),
    "in event mode": lambda library: library.start(MODEL_EXCHANGE),
}
_CALLS = [
    ("DoStep", (0.0, 0.1, 1), ["before initialization", "in initialization mode", "in event mode"]),
    ("ExitInitializationMode", (), ["before initialization", "between communication steps", "in event mode"]),
    ("EnterInitializationMode", (), ["in initialization mode", "between communication steps", "in event mode"]),
    ("SetupExperiment", (0, 0.0, 0.0, 0, 0.0), ["in initialization mode", "between communication steps"]),
    ("Terminate", (), ["before initialization", "in initialization mode"]),
    ("EnterEventMode", (), ["between communication steps", "in initialization mode"]),
    ("EnterContinuousTimeMode", (), ["between communication steps", "in initialization mode"]),
    ("SetTime", (1.0,), ["between communication steps", "before initialization"]),
    ("SetContinuousStates", (None, 0), ["between communication steps", "in event mode"]),
    ("CancelStep", (), ["in initialization mode"]),
]


@pytest.mark.parametrize(
    ("function", "arguments", "phase"), [(f, arguments, phase) for f, arguments, phases in _CALLS for phase in phases]
)
def test_calls_out_of_order(pendulum_library, function, arguments, phase) -> None:
    instance = _PHASES[phase](pendulum_library)
    refused(instance, instance.call(function, *arguments), ERROR, f"fmi2{function} must not be called {phase}")


def test_after_termination_only_reading(pendulum_library) -> None:
    instance = pendulum_library.start()
    assert instance.step(0.0, 0.1) == OK
    before = instance["theta"]
    assert instance.call("Terminate") == OK
    assert instance["theta"] == before
    refused(instance, instance.step(0.1, 0.1), ERROR, "fmi2DoStep must not be called after termination")
    refused(instance, instance.set(length=1.0), ERROR, "fmi2SetReal must not be called after termination")


@pytest.mark.parametrize("library", ["pendulum_library", "pendulum3"])
def test_start_values_in_the_resources_are_not_passed_over(request, library, tmp_path) -> None:
    """A copy of an FMU with other start values has a guid of its own: without them it would start somewhere else."""
    made = request.getfixturevalue(library)
    two = library == "pendulum_library"
    guid = made.description.guid or made.description.instantiationToken
    names = {"guid" if two else "token": f"{guid}-0123456789abcdef"}
    given = made.instantiate(**names)
    (message,) = given.messages
    assert message.endswith(": start values of this FMU are in its resources: give the path of that folder")
    assert not (given.component if two else given.pointer)

    folder = tmp_path.as_uri() if two else str(tmp_path)
    given = made.instantiate(**names, resources=folder)
    (message,) = given.messages
    assert message == f"{tmp_path}/starts.txt cannot be read: this FMU has its start values there"

    bits = struct.pack(">d", 2.5).hex()
    (tmp_path / "starts.txt").write_text(f"r {made.references['mass']} 1 {bits} mass\n")
    given = made.instantiate(**names, resources=folder)
    assert given["mass"] == 2.5
    (tmp_path / "starts.txt").unlink()
    assert given.call("Reset") == ERROR


def test_references_that_do_not_exist(pendulum_library) -> None:
    instance = pendulum_library.start()
    last = instance.library.references["input_reconstruction"] - 1
    for reference in (0, 99, 2**32 - 1):
        message = f"value reference {reference} belongs to no floating-point variable; they are 1 to {last}"
        for function in ("GetReal", "SetReal"):
            refused(instance, instance.call(function, (c.c_uint * 1)(reference), 1, reals([0.0])), ERROR, message)
    message = "value reference 0 belongs to no integer variable"
    for function in ("GetInteger", "SetInteger"):
        refused(instance, instance.call(function, (c.c_uint * 1)(0), 1, (c.c_int * 1)()), ERROR, message)
    status = instance.call("GetBoolean", (c.c_uint * 1)(0), 1, (c.c_int * 1)())
    refused(instance, status, ERROR, "there are no variables of type Boolean")
    status = instance.call("SetString", (c.c_uint * 1)(0), 1, (c.c_char_p * 1)(b"x"))
    refused(instance, status, ERROR, "there are no variables of type String")


@pytest.mark.parametrize(
    ("function", "arguments", "name"),
    [
        ("GetReal", (None, 1, reals([0])), "references"),
        ("GetReal", ((c.c_uint * 1)(0), 1, None), "values"),
        ("SetReal", (None, 1, reals([0])), "references"),
        ("SetReal", ((c.c_uint * 1)(0), 1, None), "values"),
        ("GetFMUstate", (None,), "state"),
        ("SetFMUstate", (None,), "state"),
        ("SerializedFMUstateSize", (None, None), "state"),
        ("DeSerializeFMUstate", (None, 8, None), "bytes"),
        ("GetDirectionalDerivative", (None, 1, None, 0, None, None), "unknowns"),
        ("GetDirectionalDerivative", ((c.c_uint * 1)(9), 1, None, 1, None, reals([0])), "knowns"),
        ("SetRealInputDerivatives", ((c.c_uint * 1)(5), 1, None, None), "order"),
        ("GetRealOutputDerivatives", ((c.c_uint * 1)(9), 1, None, None), "order"),
        ("GetRealStatus", (2, None), "value"),
    ],
)
def test_missing_arguments(pendulum_library, function, arguments, name) -> None:
    instance = pendulum_library.start()
    refused(instance, instance.call(function, *arguments), ERROR, f"fmi2{function}: argument {name} is NULL")


@pytest.mark.parametrize(
    ("function", "what"),
    [
        ("GetContinuousStates", "states"),
        ("GetDerivatives", "derivatives of states"),
        ("GetNominalsOfContinuousStates", "nominal values of states"),
    ],
)
def test_vectors_of_the_wrong_length(pendulum_library, function, what) -> None:
    instance = pendulum_library.start(MODEL_EXCHANGE)
    refused(instance, instance.call(function, reals([0.0] * 3), 3), ERROR, f"3 {what}: there are 4")
    refused(instance, instance.call("GetEventIndicators", reals([0.0]), 1), ERROR, "1 event indicators: there are 0")


def test_orders_of_derivatives(pendulum_library) -> None:
    instance = pendulum_library.start()
    length, theta = instance.refs(["length"]), instance.refs(["theta"])
    status = instance.call("SetRealInputDerivatives", length, 1, (c.c_int * 1)(6), reals([1.0]))
    refused(instance, status, ERROR, "derivative of order 6 of length: the order must be 1 to 5")
    status = instance.call("SetRealInputDerivatives", theta, 1, (c.c_int * 1)(1), reals([1.0]))
    refused(instance, status, ERROR, "theta is no input")
    status = instance.call("SetRealInputDerivatives", length, 1, (c.c_int * 1)(1), reals([math.nan]))
    refused(instance, status, DISCARD, "derivative of order 1 of length = nan: set a finite number")
    status = instance.call("GetRealOutputDerivatives", theta, 1, (c.c_int * 1)(2), reals([0.0]))
    refused(instance, status, ERROR, "output derivatives of order 2: the order must be 1")
    status = instance.call("GetRealOutputDerivatives", length, 1, (c.c_int * 1)(1), reals([0.0]))
    refused(instance, status, ERROR, "length is no output")


def test_status_of_a_step_that_never_is_pending(pendulum_library) -> None:
    instance = pendulum_library.start()
    message = "status of kind 0: there is none, steps are never pending"
    refused(instance, instance.call("GetStatus", 0, (c.c_int * 1)()), DISCARD, message)
    refused(instance, instance.call("CancelStep"), ERROR, "fmi2CancelStep: no step is under way")


def test_no_instance(pendulum_library) -> None:
    functions = pendulum_library.functions
    assert functions.fmi2DoStep(None, c.c_double(0.0), c.c_double(0.1), 1) == ERROR
    assert functions.fmi2GetReal(None, None, c.c_size_t(0), None) == ERROR
    assert functions.fmi2Terminate(None) == ERROR
    functions.fmi2FreeInstance(None)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"name": b""}, "fmi2Instantiate: the instance name is missing"),
        ({"name": None}, "fmi2Instantiate: the instance name is missing"),
        ({"guid": "{other}"}, "fmi2Instantiate: the guid of the model description is not that of the binary"),
    ],
)
def test_instantiation_that_is_refused(pendulum_library, options, message) -> None:
    instance = pendulum_library.instantiate(**options)
    assert instance.component is None
    assert instance.messages == [message]


# ---- the logger --------------------------------------------------------------------------------------------------


def test_what_is_refused_is_logged_whatever_is_switched_off(pendulum_library) -> None:
    instance = pendulum_library.instantiate(logging=0)
    assert instance.call("SetDebugLogging", 0, 0, None) == OK
    assert instance.set(length=math.nan) == DISCARD
    assert instance.call("Terminate") == ERROR
    assert [entry[:2] for entry in instance.log] == [(DISCARD, "logStatusDiscard"), (ERROR, "logStatusError")]


@pytest.mark.parametrize(
    ("switches", "warned"),
    [
        ([(1, [])], True),
        ([(0, [])], False),
        ([(1, [b"logStatusWarning", b"logStatusError"])], True),
        ([(1, [b"logStatusError"])], False),
        ([(1, []), (0, [b"logStatusWarning"])], False),
    ],
)
def test_warnings_can_be_switched(pendulum_library, switches, warned) -> None:
    instance = pendulum_library.instantiate(logging=0)
    for on, names in switches:
        assert instance.call("SetDebugLogging", on, len(names), (c.c_char_p * len(names))(*names)) == OK
    assert instance.setup(tolerance=1e-30) == OK
    assert [entry[:2] for entry in instance.log] == ([(WARNING, "logStatusWarning")] if warned else [])


def test_marks_of_printf_and_of_references_are_escaped(pendulum_library) -> None:
    """An importer that prints the message with printf, as the standard has it, must not read formats in it."""
    instance = pendulum_library.instantiate()
    names = (c.c_char_p * 1)(b"100%s #r1#")
    status = instance.call("SetDebugLogging", 1, 1, names)
    refused(instance, status, ERROR, "there is no log category 100%%s ##r1##")


def test_very_long_texts_are_cut(pendulum_library) -> None:
    instance = pendulum_library.instantiate()
    names = (c.c_char_p * 1)(b"%" * 5000)
    assert instance.call("SetDebugLogging", 1, 1, names) == ERROR
    assert len(instance.messages[0]) < 1100
