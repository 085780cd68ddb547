"""Equations as people write them: expressions as trees of terms, and their printers."""

from liaisons.formulas.laws import LAWS, Law
from liaisons.formulas.notation import Notation
from liaisons.formulas.terms import Formula, Term
from liaisons.formulas.writing import formula

__all__ = ["LAWS", "Formula", "Law", "Notation", "Term", "formula"]
