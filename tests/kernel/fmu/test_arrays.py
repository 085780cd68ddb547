"""Arrays: one variable in FMI 3.0, their elements in FMI 2.0, rows in the C tables; small or large alike."""

from __future__ import annotations

import ctypes as c
import re
from dataclasses import replace
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest
from driver import DISCARD, ERROR, MODEL_EXCHANGE, Library, reals
from fmpy.validation import validate_fmu
from handmade import ring
from scipy.integrate import solve_ivp

from liaisons.fmu import build, model_description
from liaisons.fmu.code import model_code
from liaisons.mechanics import Model, assemble
from liaisons.models import PendulumChain, PlannedMotion, Satellite

GUID = "{00000000-0000-0000-0000-000000000001}"
OUTPUTS = ("x", "x_dot", "p", "p_dot", "anchor_force", "kinetic_energy", "work", "power", "weights")


def description3(model: Model) -> ElementTree.Element:
    return ElementTree.fromstring(model_description(model, "3", guid=GUID))


# ---- description -------------------------------------------------------------------------------------------------


def test_arrays_of_fmi3(ring3) -> None:
    variables = {v.name: v for v in ring3.description.modelVariables}
    assert [v.name for v in ring3.description.modelVariables[:18]] == ["n", *(v.name for v in ring(3).variables)]
    size = variables["n"]
    assert (size.type, size.causality, size.variability) == ("UInt64", "structuralParameter", "fixed")
    element = description3(ring(3)).find("ModelVariables/UInt64")
    assert element is not None
    assert [element.get(bound) for bound in ("min", "start", "max")] == ["3", "3", "3"]
    assert [d.variable for d in variables["x"].dimensions] == [size]
    assert variables["work"].dimensions == []
    assert variables["x_dot"].derivative is variables["x"]
    assert variables["x_0"].start == "0.5 -0.25 0.0"
    assert variables["bond"].start == "0.75"  # one number for all
    assert variables["time"].causality == "independent"
    assert [d.variable.name for d in ring3.description.derivatives] == ["x_dot", "p_dot", "power"]
    jumping = {e.get("name") for e in description3(ring(3)).iter("Float64") if e.get("reinit") == "true"}
    assert jumping == {"work"}


def dependencies(unknowns) -> dict[str, set[str]]:
    return {u.variable.name: {known.name for known in u.dependencies} for u in unknowns}


def test_dependencies_of_fmi3_are_those_of_the_formulas(ring3) -> None:
    """From the docstring of the ring; the work of an impulse is a difference of kinetic energies."""
    outputs = dependencies(ring3.description.outputs)
    assert outputs["x"] == {"x"}
    assert outputs["x_dot"] == {"mass", "p"}
    assert outputs["anchor_force"] == {"mass", "stiffness", "anchor", "anchor_ddot", "x"}
    assert outputs["work"] == {"mass", "anchor_dot", "p", "work"}
    derivatives = dependencies(ring3.description.derivatives)
    assert derivatives["p_dot"] == {"stiffness", "bond", "anchor", "force", "x"}
    initial = dependencies(ring3.description.initialUnknowns)
    assert initial["p_dot"] == {"stiffness", "bond", "anchor", "force", "x_0"}
    assert initial["x"] == {"x_0"}
    assert initial["weights"] == {"mass", "bond"}
    assert initial.keys() == {v.name for v in ring(3).outputs}


def test_dependency_on_time_is_declared(kick3) -> None:
    assert dependencies(kick3.description.outputs) == {"x": {"x"}, "x_dot": {"time", "t_1"}}


def test_dependencies_of_fmi2_are_those_of_elements() -> None:
    """Neighbours only: in a ring of four, number 3 is no neighbour of number 1."""
    root = ElementTree.fromstring(model_description(ring(4), guid=GUID, backend="native"))
    names = [element.attrib["name"] for element in root.iter("ScalarVariable")]
    (unknown,) = (
        unknown
        for unknown in root.findall("ModelStructure/Derivatives/Unknown")
        if names[int(unknown.attrib["index"]) - 1] == "p_dot[1]"
    )
    found = {names[int(index) - 1] for index in unknown.attrib["dependencies"].split()}
    assert found == {"x[4]", "x[1]", "x[2]", "anchor[1]", "force[1]"}


def test_elements_of_fmi2(ring2) -> None:
    names = [v.name for v in ring2.description.modelVariables]
    assert names == [
        "n",
        *(v.name for v in ring(3).flat().variables),
        "input_reconstruction",
        "symplectic_steps",
        "stiff_solver",
    ]
    size = ring2.description.modelVariables[0]
    assert (size.type, size.variability, size.start) == ("Integer", "constant", "3")
    assert ring2.start().get_integer("n") == 3


