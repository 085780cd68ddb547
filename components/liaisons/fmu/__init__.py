"""Equations -> .fmu: generated C with a small runtime, or pythonfmu with CasADi at run time."""

from liaisons.fmu.building import build

__all__ = ["build"]
