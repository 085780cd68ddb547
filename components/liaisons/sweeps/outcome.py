"""What becomes of a case, and which failures are worth another try."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import TypeAlias, final

from liaisons.cosim.messages import FATAL
from liaisons.cosim.refusal import RefusedError, StatusError
from liaisons.errors import LiaisonsError


@final
@dataclass(frozen=True, slots=True)
class Failure:
    """Why nothing was kept of a case.

    :param reason: one line.
    :param refused: by the model itself, which would do it again; else by the machine, or a function of the user.
    """

    reason: str
    refused: bool


Outcome: TypeAlias = tuple[float, ...] | Failure
"""What was kept of a case, or why it failed."""


def failure(error: Exception) -> Failure:
    """A refusal is what an FMU says by Discard or Error, or an iteration that does not converge; nothing else is.

    Fatal is not: an FMU that is beyond repair may have run out of memory.
    """
    words = str(error) if isinstance(error, LiaisonsError) else f"{type(error).__name__}: {error}"
    return Failure(" ".join(words.split()), any(map(_is_refusal, _causes(error))))


def _is_refusal(error: BaseException) -> bool:
    return isinstance(error, RefusedError) or (isinstance(error, StatusError) and error.status < FATAL)


def _causes(error: BaseException | None) -> Iterator[BaseException]:
    while error is not None:
        yield error
        error = error.__cause__
