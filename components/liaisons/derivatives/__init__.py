"""Derivatives of motions, and of equations at a point."""

from liaisons.derivatives.linearization import Linearization, linearize

__all__ = ["Linearization", "linearize"]
