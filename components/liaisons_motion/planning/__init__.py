"""Planning: from a goal for a mechanism to the motion σ(t) of its operator, and the verdicts on it."""

from __future__ import annotations

from liaisons_motion.planning.planning import plan, plan_from_file
from liaisons_motion.planning.plans import Plan

__all__ = ["Plan", "plan", "plan_from_file"]
