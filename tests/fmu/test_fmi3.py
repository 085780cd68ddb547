"""FMI 3.0: description and binary belong together; every function, in and out of turn, with and without arguments."""

from __future__ import annotations

import ctypes as c
import math
import shutil
import subprocess
import zipfile
from pathlib import Path
from xml.etree import ElementTree

import fmpy
import numpy as np
import pytest
from driver import DISCARD, ERROR, OK, WARNING, reals
from driver3 import (
    BOOL,
    CO_SIMULATION,
    MODEL_EXCHANGE,
    SCHEDULED_EXECUTION,
    SIGNATURES,
    SIZES,
    TYPES,
    Instance3,
)
from fmpy.validation import validate_fmu
from handmade import pendulum

from liaisons import compiler
from liaisons.errors import BuildError
from liaisons.fmu import build
from liaisons.fmu.code import source_files


def refused(instance: Instance3, status: int, message: str, expected: int = ERROR) -> None:
    assert (status, instance.messages) == (expected, [message])
    instance.messages.clear()


# ---- the file ----------------------------------------------------------------------------------------------------


def test_place_and_name_of_the_file(folder, pendulum3) -> None:
    assert pendulum3.path == folder / "fmi3" / "HandPendulum.fmu"
    with zipfile.ZipFile(pendulum3.path) as content:
        names = content.namelist()
        library = content.read(f"binaries/{fmpy.platform_tuple}/HandPendulum{fmpy.sharedLibraryExtension}")
    assert names[0] == "modelDescription.xml"
    sources = {name.removeprefix("sources/") for name in names if name.startswith("sources/")}
    assert sources >= {"model.c", "fmi3.c", "core.c", "fmi3Functions.h", "fmi3PlatformTypes.h", "buildDescription.xml"}
    assert not any("fmi2" in name for name in sources)
    assert b"/tmp" not in library


@pytest.mark.parametrize("library", ["pendulum3", "fall3", "kick3"])
def test_validator_finds_nothing(request, library) -> None:
    assert validate_fmu(str(request.getfixturevalue(library).path)) == []


def test_description_says_the_same_as_that_of_fmi2(pendulum3, pendulum_library) -> None:
    three, two = pendulum3.description, pendulum_library.description
    for old in two.modelVariables[:-2]:  # behind them FMI 3.0 has the time
        new = three.modelVariables[old.valueReference - 1]
        for attribute in ("name", "description", "causality", "variability", "initial", "unit", "displayUnit"):
            assert getattr(new, attribute) == getattr(old, attribute), (new.name, attribute)
        for attribute in ("start", "min", "max", "nominal"):
            found, expected = (getattr(v, attribute) for v in (new, old))
            assert (found and float(found)) == (expected and float(expected)), (new.name, attribute)
        assert (new.derivative and new.derivative.name) == (old.derivative and old.derivative.name)
    for part in ("outputs", "derivatives", "initialUnknowns"):
        names = [[u.variable.name for u in getattr(d, part)] for d in (two, three)]
        assert sorted(names[0]) == sorted(names[1])
    assert three.coSimulation.hasEventMode
    assert three.coSimulation.providesIntermediateUpdate
    assert three.coSimulation.canReturnEarlyAfterIntermediateUpdate
    assert three.modelExchange.providesAdjointDerivatives
    assert (three.defaultExperiment.stopTime, two.defaultExperiment.stopTime) == ("5.0", "5.0")


def test_return_before_the_end_is_announced_where_there_are_instants(kick3, pendulum3) -> None:
    assert kick3.description.coSimulation.mightReturnEarlyFromDoStep
    assert not pendulum3.description.coSimulation.mightReturnEarlyFromDoStep


def test_every_function_of_the_standard_is_exported_and_nothing_else(pendulum3, tmp_path) -> None:
    if not shutil.which("nm"):
        pytest.skip("nm is not installed")
    with zipfile.ZipFile(pendulum3.path) as content:
        library = content.extract(f"binaries/{fmpy.platform_tuple}/HandPendulum{fmpy.sharedLibraryExtension}", tmp_path)
    lines = subprocess.check_output(["nm", "-D", "--defined-only", library], text=True).splitlines()
    header = (Path(fmpy.__file__).parent / "c-code" / "fmi3Functions.h").read_text()
    declared = {line.split()[2].rstrip(";") for line in header.splitlines() if line.startswith("FMI3_Export")}
    assert {line.split()[-1] for line in lines} == declared
    life = {"GetVersion", "FreeInstance", *(f"Instantiate{kind}" for kind in (MODEL_EXCHANGE, CO_SIMULATION))}
    life.add(f"Instantiate{SCHEDULED_EXECUTION}")
    assert {name.removeprefix("fmi3") for name in declared} == SIGNATURES.keys() | life  # the driver knows all


