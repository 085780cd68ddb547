"""Bad input: a status, one message that names what and why, and an instance that goes on as if nothing had been."""

from __future__ import annotations

import ctypes as c
import math
import struct
from typing import Any

import numpy as np
import pytest
from driver import (
    CO_SIMULATION,
    DISCARD,
    ERROR,
    MODEL_EXCHANGE,
    SCHEDULED_EXECUTION,
    SIGNATURES,
    TYPES,
    WARNING,
    reals,
)

OUTPUTS = ("theta", "p_theta", "work", "energy", "length", "friction")


# ---- values ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("values", "status", "message"),
    [
        *(
            ({"theta_force": 1.0, "length": x}, DISCARD, f"length = {x:g}: set a finite number; it stays 1")
            for x in (math.nan, math.inf, -math.inf)  # nothing of the call is taken, the good value neither
        ),
        ({"mass": 2.0}, ERROR, "mass = 2: it is a fixed parameter; set it before initialization ends"),
        ({"theta": 2.0}, ERROR, "theta = 2: it is calculated; set parameters and inputs"),
    ],
)
def test_values_that_are_refused_change_nothing(every_pendulum, values, status, message) -> None:
    python = every_pendulum.python
    running = every_pendulum.start(theta_0=1.0)
    running.step(0.0, 0.1)
    for instance in (running, *([every_pendulum.initializing()] if "mass" not in values else [])):
        before = instance.get(*OUTPUTS)
        instance.set(values, DISCARD if python else status, message)
        np.testing.assert_array_equal(instance.get(*OUTPUTS), before)
    if python:  # whose wrapper has said OK: the next step answers for it
        running.step(0.1, 0.1, DISCARD, message)
    running.step(0.1, 0.1)
    assert running.set({"length": math.nan}, None)
    running.set(length=1.1)  # makes up for it
    running.step(0.2, 0.1)
    assert running["length"] == 1.1


@pytest.mark.parametrize(
    ("values", "said"),
    [
        ({"mass": 0.0}, "mass = 0 at t = 0: it must be > 0"),
        ({"mass": -1.0}, "mass = -1 at t = 0: it must be > 0"),
        ({"friction": -0.5}, "friction = -0.5 at t = 0: it must be >= 0"),
        ({"length": -1.0}, "length = -1 at t = 0: it must be > 0"),
        ({"theta_dot_0": 1e308, "mass": 1e308}, ""),
    ],
)
def test_a_bad_start_ends_initialization_with_an_error(every_pendulum, values, said) -> None:
    instance = every_pendulum.initializing(**values)
    instance.exit_initialization(ERROR)
    (message,) = instance.messages
    assert message.startswith(said)
    assert message.endswith("set another value and initialize again")
    if every_pendulum.python:  # it stays unusable until it is reset
        assert instance.read("theta", "energy")[0] == ERROR
        for status in (DISCARD, ERROR):
            instance.step(0.0, 0.1, status)
        assert instance.messages == [message] * 4
    else:
        instance.set(mass=1.0, friction=1.0, length=1.0, theta_dot_0=0.0)
        instance.exit_initialization()
        instance.step(0.0, 0.1)
    instance.do("Reset")
    instance.initialize()
    instance.exit_initialization()
    assert instance["mass"] == 1.0
    instance.step(0.0, 0.1)


WAYS = "set 0 (hold), 1 (extrapolate) or 2 (interpolate)"
STEPS = "set 0 (the error is controlled) to 100000 in a communication step"


@pytest.mark.parametrize(
    ("name", "values", "domain"),
    [
        ("input_reconstruction", (-1, 3), WAYS),
        ("symplectic_steps", (-1, 100001), STEPS),
        ("stiff_solver", (-1, 2), "set 0 (explicit) or 1 (implicit)"),
    ],
)
def test_settings_have_their_domain_and_stay_while_it_runs(every_pendulum, name, values, domain) -> None:
    if name not in every_pendulum.references:
        return
    expected = DISCARD if every_pendulum.python else ERROR
    instance = every_pendulum.initializing()
    for value in values:
        instance.set_integer(name, value, expected, f"{name} = {value}: {domain}")
    message = f"{name} = 1: it is a fixed parameter; set it before initialization ends"
    every_pendulum.start().set_integer(name, 1, expected, message)


def test_the_time_cannot_be_set(pendulum3) -> None:
    pendulum3.start().set({"time": 1.0}, ERROR, "time = 1: the time is not a variable that can be set")


# ---- calls -------------------------------------------------------------------------------------------------------


