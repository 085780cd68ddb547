"""Derivatives of motions, and of equations at a point."""

from liaisons.derivatives.differentiation import Gradient, Sensitivities, gradient, sensitivities
from liaisons.derivatives.linearization import Linearization, linearize
from liaisons.derivatives.motion import DifferentiableMotion
from liaisons.derivatives.subjects import Motion, motion_of

__all__ = [
    "DifferentiableMotion",
    "Gradient",
    "Linearization",
    "Motion",
    "Sensitivities",
    "gradient",
    "linearize",
    "motion_of",
    "sensitivities",
]
