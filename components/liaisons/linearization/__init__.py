"""Linear systems of deviations from a point: of the equations of one FMU, and of the present point of a run."""

from __future__ import annotations

from liaisons.linearization.fmu_equations import FmuEquations
from liaisons.linearization.runs import linearization_of_run

__all__ = ["FmuEquations", "linearization_of_run"]
