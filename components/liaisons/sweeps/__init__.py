"""Sweeps: one FMU or system, simulated for many cases, on all cores or on many machines."""

from liaisons.sweeps.cases import Cases, grid, sample
from liaisons.sweeps.errors import JournalError, SweepError
from liaisons.sweeps.sweep import sweep
from liaisons.sweeps.table import Table

__all__ = ["Cases", "JournalError", "SweepError", "Table", "grid", "sample", "sweep"]
