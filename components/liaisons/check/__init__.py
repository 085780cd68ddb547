"""Result and reference in, verdict out: errors, convergence orders, and tables of claims."""

from liaisons.check.measures import max_error, slope
from liaisons.check.verdicts import Verdict, table, verdict

__all__ = ["Verdict", "max_error", "slope", "table", "verdict"]
