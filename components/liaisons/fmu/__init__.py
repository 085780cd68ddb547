"""Equations -> .fmu: generated C with a small runtime, or pythonfmu with CasADi at run time."""

from liaisons.fmu.building import build
from liaisons.fmu.origin import is_of_catalogue

__all__ = ["build", "is_of_catalogue"]
