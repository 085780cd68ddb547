"""Terminals, icon, reference results, licences: what importers find in an FMU beside the model."""

from __future__ import annotations

import csv
import io
import re
import zipfile
from dataclasses import replace
from pathlib import Path
from typing import Literal
from xml.etree import ElementTree

import casadi as ca
import fmpy
import numpy as np
import pytest
from handmade import fall, pendulum
from lxml import etree  # pyright: ignore[reportAttributeAccessIssue] - compiled, without stubs
from matplotlib.pyplot import imread

from liaisons.base import distributions
from liaisons.errors import ComponentError
from liaisons.fmu import build, extra_members, extras
from liaisons.fmu.extras import drawn_members
from liaisons.language import Coordinate, Experiment, Mechanism, Parameter, Variable
from liaisons.mechanics import Model, assemble
from liaisons.models import CATALOGUE, CartesianPendulum, DoublePendulum, Pendulum, Satellite, Sinusoid
from liaisons.reference_results import FOLDER, INTERVALS, table_variables, trajectory
from liaisons_catalogue.pendulum_chain import PendulumChain

SCHEMA = etree.XMLSchema(file=str(Path(fmpy.__file__).parent / "schema/fmi3/fmi3TerminalsAndIcons.xsd"))
MOST_ELEMENTS = 100  # of an array that has terminals in FMI 2.0
SIZE = 96  # of an icon, in pixels
every_component = pytest.mark.parametrize("component", CATALOGUE, ids=lambda c: c.__name__)


def members(terminal: ElementTree.Element) -> dict[str, dict[str, str]]:
    return {m.attrib["memberName"]: m.attrib for m in terminal.findall("TerminalMemberVariable")}


def terminals_and_icons(model: Model, fmi: Literal["2", "3"]) -> bytes:
    return extra_members(model, fmi)["terminalsAndIcons/terminalsAndIcons.xml"]


def read_member(path: Path, name: str) -> bytes | None:
    with zipfile.ZipFile(path) as archive:
        return archive.read(name) if name in archive.namelist() else None


def terminals(model: Model, fmi: Literal["2", "3"] = "2") -> dict[str, ElementTree.Element]:
    """By path: ``bob/x``."""
    root = ElementTree.fromstring(terminals_and_icons(model, fmi)).find("Terminals")
    found = {t.attrib["name"]: t for t in (() if root is None else root)}
    nested = {f"{name}/{t.attrib['name']}": t for name, parent in found.items() for t in parent.findall("Terminal")}
    return found | nested


# ---- terminals ---------------------------------------------------------------------------------------------------


@every_component
@pytest.mark.parametrize("fmi", ["2", "3"])
def test_terminals_are_valid_and_name_what_is_there(component, fmi) -> None:
    model = assemble(component)
    text = terminals_and_icons(model, fmi)
    assert SCHEMA.validate(etree.fromstring(text)), SCHEMA.error_log
    shown = model.flat() if fmi == "2" else model
    causality = {v.name: v.causality for v in shown.variables}
    found = [m.attrib for t in terminals(model, fmi).values() for m in t.findall("TerminalMemberVariable")]
    assert {causality[m["variableName"]] for m in found} <= {"input", "output"}
    named = {member.variable for port in shown.ports for member in port.members}
    assert {m["variableName"] for m in found} == named


def test_free_and_active_terminal_fit_together() -> None:
    model = assemble(Pendulum)
    both = [terminals(model)[name] for name in ("pivot/x", "bob/x")]
    causality = {v.name: v.causality for v in model.variables}
    assert both[0].get("terminalKind") == both[1].get("terminalKind")
    pivot, bob = map(members, both)
    assert pivot.keys() == {"s", "v", "a", "f"}
    assert bob.keys() == {*pivot, "impulse"}  # a pendulum has no impacts
    assert {end.get("matchingRule") for end in both} == {"bus"}
    for role in pivot:
        assert {causality[end[role]["variableName"]] for end in (pivot, bob)} == {"input", "output"}
    # One flows in, the other out: their values are equal.
    assert [end["f"]["variableKind"] for end in (pivot, bob)] == ["inflow", "outflow"]
    assert pivot["s"]["variableKind"] == "signal"


