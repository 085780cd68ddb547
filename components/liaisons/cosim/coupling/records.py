"""The structures of ``coupling.c``, which compiled code reads."""

from __future__ import annotations

from collections.abc import Iterable
from ctypes import POINTER, Structure, c_double, c_int, c_size_t, c_ssize_t, c_void_p
from typing import Any, final

from numpy.typing import NDArray

from liaisons.cosim.compiled.calls import Call
from liaisons.cosim.compiled.calls import Record as CallRecord

AS_SET, POLYNOMIAL, AT_INSTANTS, MEAN = range(4)
"""How inputs move within a step."""

Fields = list[tuple[str, Any]]


def _numbers(*names: str) -> Fields:
    return [(name, c_size_t) for name in names]


def _flags(*names: str) -> Fields:
    return [(name, c_int) for name in names]


def _pointers(*names: str) -> Fields:
    return [(name, c_void_p) for name in names]


class _Record(Structure):
    """A structure that remembers the arrays that it points to."""

    def point(self, **arrays: NDArray[Any]) -> None:
        """Point to arrays, by the names of the fields."""
        for name, array in arrays.items():
            setattr(self, name, array.ctypes.data)
            setattr(self, f"_{name}", array)


@final
class EliminationRecord(_Record):
    """See :class:`liaisons.cosim.coupling.elimination.Elimination`."""

    _fields_ = [
        *_numbers("n"),
        ("smallest_pivot", c_double),
        *_flags("ordered"),
        *_pointers("values", "row_order", "column_order", "pivots", "work"),
        *_pointers("starts", "above_starts", "below_starts", "rows", "above_rows", "below_rows"),
        *_pointers("indices", "upper", "lower"),
    ]


@final
class NewtonRecord(_Record):
    """See :class:`liaisons.cosim.coupling.newton.Newton`."""

    _fields_ = [
        *_flags("ready"),
        ("calls", POINTER(CallRecord)),
        *_numbers("count", "entries"),
        *_pointers("derivatives", "slots", "powers", "factors", "values"),
        *_numbers("numbers"),
        ("elimination", POINTER(EliminationRecord)),
        *_pointers("order"),
    ]


@final
class NodeRecord(_Record):
    """See :class:`liaisons.cosim.coupling.node.Node`."""

    _fields_ = [
        *_flags("approximation", "repeated", "sloped"),
        ("calls", POINTER(CallRecord)),
        *_numbers("count", "inputs", "outputs", "value", "slope"),
        *_pointers("sources", "rates", "roots", "set_values", "rate_values", "read", "slopes"),
        *_numbers("derivatives", "terms", "data"),
        *_pointers("signals", "scaling", "term", "after", "begun", "of", "factors", "shape"),
    ]


@final
class StrongComponentRecord(_Record):
    """See :class:`liaisons.cosim.coupling.strong_component.StrongComponent`."""

    _fields_ = [
        *_flags("cyclic"),
        ("newton", POINTER(NewtonRecord)),
        ("nodes", POINTER(NodeRecord)),
        *_numbers("count", "n", "valued"),
        *_pointers("unknowns", "kinds", "errors"),
        ("tolerance", c_double),
    ]


@final
class SignalHistoryRecord(_Record):
    """See :class:`liaisons.cosim.coupling.signal_history.SignalHistory`."""

    _fields_ = [
        *_numbers("made"),
        *_pointers("values", "past", "spans", "depth", "instants", "others", "step_in_thirds"),
    ]


@final
class FailureRecord(Structure):
    """Where a step has failed."""

    _fields_ = [*_numbers("component", "node"), ("call", c_ssize_t), *_numbers("iteration"), *_flags("deriving")]


@final
class SystemRecord(_Record):
    """See :class:`liaisons.cosim.coupling.implicit.Coupled`."""

    _fields_ = [
        *_numbers("outputs", "kinds", "count"),
        *_pointers("before", "now", "earlier", "since", "sizes", "result", "rates", "kind"),
        ("components", POINTER(StrongComponentRecord)),
        ("histories", POINTER(SignalHistoryRecord)),
        *_pointers("held", "drive", "inside"),
        *_numbers("orders", "instants"),
        *_pointers("room", "scratch"),
        ("failure", FailureRecord),
    ]


DIVERGED = -2
"""What advancing returns besides statuses and :data:`liaisons.cosim.compiled.calls.RAISED`."""


def records(calls: Iterable[Call]) -> Any:
    """The records of calls, as an array."""
    array = [call.compiled() for call in calls]
    return (CallRecord * len(array))(*array)
