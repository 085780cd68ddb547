"""Bad input: a status, one message that names what and why, and an instance that goes on as if nothing had been."""

from __future__ import annotations

import ctypes as c
import math
import struct

import numpy as np
import pytest
from driver import (
    CO_SIMULATION,
    DISCARD,
    ERROR,
    MODEL_EXCHANGE,
    OK,
    SCHEDULED_EXECUTION,
    SIGNATURES,
    TYPES,
    WARNING,
    Instance,
    Library,
    reals,
)

OUTPUTS = ("theta", "p_theta", "work", "energy", "length", "friction")


def initializing(library: Library, kind: str = CO_SIMULATION) -> Instance:
    instance = library.instantiate(kind)
    assert instance.initialize() == OK
    return instance


def refused(instance: Instance, status: int, expected: int, message: str) -> None:
    """The call had this status and this message."""
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
    assert instance.initialize() == OK
    assert instance.call("ExitInitializationMode") == OK
    assert instance["mass"] == 1.0


def test_what_cannot_be_set(pendulum_library) -> None:
    instance = pendulum_library.start()
    for name in ("mass", "input_reconstruction"):
        status = instance.set(mass=2.0) if name == "mass" else instance.set_integer(name, 2)
        refused(instance, status, ERROR, f"{name} = 2: it is a fixed parameter; set it before initialization ends")
    assert instance["mass"] == 1.0
    message = "theta = 2: it is calculated; set parameters and inputs"
    for item in (instance, initializing(pendulum_library)):
        refused(item, item.set(theta=2.0), ERROR, message)
    if "time" in pendulum_library.references:
        refused(instance, instance.set(time=1.0), ERROR, "time = 1: the time is not a variable that can be set")


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
    step = instance.advance(0.0, 1.0)
    assert (step.status, step.time) == (DISCARD, 0.0)
    (message,) = instance.messages
    assert message.startswith("length = -")
    assert message.endswith(": it must be > 0; the step from t = 0 is taken back")
    if mode == 1:
        np.testing.assert_array_equal(instance.get(*OUTPUTS), before)
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
    ("experiment", "message"),
    [
        ({"start": math.nan}, "start time = nan: it must be finite"),
        ({"tolerance": -1e-6}, "tolerance = -1e-06: it must be > 0 and finite"),
        ({"start": 2.0, "stop": 1.0}, "stop time = 1 lies before start time = 2"),
    ],
)
def test_experiments_that_make_no_sense(pendulum_library, experiment, message) -> None:
    instance = pendulum_library.instantiate()
    refused(instance, instance.initialize(**experiment), ERROR, message)


def test_stop_time_is_not_stepped_over(pendulum3) -> None:
    """FMI 3.0 asks for an error; a clock that adds tenths up reaches 0.30000000000000004."""
    instance = pendulum3.instantiate()
    assert instance.initialize(stop=0.3) == OK
    assert instance.call("ExitInitializationMode") == OK
    time = 0.0
    for _ in range(3):
        assert instance.step(time, 0.1) == OK
        time += 0.1
    refused(instance, instance.step(time, 0.1), ERROR, "step from t = 0.3 to 0.4: the stop time is 0.3")


# ---- calls -------------------------------------------------------------------------------------------------------


def test_calls_out_of_turn_name_the_phase(pendulum_library) -> None:
    """Which they are is seen in tests/conformance/test_calls.py."""
    full = pendulum_library.full
    instance = pendulum_library.instantiate()
    refused(instance, instance.step(0.0, 0.1), ERROR, f"{full('DoStep')} must not be called before initialization")
    assert instance.initialize() == OK
    refused(instance, instance.step(0.0, 0.1), ERROR, f"{full('DoStep')} must not be called in initialization mode")
    assert instance.call("ExitInitializationMode") == OK
    message = f"{full('SetTime')} must not be called between communication steps"
    refused(instance, instance.call("SetTime", 1.0), ERROR, message)
    assert instance.step(0.0, 0.1) == OK
    before = instance["theta"]
    assert instance.call("Terminate") == OK
    assert instance["theta"] == before
    refused(instance, instance.step(0.1, 0.1), ERROR, f"{full('DoStep')} must not be called after termination")
    assert instance.call("Reset") == OK
    assert instance.initialize() == OK
    exchange = pendulum_library.start(MODEL_EXCHANGE)
    refused(exchange, exchange.step(0.0, 0.1), ERROR, f"{full('DoStep')} must not be called in event mode")
    exchange.go_on()
    refused(exchange, exchange.step(0.0, 0.1), ERROR, f"{full('DoStep')} must not be called in continuous-time mode")


