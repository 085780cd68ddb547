"""Sums of products, in which terms cancel or add up to fewer: a b c - c (a b), and x sin² + x cos² = x.

Lagrange's equations, d/dt ∂L/∂q̇ - ∂L/∂q, subtract much of what they differentiate before.  For a pendulum, whose
inertia is m l² (sin² + cos²), that is a fifth of the time and more, elsewhere little; rounding errors are the same
(``benchmarks/rewriting.py``).  Short sums of short products are looked at, so that the work stays in proportion to the
number of operations.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import final

import casadi as ca

from liaisons.expressions.operations import Instruction

_MOST_TERMS = 12
_MOST_FACTORS = 8

Scaled = tuple[float, int]
"""A number that is not calculated yet: ±2ⁿ times a node."""

Product = tuple[int, ...]
"""Factors, which are no products: numbers of nodes in ascending order."""


@final
@dataclass(frozen=True, slots=True)
class Sums:
    """Knows the sums and products among nodes."""

    nodes: Sequence[Instruction]
    _terms: dict[int, tuple[Scaled, ...]] = field(default_factory=dict)
    _factors: dict[int, Product] = field(default_factory=dict)

    def shortened(self, first: Scaled, second: Scaled) -> list[tuple[float, Product]] | None:
        """Products that add up to two numbers with fewer terms than these have now; None if there are none."""
        terms = [(outer * inner, number) for outer, number in (first, second) for inner, number in self.terms(number)]
        if len(terms) > _MOST_TERMS:
            return None
        left: dict[Product, float] = {}
        for scale, number in terms:
            product = self.factors(number)
            left[product] = left.get(product, 0.0) + scale
        left = {product: scale for product, scale in left.items() if scale}
        while self._cancel(left) or self._unite_squares(left):
            pass
        return [(scale, product) for product, scale in left.items()] if len(left) < len(terms) else None

    def terms(self, number: int) -> tuple[Scaled, ...]:
        """What a node is the sum of."""
        found = self._terms.get(number)
        if found is None:
            found = self._split(number)
            if len(found) > _MOST_TERMS:
                found = ((1.0, number),)
            self._terms[number] = found
        return found

    def _split(self, number: int) -> tuple[Scaled, ...]:
        node = self.nodes[number]
        if node.is_a(ca.OP_ADD) or node.is_a(ca.OP_SUB):
            first, second = (self.terms(argument) for argument in node.arguments)
            sign = 1.0 if node.is_a(ca.OP_ADD) else -1.0
            return (*first, *((sign * scale, term) for scale, term in second))
        if node.is_a(ca.OP_TWICE) or node.is_a(ca.OP_NEG):
            outer = 2.0 if node.is_a(ca.OP_TWICE) else -1.0
            return tuple((outer * scale, term) for scale, term in self.terms(node.arguments[0]))
        return ((1.0, number),)

    def factors(self, number: int) -> Product:
        """What a node is the product of."""
        found = self._factors.get(number)
        if found is None:
            node, found = self.nodes[number], (number,)
            if node.is_a(ca.OP_MUL) or node.is_a(ca.OP_SQ):
                together = self.factors_of(node.arguments[0], node.arguments[-1])
                found = together if len(together) <= _MOST_FACTORS else found
            self._factors[number] = found
        return found

    def factors_of(self, first: int, second: int) -> Product:
        """The factors of two nodes together."""
        return tuple(sorted(self.factors(first) + self.factors(second)))

    def _cancel(self, left: dict[Product, float]) -> bool:
        """Take out x (a + b) together with -x a and -x b."""
        for product, scale in left.items():
            for factor in set(product):
                pieces = self.terms(factor)
                if len(pieces) == 1 or len(pieces) >= len(left):
                    continue
                others = _without(product, factor)
                expanded = {tuple(sorted((*others, *self.factors(piece)))): scale * inner for inner, piece in pieces}
                if len(expanded) == len(pieces) and all(left.get(piece) == -expanded[piece] for piece in expanded):
                    for piece in (product, *expanded):
                        del left[piece]
                    return True
        return False

    def _unite_squares(self, left: dict[Product, float]) -> bool:
        """Put x for x sin² + x cos² of one angle."""
        for product, scale in left.items():
            for factor in set(product):
                node = self.nodes[factor]
                if not node.is_a(ca.OP_SIN) or product.count(factor) < 2:
                    continue
                rest = _without(_without(product, factor), factor)
                for other, equal in left.items():
                    if equal == scale and self._has_square_of_cosine(other, rest, node.arguments):
                        del left[product], left[other]
                        left[rest] = left.get(rest, 0.0) + scale
                        return True
        return False

    def _has_square_of_cosine(self, product: Product, rest: Product, angle: tuple[int, ...]) -> bool:
        more = list(product)
        for factor in rest:
            if factor not in more:
                return False
            more.remove(factor)
        return len(more) == 2 and more[0] == more[1] and self.nodes[more[0]] == Instruction.of(ca.OP_COS, *angle)


def _without(product: Product, factor: int) -> Product:
    place = product.index(factor)
    return product[:place] + product[place + 1 :]