def test_places_are_nested_and_lone_components_are_not() -> None:
    found = terminals(assemble(DoublePendulum))
    assert {"bob_1", "bob_1/x", "bob_1/z", "bob_2/x", "pivot", "pivot/z", "theta_1"} <= found.keys()
    assert "pivot_x" not in found
    assert members(found["theta_1"]).keys() == {"phi", "w", "a", "tau", "impulse"}
    assert found["bob_1"].find("TerminalMemberVariable") is None


def test_signal_goes_with_lengths_and_angles() -> None:
    found = terminals(assemble(Sinusoid))
    assert members(found["y"])["s"]["variableName"] == members(found["y_rotation"])["phi"]["variableName"] == "y"
    # An operator gives no force: an active port must not insist on one.
    assert terminals(assemble(Pendulum))["length"].get("matchingRule") == "bus"


def test_model_without_ports_has_an_icon_only() -> None:
    root = ElementTree.fromstring(terminals_and_icons(fall(), "3"))
    assert SCHEMA.validate(etree.fromstring(ElementTree.tostring(root)))
    assert [child.tag for child in root] == ["GraphicalRepresentation"]


def test_arrays_are_one_terminal_in_fmi_3_and_one_an_element_in_fmi_2() -> None:
    model = assemble(PendulumChain, 3)
    name = model.ports[0].name
    assert {f"{name}[1]", f"{name}[3]"} <= terminals(model, "2").keys()
    assert name in terminals(model, "3")
    long = terminals_and_icons(assemble(PendulumChain, MOST_ELEMENTS + 1), "2").decode()
    assert f"{name}[" not in long


# ---- icon ----------------------------------------------------------------------------------------------------------


def opacity(icon: dict[str, bytes]) -> np.ndarray:
    """Of each pixel, shape (SIZE, SIZE)."""
    pixels = imread(io.BytesIO(icon["terminalsAndIcons/icon.png"]))
    assert pixels.shape == (SIZE, SIZE, 4)
    return pixels[:, :, 3]


@every_component
def test_icon_shows_something_inside_its_frame(component) -> None:
    icon = drawn_members(assemble(component), "2")
    shown = opacity(icon)
    assert 0.01 < np.mean(shown > 0) < 0.5
    assert not shown[[0, -1]].any()
    assert not shown[:, [0, -1]].any()
    root = ElementTree.fromstring(icon["terminalsAndIcons/icon.svg"])
    assert root.get("viewBox") == f"0 0 {SIZE} {SIZE}"
    assert root.findall(".//{http://www.w3.org/2000/svg}path")
    for content in icon.values():
        assert not re.search(rb"tEXt|iTXt|zTXt|tIME|matplotlib\.org|20\d\d-\d\d", content), "who drew it, and when"


def test_icon_of_what_cannot_be_integrated_has_letters() -> None:
    one, two = (opacity(drawn_members(replace(assemble(Collapse), name=name), "2")) for name in ("Fall", "FreeFall"))
    assert one.any()
    assert np.any(one != two)


def test_an_fmu_with_another_icon_is_the_same(tmp_path, monkeypatch) -> None:
    fmu = build(pendulum(), tmp_path, backend="python")
    monkeypatch.setattr("liaisons.fmu.building.drawn_members", lambda *_: {"model.png": b"another"})
    other = build(pendulum(), tmp_path / "other", backend="python")
    assert read_member(fmu, "modelDescription.xml") == read_member(other, "modelDescription.xml")
    assert read_member(fmu, "model.png") != read_member(other, "model.png")


# ---- reference results ---------------------------------------------------------------------------------------------


def table(model: Model, fmi: Literal["2", "3"] = "2") -> tuple[list[str], np.ndarray]:
    text = extra_members(model, fmi)[f"{FOLDER}/{model.name}_out.csv"].decode()
    head, *rows = csv.reader(io.StringIO(text))
    return head, np.array([[float(number) for cell in row for number in cell.split()] for row in rows])


