"""Derivatives of motions, and of equations at a point."""

from liaisons.derivatives.linearization import Linearization, linearize
from liaisons.derivatives.motion import DifferentiableMotion, motion_of

__all__ = ["DifferentiableMotion", "Linearization", "linearize", "motion_of"]
