"""Derivatives of motions."""

from liaisons.derivatives.differentiation import Gradient, Sensitivities, gradient, sensitivities
from liaisons.derivatives.inputs import input_functions
from liaisons.derivatives.motion import Branch, DifferentiableMotion
from liaisons.derivatives.subjects import Motion, motion_of

__all__ = [
    "Branch",
    "DifferentiableMotion",
    "Gradient",
    "Motion",
    "Sensitivities",
    "gradient",
    "input_functions",
    "motion_of",
    "sensitivities",
]
