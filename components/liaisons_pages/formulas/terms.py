"""Formulas as trees, which printers for MathML, LaTeX, terminals, SymPy and Modelica walk through.

Nodes hold no brackets: where a printer needs them follows from the kinds of a node and of the one above it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TypeAlias


@dataclass(frozen=True, slots=True)
class Number:
    """A number that is not negative."""

    value: float


@dataclass(frozen=True, slots=True)
class Name:
    """A variable or an abbreviation, by its name; ``"π"`` is that number."""

    name: str


@dataclass(frozen=True, slots=True)
class Negative:
    """A term of an :class:`Addition` that is subtracted."""

    term: Term


@dataclass(frozen=True, slots=True)
class Addition:
    """A sum of at least one term; the terms are no additions."""

    terms: tuple[Term, ...]


@dataclass(frozen=True, slots=True)
class Product:
    """A product of at least two factors."""

    factors: tuple[Term, ...]


@dataclass(frozen=True, slots=True)
class Quotient:
    """A fraction."""

    above: Term
    below: Term


@dataclass(frozen=True, slots=True)
class Power:
    """A power; exponents of 1/2 are a :class:`Root`."""

    base: Term
    exponent: Term


@dataclass(frozen=True, slots=True)
class Root:
    """A square root."""

    inside: Term


@dataclass(frozen=True, slots=True)
class Application:
    """A function of arguments: ``sin``, ``atan2``, ``abs``; ``lt``, ``le``, ``eq``, ``ne`` are 1 where they hold."""

    function: str
    arguments: tuple[Term, ...]


Term: TypeAlias = Number | Name | Negative | Addition | Product | Quotient | Power | Root | Application


@dataclass(frozen=True, slots=True)
class Formula:
    """A term, and the definitions of its abbreviations in their order."""

    term: Term
    where: tuple[tuple[Name, Term], ...]


def summands(term: Term) -> tuple[Term, ...]:
    """Return the terms of a sum; any other term alone."""
    return term.terms if isinstance(term, Addition) else (term,)


def sum_term(terms: Sequence[Term]) -> Term:
    """Return the sum of terms."""
    return terms[0] if len(terms) == 1 and not isinstance(terms[0], Negative) else Addition(tuple(terms) or (ZERO,))


def product_term(factors: Sequence[Term]) -> Term:
    """Return the product of at least one factor."""
    return factors[0] if len(factors) == 1 else Product(tuple(factors))


ZERO = Number(0)
