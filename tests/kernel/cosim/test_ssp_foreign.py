"""SSP archives of other makes: nested, mapped, converted, broken."""

from __future__ import annotations

import zipfile
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from hostile import (
    SPACES,
    UNITS,
    binding,
    bound,
    component,
    connected,
    connections,
    connectors,
    elements,
    mapping,
    nested,
    parameter_set,
    real,
    structure,
)
from making import FmuPaths, described
from numpy.testing import assert_allclose, assert_array_equal
from numpy.typing import NDArray

from liaisons import System
from liaisons.errors import LiaisonsError, SimulationError

Archive = Callable[..., Path]


@pytest.fixture
def archive(fmu: FmuPaths, tmp_path: Path) -> Archive:
    """An archive with this system, all test FMUs, and further files."""

    def make(system: str, more: str = "", **files: str | bytes) -> Path:
        path = tmp_path / "foreign.ssp"
        with zipfile.ZipFile(path, "w") as target:
            target.writestr("SystemStructure.ssd", structure(system, more))
            for name in ("Cubic", "Spring", "Mass", "Probe", "Faulty", "Discrete"):
                target.write(fmu(name), f"resources/{name}.fmu")
            for name, content in files.items():
                target.writestr(f"resources/{name}", content)
        return path

    return make


def _message(path: Path, kind: type[LiaisonsError] = SimulationError) -> str:
    with pytest.raises(kind) as caught:
        System.from_ssp(path)
    message = str(caught.value)
    assert message.startswith(f"{path}: ")
    assert "\n" not in message
    return message


def _joined(path: Path) -> set[str]:
    return {line.strip() for line in repr(System.from_ssp(path)).splitlines() if "->" in line}


def test_nested_systems_are_dissolved(archive: Archive) -> None:
    inner = nested(
        "inner.one",
        connectors(out="output", **{"in": "input"}),
        elements(component("source", "Cubic"), component("echo", "Probe")),
        connections(connected("source.y", "out"), connected("in", "echo.u")),
    )
    links = connected("inner.one.out", "probe.u"), connected("probe.echo", "inner.one.in"), connected("x", "y")
    path = archive(elements(inner, component("probe", "Probe")) + connections(*links))
    assert _joined(path) == {"inner_one_source.y -> probe.u", "probe.echo -> inner_one_echo.u"}


def test_signals_of_a_dictionary_connect_all_who_refer_to_it(archive: Archive) -> None:
    dictionary = '<SignalDictionaries><SignalDictionary name="bus" source="resources/bus.ssb"/></SignalDictionaries>'
    reference = '<SignalDictionaryReference name="{}" dictionary="bus"/>'
    content = elements(component("p", "Probe"), reference.format("here")) + connections(connected("here.signal", "p.u"))
    outer = elements(component("source", "Cubic"), reference.format("there"), nested("deep", content))
    path = archive(outer + connections(connected("source.y", "there.signal")) + dictionary)
    assert _joined(path) == {"source.y -> deep_p.u"}


def test_parameters_of_all_levels(archive: Archive) -> None:
    inner = nested(
        "deep",
        connectors(exposed="parameter") + bound(real("spring.stiffness", 2.0)),
        elements(component("spring", "Spring", bound(real("stiffness", 1.0) + real("length", 0.5)))),
        connections(connected("exposed", "spring.length_dot")),
    )
    outer = bound(real("deep.spring.stiffness", 3.0), real("deep.spring.stiffness", 4.0) + real("deep.exposed", 7))
    system = System.from_ssp(archive(outer + elements(inner)))
    # what stands further out, and what stands later, counts more
    assert system.parts["deep_spring"].starts == {"length": 0.5, "stiffness": 4.0, "length_dot": 7.0}


def test_prefix_source_and_mapping(archive: Archive) -> None:
    entries = """<m:MappingEntry source="a.k" target="spring.stiffness">
    <c:LinearTransformation factor="2" offset="1"/></m:MappingEntry>
    <m:MappingEntry source="a.mode" target="spring.input_reconstruction"><c:IntegerMappingTransformation>
    <c:MapEntry source="5" target="2"/></c:IntegerMappingTransformation></m:MappingEntry>"""
    parameters = real("k", 10) + '<v:Parameter name="mode"><v:Integer value="5"/></v:Parameter>' + real("length", 9)
    given = binding('<ParameterMapping source="resources/map.ssm"/>', source="resources/values.ssv", prefix="a.")
    path = archive(
        f"<ParameterBindings>{given}</ParameterBindings>" + elements(component("spring", "Spring")),
        **{"values.ssv": parameter_set(parameters), "map.ssm": mapping(entries)},
    )
    # with a mapping, only what it names is taken
    assert System.from_ssp(path).parts["spring"].starts == {"stiffness": 21.0, "input_reconstruction": 2}


