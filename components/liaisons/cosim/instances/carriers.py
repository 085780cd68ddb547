"""Scalars of a call and the FMI 3.0 variables, whole arrays among them, that carry them."""

from __future__ import annotations

import ctypes as c
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, final

import numpy as np
from numpy.typing import NDArray

from liaisons.cosim.description import Fmu
from liaisons.cosim.variables import Scalar

Transfer = Callable[[], int]


@final
@dataclass(frozen=True)
class Carrier:
    """Whole variables of one type, one behind the other in a buffer, and the scalars that are wanted of them.

    :param references: value references of the variables, each once.
    :param buffer: room for all their elements; ``scratch`` is the same as NumPy sees it.
    :param wanted: which of the scalars of the call these are.
    :param places: where those stand in the buffer.
    """

    base: str
    references: tuple[int, ...]
    buffer: c.Array[Any]
    scratch: NDArray[Any]
    wanted: NDArray[np.intp]
    places: NDArray[np.intp]

    @property
    def whole(self) -> bool:
        """Whether the scalars are all that the buffer holds."""
        return len(self.places) == len(self.buffer)

    @property
    def direct(self) -> bool:
        """Whether the scalars are just what the buffer holds, doubles in this order."""
        in_order = np.array_equal(self.places, np.arange(len(self.buffer)))
        return self.base == "Float64" and in_order and len(self.wanted) == len(self.places)

    def taken(self, read: Transfer, values: NDArray[np.float64]) -> int:
        """Read the buffer, and hand on what is wanted of it."""
        status = read()
        values[self.wanted] = self.scratch[self.places]
        return status

    def given(self, write: Transfer, values: NDArray[np.float64]) -> int:
        """Write the buffer, with these values within what stands in it."""
        self.scratch[self.places] = values[self.wanted]
        return write()


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
            array = fmu.variables.whole(variable.name)
            size += array.size if array else 1
    places = [begins[variables[k].reference] + variables[k].position for k in wanted]
    buffer = ((c.c_float if base == "Float32" else c.c_double) * size)()
    indices = np.array(wanted, dtype=np.intp), np.array(places, dtype=np.intp)
    return Carrier(base, tuple(begins), buffer, np.ctypeslib.as_array(buffer), *indices)


def counted(references: Sequence[int]) -> tuple[object, object]:
    """Value references and their number, as arguments of a foreign call that are converted only once."""
    return buffered((c.c_uint32 * len(references))(*references))


def buffered(values: c.Array[Any]) -> tuple[object, object]:
    """Values and their number, likewise."""
    return c.byref(values), c.c_size_t.from_param(len(values))
