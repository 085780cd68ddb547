"""Arrays of numbers that NumPy shares with functions of FMUs."""

from __future__ import annotations

from collections.abc import Iterable
from ctypes import Array, c_double
from typing import Any, final

import numpy as np
from numpy.typing import NDArray

Vector = NDArray[np.float64]
Indices = NDArray[np.intp]
Numbers = Vector | Array[c_double]
"""Contiguous doubles, which a prepared call reads or writes."""


def pointer_to(values: Numbers) -> Array[c_double]:
    """ctypes array that shares the memory of an array of doubles, as an argument of a C function."""
    return (c_double * len(values)).from_buffer(values)  # type: ignore[arg-type] - NumPy says so from Python 3.12 on


@final
class Memory:
    """Arrays that are saved and restored together, or reset to their values at construction."""

    def __init__(self, arrays: Iterable[NDArray[Any]]) -> None:
        self.arrays = list(arrays)
        self._initial = self.save()

    def save(self) -> list[NDArray[Any]]:
        """Copies of the arrays, for :meth:`restore`."""
        return [array.copy() for array in self.arrays]

    def restore(self, saved: Iterable[NDArray[Any]]) -> None:
        """Copy saved values into the arrays."""
        for array, values in zip(self.arrays, saved, strict=True):
            array[:] = values

    def reset(self) -> None:
        """Set the arrays to their values at construction."""
        self.restore(self._initial)
