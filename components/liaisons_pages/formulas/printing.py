"""Base of all printers of formulas: walks through terms and sets brackets.

What a kind of text writes around its parts is a template, or a method where it depends on them.
"""

from abc import ABC, abstractmethod
from collections.abc import Mapping
from itertools import pairwise
from typing import ClassVar

from liaisons_pages.formulas.notation import Letter, Notation
from liaisons_pages.formulas.terms import (
    Addition,
    Application,
    Name,
    Negative,
    Number,
    Power,
    Product,
    Quotient,
    Root,
    Term,
    summands,
)

_SPELLED = {"asin": "arcsin", "acos": "arccos", "atan": "arctan", "log": "ln"}


class Printer(ABC):
    """Printer of terms as text of one kind; abstract."""

    plus: ClassVar[str]
    minus: ClassVar[str]
    space: ClassVar[str] = " "
    between: ClassVar[str] = " "
    signs: ClassVar[Mapping[str, str]] = {}
    digits = grouped = "{}".format
    applied = "{}{}".format

    def __init__(self, notation: Notation) -> None:
        self.notation = notation

    def name(self, name: str) -> str:
        """Return the letter of a variable."""
        return self.letter(self.notation[name])

    def terms(self, term: Term) -> tuple[str, ...]:
        """Return the terms of a sum, each with its sign; a line may break between them."""
        return tuple(
            self.minus + self.factor(t.term, Addition)
            if isinstance(t, Negative)
            else (self.plus if i else "") + self.row(t)
            for i, t in enumerate(summands(term))
        )

    def row(self, term: Term) -> str:  # noqa: PLR0911 - one for each kind
        """Return a term on one line."""
        match term:
            case Number(value):
                return self.number(value)
            case Name(name):
                return self.name(name)
            case Addition() | Negative():
                return "".join(self.terms(term))
            case Product(factors):
                return self.product(factors)
            case Quotient(above, below):
                return self.quotient(above, below)
            case Root(inside):
                return self.root(inside)
            case Power(base, exponent):
                return self._power(base, exponent)
            case Application(function, arguments):
                return self._application(function, arguments)

    def factor(self, term: Term, *kinds: type[Term]) -> str:
        """Return a term, in brackets if it is of one of these kinds."""
        row = self.row(term)
        return self.around("(", row, ")") if isinstance(term, kinds) else row

    def number(self, value: float) -> str:
        """Return a number that is not negative."""
        mantissa, _, exponent = f"{value!r}".partition("e")
        if not exponent:
            return self.digits(mantissa)
        return (
            f"{self.digits(mantissa)}{self.sign('·')}{self.raised(self.digits('10'), self.digits(str(int(exponent))))}"
        )

    def quotient(self, above: Term, below: Term) -> str:
        return self.fraction(self.row(above), self.row(below))

    def exponent(self, exponent: Term) -> str:
        return self.row(exponent)

    def sign(self, sign: str) -> str:
        return self.signs.get(sign, sign)

    def _power(self, base: Term, exponent: Term) -> str:
        above = self.exponent(exponent)
        if isinstance(base, Application) and base.function in ("sin", "cos") and exponent == Number(2):
            return self._function_call(self.raised(self.function(base.function), above), base.arguments)
        return self.raised(self.row(base) if isinstance(base, Name) else self.around("(", self.row(base), ")"), above)

    def _application(self, function: str, arguments: tuple[Term, ...]) -> str:
        inner = [self.row(argument) for argument in arguments]
        if function == "abs":
            return self.around("|", inner[0], "|")
        if relation := {"lt": "<", "le": "≤", "eq": "=", "ne": "≠"}.get(function):
            return self.around("[", self.sign(relation).join(inner), "]")
        return self._function_call(self.function(_SPELLED.get(function, function)), arguments)

    def _function_call(self, function: str, arguments: tuple[Term, ...]) -> str:
        """Return a function with its arguments."""
        inner = self.sign(",").join(map(self.row, arguments))
        is_name = len(arguments) == 1 and isinstance(arguments[0], Name)
        return self.applied(function, self.space + inner if is_name else self.around("(", inner, ")"))

    @abstractmethod
    def letter(self, letter: Letter) -> str:
        """Return a letter with its dots and subscripts."""

    @abstractmethod
    def function(self, name: str) -> str:
        """Return the name of a function."""

    def product(self, factors: tuple[Term, ...]) -> str:
        """Return factors with signs of multiplication between them."""
        rows = [self.factor(factor, Addition, Product) for factor in factors]
        return rows[0] + "".join(self.multiplication_sign(*pair) + pair[1] for pair in pairwise(rows))

    def multiplication_sign(self, before: str, after: str) -> str:  # noqa: ARG002 - of both
        """Return what stands between two factors."""
        return self.space

    @abstractmethod
    def fraction(self, above: str, below: str) -> str: ...

    @abstractmethod
    def root(self, inside: Term) -> str: ...

    @abstractmethod
    def raised(self, base: str, above: str) -> str:
        """Return a base with its exponent."""

    @abstractmethod
    def around(self, left: str, row: str, right: str) -> str:
        """Return a row between brackets."""
