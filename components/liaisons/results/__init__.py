"""What simulations, sweeps and ensembles give back: named signals with units; knows no symbols and no FMU."""

from liaisons.results.result import IncompleteError, Interrupted, Result

__all__ = ["IncompleteError", "Interrupted", "Result"]
