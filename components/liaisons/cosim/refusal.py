"""The errors of FMUs that say no."""

from __future__ import annotations

from typing import final

from liaisons.errors import SimulationError


@final
class StatusError(SimulationError):
    """An FMU returned Discard, Error or Fatal.

    :ivar status: which of them, as FMI numbers it.
    """

    def __init__(self, message: str, status: int) -> None:
        super().__init__(message)
        self.status = status


@final
class RefusedError(SimulationError):
    """A step was refused, by an FMU or by an iteration that did not converge; a shorter one may go."""
