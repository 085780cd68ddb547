"""Calls of FMUs, prepared once and made at each communication step, by Python or by compiled code."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from ctypes import CFUNCTYPE, Array, addressof, c_int, c_void_p, cast
from functools import partial
from pathlib import Path
from typing import Any, Literal, final

from liaisons.cosim.messages import WARNING
from liaisons.cosim.structures import Record, record_type
from liaisons.errors import SimulationError

Action = Literal["copy", "set", "step", "get", "save", "restore", "derive", "shape", "slope", "couple"]
"""Action of a call; derive: get directional derivatives; shape: set derivatives of inputs; slope: get derivatives of
outputs; couple: make a coupled step."""

Failure = Callable[[Action, int, str], SimulationError]
"""Makes the error of a call from its action, the status that it returned, and words for the time."""

COPY, CONVERT, TRANSFER_2, TRANSFER_3, STEP_2, STEP_3, SAVE, RESTORE, ORDERS_2, DERIVE_2, WATCH, PYTHON, COUPLED = (
    range(13)
)
"""Kinds of calls, as ``calls.h`` numbers them."""

RAISED = -1
"""Result of a call of Python from compiled code that has raised an exception; :attr:`Call.raised` is the exception."""

HEADER = Path(__file__).with_name("calls.h")


CallRecord = record_type(HEADER, "Call")
"""The structure from which compiled code makes a call."""


@final
class Call(partial[Any]):
    """A function with all its arguments; called, it returns an FMI status, or None for OK.

    :ivar failure: makes its error, of a call that can be refused.
    :ivar record: how compiled code makes it; its addresses are those of objects that the call keeps alive.
    :ivar raised: exception of the call, when compiled code has made it.
    :ivar buffers: objects that the record points to, beside the arguments.
    """

    action: Action = "copy"
    failure: Failure
    record: Record | None = None
    raised: BaseException | None = None
    buffers: object = None

    def set_failure(self, action: Action, failure: Failure) -> Call:
        """Set the action, and the function that makes the error; returns the call itself."""
        self.action, self.failure = action, failure
        return self

    def error(self, status: int, when: str) -> SimulationError:
        """Error for a status that the call has returned.

        :param when: words for the time.
        """
        return self.failure(self.action, status, when)

    def perform(self, when: str) -> None:
        """Make the call and check its status.

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
        """Set the record from which compiled code makes the call; returns the call itself.

        :param source: address, or object of ctypes, that is read.
        :param values: address, or object of ctypes, that is written.
        """
        function: Any = self.func
        address = None if kind in {COPY, CONVERT, WATCH} else cast(function, c_void_p).value
        source, values, more = (
            pointer if pointer is None or isinstance(pointer, int) else addressof(pointer)
            for pointer in (source, values, more)
        )
        self.record = CallRecord(kind, address, instance, source, count, values, size, more)
        return self

    def compiled_record(self) -> Record:
        """Record from which compiled code makes the call; if none was set, it calls Python."""
        if self.record is None:
            self._callback = _CALLBACK(self._status_or_raised)
            self.record = CallRecord(PYTHON, cast(self._callback, c_void_p).value)
        return self.record

    def _status_or_raised(self) -> int:
        """Make the call; returns its status, or :data:`RAISED` if there was an exception, which it stores."""
        try:
            return self() or 0
        except BaseException as error:  # noqa: BLE001 - exceptions cannot pass through compiled code
            self.raised = error
            return RAISED


_CALLBACK = CFUNCTYPE(c_int)


def call_records(calls: Iterable[Call]) -> Array[Record]:
    """The records of calls, as an array of C."""
    array = [call.compiled_record() for call in calls]
    return (CallRecord * len(array))(*array)
