"""C structures, which are declared in C files only; Python reads their fields there."""

from __future__ import annotations

import re
from ctypes import Array, Structure, addressof, c_bool, c_double, c_int, c_size_t, c_ssize_t, c_void_p, memmove
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

_TYPES = {"size_t": c_size_t, "ptrdiff_t": c_ssize_t, "double": c_double, "int": c_int, "bool": c_bool}


SavedRecord = tuple[bytes, dict[str, Any], list[tuple[NDArray[Any], NDArray[Any]]]]
"""Bytes of a record, what its pointers point to, and arrays with copies of their values."""


class Record(Structure):
    """A C structure, which keeps in ``targets`` what its pointers point to.

    :ivar remembered: names of the arrays that compiled code writes, and reads in later steps.
    """

    targets: dict[str, Any]
    remembered: ClassVar[tuple[str, ...]] = ()

    def point(self, **targets: NDArray[Any] | Array[Any] | Structure | c_double) -> None:
        """Set pointers, by their names, to arrays or structures, which are kept alive."""
        vars(self).setdefault("targets", {}).update(targets)
        for name, target in targets.items():
            setattr(self, name, target.ctypes.data if isinstance(target, np.ndarray) else addressof(target))

    def save(self) -> SavedRecord:
        """Copy of the fields and of the arrays that are remembered, for :meth:`restore`."""
        targets = dict(vars(self).get("targets", {}))
        arrays = [targets[name] for name in self.remembered if name in targets]
        return bytes(self), targets, [(array, array.copy()) for array in arrays]

    def restore(self, saved: SavedRecord) -> None:
        """Set the fields to those of a copy, and in place the values of the arrays."""
        content, targets, arrays = saved
        memmove(addressof(self), content, len(content))
        self.targets = dict(targets)
        for array, numbers in arrays:
            array[:] = numbers


def record_type(path: Path, structure: str, *remembered: str, **nested: type[Structure]) -> type[Record]:
    """The type of a C structure, whose fields are read from ``typedef struct { ... } structure;``.

    :param path: of the C file.
    :param remembered: see :class:`Record`.
    :param nested: structures inside it, by name.
    """
    code = re.sub(r"/\*.*?\*/", "", path.read_text(encoding="utf-8"), flags=re.DOTALL)
    (content,) = re.findall(rf"typedef struct \{{([^}}]*)\}} {structure};", code)
    types = _TYPES | nested
    fields = [
        (re.findall(r"\w+", declarator)[-1], c_void_p if "*" in declarator else types[kind])
        for kind, declarators in re.findall(r"(?:const )?(\w+) ([^;]+);", content)
        for declarator in declarators.split(",")
    ]
    return type(structure, (Record,), {"_fields_": fields, "remembered": remembered})