def test_dependencies_of_very_many_numbers_are_left_out() -> None:
    """FMI defines a missing list as "all"."""
    root = ElementTree.fromstring(model_description(ring(1000), guid=GUID, backend="native"))
    unknowns = list(root.iter("Unknown"))
    assert len(unknowns) > 6000
    assert not any("dependencies" in unknown.attrib for unknown in unknowns)


# ---- values ------------------------------------------------------------------------------------------------------


def test_start_values(ring_library) -> None:
    """One number for all, and leading ones."""
    instance = ring_library.instantiate()
    assert instance.get("x_0", "bond", "anchor").tolist() == [0.5, -0.25, 0, 0.75, 0.75, 0.75, 0.125, 0.125, 0.125]
    instance.set(x_0=[1, 2, 3])
    instance.do("Reset")
    assert instance.get("x_0").tolist() == [0.5, -0.25, 0]


def test_order_of_references_does_not_matter(ring3) -> None:
    instance = ring3.start()
    instance.step(0.0, 0.4)
    whole: dict[str, Any] = dict(
        zip(OUTPUTS, np.split(instance.get(*OUTPUTS), [3, 6, 9, 12, 15, 16, 17, 18]), strict=True)
    )
    assert {name: array.size for name, array in whole.items()} == {name: ring3.count(name) for name in OUTPUTS}
    mixed = ("weights", "time", "mass", "x", "x", "work", "force", "anchor_force")
    whole |= {"time": [0.4], "mass": [1.0], "force": [0, 0, 0]}
    np.testing.assert_array_equal(instance.get(*mixed), np.concatenate([whole[name] for name in mixed]))


@pytest.mark.parametrize("shift", [None, np.array([0.0, 1.0, 2.0])], ids=["anchors rest", "anchors move"])
def test_motion(ring_library, shift) -> None:
    """Against SciPy, from the formulas in the docstring of the ring; anchors interpolated, element by element."""
    force = np.array([0.1, -0.2, 0.3])

    def inputs(t: float) -> dict[str, np.ndarray]:
        if shift is None:
            return {"anchor": np.full(3, 0.125), "force": force}
        wave = t + shift
        return {"anchor": np.sin(wave), "anchor_dot": np.cos(wave), "anchor_ddot": -np.sin(wave), "force": force}

    def rates(t: float, y: np.ndarray) -> np.ndarray:
        x, p = y[:3], y[3:]
        spring = 0.75 * (np.roll(x, 1) - x)
        return np.concatenate([p, 2 * np.sin(inputs(t)["anchor"] - x) + spring - np.roll(spring, -1) + force])

    y = solve_ivp(rates, (0, 2), [0.5, -0.25, 0, 0, 0, 0], method="DOP853", rtol=1e-12, atol=1e-12).y[:, -1]
    instance = ring_library.start(tolerance=1e-11, input_reconstruction=2, **inputs(0.0))
    instance.follow(0.05, 40, inputs, ahead=True)
    # The quintic errs by H⁶/46080 = 3e-13 of an amplitude of 1; 40 steps of 1e-12.
    np.testing.assert_allclose(instance.get("x", "p"), y, rtol=0, atol=1e-9)


def test_states_of_arrays_can_be_set_one_by_one_in_model_exchange(ring_library) -> None:
    instance = ring_library.running(MODEL_EXCHANGE)
    instance.set(p=[4, 5, 6], work=7, x=[1, 2, 3])
    assert instance.vector("GetContinuousStates", 7).tolist() == [1, 2, 3, 4, 5, 6, 7]
    assert instance.get("x_dot").tolist() == [4, 5, 6]
    instance.set({"x_dot": [0, 0, 0]}, ERROR, "x_dot[1] = 0: it is calculated; set parameters and inputs")


# ---- messages ----------------------------------------------------------------------------------------------------


def test_messages_name_the_element(ring_library) -> None:
    instance = ring_library.initializing()
    instance.set({"bond": [0.0, np.nan, 0.0]}, DISCARD, "bond[2] = nan: set a finite number; it stays 0.75")
    instance.set(bond=[0.0, -1.0, 0.0])
    message = "bond[2] = -1 at t = 0: it must be >= 0; set another value and initialize again"
    instance.exit_initialization(ERROR, message)
    instance.set(bond=[0.0, 1.0, 0.0])
    instance.exit_initialization()
    instance.set(anchor=[0.0, 11.0, 0.0])
    message = "anchor[2] = 11 at t = 0: it must be <= 10; the step from t = 0 is taken back"
    instance.step(0.0, 0.1, ERROR, message)


