"""Equations as people write them: expressions as trees of terms, and their printers."""

from liaisons_pages.formulas.displayed import DisplayedEquations, of_component, of_model
from liaisons_pages.formulas.laws import LAWS
from liaisons_pages.formulas.mathml import MathML
from liaisons_pages.formulas.modelica import UnsupportedError, modelica_expression
from liaisons_pages.formulas.notation import Notation
from liaisons_pages.formulas.terms import Formula, Term
from liaisons_pages.formulas.writing import formula

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
