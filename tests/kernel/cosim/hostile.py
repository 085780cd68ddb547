"""Archives that nobody should have to meet; each is made by a function that writes it to a path."""

from __future__ import annotations

import stat
import struct
import zipfile
import zlib
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import fmpy

LIBRARY = f"binaries/{fmpy.platform}/x{fmpy.sharedLibraryExtension}"
DEFLATED = zipfile.ZIP_DEFLATED
DESCRIPTION = "modelDescription.xml"
STRUCTURE = "SystemStructure.ssd"

ZEROS = 100 * 2**20  # a member of a bomb


@dataclass(frozen=True)
class Member:
    """A member as it stands in a zip archive, true or not."""

    name: bytes
    data: bytes = b""
    method: int = zipfile.ZIP_STORED
    flags: int = 0
    size: int | None = None
    mode: int = 0o100644
    again: bool = False  # no data of its own, but those of the first member


def zipped(path: Path, members: Iterable[Member]) -> None:
    """Write an archive, by hand: nothing is checked."""
    body, directory, count, first = bytearray(), bytearray(), 0, 0
    for member in members:
        deflated = member.method == DEFLATED
        packed = _deflated(member.data) if deflated and not member.again else member.data
        size = len(member.data) if member.size is None else member.size
        sums = struct.pack("<HHIIII", 0, 0x21, zlib.crc32(member.data), len(packed), size, 0)[:-4]
        offset = first if member.again else len(body)
        head = struct.pack("<HHH", 20, member.flags, member.method) + sums + struct.pack("<HH", len(member.name), 0)
        if not member.again:
            body += b"PK\x03\x04" + head + member.name + packed
        directory += b"PK\x01\x02" + struct.pack("<H", 0x314) + head + struct.pack("<HHH", 0, 0, 0)
        directory += struct.pack("<II", member.mode << 16, offset) + member.name
        count += 1
    end = struct.pack("<HHHHIIH", 0, 0, count & 0xFFFF, count & 0xFFFF, len(directory), len(body), 0)
    path.write_bytes(body + directory + b"PK\x05\x06" + end)


def _deflated(data: bytes) -> bytes:
    packer = zlib.compressobj(1, zlib.DEFLATED, -15)
    return packer.compress(data) + packer.flush()


Write = Callable[[Path], object]


def text(words: str, *more: Member) -> Write:
    """An FMU with this model description, and a library that is none."""
    return data(words.encode(), *more)


def data(words: bytes, *more: Member) -> Write:
    """The same, of any bytes."""
    members = [Member(DESCRIPTION.encode(), words, DEFLATED), Member(LIBRARY.encode(), b"no library")]
    return partial(zipped, members=[*members, *more])


def beside(name: bytes, content: bytes, method: int = zipfile.ZIP_STORED, **more: Any) -> Write:
    """A good description with this member beside it."""
    return text(GOOD, Member(name, content, method, **more))


def two(variables: str = "", *, inside: str = "", root: str = "", outputs: str = "") -> str:
    """A model description of FMI 2.0."""
    return (
        f'<?xml version="1.0" encoding="UTF-8"?><fmiModelDescription fmiVersion="2.0" modelName="x" guid="x" {root}>'
        f'<CoSimulation modelIdentifier="x"/>{inside}<ModelVariables>{variables}</ModelVariables>'
        f"<ModelStructure>{outputs}</ModelStructure></fmiModelDescription>"
    )


def three(variables: str) -> str:
    """A model description of FMI 3.0."""
    return (
        '<fmiModelDescription fmiVersion="3.0" modelName="x" instantiationToken="x"><CoSimulation modelIdentifier="x"/>'
        f"<ModelVariables>{variables}</ModelVariables></fmiModelDescription>"
    )


def scalar(name: str, reference: object = 0, causality: str = "output") -> str:
    """A variable of FMI 2.0."""
    return (
        f'<ScalarVariable name="{name}" valueReference="{reference}" causality="{causality}"><Real/></ScalarVariable>'
    )


def array(*dimensions: str) -> str:
    """An array of FMI 3.0."""
    inside = "".join(f"<Dimension {dimension}/>" for dimension in dimensions)
    return f'<Float64 name="a" valueReference="1" causality="parameter" start="0">{inside}</Float64>'


def unit(factor: str) -> str:
    """The definition of a unit."""
    return f'<UnitDefinitions><Unit name="m"><BaseUnit m="1" factor="{factor}"/></Unit></UnitDefinitions>'


def timed(stop_time: str, step_size: str) -> str:
    """A model description with this default experiment."""
    return two(scalar("y"), inside=f'<DefaultExperiment stopTime="{stop_time}" stepSize="{step_size}"/>')


