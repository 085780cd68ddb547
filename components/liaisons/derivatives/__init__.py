"""Derivatives of motions, and of equations at a point."""

from liaisons.derivatives.linearization import Linearization, linearize
from liaisons.derivatives.motion import DifferentiableMotion, Motion, motion_of

__all__ = ["DifferentiableMotion", "Linearization", "Motion", "linearize", "motion_of"]
