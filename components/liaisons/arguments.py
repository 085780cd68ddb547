"""What arguments are taken for, and what is said of those that are something else.

Each function takes what to call the argument, the argument, and the class of the error that it raises.
"""

from __future__ import annotations

import math
import os
from collections.abc import Iterable, Mapping, Sequence
from numbers import Integral, Real
from pathlib import Path
from typing import TYPE_CHECKING, Any

from liaisons.errors import LiaisonsError, SimulationError

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

Error = type[LiaisonsError]


def shown(value: object) -> str:
    """A value in one line that is not too long."""
    text = " ".join(repr(value).split())
    return text if len(text) <= 80 else f"{text[:77]}..."


def listed(label: str, names: object, error: Error = SimulationError) -> list[str]:
    """Names as a list; one may stand for itself."""
    if isinstance(names, str):
        return [names]
    found = list(names) if isinstance(names, Iterable) and not isinstance(names, (Mapping, bytes)) else [None]
    if not all(isinstance(name, str) for name in found):
        raise error(f"{label} = {shown(names)}: give a name or a list of names")
    return [str(name) for name in found]


def named(label: str, given: object, error: Error = SimulationError) -> Mapping[str, Any]:
    """A dictionary by names."""
    if not isinstance(given, Mapping) or not all(isinstance(name, str) for name in given):
        raise error(f"{label} = {shown(given)}: give a dictionary with names as keys")
    return given


def as_path(label: str, path: object, error: Error = SimulationError) -> Path:
    """A path."""
    if not isinstance(path, (str, os.PathLike)):
        raise error(f"{label} = {shown(path)}: give a path")
    return Path(path)


def finite(label: str, value: object, error: Error = SimulationError) -> None:
    """Check that it is a finite number."""
    if not isinstance(value, Real) or not math.isfinite(value):
        raise error(f"{label} = {shown(value)}: must be a finite number")


def numbers(label: str, values: object, error: Error = SimulationError) -> NDArray[np.float64]:
    """An array of numbers."""
    import numpy as np  # slow to load: the command line's help does without

    try:
        if values is not None:  # NumPy would take it for not-a-number
            return np.asarray(values, dtype=float)
    except (TypeError, ValueError):
        pass
    raise error(f"{label} = {shown(values)}: give numbers")


def whole(label: str, value: object, error: Error = SimulationError, *, least: int = 1) -> None:
    """Check that it is a whole number."""
    if not isinstance(value, Integral) or value < least:
        raise error(f"{label} = {shown(value)}: give a whole number, {least} at least")


def chosen(label: str, value: object, known: Sequence[str], error: Error = SimulationError) -> None:
    """Check that it is one of some words."""
    if not isinstance(value, str) or value not in known:
        raise error(f"{label} = {shown(value)}: choose one of {', '.join(map(repr, known))}")
