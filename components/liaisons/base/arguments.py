"""Checks of arguments.

Each function takes a label for the message, the argument, and the class of the error that it raises.
"""

from __future__ import annotations

import math
import os
import re
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from numbers import Integral, Real
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from liaisons.errors import InvalidValueError, LiaisonsError

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

Error = type[LiaisonsError]
T = TypeVar("T")


def shown(value: object) -> str:
    """The repr of a value on one line of at most 80 characters, for messages."""
    text = " ".join(repr(value).split())
    return text if len(text) <= 80 else f"{text[:77]}..."


def name_list(label: str, names: object, error: Error = InvalidValueError) -> list[str]:
    """Names as a list, of one if a single name is given; raises the error for anything but names."""
    if isinstance(names, str):
        return [names]
    items = list(names) if isinstance(names, Iterable) and not isinstance(names, (Mapping, bytes)) else [None]
    if not all(isinstance(name, str) for name in items):
        raise error(f"{label} = {shown(names)}: give a name or a list of names")
    return [str(name) for name in items]


def name_dictionary(label: str, dictionary: object, error: Error = InvalidValueError) -> Mapping[str, Any]:
    """The dictionary itself; raises the error unless its keys are names."""
    if not isinstance(dictionary, Mapping) or not all(isinstance(name, str) for name in dictionary):
        raise error(f"{label} = {shown(dictionary)}: give a dictionary with names as keys")
    return dictionary


def merged_start_values(
    label: str, start_values: object, keywords: Mapping[str, T], error: Error = InvalidValueError
) -> dict[str, T]:
    """Start values of a dictionary and of keywords in one dictionary; raises the error for a name in both.

    :param start_values: None for none.
    """
    values = dict(name_dictionary(f"{label}: start_values", {} if start_values is None else start_values, error))
    for name in keywords:
        if name in values:
            raise error(f"{label}: {name} is given in start_values and as a keyword; leave one out")
    return {**values, **keywords}


@contextmanager
def start_value_hints(variables: Collection[str]) -> Iterator[None]:
    """Add a hint at ``start_values`` to errors of the context about a setting that is called like a variable."""
    try:
        yield
    except LiaisonsError as error:
        setting = re.match(r"(?:[^:=]*: )?(\w+) = ", str(error))
        if setting is None or setting[1] not in variables:
            raise
        raise type(error)(f"{error}; {setting[1]} is a variable, too: give it in start_values") from None


def as_path(label: str, path: object, error: Error = InvalidValueError) -> Path:
    """The path as a Path; raises the error for anything else."""
    if not isinstance(path, (str, os.PathLike)):
        raise error(f"{label} = {shown(path)}: give a path")
    return Path(path)


def check_finite(label: str, value: object, error: Error = InvalidValueError) -> None:
    """Raise an error unless the value is a finite number."""
    if not isinstance(value, Real) or not math.isfinite(value):
        raise error(f"{label} = {shown(value)}: must be a finite number")


def check_positive(label: str, value: object, error: Error = InvalidValueError) -> None:
    """Raise an error unless the value is a finite number > 0."""
    check_finite(label, value, error)
    if value <= 0:  # type: ignore[operator]  # a number
        raise error(f"{label} = {shown(value)}: must be > 0")


def checked_stop_and_step(start_time: float, stop_time: float | None, step_size: float | None) -> tuple[float, float]:
    """Stop time and step size [s]; raises InvalidValueError if they are missing or contradict the start time."""
    if stop_time is None or step_size is None:
        raise InvalidValueError("give stop_time and step_size, or the communication points themselves as times")
    check_finite("start_time", start_time)
    check_finite("stop_time", stop_time)
    check_positive("step_size", step_size)
    if stop_time <= start_time:
        raise InvalidValueError(f"stop_time = {stop_time!r}: must be greater than start_time = {start_time!r}")
    if stop_time - step_size == stop_time or start_time + step_size == start_time:
        raise InvalidValueError(f"step_size = {step_size!r}: smaller than the rounding of times up to {stop_time!r} s")
    return stop_time, step_size


def float_array(label: str, values: object, error: Error = InvalidValueError) -> NDArray[np.float64]:
    """Numbers as an array of floats; raises the error for anything else."""
    import numpy as np  # slow to load: the command line's help does without

    try:
        if values is not None:  # NumPy would take it for not-a-number
            return np.asarray(values, dtype=float)
    except (TypeError, ValueError):
        pass
    raise error(f"{label} = {shown(values)}: give numbers")


def check_integer(label: str, value: object, error: Error = InvalidValueError, *, minimum: int = 1) -> None:
    """Raise an error unless the value is an integer, ``minimum`` or more."""
    if not isinstance(value, Integral) or value < minimum:
        raise error(f"{label} = {shown(value)}: give a whole number, at least {minimum}")


def check_choice(label: str, value: object, choices: Sequence[str], error: Error = InvalidValueError) -> None:
    """Raise an error unless the value is one of the choices."""
    if not isinstance(value, str) or value not in choices:
        raise error(f"{label} = {shown(value)}: choose one of {', '.join(map(repr, choices))}")
