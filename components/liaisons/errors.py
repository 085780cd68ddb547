"""Errors, whose messages name the object, the value received and the fix."""

from __future__ import annotations

import difflib
from collections.abc import Iterable
from typing import Any

_LONGEST = 2000  # characters of a message


class LiaisonsError(Exception):
    """Base class of every error that this package raises on purpose; its message is one line, whatever it quotes."""

    def __str__(self) -> str:
        return one_line(Exception.__str__(self))  # that of a KeyError would quote it


def one_line(text: str) -> str:
    """Text on one line for a terminal: without control characters, and shortened if it is very long."""
    if len(text) > _LONGEST:
        text = f"{text[: _LONGEST - 300]} ... {text[-300:]}"
    if text.isprintable():
        return text
    return "".join(c if c.isprintable() else " " if c.isspace() else f"\\x{ord(c):02x}" for c in text)


class ComponentError(LiaisonsError):
    """The declaration of a component is wrong: unknown symbol, singular mass matrix, missing unit, ..."""


class BuildError(LiaisonsError):
    """An FMU could not be built; nothing was written."""


class BackEndError(BuildError):
    """A back end cannot do what this component needs; others can."""


class ConnectError(LiaisonsError):
    """Two ports or variables of a system do not fit each other."""


class SimulationError(LiaisonsError):
    """An FMU refused a value or a step; the message contains that of the FMU."""


class InvalidValueError(SimulationError, ValueError):
    """An argument, a setting or a start value has a value that it cannot have."""


class UnknownSignalError(SimulationError, KeyError):
    """A result has no signal of this name; the message suggests the nearest name."""


class RefusedError(SimulationError):
    """An FMU has answered Discard or Error, or an iteration did not converge.

    The FMU can continue from a saved state, and a shorter step may succeed.  After any other status it cannot continue.
    """


class EndedError(SimulationError):
    """An FMU has asked to end the simulation; it has reached ``time`` [s]."""

    def __init__(self, message: str, time: float) -> None:
        super().__init__(message)
        self.time = time

    def __reduce__(self) -> tuple[type[EndedError], tuple[str, float]]:
        return type(self), (self.args[0], self.time)  # from one process to another


class IncompleteError(SimulationError):
    """An FMU failed during a run; ``result`` has all signals up to the last communication point that was reached."""

    def __init__(self, message: str, result: Any) -> None:
        super().__init__(message)
        self.result = result


class Interrupted(KeyboardInterrupt):
    """The user stopped a run; ``result`` has all signals up to the last communication point that was reached.

    A ``KeyboardInterrupt``, so that a script stops; catch it to continue with the partial result.
    """

    def __init__(self, message: str, result: Any) -> None:
        super().__init__(message)
        self.result = result


class ProjectError(LiaisonsError):
    """A file or a name does not exist, or cannot be used."""


class FormulaError(LiaisonsError, ValueError):
    """A formula cannot be parsed, or has no value somewhere."""


class PlanError(LiaisonsError, ValueError):
    """A motion cannot be planned, or its goal was not reached."""


class IdentificationError(LiaisonsError, ValueError):
    """Measurements cannot be read, or do not determine what is unknown; ``fit`` is what was reached, if anything."""

    def __init__(self, message: str, fit: Any = None) -> None:
        super().__init__(message)
        self.fit = fit


class SweepError(LiaisonsError, ValueError):
    """A sweep has a bad argument; errors of single cases are recorded in the table."""


class JournalError(SweepError):
    """A journal belongs to another sweep, or is not a journal."""


class ValidityError(LiaisonsError, ValueError):
    """A closed form or a measure was asked for a case that it does not cover."""


def suggestion(name: object, known: Iterable[str]) -> str:
    """Words that suggest the closest of the known names, ``"; did you mean 'x'?"``, else list them.

    :param name: the unknown name.
    :param known: all names.
    """
    known = sorted(known)
    near = difflib.get_close_matches(str(name), known, n=1)
    if near:
        return f"; did you mean {near[0]!r}?"
    return f"; known: {', '.join(known)}" if known else "; there are none"


class ProcessEndedError(SimulationError):
    """The process of an isolated FMU crashed, or exited.

    :ivar how: by which signal, or with which exit status.
    """

    def __init__(self, message: str, how: str) -> None:
        super().__init__(message)
        self.how = how