GOOD = timed("1", "1")
LAUGHS = (
    '<?xml version="1.0"?><!DOCTYPE x [<!ENTITY a0 "ha">'
    + "".join(f'<!ENTITY a{k} "{f"&a{k - 1};" * 10}">' for k in range(1, 12))
    + '<!ENTITY f SYSTEM "file:///etc/hostname">]>'
)
SSP = "http://ssp-standard.org/SSP1/SystemStructure"
SPACES = f'xmlns:v="{SSP}ParameterValues" xmlns:m="{SSP}ParameterMapping" xmlns:c="{SSP}Common"'
UNITS = (
    '<c:Unit name="mm"><c:BaseUnit m="1" factor="0.001"/></c:Unit>'
    '<c:Unit name="degC"><c:BaseUnit K="1" offset="273.15"/></c:Unit>'
)


def many(count: int, item: Callable[[int], str]) -> str:
    """Something a number of times."""
    return "".join(map(item, range(count)))


def _attributes(**texts: object) -> str:
    return "".join(f' {name}="{text}"' for name, text in texts.items())


def structure(content: str, more: str = "", head: str = '<?xml version="1.0"?>', version: str = "1.0") -> str:
    """A system structure; what it says of its one system."""
    root = f'SystemStructureDescription xmlns="{SSP}Description" {SPACES} version="{version}" name="s"'
    return f'{head}<{root}><System name="s">{content}</System>{more}</SystemStructureDescription>'


def elements(*inside: str) -> str:
    """The elements of a system."""
    return f"<Elements>{''.join(inside)}</Elements>"


def component(name: str, fmu: str = "x", inside: str = "", **attributes: str) -> str:
    """A component of a system."""
    given = {"name": name, "source": f"resources/{fmu}.fmu"} | attributes
    return f"<Component{_attributes(**given)}>{inside}</Component>"


def nested(name: str, *inside: str) -> str:
    """A system in a system."""
    return f'<System name="{name}">{"".join(inside)}</System>'


def connectors(**kinds: str) -> str:
    """The connectors of a system."""
    listed = many(len(kinds), lambda k: f'<Connector name="{[*kinds][k]}" kind="{[*kinds.values()][k]}"/>')
    return f"<Connectors>{listed}</Connectors>"


def connected(start: str, end: str, inside: str = "", **more: str) -> str:
    """A connection between ``"element.connector"``, or ``"connector"`` of the system itself."""
    names: dict[str, object] = dict(more)
    for role, place in (("start", start), ("end", end)):
        element, _, connector = place.rpartition(".")
        names |= {f"{role}Connector": connector} | ({f"{role}Element": element} if element else {})
    return f"<Connection{_attributes(**names)}>{inside}</Connection>"


def connections(*listed: str) -> str:
    """Connections with what is around them."""
    return f"<Connections>{''.join(listed)}</Connections>"


def real(name: str, value: object = 1, **attributes: str) -> str:
    """A parameter."""
    return f'<v:Parameter name="{name}"><v:Real value="{value}"{_attributes(**attributes)}/></v:Parameter>'


def parameter_set(values: str, units: str = UNITS) -> str:
    """A parameter set."""
    inside = f"<v:Parameters>{values}</v:Parameters><v:Units>{units}</v:Units>"
    return f'<v:ParameterSet {SPACES} version="1.0" name="v">{inside}</v:ParameterSet>'


def mapping(entries: str) -> str:
    """A mapping of parameters."""
    return f'<m:ParameterMapping {SPACES} version="1.0">{entries}</m:ParameterMapping>'


def binding(inside: str, **attributes: str) -> str:
    """A parameter binding."""
    return f"<ParameterBinding{_attributes(**attributes)}>{inside}</ParameterBinding>"


def bound(*sets: str, units: str = UNITS, entries: str = "") -> str:
    """Parameter sets inline, one of them with a mapping."""
    mapped = f"<ParameterMapping>{mapping(entries)}</ParameterMapping>" if entries else ""
    inline = (binding(f"<ParameterValues>{parameter_set(s, units)}</ParameterValues>{mapped}") for s in sets)
    return f"<ParameterBindings>{''.join(inline)}</ParameterBindings>"


def archive(words: str | bytes, *more: Member, fmu: Write | None = None) -> Write:
    """An SSP archive with this structure and an FMU."""

    def write(path: Path) -> None:
        inner = path.with_suffix(".inner")
        (fmu or text(two(scalar("y"))))(inner)
        content = words if isinstance(words, bytes) else words.encode()
        files = Member(STRUCTURE.encode(), content, DEFLATED), Member(b"resources/x.fmu", inner.read_bytes(), DEFLATED)
        zipped(path, [*files, *more])
        inner.unlink()

    return write


