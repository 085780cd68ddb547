"""SSP archives of other makes: nested, mapped, converted, broken."""

from __future__ import annotations

import zipfile
from collections.abc import Callable
from pathlib import Path

import pytest

from liaisons import System
from liaisons.errors import ConnectError, LiaisonsError, SimulationError

FmuPaths = Callable[[str], Path]
Archive = Callable[..., Path]

ROOT = """<?xml version="1.0"?>
<SystemStructureDescription xmlns="http://ssp-standard.org/SSP1/SystemStructureDescription"
 xmlns:v="http://ssp-standard.org/SSP1/SystemStructureParameterValues"
 xmlns:m="http://ssp-standard.org/SSP1/SystemStructureParameterMapping"
 xmlns:c="http://ssp-standard.org/SSP1/SystemStructureCommon" version="{version}" name="foreign">
{system}
</SystemStructureDescription>"""

SET = """<v:ParameterSet xmlns:v="http://ssp-standard.org/SSP1/SystemStructureParameterValues"
 xmlns:c="http://ssp-standard.org/SSP1/SystemStructureCommon" version="1.0" name="values">
<v:Parameters>{}</v:Parameters>
<v:Units><c:Unit name="mm"><c:BaseUnit m="1" factor="0.001"/></c:Unit>
<c:Unit name="degC"><c:BaseUnit K="1" offset="273.15"/></c:Unit></v:Units></v:ParameterSet>"""


def _real(name: str, value: object, **attributes: str) -> str:
    more = "".join(f' {key}="{text}"' for key, text in attributes.items())
    return f'<v:Parameter name="{name}"><v:Real value="{value}"{more}/></v:Parameter>'


def _bindings(*sets: str) -> str:
    inline = (f"<ParameterBinding><ParameterValues>{SET.format(s)}</ParameterValues></ParameterBinding>" for s in sets)
    return f"<ParameterBindings>{''.join(inline)}</ParameterBindings>"


def _component(name: str, fmu: str, inside: str = "", **attributes: str) -> str:
    more = "".join(f' {key}="{text}"' for key, text in attributes.items())
    return f'<Component name="{name}" source="resources/{fmu}.fmu"{more}>{inside}</Component>'


def _connection(start: str, end: str, inside: str = "") -> str:
    names = {}
    for role, place in (("start", start), ("end", end)):
        element, _, connector = place.rpartition(".")
        names |= {f"{role}Connector": connector} | ({f"{role}Element": element} if element else {})
    attributes = " ".join(f'{key}="{text}"' for key, text in names.items())
    return f"<Connection {attributes}>{inside}</Connection>"


def _system(name: str, elements: str, connections: str = "", before: str = "", after: str = "") -> str:
    joined = f"<Connections>{connections}</Connections>" if connections else ""
    return f'<System name="{name}">{before}<Elements>{elements}</Elements>{joined}{after}</System>'


def _connectors(**kinds: str) -> str:
    listed = "".join(f'<Connector name="{name}" kind="{kind}"/>' for name, kind in kinds.items())
    return f"<Connectors>{listed}</Connectors>"


@pytest.fixture
def archive(fmu: FmuPaths, tmp_path: Path) -> Archive:
    """An archive with this system, all test FMUs, and further files."""

    def make(system: str, version: str = "1.0", **files: str) -> Path:
        path = tmp_path / "foreign.ssp"
        with zipfile.ZipFile(path, "w") as target:
            target.writestr("SystemStructure.ssd", ROOT.format(system=system, version=version))
            for name in ("Cubic", "Spring", "Mass", "Probe", "Faulty"):
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


def test_nested_systems_are_dissolved(archive: Archive) -> None:
    inner = _system(
        "inner.one",
        _component("source", "Cubic") + _component("echo", "Probe"),
        _connection("source.y", "out") + _connection("in", "echo.u"),
        before=_connectors(out="output", **{"in": "input"}),
    )
    path = archive(
        _system(
            "root",
            inner + _component("probe", "Probe"),
            _connection("inner.one.out", "probe.u") + _connection("probe.echo", "inner.one.in") + _connection("x", "y"),
        )
    )
    lines = repr(System.from_ssp(path)).splitlines()
    assert {line.strip() for line in lines if "->" in line} == {
        "inner_one_source.y -> probe.u",
        "probe.echo -> inner_one_echo.u",
    }


def test_signals_of_a_dictionary_connect_all_who_refer_to_it(archive: Archive) -> None:
    dictionary = '<SignalDictionaries><SignalDictionary name="bus" source="resources/bus.ssb"/></SignalDictionaries>'
    reference = '<SignalDictionaryReference name="{}" dictionary="bus"/>'
    inner = _system("deep", _component("p", "Probe") + reference.format("here"), _connection("here.signal", "p.u"))
    outer = _component("source", "Cubic") + reference.format("there") + inner
    path = archive(_system("root", outer, _connection("source.y", "there.signal"), after=dictionary))
    assert "source.y -> deep_p.u" in repr(System.from_ssp(path))


