"""Formulas as people type them, ``1 + 0.1*sin(5*t)``: as CasADi expressions, and as signals."""

from liaisons.typed_formulas.formulas import formula
from liaisons.typed_formulas.signals import formula_signal
from liaisons.typed_formulas.time_functions import pulse_instants, time_function

__all__ = ["formula", "formula_signal", "pulse_instants", "time_function"]
