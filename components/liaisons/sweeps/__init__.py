"""Sweeps: one FMU or system, simulated for many cases, on all cores or on many machines."""

from liaisons.errors import JournalError, SweepError
from liaisons.sweeps.cases import grid, sample
from liaisons.sweeps.sweeping import sweep

__all__ = ["JournalError", "SweepError", "grid", "sample", "sweep"]
