"""Layouts of the buffers of calls: scalars, by type, as elements of whole variables.

A run handles doubles only: integers are doubles (exact up to 2^53), a Boolean is 0 or 1, and a string is its number in
:mod:`liaisons.cosim.instances.texts`.
"""

from __future__ import annotations

import ctypes as c
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Any, final

import numpy as np
from numpy.typing import NDArray

from liaisons.cosim.arrays import Indices, Vector, as_indices
from liaisons.cosim.description.fmu import Fmu
from liaisons.cosim.description.variables import Scalar
from liaisons.cosim.instances import texts

Transfer = Callable[[], int]


@final
@dataclass(frozen=True)
class BufferLayout:
    """Variables of one type in a buffer, one after the other, and the scalars of a call among their elements.

    :param references: value references of the variables, in FMI 3.0 each once.
    :param c_type: of their elements; ``size`` is their number.
    :param scalars: indices of the scalars in the call; ``positions`` those in the buffer.
    """

    base: str
    references: tuple[int, ...]
    c_type: Any
    size: int
    scalars: Indices
    positions: Indices

    @cached_property
    def buffer(self) -> c.Array[Any]:
        """Numbers, or pointers to strings, of all elements."""
        return (self.c_type * self.size)()

    @cached_property
    def scratch(self) -> NDArray[Any]:
        """The buffer as an array; of strings, their numbers."""
        return np.zeros(self.size) if self.base == "String" else np.ctypeslib.as_array(self.buffer)

    @property
    def whole(self) -> bool:
        """Whether the scalars are all that the buffer holds."""
        return len(self.positions) == self.size

    @property
    def direct(self) -> bool:
        """Whether the scalars are all that the buffer holds, as doubles in the same order."""
        return self.base in {"Real", "Float64"} and np.array_equal(self.positions, range(self.size))

    def read_into(self, read: Transfer, values: Vector) -> int:
        """Read the buffer, and copy the scalars to the values of the call."""
        status = read()
        if self.base == "String":
            self.scratch[:] = [texts.number(text) for text in self.buffer]
        values[self.scalars] = self.scratch[self.positions]
        return status

    def write_from(self, write: Transfer, values: Vector) -> int:
        """Write the buffer, with the scalars from the values of the call."""
        if self.base == "String":
            for position, number in zip(self.positions, values[self.scalars].tolist(), strict=True):
                self.buffer[position] = texts.text(number)
        else:
            self.scratch[self.positions] = values[self.scalars]
        return write()


def layouts(fmu: Fmu, variables: Sequence[Scalar], types: Mapping[str, Any]) -> list[BufferLayout]:
    """The layouts of scalars, one of each type.

    :param types: those of C, by the types in the names of FMI's functions.
    """
    by_base: dict[str, list[int]] = {}
    for k, variable in enumerate(variables):
        by_base.setdefault(variable.base, []).append(k)
    return [layout(fmu, variables, scalars, base, types[base]) for base, scalars in by_base.items()]


def layout(
    fmu: Fmu, variables: Sequence[Scalar], scalars: Sequence[int], base: str = "Float64", c_type: Any = c.c_double
) -> BufferLayout:
    """The layout of some of these scalars, of one type."""
    begins: dict[int, int] = {}
    references: list[int] = []
    positions: list[int] = []
    size = 0
    for variable in (variables[k] for k in scalars):
        # in FMI 2.0 aliases are read twice, so that the buffer is as long as the call's
        begin = begins.setdefault(variable.reference, size) if fmu.version == 3 else size
        if begin == size:
            references.append(variable.reference)
            array = fmu.variables.whole_array(variable.name) if fmu.version == 3 else None
            size += array.size if array else 1
        positions.append(begin + variable.position)
    return BufferLayout(base, tuple(references), c_type, size, as_indices(scalars), as_indices(positions))


@lru_cache(maxsize=1024)
def value_references(references: tuple[int, ...]) -> c.Array[c.c_uint32]:
    """Value references as a C array, shared by all instances, so that it stays in the processor's cache."""
    return (c.c_uint32 * len(references))(*references)


def counted(references: Sequence[int]) -> tuple[object, object]:
    """Value references and their number, as arguments of a foreign call, converted once."""
    return buffered(value_references(tuple(references)))


def buffered(values: c.Array[Any]) -> tuple[object, object]:
    """A buffer and its length, as arguments of a foreign call, converted once."""
    return c.byref(values), c.c_size_t.from_param(len(values))
