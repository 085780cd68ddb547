"""Equations as people write them: expressions as trees of terms, and their printers."""

from liaisons.formulas.displayed import DisplayedEquations, of_component, of_model
from liaisons.formulas.laws import LAWS
from liaisons.formulas.mathml import MathML
from liaisons.formulas.modelica import UnsupportedError, modelica_expression
from liaisons.formulas.notation import Notation
from liaisons.formulas.terms import Formula, Term
from liaisons.formulas.writing import formula

__all__ = [
    "LAWS",
    "DisplayedEquations",
    "Formula",
    "MathML",
    "Notation",
    "Term",
    "UnsupportedError",
    "formula",
    "modelica_expression",
    "of_component",
    "of_model",
]