def test_start_values_in_the_resources_are_not_passed_over(pendulum_library, tmp_path) -> None:
    """A copy of an FMU with other start values has a guid of its own: without them it would start somewhere else."""
    token = f"{pendulum_library.token}-0123456789abcdef"
    given = pendulum_library.instantiate(token=token)
    (message,) = given.messages
    assert message.endswith(": start values of this FMU are in its resources: give the path of that folder")
    assert not given.pointer

    given = pendulum_library.instantiate(token=token, resources=tmp_path)
    assert given.messages == [f"{tmp_path}/starts.txt cannot be read: this FMU has its start values there"]

    bits = struct.pack(">d", 2.5).hex()
    (tmp_path / "starts.txt").write_text(f"r {pendulum_library.references['mass']} 1 {bits} mass\n")
    given = pendulum_library.instantiate(token=token, resources=tmp_path)
    assert given["mass"] == 2.5
    (tmp_path / "starts.txt").unlink()
    assert given.call("Reset") == ERROR


def test_references_that_do_not_exist(pendulum_library) -> None:
    instance = pendulum_library.start()
    last = pendulum_library.references["input_reconstruction"] - 1
    for reference in (0, last + 1, 2**32 - 1):
        message = f"value reference {reference} belongs to no floating-point variable; they are 1 to {last}"
        for function in ("GetFloat64", "SetFloat64"):
            status = instance.call(function, (c.c_uint * 1)(reference), 1, reals([0.0]), 1)
            refused(instance, status, ERROR, message)
    for function in ("GetInt32", "SetInt32"):
        status = instance.call(function, (c.c_uint * 1)(0), 1, (c.c_int * 1)(), 1)
        refused(instance, status, ERROR, "value reference 0 belongs to no integer variable")
    if pendulum_library.fmi == "3":
        status = instance.call("GetUInt64", (c.c_uint * 1)(last), 1, (c.c_uint64 * 1)(), 1)
        refused(instance, status, ERROR, f"value reference {last} belongs to no variable of type UInt64")


@pytest.mark.parametrize("name", sorted(TYPES.keys() - {"Float64", "Int32", "UInt64"}))
def test_types_without_variables(pendulum_library, name) -> None:
    if f"Get{name}" not in SIGNATURES[pendulum_library.fmi]:
        return
    instance = pendulum_library.start()
    for way in ("Get", "Set"):
        assert instance.call(f"{way}{name}", None, 0, None, 0) == OK
        status = instance.call(f"{way}{name}", (c.c_uint * 1)(0), 1, None, 1)
        refused(instance, status, ERROR, f"there are no variables of type {name}")


def test_binaries_and_clocks(pendulum3) -> None:
    instance = pendulum3.start(MODEL_EXCHANGE)
    for way in ("Get", "Set"):
        assert instance.call(f"{way}Binary", None, 0, None, None, 0) == OK
        status = instance.call(f"{way}Binary", (c.c_uint * 1)(0), 1, (c.c_size_t * 1)(), (c.c_void_p * 1)(), 1)
        refused(instance, status, ERROR, "there are no variables of type Binary")
    clocks = [name for name in SIGNATURES["3"] if name.endswith(("Clock", "Decimal", "Fraction"))]
    assert len(clocks) == 10
    for name in clocks:
        rest = [None] * (len(SIGNATURES["3"][name]) - 2)
        assert instance.call(name, None, 0, *rest) == OK
        status = instance.call(name, (c.c_uint * 1)(0), 1, *rest)
        refused(instance, status, ERROR, "there are no variables of type Clock")


def test_dependencies_are_in_the_description_only(pendulum3) -> None:
    instance = pendulum3.start()
    arguments = {"GetNumberOfVariableDependencies": [None], "GetVariableDependencies": [*[None] * 4, 0]}
    for name, rest in arguments.items():
        message = f"fmi3{name}: see the model description; providesPerElementDependencies is false"
        refused(instance, instance.call(name, 0, *rest), ERROR, message)


@pytest.mark.parametrize(
    ("function", "arguments", "name"),
    [
        ("GetFloat64", (None, 1, reals([0]), 1), "references"),
        ("GetFloat64", ((c.c_uint * 1)(0), 1, None, 1), "values"),
        ("SetFloat64", (None, 1, reals([0]), 1), "references"),
        ("SetFloat64", ((c.c_uint * 1)(0), 1, None, 1), "values"),
        ("GetFMUState", (None,), "state"),
        ("SetFMUState", (None,), "state"),
        ("SerializedFMUStateSize", (None, None), "state"),
        ("DeserializeFMUState", (None, 8, None), "bytes"),
        ("GetDirectionalDerivative", (None, 1, None, 0, None, 0, None, 1), "unknowns"),
        ("GetDirectionalDerivative", ((c.c_uint * 1)(9), 1, None, 1, None, 1, reals([0]), 1), "knowns"),
        ("GetOutputDerivatives", ((c.c_uint * 1)(9), 1, None, None, 1), "orders"),
    ],
)
def test_missing_arguments(pendulum_library, function, arguments, name) -> None:
    instance = pendulum_library.start()
    refused(
        instance,
        instance.call(function, *arguments),
        ERROR,
        f"{instance.library.full(function)}: argument {name} is NULL",
    )


