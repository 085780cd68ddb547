"""Each element and attribute of the schemas of SSP 1.0 and 2.0, one at a time in a small archive.

It is obeyed, listed in a warning, refused, or has no meaning for a motion, for a reason that stands here.  ``python
tests/kernel/cosim/test_ssp_attributes.py`` writes docs/reference/ssp.md, which these tests keep up to date.
"""

from __future__ import annotations

import logging
import re
import tempfile
import zipfile
from collections.abc import Iterator
from functools import cache
from importlib.resources import files
from pathlib import Path
from typing import Any, NamedTuple
from xml.etree import ElementTree

import pytest
from hostile import SPACES, SSP, UNITS
from making import FmuPaths, described

from liaisons import System
from liaisons.errors import LiaisonsError

PAGE = Path(__file__).parents[3] / "docs" / "reference" / "ssp.md"
OBEYED, LISTED, REFUSED, NONE = "obeyed", "listed", "refused", "no meaning for a motion"

DOCUMENTS = {
    "Description": f"""<SystemStructureDescription xmlns="{SSP}Description" {SPACES} version="2.0" name="s">
  <System name="s">
    <Connectors><Connector name="k" kind="parameter"/></Connectors>
    <ParameterBindings>
      <ParameterBinding source="resources/v.ssv"><ParameterMapping source="resources/m.ssm"/></ParameterBinding>
    </ParameterBindings>
    <Elements>
      <Component name="spring" source="resources/Spring.fmu">
        <Connectors><Connector name="seen" kind="output"/></Connectors>
        <ParameterBindings>
          <ParameterBinding source="resources/own.ssv"><ParameterMapping source="resources/own.ssm"/></ParameterBinding>
        </ParameterBindings>
      </Component>
      <Component name="faulty" source="resources/Faulty.fmu"/>
      <Component name="points" source="resources/Points.fmu"/>
      <System name="inner">
        <Connectors><Connector name="out" kind="output"/></Connectors>
        <Elements><Component name="again" source="resources/Spring.fmu"/></Elements>
        <Connections>
          <Connection startElement="again" startConnector="seen" endConnector="out">
            <c:LinearTransformation offset="1"/>
          </Connection>
        </Connections>
      </System>
      <SignalDictionaryReference name="bus" dictionary="d">
        <Connectors><Connector name="signal"/></Connectors>
      </SignalDictionaryReference>
    </Elements>
    <Connections>
      <Connection startElement="spring" startConnector="seen" endElement="bus" endConnector="signal">
        <c:LinearTransformation factor="3" offset="1"/>
      </Connection>
      <Connection startElement="bus" startConnector="signal" endElement="faulty" endConnector="u"/>
      <Connection startElement="inner" startConnector="out" endElement="spring" endConnector="length"/>
      <Connection startConnector="k" endElement="faulty" endConnector="limit"/>
    </Connections>
    <SignalDictionaries><SignalDictionary name="d" source="resources/d.ssb"/></SignalDictionaries>
  </System>
  <Units>{UNITS}</Units>
  <DefaultExperiment startTime="0" stopTime="3"/>
</SystemStructureDescription>""",
    "ParameterValues": f"""<v:ParameterSet {SPACES} version="2.0" name="v">
  <v:Parameters><v:Parameter name="p"><v:Real value="4"/></v:Parameter></v:Parameters><v:Units>{UNITS}</v:Units>
</v:ParameterSet>""",
    "ParameterMapping": f"""<m:ParameterMapping {SPACES} version="2.0">
  <m:MappingEntry source="p" target="k"/>
</m:ParameterMapping>""",
    "SignalDictionary": f"""<b:SignalDictionary xmlns:b="{SSP}SignalDictionary" {SPACES} version="2.0">
  <b:DictionaryEntry name="signal"/><b:Units>{UNITS}</b:Units>
</b:SignalDictionary>""",
}
"""A small archive: two FMUs, a connection through a signal dictionary, a parameter set with mappings, units."""
NAMES = dict(
    zip(DOCUMENTS, ("SystemStructure.ssd", "resources/v.ssv", "resources/m.ssm", "resources/d.ssb"), strict=True)
)

