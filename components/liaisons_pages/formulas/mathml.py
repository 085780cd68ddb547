"""Formulas in MathML Core."""

import re
from html import escape

from liaisons_pages.formulas.notation import Letter
from liaisons_pages.formulas.printing import Printer
from liaisons_pages.formulas.terms import Number, Quotient, Term

_TIMES = "<mo>&#x2062;</mo>"
_TAG = re.compile(r"<[^>]+>|&#x206[12];")
# A word, which is a name of several letters, at the end of a factor or at its beginning.
_WORD_LAST = re.compile(r"<mi>\w\w+</mi>(?:</\w+>|<mo>[˙¨]</mo>)*$")
_WORD_FIRST = re.compile(r"(?:<\w+[^>]*>)*<mi>\w\w+</mi>")


class MathML(Printer):
    """Prints MathML Core."""

    plus, minus, between, space = "<mo>+</mo>", "<mo>−</mo>", "", '<mspace width="0.2em"></mspace>'
    digits, grouped = "<mn>{}</mn>".format, "<mrow>{}</mrow>".format
    fraction, raised = "<mfrac><mrow>{}</mrow><mrow>{}</mrow></mfrac>".format, "<msup>{}{}</msup>".format
    around = "<mrow><mo>{}</mo>{}<mo>{}</mo></mrow>".format
    applied = "<mrow>{}<mo>&#x2061;</mo>{}</mrow>".format

    def width(self, term: Term) -> int:
        """Return the number of characters of a term."""
        return len(_TAG.sub("", self.row(term)))

    def letter(self, letter: Letter) -> str:
        base = self.digits(letter.text) if letter.text.isdecimal() else self.function(letter.text)
        if letter.dots:
            base = f"<mover>{base}<mo>{'˙¨'[letter.dots - 1]}</mo></mover>"
        below = [self.letter(x) for x in letter.below]
        if not below:
            return base
        return f"<msub>{base}{below[0] if len(below) == 1 else self.grouped(self.sign(',').join(below))}</msub>"

    def function(self, name: str) -> str:
        return f"<mi>{escape(name)}</mi>"

    def sign(self, sign: str) -> str:
        return f"<mo>{escape(sign)}</mo>"

    def multiplication_sign(self, before: str, after: str) -> str:
        """Return an invisible sign, with a space beside words."""
        return _TIMES + (self.space if _WORD_LAST.search(before) or _WORD_FIRST.match(after) else "")

    def root(self, inside: Term) -> str:
        return f"<msqrt>{self.row(inside)}</msqrt>"

    def exponent(self, exponent: Term) -> str:
        row = self.row(exponent)
        return row if isinstance(exponent, Number | Quotient) else self.grouped(row)