@pytest.mark.parametrize(("given", "target", "expected"), [("true", "false", False), ("false", "true", True)])
def test_a_boolean_becomes_what_its_entry_says(archive: Archive, given: str, target: str, expected: bool) -> None:
    entry = f'<c:BooleanMappingTransformation><c:MapEntry source="{given}" target="{target}"/></c:Boo'
    entries = f'<m:MappingEntry source="flag" target="f.flag">{entry}leanMappingTransformation></m:MappingEntry>'
    flag = f'<v:Parameter name="flag"><v:Boolean value="{given}"/></v:Parameter>'
    path = archive(bound(flag, entries=entries) + elements(component("f", "Faulty")))
    assert System.from_ssp(path).parts["f"].starts == {"flag": expected}


def test_units_are_converted(archive: Archive, caplog: pytest.LogCaptureFixture) -> None:
    values = real("length", 250, unit="mm") + real("stiffness", 5, unit="mm") + real("nothing", 1)
    starts = System.from_ssp(archive(elements(component("spring", "Spring", bound(values))))).parts["spring"].starts
    assert starts == {"length": 0.25, "stiffness": 5.0}  # the FMU gives the stiffness no unit
    assert "has no variable 'nothing'" in caplog.text
    kelvin = archive(elements(component("spring", "Spring", bound(real("length", 1, unit="degC")))))
    assert "spring.length = 1.0: the unit of the parameter is of another kind" in _message(kelvin)


def typed(name: str, kind: str, unit: str) -> str:
    """A connector with a unit."""
    return f'<Connector name="{name}" kind="{kind}"><c:Real unit="{unit}"/></Connector>'


TYPED = "<Connectors>{}</Connectors>"
METRES = '<c:Unit name="metre"><c:BaseUnit m="1"/></c:Unit>'
BUS = "http://ssp-standard.org/SSP1/SystemStructureSignalDictionary"
DICTIONARY = f'<b:SignalDictionary xmlns:b="{BUS}" {SPACES} version="1.0">{{}}</b:SignalDictionary>'
ENTRY = '<b:Signals><b:DictionaryEntry name="signal"><c:Real unit="mm"/></b:DictionaryEntry></b:Signals>'


def test_units_of_signal_dictionaries_and_of_connectors_convert(archive: Archive) -> None:
    """Spring.length is in m; what is in mm before it is a thousandth, wherever the unit stands."""
    content = DICTIONARY.format(f"{ENTRY}<b:Units>{UNITS}</b:Units>")
    reference = '<SignalDictionaryReference name="bus" dictionary="bus"/>'
    links = connections(connected("bus.signal", "spring.length"), connected("source.y", "bus.signal"))
    parts = elements(component("source", "Cubic"), component("spring", "Spring"), reference)
    dictionaries = '<SignalDictionaries><SignalDictionary name="bus"{}</SignalDictionaries>'
    inline, outside = f">{content}</SignalDictionary>", ' source="resources/bus.ssb"/>'
    for place in (inline, outside):
        path = archive(parts + links + dictionaries.format(place), **{"bus.ssb": content})
        (connection,) = System.from_ssp(path).connections
        assert connection.conversion == pytest.approx((1e-3, 0.0), rel=1e-15)


@pytest.mark.parametrize(
    ("system", "words"),
    [
        (
            elements(component("spring", "Spring", TYPED.format(typed("length", "input", "mm")))),
            ["spring.length has the unit 'mm', but 'm' in its FMU"],
        ),
        (
            elements(component("spring", "Spring", TYPED.format(typed("length", "input", "ell")))),
            ["spring.length has the unit 'ell', which has no definition"],
        ),
        (TYPED.format(typed("total", "output", "ell")), ["total has the unit 'ell', which has no definition"]),
        (
            elements(component("spring", "Spring", bound(real("length", 2, unit="ell")))),
            ["spring.length = 2.0 ell: this unit has no definition"],
        ),
    ],
)
def test_units_that_are_not_defined_or_not_those_of_the_fmu_are_refused(
    archive: Archive, system: str, words: list[str]
) -> None:
    message = _message(archive(system, f"<Units>{UNITS}{METRES}</Units>"))
    assert all(word in message for word in words), message


