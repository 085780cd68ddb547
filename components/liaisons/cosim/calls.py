"""Calls of FMUs, prepared once and made at every communication step, by Python or by compiled code."""

from __future__ import annotations

from collections.abc import Callable
from ctypes import Structure, c_int, c_size_t, c_void_p, cast
from enum import IntEnum
from functools import partial
from typing import Any, final

Call = Callable[[], int | None]
"""A prepared call without arguments; returns an FMI status, or None where there can be none."""


class Kind(IntEnum):
    """What a call does, as ``loop.c`` numbers it."""

    COPY = 0
    TRANSFER_2 = 1
    TRANSFER_3 = 2
    STEP_2 = 3
    STEP_3 = 4


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
class Prepared(partial[Any]):
    """A call that compiled code can make, too.

    :ivar record: how; its addresses are of what the call keeps alive.
    """

    record: Record

    def recorded(
        self,
        kind: Kind,
        *,
        function: Any = None,
        instance: int | None = None,
        given: int | None = None,
        count: int = 0,
        values: int | None = None,
        size: int = 0,
    ) -> Prepared:
        """The same with its record.

        :param function: of a library.
        :param given: address of what is read; ``values`` of what is written.
        """
        address = cast(function, c_void_p).value
        self.record = Record(kind, address, instance, given, count, values, size)
        return self