OWN = DOCUMENTS["ParameterMapping"].replace('target="k"', 'target="length"')
MORE = {
    "resources/own.ssm": OWN,
    "resources/own.ssv": DOCUMENTS["ParameterValues"],
    "resources/other.ssm": OWN.replace('target="length"', 'target="length_dot"'),
    "resources/outer.ssm": OWN.replace('target="length"', 'target="spring.length_dot"'),
    "resources/other.ssv": DOCUMENTS["ParameterValues"].replace('value="4"', 'value="6"'),
    "resources/other.ssb": DOCUMENTS["SignalDictionary"].replace("/>", '><c:Real unit="mm"/></b:DictionaryEntry>', 1),
}
"""What else is in the archive."""

Edits = dict[str, dict[str, str]]
"""Attributes by the place of an element, which is added where there is none."""
COMPONENT, REFERENCE, LINK = "System/Component", "System/SignalDictionaryReference", "System/Connection"
SIGNAL, ENTRY = f"{REFERENCE}/Connector", "ParameterMapping/MappingEntry"
IN_DICTIONARY, VALUE = "SignalDictionary/DictionaryEntry", "ParameterSet/Parameter"
Values = dict[str, str | tuple[str, Edits]]
"""Values of attributes, and what they need besides."""
BOUND: Values = {"source": "resources/other.ssv", "sourceBase": "component", "prefix": "a."}
MM = {f"{SIGNAL}/Real": {"unit": "mm"}}


def value_of(kind: str, value: str, target: str) -> dict[str, Values]:
    """A value of a parameter of a type, and the variable that it is for."""
    return {f"{VALUE}/{kind}": {"value": (value, {ENTRY: {"target": target}, f"{VALUE}/{kind}": {"value": ""}})}}


RENAMED = "="
"""Before a value: what refers to the old one refers to the new one."""
VALUES: dict[str, Values] = {  # that change the motion, or are refused; others: "1"
    "SystemStructureDescription": {"version": "3.0", "name": "other"},
    "System": {"name": ("other", {"SystemStructureDescription": {"name": ""}})},
    "System/Connector": {"name": ("other", {"System/Connector/Real": {"unit": "mm"}}), "kind": "input"},
    "System/Connector/Real": {"unit": "mm"},
    **dict.fromkeys((f"{p}/ParameterBinding" for p in ("System", COMPONENT, REFERENCE)), BOUND),
    "System/ParameterBinding/ParameterMapping": {"source": "resources/outer.ssm", "sourceBase": "component"},
    f"{COMPONENT}/ParameterBinding/ParameterMapping": {"source": "resources/other.ssm", "sourceBase": "component"},
    COMPONENT: {
        "name": "=other",
        "type": "application/x-ssp-package",
        "source": "resources/Again.fmu",
        "implementation": "ScheduledExecution",
    },
    f"{COMPONENT}/Connector": {"kind": "input", "name": ("other", {f"{COMPONENT}/Connector/Real": {"unit": "mm"}})},
    f"{COMPONENT}/Connector/Real": {"unit": "mm"},
    REFERENCE: {"name": "=other", "dictionary": "other"},
    SIGNAL: {"name": ("other", MM)},
    f"{SIGNAL}/Real": {"unit": "mm"},
    LINK: {
        "startElement": ("faulty", {LINK: {"startConnector": "x"}}),
        "startConnector": "seen_dot",
        "startIndices": ("3", {LINK: {"startElement": "points", "startConnector": "theta"}}),
        "endElement": ("faulty", {LINK: {"endConnector": "u"}}),
        "endConnector": "other",
        "endIndices": ("2", {LINK: {"startElement": "points", "startConnector": "theta", "startIndices": "3"}}),
        "suppressUnitConversion": ("true", MM),
    },
    f"{LINK}/LinearTransformation": {"factor": "2", "offset": "5"},
    "System/SignalDictionary": {"name": "=other", "source": "resources/other.ssb"},
    "Unit": {"name": ("ell", {f"{SIGNAL}/Real": {"unit": "ell"}})},
    "DefaultExperiment": {"startTime": "0.5", "stopTime": "2"},
    "ParameterSet": {"version": "3.0"},
    VALUE: {"name": "other"},
    "ParameterSet/Unit": {"name": ("ell", {f"{VALUE}/Real": {"unit": "ell"}})},
    ENTRY: {
        "source": "other",
        "target": "faulty.time_of_failure",
        "suppressUnitConversion": ("true", {f"{VALUE}/Real": {"unit": "mm"}, ENTRY: {"target": "spring.length"}}),
    },
    f"{ENTRY}/LinearTransformation": {"factor": "2", "offset": "5"},
    "ParameterMapping": {"version": "3.0"},
    "SignalDictionary": {"version": "3.0"},
    IN_DICTIONARY: {"name": ("other", {f"{IN_DICTIONARY}/Real": {"unit": "mm"}})},
    "SignalDictionary/Unit": {"name": ("ell", {f"{IN_DICTIONARY}/Real": {"unit": "ell"}})},
}
for _kind in ("Float64", "Float32"):
    VALUES |= {
        f"{place}/{_kind}": VALUES[f"{place}/Real"] for place in ("System/Connector", f"{COMPONENT}/Connector", SIGNAL)
    }
