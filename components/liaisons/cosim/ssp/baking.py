"""Start values inside FMUs, for importers that pass over parameter sets.

An FMU of ours looks for ``resources/starts.txt`` when it is instantiated: a line ``REFERENCE BITS NAME`` for each
number, its bits in hexadecimal digits, which no locale reads differently.  A copy with that file, and with the same
values in its model description, starts there by itself; its binaries stay as they are.  An FMU of another make cannot
be changed so; its start values stand in the parameter set only.
"""

from __future__ import annotations

import io
import struct
from collections.abc import Mapping
from xml.etree import ElementTree
from zipfile import ZipFile, ZipInfo

from liaisons.cosim.component import Component
from liaisons.cosim.ssp.parameters import scalars, start
from liaisons.cosim.starts import Start

_STARTS = "resources/starts.txt"
_DESCRIPTION = "modelDescription.xml"


def takes_starts(component: Component) -> bool:
    """Whether the FMU's library reads the file."""
    with ZipFile(component.fmu.path) as archive:
        return b"starts.txt" in archive.read(component.fmu.binary)


def baked(component: Component) -> bytes:
    """The FMU with other start values: those that the component has in the system."""
    values = {name: start(component, name) for name in scalars(component)}
    numbers = {name: value for name, value in values.items() if not isinstance(value, (str, tuple))}
    target = io.BytesIO()
    with ZipFile(component.fmu.path) as old, ZipFile(target, "w") as new:
        for item in old.infolist():
            if item.filename != _STARTS:
                data = old.read(item)
                new.writestr(item, _described(data, numbers) if item.filename == _DESCRIPTION else data)
        lines = (
            f"{component.fmu.variables[name].reference} {_bits(value)} {name}\n" for name, value in numbers.items()
        )
        new.writestr(ZipInfo(_STARTS), "".join(lines))
    return target.getvalue()


def _described(description: bytes, numbers: Mapping[str, Start]) -> bytes:
    """The model description with these start values; of FMI 2.0, where every number is a variable."""
    root = ElementTree.fromstring(description)
    for variable in root.iter("ScalarVariable"):
        value = numbers.get(variable.get("name", ""))
        if value is not None:
            variable[0].set("start", str(value).lower() if isinstance(value, bool) else _text(value))
    return ElementTree.tostring(root, encoding="UTF-8", xml_declaration=True)


def _bits(value: Start) -> str:
    return struct.pack(">d" if isinstance(value, float) else ">q", value).hex()


def _text(value: Start) -> str:
    return repr(float(value)) if isinstance(value, float) else str(int(value))
