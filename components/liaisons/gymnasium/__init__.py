"""Environments of Gymnasium, an optional package: mechanisms and systems to be learned."""

from __future__ import annotations

from liaisons.errors import ProjectError

try:
    import gymnasium as _
except ImportError:
    raise ProjectError("liaisons.gymnasium needs Gymnasium; pip install 'liaisons[gymnasium]'") from None

from liaisons.gymnasium.environment import Environment, Optimum
from liaisons.gymnasium.registered import register_environments
from liaisons.gymnasium.task import Signals, Task
from liaisons.gymnasium.vector import VectorEnvironment

__all__ = ["Environment", "Optimum", "Signals", "Task", "VectorEnvironment"]

register_environments()
