"""Arrays of numbers that NumPy and functions of FMUs share."""

from __future__ import annotations

from ctypes import Array, c_double

import numpy as np
from numpy.typing import NDArray

Vector = NDArray[np.float64]
Indices = NDArray[np.intp]
Numbers = Vector | Array[c_double]
"""Doubles side by side, which a prepared call reads or writes."""


def pointer_to(values: Numbers) -> Array[c_double]:
    """The same doubles as an argument of a foreign function."""
    return (c_double * len(values)).from_buffer(values)  # type: ignore[arg-type] - NumPy says so from Python 3.12 on
