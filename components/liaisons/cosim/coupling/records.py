"""The structures of ``coupling.c``."""

from __future__ import annotations

from functools import partial
from typing import final

from liaisons.cosim.compiled.calls import HEADER
from liaisons.cosim.structures import Record, structure_fields

AS_SET, POLYNOMIAL, AT_INSTANTS, MEAN = range(4)
"""How inputs move within a step."""

DIVERGED = -2
"""What advancing returns besides statuses and :data:`liaisons.cosim.compiled.calls.RAISED`."""

_fields = partial(structure_fields, HEADER.with_name("coupling.c"))


@final
class EliminationRecord(Record):
    """See :class:`liaisons.cosim.coupling.elimination.Elimination`."""

    _fields_ = _fields("Elimination")
    remembered = ("pivots", "upper", "lower")


@final
class NewtonRecord(Record):
    """See :class:`liaisons.cosim.coupling.strong_component.Newton`."""

    _fields_ = _fields("Newton")


@final
class NodeRecord(Record):
    """See :class:`liaisons.cosim.coupling.node.Node`."""

    _fields_ = _fields("Node")


@final
class StrongComponentRecord(Record):
    """See :class:`liaisons.cosim.coupling.strong_component.StrongComponent`."""

    _fields_ = _fields("StrongComponent")


@final
class SignalHistoryRecord(Record):
    """See :class:`liaisons.cosim.coupling.signals.SignalHistory`."""

    _fields_ = _fields("SignalHistory")


@final
class FailureRecord(Record):
    """Where a step has failed."""

    _fields_ = _fields("Failure")


@final
class SystemRecord(Record):
    """See :class:`liaisons.cosim.coupling.implicit.Coupled`."""

    _fields_ = _fields("System", Failure=FailureRecord)
