"""Sweeps: one FMU or system, simulated for many cases, on all cores or on many machines."""

from liaisons.errors import JournalError, SweepError
from liaisons_tools.sweeps.cases import grid, sample
from liaisons_tools.sweeps.sweeping import sweep

__all__ = ["JournalError", "SweepError", "grid", "sample", "sweep"]