def test_states_that_are_not_finite_are_named(ring_library) -> None:
    instance = ring_library.running(MODEL_EXCHANGE)
    states = reals([0, 0, 0, 0, 0, np.inf, 0])
    instance.refuse("p[3] = inf: set a finite number", "SetContinuousStates", states, 7, status=DISCARD)
    states[1], states[2], states[5] = 1e308, -1e308, 0
    instance.do("SetContinuousStates", states, 7)
    assert instance.call("GetContinuousStateDerivatives", states, 7) == DISCARD
    assert re.fullmatch(r"p_dot\[.*inf at t = 0: the motion ends there", *instance.messages)


@pytest.mark.parametrize("function", ["GetFloat64", "SetFloat64"])
@pytest.mark.parametrize("count", [0, 3, 5, 6])
def test_numbers_of_values_that_do_not_fit(ring3, pendulum3, function, count) -> None:
    for library, names, numbers in ((ring3, ["force", "stiffness"], 4), (pendulum3, ["theta_force", "length_dot"], 2)):
        instance = library.start()
        message = f"{count} values for variables that hold {numbers}"
        instance.refuse(message, function, instance.refs(names), 2, reals([0.0] * 8), count)


# ---- structural parameters ---------------------------------------------------------------------------------------


def test_configuration_mode(ring3, pendulum3) -> None:
    instance = ring3.instantiate()
    size, n = instance.refs(["n"]), (c.c_uint64 * 1)(3)
    instance.refuse("{} must not be called before initialization", "SetUInt64", size, 1, n, 1)
    instance.do("EnterConfigurationMode")
    instance.do("SetUInt64", size, 1, n, 1)
    n[0] = 4
    instance.refuse("n = 4: this FMU is built for 3; build another one", "SetUInt64", size, 1, n, 1)
    instance.do("GetUInt64", size, 1, n, 1)
    assert n[0] == 3
    message = "fmi3EnterInitializationMode must not be called in configuration mode"
    instance.initialize(None, 0.0, None, ERROR, message)
    instance.do("ExitConfigurationMode")
    instance.initialize()
    instance.refuse("{} must not be called in initialization mode", "EnterConfigurationMode")
    pendulum3.instantiate().refuse("{}: there are no structural parameters", "EnterConfigurationMode")


# ---- sizes -------------------------------------------------------------------------------------------------------


def test_description_does_not_grow_with_the_arrays() -> None:
    """In XML only an array whose elements start differently has a list of them."""
    small, large = (description3(ring(n)) for n in (3, 10_000))
    for variable in (*small.iter("Float64"), *large.iter("Float64")):
        if variable.get("name") == "x_0":
            variable.set("start", "")
    assert len(ElementTree.tostring(large)) < 1.1 * len(ElementTree.tostring(small))


def test_one_element_is_an_array_too() -> None:
    model = replace(ring(1), name="HandRingOfOne")
    root = ElementTree.fromstring(model_description(model, guid=GUID, backend="native"))
    names = {element.attrib["name"] for element in root.iter("ScalarVariable")}
    assert {"x[1]", "anchor_dot[1]"} <= names
    assert "1, 1, 0," in next(line for line in model_code(model, GUID, "3").splitlines() if '{"x",' in line)


# ---- FMI 3.0 without arrays ------------------------------------------------------------------------------------------


@pytest.mark.parametrize("component", [PendulumChain, PlannedMotion])
@pytest.mark.variants(core=0)
def test_fmi3_without_arrays_has_none(component, shared_folder) -> None:
    paths = [build(assemble(component), shared_folder, fmi="3", arrays=arrays) for arrays in (True, False)]
    assert paths[1] == shared_folder / "fmi3" / "scalars" / f"{component.__name__}.fmu"
    assert validate_fmu(str(paths[1])) == []
    whole, numbers = map(Library, paths)
    assert any(v.dimensions for v in whole.description.modelVariables)
    assert not any(v.dimensions for v in numbers.description.modelVariables)
    assert not any(v.causality == "structuralParameter" for v in numbers.description.modelVariables)
    numbers.instantiate().refuse("{}: there are no structural parameters", "EnterConfigurationMode")


def test_pictures_are_drawn_from_scalars(library) -> None:
    """OMSimulator and PyFMI fail at local arrays of FMI 3.0."""
    variables = library(Satellite, "fmi3").description.modelVariables
    drawn = [v for v in variables if v.name.startswith("picture")]
    assert len(drawn) > 1
    assert not any(v.dimensions for v in variables)
