"""Printer of formulas as Modelica expressions."""

import math
import re
from collections.abc import Callable

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

_CALLED = re.compile(r"a?(sin|cos|tan)|(sin|cos|tan)h|atan2|exp|log|abs|sign|floor|ceil|min|max")
_WRITTEN = {
    "fmod": "rem({0}, {1})",
    "or": "max({0}, {1})",
    "asinh": "log({0} + sqrt(({0})^2 + 1))",
    "acosh": "log({0} + sqrt(({0})^2 - 1))",
    "atanh": "log((1 + {0})/(1 - ({0})))/2",
}
_RELATIONS = {
    "lt": "{0} < {1}",
    "le": "{0} <= {1}",
    # Real numbers are not compared by == outside of functions.
    "eq": "abs({0} - ({1})) <= 0",
    "ne": "abs({0} - ({1})) > 0",
}


class UnsupportedError(Exception):
    """A function that the language does not have."""


def modelica_expression(term: Term, write_name: Callable[[str], str], *, events: bool = True) -> str:  # noqa: C901, PLR0911 - by kind
    """Return the Modelica expression of a term.

    :param write_name: returns what a name is written as.
    :param events: whether relations are events.
    :raises UnsupportedError: for a function that Modelica does not have.
    """

    def factor(part: Term, *bracketed: type[Term]) -> str:
        text = modelica_expression(part, write_name, events=events)
        return f"({text})" if isinstance(part, bracketed) else text

    match term:
        case Number(value):
            if not math.isfinite(value):
                raise UnsupportedError(str(value))
            return repr(value if isinstance(value, int) else float(value))
        case Name(name):
            return repr(math.pi) if name == "π" else write_name(name)
        case Addition() | Negative():
            parts = summands(term)
            signs = [isinstance(part, Negative) for part in parts]
            texts = [factor(p.term, Addition) if isinstance(p, Negative) else factor(p) for p in parts]
            first, *further = zip(signs, texts, strict=True)
            return "".join(["-" * first[0] + first[1], *(f" {'-' if sign else '+'} {text}" for sign, text in further)])
        case Product(factors):
            return "*".join(factor(part, Addition) for part in factors)
        case Quotient(above, below):
            return f"{factor(above, Addition)}/{factor(below, Addition, Product, Quotient)}"
        case Root(inside):
            return f"sqrt({factor(inside)})"
        case Power(base, exponent):
            return f"{factor(base, Addition, Product, Quotient, Power)}^{factor(exponent, Addition, Product, Quotient)}"
        case Application(function, arguments):
            texts = [*map(factor, arguments)]
            if function in _RELATIONS:
                relation = _RELATIONS[function].format(*texts)
                return f"(if {relation if events else f'noEvent({relation})'} then 1 else 0)"
            if function in _WRITTEN:
                return _WRITTEN[function].format(*texts)
            if not _CALLED.fullmatch(function):
                raise UnsupportedError(function)
            return f"{function}({', '.join(texts)})"
