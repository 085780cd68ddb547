"""The logger of simulations, and the collection of the warnings of one run."""

from __future__ import annotations

import logging
from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from typing import final

logger = logging.getLogger("liaisons.cosim")

_MOST = 100
"""Different warnings that are collected; more are counted only."""


@final
class Warnings:
    """Warnings, each once, in the order in which they came first."""

    def __init__(self) -> None:
        self._texts: dict[str, None] = {}
        self._omitted = 0

    def add(self, text: str) -> None:
        """Add a text, on one line."""
        text = " ".join(text.split())
        if text in self._texts or len(self._texts) < _MOST:
            self._texts[text] = None
        else:
            self._omitted += 1

    @property
    def texts(self) -> tuple[str, ...]:
        """The texts, and how many more there were."""
        return (*self._texts, *([f"and {self._omitted} more"] if self._omitted else []))


@contextmanager
def collected_warnings() -> Iterator[Warnings]:
    """Collect the warnings that this thread logs in the context; they are logged all the same."""
    warnings = Warnings()
    token = _collecting.set((*_collecting.get(), warnings))
    try:
        yield warnings
    finally:
        _collecting.reset(token)


def _collect(record: logging.LogRecord) -> bool:
    """Collect a warning; a filter, since a handler would replace Python's own, which prints it."""
    if record.levelno == logging.WARNING:
        for warnings in _collecting.get():
            warnings.add(record.getMessage())
    return True


_collecting: ContextVar[tuple[Warnings, ...]] = ContextVar("collecting", default=())
logger.addFilter(_collect)