def _two_bombs(path: Path) -> None:
    """Each of the FMUs is just small enough."""
    _bomb(path, 6)
    content = path.read_bytes()
    system = structure(elements(component("c"), component("d", "y")))
    zipped(
        path, [Member(STRUCTURE.encode(), system.encode()), *(Member(b"resources/%c.fmu" % n, content) for n in b"xy")]
    )


def _nested(depth: int) -> str:
    return many(depth, lambda k: f'<Elements><System name="s{k}">') + "</System></Elements>" * depth


def _diamonds(depth: int) -> str:
    """Systems in systems, each with two connectors that both lead to both of the next: 2^depth ways."""
    crossed = connections(*(connected(a, f"s.{b}") for a in "ab" for b in "ab"))
    inside = elements(component("c"))
    for k in range(depth):
        inside = elements(nested("s", connectors(a="input", b="input"), inside, crossed if k else ""))
    return inside


def _bomb(path: Path, count: int) -> None:
    """Members that share one block of zeros."""
    packed = Member(b"resources/0", bytes(ZEROS), DEFLATED)
    shared = (Member(b"resources/%d" % k, b"", size=ZEROS, again=True) for k in range(1, count))
    zipped(path, [packed, *shared, Member(DESCRIPTION.encode(), GOOD.encode()), Member(LIBRARY.encode())])


def _truncated(path: Path) -> None:
    text(GOOD)(path)
    path.write_bytes(path.read_bytes()[:-60])


def _flipped(path: Path) -> None:
    text(GOOD, Member(b"resources/a", b"abcdefgh" * 100))(path)
    content = bytearray(path.read_bytes())
    content[content.index(b"abcdefgh") + 50] ^= 1
    path.write_bytes(content)


def _zip_in_zip(path: Path) -> None:
    text(GOOD)(path)
    zipped(path, [Member(b"x.fmu", path.read_bytes())])


SLOW = {"million variables", "dependencies", "million elements", "60000 files"}
_DEPENDENT = many(300, lambda k: f'<Unknown index="{k}" dependencies="{" ".join(map(str, range(k, 20_000)))}"/>')

