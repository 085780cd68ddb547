"""What a person sees of a long computation, a progress bar, and does to it: interrupts from the keyboard."""

from __future__ import annotations

import signal
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from importlib.util import find_spec
from types import FrameType

_PAUSE = 0.1  # [s] between two updates


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
