"""The error after which a shorter step may do."""

from __future__ import annotations

from typing import final

from liaisons.errors import SimulationError


@final
class RefusedError(SimulationError):
    """A step was refused, by an FMU or by an iteration that did not converge; a shorter one may go."""
