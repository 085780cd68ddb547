"""What arguments are taken for, and what is said of those that are something else."""

from __future__ import annotations

import math
import os
from collections.abc import Iterable, Mapping
from numbers import Real
from pathlib import Path
from typing import Any

from liaisons.errors import LiaisonsError, SimulationError


def listed(label: str, names: object, error: type[LiaisonsError] = SimulationError) -> list[str]:
    """Names as a list; one may stand for itself.

    :param label: what they are for.
    :raises error: if they are no names.
    """
    if isinstance(names, str):
        return [names]
    found = list(names) if isinstance(names, Iterable) and not isinstance(names, (Mapping, bytes)) else [None]
    if not all(isinstance(name, str) for name in found):
        raise error(f"{label} = {names!r}: give a name or a list of names")
    return [str(name) for name in found]


def named(label: str, given: object, error: type[LiaisonsError] = SimulationError) -> Mapping[str, Any]:
    """A dictionary by names.

    :param label: what it is of.
    :raises error: if it is none.
    """
    if not isinstance(given, Mapping) or not all(isinstance(name, str) for name in given):
        raise error(f"{label} = {given!r}: give a dictionary with names as keys")
    return given


def as_path(label: str, path: object, error: type[LiaisonsError] = SimulationError) -> Path:
    """A path.

    :param label: what it is of.
    :raises error: if it is none.
    """
    if not isinstance(path, (str, os.PathLike)):
        raise error(f"{label} = {path!r}: give a path")
    return Path(path)


def finite(label: str, value: object, error: type[LiaisonsError] = SimulationError) -> None:
    """Check that it is a finite number.

    :raises error: if it is none.
    """
    if not isinstance(value, Real) or not math.isfinite(value):
        raise error(f"{label} = {value!r}: must be a finite number")