for _kind in ("Real", "Float64", "Float32"):
    VALUES |= value_of(_kind, "6", "faulty.limit")
    VALUES[f"{VALUE}/{_kind}"]["unit"] = "mm", {f"{VALUE}/{_kind}": {"value": "5"}, ENTRY: {"target": "spring.length"}}
    VALUES[f"{IN_DICTIONARY}/{_kind}"] = {"unit": "mm"}
for _kind in ("Integer", "Int8", "UInt8", "Int16", "UInt16", "Int32", "UInt32", "Int64", "UInt64"):
    VALUES |= value_of(_kind, "0", "spring.input_reconstruction")
VALUES |= value_of("Boolean", "true", "faulty.flag")
for _kind, _value, _target in (("String", "words", "faulty.label"), ("Enumeration", "severe", "faulty.status")):
    VALUES |= value_of(_kind, _value, _target) | value_of(f"{_kind}/Value", _value, _target)
VALUES[f"{VALUE}/Enumeration"]["name"] = (
    "1",
    {ENTRY: {"target": "faulty.status"}, f"{VALUE}/Enumeration": {"value": "severe"}},
)
VALUES |= value_of("Binary", "00", "faulty.label") | value_of("Binary/Value", "00", "faulty.label")
for _place, _users in (
    ("", f"{SIGNAL}/Real"),
    ("ParameterSet/", f"{VALUE}/Real"),
    ("SignalDictionary/", f"{IN_DICTIONARY}/Real"),
):
    _used: Edits = {_users: {"unit": "mm"}} | (
        {ENTRY: {"target": "spring.length"}} if _place == "ParameterSet/" else {}
    )
    VALUES[f"{_place}Unit/BaseUnit"] = {
        **dict.fromkeys(("kg", "s", "A", "K", "mol", "cd", "rad"), ("1", _used)),
        "m": ("2", _used),
        "factor": ("0.5", _used),
        "offset": ("7", _used),
    }
for _kind, _old, _new, _target, _type in (
    ("Boolean", "false", "true", "faulty.flag", "Boolean"),
    ("Integer", "2", "0", "spring.input_reconstruction", "Integer"),
    ("Enumeration", "on", "severe", "faulty.status", "Enumeration"),
):
    _given = {f"{VALUE}/{_type}": {"value": _old}, ENTRY: {"target": _target}}
    _map = f"{ENTRY}/{_kind}MappingTransformation/MapEntry"
    VALUES[_map] = {
        "source": (_old, _given | {_map: {"target": _new}}),
        "target": (_new, _given | {_map: {"source": _old}}),
    }

