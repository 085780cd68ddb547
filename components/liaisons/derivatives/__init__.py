"""Derivatives of motions: of the steps that were taken, forward and backwards."""

from liaisons.derivatives.motion import DifferentiableMotion, motion_of

__all__ = ["DifferentiableMotion", "motion_of"]
