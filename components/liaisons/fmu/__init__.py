"""Equations -> .fmu: generated C with a small runtime, or pythonfmu with CasADi at run time."""

from liaisons.fmu.building import build
from liaisons.fmu.jumps import jump_effects
from liaisons.fmu.layout import index_ranges, start_vectors
from liaisons.fmu.origin import is_of_catalogue
from liaisons.fmu.reference_results import Trajectory, trajectory

__all__ = [
    "Trajectory",
    "build",
    "index_ranges",
    "is_of_catalogue",
    "jump_effects",
    "start_vectors",
    "trajectory",
]