def test_calls_out_of_turn_name_the_phase(pendulum_library) -> None:
    """Which they are is seen in tests/conformance/test_calls.py."""
    full = pendulum_library.full
    early = f"{full('DoStep')} must not be called "
    instance = pendulum_library.instantiate()
    instance.step(0.0, 0.1, ERROR, early + "before initialization")
    instance.initialize()
    instance.step(0.0, 0.1, ERROR, early + "in initialization mode")
    instance.exit_initialization()
    instance.refuse("{} must not be called between communication steps", "SetTime", 1.0)
    instance.step(0.0, 0.1)
    before = instance["theta"]
    instance.do("Terminate")
    assert instance["theta"] == before
    instance.step(0.1, 0.1, ERROR, early + "after termination")
    instance.do("Reset")
    instance.initialize()
    exchange = pendulum_library.start(MODEL_EXCHANGE)
    exchange.step(0.0, 0.1, ERROR, early + "in event mode")
    exchange.go_on()
    exchange.step(0.0, 0.1, ERROR, early + "in continuous-time mode")


def test_start_values_in_the_resources_are_not_passed_over(native_pendulum, tmp_path) -> None:
    """A copy of an FMU with other start values has a guid of its own: without them it would start somewhere else."""
    token = f"{native_pendulum.token}-0123456789abcdef"
    given = native_pendulum.instantiate(token=token)
    (message,) = given.messages
    assert message.endswith(": start values of this FMU are in its resources: give the path of that folder")
    assert not given.pointer

    given = native_pendulum.instantiate(token=token, resources=tmp_path)
    assert given.messages == [f"{tmp_path}/starts.txt cannot be read: this FMU has its start values there"]

    bits = struct.pack(">d", 2.5).hex()
    (tmp_path / "starts.txt").write_text(f"r {native_pendulum.references['mass']} 1 {bits} mass\n")
    given = native_pendulum.instantiate(token=token, resources=tmp_path)
    assert given["mass"] == 2.5
    (tmp_path / "starts.txt").unlink()
    assert given.call("Reset") == ERROR


def one(kind: Any, value: Any = 0) -> Any:
    """An array of one."""
    return (kind * 1)(value)


def reference(number: int) -> Any:
    return one(c.c_uint, number)


NUMBER, LENGTH, THETA = reals([0.0]), reference(6), reference(10)  # value references of the pendulum
NULL = "{}: argument %s is NULL"
IN_DESCRIPTION = "{}: see the model description; providesPerElementDependencies is false"
NOT_FLOATING = "value reference %d belongs to no floating-point variable; they are 1 to %d"
CALLS: list[tuple[str, str, tuple[Any, ...], str]] = [  # versions of FMI, function, arguments, message
    *(
        (fmi, f"{way}Float64", (reference(number), 1, NUMBER, 1), NOT_FLOATING % (number, last))
        for fmi, last in (("2", 21), ("3", 22))  # which has the time
        for way in ("Get", "Set")
        for number in (0, last + 1, 2**32 - 1)
    ),
    ("23", "GetInt32", (reference(0), 1, one(c.c_int), 1), "value reference 0 belongs to no integer variable"),
    ("23", "SetInt32", (reference(0), 1, one(c.c_int), 1), "value reference 0 belongs to no integer variable"),
    ("3", "GetUInt64", (LENGTH, 1, one(c.c_uint64), 1), "value reference 6 belongs to no variable of type UInt64"),
    *(("23", f"{way}Float64", (None, 1, NUMBER, 1), NULL % "references") for way in ("Get", "Set")),
    *(("23", f"{way}Float64", (LENGTH, 1, None, 1), NULL % "values") for way in ("Get", "Set")),
    ("23", "GetFMUState", (None,), NULL % "state"),
    ("23", "SetFMUState", (None,), NULL % "state"),
    ("23", "SerializedFMUStateSize", (None, None), NULL % "state"),
    ("23", "DeserializeFMUState", (None, 8, None), NULL % "bytes"),
    ("23", "GetDirectionalDerivative", (None, 1, None, 0, None, 0, None, 1), NULL % "unknowns"),
    ("23", "GetDirectionalDerivative", (THETA, 1, None, 1, None, 1, NUMBER, 1), NULL % "knowns"),
    ("23", "GetOutputDerivatives", (THETA, 1, None, None, 1), NULL % "orders"),
    *(
        (
            "23",
            "GetOutputDerivatives",
            (THETA, 1, one(c.c_int, order), NUMBER, 1),
            f"output derivatives of order {order}: the order must be 1",
        )
        for order in (0, 2)
    ),
    ("23", "GetOutputDerivatives", (LENGTH, 1, one(c.c_int, 1), NUMBER, 1), "length is no output"),
    ("3", "GetNumberOfVariableDependencies", (0, None), IN_DESCRIPTION),
    ("3", "GetVariableDependencies", (0, *[None] * 4, 0), IN_DESCRIPTION),
    (
        "2",
        "SetRealInputDerivatives",
        (LENGTH, 1, one(c.c_int, 6), NUMBER),
        "derivative of order 6 of length: the order must be 1 to 5",
    ),
    ("2", "SetRealInputDerivatives", (THETA, 1, one(c.c_int, 1), NUMBER), "theta is no input"),
    ("2", "SetRealInputDerivatives", (LENGTH, 1, None, None), NULL % "orders"),
    ("2", "CancelStep", (), "{}: no step is under way"),
    ("2", "GetRealStatus", (2, None), NULL % "value"),
]


