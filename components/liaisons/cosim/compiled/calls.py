"""What Python and compiled code share: arrays, structures, and calls of FMUs, which either makes in each step.

Calls are prepared once.  C structures are declared in C files only; Python reads their fields there.
"""

from __future__ import annotations

import ctypes
import re
from collections.abc import Callable, Iterable
from ctypes import CFUNCTYPE, Array, Structure, addressof, c_double, c_int, c_void_p, cast, memmove
from functools import partial
from pathlib import Path
from typing import Any, ClassVar, Literal, final

import numpy as np
from numpy.typing import NDArray

from liaisons.errors import SimulationError

OK, WARNING, DISCARD, ERROR, FATAL = 0, 1, 2, 3, 4
SUCCESS = {OK, WARNING}
STATUSES = ("OK", "Warning", "Discard", "Error", "Fatal", "Pending")

Vector = NDArray[np.float64]
Indices = NDArray[np.intp]
Numbers = Vector | Array[c_double]
"""Contiguous doubles, which a prepared call reads or writes."""


def pointer_to(values: Numbers) -> Array[c_double]:
    """ctypes array that shares the memory of an array of doubles, as an argument of a C function."""
    return (c_double * len(values)).from_buffer(values)  # type: ignore[arg-type] - NumPy says so from Python 3.12 on


@final
class Memory:
    """Arrays that are saved and restored together, or reset to their values at construction."""

    def __init__(self, arrays: Iterable[NDArray[Any]]) -> None:
        self.arrays = list(arrays)
        self._initial = self.save()

    def save(self) -> list[NDArray[Any]]:
        """Copies of the arrays, for :meth:`restore`."""
        return [*map(np.copy, self.arrays)]

    def restore(self, saved: Iterable[NDArray[Any]]) -> None:
        """Copy saved values into the arrays."""
        for array, values in zip(self.arrays, saved, strict=True):
            array[:] = values

    def reset(self) -> None:
        """Set the arrays to their values at construction."""
        self.restore(self._initial)


_INTEGERS = {"size_t": ctypes.c_size_t, "ptrdiff_t": ctypes.c_ssize_t, "int": c_int, "bool": ctypes.c_bool}
_TYPES = {**_INTEGERS, "double": c_double}

SavedRecord = tuple[bytes, dict[str, Any], list[tuple[NDArray[Any], NDArray[Any]]]]
"""Bytes of a record, what its pointers point to, and arrays with copies of their values."""


class Record(Structure):
    """A C structure, which keeps in ``targets`` what its pointers point to.

    :ivar remembered: names of the arrays that compiled code writes, and reads in later steps.
    """

    targets: dict[str, Any]
    remembered: ClassVar[tuple[str, ...]] = ()

    def point(self, **targets: NDArray[Any] | Array[Any] | Structure | c_double) -> None:
        """Set pointers, by their names, to arrays or structures, which are kept alive."""
        vars(self).setdefault("targets", {}).update(targets)
        for name, target in targets.items():
            setattr(self, name, target.ctypes.data if isinstance(target, np.ndarray) else addressof(target))

    def save(self) -> SavedRecord:
        """Copy of the fields and of the arrays that are remembered, for :meth:`restore`."""
        targets = dict(vars(self).get("targets", {}))
        arrays = [targets[name] for name in self.remembered if name in targets]
        return bytes(self), targets, [(array, array.copy()) for array in arrays]

    def restore(self, saved: SavedRecord) -> None:
        """Set the fields to those of a copy, and in place the values of the arrays."""
        content, targets, arrays = saved
        memmove(addressof(self), content, len(content))
        self.targets = dict(targets)
        for array, numbers in arrays:
            array[:] = numbers


def record_type(path: Path, structure: str, *remembered: str, **nested: type[Structure]) -> type[Record]:
    """The type of a C structure, whose fields are read from ``typedef struct { ... } structure;``.

    :param path: of the C file.
    :param remembered: see :class:`Record`.
    :param nested: structures inside it, by name.
    """
    code = re.sub(r"/\*.*?\*/", "", path.read_text(encoding="utf-8"), flags=re.DOTALL)
    (content,) = re.findall(rf"typedef struct \{{([^}}]*)\}} {structure};", code)
    types = _TYPES | nested
    fields = [
        (re.findall(r"\w+", declarator)[-1], c_void_p if "*" in declarator else types[kind])
        for kind, declarators in re.findall(r"(?:const )?(\w+) ([^;]+);", content)
        for declarator in declarators.split(",")
    ]
    return type(structure, (Record,), {"_fields_": fields, "remembered": remembered})


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
    array = [*map(Call.compiled_record, calls)]
    return (CallRecord * len(array))(*array)
