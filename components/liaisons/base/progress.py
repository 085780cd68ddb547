"""Progress bars in terminals and notebooks."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from importlib.util import find_spec

_PAUSE = 0.1  # [s] between two updates


@contextmanager
def progress_bar(title: str, words: str, first: float, last: float) -> Iterator[Callable[[float], None]]:
    """Yield a function that shows the progress it is called with on stderr; nothing in a file or a pipe.

    :param title: what runs; nothing is shown when empty.
    :param words: format of the progress, for example ``"t = {:g} of {:g} s"``.
    :param first: progress at the start.
    :param last: progress at the end.
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
        task = bar.add_task(title, total=last - first)
        shown = time.monotonic()

        def show(reached: float) -> None:
            nonlocal shown
            now = time.monotonic()
            if now - shown >= _PAUSE or reached >= last:
                shown = now
                said = f"{title}: {words.format(reached, last)}"
                bar.update(task, completed=reached - first, description=said, refresh=True)

        yield show