def test_sources_compile_on_their_own(pendulum3, tmp_path, capfd) -> None:
    folder = Path(fmpy.extract(str(pendulum3.path), unzipdir=str(tmp_path / "fmu")))
    root = ElementTree.parse(folder / "sources" / "buildDescription.xml")
    files = [element.attrib["name"] for element in root.iter("SourceFile")]
    cc = compiler.system_compiler() or compiler.zig_compiler()
    assert cc is not None
    flags = ["-std=c99", "-Wall", "-Wextra", "-pedantic", "-Werror", "-fPIC", "-shared"]
    subprocess.run([*cc, *flags, *files, "-o", tmp_path / "library.so", "-lm"], cwd=folder / "sources", check=True)
    assert capfd.readouterr().err == ""


def test_what_cannot_be_built(tmp_path, monkeypatch) -> None:
    with pytest.raises(BuildError, match=r"FMUs in Python are FMI 2\.0; for FMI 3\.0 take backend='native'"):
        build(pendulum(), tmp_path, backend="python", fmi="3")
    with pytest.raises(BuildError, match="fmi = '1': choose one of '2', '3'"):
        build(pendulum(), tmp_path, fmi="1")  # pyright: ignore[reportArgumentType]
    monkeypatch.setattr("liaisons.fmu.code.find_spec", lambda _: None)
    with pytest.raises(BuildError, match=r"fmi3Functions\.h is missing in the installed fmpy"):
        source_files(pendulum(), "{}", "3")


# ---- life --------------------------------------------------------------------------------------------------------


def test_version(pendulum3) -> None:
    pendulum3.functions.fmi3GetVersion.restype = c.c_char_p
    assert pendulum3.functions.fmi3GetVersion() == b"3.0"


@pytest.mark.parametrize("kind", [CO_SIMULATION, MODEL_EXCHANGE])
@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"name": b" "}, "the instance name is missing"),
        ({"name": None}, "the instance name is missing"),
        ({"token": "{other}"}, "the guid of the model description is not that of the binary"),
    ],
)
def test_instantiation_that_is_refused(pendulum3, kind, options, message) -> None:
    instance = pendulum3.instantiate(kind, **options)
    assert instance.pointer is None
    assert instance.messages == [f"fmi3Instantiate{kind}: {message}"]


def test_scheduled_execution_is_refused(pendulum3) -> None:
    instance = pendulum3.instantiate(SCHEDULED_EXECUTION)
    assert instance.pointer is None
    (message,) = instance.messages
    assert message.startswith("fmi3InstantiateScheduledExecution: ")


def test_no_instance(pendulum3) -> None:
    """Every function, with NULL for the instance: an error and no crash."""
    for name, types in SIGNATURES.items():
        entry = getattr(pendulum3.functions, f"fmi3{name}")
        entry.argtypes = [c.c_void_p, *types]
        assert entry(None, *(_nothing(t) for t in types)) == ERROR, name
    pendulum3.functions.fmi3FreeInstance(None)


def _nothing(kind) -> object:
    return kind(0) if kind in {c.c_double, c.c_bool, c.c_size_t, c.c_uint} else None


@pytest.mark.parametrize("kind", [CO_SIMULATION, MODEL_EXCHANGE])
def test_no_arguments(ring3, kind) -> None:
    """Every function with NULL and with 1 for its sizes, in every phase: a status and no crash, and life goes on."""
    instance = ring3.instantiate(kind, events=True, early=True) if kind == CO_SIMULATION else ring3.instantiate(kind)
    phases = [
        lambda: OK,
        lambda: instance.call("EnterConfigurationMode"),
        lambda: instance.call("ExitConfigurationMode") or instance.initialize(),
        lambda: instance.call("ExitInitializationMode"),
        lambda: instance.call("EnterStepMode" if kind == CO_SIMULATION else "EnterContinuousTimeMode"),
        lambda: instance.call("Terminate"),
    ]
    moving = {name for name in SIGNATURES if name.startswith(("Enter", "Exit")) or name in {"Terminate", "Reset"}}
    harmless = {"FreeFMUState", "SetDebugLogging"}  # NULL is nothing to free; 1 category that is NULL is refused
    for enter in phases:
        assert enter() == OK, instance.messages
        for name in SIGNATURES.keys() - moving:
            arguments = [c.c_size_t(1) if t is c.c_size_t else _nothing(t) for t in SIGNATURES[name]]
            status = instance.call(name, *arguments)
            assert status == ERROR or name in harmless | {"SetTime"}, (name, instance.messages[-1:])