def test_units_of_other_names_and_of_the_fmu_itself_are_taken(archive: Archive) -> None:
    for unit in ("metre", "m"):
        spring = component(
            "spring", "Spring", TYPED.format(typed("length", "input", unit)) + bound(real("length", 2, unit="m"))
        )
        system = System.from_ssp(archive(elements(spring), f"<Units>{METRES}</Units>"))
        assert system.parts["spring"].starts == {"length": 2.0}


def test_the_experiment_of_an_archive_is_simulated(archive: Archive) -> None:
    path = archive(elements(component("source", "Cubic")), '<DefaultExperiment startTime="0.5" stopTime="1.25"/>')
    run = System.from_ssp(path).simulate(step_size=0.25)
    assert_array_equal(run.time, [0.5, 0.75, 1.0, 1.25])


def test_percent_encoded_sources_and_empty_element_names(archive: Archive, fmu: FmuPaths) -> None:
    empty = '<Connection startElement="" startConnector="s" endElement="c" endConnector="y"/>'
    parts = elements(component("c", "two%20words"), component("p", "Probe"))
    words = {"two words.fmu": fmu("Cubic").read_bytes()}
    path = archive(parts + connections(connected("c.y", "p.u"), empty), **words)
    assert _joined(path) == {"c.y -> p.u"}


ENUMERATION = '<v:Parameter name="status"><v:Enumeration value="on"/></v:Parameter>'
ELSEWHERE = f"<ParameterBindings>{binding('', source='resources/a.ssv')}</ParameterBindings>"
KINDS = '<Connectors><Connector name="{}" kind="{}"/></Connectors>'
DOUBLED = '<c:LinearTransformation factor="2"/>'


@pytest.mark.parametrize(
    ("system", "words"),
    [
        (component("a", "Nowhere"), ["component a", "resources/Nowhere.fmu", "lacks that file"]),
        (component("a", source="https://example.org/a.fmu"), ["component a", "outside the archive"]),
        ('<Component name="a"/>', ["component a has no source"]),
        (component("a", "Cubic", type="application/x-ssp-package"), ["component a", "x-ssp-package", "only FMUs"]),
        (component("a", "Cubic", implementation="ScheduledExecution"), ["component a asks for ScheduledExecution"]),
        ('<Component source="resources/Cubic.fmu"/>', ["a Component without name"]),
        (component("a", "Cubic") * 2, ["two elements are called a"]),
        (component("a", "Spring", bound(real("stiffness", "much"))), ["stiffness = 'much'", "no Real"]),
        (component("a", "Faulty", bound(ENUMERATION)), ["a.status = 'on': expected an integer"]),
        (component("a", "Spring", bound(real("seen", 1))), ["a.seen = 1.0", "calculated"]),
        (component("a", "Spring", ELSEWHERE), ["the parameter set of a", "resources/a.ssv", "lacks that file"]),
        ('<SignalDictionaryReference name="r" dictionary="d"/>', ["signal dictionary 'd'"]),
    ],
)
def test_elements_that_will_not_do(archive: Archive, system: str, words: list[str]) -> None:
    message = _message(archive(elements(system)))
    assert all(word in message for word in words), message


@pytest.mark.parametrize(
    ("links", "words"),
    [
        ([connected("c.y", "q.u")], ["from c.y to q.u", "no element 'q'"]),
        ([connected("c.y", "p.v")], ["from c.y to p.v", "Probe.fmu has no variable 'v'"]),
        ([connected("c.y", "p.u"), connected("f.x", "p.u")], ["f.x", "p.u", "c.y feeds it already"]),
        ([connected("s.seen_dot", "f.u")], ["connection from s.seen_dot to f.u", "units of different kinds"]),
        ([connected("d.late", "p.u")], ["d.late (Boolean)", "p.u (Real)"]),
        ([connected("d.count", "p.u", DOUBLED)], ["d.count (Integer)", "p.u (Real)", "a factor of 2", "only reals"]),
        ([connected("c.y", "p.u", '<c:LinearTransformation factor="nan"/>')], ["from c.y to p.u", "no finite number"]),
        ([connected("c.y", "p.u", "<c:BooleanMappingTransformation/>")], ["from c.y to p.u", "a BooleanMapping"]),
        (['<Connection startElement="c" endElement="p" endConnector="u"/>'], ["a Connection without startConnector"]),
        ([connected("a", "b"), connected("b", "a"), connected("a", "p.u")], ["from a to b goes round in a circle"]),
        ([connected("c.y", "a"), connected("f.x", "a"), connected("a", "p.u")], ["a has several sources: c.y, f.x"]),
    ],
)
def test_connections_that_will_not_do(archive: Archive, links: list[str], words: list[str]) -> None:
    parts = {"c": "Cubic", "p": "Probe", "f": "Faulty", "s": "Spring", "d": "Discrete"}
    inside = elements(*(component(name, fmu) for name, fmu in parts.items()))
    message = _message(archive(inside + connections(*links)), LiaisonsError)
    assert all(word in message for word in words), message


