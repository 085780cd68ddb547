"""What simulations, sweeps and ensembles give back: named signals with units; knows no symbols and no FMU."""

from liaisons.errors import IncompleteError, Interrupted
from liaisons.results.result import Result

__all__ = ["IncompleteError", "Interrupted", "Result"]
