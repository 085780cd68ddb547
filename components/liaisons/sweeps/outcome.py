"""What becomes of a case, and which failures are worth another try."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeAlias, final

from liaisons.errors import LiaisonsError, RefusedError


@final
@dataclass(frozen=True, slots=True)
class Failure:
    """Why nothing was kept of a case.

    :param reason: one line.
    :param refused: by the model itself, which would do it again; else by the machine, or a function of the user.
    """

    reason: str
    refused: bool


@final
@dataclass(frozen=True, slots=True)
class Kept:
    """What was kept of a case: its numbers, in the order of their names, and what was warned of meanwhile."""

    values: tuple[float, ...]
    warnings: tuple[str, ...] = ()


Outcome: TypeAlias = Kept | Failure
"""What was kept of a case, or why it failed."""

LIVES = 2
"""So many processes may die over one case before it is given up, until the next start."""


def died(code: int | None) -> Failure:
    """Of a case over which as many processes have died as may, the last one with this exit code."""
    return Failure(f"the process that simulated it died, {LIVES} times (exit code {code})", refused=False)


def too_long(time_limit: float) -> Failure:
    """Of a case whose process was ended for that."""
    return Failure(f"took longer than the time limit of {time_limit:g} s", refused=False)


def failure(error: Exception) -> Failure:
    """A refusal is what an FMU says by Discard or Error, or an iteration that does not converge; nothing else is.

    Fatal is not: an FMU that is beyond repair may have run out of memory.
    """
    words = str(error) if isinstance(error, LiaisonsError) else f"{type(error).__name__}: {error}"
    cause: BaseException | None = error
    while cause is not None and not isinstance(cause, RefusedError):
        cause = cause.__cause__
    return Failure(" ".join(words.split()), refused=cause is not None)
