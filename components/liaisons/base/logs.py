"""What a person learns of a long computation, warnings and progress, and does to it: interrupts from the keyboard."""

from __future__ import annotations

import logging
import signal
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from importlib.util import find_spec
from types import FrameType
from typing import Any, final

_MOST = 100
"""Number of different warnings that are collected; further ones are only counted."""
_PAUSE = 0.1
"""Time between two updates of a progress bar [s]."""


@final
class Warnings:
    """Warnings in the order of their first occurrence, each once."""

    def __init__(self) -> None:
        self._texts: dict[str, None] = {}
        self._omitted = 0

    def add(self, text: str) -> None:
        """Add a warning as one line, unless it is there already."""
        text = " ".join(text.split())
        if text in self._texts or len(self._texts) < _MOST:
            self._texts[text] = None
        else:
            self._omitted += 1

    @property
    def texts(self) -> tuple[str, ...]:
        """Texts of the warnings; the last one counts those that were omitted, if any."""
        return (*self._texts, *([f"and {self._omitted} more"] if self._omitted else []))


@contextmanager
def collected_warnings(*, instead_of: Warnings | None = None) -> Iterator[Warnings]:
    """Yield a collection of the warnings that this thread logs in the context; they are logged all the same.

    :param instead_of: a collection that does not get them.
    """
    warnings = Warnings()
    paused = _collecting.get() & {instead_of}
    _collecting.set(_collecting.get() - paused | {warnings})
    try:
        yield warnings
    finally:  # contexts of several runs may end in any order
        _collecting.set(_collecting.get() - {warnings} | paused)


@contextmanager
def ignored_warnings() -> Iterator[None]:
    """Suppress warnings in the context: they are neither logged nor collected."""
    token, before = _collecting.set(frozenset()), logger.logger.level
    logger.setLevel(logging.ERROR)
    try:
        yield
    finally:
        logger.setLevel(before)
        _collecting.reset(token)


@final
class _CollectingLogger(logging.LoggerAdapter[logging.Logger]):
    """A logger whose warnings are collected whatever its level is."""

    def log(self, level: int, msg: object, *args: object, **kwargs: Any) -> None:
        """Log a message; add a warning to the collectors of this thread."""
        if level == logging.WARNING:
            for warnings in _collecting.get():
                warnings.add(str(msg) % args if args else str(msg))
        super().log(level, msg, *args, **{"stacklevel": 2, **kwargs})


_collecting: ContextVar[frozenset[Warnings]] = ContextVar("collecting", default=frozenset())
logger = _CollectingLogger(logging.getLogger("liaisons.cosim"), {})


@contextmanager
def progress_bar(title: str, template: str, start: float, end: float) -> Iterator[Callable[[float], None]]:
    """Yield a function of the progress that updates a bar on stderr; in a file or a pipe nothing is shown.

    :param title: what runs; nothing is shown when empty.
    :param template: format of the progress, for example ``"t = {:g} of {:g} s"``.
    :param start: progress at the start.
    :param end: progress at the end.
    """
    if not title:
        yield lambda _: None
        return
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn

    console = Console(stderr=True)
    with Progress(
        TextColumn("{task.description}", markup=False),
        BarColumn(),
        TimeRemainingColumn(),
        console=console,
        auto_refresh=False,  # without a thread, since the run may start processes
        redirect_stdout=False,
        redirect_stderr=False,
        disable=not (find_spec("ipywidgets") if console.is_jupyter else console.is_interactive),
    ) as bar:
        task = bar.add_task(title, total=end - start)
        updated = time.monotonic()

        def show(reached: float) -> None:
            nonlocal updated
            now = time.monotonic()
            if now - updated >= _PAUSE or reached >= end:
                updated = now
                description = f"{title}: {template.format(reached, end)}"
                bar.update(task, completed=reached - start, description=description, refresh=True)

        yield show


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
