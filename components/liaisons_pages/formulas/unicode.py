"""Formulas in Unicode, for terminals."""

import textwrap
import unicodedata
from itertools import pairwise
from typing import ClassVar

from liaisons_pages.formulas.notation import Letter
from liaisons_pages.formulas.printing import Printer
from liaisons_pages.formulas.terms import Addition, Name, Number, Product, Quotient, Term

_ABOVE = str.maketrans("0123456789-−+()Tn", "⁰¹²³⁴⁵⁶⁷⁸⁹⁻⁻⁺⁽⁾ᵀⁿ")
_BELOW = str.maketrans("0123456789aehijklmnoprstuvxβγρφχ", "₀₁₂₃₄₅₆₇₈₉ₐₑₕᵢⱼₖₗₘₙₒₚᵣₛₜᵤᵥₓᵦᵧᵨᵩᵪ")
_FRACTIONS = {"1/2": "½", "1/3": "⅓", "2/3": "⅔", "1/4": "¼", "3/4": "¾", "1/6": "⅙", "1/8": "⅛", "3/8": "⅜"}
_DOTS, _BEHIND = ("", "\u0307", "\u0308"), ("", "˙", "¨")
FIRM = "\u00a0"
"""Blank at which no line breaks."""
SOFT = "\u202f"
"""Blank at which a line breaks where there is no other way."""


def wrapped_lines(text: str, columns: int) -> list[str]:
    """Return the lines of a text, its special blanks replaced by plain ones."""
    lines = list[str]()
    for line in textwrap.wrap(text, columns, break_long_words=False):
        lines += [line] if width(line) <= columns else textwrap.wrap(line.replace(SOFT, " "), columns)
    return [line.replace(FIRM, " ").replace(SOFT, " ") for line in lines]


def width(text: str) -> int:
    """Return the number of columns that a text takes in a terminal."""
    return sum(not unicodedata.combining(character) for character in text)


class Unicode(Printer):
    """Prints for a terminal: ``½ m l² θ̇²``."""

    plus, minus, space = f" +{FIRM}", f" −{FIRM}", FIRM
    function = "{}".format
    signs: ClassVar = {",": ", ", "≤": " ≤ ", "≠": " ≠ ", "=": " = ", "<": " < "}

    def terms(self, term: Term) -> tuple[str, ...]:
        first, *further = super().terms(term)
        return first.replace(self.minus, "−", 1) if first.startswith(" ") else first, *further

    def letter(self, letter: Letter) -> str:
        dots = (_BEHIND if letter.is_word else _DOTS)[letter.dots]
        text = unicodedata.normalize("NFC", letter.text + dots)
        if not letter.below:
            return text
        below = ",".join(map(self.letter, letter.below))
        small = below.translate(_BELOW)
        is_small = not any(x.is_word for x in letter.below) and not set(below) & set(small)
        return text + (small if is_small else f"_{below}")

    def product(self, factors: tuple[Term, ...]) -> str:
        """Return letters with a blank between them, words with a dot."""
        rows = [self.factor(factor, Addition, Product, Quotient) for factor in factors]
        words = [isinstance(factor, Name) and self._has_word(self.notation[factor.name]) for factor in factors]
        gaps = (f"{SOFT}·{FIRM}" if any(pair) else SOFT for pair in pairwise(words))
        return rows[0] + "".join(gap + row for gap, row in zip(gaps, rows[1:], strict=True))

    def factor(self, term: Term, *kinds: type[Term]) -> str:
        row = self.row(term)
        return row if row in _FRACTIONS.values() else super().factor(term, *kinds)

    def quotient(self, above: Term, below: Term) -> str:
        over = self.factor(above, Addition, Quotient)
        return self.fraction(over, self.factor(below, Addition, Product, Quotient))

    def fraction(self, above: str, below: str) -> str:
        text = f"{above}/{below}"
        return _FRACTIONS.get(text, text)

    def root(self, inside: Term) -> str:
        row = self.row(inside)
        return f"√{row if isinstance(inside, Name | Number) else self.around('(', row, ')')}"

    def exponent(self, exponent: Term) -> str:
        row = self.row(exponent)
        return row if isinstance(exponent, Name | Number) else self.around("(", row, ")")

    def raised(self, base: str, above: str) -> str:
        small = above.translate(_ABOVE)
        return base + (f"^{above}" if set(above) & set(small) else small)

    def around(self, left: str, row: str, right: str) -> str:
        return left + row.strip() + right

    def _has_word(self, letter: Letter) -> bool:
        return letter.is_word or any(map(self._has_word, letter.below))
