"""Start values inside FMUs, for importers that pass over parameter sets.

An FMU of ours looks for ``resources/starts.txt`` when it is instantiated or reset.  A line ``KIND REFERENCE COUNT BITS
... NAME`` there stands for a variable: KIND is ``r`` for reals and ``i`` for integers, BITS are those of its numbers in
hexadecimal digits, which no locale reads differently.  A copy with that file, and with the same values in its model
description, starts there by itself; its binaries stay as they are.  It has a GUID of its own, since some importers take
FMUs of one GUID for one.  An FMU of another make cannot be changed so: its start values are in the parameter set only.
"""

from __future__ import annotations

import hashlib
import io
import struct
from collections.abc import Mapping
from xml.etree import ElementTree
from zipfile import ZipFile, ZipInfo

from liaisons.cosim.parts import Part
from liaisons.cosim.starts import Value
from liaisons.ssp.parameters import scalars, start, text

_STARTS = "resources/starts.txt"
_MARK = b"/starts.txt"
_DESCRIPTION = "modelDescription.xml"


def takes_starts(part: Part) -> bool:
    """Whether the FMU's library, or the Python module that stands for it, reads the file."""
    with ZipFile(part.fmu.path) as archive:
        modules = [name for name in archive.namelist() if name.startswith("resources/liaisons_runtime_")]
        return any(_MARK in archive.read(name) for name in (part.fmu.binary, *modules))


def baked(part: Part) -> bytes:
    """The FMU with other start values: those that the component has in the system."""
    values = {name: start(part, name) for name in scalars(part)}
    target = io.BytesIO()
    with ZipFile(part.fmu.path) as old, ZipFile(target, "w") as new:
        before = old.read(_STARTS).decode() if _STARTS in old.namelist() else ""
        starts = before + "".join(_line(part, *item) for item in values.items())  # the last of two lines counts
        for item in old.infolist():
            if item.filename != _STARTS:
                data = old.read(item)
                new.writestr(item, _described(data, values, starts) if item.filename == _DESCRIPTION else data)
        new.writestr(ZipInfo(_STARTS), starts)
    return target.getvalue()


def _line(part: Part, name: str, value: Value) -> str:
    like = part.fmu.variables.entry(name).like
    kind, form = ("r", ">d") if like.type == "Real" else ("i", ">q")
    numbers = value if isinstance(value, tuple) else (value,)
    bits = " ".join(struct.pack(form, number).hex() for number in numbers)
    return f"{kind} {like.reference} {len(numbers)} {bits} {name}\n"


def _described(description: bytes, values: Mapping[str, Value], starts: str) -> bytes:
    """The model description with these start values, and a GUID that the library takes for its own."""
    root = ElementTree.fromstring(description)
    name = "guid" if "guid" in root.attrib else "instantiationToken"
    # a minus, which a URI takes as it is: libcosim makes a directory of the GUID and does not encode it again
    root.set(name, f"{root.get(name)}-{hashlib.sha256(starts.encode()).hexdigest()[:16]}")
    for variable in root.iterfind("ModelVariables/*"):
        value = values.get(variable.get("name", ""))
        if value is not None:  # FMI 2.0 has the start value in the type, FMI 3.0 has a variable of the type
            (variable[0] if variable.tag == "ScalarVariable" else variable).set("start", text(value))
    return ElementTree.tostring(root, encoding="UTF-8", xml_declaration=True)
