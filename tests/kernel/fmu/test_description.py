"""modelDescription.xml: valid, complete, and true to what the binary does."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
from driver import MODEL_EXCHANGE, Instance, members, reals
from fmpy.validation import validate_fmu
from fmu_manipulation_toolbox.checker import OperationGenericCheck, OperationSemanticCheck
from fmu_manipulation_toolbox.operations import FMU
from handmade import fall, pendulum, ring

import liaisons
from liaisons.errors import BuildError
from liaisons.fmu import build, model_description
from liaisons.fmu.origin import provenance
from liaisons.mechanics import Model, assemble
from liaisons.models import Constant, OscillatorChain

GUID = "{00000000-0000-0000-0000-000000000001}"


def described(model: Model, target: str = "fmi2") -> ElementTree.Element:
    if target == "fmi3":
        return ElementTree.fromstring(model_description(model, "3", guid=GUID))
    backend = "python" if target == "python" else "native"
    return ElementTree.fromstring(model_description(model, guid=GUID, backend=backend))


@pytest.fixture(scope="module")
def native() -> ElementTree.Element:
    return described(pendulum())


every_target = pytest.mark.parametrize("target", ["fmi2", "fmi3", "python"])
every_model = pytest.mark.parametrize("model", [pendulum(), fall(), ring(3)], ids=lambda model: model.name)


def scalar(root: ElementTree.Element, name: str) -> tuple[dict[str, str], dict[str, str]]:
    found = root.find(f"ModelVariables/ScalarVariable[@name='{name}']")
    assert found is not None
    return found.attrib, found[0].attrib


@every_target
@pytest.mark.parametrize("name", ["pendulum", "fall", "kick", "ring"])
def test_validators_find_nothing(handmade, name, target) -> None:
    assert validate_fmu(str(handmade(name, target).path)) == []


def test_second_validator_finds_nothing(pendulum_fmu) -> None:
    generic, semantic = OperationGenericCheck(), OperationSemanticCheck()
    for check in (generic, semantic):
        FMU(str(pendulum_fmu)).apply_operation(check)
    assert generic.compliant_with_version == "2.0"
    assert semantic.errors == []


def attributes(fmu: Path) -> dict[str, str]:
    return ElementTree.fromstring(members(fmu)["modelDescription.xml"]).attrib


@pytest.mark.parametrize("options", [{}, {"fmi": "3"}, {"backend": "python"}], ids=["fmi2", "fmi3", "python"])
def test_author_version_licence_and_date(options, tmp_path, monkeypatch) -> None:
    monkeypatch.delenv("SOURCE_DATE_EPOCH", raising=False)
    fmu = build(assemble(Constant), tmp_path, **options)
    before = fmu.read_bytes()
    about = attributes(fmu)
    assert (about["author"], about["license"]) == ("the liaisons authors", "MIT")
    assert about["version"] == liaisons.__version__
    assert about["generationDateAndTime"] == f"{liaisons.__date__}T00:00:00Z"
    assert validate_fmu(str(fmu)) == []

    monkeypatch.setenv("SOURCE_DATE_EPOCH", "1000000000")
    other = attributes(build(assemble(Constant), tmp_path, **options))
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
        about = attributes(build(model, tmp_path, backend="native"))
        assert not {"author", "license", "version", "copyright", "generationDateAndTime"} & about.keys()
    monkeypatch.setenv("SOURCE_DATE_EPOCH", "0")
    about = attributes(build(assemble(Mine), tmp_path, backend="native"))
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
    listed = [element.get("name") for element in native.iter("ScalarVariable")]
    assert listed == [*names, "input_reconstruction", "symplectic_steps", "stiff_solver"]
    _, real = scalar(native, "theta_dot")
    assert names[int(real["derivative"]) - 1] == "theta"


@every_target
@every_model
def test_references_count_from_one_and_sizes_come_first(model, target) -> None:
    root = described(model, target)
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
    root = described(assemble(Constant))
    assert "unit" not in scalar(root, "y")[1]
    assert root.find("ModelVariables/ScalarVariable[@name='input_reconstruction']") is None  # there are no inputs


def test_python_back_end_promises_only_what_it_can(native) -> None:
    python = described(pendulum(), "python")
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


@every_target
@every_model
def test_initial_unknowns_are_all_that_the_standard_asks_for(model, target) -> None:
    """Outputs, calculated parameters, states and their rates: FMI 2.0.4, 2.2.8; FMI 3.0.2, 2.4.8."""
    root, structure = described(model, target), "ModelStructure/"
    if target == "fmi3":
        entries = {entry.attrib["valueReference"]: entry.attrib for entry in root.iterfind("ModelVariables/*")}
        initial, derivatives, place = "InitialUnknown", "ContinuousStateDerivative", "valueReference"
    else:
        scalars = enumerate(root.iterfind("ModelVariables/ScalarVariable"), start=1)
        entries = {str(index): entry.attrib | entry[0].attrib for index, entry in scalars}
        initial, derivatives, place = "InitialUnknowns/Unknown", "Derivatives/Unknown", "index"
    listed = [unknown.attrib[place] for unknown in root.iterfind(structure + initial)]
    wanted = {name for name, entry in entries.items() if entry["causality"] in {"output", "calculatedParameter"}}
    for rate in root.iterfind(structure + derivatives):
        wanted |= {rate.attrib[place], entries[rate.attrib[place]]["derivative"]}
    assert len(listed) == len(wanted)
    assert set(listed) == {name for name in wanted if entries[name]["initial"] != "exact"}


INPUTS = ("length", "length_dot", "length_ddot", "theta_force")


def moved(
    instance: Instance, names: Iterable[str], knowns: Iterable[str], put: Callable[[str, float], object]
) -> dict[str, set[str]]:
    """Which variables change when some are changed in turn, and put back."""
    names = list(names)
    before, found = instance.get(*names), {name: set[str]() for name in names}
    for known in knowns:
        value = instance[known]
        put(known, value + 0.125)
        for name in np.array(names)[instance.get(*names) != before]:
            found[name].add(known)
        put(known, value)
    return found


def test_initial_dependencies_are_those_of_the_binary(native, pendulum_library) -> None:
    """Every parameter and input is changed in turn: what moves must be declared, and what is declared moves."""
    declared = dependencies(native, "InitialUnknowns")
    knowns = ("mass", "gravity", "friction", "theta_0", "theta_dot_0", *INPUTS)
    instance = pendulum_library.initializing(
        theta_0=0.4, theta_dot_0=0.7, length_dot=0.3, friction=0.2, theta_force=0.1
    )
    found = moved(instance, declared, knowns, lambda name, value: instance.set({name: value}))
    # theta_dot = p/(m l²) with p = m l² theta_dot_0, and work is a difference of equal energies: the dependencies on
    # the way cancel, which a sparsity pattern cannot know.
    cancelling = {"theta_dot", "work", "energy_balance"}
    assert cancelling < declared.keys()
    for name in declared:
        assert declared[name] > found[name] if name in cancelling else declared[name] == found[name], name


def test_running_dependencies_are_those_of_the_binary(native, pendulum_library) -> None:
    declared = dependencies(native, "Outputs") | dependencies(native, "Derivatives")
    y = {"theta": 0.4, "p_theta": 0.7, "work": 0.1, "dissipated": 0.2}
    instance = pendulum_library.running(MODEL_EXCHANGE, friction=0.2, length_dot=0.3, theta_force=0.1)

    def put(name: str, value: float) -> None:
        if name in INPUTS:
            instance.set({name: value})
        else:
            instance.do("SetContinuousStates", reals((y | {name: value}).values()), len(y))

    put("theta", y["theta"])
    found = moved(instance, declared, (*y, *INPUTS), put)
    # work contains the impulse of a jump of the inputs, which there is none of in continuous-time mode
    for name in set(declared) - {"work", "energy_balance"}:
        assert declared[name] == found[name], name
    assert declared["work"] > found["work"]


def test_description_says_the_same_as_that_of_fmi2(pendulum3, pendulum2) -> None:
    three, two = pendulum3.description, pendulum2.description
    for old in two.modelVariables[:-3]:  # behind them FMI 3.0 has the time
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