FMUS: dict[str, tuple[str, Write]] = {
    "empty file": ("no archive at all", lambda path: path.write_bytes(b"")),
    "text": ("no archive at all", lambda path: path.write_text("Lorem ipsum " * 1000)),
    "truncated": ("truncated", _truncated),
    "folder": ("is a directory", lambda path: path.mkdir()),
    "nothing inside": ("has no modelDescription.xml", partial(zipped, members=[])),
    "zip in zip": ("has no modelDescription.xml", _zip_in_zip),
    "encrypted": ("'resources/a' inside is encrypted", beside(b"resources/a", b"?" * 20, flags=1)),
    "unknown compression": ("by method 99", beside(b"resources/a", b"?" * 20, method=99)),
    "bzip2": ("by method 12", beside(b"resources/a", b"?" * 20, method=12)),
    "says less than it has": ("damaged", beside(b"a", bytes(2**22), DEFLATED, size=10)),
    "says 4 GB": ("more than the limit of 1073741824", beside(b"a", b"a", DEFLATED, size=2**32 - 2)),
    "bomb": ("takes 104857", partial(_bomb, count=100)),
    "60000 files": (
        "has 60001 files inside",
        partial(zipped, members=[Member(b"%d" % k) for k in range(60_000)] + [Member(DESCRIPTION.encode())]),
    ),
    "directory of 20 MB": ("a directory of", partial(zipped, members=[Member(b"a" * 60_000)] * 350)),
    "file outside": ("would lie outside", beside(b"resources/../../evil", b"!")),
    "absolute path": ("would lie outside", beside(b"/tmp/evil", b"!")),
    "drive": ("would lie outside", beside(b"C:evil", b"!")),
    "backslash": ("would lie outside", beside(b"..\\evil", b"!")),
    "link": ("is a symbolic link", beside(b"resources/a", b"/etc/passwd", mode=stat.S_IFLNK | 0o777)),
    "NUL in a name": ("is not a name of a file", beside(b"resources/a\0b", b"!")),
    "name that is no UTF-8": ("can't decode", beside(b"\xff\xfe", b"!", flags=0x800)),
    "name twice": ("is there twice", text(GOOD, *(Member(b"resources/a", c) for c in (b"1", b"2")))),
    "file that is a folder": (
        "cannot be read or unpacked",
        text(GOOD, Member(b"resources", b"1"), Member(b"resources/a", b"2")),
    ),
    "name of 5000 letters": ("cannot be read or unpacked", beside(b"a" * 5000, b"!")),
    "damaged byte": ("Bad CRC-32", _flipped),
    "unknown encoding": ("encoding", text(GOOD.replace("UTF-8", "klingon"))),
    "encoding of several bytes": ("encoding", text(GOOD.replace("UTF-8", "shift_jis"))),
    "no UTF-8": ("invalid token", data(GOOD.replace('"y"', '"\xe9"').encode("latin-1"))),
    "NUL in XML": ("invalid token", text(GOOD.replace('"y"', '"y\0"'))),
    "empty XML": ("no element found", text("")),
    "half of the XML": ("unclosed token", text(GOOD[:-30])),
    "scheduled execution": (
        "made for scheduled execution only; export it for co-simulation or model exchange",
        text(three("").replace("CoSimulation", "ScheduledExecution")),
    ),
    "no kind": ("made for no kind of simulation", text(GOOD.replace("CoSimulation", "Simulation"))),
    "FMI 1.0": (
        "FMI 1.0; only FMUs of FMI 2.0 and 3.0",
        text(
            '<fmiModelDescription fmiVersion="1.0"><ModelVariables><ScalarVariable name="x"><Real start="1"/>'
            "</ScalarVariable></ModelVariables></fmiModelDescription>"
        ),
    ),
    "FMI 4.0": ("FMI 4.0; only FMUs of FMI 2.0 and 3.0", text(GOOD.replace("2.0", "4.0"))),
    "no guid": ("xml cannot be read: fmiModelDescription has no 'guid'", text(GOOD.replace(" guid=", " id="))),
    "no token": ("fmiModelDescription has no 'instantiationToken'", text(three("").replace(" inst", " x"))),
    "no name": ("no attribute 'name'", text(three(array('start="1"')).replace('name="a"', ""))),
    "page": ("its root is not fmiModelDescription", text("<html/>")),
    "entities": ("document type", text(LAUGHS + GOOD[38:].replace('"y"', '"&a11;"'))),
    "entity of a file": ("document type", text(LAUGHS + GOOD[38:].replace("<ModelStructure>", "<ModelStructure>&f;"))),
    "elements 100000 deep": ("nested more than 200 deep", text(two(scalar("y"), outputs="<a>" * 100_000))),
    "attribute of 60 MB": ("longer than 16777216 bytes", text(two(scalar("y" * 60_000_000)))),
    "million variables": ("bytes of memory", text(two(many(1_000_000, lambda k: scalar(f"v{k}", k))))),
    "dependencies": (
        "bytes of memory",
        text(two(many(20_000, lambda k: scalar(f"v{k}", k, "input")), outputs=f"<Outputs>{_DEPENDENT}</Outputs>")),
    ),
    "value reference of 33 bits": ("value reference 4294967296", text(two(scalar("y", 2**32)))),
    "negative value reference": ("value reference -1", text(two(scalar("y", -1)))),
    "value reference of 5000 digits": ("4300 digits", text(two(scalar("y", "9" * 5000)))),
    "value reference one": ("invalid literal", text(two(scalar("y", "one")))),
    "negative dimension": ("a dimension of 'a' is -3", text(three(array('start="-3"')))),
    "dimension that is nowhere": (
        "value reference 77, which is not a structural",
        text(three(array('valueReference="77"'))),
    ),
    "dimension of nothing": ("value reference None", text(three(array("")))),
    "huge array": ("elements, more than 10000000", text(three(array('start="1000000000000"')))),
    "huge matrix": ("elements, more than 10000000", text(three(array(*['start="100000"'] * 9)))),
    "unit 0": ("has the factor 0.0", text(two(scalar("y"), inside=unit("0")))),
    "unit nan": ("has the factor nan", text(two(scalar("y"), inside=unit("nan")))),
    "stop time 1e300": ("no default stop_time", text(timed("1e300", "0.01"))),
    "step size 1e-300": ("no default stop_time", text(timed("1", "1e-300"))),
    "both": ("no default stop_time", text(timed("1e300", "1e-300"))),
    "infinite stop time": ("no default stop_time", text(timed("inf", "nan"))),
    "order of derivatives": (
        "invalid literal",
        text(GOOD.replace("<CoSimulation", '<CoSimulation maxOutputDerivativeOrder="many"')),
    ),
    "words of control": ("FMI 1.0", text(GOOD.replace('"2.0"', '"1.0&#10;&#9;evil"'))),
    "library that is none": ("cannot be loaded", text(timed("1", "1"))),
}


