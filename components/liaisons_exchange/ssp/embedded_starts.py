"""Start values inside FMUs, for importers that ignore parameter sets.

An FMU of liaisons reads ``resources/starts.txt`` when it is instantiated or reset.  A line ``KIND REFERENCE COUNT BITS
... NAME`` there is a variable: KIND is ``r`` for reals and ``i`` for integers, BITS are those of its numbers in
hexadecimal digits, which do not depend on the locale.  KIND ``t`` is a table that replaces that of its parameters,
column after column; with ``z``, a prescribed coordinate that must not be 0 keeps its start value if an importer sets 0
before the first step.  A copy of the FMU with that file, and with the same values in its model description, has these
start values with the same binaries.  It has a GUID of its own, since some importers take FMUs of one GUID for one.  A
foreign FMU cannot be changed so: its start values are in the parameter set only.
"""

from __future__ import annotations

import hashlib
import io
import struct
from collections.abc import Iterable, Mapping
from pathlib import Path
from xml.etree import ElementTree
from zipfile import ZipFile, ZipInfo

from liaisons.base.archive import DESCRIPTION, START_VALUES
from liaisons.base.arrays import Floats
from liaisons.base.compiler import INSTALLATION
from liaisons.cosim import SystemComponent
from liaisons.errors import SimulationError
from liaisons_exchange.ssp.assignment import Value
from liaisons_exchange.ssp.parameters import starts_by_parameter, value_text

_PYTHON = "resources/component.json"
STARTS = b"/starts.txt"
"""What binaries contain that read start values."""
ZEROS = b" = 0 before the first step: it stays "
"""What binaries contain that skip zeros."""


def contains_mark(part: SystemComponent, mark: bytes) -> bool:
    """Whether the binary of an FMU contains the text that shows a capability, :data:`STARTS` or :data:`ZEROS`."""
    with ZipFile(part.fmu.path) as archive:
        modules = [name for name in archive.namelist() if name.startswith("resources/liaisons_runtime_")]
        return any(mark in archive.read(name) for name in (part.fmu.binary, *modules))


def fmu_with_starts(part: SystemComponent, *, ignore_zeros: bool = False) -> bytes:
    """Content of a component's FMU file, with the component's start values embedded.

    :param ignore_zeros: prescribed coordinates that must not be 0 keep their start values where an importer sets 0
        before the first step.
    """
    values = starts_by_parameter(part)
    lines = [_start_line(part, *item) for item in values.items()]
    return _fmu_with_start_lines(part.fmu.path, lines + ["z 0 1 0000000000000000 zeros\n"] * ignore_zeros, values)


def fmu_with_table(path: Path, table: Floats) -> bytes:
    """Content of an FMU file, with another table embedded.

    :param table: shape (columns, rows).
    :raises SimulationError: if the FMU is of the Python back end.
    """
    with ZipFile(path) as archive:
        if _PYTHON in archive.namelist():
            raise SimulationError(f"{path.name}: {table.shape[1]} knots need a native FMU; {INSTALLATION}")
    return _fmu_with_start_lines(path, [f"t 0 {table.size} {_hexadecimal_bits('>d', table.ravel())} table\n"], {})


def _fmu_with_start_lines(path: Path, lines: Iterable[str], values: Mapping[str, Value]) -> bytes:
    """Content of an FMU file with further lines in its file of start values, and start values in its description."""
    target = io.BytesIO()
    with ZipFile(path) as old, ZipFile(target, "w") as new:
        before = old.read(START_VALUES).decode() if START_VALUES in old.namelist() else ""
        starts = before + "".join(lines)  # the last of two lines wins
        for item in old.infolist():
            if item.filename != START_VALUES:
                data = old.read(item)
                new.writestr(
                    item, _description_with_starts(data, values, starts) if item.filename == DESCRIPTION else data
                )
        new.writestr(ZipInfo(START_VALUES), starts)
    return target.getvalue()


def _start_line(part: SystemComponent, name: str, value: Value) -> str:
    """Line with the start value of a variable, for ``starts.txt``."""
    scalar = part.fmu.variables.entry(name).prototype
    kind, form = ("r", ">d") if scalar.type == "Real" else ("i", ">q")
    numbers = value if isinstance(value, tuple) else (value,)
    return f"{kind} {scalar.reference} {len(numbers)} {_hexadecimal_bits(form, numbers)} {name}\n"


def _hexadecimal_bits(struct_format: str, numbers: Iterable[object]) -> str:
    """Bits of numbers in hexadecimal digits, separated by spaces."""
    return " ".join(struct.pack(struct_format, number).hex() for number in numbers)


def _description_with_starts(description: bytes, values: Mapping[str, Value], starts: str) -> bytes:
    """Model description with other start values, and with a GUID that depends on them.

    :param starts: content of ``starts.txt``.
    """
    root = ElementTree.fromstring(description)
    name = "guid" if "guid" in root.attrib else "instantiationToken"
    # a minus, which a URI takes as it is: libcosim makes a directory of the GUID and does not encode it again
    root.set(name, f"{root.get(name)}-{hashlib.sha256(starts.encode()).hexdigest()[:16]}")
    for variable in root.iterfind("ModelVariables/*"):
        value = values.get(variable.get("name", ""))
        if value is not None:  # FMI 2.0 has the start value in the type, FMI 3.0 has a variable of the type
            (variable[0] if variable.tag == "ScalarVariable" else variable).set("start", value_text(value))
    return ElementTree.tostring(root, encoding="UTF-8", xml_declaration=True)
