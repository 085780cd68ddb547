"""Right-hand sides of motions as expressions and in C, for ensembles, derivatives, environments and fits."""

from liaisons_motion.right_hand_sides.methods import METHODS, Tableau
from liaisons_motion.right_hand_sides.models import ContinuousModel, continuous_model
from liaisons_motion.right_hand_sides.right_hand_side import DEGREE, CArray, RightHandSide
from liaisons_motion.right_hand_sides.step_code import StepCode, c_function
from liaisons_motion.right_hand_sides.steps import LANES, Advance, compiled_advance

__all__ = [
    "DEGREE",
    "LANES",
    "METHODS",
    "Advance",
    "CArray",
    "ContinuousModel",
    "RightHandSide",
    "StepCode",
    "Tableau",
    "c_function",
    "compiled_advance",
    "continuous_model",
]
