"""Verdicts on results: errors, orders of convergence, and tables of claims."""

from liaisons.check.comparison import Comparison, Difference, compare
from liaisons.check.flows import hamiltonian_flow
from liaisons.check.measures import crossings, frequencies, max_error, slope
from liaisons.check.verdicts import Verdict, table, verdict

__all__ = [
    "Comparison",
    "Difference",
    "Verdict",
    "compare",
    "crossings",
    "frequencies",
    "hamiltonian_flow",
    "max_error",
    "slope",
    "table",
    "verdict",
]