_C = elements(component("c"))
_TWICE = '<m:MappingEntry source="p" target="c.y"><c:LinearTransformation factor="{}"/></m:MappingEntry>'
_LONG = f'<v:Parameter name="p"><v:Integer value="{"9" * 400}"/></v:Parameter>'
_UNIT = '<c:Unit name="m"><c:BaseUnit m="{}" factor="{}"/></c:Unit>'
_CIRCLE = connectors(a="input", b="input"), bound(real("a")), _C, connections(connected("a", "b"), connected("b", "a"))

SSPS: dict[str, tuple[str, Write]] = {
    "no structure": ("has no SystemStructure.ssd", partial(zipped, members=[Member(b"a", b"b")])),
    "FMU under another name": ("has no SystemStructure.ssd", text(GOOD)),
    "3000 nested systems": ("nested more than 200 deep", archive(structure(_nested(3000)))),
    "20000 components": (
        "more than 10000 components",
        archive(structure(elements(many(20_000, lambda k: component(f"c{k}"))))),
    ),
    "million elements": ("elements and attributes", archive(structure(elements("<a/>" * 1_000_001)))),
    "structure of 80 MB": ("longer than", archive(structure("<!-- -->" + " " * 80_000_000))),
    "half of the structure": ("SystemStructure.ssd cannot be read", archive("<half")),
    "other root": ("expected ssd:SystemStructureDescription", archive("<other/>")),
    "SSP 3.0": ("SSP version '3.0' is not known; known: 1.0, 2.0", archive(structure(_C, version="3.0"))),
    "entities": ("document type", archive(structure(elements(component("&a11;")), head=LAUGHS))),
    "unknown encoding": ("encoding", archive(structure("", head='<?xml version="1.0" encoding="klingon"?>'))),
    "two to the sixtieth ways": ("cannot be loaded", archive(structure(bound(real("s.a")) + _diamonds(60)))),
    "source outside": ("outside the archive", archive(structure(elements(component("c", "../../evil"))))),
    "encoded source outside": (
        "outside the archive",
        archive(structure(elements(component("c", "%2e%2e/%2e%2e/evil")))),
    ),
    "file outside": ("would lie outside", archive(structure(_C), Member(b"../evil", b"!"))),
    "bomb": ("more than the limit", archive(structure(_C), Member(b"a", b"", size=2**31))),
    "bomb in the FMU": ("resources/x.fmu takes 104857", archive(structure(_C), fmu=partial(_bomb, count=100))),
    "bombs that are small one by one": ("with its FMUs takes", _two_bombs),
    "description of the FMU": (
        "resources/x.fmu: its modelDescription.xml cannot be read",
        archive(structure(_C), fmu=text("<a/>")),
    ),
    "FMU that is none": (
        "resources/x.fmu: truncated",
        archive(structure(_C), fmu=lambda path: path.write_text("no")),
    ),
    "digits in an index": (
        "has no variable",
        archive(structure(_C + connections(connected("c.y", f"c.y[{'9' * 5000}]")))),
    ),
    "indices that are none": (
        "a number that is none",
        archive(structure(_C + connections(connected("c.y", "c.y", endIndices="one")))),
    ),
    "way through 2000 connectors": (
        "more than 1000 connectors",
        archive(
            structure(_C + connections(connected("a0", "c.y"), many(2000, lambda k: connected(f"a{k + 1}", f"a{k}"))))
        ),
    ),
    "circle of connectors": ("cannot be loaded", archive(structure("".join(_CIRCLE)))),
    "unit 0": ("has the factor 0.0", archive(structure(bound(real("c.y"), units=_UNIT.format(1, 0)) + _C))),
    "exponent that is none": (
        "cannot be read: invalid literal",
        archive(structure(bound(real("c.y"), units=_UNIT.format("one", 1)) + _C)),
    ),
    "transformation by a word": (
        "cannot be read: could not convert",
        archive(structure(bound(real("p"), entries=_TWICE.format("much")) + _C)),
    ),
    "parameter of 400 digits": (
        "cannot be read: int too large",
        archive(structure(bound(_LONG, entries=_TWICE.format(2)) + _C)),
    ),
    "one name by two ways": (
        "has a component 'a_b' already",
        archive(structure(elements(component("a_b"), nested("a", elements(component("b")))))),
    ),
    "stop time that is none": (
        "a number that is none",
        archive(structure(_C, '<DefaultExperiment stopTime="never"/>')),
    ),
}
