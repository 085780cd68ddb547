"""Variables that are integers or Booleans, and event indicators."""

from __future__ import annotations

import ctypes as c
from xml.etree import ElementTree

import numpy as np
import pytest
from driver import ERROR, Instance, Library, members, reals
from wasm_driver import WasmLibrary

from liaisons.fmu import build
from liaisons.mechanics import Model, assemble
from liaisons.models import BouncingBall


@pytest.fixture(scope="module")
def model() -> Model:
    return assemble(BouncingBall)


@pytest.fixture(scope="module", params=["2", "3", "wasm"])
def library(request, folder, model) -> Library:
    if request.param == "wasm":
        return WasmLibrary(build(model, folder / "wasm", backend="native", fmi="3", platforms="wasm"))
    return Library(build(model, folder, backend="native", fmi=request.param))


@pytest.fixture(scope="module")
def root(library) -> ElementTree.Element:
    return ElementTree.fromstring(members(library.path)["modelDescription.xml"])


def test_types_are_described(library, root) -> None:
    two = library.fmi == "2"
    kinds = {"gap_closed": "Boolean", "gap_impacts": "Integer" if two else "Int32"}
    for name, kind in kinds.items():
        variable = root.find(f"ModelVariables/*[@name='{name}']")
        assert variable is not None
        assert (variable[0] if two else variable).tag == kind
        assert (variable.attrib["variability"], variable.attrib["initial"]) == ("discrete", "calculated")
        assert not {"unit", "nominal", "min", "start"} & {*variable.attrib, *(variable[0].attrib if two else {})}


def test_event_indicators_are_described(library, root) -> None:
    exchange = root.find("ModelExchange")
    assert exchange is not None
    if library.fmi == "2":
        assert root.attrib["numberOfEventIndicators"] == "1"
        assert "completedIntegratorStepNotNeeded" not in exchange.attrib
        return
    assert exchange.attrib["needsCompletedIntegratorStep"] == "true"
    listed = [element.attrib["valueReference"] for element in root.iter("EventIndicator")]
    assert listed == [str(library.references["gap_indicator"])]
    assert root.find("CoSimulation[@mightReturnEarlyFromDoStep='true']") is not None


def test_states_may_jump_at_events(library, root) -> None:
    reals = root.iter("ScalarVariable" if library.fmi == "2" else "Float64")
    variables = ((v.attrib["name"], v[0] if library.fmi == "2" else v) for v in reals)
    assert {name for name, real in variables if "reinit" in real.attrib} == {"height", "p_height", "work"}


def test_what_events_decide_depends_on_everything(library, root, model) -> None:
    two = library.fmi == "2"
    attribute = "index" if two else "valueReference"
    names = {str(library.references[name]): name for name in library.references}
    parts = ["Outputs/Unknown", "InitialUnknowns/Unknown"] if two else ["Output", "InitialUnknown"]
    states, inputs, parameters = len(model.states), len(model.inputs), len(model.parameters)
    knowns = [states + inputs, parameters + inputs]
    if not two:
        knowns = [1 + states + inputs + parameters, 1 + inputs + parameters]
    running, starting = (
        {names[u.attrib[attribute]] for u in root.findall(f"ModelStructure/{part}") if len(dependencies(u)) == most}
        for part, most in zip(parts, knowns, strict=True)
    )
    assert running == {"gap_closed", "gap_impacts", "gap_impulse", "table_impulse", "impact_loss"}
    assert starting - running == {"height_ddot", "p_height_dot", "gap_force", "table_force", "table_power", "power"}


def dependencies(unknown: ElementTree.Element) -> set[str]:
    return set(unknown.attrib["dependencies"].split())


# ---- calls ------------------------------------------------------------------------------------------------------


def read_boolean(instance: Instance, name: str) -> bool:
    values = instance.flags(1)
    instance.do("GetBoolean", instance.refs([name]), 1, values, 1)
    return bool(values[0])