def test_parameters_of_all_levels(archive: Archive) -> None:
    inner = _system(
        "deep",
        _component("spring", "Spring", _bindings(_real("stiffness", 1.0) + _real("length", 0.5))),
        _connection("exposed", "spring.length_dot"),
        before=_connectors(exposed="parameter") + _bindings(_real("spring.stiffness", 2.0)),
    )
    outer = _bindings(
        _real("deep.spring.stiffness", 3.0), _real("deep.spring.stiffness", 4.0) + _real("deep.exposed", 7)
    )
    system = System.from_ssp(archive(_system("root", inner, before=outer)))
    # what stands further out, and what stands later, counts more
    assert system.parts["deep_spring"].starts == {"length": 0.5, "stiffness": 4.0, "length_dot": 7.0}


def test_prefix_source_and_mapping(archive: Archive) -> None:
    mapping = """<ParameterMapping source="resources/map.ssm"/>"""
    binding = f'<ParameterBinding source="resources/values.ssv" prefix="a.">{mapping}</ParameterBinding>'
    entries = """<m:ParameterMapping xmlns:m="http://ssp-standard.org/SSP1/SystemStructureParameterMapping"
     xmlns:c="http://ssp-standard.org/SSP1/SystemStructureCommon" version="1.0">
    <m:MappingEntry source="a.k" target="spring.stiffness">
    <c:LinearTransformation factor="2" offset="1"/></m:MappingEntry>
    <m:MappingEntry source="a.mode" target="spring.input_reconstruction"><c:IntegerMappingTransformation>
    <c:MapEntry source="5" target="2"/></c:IntegerMappingTransformation></m:MappingEntry></m:ParameterMapping>"""
    parameters = _real("k", 10) + '<v:Parameter name="mode"><v:Integer value="5"/></v:Parameter>' + _real("length", 9)
    path = archive(
        _system("root", _component("spring", "Spring"), before=f"<ParameterBindings>{binding}</ParameterBindings>"),
        **{"values.ssv": SET.format(parameters), "map.ssm": entries},
    )
    # with a mapping, only what it names is taken
    assert System.from_ssp(path).parts["spring"].starts == {"stiffness": 21.0, "input_reconstruction": 2}


def test_units_are_converted(archive: Archive, caplog: pytest.LogCaptureFixture) -> None:
    values = _real("length", 250, unit="mm") + _real("stiffness", 5, unit="mm") + _real("nothing", 1)
    path = archive(_system("root", _component("spring", "Spring", _bindings(values))))
    starts = System.from_ssp(path).parts["spring"].starts
    assert starts == {"length": 0.25, "stiffness": 5.0}  # the FMU gives the stiffness no unit
    assert "has no variable 'nothing'" in caplog.text
    kelvin = archive(_system("root", _component("spring", "Spring", _bindings(_real("length", 1, unit="degC")))))
    assert "spring.length = 1.0: the unit of the parameter is of another kind" in _message(kelvin)


def test_percent_encoded_sources_and_empty_element_names(archive: Archive, fmu: FmuPaths) -> None:
    path = archive(
        _system(
            "root",
            '<Component name="c" source="resources/two%20words.fmu"/>' + _component("p", "Probe"),
            _connection("c.y", "p.u")
            + '<Connection startElement="" startConnector="s" endElement="c" endConnector="y"/>',
        )
    )
    with zipfile.ZipFile(path, "a") as target:
        target.write(fmu("Cubic"), "resources/two words.fmu")
    assert "c.y -> p.u" in repr(System.from_ssp(path))