TRANSFORMED = '<c:LinearTransformation factor="{}" offset="{}"/>'
UNITS_OF_THE_SYSTEM = f"<Units>{UNITS}</Units>"


def _ran(path: Path, name: str) -> NDArray[np.float64]:
    result = System.from_ssp(path).simulate(1.0, 0.25)
    return result[name]


@pytest.mark.usefixtures("either_loop")
def test_connections_with_factor_and_offset(archive: Archive) -> None:
    inner = nested(
        "inner",
        connectors(**{"in": "input"}),
        elements(component("p", "Probe")),
        connections(connected("in", "p.u", TRANSFORMED.format(-2, 1))),
    )
    links = connections(connected("c.y", "inner.in", TRANSFORMED.format(10, 3)))
    path = archive(elements(component("c", "Cubic"), inner) + links)
    t = np.linspace(0, 1, 5)
    assert_array_equal(_ran(path, "inner_p.u"), -2 * (10 * t**3 + 3) + 1)
    assert _joined(path) == {"-20 * c.y + -5 -> inner_p.u"}


@pytest.mark.usefixtures("either_loop")
@pytest.mark.parametrize(
    ("more", "factor"),
    [({}, 1000.0), ({"suppressUnitConversion": "true"}, 1.0)],
)
def test_units_of_connections_are_converted_unless_suppressed(
    archive: Archive, more: dict[str, str], factor: float
) -> None:
    parts = elements(component("spring", "Spring", bound(real("length", 0.25))), component("faulty", "Faulty"))
    path = archive(parts + connections(connected("spring.seen", "faulty.u", **more)))
    assert_array_equal(_ran(path, "faulty.u")[1:], 0.25 * factor)


def test_the_unit_of_a_system_connector_lies_between(archive: Archive) -> None:
    """0.25 m become 250 mm, and 1 more, and 0.251 m."""
    shown = '<Connectors><Connector name="out" kind="output"><c:Real unit="mm"/></Connector></Connectors>'
    inside = elements(component("spring", "Spring", bound(real("length", 0.25))))
    inner = nested("inner", shown, inside, connections(connected("spring.seen", "out", TRANSFORMED.format(1, 1))))
    links = connections(connected("inner.out", "other.length"))
    path = archive(elements(inner, component("other", "Spring")) + links, more=UNITS_OF_THE_SYSTEM)
    assert_allclose(_ran(path, "other.length")[1:], 0.251, rtol=1e-15)


def test_either_end_may_be_called_the_start(archive: Archive) -> None:
    inner = nested(
        "inner",
        connectors(out="output", **{"in": "input"}),
        elements(component("c", "Cubic", KINDS.format("y", "output")), component("p", "Probe")),
        connections(connected("out", "c.y"), connected("p.u", "in")),
    )
    probe = component("q", "Probe", KINDS.format("u", "input"))
    path = archive(elements(inner, probe) + connections(connected("q.u", "inner.out")))
    assert _joined(path) == {"inner_c.y -> q.u"}


def test_factor_and_offset_come_back(archive: Archive, tmp_path: Path) -> None:
    parts = elements(
        component("c", "Cubic"), component("p", "Probe"), component("s", "Spring"), component("f", "Faulty")
    )
    links = connected("c.y", "p.u", TRANSFORMED.format(0.1, 1 / 3)), connected("s.seen", "f.u")
    system = System.from_ssp(archive(parts + connections(*links)))
    for form in ("portable", "full"):
        system.write_ssp(tmp_path / "again.ssp", form=form)
        again = System.from_ssp(tmp_path / "again.ssp")
        assert {c.target.reference: c.conversion for c in again.connections} == {
            ("p", "u"): (0.1, 1 / 3),
            ("f", "u"): (1000.0, 0.0),
        }