@pytest.mark.parametrize(("versions", "function", "arguments", "message"), CALLS)
def test_calls_that_are_refused(pendulum_library, versions, function, arguments, message) -> None:
    if pendulum_library.fmi in versions:
        pendulum_library.start().refuse(message, function, *arguments)


def test_discarded_calls_of_fmi2(pendulum2) -> None:
    instance = pendulum2.start()
    message = "status of kind 0: there is none, steps are never pending"
    instance.refuse(message, "GetStatus", 0, one(c.c_int), status=DISCARD)
    message = "derivative of order 1 of length = nan: set a finite number"
    arguments = LENGTH, 1, one(c.c_int, 1), reals([math.nan])
    instance.refuse(message, "SetRealInputDerivatives", *arguments, status=DISCARD)


WITHOUT_VARIABLES = {
    **{f"{way}{kind}": kind for kind in {*TYPES, "Binary"} - {"Float64", "Int32", "UInt64"} for way in ("Get", "Set")},
    **{name: "Clock" for name in SIGNATURES["3"] if name.endswith(("Clock", "Decimal", "Fraction"))},
}


@pytest.mark.parametrize("name", sorted(WITHOUT_VARIABLES))
def test_types_without_variables(pendulum_library, name) -> None:
    if name in SIGNATURES[pendulum_library.fmi]:
        instance = pendulum_library.start(MODEL_EXCHANGE)
        types = SIGNATURES[pendulum_library.fmi][name][2:]
        none, one_more = ([n if kind is c.c_size_t else None for kind in types] for n in (0, 1))
        instance.do(name, None, 0, *none)
        message = f"there are no variables of type {WITHOUT_VARIABLES[name]}"
        instance.refuse(message, name, reference(0), 1, *one_more)


@pytest.mark.parametrize(
    ("function", "size", "message"),
    [
        ("GetContinuousStates", 3, "3 states: there are 4"),
        ("GetContinuousStateDerivatives", 3, "3 derivatives of states: there are 4"),
        ("GetNominalsOfContinuousStates", 3, "3 nominal values of states: there are 4"),
        ("GetEventIndicators", 1, "1 event indicators: there are 0"),
    ],
)
def test_vectors_of_the_wrong_length(pendulum_library, function, size, message) -> None:
    pendulum_library.start(MODEL_EXCHANGE).refuse(message, function, reals([0.0] * size), size)


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
    instance.do("SetDebugLogging", 0, 0, None)
    instance.set({"length": math.nan}, DISCARD)
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
        instance.do("SetDebugLogging", on, len(names), (c.c_char_p * len(names))(*names))
    instance.initialize(tolerance=1e-30)
    assert [entry[:2] for entry in instance.log] == ([(WARNING, "logStatusWarning")] if warned else [])


def test_marks_of_printf_and_of_references_are_escaped(pendulum_library) -> None:
    """An importer of FMI 2.0 may print the message with printf, as the standard has it."""
    shown = {"2": "100%%s ##r1##", "3": "100%s ##r1##"}[pendulum_library.fmi]
    category = one(c.c_char_p, b"100%s #r1#")
    pendulum_library.instantiate().refuse(f"there is no log category {shown}", "SetDebugLogging", 1, 1, category)


def test_very_long_texts_are_cut(pendulum_library) -> None:
    instance = pendulum_library.instantiate()
    names = (c.c_char_p * 1)(b"%" * 5000)
    assert instance.call("SetDebugLogging", 1, 1, names) == ERROR
    assert len(instance.messages[0]) < 1100
