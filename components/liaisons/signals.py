"""Signals that move inputs and active coordinates: operators, tables, formulas and functions of time."""

from liaisons.cosim import OperatorFmu, Signal, sampled
from liaisons.interface import operator, tabulated
from liaisons.typed_formulas import formula_signal

__all__ = ["OperatorFmu", "Signal", "formula_signal", "operator", "sampled", "tabulated"]
