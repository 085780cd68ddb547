"""Planning: from a goal for a mechanism to the motion σ(t) of its operator, and the verdicts on it."""

from __future__ import annotations

from liaisons.planning.planning import plan, plan_from_file
from liaisons.planning.plans import Plan

__all__ = ["Plan", "plan", "plan_from_file"]
