"""Derivatives of motions."""

from liaisons_motion.derivatives.differentiation import Gradient, Sensitivities, gradient, sensitivities
from liaisons_motion.derivatives.inputs import input_functions
from liaisons_motion.derivatives.motion import Branch, DifferentiableMotion
from liaisons_motion.derivatives.subjects import Motion, motion_of

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
