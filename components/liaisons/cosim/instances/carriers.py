"""Scalars of a call and the FMI 3.0 variables, whole arrays among them, that carry them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from ctypes import Array, byref, c_double, c_float, c_size_t, c_uint32
from dataclasses import dataclass
from typing import Any, final

import numpy as np
from numpy.typing import NDArray

from liaisons.array_names import split
from liaisons.cosim.description import Fmu
from liaisons.cosim.variables import Array as Elements
from liaisons.cosim.variables import Scalar

Transfer = Callable[[], int]


@final
@dataclass(frozen=True)
class Carrier:
    """Whole variables of one type, one behind the other in a buffer, and the scalars that are wanted of them.

    :param references: value references of the variables, each once.
    :param buffer: room for all their elements.
    :param wanted: which of the scalars of the call these are.
    :param places: where those stand in the buffer.
    """

    base: str
    references: tuple[int, ...]
    buffer: Array[Any]
    wanted: NDArray[np.intp]
    places: NDArray[np.intp]

    @property
    def scratch(self) -> NDArray[Any]:
        """The buffer as NumPy sees it."""
        return view(self.buffer, np.float32 if self.base == "Float32" else np.float64)

    @property
    def whole(self) -> bool:
        """Whether the scalars are all that the buffer holds."""
        return len(self.places) == len(self.buffer)

    @property
    def direct(self) -> bool:
        """Whether the scalars are just what the buffer holds, doubles in this order."""
        in_order = np.array_equal(self.places, np.arange(len(self.buffer)))
        return self.base == "Float64" and in_order and len(self.wanted) == len(self.places)


def carriers(fmu: Fmu, variables: Sequence[Scalar]) -> list[Carrier]:
    """The variables that carry these scalars, those of one type together."""
    bases = dict.fromkeys(variable.base for variable in variables)
    return [carrier(fmu, variables, [k for k, v in enumerate(variables) if v.base == base], base) for base in bases]


def carrier(fmu: Fmu, variables: Sequence[Scalar], wanted: Sequence[int], base: str = "Float64") -> Carrier:
    """The variables that carry some of these scalars."""
    begins: dict[int, int] = {}
    size = 0
    for k in wanted:
        variable = variables[k]
        if variable.reference not in begins:
            begins[variable.reference] = size
            entry = fmu.variables.entries.get(split(variable.name)[0])
            size += entry.size if isinstance(entry, Elements) else 1
    places = [begins[variables[k].reference] + variables[k].position for k in wanted]
    buffer = ((c_float if base == "Float32" else c_double) * size)()
    return Carrier(base, tuple(begins), buffer, np.array(wanted, dtype=np.intp), np.array(places, dtype=np.intp))


def counted(references: Sequence[int]) -> tuple[object, object]:
    """Value references and their number, as arguments of a foreign call that are converted only once."""
    return byref((c_uint32 * len(references))(*references)), c_size_t.from_param(len(references))


def buffered(values: Array[Any]) -> tuple[object, object]:
    """Values and their number, likewise."""
    return byref(values), c_size_t.from_param(len(values))


def view(values: Any, kind: type[np.floating[Any]] = np.float64) -> NDArray[Any]:
    """A foreign buffer as NumPy sees it."""
    return np.frombuffer(values, dtype=kind)


def reading(reads: Sequence[tuple[Transfer, Carrier]], values: Array[c_double]) -> Transfer:
    """A call that reads and hands on what is wanted; it returns the worst status."""
    bus = view(values)
    steps = [(read, carrier.scratch, carrier.wanted, carrier.places) for read, carrier in reads]

    def call() -> int:
        worst = 0
        for read, scratch, wanted, places in steps:
            worst = max(worst, read())
            bus[wanted] = scratch[places]
        return worst

    return call


def setting(transfers: Sequence[tuple[Transfer, Transfer, Carrier]], values: Array[c_double]) -> Transfer:
    """A call that sets what is given within what the FMU holds; it returns the worst status."""
    bus = view(values)
    steps = [(read, write, carrier.scratch, carrier.wanted, carrier.places) for read, write, carrier in transfers]

    def call() -> int:
        worst = 0
        for read, write, scratch, wanted, places in steps:
            worst = max(worst, read())
            scratch[places] = bus[wanted]
            worst = max(worst, write())
        return worst

    return call