_TYPES = "(Real|Float64|Float32|U?Int(eger|8|16|32|64)|Boolean|String|Enumeration|Binary|Clock|Dimension)"
NO_MEANING = {  # of what the schemas have, by place and attribute: why it changes no motion
    r".*Geometry": "drawing",
    r".*GraphicalElements": "drawing",
    r".*(Annotations|MetaData|Signature)": "belongs to other tools; step sizes of OSP and OMSimulator are read",
    r".* (id|description|author|fileversion|copyright|license|generationTool|generationDateAndTime)": "documentation",
    r"ParameterSet name": "documentation",
    rf"(.*/Connector|{IN_DICTIONARY})/{_TYPES}( (?!unit)[\w-]+)?": "types and sizes are those of the FMUs",
    rf"{VALUE}/(Dimension .*|Enumeration name)": "types and sizes are those of the FMUs",
    r"(.*/)?Enumeration( name|/Item .*)": "items have the numbers of the FMUs",
    r".*(ParameterBinding|ParameterMapping|SignalDictionary) type": "the file says what it is; another root is refused",
    rf"{SIGNAL} kind": "the direction is that of the connections",
}


IN_TEXT = {"drawing", "documentation", NO_MEANING[r".*(Annotations|MetaData|Signature)"]}
"""Reasons that the page gives in words."""


class Trial(NamedTuple):
    """An attribute of an element, or, without one, an element as a whole."""

    document: str
    chain: tuple[str, ...]
    place: str
    attribute: str = ""

    @property
    def reason(self) -> str | None:
        """Why it has no meaning for a motion, if so."""
        label = f"{self.place} {self.attribute}".strip()
        return next((why for pattern, why in NO_MEANING.items() if re.fullmatch(pattern, label)), None)


def trials() -> dict[str, Trial]:
    """All attributes and elements of the schemas, the newer one first, by place and attribute."""
    pytest.importorskip("pyssp_standard")
    xmlschema = pytest.importorskip("xmlschema")
    found: dict[str, Trial] = {}
    for version in ("ssp2", ""):
        for document in DOCUMENTS:
            path = files("pyssp_standard") / "resources" / version / f"SystemStructure{document}.xsd"
            for root in xmlschema.XMLSchema(str(path)).elements.values():
                for trial in _of_schema(document, root, (), ""):
                    found.setdefault(f"{trial.place} {trial.attribute}".strip(), trial)
    return found


def _of_schema(document: str, element: Any, chain: tuple[str, ...], place: str) -> Iterator[Trial]:
    if element.name in chain:  # a system in a system
        return
    chain, name, attributes = (*chain, element.name), element.local_name, list(element.attributes)
    children = [child for child in element.type.content if element.type.has_complex_content()]
    inside = [child for child in element.type.content.iter_elements() if child.name] if children else []
    closed = re.fullmatch(r"Annotations|MetaData|Signature|\w*Geometry|GraphicalElements", name)
    is_container = bool(inside) and not (attributes or closed or name.endswith("Transformation"))
    place = place if is_container else f"{place}/{name}".removeprefix("/")
    if closed or not (attributes or inside):
        yield Trial(document, chain, place)
        return
    yield from (Trial(document, chain, place, attribute) for attribute in attributes)
    place = "" if name == "SystemStructureDescription" else place
    for child in inside:
        yield from _of_schema(document, child, chain, place)


