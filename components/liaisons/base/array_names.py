"""Names of the elements of arrays: ``theta[1]``, ``theta[2]``, ...; ``m[1,1]``, ``m[1,2]``, ...

FMI 2.0 has scalars only, with these names; FMI 3.0 and a :class:`liaisons.Result` have arrays, too.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Sequence
from typing import Any

Shape = tuple[int, ...]

_INDEX = "(?:0|[1-9][0-9]{0,18})"
_ELEMENT = re.compile(rf"(.+)\[({_INDEX}(?:,{_INDEX})*)\]", re.DOTALL)


def array_and_index(name: str) -> tuple[str, Shape | None]:
    """Name of the array, and index: ``("theta", (3,))`` of ``"theta[3]"``, ``("theta", None)`` of ``"theta"``."""
    if not name.endswith("]"):  # most of them, at a tenth of the cost
        return name, None
    match = _ELEMENT.fullmatch(name)
    return (match[1], tuple(map(int, match[2].split(",")))) if match else (name, None)


def suffixed_name(name: str, suffix: str) -> str:
    """Name with a suffix, which stands before an index: ``x_dot[2]`` for ``x[2]``."""
    array, bracket, index = name.partition("[")
    return f"{array}{suffix}{bracket}{index}"


def element_offset(index: Shape, shape: Shape) -> int | None:
    """Position of an element in its array, from 0, row by row; None if the array has no such element."""
    if len(index) != len(shape):
        return None
    number = 0
    for i, n in zip(index, shape, strict=True):
        if not 1 <= i <= n:
            return None
        number = number * n + i - 1
    return number


def complete_shape(indices: Sequence[Shape]) -> Shape | None:
    """Shape of the array whose elements have these indices; None unless they are all of its indices, row by row."""
    shape = indices[-1]
    if math.prod(shape) != len(indices):
        return None
    return shape if all(element_offset(index, shape) == number for number, index in enumerate(indices)) else None


def by_name(names: Iterable[str], values: Iterable[Any]) -> dict[str, Any]:
    """Dictionary from names to values; a ValueError unless there are as many of both."""
    return dict(zip(names, values, strict=True))
