"""Ensembles: one component with many parameter sets and initial states, integrated together in compiled code."""

from liaisons_motion.ensembles.integrating import ensemble
from liaisons_motion.ensembles.members import Members, model_with_operators

__all__ = ["Members", "ensemble", "model_with_operators"]
