"""Operators that find σ(t): from a goal for a mechanism to its motion, and the proof of it."""

from __future__ import annotations

from liaisons.errors import PlanError
from liaisons.operators.controllers import Controller
from liaisons.operators.holding import hold
from liaisons.operators.planning import plan, planned
from liaisons.operators.plans import Plan

__all__ = ["Controller", "Plan", "PlanError", "hold", "plan", "planned"]
