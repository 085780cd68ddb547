"""modelDescription.xml: valid, complete, and true to what the binary does."""

from __future__ import annotations

import zipfile
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest
from driver import MODEL_EXCHANGE, OK, reals
from fmpy.validation import validate_fmu
from fmu_manipulation_toolbox.checker import OperationGenericCheck, OperationSemanticCheck
from fmu_manipulation_toolbox.operations import FMU
from handmade import fall, pendulum, ring

import liaisons
from liaisons.errors import BuildError
from liaisons.fmu import build
from liaisons.fmu.description import model_description
from liaisons.fmu.description3 import model_description3
from liaisons.fmu.origin import provenance
from liaisons.mechanics import assemble
from liaisons.models import Constant, OscillatorChain

GUID = "{00000000-0000-0000-0000-000000000001}"


@pytest.fixture(scope="module")
def native() -> ElementTree.Element:
    return ElementTree.fromstring(model_description(pendulum(), guid=GUID, backend="native"))


def scalar(root: ElementTree.Element, name: str) -> tuple[dict[str, str], dict[str, str]]:
    found = root.find(f"ModelVariables/ScalarVariable[@name='{name}']")
    assert found is not None
    return found.attrib, found[0].attrib


@pytest.mark.parametrize("fmi", ["2", "3"])
@pytest.mark.parametrize("name", ["pendulum", "fall", "kick", "ring"])
def test_validators_find_nothing(handmade, name, fmi) -> None:
    assert validate_fmu(str(handmade(name, fmi).path)) == []


def test_second_validator_finds_nothing(pendulum_fmu) -> None:
    generic, semantic = OperationGenericCheck(), OperationSemanticCheck()
    for check in (generic, semantic):
        FMU(str(pendulum_fmu)).apply_operation(check)
    assert generic.compliant_with_version == "2.0"
    assert semantic.errors == []


def test_same_bytes_for_same_model() -> None:
    texts = {model_description(pendulum(), guid=GUID, backend="native") for _ in range(2)}
    assert len(texts) == 1


def root_of(fmu: Path) -> ElementTree.Element:
    with zipfile.ZipFile(fmu) as archive:
        return ElementTree.fromstring(archive.read("modelDescription.xml"))


BUILDS: list[dict[str, Any]] = [{"backend": "native"}, {"backend": "native", "fmi": "3"}, {"backend": "python"}]


@pytest.mark.parametrize("options", BUILDS, ids=["fmi2", "fmi3", "python"])
def test_author_version_licence_and_date(options, tmp_path, monkeypatch) -> None:
    monkeypatch.delenv("SOURCE_DATE_EPOCH", raising=False)
    fmu = build(assemble(Constant), tmp_path, **options)
    before = fmu.read_bytes()
    about = root_of(fmu).attrib
    assert (about["author"], about["license"]) == ("the liaisons authors", "MIT")
    assert about["version"] == liaisons.__version__
    assert about["generationDateAndTime"] == f"{liaisons.__date__}T00:00:00Z"
    assert validate_fmu(str(fmu)) == []

    monkeypatch.setenv("SOURCE_DATE_EPOCH", "1000000000")
    other = root_of(build(assemble(Constant), tmp_path, **options)).attrib
    assert other["generationDateAndTime"] == "2001-09-09T01:46:40Z"
    token = "instantiationToken" if options.get("fmi") else "guid"
    assert other[token] == about[token]  # the same model, whenever it was built

    monkeypatch.delenv("SOURCE_DATE_EPOCH")
    assert build(assemble(Constant), tmp_path, **options).read_bytes() == before


def test_a_component_of_somebody_elses_does_not_claim_our_authorship(tmp_path, monkeypatch) -> None:
    class Mine(Constant):
        """A component of one's own."""

    monkeypatch.delenv("SOURCE_DATE_EPOCH", raising=False)
    for model in (assemble(Mine), pendulum()):
        about = root_of(build(model, tmp_path, backend="native")).attrib
        assert not {"author", "license", "version", "copyright", "generationDateAndTime"} & about.keys()
    monkeypatch.setenv("SOURCE_DATE_EPOCH", "0")
    about = root_of(build(assemble(Mine), tmp_path, backend="native")).attrib
    assert about["generationDateAndTime"] == "1970-01-01T00:00:00Z"
    assert "author" not in about
    monkeypatch.setenv("SOURCE_DATE_EPOCH", "yesterday")
    with pytest.raises(BuildError, match=r"SOURCE_DATE_EPOCH = 'yesterday': set seconds since 1970-01-01"):
        build(assemble(Mine), tmp_path, backend="native")


