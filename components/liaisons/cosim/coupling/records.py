"""The structures and constants of ``coupling.c``."""

from __future__ import annotations

from functools import partial

from liaisons.cosim.compiled.calls import HEADER, record_type

AS_SET, POLYNOMIAL, AT_INSTANTS, MEAN = range(4)
"""How inputs move within a step."""

DIVERGED = -2
"""What advancing returns besides statuses and :data:`liaisons.cosim.compiled.calls.RAISED`."""

_type = partial(record_type, HEADER.with_name("coupling.c"))
EliminationRecord = _type("Elimination", "pivots", "upper", "lower")
NewtonRecord, NodeRecord, StrongComponentRecord = _type("Newton"), _type("Node"), _type("StrongComponent")
SignalHistoryRecord, SystemRecord = _type("SignalHistory"), _type("System", Failure=_type("Failure"))
