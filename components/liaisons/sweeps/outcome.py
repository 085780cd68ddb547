"""Outcome of a case, and which failures are tried again."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeAlias, final

from liaisons.errors import LiaisonsError, RefusedError


@final
@dataclass(frozen=True, slots=True)
class Failure:
    """Why a case has no measures.

    :param reason: one line.
    :param refused: whether the model refused it, and would again; else the machine or a function of the user failed.
    """

    reason: str
    refused: bool


@final
@dataclass(frozen=True, slots=True)
class Completed:
    """Measures of a case, in the order of :attr:`Study.keep`, and its warnings."""

    values: tuple[float, ...]
    warnings: tuple[str, ...] = ()


Outcome: TypeAlias = Completed | Failure
"""Measures of a case, or why it failed."""


def failure_of(error: Exception) -> Failure:
    """Return the failure of a case that ended with this error: refused after Discard, Error or no convergence.

    Fatal is no refusal: the FMU may have run out of memory.
    """
    words = str(error) if isinstance(error, LiaisonsError) else f"{type(error).__name__}: {error}"
    cause: BaseException | None = error
    while cause is not None and not isinstance(cause, RefusedError):
        cause = cause.__cause__
    return Failure(" ".join(words.split()), refused=cause is not None)
