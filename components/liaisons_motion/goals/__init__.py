"""What is to move, and where: the goal of a plan or of feedback, and the symbols of its mechanism with their sizes."""

from liaisons_motion.goals.goal import Cost, Goal, Place, duration_range
from liaisons_motion.goals.symbols import GoalSymbols, goal_symbols, range_middle, runge_kutta

__all__ = [
    "Cost",
    "Goal",
    "GoalSymbols",
    "Place",
    "duration_range",
    "goal_symbols",
    "range_middle",
    "runge_kutta",
]
