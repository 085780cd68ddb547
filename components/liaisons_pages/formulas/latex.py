"""Formulas in LaTeX, as MathJax and matplotlib read it, too."""

import unicodedata
from typing import ClassVar

from liaisons_pages.formulas.notation import Letter
from liaisons_pages.formulas.printing import Printer
from liaisons_pages.formulas.terms import Term

_KNOWN = ["sin", "cos", "tan", "sinh", "cosh", "tanh", "arcsin", "arccos", "arctan", "exp", "ln", "min", "max"]
_WORD = r"\mathrm{"


class LaTeX(Printer):
    """Prints LaTeX; words are upright."""

    plus, minus = " + ", " - "
    fraction, raised = r"\frac{{{}}}{{{}}}".format, "{}^{{{}}}".format
    signs: ClassVar = {
        "∂": r"\partial ",
        "−": "-",
        "·": r" \cdot ",
        "≤": r" \leq ",
        "≥": r" \geq ",
        "⟂": r" \perp ",
        "≠": r" \neq ",
        "=": " = ",
        "<": " < ",
    }

    def letter(self, letter: Letter) -> str:
        text = "".join(map(_latex_character, letter.text)).strip()
        base = f"{_WORD}{text}}}" if letter.is_word else text
        if letter.dots:
            base = rf"\{'d' * letter.dots}ot{{{base}}}"
        return f"{base}_{{{','.join(map(self.letter, letter.below))}}}" if letter.below else base

    def function(self, name: str) -> str:
        return rf"\{name}" if name in _KNOWN else rf"\operatorname{{{name}}}"

    def multiplication_sign(self, before: str, after: str) -> str:
        return r" \, " if _WORD in before + after else " "

    def root(self, inside: Term) -> str:
        return rf"\sqrt{{{self.row(inside)}}}"

    def around(self, left: str, row: str, right: str) -> str:
        return rf"\left{left} {row.strip()} \right{right}"


def _latex_character(character: str) -> str:
    """Return a character in LaTeX: a Greek letter as its command, any other one as it is."""
    if character == "Σ":
        return r"\sum "
    words = unicodedata.name(character).replace("LAMDA", "LAMBDA").split()
    if words[0] != "GREEK" or len(words) != 4 or words[3] == "OMICRON":
        return character
    return f"\\{words[3].title() if words[1] == 'CAPITAL' else words[3].lower()} "