def test_phases_of_co_simulation(pendulum3) -> None:
    instance = pendulum3.instantiate()
    refused(instance, instance.call("ExitInitializationMode"), _out_of_turn("ExitInitializationMode", 0))
    assert instance.initialize() == OK
    refused(instance, instance.initialize(), _out_of_turn("EnterInitializationMode", 1))
    refused(instance, instance.step(0.0, 0.1).status, _out_of_turn("DoStep", 1))
    assert instance.call("ExitInitializationMode") == OK
    refused(instance, instance.call("EnterStepMode"), _out_of_turn("EnterStepMode", 2))
    message = "fmi3EnterEventMode must not be called: this instance is one for co-simulation without event mode"
    refused(instance, instance.call("EnterEventMode"), message)
    assert instance.step(0.0, 0.1).status == OK
    assert instance.call("Terminate") == OK
    refused(instance, instance.step(0.1, 0.1).status, _out_of_turn("DoStep", 3))
    refused(instance, instance.set(length=1.0), _out_of_turn("SetFloat64", 3))
    assert instance["time"] == 0.1
    assert instance.call("Reset") == OK
    assert instance.initialize() == OK


def _out_of_turn(function: str, phase: int) -> str:
    phases = ("before initialization", "in initialization mode", "between communication steps", "after termination")
    return f"fmi3{function} must not be called {phases[phase]}"


def test_functions_of_the_other_interface_are_refused(pendulum3) -> None:
    simulated = pendulum3.start(options={"events": True})  # in event mode
    exchanged = pendulum3.start(MODEL_EXCHANGE)
    number = (c.c_size_t * 1)()
    for name, arguments in {
        "EnterContinuousTimeMode": (),
        "SetTime": (0.0,),
        "GetContinuousStates": (reals([0.0] * 4), 4),
        "GetContinuousStateDerivatives": (reals([0.0] * 4), 4),
        "GetNominalsOfContinuousStates": (reals([0.0] * 4), 4),
        "GetEventIndicators": (None, 0),
        "GetNumberOfContinuousStates": (number,),
        "GetNumberOfEventIndicators": (number,),
    }.items():
        message = f"fmi3{name} must not be called: this instance is one for co-simulation with events"
        refused(simulated, simulated.call(name, *arguments), message)
    message = "fmi3EnterStepMode must not be called: this instance is one for model exchange"
    refused(exchanged, exchanged.call("EnterStepMode"), message)
    assert exchanged.call("GetNumberOfContinuousStates", number) == OK
    assert number[0] == 4
    assert exchanged.call("GetNumberOfEventIndicators", number) == OK
    assert number[0] == 0
    assert exchanged.call("GetEventIndicators", None, 0) == OK


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ((False, 0.0, math.nan, False, 0.0), "start time = nan: it must be finite"),
        ((True, -1e-6, 0.0, False, 0.0), "tolerance = -1e-06: it must be > 0 and finite"),
        ((False, 0.0, 2.0, True, 1.0), "stop time = 1 lies before start time = 2"),
    ],
)
def test_experiments_that_make_no_sense(pendulum3, arguments, message) -> None:
    instance = pendulum3.instantiate()
    refused(instance, instance.call("EnterInitializationMode", *arguments), message)


def test_stop_time_is_not_stepped_over(pendulum3) -> None:
    """The standard asks for an error; a clock that adds tenths up reaches 0.30000000000000004."""
    instance = pendulum3.instantiate()
    assert instance.initialize(stop=0.3) == OK
    assert instance.call("ExitInitializationMode") == OK
    time = 0.0
    for _ in range(3):
        assert instance.step(time, 0.1).status == OK
        time += 0.1
    message = "step from t = 0.3 to 0.4: the stop time is 0.3"
    refused(instance, instance.step(time, 0.1).status, message)


