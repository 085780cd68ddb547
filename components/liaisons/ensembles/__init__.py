"""Ensembles: one component with many parameter sets and initial states, integrated together in compiled code."""

from liaisons.ensembles.integrating import ensemble

__all__ = ["ensemble"]