def test_values_are_those_of_their_types(library) -> None:
    """It falls for T = sqrt(2 h/g) and bounces for 2 T e, 2 T e², ...: until 3 T for e = 1/2."""
    instance = library.start(bounce=0.5)
    fall, now = np.sqrt(2 / instance["gravity"]), 0.0
    for falls, impacts in ((0.9, 0), (1.1, 1), (2.1, 2), (2.6, 3), (2.8, 4)):
        instance.step(now, falls * fall - now)
        now = falls * fall
        assert (read_boolean(instance, "gap_closed"), instance.get_integer("gap_impacts")) == (False, impacts)
    instance.step(now, 0.3 * fall)
    assert read_boolean(instance, "gap_closed")
    assert instance.get_integer("input_reconstruction") == 1  # a setting, of the same type


def test_values_of_another_type_are_refused(library) -> None:
    instance = library.start()
    for name, function, of_type, is_one in (
        ("gap_closed", "GetFloat64", "floating-point", "Boolean"),
        ("gap_impacts", "GetFloat64", "floating-point", "integer"),
        ("height", "GetBoolean", "Boolean", "floating-point"),
        ("gap_impacts", "GetBoolean", "Boolean", "integer"),
        ("dissipation", "GetInt32", "integer", "floating-point"),  # the last but a drawn one, before the settings
        ("gap_closed", "GetInt32", "integer", "Boolean"),
    ):
        buffer = {"GetFloat64": reals([0.0]), "GetBoolean": instance.flags(1), "GetInt32": (c.c_int32 * 1)()}[function]
        known = f"value reference {library.references[name]} belongs to no {of_type} variable: {name} is {is_one}"
        instance.refuse(known, function, instance.refs([name]), 1, buffer, 1)
    instance.step(0.0, 0.1)


def test_what_is_calculated_cannot_be_set(library) -> None:
    instance = library.start()
    said = "{} = 1: it is calculated; set parameters and inputs"
    instance.refuse(said.format("gap_closed"), "SetBoolean", instance.refs(["gap_closed"]), 1, instance.flags(1), 1)
    instance.set_integer("gap_impacts", 1, ERROR, said.format("gap_impacts"))
    instance.set({"gap_closed": 1}, ERROR, said.format("gap_closed"))
    unknown = (c.c_uint * 1)(999)
    for way in ("Get", "Set"):
        words = "value reference 999 belongs to no Boolean variable"
        instance.refuse(words, f"{way}Boolean", unknown, 1, instance.flags(1), 1)


def test_only_reals_have_derivatives(library) -> None:
    instance = library.start()
    unknown, known, numbers = instance.refs(["gap_closed"]), instance.refs(["table"]), reals([1.0])
    words = f"value reference {unknown[0]} belongs to no floating-point variable: gap_closed is Boolean"
    instance.refuse(words, "GetDirectionalDerivative", unknown, 1, known, 1, numbers, 1, reals([0.0]), 1)
    instance.refuse(words, "GetOutputDerivatives", unknown, 1, (c.c_int32 * 1)(1), reals([0.0]), 1)
    assert instance.directional(["gap"], {"height": 2.0}) == [2.0]


def test_event_indicators_of_model_exchange(library) -> None:
    instance = library.running()
    if library.fmi == "3":
        count = c.c_size_t()
        instance.do("GetNumberOfEventIndicators", c.byref(count))
        assert count.value == 1
    events = instance.flags(2)
    pointers = [c.cast(c.byref(events, i * c.sizeof(events._type_)), c.POINTER(events._type_)) for i in range(2)]
    for height in (0.25, 0.0, -0.5):
        instance.do("SetContinuousStates", reals([height, 0.0, 0.0, 0.0]), 4)
        (indicator,) = instance.vector("GetEventIndicators", 1)
        assert indicator == instance["gap_indicator"]
        assert np.sign(indicator) == (1 if height >= 0 else -1)
        instance.do("CompletedIntegratorStep", True, *pointers)
        assert [bool(flag) for flag in events] == [height < 0, False]
    instance.refuse("2 event indicators: there are 1", "GetEventIndicators", reals([0.0] * 2), 2)
