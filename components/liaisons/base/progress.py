"""Progress bars in terminals and notebooks."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from importlib.util import find_spec

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
