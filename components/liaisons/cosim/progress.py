"""What a long run has to do with the one who waits for it: an interrupt from the keyboard, a progress bar."""

from __future__ import annotations

import signal
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType


@contextmanager
def deferred_interrupts() -> Iterator[list[int]]:
    """A list into which an interrupt from the keyboard goes; a second one acts at once.

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


def progress_bar(title: str, first: float, last: float) -> Callable[[float], None]:
    """A function that is told the time reached [s]; it writes to stderr ten times a second, and at the end."""
    begin = shown = time.monotonic()

    def show(t: float) -> None:
        nonlocal shown
        now = time.monotonic()
        if now - shown < 0.1 and t < last:
            return
        shown = now
        part = (t - first) / (last - first)
        rest = (now - begin) * (1 / part - 1)
        bar = f"[{'#' * int(30 * part):30}]"
        sys.stderr.write(f"\r{title} {bar} t = {t:.6g} of {last:.6g} s, {rest:.0f} s left " + "\n" * (t == last))
        sys.stderr.flush()

    return show
