"""Calls of FMUs, prepared once and made at every communication step, by Python or by compiled code."""

from __future__ import annotations

from collections.abc import Callable
from ctypes import Structure, c_int, c_size_t, c_void_p, cast
from functools import partial
from typing import Any, Literal, final

from liaisons.errors import SimulationError

Action = Literal["copy", "set", "step", "get", "save", "restore", "derive", "shape", "slope"]
"""What a call does; the last three: directional derivatives, derivatives of inputs and of outputs."""

Failure = Callable[[Action, int, str], SimulationError]
"""Makes the error of a call: what it was to do, the status that it returned, and when that was."""

COPY, CONVERT, TRANSFER_2, TRANSFER_3, STEP_2, STEP_3 = range(6)
"""Kinds of calls, as ``loop.c`` numbers them."""


@final
class Record(Structure):
    """A call as ``loop.c`` makes it; see there."""

    _fields_ = [
        ("kind", c_int),
        ("function", c_void_p),
        ("instance", c_void_p),
        ("given", c_void_p),
        ("count", c_size_t),
        ("values", c_void_p),
        ("size", c_size_t),
    ]


@final
class Call(partial[Any]):
    """A call without arguments; it returns an FMI status, or None where there can be none.

    A function of C is called by it as by ``functools.partial``, with nothing of Python between.

    :ivar action: what it does.
    :ivar failure: makes its error; None of what cannot be refused.
    :ivar record: how compiled code makes it, its addresses those of what the call keeps alive; None if only Python can.
    """

    action: Action = "copy"
    failure: Failure | None = None
    record: Record | None = None

    def of(self, action: Action, failure: Failure) -> Call:
        """The same, which knows what it does for whom."""
        self.action, self.failure = action, failure
        return self

    def recorded(
        self,
        kind: int,
        *,
        function: Any = None,
        instance: int | None = None,
        given: int | None = None,
        count: int = 0,
        values: int | None = None,
        size: int = 0,
    ) -> Call:
        """The same with its record.

        :param function: of a library.
        :param given: address of what is read; ``values`` of what is written.
        """
        self.record = Record(kind, cast(function, c_void_p).value, instance, given, count, values, size)
        return self