def test_chains_of_any_size_are_ours() -> None:
    assert provenance(assemble(OscillatorChain, n=5))["author"] == "the liaisons authors"


def test_references_are_positions(native) -> None:
    """Some importers take one for the other, and the index 0 of a derivative for none."""
    names = [variable.name for variable in pendulum().variables]
    elements = list(native.iter("ScalarVariable"))
    assert [element.get("name") for element in elements] == [*names, "input_reconstruction", "symplectic_steps"]
    assert [int(element.attrib["valueReference"]) for element in elements] == list(range(1, len(names) + 3))
    _, real = scalar(native, "theta_dot")
    assert names[int(real["derivative"]) - 1] == "theta"


@pytest.mark.parametrize("version", ["2", "3", "python"])
@pytest.mark.parametrize("component", [pendulum, fall, lambda: ring(3)], ids=["pendulum", "fall", "ring"])
def test_references_count_from_one_and_sizes_come_first(component, version) -> None:
    model = component()
    if version == "3":
        text = model_description3(model, token=GUID)
    else:
        text = model_description(model, guid=GUID, backend="python" if version == "python" else "native")
    root = ElementTree.fromstring(text)
    variables = root.findall("ModelVariables/*")
    assert [int(v.attrib["valueReference"]) for v in variables] == list(range(1, len(variables) + 1))
    sizes = [size.name for size in model.dimensions]
    assert [v.attrib["name"] for v in variables[: len(sizes)]] == sizes
    by_reference = {v.attrib["valueReference"]: v.attrib["name"] for v in variables}
    for dimension in root.iterfind("ModelVariables/*/Dimension"):
        assert by_reference[dimension.attrib["valueReference"]] in sizes


def test_variable_attributes(native) -> None:
    mass, real = scalar(native, "mass")
    assert mass["causality"], mass["variability"] == ("parameter", "fixed")
    assert mass["initial"] == "exact"
    assert mass["description"].endswith("(> 0)")  # min alone would allow 0
    assert {name: real[name] for name in ("unit", "min", "start")} == {"unit": "kg", "min": "0.0", "start": "1.0"}
    friction, _ = scalar(native, "friction")
    assert friction["variability"] == "tunable"
    theta, real = scalar(native, "theta")
    assert theta["initial"] == "calculated"
    assert real["displayUnit"] == "deg"
    assert "start" not in real
    assert "reinit" in scalar(native, "work")[1]
    assert "reinit" not in real


def test_units_carry_base_units_and_display_factors(native) -> None:
    unit = native.find("UnitDefinitions/Unit[@name='rad/s']")
    assert unit is not None
    assert unit[0].attrib == {"rad": "1", "s": "-1"}
    factors = {display.get("name"): float(display.attrib["factor"]) for display in unit.findall("DisplayUnit")}
    assert factors["rpm"] == pytest.approx(60 / (2 * np.pi), rel=1e-15)  # two roundings
    newton = native.find("UnitDefinitions/Unit[@name='N']/BaseUnit")
    assert newton is not None
    assert newton.attrib == {"kg": "1", "m": "1", "s": "-2"}


def test_variable_without_unit_has_no_unit_attribute() -> None:
    root = ElementTree.fromstring(model_description(assemble(Constant), guid=GUID, backend="native"))
    assert "unit" not in scalar(root, "y")[1]
    assert root.find("ModelVariables/ScalarVariable[@name='input_reconstruction']") is None  # there are no inputs


def test_python_back_end_promises_only_what_it_can(native) -> None:
    python = ElementTree.fromstring(model_description(pendulum(), guid=GUID, backend="python"))
    assert python.find("ModelExchange") is None
    interface = python.find("CoSimulation")
    assert interface is not None
    assert not {"providesDirectionalDerivative", "maxOutputDerivativeOrder", "canInterpolateInputs"} & set(
        interface.attrib
    )
    for part in ("UnitDefinitions", "ModelStructure", "DefaultExperiment"):
        ours, theirs = native.find(part), python.find(part)
        assert ours is not None
        assert theirs is not None
        assert ElementTree.tostring(ours) == ElementTree.tostring(theirs)


def dependencies(root: ElementTree.Element, part: str) -> dict[str, set[str]]:
    names = [element.attrib["name"] for element in root.iter("ScalarVariable")]
    return {
        names[int(unknown.attrib["index"]) - 1]: {
            names[int(index) - 1] for index in unknown.attrib["dependencies"].split()
        }
        for unknown in root.findall(f"ModelStructure/{part}/Unknown")
    }


