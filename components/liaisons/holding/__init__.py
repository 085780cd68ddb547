"""Holding: a controller that brings a mechanism to a goal, or back to a planned motion, by feedback."""

from __future__ import annotations

from liaisons.holding.controllers import Controller
from liaisons.holding.holding import hold

__all__ = ["Controller", "hold"]
