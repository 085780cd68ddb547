"""Holding: a controller that brings a mechanism to a goal, or back to a planned motion, by feedback, and observers."""

from __future__ import annotations

from liaisons.holding.controllers import Controller
from liaisons.holding.holding import hold
from liaisons.holding.observers import Observer, observe

__all__ = ["Controller", "Observer", "hold", "observe"]
