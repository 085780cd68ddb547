"""Formulas as expressions of SymPy, an optional package."""

from typing import Any

from liaisons.errors import ProjectError
from liaisons_pages.formulas import terms as kinds
from liaisons_pages.formulas.terms import Formula, Term

_NAMES = {"abs": "Abs", "min": "Min", "max": "Max", "ceil": "ceiling"}
_RELATIONS = {"lt": "Lt", "le": "Le", "eq": "Eq", "ne": "Ne"}


def sympy_package() -> Any:
    """Return the module ``sympy``.

    :raises ProjectError: if it is missing.
    """
    try:
        import sympy
    except ImportError:
        raise ProjectError("equations(...).sympy() needs SymPy; pip install 'liaisons[sympy]'") from None
    return sympy


def equation(left: str, right: Formula) -> Any:
    """Return the equation of a variable, or of ``"0"``, and a formula."""
    sympy = sympy_package()
    return sympy.Eq(sympy.Symbol(left, real=True) if left != "0" else 0, expression(right), evaluate=False)


def expression(formula: Formula) -> Any:  # noqa: C901 - one for each kind
    """Return a formula without abbreviations; its symbols are real and have the names of the variables."""
    sympy = sympy_package()
    values = {"π": sympy.pi}

    def value(term: Term) -> Any:  # noqa: C901, PLR0911
        match term:
            case kinds.Number(number):
                return sympy.sympify(number)
            case kinds.Name(name):
                return values[name] if name in values else sympy.Symbol(name, real=True)
            case kinds.Negative(subtracted):
                return -value(subtracted)
            case kinds.Addition(terms):
                return sympy.Add(*map(value, terms))
            case kinds.Product(factors):
                return sympy.Mul(*map(value, factors))
            case kinds.Quotient(above, below):
                return value(above) / value(below)
            case kinds.Power(base, exponent):
                return value(base) ** value(exponent)
            case kinds.Root(inside):
                return sympy.sqrt(value(inside))
            case kinds.Application(function, arguments):
                x = map(value, arguments)
                if function in _RELATIONS:  # 1 where it holds
                    return sympy.Piecewise((1, getattr(sympy, _RELATIONS[function])(*x)), (0, True))
                return getattr(sympy, _NAMES.get(function, function))(*x)

    for name, term in formula.where:
        values[name.name] = value(term)
    return value(formula.term)