def test_reference_results_are_the_closed_form() -> None:
    head, rows = table(assemble(Pendulum))
    assert rows.shape == (INTERVALS + 1, len(head))
    exact = Pendulum.exact(rows[:, 0])
    # Nine digits of the greatest number, 0.1 and 0.31: half of the last one; twenty steps with errors of 1e-11.
    for column, expected in (("theta", exact["theta"]), ("p_theta", exact["theta_dot"])):
        np.testing.assert_allclose(rows[:, head.index(column)], expected, rtol=0, atol=7e-10)


def test_reference_results_of_arrays_and_signals() -> None:
    head, rows = table(assemble(Sinusoid))
    assert head == ["time", "y", "y_dot", "y_ddot"]
    np.testing.assert_allclose(rows[:, 3], -np.sin(rows[:, 0]), rtol=0, atol=1e-9)  # its digits
    chain = assemble(PendulumChain, 3)
    (flat, numbers), (arrays, same) = table(chain, "2"), table(chain, "3")
    assert len(arrays) < len(flat) == numbers.shape[1]
    np.testing.assert_array_equal(numbers, same)


def test_noise_is_rounded_away() -> None:
    head, rows = table(assemble(CartesianPendulum))
    assert not rows[:, head.index("y")].any()  # it swings in the x-z plane


WITH_REFERENCE = [c for c in CATALOGUE if assemble(c).experiment.reference]
UNSEEN = {  # cyclic, or the places where springs are at rest
    *("beta", "wheel_1", "wheel_2", "wheel_3", "azimuth", "twist", "spacing"),
    *("length", "pivot_x", "pivot_z"),
}


def changed(model: Model, name: str) -> Model:
    """With another start value, whether it is the reference experiment's or the variable's own."""
    reference = model.experiment.reference
    if name in reference:
        moved = {**reference, name: 1.01 * reference[name]}
        return replace(model, experiment=replace(model.experiment, reference=moved))

    def started(variable: Variable) -> Variable:
        if variable.name != name:
            return variable
        starts = tuple(1.01 * x + 0.01 * (x == 0) for x in variable.starts)
        return replace(variable, start=starts if variable.dimension else starts[0])

    return replace(model, parameters=tuple(map(started, model.parameters)), inputs=tuple(map(started, model.inputs)))


@pytest.mark.parametrize("component", WITH_REFERENCE, ids=lambda c: c.__name__)
def test_reference_results_notice_one_percent_of_everything(component) -> None:
    """Where the default experiment shows nothing: a wrong parameter or input would be seen in some column."""
    model = assemble(component)
    results = trajectory(model)
    assert results is not None
    inputs = [v for v in model.inputs if v.variability == "continuous"]  # others act at events
    names = [v.name for v in (*model.parameters, *inputs) if v.causality != "calculatedParameter"]
    for name in set(names) - UNSEEN:
        other = trajectory(changed(model, name))
        assert other is not None
        sizes = {v.name: np.max(np.abs(results[v.name])) for v in table_variables(model)}
        moved = max(np.max(np.abs(other[column] - results[column])) / (size or 1) for column, size in sizes.items())
        assert moved > 1e-4, name  # the FMU agrees to 1e-7


def test_experiments_that_show_something_have_references() -> None:
    """The others have inputs and starts of their own, which importers find beside the results."""
    named = {c.__name__ for c in WITH_REFERENCE}
    assert named >= {"DrivenChain", "Satellite", "CircularHoop", "FourierHoop", "Flywheel"}
    found = extra_members(assemble(Satellite), "3")
    values = ElementTree.fromstring(found[f"{FOLDER}/Satellite.ssv"])
    given = {p.attrib["name"]: float(p[0].attrib["value"]) for p in values.iter() if p.tag.endswith("Parameter")}
    head, *rows = csv.reader(io.StringIO(found[f"{FOLDER}/Satellite_in.csv"].decode()))
    motion = {name: np.array(column, float) for name, *column in zip(head, *rows, strict=True)}
    start = given | {name: column[0] for name, column in motion.items()}
    assert assemble(Satellite).experiment.reference.items() <= start.items()
    rates = np.gradient(motion["wheel_2"], motion["time"])
    np.testing.assert_allclose(rates[1:-1], motion["wheel_2_dot"][1:-1], rtol=1e-12)
    with pytest.raises(ComponentError, match=r"Satellite: Experiment\(reference=...\): 'wheel_1_dto' .* did you mean"):
        trajectory(replace(assemble(Satellite), experiment=Experiment(reference={"wheel_1_dto": 1.0})))


