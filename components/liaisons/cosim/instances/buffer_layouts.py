"""Scalars of a call and the variables, whole arrays of FMI 3.0 among them, that carry them, by their types.

The run of a system knows doubles only: integers stand for themselves there (exactly up to 2^53), a Boolean is 0 or 1,
and a string has its number in :mod:`liaisons.cosim.instances.texts`.
"""

from __future__ import annotations

import ctypes as c
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, final

import numpy as np
from numpy.typing import NDArray

from liaisons.cosim.description.fmu import Fmu
from liaisons.cosim.description.variables import Scalar
from liaisons.cosim.instances import texts

Transfer = Callable[[], int]


@final
@dataclass(frozen=True)
class BufferLayout:
    """Whole variables of one type, one behind the other in a buffer, and the scalars that are wanted of them.

    :param references: value references of the variables, in FMI 3.0 each once.
    :param of: the type of C of their elements, so many as ``size``.
    :param wanted: which of the scalars of the call these are.
    :param places: where those stand in the buffer.
    """

    base: str
    references: tuple[int, ...]
    of: Any
    size: int
    wanted: Sequence[int]
    places: Sequence[int]

    @cached_property
    def buffer(self) -> c.Array[Any]:
        """Room for all elements."""
        return (self.of * self.size)()

    @cached_property
    def scratch(self) -> NDArray[Any]:
        """The same as NumPy sees it; of strings, their numbers."""
        return np.zeros(self.size) if self.base == "String" else np.ctypeslib.as_array(self.buffer)

    @property
    def whole(self) -> bool:
        """Whether the scalars are all that the buffer holds."""
        return len(self.places) == self.size

    @property
    def direct(self) -> bool:
        """Whether the scalars are just what the buffer holds, doubles in this order."""
        return self.base in {"Real", "Float64"} and list(self.places) == list(range(self.size))

    def taken(self, read: Transfer, values: NDArray[np.float64]) -> int:
        """Read the buffer, and hand on what is wanted of it."""
        status = read()
        if self.base == "String":
            self.scratch[:] = [texts.number(text) for text in self.buffer]
        values[self._targets] = self.scratch[self._sources]
        return status

    def given(self, write: Transfer, values: NDArray[np.float64]) -> int:
        """Write the buffer, with these values within what stands in it."""
        if self.base == "String":
            for place, number in zip(self.places, values[self._targets].tolist(), strict=True):
                self.buffer[place] = texts.text(number)
        else:
            self.scratch[self._sources] = values[self._targets]
        return write()

    @cached_property
    def _targets(self) -> NDArray[np.intp]:
        return np.array(self.wanted, dtype=np.intp)

    @cached_property
    def _sources(self) -> NDArray[np.intp]:
        return np.array(self.places, dtype=np.intp)


def carriers(fmu: Fmu, variables: Sequence[Scalar], types: Mapping[str, Any]) -> list[BufferLayout]:
    """The variables that carry these scalars, those of one type together.

    :param types: those of C, by the types in the names of FMI's functions.
    """
    wanted: dict[str, list[int]] = {}
    for k, variable in enumerate(variables):
        wanted.setdefault(variable.base, []).append(k)
    return [carrier(fmu, variables, places, base, types[base]) for base, places in wanted.items()]


def carrier(
    fmu: Fmu, variables: Sequence[Scalar], wanted: Sequence[int], base: str = "Float64", of: Any = c.c_double
) -> BufferLayout:
    """The variables that carry some of these scalars."""
    begins: dict[int, int] = {}
    references: list[int] = []
    places: list[int] = []
    size = 0
    for variable in (variables[k] for k in wanted):
        # in FMI 2.0 aliases are read twice, so that the buffer is as long as the call's
        begin = begins.setdefault(variable.reference, size) if fmu.version == 3 else size
        if begin == size:
            references.append(variable.reference)
            array = fmu.variables.whole(variable.name) if fmu.version == 3 else None
            size += array.size if array else 1
        places.append(begin + variable.position)
    return BufferLayout(base, tuple(references), of, size, wanted, places)


def counted(references: Sequence[int]) -> tuple[object, object]:
    """Value references and their number, as arguments of a foreign call that are converted only once."""
    return buffered((c.c_uint32 * len(references))(*references))


def buffered(values: c.Array[Any]) -> tuple[object, object]:
    """Values and their number, likewise."""
    return c.byref(values), c.c_size_t.from_param(len(values))
