"""Measures of a case: one number of its result for each column of the table."""

from __future__ import annotations

import marshal
import pickle
from collections.abc import Callable, Iterable, Mapping
from types import CodeType
from typing import Any, TypeAlias

import numpy as np

from liaisons.base.arguments import name_list, shown
from liaisons.errors import SweepError, suggestion
from liaisons.results import Result

Measure: TypeAlias = str | Callable[[Result], float]
"""A signal's value at the end, ``"theta"``, ``"theta:max"``, ``"theta:min"``; or a function of the whole result."""

Measures: TypeAlias = Mapping[str, Measure]
"""Column of the table -> measure."""

_MEASURES: dict[str, Callable[[Any], float]] = {"final": lambda x: x[-1], "max": np.max, "min": np.min}


def checked_measures(keep: str | Iterable[str] | Measures) -> Measures:
    """Measures by the names of their columns, checked.

    :raises SweepError: if there is nothing to keep, or a word after the colon is unknown.
    """
    columns = dict(keep) if isinstance(keep, Mapping) else {name: name for name in name_list("keep", keep, SweepError)}
    if not columns:
        raise SweepError("nothing is kept; name a signal, e.g. keep=['theta', 'theta:max']")
    for name, measure in columns.items():
        if isinstance(measure, str):
            signal_and_kind(measure)
        elif not callable(measure):
            raise SweepError(f"keep: {name} = {shown(measure)}; give the name of a signal or a function of the Result")
    return columns


def signal_and_kind(measure: str) -> tuple[str, str]:
    """Signal of a measure such as ``"theta:max"``, and which of its values: ``"final"``, ``"max"`` or ``"min"``."""
    signal, colon, word = measure.partition(":")
    if not signal:
        raise SweepError(f"keep {measure!r}: no signal is named; write SIGNAL, SIGNAL:max or SIGNAL:min")
    if colon and word not in _MEASURES:
        raise SweepError(f"keep {measure!r}: {word!r} is not known{suggestion(word, _MEASURES)}")
    return signal, word or "final"


def evaluate_measures(keep: Measures, result: Result) -> tuple[float, ...]:
    """Measures of a case from its result, in the order of the columns.

    :raises SweepError: if a function fails or returns no number.
    """
    values: list[float] = []
    for name, measure in keep.items():
        if isinstance(measure, str):
            signal, word = signal_and_kind(measure)
            values.append(float(_MEASURES[word](result[signal])))
            continue
        try:
            values.append(float(measure(result)))
        except Exception as error:
            raise SweepError(f"keep: the function of {name!r} fails: {type(error).__name__}: {error}") from error
    return tuple(values)


def measure_identity(measure: Measure) -> bytes:
    """Bytes that identify a measure in the key of a journal; for a function its code and the values in its closure."""
    if isinstance(measure, str):
        return measure.encode()
    code = getattr(measure, "__code__", None)
    if isinstance(code, CodeType):
        defaults, cells = measure.__defaults__, measure.__closure__ or ()  # type: ignore[union-attr] - it has code
        return marshal.dumps(code) + repr((defaults, [cell.cell_contents for cell in cells])).encode()
    return pickle.dumps(measure)
