"""Operators that find σ(t): what is wanted of a mechanism in, motion and proof out."""

from liaisons.operators.goals import planned
from liaisons.operators.held import Held
from liaisons.operators.holding import hold
from liaisons.operators.planning import plan
from liaisons.operators.plans import Plan
from liaisons.operators.problems import PlanError

__all__ = ["Held", "Plan", "PlanError", "hold", "plan", "planned"]
