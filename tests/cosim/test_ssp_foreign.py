"""SSP archives of other makes: nested, mapped, converted, broken."""

from __future__ import annotations

import zipfile
from collections.abc import Callable
from pathlib import Path

import pytest
from hostile import (
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
from making import FmuPaths

from liaisons import System
from liaisons.errors import LiaisonsError, SimulationError

Archive = Callable[..., Path]


@pytest.fixture
def archive(fmu: FmuPaths, tmp_path: Path) -> Archive:
    """An archive with this system, all test FMUs, and further files."""

    def make(system: str, version: str = "1.0", **files: str) -> Path:
        path = tmp_path / "foreign.ssp"
        with zipfile.ZipFile(path, "w") as target:
            target.writestr("SystemStructure.ssd", structure(system, version=version))
            for name in ("Cubic", "Spring", "Mass", "Probe", "Faulty", "Discrete"):
                target.write(fmu(name), f"resources/{name}.fmu")
            for name, text in files.items():
                target.writestr(f"resources/{name}", text)
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


def test_units_are_converted(archive: Archive, caplog: pytest.LogCaptureFixture) -> None:
    values = real("length", 250, unit="mm") + real("stiffness", 5, unit="mm") + real("nothing", 1)
    starts = System.from_ssp(archive(elements(component("spring", "Spring", bound(values))))).parts["spring"].starts
    assert starts == {"length": 0.25, "stiffness": 5.0}  # the FMU gives the stiffness no unit
    assert "has no variable 'nothing'" in caplog.text
    kelvin = archive(elements(component("spring", "Spring", bound(real("length", 1, unit="degC")))))
    assert "spring.length = 1.0: the unit of the parameter is of another kind" in _message(kelvin)


def test_percent_encoded_sources_and_empty_element_names(archive: Archive, fmu: FmuPaths) -> None:
    empty = '<Connection startElement="" startConnector="s" endElement="c" endConnector="y"/>'
    parts = elements(component("c", "two%20words"), component("p", "Probe"))
    path = archive(parts + connections(connected("c.y", "p.u"), empty))
    with zipfile.ZipFile(path, "a") as target:
        target.write(fmu("Cubic"), "resources/two words.fmu")
    assert _joined(path) == {"c.y -> p.u"}


ENUMERATION = '<v:Parameter name="x"><v:Enumeration value="on"/></v:Parameter>'
ELSEWHERE = f"<ParameterBindings>{binding('', source='resources/a.ssv')}</ParameterBindings>"
DOUBLED = '<c:LinearTransformation factor="2"/>'


@pytest.mark.parametrize(
    ("system", "words"),
    [
        (component("a", "Nowhere"), ["component a", "resources/Nowhere.fmu", "lacks that file"]),
        (component("a", source="https://example.org/a.fmu"), ["component a", "outside the archive"]),
        ('<Component name="a"/>', ["component a has no source"]),
        (component("a", "Cubic", type="application/x-ssp-package"), ["component a", "x-ssp-package", "only FMUs"]),
        (component("a", "Cubic", implementation="ModelExchange"), ["component a asks for ModelExchange"]),
        ('<Component source="resources/Cubic.fmu"/>', ["a Component without name"]),
        (component("a", "Cubic") * 2, ["two elements are called a"]),
        (component("a", "Spring", bound(real("stiffness", "much"))), ["stiffness = 'much'", "no Real"]),
        (component("a", "Spring", bound(ENUMERATION)), ["parameter x is of type Enumeration"]),
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
        ([connected("c.y", "q.u")], ["q.u", "no element 'q'"]),
        ([connected("c.y", "p.v")], ["Probe.fmu has no variable 'v'"]),
        ([connected("c.y", "p.u"), connected("f.x", "p.u")], ["f.x", "p.u", "c.y feeds it already"]),
        ([connected("s.seen", "f.u")], ["s.seen [m]", "f.u [mm]", "factor 1000"]),
        ([connected("d.late", "p.u")], ["d.late (Boolean)", "p.u (Real)"]),
        ([connected("c.y", "p.u", DOUBLED)], ["connection from c.y to p.u has a LinearTransformation"]),
        (['<Connection startElement="c" endElement="p" endConnector="u"/>'], ["a Connection without startConnector"]),
        ([connected("a", "b"), connected("b", "a"), connected("a", "p.u")], ["round in a circle"]),
        ([connected("c.y", "a"), connected("f.x", "a"), connected("a", "p.u")], ["a has several sources: c.y, f.x"]),
    ],
)
def test_connections_that_will_not_do(archive: Archive, links: list[str], words: list[str]) -> None:
    parts = {"c": "Cubic", "p": "Probe", "f": "Faulty", "s": "Spring", "d": "Discrete"}
    inside = elements(*(component(name, fmu) for name, fmu in parts.items()))
    message = _message(archive(inside + connections(*links)), LiaisonsError)
    assert all(word in message for word in words), message


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