@pytest.mark.parametrize("version", ["2", "3", "python"])
@pytest.mark.parametrize("component", [pendulum, fall, lambda: ring(3)], ids=["pendulum", "fall", "ring"])
def test_initial_unknowns_are_all_that_the_standard_asks_for(component, version) -> None:
    """Outputs, calculated parameters, states and their rates: FMI 2.0.4, 2.2.8; FMI 3.0.2, 2.4.8."""
    if version == "3":
        root = ElementTree.fromstring(model_description3(component(), token=GUID))
        entries = {entry.attrib["valueReference"]: entry.attrib for entry in root.iterfind("ModelVariables/*")}
        listed = [unknown.attrib["valueReference"] for unknown in root.iterfind("ModelStructure/InitialUnknown")]
    else:
        backend = "native" if version == "2" else "python"
        root = ElementTree.fromstring(model_description(component(), guid=GUID, backend=backend))
        scalars = enumerate(root.iterfind("ModelVariables/ScalarVariable"), start=1)
        entries = {str(index): entry.attrib | entry[0].attrib for index, entry in scalars}
        listed = [unknown.attrib["index"] for unknown in root.iterfind("ModelStructure/InitialUnknowns/Unknown")]
    wanted = {place for place, entry in entries.items() if entry["causality"] in {"output", "calculatedParameter"}}
    kind, place = (
        ("ContinuousStateDerivative", "valueReference") if version == "3" else ("Derivatives/Unknown", "index")
    )
    for rate in root.iterfind(f"ModelStructure/{kind}"):
        wanted |= {rate.attrib[place], entries[rate.attrib[place]]["derivative"]}
    assert len(listed) == len(wanted)
    assert set(listed) == {place for place in wanted if entries[place]["initial"] != "exact"}


def test_initial_dependencies_are_those_of_the_binary(native, pendulum_library) -> None:
    """Every parameter and input is changed in turn: what moves must be declared, and what is declared moves."""
    declared = dependencies(native, "InitialUnknowns")
    base = {"theta_0": 0.4, "theta_dot_0": 0.7, "length_dot": 0.3, "friction": 0.2, "theta_force": 0.1}
    knowns = ["mass", "gravity", "friction", "theta_0", "theta_dot_0"]
    knowns += ["length", "length_dot", "length_ddot", "theta_force"]
    instance = pendulum_library.instantiate()
    assert instance.initialize() == OK
    assert instance.set(base) == OK
    before = instance.get(*declared)
    moved: dict[str, set[str]] = {name: set() for name in declared}
    for known in knowns:
        value = instance[known]
        assert instance.set({known: value + 0.125}) == OK
        for name in np.array(list(declared))[instance.get(*declared) != before]:
            moved[name].add(known)
        assert instance.set({known: value}) == OK
    # theta_dot = p/(m l²) with p = m l² theta_dot_0, and work is a difference of equal energies: the dependencies on
    # the way cancel, which a sparsity pattern cannot know.
    cancelling = {"theta_dot", "work", "energy_balance"}
    for name in declared:
        assert declared[name] > moved[name] if name in cancelling else declared[name] == moved[name], name


def test_running_dependencies_are_those_of_the_binary(native, pendulum_library) -> None:
    declared = dependencies(native, "Outputs") | dependencies(native, "Derivatives")
    states = ["theta", "p_theta", "work", "dissipated"]
    inputs = ["length", "length_dot", "length_ddot", "theta_force"]
    instance = pendulum_library.start(MODEL_EXCHANGE, friction=0.2, length_dot=0.3, theta_force=0.1)
    instance.go_on()
    base = [0.4, 0.7, 0.1, 0.2]

    def values() -> dict[str, float]:
        return dict(zip(declared, instance.get(*declared), strict=True))

    def set_states(y: list[float]) -> None:
        assert instance.call("SetContinuousStates", reals(y), len(y)) == OK

    set_states(base)
    before = values()
    moved: dict[str, set[str]] = {name: set() for name in declared}
    for i, state in enumerate(states):
        set_states([value + 0.125 * (i == j) for j, value in enumerate(base)])
        moved = {name: moved[name] | ({state} if value != before[name] else set()) for name, value in values().items()}
        set_states(base)
    for known in inputs:
        value = instance[known]
        assert instance.set({known: value + 0.125}) == OK
        moved = {name: moved[name] | ({known} if v != before[name] else set()) for name, v in values().items()}
        assert instance.set({known: value}) == OK
    # work contains the impulse of a jump of the inputs, which there is none of in continuous-time mode
    for name in set(declared) - {"work", "energy_balance"}:
        assert declared[name] == moved[name], name
    assert declared["work"] > moved["work"]


def test_description_says_the_same_as_that_of_fmi2(pendulum3, pendulum2) -> None:
    three, two = pendulum3.description, pendulum2.description
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