class Reader:
    """Reads variants of the small archive.

    :param fmu: path of an FMU by its name.
    """

    def __init__(self, fmu: FmuPaths, folder: Path) -> None:
        self.path, self.trials = folder / "small.ssp", trials()
        self.chains = {trial.place: trial for trial in self.trials.values()}
        items = b'<SimpleType name="S"><Enumeration><Item name="mild" value="2"/><Item name="severe" value="3"/>'
        types = b"<TypeDefinitions>%b</Enumeration></SimpleType></TypeDefinitions><ModelVariables>" % items

        def change(content: bytes) -> bytes:
            content = content.replace(b"<ModelVariables>", types)
            return content.replace(b'<Integer start="2"/>', b'<Enumeration declaredType="S" start="2"/>')

        faulty = described(fmu("Faulty"), folder / "Faulty.fmu", change)
        fmus = {"Spring": fmu("Spring"), "Again": fmu("Spring"), "Faulty": faulty, "Points": fmu("Points")}
        self.files = {f"resources/{name}.fmu": path.read_bytes() for name, path in fmus.items()}
        self.files |= {name: text.encode() for name, text in MORE.items()}
        self.read = cache(self._read)

    def documents(self, trial: Trial, *, plain: bool = False) -> tuple[bytes, ...]:
        """The small archive with the attribute.

        :param plain: without it, but with what its value needs besides.
        """
        roots = {document: ElementTree.fromstring(text) for document, text in DOCUMENTS.items()}
        value = VALUES.get(trial.place, {}).get(trial.attribute, "1")
        value, besides = value if isinstance(value, tuple) else (value, {})
        own = {trial.attribute: value.removeprefix(RENAMED)} if trial.attribute else {}
        around = trial.place if trial.attribute else trial.place.rpartition("/")[0]
        there = [(around, {})] if trial.reason and around in self.chains else []  # which may matter as such
        for place, attributes in [*besides.items(), *there, *([] if plain else [(trial.place, own)])]:
            element = self._element(roots, place)
            element.attrib |= attributes
            if "" in attributes.values():
                element.attrib = {key: text for key, text in element.attrib.items() if text}
        if trial.place.endswith("/ParameterValues") and not plain:  # inline
            self._element(roots, trial.place).append(ElementTree.fromstring(MORE["resources/other.ssv"]))
            self._element(roots, trial.place.rpartition("/")[0]).attrib.pop("source", None)
        if value.startswith(RENAMED):
            itself = self._element(roots, trial.place)
            old = self._element({d: ElementTree.fromstring(t) for d, t in DOCUMENTS.items()}, trial.place).get("name")
            for element in (e for root in roots.values() for e in root.iter() if e is not itself):
                element.attrib |= {k: value.removeprefix(RENAMED) for k, text in element.items() if text == old}
        return tuple(map(ElementTree.tostring, roots.values()))

    def _element(self, roots: dict[str, ElementTree.Element], place: str) -> ElementTree.Element:
        """The first element at a place, added where there is none; a parameter has one value."""
        document, chain, *_ = self.chains[place]
        element = roots[document]
        nested = chain[2:3] and place.startswith("System/Connector")  # which leads further than one of the outermost
        elements, system = f"{chain[1].partition('}')[0]}}}Elements" if nested else "", chain[1] if nested else ""
        for name in [*chain[1:2], *filter(None, [elements, system]), *chain[2:]]:
            found = element.find(name)
            is_value = element.tag.endswith("}Parameter") and not name.endswith(("}Dimension", "}Annotations"))
            if found is None:
                for other in [*element] if is_value else []:
                    element.remove(other)
                found = ElementTree.SubElement(element, name)
            element = found
        return element

    def _read(self, documents: tuple[bytes, ...]) -> tuple[object, tuple[str, ...]]:
        """What a system consists of, or the error of the archive; and what is warned of."""
        with zipfile.ZipFile(self.path, "w") as archive:
            for name, content in [*zip(NAMES.values(), documents, strict=True), *self.files.items()]:
                archive.writestr(name, content)
        said: list[str] = []
        handler = logging.Handler()
        handler.emit = lambda record: said.append(record.getMessage())
        logging.getLogger("liaisons").addHandler(handler)
        try:
            system = System.from_ssp(self.path)
        except LiaisonsError as error:
            return error, tuple(said)
        finally:
            logging.getLogger("liaisons").removeHandler(handler)
        parts = [(name, part.fmu.path.name, dict(part.starts)) for name, part in system.parts.items()]
        links = [(c.source.reference, c.target.reference, c.conversion) for c in system.connections]
        return repr((system.name, parts, links, system.experiment)), tuple(said)

    def verdict(self, trial: Trial) -> str:
        """Whether the attribute is obeyed, listed or refused, or changes nothing."""
        (before, known), (after, said) = (self.read(self.documents(trial, plain=plain)) for plain in (True, False))
        value = VALUES.get(trial.place, {}).get(trial.attribute, "1")
        value, tags = value[0] if isinstance(value, tuple) else value, trial.place.split("/")[-2:]
        named = re.compile(rf"\b({'|'.join(map(re.escape, filter(None, [*tags, trial.attribute, value])))})\b")
        if isinstance(after, LiaisonsError):
            words = str(after)
            if re.search("of different kinds|of another kind", words) and not isinstance(before, LiaisonsError):
                return OBEYED  # the unit
            assert named.search(words), (trial, words)
            return REFUSED
        if [line for line in said if line not in known and named.search(line)]:
            return LISTED
        return NONE if before == after else OBEYED


