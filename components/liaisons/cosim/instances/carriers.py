"""Scalars of a call and the variables, whole arrays of FMI 3.0 among them, that carry them, by their types.

The run of a system knows doubles only: integers stand for themselves there (exactly up to 2^53), a Boolean is 0 or 1.
"""

from __future__ import annotations

import ctypes as c
from collections.abc import Callable, Mapping, Sequence
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

    :param references: value references of the variables, in FMI 3.0 each once.
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
        return self.base in {"Real", "Float64"} and in_order and len(self.wanted) == len(self.places)

    def taken(self, read: Transfer, values: NDArray[np.float64]) -> int:
        """Read the buffer, and hand on what is wanted of it."""
        status = read()
        values[self.wanted] = self.scratch[self.places]
        return status

    def given(self, write: Transfer, values: NDArray[np.float64]) -> int:
        """Write the buffer, with these values within what stands in it."""
        self.scratch[self.places] = values[self.wanted]
        return write()


def carriers(fmu: Fmu, variables: Sequence[Scalar], types: Mapping[str, Any]) -> list[Carrier]:
    """The variables that carry these scalars, those of one type together.

    :param types: those of C, by the types in the names of FMI's functions.
    """
    bases = dict.fromkeys(variable.base for variable in variables)
    wanted = {base: [k for k, variable in enumerate(variables) if variable.base == base] for base in bases}
    return [carrier(fmu, variables, wanted[base], base, types[base]) for base in bases]


def carrier(
    fmu: Fmu, variables: Sequence[Scalar], wanted: Sequence[int], base: str = "Float64", of: Any = c.c_double
) -> Carrier:
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
            array = fmu.variables.whole(variable.name)
            size += array.size if array else 1
        places.append(begin + variable.position)
    buffer = (of * size)()
    indices = np.array(wanted, dtype=np.intp), np.array(places, dtype=np.intp)
    return Carrier(base, tuple(references), buffer, np.ctypeslib.as_array(buffer), *indices)


def counted(references: Sequence[int]) -> tuple[object, object]:
    """Value references and their number, as arguments of a foreign call that are converted only once."""
    return buffered((c.c_uint32 * len(references))(*references))


def buffered(values: c.Array[Any]) -> tuple[object, object]:
    """Values and their number, likewise."""
    return c.byref(values), c.c_size_t.from_param(len(values))