class Collapse(Mechanism):
    """Falls into the singularity at x = 0 within its experiment."""

    mass = Parameter(1.0, "kg", "mass", above=0)
    attraction = Parameter(1.0, "J.m", "energy times distance")
    x = Coordinate("m", "distance", start=1.0, above=0)
    experiment = Experiment(stop_time=3.0)

    def kinetic_energy(self) -> ca.SX:
        return self.mass / 2 * self.dot(self.x) ** 2

    def potential_energy(self) -> ca.SX:
        return -self.attraction / self.x


def test_experiment_that_cannot_be_integrated_is_left_out_and_said_so() -> None:
    model = assemble(Collapse)
    assert trajectory(model) is None
    found = extra_members(model, "2")
    assert not [name for name in found if name.endswith(".csv")]
    assert b"<!-- No results" in found[f"{FOLDER}/fmi-ls-manifest.xml"]


@every_component
def test_manifest_names_files_that_are_there(component) -> None:
    model = assemble(component)
    found = extra_members(model, "2")
    root = ElementTree.fromstring(found[f"{FOLDER}/fmi-ls-manifest.xml"])
    assert root.tag == "fmiReferences"
    assert root.get("{http://fmi-standard.org/fmi-ls-manifest}fmi-ls-name") == "org.fmi-standard.fmi-ls-ref"
    assert root.get("{http://fmi-standard.org/fmi-ls-manifest}fmi-ls-version") == "1.0.0-beta.1"
    related = {element.attrib["role"]: element.attrib["source"] for element in root.findall("Related")}
    assert related["document"] == "../../documentation/index.html"
    assert (
        ("result" not in related) if model.contacts or model.sample else (f"{FOLDER}/{related['result']}" in found)
    )  # events are not in SciPy


# ---- what others add -----------------------------------------------------------------------------------------------


def test_whoever_registers_a_function_adds_members(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The page and the icon are registered like this; without them there is an FMU all the same."""
    calls = []

    def draw() -> bytes:
        calls.append(1)
        return b"drawn"

    added = {"documentation/note.txt": b"a note", "documentation/drawn.txt": draw}
    monkeypatch.setattr("liaisons.fmu.extras.registered", lambda _: [lambda *_: {**added}])
    fmu = build(pendulum(), tmp_path, backend="python")
    assert read_member(fmu, "documentation/note.txt") == b"a note"
    assert read_member(fmu, "documentation/drawn.txt") == b"drawn"
    assert read_member(fmu, "documentation/index.html") is read_member(fmu, "model.png") is None
    build(pendulum(), tmp_path, backend="python")
    assert len(calls) == 1  # the file was up to date
    added["documentation/note.txt"] = b"another note"
    build(pendulum(), tmp_path, backend="python")
    assert read_member(fmu, "documentation/note.txt") == b"another note"


# ---- all of it -----------------------------------------------------------------------------------------------------


def test_members_of_both_versions() -> None:
    two, three = drawn_members(pendulum(), "2"), drawn_members(pendulum(), "3")
    assert two.keys() - three.keys() == {"model.png"}
    assert two["model.png"] == two["terminalsAndIcons/icon.png"]
    found = extra_members(pendulum(), "3")
    assert {"documentation/index.html", "terminalsAndIcons/terminalsAndIcons.xml"} <= found.keys()
    assert b"MIT License" in found["documentation/licenses/license.txt"]
    assert extra_members(pendulum(), "3") == found


def test_a_tree_without_its_licence_names_it(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """As a folder that was copied without the file: FMUs are built, and say which licence it is."""
    (tmp_path / "pyproject.toml").write_bytes((Path(__file__).parents[3] / "pyproject.toml").read_bytes())
    monkeypatch.setattr(distributions, "_COMPONENTS", tmp_path / "components")
    monkeypatch.setattr(extras, "own_distribution", distributions.clone)
    extras._licence_text.cache_clear()
    try:
        text = extra_members(pendulum(), "3")["documentation/licenses/license.txt"].decode()
    finally:
        extras._licence_text.cache_clear()
    assert "beside the model in sources:\n\nMIT\n\nThe headers" in text
