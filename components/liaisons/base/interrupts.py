"""Interrupts from the keyboard, which wait for the end of a communication step."""

from __future__ import annotations

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType


@contextmanager
def deferred_interrupts() -> Iterator[list[int]]:
    """Yield a list to which the first interrupt from the keyboard is appended; a second one acts at once.

    A communication step is not broken off in its middle, where an FMU of Python code would take it for its own error.
    """
    interrupts: list[int] = []
    usual = signal.getsignal(signal.SIGINT)
    if threading.current_thread() is not threading.main_thread() or usual is not signal.default_int_handler:
        yield interrupts
        return

    def defer(number: int, _frame: FrameType | None) -> None:
        interrupts.append(number)
        signal.signal(signal.SIGINT, usual)

    signal.signal(signal.SIGINT, defer)
    try:
        yield interrupts
    finally:
        signal.signal(signal.SIGINT, usual)