def test_a_converted_connection_is_not_iterated(archive: Archive) -> None:
    parts = elements(component("c", "Cubic"), component("p", "Probe"))
    system = System.from_ssp(archive(parts + connections(connected("c.y", "p.u", DOUBLED))))
    with pytest.raises(SimulationError, match=r"'implicit' carries values as they are, but 2 \* c\.y -> p\.u converts"):
        system.simulate(1.0, 0.25, coupling="implicit")


def test_a_prefix_that_is_not_declared(archive: Archive, caplog: pytest.LogCaptureFixture) -> None:
    step = '<Annotations><c:Annotation type="t"><osp:FixedStepAlgorithm baseStepSize="0.25"/><my:own my:way="1"/>'
    experiment = f'<DefaultExperiment stopTime="2">{step}</c:Annotation></Annotations></DefaultExperiment>'
    path = archive(elements(component("c", "Cubic")), more=experiment)
    system = System.from_ssp(path)
    assert (system.experiment.stop_time, system.experiment.step_size) == (2.0, 0.25)
    assert f"{path}: SystemStructure.ssd does not declare the prefix my, osp" in caplog.text


def test_items_of_an_enumeration_go_by_name(archive: Archive, fmu: FmuPaths, tmp_path: Path) -> None:
    """Which number an item has is said by the FMU; a mapping may rename items."""
    entry = '<m:MappingEntry source="status" target="a.status"><c:EnumerationMappingTransformation>{}</c:E{}>'
    rename = entry.format('<c:MapEntry source="on" target="severe"/>', "numerationMappingTransformation")
    given = bound(ENUMERATION, entries=rename + "</m:MappingEntry>")

    def change(content: bytes) -> bytes:
        items = b'<Item name="mild" value="2"/><Item name="severe" value="3"/>'
        types = b'<TypeDefinitions><SimpleType name="S"><Enumeration>%b</Enumeration></SimpleType>' % items
        content = content.replace(b"<ModelVariables>", types + b"</TypeDefinitions><ModelVariables>")
        return content.replace(b'<Integer start="2"/>', b'<Enumeration declaredType="S" start="2"/>')

    typed = {"Typed.fmu": described(fmu("Faulty"), tmp_path / "Typed.fmu", change).read_bytes()}
    path = archive(given + elements(component("a", "Typed")), **typed)
    assert System.from_ssp(path).parts["a"].starts == {"status": 3}
    plain = archive(elements(component("a", "Typed", bound(ENUMERATION))), **typed)
    assert "a.status = 'on': it is one of mild, severe" in _message(plain)


def test_parameters_are_not_converted_by_connections(archive: Archive) -> None:
    spring = elements(component("spring", "Spring")) + connections(connected("k", "spring.stiffness", DOUBLED))
    path = archive(elements(nested("inner", connectors(k="parameter"), spring)) + bound(real("inner.k", 2)))
    assert "from inner.k to inner.spring.stiffness converts a parameter" in _message(path)


def test_connection_that_keeps_values_is_none_that_changes_them(archive: Archive) -> None:
    plain = connected("c.y", "p.u", '<c:LinearTransformation factor="1.0" offset="0"/>')
    path = archive(elements(component("c", "Cubic"), component("p", "Probe")) + connections(plain))
    assert _joined(path) == {"c.y -> p.u"}


def test_files_that_are_no_archive(archive: Archive, tmp_path: Path) -> None:
    whole = archive(elements(component("c", "Cubic"))).read_bytes()
    path = tmp_path / "bad.ssp"
    assert "no such file" in _message(path)
    path.write_bytes(whole[: len(whole) // 2])
    assert "truncated" in _message(path)
    damaged = bytearray(whole)
    damaged[whole.index(b"resources/Cubic.fmu") + 2000] ^= 0xFF  # in the middle of the FMU, stored as it is
    path.write_bytes(damaged)
    assert "damaged" in _message(path)


@pytest.mark.parametrize("link", [connected("c.y", "q.u"), connected("c.z", "s.length")])
def test_nothing_unpacked_stays_behind_an_error(
    archive: Archive, link: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "temporary").mkdir()
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path / "temporary"))
    _message(archive(elements(component("c", "Cubic"), component("s", "Spring")) + connections(link)), LiaisonsError)
    assert list((tmp_path / "temporary").iterdir()) == []