def test_completed_steps_ask_for_nothing(pendulum3) -> None:
    instance = pendulum3.start(MODEL_EXCHANGE)
    instance.update()
    assert instance.call("EnterContinuousTimeMode") == OK
    event, end = (c.c_bool * 1)(True), (c.c_bool * 1)(True)
    assert instance.call("CompletedIntegratorStep", True, c.cast(event, BOOL), c.cast(end, BOOL)) == OK
    assert (event[0], end[0]) == (False, False)


# ---- variables ---------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", sorted(TYPES.keys() - {"Float64", "Int32", "UInt64"}))
def test_types_without_variables(pendulum3, name) -> None:
    instance = pendulum3.start()
    for way in ("Get", "Set"):
        assert instance.call(f"{way}{name}", None, 0, None, 0) == OK
        values = (TYPES[name] * 1)()
        status = instance.call(f"{way}{name}", (c.c_uint * 1)(0), 1, values, 1)
        refused(instance, status, f"there are no variables of type {name}")


def test_binaries_and_clocks(pendulum3) -> None:
    instance = pendulum3.start(MODEL_EXCHANGE)
    for way in ("Get", "Set"):
        assert instance.call(f"{way}Binary", None, 0, None, None, 0) == OK
        status = instance.call(f"{way}Binary", (c.c_uint * 1)(0), 1, (c.c_size_t * 1)(), (c.c_void_p * 1)(), 1)
        refused(instance, status, "there are no variables of type Binary")
    clocks = [name for name in SIGNATURES if name.endswith(("Clock", "Decimal", "Fraction"))]
    assert len(clocks) == 10
    for name in clocks:
        rest = [None] * (len(SIGNATURES[name]) - 2)
        assert instance.call(name, None, 0, *rest) == OK
        refused(instance, instance.call(name, (c.c_uint * 1)(0), 1, *rest), "there are no variables of type Clock")


def test_reconstruction(pendulum3) -> None:
    instance = pendulum3.instantiate()
    reference, value = instance.refs(["input_reconstruction"]), (c.c_int32 * 1)()
    assert instance.call("GetInt32", reference, 1, value, 1) == OK
    assert value[0] == 1
    message = "input_reconstruction = 3: set 0 (hold), 1 (extrapolate) or 2 (interpolate)"
    refused(instance, instance.set_mode(3), message)
    assert instance.set_mode(2) == OK
    status = instance.call("GetInt32", reference, 1, value, 2)
    refused(instance, status, "2 values for scalars of type Int32: there are 1")
    started = pendulum3.start()
    message = "input_reconstruction = 2: it is a fixed parameter; set it before initialization ends"
    refused(started, started.set_mode(2), message)
    status = started.call("GetInt32", (c.c_uint * 1)(0), 1, value, 1)
    refused(started, status, "value reference 0 belongs to no integer variable")


def test_references_that_do_not_exist(pendulum3) -> None:
    instance = pendulum3.start()
    last = pendulum3.references["time"]
    for function in ("GetFloat64", "SetFloat64"):
        for reference in (0, last + 1):
            status = instance.call(function, (c.c_uint * 1)(reference), 1, reals([0.0]), 1)
            message = f"value reference {reference} belongs to no floating-point variable; they are 1 to {last}"
            refused(instance, status, message)
    status = instance.call("GetUInt64", (c.c_uint * 1)(last + 2), 1, (c.c_uint64 * 1)(), 1)
    refused(instance, status, f"value reference {last + 2} belongs to no variable of type UInt64")


def test_what_cannot_be_set(pendulum3) -> None:
    instance = pendulum3.start()
    refused(instance, instance.set(time=1.0), "time = 1: the time is not a variable that can be set")
    refused(instance, instance.set(theta=1.0), "theta = 1: it is calculated; set parameters and inputs")
    refused(instance, instance.set(mass=2.0), "mass = 2: it is a fixed parameter; set it before initialization ends")
    message = "length = nan: set a finite number; it stays 1"
    refused(instance, instance.set(theta_force=1.0, length=math.nan), message, DISCARD)
    assert instance["theta_force"] == 0.0