@pytest.mark.parametrize(
    ("system", "words"),
    [
        (_component("a", "Nowhere"), ["component a", "resources/Nowhere.fmu", "lacks that file"]),
        ('<Component name="a" source="../a.fmu"/>', ["component a", "outside the archive"]),
        ('<Component name="a" source="https://example.org/a.fmu"/>', ["component a", "outside the archive"]),
        ('<Component name="a"/>', ["component a has no source"]),
        (_component("a", "Cubic", type="application/x-ssp-package"), ["component a", "x-ssp-package", "only FMUs"]),
        (_component("a", "Cubic", implementation="ModelExchange"), ["component a asks for ModelExchange"]),
        ('<Component source="resources/Cubic.fmu"/>', ["a Component without name"]),
        (_component("a", "Cubic") * 2, ["two elements are called a"]),
        (_component("a", "Spring", _bindings(_real("stiffness", "much"))), ["stiffness = 'much'", "no Real"]),
        (
            _component("a", "Spring", _bindings('<v:Parameter name="x"><v:Enumeration value="on"/></v:Parameter>')),
            ["parameter x is of type Enumeration"],
        ),
        (_component("a", "Spring", _bindings(_real("seen", 1))), ["a.seen = 1.0", "calculated"]),
        (
            _component(
                "a", "Spring", '<ParameterBindings><ParameterBinding source="resources/a.ssv"/></ParameterBindings>'
            ),
            ["the parameter set of a", "resources/a.ssv", "lacks that file"],
        ),
        ('<SignalDictionaryReference name="r" dictionary="d"/>', ["signal dictionary 'd'"]),
    ],
)
def test_elements_that_will_not_do(archive: Archive, system: str, words: list[str]) -> None:
    message = _message(archive(_system("root", system)))
    assert all(word in message for word in words), message


@pytest.mark.parametrize(
    ("connections", "words"),
    [
        (_connection("c.y", "q.u"), ["q.u", "no element 'q'"]),
        (_connection("c.y", "p.v"), ["Probe.fmu has no variable 'v'"]),
        (_connection("c.y", "p.u") + _connection("f.x", "p.u"), ["f.x", "p.u", "c.y feeds it already"]),
        (_connection("s.seen", "f.u"), ["s.seen [m]", "f.u [mm]", "factor 1000"]),
        (_connection("p.count", "f.u"), ["p.count is Integer"]),
        (
            _connection("c.y", "p.u", '<c:LinearTransformation factor="2"/>'),
            ["connection from c.y to p.u has a LinearTransformation"],
        ),
        ('<Connection startElement="c" endElement="p" endConnector="u"/>', ["a Connection without startConnector"]),
        (_connection("a", "b") + _connection("b", "a") + _connection("a", "p.u"), ["round in a circle"]),
        (
            _connection("c.y", "a") + _connection("f.x", "a") + _connection("a", "p.u"),
            ["a has several sources: c.y, f.x"],
        ),
    ],
)
def test_connections_that_will_not_do(archive: Archive, connections: str, words: list[str]) -> None:
    parts = {"c": "Cubic", "p": "Probe", "f": "Faulty", "s": "Spring"}
    elements = "".join(_component(name, fmu) for name, fmu in parts.items())
    message = _message(archive(_system("root", elements, connections)), LiaisonsError)
    assert all(word in message for word in words), message


def test_connection_that_keeps_values_is_none_that_changes_them(archive: Archive) -> None:
    plain = _connection("c.y", "p.u", '<c:LinearTransformation factor="1.0" offset="0"/>')
    path = archive(_system("root", _component("c", "Cubic") + _component("p", "Probe"), plain))
    assert "c.y -> p.u" in repr(System.from_ssp(path))


def test_version_that_is_not_known(archive: Archive) -> None:
    assert "SSP version '3.0' is not known; known: 1.0, 2.0" in _message(archive(_system("root", ""), version="3.0"))


def test_files_that_are_no_archive(archive: Archive, tmp_path: Path) -> None:
    whole = archive(_system("root", _component("c", "Cubic"))).read_bytes()
    path = tmp_path / "bad.ssp"
    assert "no such file" in _message(path)
    path.write_bytes(whole[: len(whole) // 2])
    assert "truncated" in _message(path)
    damaged = bytearray(whole)
    damaged[whole.index(b"resources/Cubic.fmu") + 2000] ^= 0xFF  # in the middle of the FMU, stored as it is
    path.write_bytes(damaged)
    assert "damaged" in _message(path)
    with zipfile.ZipFile(path, "w") as target:
        target.writestr("readme.txt", "no system")
    assert "has no SystemStructure.ssd inside" in _message(path)
    with zipfile.ZipFile(path, "w") as target:
        target.writestr("SystemStructure.ssd", "<half")
    assert "SystemStructure.ssd cannot be read" in _message(path)
    with zipfile.ZipFile(path, "w") as target:
        target.writestr("SystemStructure.ssd", "<other/>")
    assert "expected ssd:SystemStructureDescription" in _message(path)


def test_nothing_unpacked_stays_behind_an_error(
    archive: Archive, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "temporary").mkdir()
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path / "temporary"))
    path = archive(_system("root", _component("c", "Cubic"), _connection("c.y", "q.u")))
    _message(path)
    path = archive(
        _system("root", _component("c", "Cubic") + _component("s", "Spring"), _connection("c.z", "s.length"))
    )
    _message(path, ConnectError)
    assert list((tmp_path / "temporary").iterdir()) == []
