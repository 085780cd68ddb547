"""Operators that find σ(t): what is wanted of a mechanism in, motion and proof out."""

from liaisons.operators.goals import planned
from liaisons.operators.planning import plan
from liaisons.operators.plans import Plan
from liaisons.operators.problems import PlanError

__all__ = ["Plan", "PlanError", "plan", "planned"]
