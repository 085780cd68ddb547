"""Ensembles: one component with many parameter sets and initial states, integrated together in compiled code."""

from liaisons.ensembles.integrating import ensemble
from liaisons.ensembles.members import Members

__all__ = ["Members", "ensemble"]