TITLE = """# SSP: which elements and attributes are read

Each element and attribute of the SSP 1.0 and 2.0 schemas was tried, one at a time, in a small archive. *Obeyed* means
that it changes the start values, connections, conversions or the experiment of the system; a unit of the wrong kind
is refused for that reason. *Listed* means that it is ignored, with a warning. *Refused* means an error that names it.
Sets, mappings and dictionaries inside the structure are read like those in files.

Some further elements and attributes have no meaning for a motion. They are meant for drawing (geometries,
`GraphicalElements`), for documentation (`id`, `description`, `author`, `fileversion`, `copyright`, `license`,
`generationTool`, `generationDateAndTime`), or for other tools (`MetaData`, `Signature`, and `Annotations` except the
step sizes of OSP and OMSimulator, which are read).

Types, sizes and numbers of enumeration items are taken from the FMUs, the direction of a dictionary's signals from
their connections, and the kind of a file from its content. A unit of a component's connector is refused if it differs
from that of its FMU.
"""


def page(reader: Reader) -> str:
    """The table: of each element, the attributes that are obeyed, listed, refused and without meaning."""
    rows: dict[str, dict[str, list[str]]] = {}
    for trial in reader.trials.values():
        if trial.reason in IN_TEXT:
            continue
        verdict = NONE if trial.reason else reader.verdict(trial)
        assert trial.reason or verdict != NONE, f"{trial.place} {trial.attribute} is ignored, and nothing says so"
        row = rows.setdefault(trial.place, {OBEYED: [], LISTED: [], REFUSED: [], NONE: []})
        row[verdict].append(trial.attribute or "as a whole")
    cells: dict[tuple[str, str], list[str]] = {}
    for place, row in rows.items():  # siblings of the same kind in one row
        outer, _, tag = place.rpartition("/")
        cells.setdefault((outer, " | ".join(", ".join(names) or "–" for names in row.values())), []).append(tag)
    head = [f"| element | obeyed | listed | refused, by name | {NONE} |", "|---|---|---|---|---|"]
    return "\n".join(
        [TITLE, *head, *(f"| {_label(outer, tags)} | {row} |" for (outer, row), tags in cells.items()), ""]
    )


def _label(outer: str, tags: list[str]) -> str:
    return (
        f"`{outer}/`: {', '.join(tags)}"
        if len(tags) > 1 and outer
        else ", ".join(f"`{f'{outer}/{tag}'.strip('/')}`" for tag in tags)
    )


@pytest.mark.variants(core=0)
def test_the_page_is_up_to_date(fmu: FmuPaths, tmp_path: Path) -> None:
    assert PAGE.read_text(encoding="utf-8") == page(Reader(fmu, tmp_path)), f"python {__file__} writes it"


@pytest.mark.slow
def test_what_has_no_meaning_changes_nothing(fmu: FmuPaths, tmp_path: Path) -> None:
    """Nor is it refused."""
    reader = Reader(fmu, tmp_path)
    found = {label: reader.verdict(trial) for label, trial in reader.trials.items() if trial.reason}
    assert {label for label, verdict in found.items() if verdict != NONE} == set()
    assert {trial.reason for trial in reader.trials.values()} == {None, *NO_MEANING.values()}


if __name__ == "__main__":
    import conftest

    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        reader = Reader(lambda fmu: conftest._build(folder, fmu, getattr(conftest, fmu.upper())), folder)
        PAGE.write_text(page(reader), encoding="utf-8")
