"""The logger of simulations, and the collection of the warnings of one run."""

from __future__ import annotations

import logging
from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from typing import Any, final

_MOST = 100
"""Number of different warnings that are collected; further ones are only counted."""


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