def test_dependencies_are_in_the_description_only(pendulum3) -> None:
    instance = pendulum3.start()
    message = "see the model description; providesPerElementDependencies is false"
    status = instance.call("GetNumberOfVariableDependencies", 0, c.cast((c.c_size_t * 1)(), SIZES))
    refused(instance, status, f"fmi3GetNumberOfVariableDependencies: {message}")
    status = instance.call("GetVariableDependencies", 0, None, None, None, None, 0)
    refused(instance, status, f"fmi3GetVariableDependencies: {message}")


@pytest.mark.parametrize("order", [0, 2])
def test_orders_of_output_derivatives(pendulum3, order) -> None:
    instance = pendulum3.start()
    status = instance.call("GetOutputDerivatives", instance.refs(["theta"]), 1, (c.c_int32 * 1)(order), reals([0.0]), 1)
    refused(instance, status, f"output derivatives of order {order}: the order must be 1")


def test_vectors_of_the_wrong_length(pendulum3) -> None:
    instance = pendulum3.start(MODEL_EXCHANGE)
    for function, what in {
        "GetContinuousStates": "states",
        "GetContinuousStateDerivatives": "derivatives of states",
        "GetNominalsOfContinuousStates": "nominal values of states",
    }.items():
        refused(instance, instance.call(function, reals([0.0] * 3), 3), f"3 {what}: there are 4")


# ---- steps that fail, saved states -------------------------------------------------------------------------------


def test_step_that_is_refused(fall3) -> None:
    """A fall onto the centre ends after π (1/2)^(3/2) = 1.1107 s: the step over that is taken back."""
    instance = fall3.start()
    assert instance.step(0.0, 1.0).status == OK
    before = instance.get("x", "v")
    step = instance.step(1.0, 0.5)
    assert (step.status, step.time) == (DISCARD, 1.0)
    assert instance.messages[0].endswith("the step from t = 1 is taken back")
    np.testing.assert_array_equal(instance.get("x", "v"), before)
    assert instance.step(1.0, 0.05).status == OK


def test_saved_states(pendulum3, fall3) -> None:
    instance = pendulum3.start(theta_0=1.0)
    state = instance.save()
    assert instance.step(0.0, 0.5).status == OK
    content, expected = instance.serialize(), instance["theta"]
    assert instance.call("SetFMUState", state) == OK
    assert instance["time"] == 0.0
    assert instance.step(0.0, 0.5).status == OK
    assert instance["theta"] == expected
    assert instance.call("FreeFMUState", c.byref(state)) == OK
    other = pendulum3.instantiate()
    assert other.deserialize(content) == OK
    assert other.get("theta", "time").tolist() == [expected, 0.5]
    damaged = content[:-20] + b"####" + content[-16:]
    refused(other, other.deserialize(damaged), "the saved state is damaged: its checksum is wrong")
    exchange = pendulum3.instantiate(MODEL_EXCHANGE)
    refused(exchange, exchange.deserialize(content), "the saved state belongs to an instance for co-simulation")
    assert fall3.instantiate().deserialize(content) == ERROR


# ---- the log -----------------------------------------------------------------------------------------------------


def test_without_logging_refusals_are_said(pendulum3) -> None:
    """As in FMI 2.0: the status alone tells nobody what to change."""
    instance = pendulum3.instantiate(logging=False)
    assert instance.set(length=math.nan) == DISCARD
    assert instance.initialize(tolerance=1e-30) == OK
    assert instance.call("Terminate") == ERROR
    assert [entry[:2] for entry in instance.log] == [(DISCARD, "logStatusDiscard"), (ERROR, "logStatusError")]


def test_categories_can_be_switched(pendulum3) -> None:
    instance = pendulum3.instantiate(logging=False)
    names = (c.c_char_p * 1)(b"logStatusWarning")
    assert instance.call("SetDebugLogging", True, 1, names) == OK
    assert instance.initialize(tolerance=1e-30) == OK
    assert [entry[:2] for entry in instance.log] == [(WARNING, "logStatusWarning")]
    assert instance.call("SetDebugLogging", False, 0, None) == OK
    assert instance.call("Reset") == OK
    assert instance.initialize(tolerance=1e-30) == OK
    assert len(instance.log) == 1
    assert instance.call("SetDebugLogging", True, 1, (c.c_char_p * 1)(b"50% #1#")) == ERROR
    assert instance.messages[-1] == "there is no log category 50% ##1##"
