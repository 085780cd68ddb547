"""Variables that are integers or Booleans, and event indicators."""

from __future__ import annotations

from xml.etree import ElementTree

import pytest
from driver import Library, members
from fmpy.validation import validate_fmu
from handmade import indicated

from liaisons.fmu import build


@pytest.fixture(scope="module", params=["2", "3"])
def library(request, folder) -> Library:
    return Library(build(indicated(), folder, backend="native", fmi=request.param))


@pytest.fixture(scope="module")
def root(library) -> ElementTree.Element:
    return ElementTree.fromstring(members(library.path)["modelDescription.xml"])


def test_validators_find_nothing(library) -> None:
    assert validate_fmu(str(library.path)) == []


def test_types_are_described(library, root) -> None:
    two = library.fmi == "2"
    kinds = {"side_closed": "Boolean", "side_impacts": "Integer" if two else "Int32"}
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
    assert listed == [str(library.references["side_indicator"])]
    assert root.find("CoSimulation[@mightReturnEarlyFromDoStep='true']") is not None


def test_states_may_jump_at_events(library, root) -> None:
    reals = root.iter("ScalarVariable" if library.fmi == "2" else "Float64")
    variables = ((v.attrib["name"], v[0] if library.fmi == "2" else v) for v in reals)
    assert {name for name, real in variables if "reinit" in real.attrib} == {"theta", "p_theta", "work"}


def test_what_events_decide_depends_on_everything(library, root) -> None:
    """That is what FMI says of unknowns without dependencies."""
    two = library.fmi == "2"
    attribute = "index" if two else "valueReference"
    names = {str(library.references[name]): name for name in library.references}
    for part in ("Outputs/Unknown", "InitialUnknowns/Unknown") if two else ("Output", "InitialUnknown"):
        unknowns = root.findall(f"ModelStructure/{part}")
        free = {names[u.attrib[attribute]] for u in unknowns if "dependencies" not in u.attrib}
        assert free == {"side_closed", "side_impacts"}
