"""Examination of a component: declarations, energies, equations and closed form against each other."""

from liaisons_motion.examination.examining import Examination, check_component
from liaisons_motion.examination.repairs import Cause

__all__ = ["Cause", "Examination", "check_component"]
