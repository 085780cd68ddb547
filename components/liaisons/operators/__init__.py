"""Operators that find σ(t): from a goal for a mechanism to its motion, and the proof of it."""

from __future__ import annotations

import warnings
from typing import Any

from liaisons.errors import PlanError
from liaisons.operators.controllers import Controller
from liaisons.operators.holding import hold
from liaisons.operators.planning import plan, planned
from liaisons.operators.plans import Plan

__all__ = ["Controller", "Plan", "PlanError", "hold", "plan", "planned"]


def __getattr__(name: str) -> Any:
    if name != "Held":
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    warnings.warn("liaisons.Held is called liaisons.Controller", DeprecationWarning, stacklevel=3)
    return Controller
