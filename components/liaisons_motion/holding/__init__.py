"""Holding: a controller that brings a mechanism to a goal, or back to a planned motion, by feedback, and observers."""

from __future__ import annotations

from liaisons_motion.holding.controllers import Controller
from liaisons_motion.holding.holding import hold
from liaisons_motion.holding.observers import Observer, observe
from liaisons_motion.holding.state_spaces import from_control

__all__ = ["Controller", "Observer", "from_control", "hold", "observe"]
