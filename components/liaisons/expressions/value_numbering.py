"""Value numbering with algebraic simplification: equal operations are one node, with exact scales in front of it.

Derivatives of energies abound in halves, doubles and signs.  These factors are exact, so they may pass through products
and sums until they meet their inverse: m/2 (a b + a b) is m a b.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from functools import reduce
from typing import TypeGuard, final

import casadi as ca

from liaisons.errors import ComponentError
from liaisons.expressions.operations import OPERATIONS, Instruction
from liaisons.expressions.sum_factoring import Expansions, Monomial, ScaledNode

_LARGEST_POWER = 16  # integer powers up to here are products; more would cost accuracy
_LARGEST_SCALE = 2.0**16


@final
class Builder:
    """Nodes of a program, each once, in topological order."""

    def __init__(self) -> None:
        self.nodes: list[Instruction] = []
        self._numbers: dict[object, int] = {}
        self._sums = Expansions(self.nodes)
        self._products: dict[Monomial, int] = {}
        self._rewritten: dict[int, Callable[..., ScaledNode]] = {
            ca.OP_ASSIGN: lambda x: x,
            ca.OP_NEG: lambda x: (-x[0], x[1]),
            ca.OP_TWICE: lambda x: (2 * x[0], x[1]),
            ca.OP_SQ: lambda x: self._product(x, x),
            ca.OP_MUL: self._product,
            ca.OP_INV: self._inverse,
            ca.OP_DIV: self._quotient,
            ca.OP_ADD: self._sum,
            ca.OP_SUB: lambda x, y: self._sum(x, (-y[0], y[1])),
            ca.OP_IF_ELSE_ZERO: self._if_else_zero,
            ca.OP_POW: self._power,
            ca.OP_CONSTPOW: self._power,
            ca.OP_HYPOT: self._hypotenuse,
        }

    def entry(self, column: int, row: int) -> ScaledNode:
        """Node of an entry of an input."""
        return 1.0, self._add_node(Instruction(None, (column, row)))

    def constant(self, value: float) -> ScaledNode:
        """Node of a constant."""
        return 1.0, self._add_node(Instruction(None, (), float(value)))

    def node_number(self, scaled: ScaledNode) -> int:
        """Number of the node with the value of a scaled node, added if there is none."""
        scale, core = scaled
        if scale == 1:
            return core
        node = self.nodes[core]
        if node.constant is not None:
            return self.constant(scale * node.constant)[1]
        if scale < 0 and node.operation == ca.OP_SUB:
            return self.node_number((-scale, self._add_operation(ca.OP_SUB, *reversed(node.arguments))))
        if scale in (-1, 2):
            return self._add_operation(ca.OP_NEG if scale == -1 else ca.OP_TWICE, core)
        return self._add_operation(ca.OP_MUL, core, self.constant(scale)[1])

    def perform(self, code: int, arguments: Sequence[ScaledNode]) -> ScaledNode:
        """Simplified result of CasADi's operation of a code.

        :raises ComponentError: for an operation that has no counterpart in C.
        """
        if code not in OPERATIONS:
            what = (
                "calls a function, such as ca.interpolant" if code == ca.OP_CALL else f"has CasADi's operation {code}"
            )
            raise ComponentError(
                f"an expression {what}, which has no counterpart in vectorised C; write it by scalar formulas "
                "(ca.if_else, powers), or simulate the FMU"
            )
        if code in self._rewritten:
            return self._with_bounded_scale(self._rewritten[code](*arguments))
        return 1.0, self._add_operation(code, *map(self.node_number, arguments))

    def _with_bounded_scale(self, number: ScaledNode) -> ScaledNode:
        """Same value with a scale that is a power of two, and bounded: else with 1, in a node of its own."""
        scale = number[0]
        if _is_power_of_two(scale) and 1 / _LARGEST_SCALE <= abs(scale) <= _LARGEST_SCALE:
            return number
        return 1.0, self.node_number(number)

    def _inverse(self, number: ScaledNode) -> ScaledNode:
        scale, x = number
        return 1 / scale, self._add_operation(ca.OP_INV, x)

    def _if_else_zero(self, condition: ScaledNode, number: ScaledNode) -> ScaledNode:
        scale, x = number
        return scale, self._add_operation(ca.OP_IF_ELSE_ZERO, self.node_number(condition), x)

    def _product(self, first: ScaledNode, second: ScaledNode) -> ScaledNode:
        (scale, x), (other, y) = first, second
        for number, factor in ((x, second), (y, first)):
            constant = self.nodes[number].constant
            if constant == 0:
                return 1.0, number
            if _is_power_of_two(constant):
                return scale * other * constant, factor[1]
        operation = (ca.OP_SQ, x) if x == y else (ca.OP_MUL, *sorted((x, y)))
        # The same factors in another order have the same product.
        core = self._products.setdefault(self._sums.product_factors(x, y), self._add_operation(*operation))
        return scale * other, core

    def _quotient(self, first: ScaledNode, second: ScaledNode) -> ScaledNode:
        (scale, x), (other, y) = first, second
        constant = self.nodes[y].constant
        if _is_power_of_two(constant):
            return scale / (other * constant), x
        return scale / other, self._add_operation(ca.OP_DIV, x, y)

    def _hypotenuse(self, first: ScaledNode, second: ScaledNode) -> ScaledNode:
        """√(x² + y²), five times as fast as ``hypot``, but subject to overflow."""
        squares = self._sum(self._product(first, first), self._product(second, second))
        return 1.0, self._add_operation(ca.OP_SQRT, self.node_number(squares))

    def _sum(self, first: ScaledNode, second: ScaledNode) -> ScaledNode:
        for number, term in ((first[1], second), (second[1], first)):
            if self.nodes[number].constant == 0:
                return term
        together = first[0] + second[0]
        if first[1] == second[1] and (together == 0 or _is_power_of_two(together)):
            return (together, first[1]) if together else self.constant(0.0)
        products = self._sums.shortened_sum(first, second)
        return self._two_term_sum(first, second) if products is None else self._sum_of_products(products)

    def _two_term_sum(self, first: ScaledNode, second: ScaledNode) -> ScaledNode:
        """Sum of two scaled nodes as one addition or subtraction, the scale of one of them factored out."""
        if abs(second[0]) == 1:  # a scale of one is put in front of both
            first, second = second, first
        (scale, x), (other, y) = first, second
        if abs(other) != abs(scale):
            y = self.node_number((abs(other / scale), y))
        if (scale < 0) == (other < 0):
            return scale, self._add_operation(ca.OP_ADD, *sorted((x, y)))
        plus, minus = (x, y) if scale > 0 else (y, x)
        if Instruction(ca.OP_SUB, (minus, plus)) in self._numbers:
            return -abs(scale), self._add_operation(ca.OP_SUB, minus, plus)
        return abs(scale), self._add_operation(ca.OP_SUB, plus, minus)

    def _sum_of_products(self, products: Sequence[tuple[float, Monomial]]) -> ScaledNode:
        """Sum of scaled products, added in their order."""
        total = self.constant(0.0)
        for scale, product in products:
            inner, core = reduce(self._product, ((1.0, factor) for factor in product), self.constant(1.0))
            total = self._sum(total, (scale * inner, core))
        return total

    def _power(self, base: ScaledNode, exponent: ScaledNode) -> ScaledNode:
        value = self.nodes[exponent[1]].constant
        if value is not None:
            value *= exponent[0]
            if value == 0.5:
                return self.perform(ca.OP_SQRT, [base])
            if value.is_integer() and 0 < abs(value) <= _LARGEST_POWER:
                power = self._integer_power(base, int(abs(value)))
                return power if value > 0 else self.perform(ca.OP_INV, [power])
        return 1.0, self._add_operation(ca.OP_POW, self.node_number(base), self.node_number(exponent))

    def _integer_power(self, base: ScaledNode, exponent: int) -> ScaledNode:
        """Power by repeated squaring."""
        if exponent == 1:
            return base
        half = self._integer_power(base, exponent // 2)
        square = self._product(half, half)
        return self._product(base, square) if exponent % 2 else square

    def _add_operation(self, code: int, *arguments: int) -> int:
        return self._add_node(Instruction(code, arguments))

    def _add_node(self, node: Instruction) -> int:
        """Add an instruction unless there is an equal one; return its number."""
        key = node if node.constant is None else node.constant.hex()  # tells 0 from -0
        if key not in self._numbers:
            self._numbers[key] = len(self.nodes)
            self.nodes.append(node)
        return self._numbers[key]


def _is_power_of_two(value: float | None) -> TypeGuard[float]:
    return value is not None and abs(math.frexp(value)[0]) == 0.5
