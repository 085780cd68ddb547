"""Where warnings of simulations go, and those of one run."""

from __future__ import annotations

import logging
from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from typing import final

logger = logging.getLogger("liaisons.cosim")

_MOST = 100
"""Different warnings that are kept; what comes after them is counted."""


@final
class Warnings:
    """Warnings, each once, in the order in which they came first."""

    def __init__(self) -> None:
        self._texts: dict[str, None] = {}
        self._others = 0

    def add(self, text: str) -> None:
        """Keep a text, on one line."""
        text = " ".join(text.split())
        if text in self._texts or len(self._texts) < _MOST:
            self._texts[text] = None
        else:
            self._others += 1

    @property
    def texts(self) -> tuple[str, ...]:
        """What was kept."""
        return (*self._texts, *([f"and {self._others} more"] if self._others else []))


@contextmanager
def collected_warnings() -> Iterator[Warnings]:
    """Collect the warnings that this thread logs meanwhile; they are logged all the same."""
    found = Warnings()
    token = _collecting.set((*_collecting.get(), found))
    try:
        yield found
    finally:
        _collecting.reset(token)


def _collect(record: logging.LogRecord) -> bool:
    """Hand a warning to all that collect; a filter, for a handler would keep Python's own from printing it."""
    if record.levelno == logging.WARNING:
        for found in _collecting.get():
            found.add(record.getMessage())
    return True


_collecting: ContextVar[tuple[Warnings, ...]] = ContextVar("collecting", default=())
logger.addFilter(_collect)
