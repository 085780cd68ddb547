"""Sums of products, in which terms cancel or add up to fewer: a b c - c (a b), and x sin² + x cos² = x.

Lagrange's equations, d/dt ∂L/∂q̇ - ∂L/∂q, subtract much of what they differentiate before.  For a pendulum, whose
inertia is m l² (sin² + cos²), that is a fifth of the time and more, elsewhere little; rounding errors are the same
(``benchmarks/rewriting.py``).  Only short sums of short products are expanded: the work is proportional to the
number of operations.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import final

import casadi as ca

from liaisons.expressions.operations import Instruction

_MOST_TERMS = 12
_MOST_FACTORS = 8

ScaledNode = tuple[float, int]
"""±2ⁿ times a node, by its number."""

Monomial = tuple[int, ...]
"""Numbers of the nodes that are multiplied, none of them a product, in ascending order."""


@final
@dataclass(frozen=True, slots=True)
class Expansions:
    """Sums and products among nodes, expanded."""

    nodes: Sequence[Instruction]
    _terms: dict[int, tuple[ScaledNode, ...]] = field(default_factory=dict)
    _factors: dict[int, Monomial] = field(default_factory=dict)

    def shortened_sum(self, first: ScaledNode, second: ScaledNode) -> list[tuple[float, Monomial]] | None:
        """Scaled products of a sum if they are fewer than the terms of both nodes; else None."""
        terms = [(outer * inner, number) for outer, number in (first, second) for inner, number in self.terms(number)]
        if len(terms) > _MOST_TERMS:
            return None
        left: dict[Monomial, float] = {}
        for scale, number in terms:
            product = self.factors(number)
            left[product] = left.get(product, 0.0) + scale
        left = {product: scale for product, scale in left.items() if scale}
        while self._cancel_expanded(left) or self._unite_squares(left):
            pass
        return [(scale, product) for product, scale in left.items()] if len(left) < len(terms) else None

    def terms(self, number: int) -> tuple[ScaledNode, ...]:
        """Terms of a node as a sum; itself if there are too many."""
        if number not in self._terms:
            terms = self._split_into_terms(number)
            self._terms[number] = terms if len(terms) <= _MOST_TERMS else ((1.0, number),)
        return self._terms[number]

    def _split_into_terms(self, number: int) -> tuple[ScaledNode, ...]:
        """Terms of a node as a sum."""
        node = self.nodes[number]
        if node.operation in (ca.OP_ADD, ca.OP_SUB):
            first, second = (self.terms(argument) for argument in node.arguments)
            sign = 1.0 if node.operation == ca.OP_ADD else -1.0
            return (*first, *((sign * scale, term) for scale, term in second))
        if node.operation in (ca.OP_TWICE, ca.OP_NEG):
            outer = 2.0 if node.operation == ca.OP_TWICE else -1.0
            return tuple((outer * scale, term) for scale, term in self.terms(node.arguments[0]))
        return ((1.0, number),)

    def factors(self, number: int) -> Monomial:
        """Factors of a node as a product; itself if there are too many."""
        if number not in self._factors:
            node, factors = self.nodes[number], (number,)
            if node.operation in (ca.OP_MUL, ca.OP_SQ):
                factors = self.product_factors(node.arguments[0], node.arguments[-1])
            self._factors[number] = factors if len(factors) <= _MOST_FACTORS else (number,)
        return self._factors[number]

    def product_factors(self, first: int, second: int) -> Monomial:
        """Factors of the product of two nodes."""
        return tuple(sorted(self.factors(first) + self.factors(second)))

    def _cancel_expanded(self, left: dict[Monomial, float]) -> bool:
        """Remove x (a + b), -x a and -x b, if all of them are there; return whether they were."""
        for product, scale in left.items():
            for factor in set(product):
                pieces = self.terms(factor)
                if len(pieces) == 1 or len(pieces) >= len(left):
                    continue
                rest = _without(product, factor)
                expanded = {tuple(sorted((*rest, *self.factors(piece)))): scale * inner for inner, piece in pieces}
                if len(expanded) == len(pieces) and all(left.get(piece) == -expanded[piece] for piece in expanded):
                    for monomial in (product, *expanded):
                        del left[monomial]
                    return True
        return False

    def _unite_squares(self, left: dict[Monomial, float]) -> bool:
        """Replace x sin² + x cos² of one angle by x, if both are there; return whether they were."""
        for product, scale in left.items():
            for factor in set(product):
                node = self.nodes[factor]
                if node.operation != ca.OP_SIN or product.count(factor) < 2:
                    continue
                rest = _without(_without(product, factor), factor)
                for other, equal in left.items():
                    if equal == scale and self._has_square_of_cosine(other, rest, node.arguments):
                        del left[product], left[other]
                        left[rest] = left.get(rest, 0.0) + scale
                        return True
        return False

    def _has_square_of_cosine(self, product: Monomial, rest: Monomial, angle: tuple[int, ...]) -> bool:
        """Whether a product is the rest times cos² of the angle."""
        remaining = Counter(product)
        remaining.subtract(rest)
        squares = [factor for factor, count in remaining.items() if count]
        return (
            len(squares) == 1 and remaining[squares[0]] == 2 and self.nodes[squares[0]] == Instruction(ca.OP_COS, angle)
        )


def _without(product: Monomial, factor: int) -> Monomial:
    """Product without one of its factors."""
    index = product.index(factor)
    return product[:index] + product[index + 1 :]
