"""Calls of FMUs, prepared once and made at every communication step, by Python or by compiled code."""

from __future__ import annotations

from collections.abc import Callable
from ctypes import CFUNCTYPE, addressof, c_int, c_void_p, cast
from functools import partial
from pathlib import Path
from typing import Any, Literal, final

from liaisons.base.structures import Record, structure_fields
from liaisons.cosim.messages import WARNING
from liaisons.errors import SimulationError

Action = Literal["copy", "set", "step", "get", "save", "restore", "derive", "shape", "slope", "couple"]
"""What a call does; of the last four: directional derivatives, derivatives of inputs and of outputs, a coupled step."""

Failure = Callable[[Action, int, str], SimulationError]
"""Makes the error of a call: what it was to do, the status that it returned, and when that was."""

COPY, CONVERT, TRANSFER_2, TRANSFER_3, STEP_2, STEP_3, SAVE, RESTORE, ORDERS_2, DERIVE_2, PYTHON, COUPLED = range(12)
"""Kinds of calls, as ``calls.h`` numbers them."""

RAISED = -1
"""What is no status: an exception in a call that compiled code has asked Python for; it is ``raised`` of the call."""


HEADER = Path(__file__).with_name("calls.h")


@final
class CallRecord(Record):
    """A call as compiled code makes it."""

    _fields_ = structure_fields(HEADER, "Call")


@final
class Call(partial[Any]):
    """A call without arguments; it returns an FMI status, or None where there can be none.

    A function of C is called by it as by ``functools.partial``, with nothing of Python between.

    :ivar action: what it does.
    :ivar failure: makes its error, of a call that can be refused.
    :ivar buffers: what the record points to beside the arguments.
    :ivar record: how compiled code makes it, its addresses those of what the call keeps alive; see :meth:`compiled_record`.
    """

    action: Action = "copy"
    failure: Failure
    record: CallRecord | None = None
    raised: BaseException | None = None
    buffers: object = None

    def set_failure(self, action: Action, failure: Failure) -> Call:
        """Set what the call does, and what makes its error; returns the call."""
        self.action, self.failure = action, failure
        return self

    def error(self, status: int, when: str) -> SimulationError:
        """The error of a status that the call has returned."""
        return self.failure(self.action, status, when)

    def perform(self, when: str) -> None:
        """Make the call.

        :raises SimulationError: for a status other than OK and Warning.
        """
        if (status := self()) and status != WARNING:
            raise self.error(status, when)

    def set_record(
        self,
        kind: int,
        instance: int | None,
        *,
        source: Any = None,
        count: int = 0,
        values: Any = None,
        size: int = 0,
        more: Any = None,
    ) -> Call:
        """Set the record by which compiled code makes the call; returns the call.

        :param source: address of what is read, or an object of ctypes; ``values`` of what is written.
        """
        function: Any = self.func
        address = None if kind in {COPY, CONVERT} else cast(function, c_void_p).value
        source, values, more = (
            pointer if pointer is None or isinstance(pointer, int) else addressof(pointer)
            for pointer in (source, values, more)
        )
        self.record = CallRecord(kind, address, instance, source, count, values, size, more)
        return self

    def compiled_record(self) -> CallRecord:
        """The record by which compiled code makes the call; without one, compiled code calls Python."""
        if self.record is None:
            self._asked = _ASKED(self._answer)
            self.record = CallRecord(PYTHON, cast(self._asked, c_void_p).value)
        return self.record

    def _answer(self) -> int:
        """Make the call for compiled code; keeps an exception, and returns :data:`RAISED` for it."""
        try:
            return self() or 0
        except BaseException as error:  # noqa: BLE001 - nothing gets through compiled code but this
            self.raised = error
            return RAISED


_ASKED = CFUNCTYPE(c_int)