@pytest.mark.parametrize(
    ("function", "what"),
    [
        ("GetContinuousStates", "states"),
        ("GetContinuousStateDerivatives", "derivatives of states"),
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
    for order in (0, 2):
        status = instance.call("GetOutputDerivatives", theta, 1, (c.c_int * 1)(order), reals([0.0]), 1)
        refused(instance, status, ERROR, f"output derivatives of order {order}: the order must be 1")
    status = instance.call("GetOutputDerivatives", length, 1, (c.c_int * 1)(1), reals([0.0]), 1)
    refused(instance, status, ERROR, "length is no output")


def test_orders_of_input_derivatives(pendulum2) -> None:
    instance = pendulum2.start()
    for name, order, value, expected, message in (
        ("length", 6, 1.0, ERROR, "derivative of order 6 of length: the order must be 1 to 5"),
        ("theta", 1, 1.0, ERROR, "theta is no input"),
        ("length", 1, math.nan, DISCARD, "derivative of order 1 of length = nan: set a finite number"),
    ):
        arguments = (instance.refs([name]), 1, (c.c_int * 1)(order), reals([value]))
        refused(instance, instance.call("SetRealInputDerivatives", *arguments), expected, message)


def test_what_fmi2_alone_has(pendulum2) -> None:
    instance = pendulum2.start()
    message = "status of kind 0: there is none, steps are never pending"
    refused(instance, instance.call("GetStatus", 0, (c.c_int * 1)()), DISCARD, message)
    refused(instance, instance.call("CancelStep"), ERROR, "fmi2CancelStep: no step is under way")
    status = instance.call("SetRealInputDerivatives", (c.c_uint * 1)(5), 1, None, None)
    refused(instance, status, ERROR, "fmi2SetRealInputDerivatives: argument orders is NULL")
    refused(instance, instance.call("GetRealStatus", 2, None), ERROR, "fmi2GetRealStatus: argument value is NULL")


def test_no_instance(pendulum_library) -> None:
    """Every function, with NULL for the instance: an error and no crash."""
    for name, types in SIGNATURES[pendulum_library.fmi].items():
        entry = getattr(pendulum_library.functions, pendulum_library.full(name))
        entry.argtypes = [c.c_void_p, *types]
        assert entry(None, *map(nothing, types)) == ERROR, name
    getattr(pendulum_library.functions, f"fmi{pendulum_library.fmi}FreeInstance")(None)


def nothing(kind) -> object:
    return kind(0) if kind in {c.c_double, c.c_bool, c.c_size_t, c.c_uint, c.c_int} else None


@pytest.mark.parametrize("kind", [CO_SIMULATION, MODEL_EXCHANGE])
@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"name": b" "}, "the instance name is missing"),
        ({"name": None}, "the instance name is missing"),
        ({"token": "{other}"}, "the guid of the model description is not that of the binary"),
    ],
)
def test_instantiation_that_is_refused(pendulum_library, kind, options, message) -> None:
    instance = pendulum_library.instantiate(kind, **options)
    assert instance.pointer is None
    assert instance.messages == [
        f"fmi{'2Instantiate' if pendulum_library.fmi == '2' else f'3Instantiate{kind}'}: {message}"
    ]


def test_scheduled_execution_is_refused(pendulum3) -> None:
    instance = pendulum3.instantiate(SCHEDULED_EXECUTION)
    assert instance.pointer is None
    (message,) = instance.messages
    assert message.startswith("fmi3InstantiateScheduledExecution: ")


# ---- the logger --------------------------------------------------------------------------------------------------


def test_what_is_refused_is_logged_whatever_is_switched_off(pendulum_library) -> None:
    instance = pendulum_library.instantiate(logging=False)
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
    instance = pendulum_library.instantiate(logging=False)
    for on, names in switches:
        assert instance.call("SetDebugLogging", on, len(names), (c.c_char_p * len(names))(*names)) == OK
    assert instance.initialize(tolerance=1e-30) == OK
    assert [entry[:2] for entry in instance.log] == ([(WARNING, "logStatusWarning")] if warned else [])


@pytest.mark.parametrize(("text", "shown"), [(b"100%s #r1#", {"2": "100%%s ##r1##", "3": "100%s ##r1##"})])
def test_marks_of_printf_and_of_references_are_escaped(pendulum_library, text, shown) -> None:
    """An importer of FMI 2.0 may print the message with printf, as the standard has it."""
    instance = pendulum_library.instantiate()
    status = instance.call("SetDebugLogging", 1, 1, (c.c_char_p * 1)(text))
    refused(instance, status, ERROR, f"there is no log category {shown[pendulum_library.fmi]}")


def test_very_long_texts_are_cut(pendulum_library) -> None:
    instance = pendulum_library.instantiate()
    names = (c.c_char_p * 1)(b"%" * 5000)
    assert instance.call("SetDebugLogging", 1, 1, names) == ERROR
    assert len(instance.messages[0]) < 1100
