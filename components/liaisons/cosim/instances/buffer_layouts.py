"""Layouts of the buffers of calls: scalars, by type, as elements of whole variables.

A run handles doubles only: integers are doubles (exact up to 2^53), a Boolean is 0 or 1, and a string is a number
that stands for it, valid in one process.
"""

from __future__ import annotations

import ctypes as c
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache, partial
from itertools import count
from typing import Any, final

import numpy as np
from numpy.typing import NDArray

from liaisons.base.arrays import as_indices
from liaisons.cosim.compiled.calls import Indices, Vector
from liaisons.errors import SimulationError
from liaisons.fmu_files import Fmu, Scalar

_numbers: dict[bytes, int] = {b"": 0}
_texts: dict[int, bytes] = {0: b""}
_next = count(1)


def number_of(text: bytes | None) -> int:
    """Number that stands for a string."""
    index = _numbers.get(text or b"")
    if index is None:
        index = _numbers.setdefault(text or b"", next(_next))
        _texts[index] = text or b""
    return index


def text_of(number: float) -> bytes:
    """String for which a number stands.

    :raises SimulationError: if the number is from another process.
    """
    if number not in _texts:
        raise SimulationError("a string comes from an isolated FMU, which cannot pass it on")
    return _texts[int(number)]


Transfer = Callable[[], int]


@final
@dataclass(frozen=True)
class BufferLayout:
    """Whole variables of one type in a buffer, and the positions of a call's scalars among their elements.

    :param base: type of the variables as in names of FMI functions.
    :param references: value references of the variables, in FMI 3.0 each once.
    :param c_type: type of an element.
    :param size: number of elements.
    :param scalars: indices of the scalars in the call.
    :param positions: their indices in the buffer.
    """

    base: str
    references: tuple[int, ...]
    c_type: Any
    size: int
    scalars: Indices
    positions: Indices

    @cached_property
    def buffer(self) -> c.Array[Any]:
        """Memory of all elements, numbers or pointers to strings."""
        return (self.c_type * self.size)()

    @cached_property
    def numbers(self) -> NDArray[Any]:
        """View of the buffer as an array; for strings, room for the numbers that stand for them."""
        return np.zeros(self.size) if self.base == "String" else np.ctypeslib.as_array(self.buffer)

    @property
    def is_complete(self) -> bool:
        """Whether the call has scalars for all elements of the buffer."""
        return len(self.positions) == self.size

    @property
    def is_identity(self) -> bool:
        """Whether the values of the call are those of the buffer: doubles, complete and in the same order."""
        return self.base in {"Real", "Float64"} and np.array_equal(self.positions, range(self.size))

    def read_into(self, read: Transfer, values: Vector) -> int:
        """Call a function that reads the buffer, and copy the scalars to the values of the call; returns the status."""
        status = read()
        if self.base == "String":
            self.numbers[:] = [number_of(each) for each in self.buffer]
        values[self.scalars] = self.numbers[self.positions]
        return status

    def write_from(self, write: Transfer, values: Vector) -> int:
        """Copy the values of the call to the buffer, and call a function that writes it; returns the status."""
        if self.base == "String":
            for position, number in zip(self.positions, values[self.scalars].tolist(), strict=True):
                self.buffer[position] = text_of(number)
        else:
            self.numbers[self.positions] = values[self.scalars]
        return write()


def layouts_by_type(fmu: Fmu, variables: Sequence[Scalar], types: Mapping[str, Any]) -> list[BufferLayout]:
    """Layouts for the scalars of a call, one for each of their types.

    :param types: type of C for each type in names of FMI functions.
    """
    by_base: dict[str, list[int]] = {}
    for k, variable in enumerate(variables):
        by_base.setdefault(variable.base, []).append(k)
    return [*map(partial(layout, fmu, variables), by_base.values(), by_base, map(types.__getitem__, by_base))]


def layout(
    fmu: Fmu, variables: Sequence[Scalar], scalars: Sequence[int], base: str = "Float64", c_type: Any = c.c_double
) -> BufferLayout:
    """Layout for the scalars of one type in a call; ``scalars`` are their indices among the variables."""
    begins: dict[int, int] = {}
    references: list[int] = []
    positions: list[int] = []
    size = 0
    for variable in map(variables.__getitem__, scalars):
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
    """Value references as a C array, shared by all instances."""
    return (c.c_uint32 * len(references))(*references)


def counted_references(references: Sequence[int]) -> tuple[object, object]:
    """Pointer to value references and their number, as two arguments of a C function."""
    return counted_buffer(value_references(tuple(references)))


def counted_buffer(values: c.Array[Any]) -> tuple[object, object]:
    """Pointer to a buffer and its length, as two arguments of a C function."""
    return c.byref(values), c.c_size_t.from_param(len(values))
