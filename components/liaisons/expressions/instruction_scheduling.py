"""Reassociation of sums and products for a short critical path: late operands enter last.

In l (cos θ ω) nothing can start before ω is ready, in (l cos θ) ω one multiplication is done by then, and ω/m waits
for a division where ω (1/m) waits for a multiplication.  Right-hand sides are chains from one stage of a solver to the
next: their latency, not the number of operations, is their time.  Common factors of terms, the latest first, are put in
front of the sum: a ω + b ω = (a + b) ω.  Only operations with a single use are reassociated, so that their number does
not grow, but for reciprocals.
"""

from __future__ import annotations

import heapq
from collections import Counter
from collections.abc import Sequence
from functools import reduce
from operator import and_
from typing import final

import casadi as ca

from liaisons.expressions.operations import Instruction

_SUMS = (ca.OP_ADD, ca.OP_SUB)
_CYCLES = dict.fromkeys((ca.OP_ADD, ca.OP_SUB, ca.OP_MUL, ca.OP_SQ, ca.OP_TWICE), 4)
_CYCLES |= dict.fromkeys((ca.OP_DIV, ca.OP_INV, ca.OP_SQRT), 15) | {ca.OP_NEG: 1}
_CALL = 60  # of an elementary function
_LONG = 1000  # cycles after which the late input is ready

Signed = tuple[int, int]
"""A node, and 1 or -1."""

Term = tuple[list[int], int]
"""The factors of a product, and 1 or -1."""


@final
class Reassociation:
    """Reassociated program: ``nodes`` and ``outputs``.

    :param late: index of the input that is ready last, if there is one.
    """

    def __init__(self, nodes: Sequence[Instruction], outputs: Sequence[Sequence[int]], late: int | None) -> None:
        self._old = nodes
        self._absorbed_nodes = _absorbed_nodes(nodes, outputs)
        self.nodes: list[Instruction] = []
        self._ready: list[int] = []  # cycles until a node is ready
        self._numbers: dict[Instruction, int] = {}
        new: dict[int, int] = {}
        for number, node in enumerate(nodes):
            if number in self._absorbed_nodes:
                continue
            if _is_sum(node):
                terms = [([new[x] for x in factors], sign) for factors, sign in self._terms(number)]
                new[number], _ = self._add_factored_sum(terms)  # positive, as one of the terms is
            elif node.is_a(ca.OP_MUL):
                new[number] = self._add_product([new[x] for x in self._factors(number)])
            elif node.is_a(ca.OP_DIV) and late is not None:
                new[number] = self._add_quotient(*(new[x] for x in node.arguments))
            elif node.operation is None:
                is_late = late is not None and node.constant is None and node.arguments[0] == late
                new[number] = self._add_node(node, _LONG if is_late else 0)
            else:
                new[number] = self._add_operation(node.renumbered(new))
        self.outputs = [[new[number] for number in entries] for entries in outputs]

    def _terms(self, number: int) -> list[Term]:
        """Return the terms of a sum, with those of absorbed sums."""
        terms: list[Term] = []
        left = [(number, 1)]
        while left:
            number, sign = left.pop()
            node = self._old[number]
            signs = (sign, -sign if node.is_a(ca.OP_SUB) else sign)
            for x, of_x in zip(node.arguments, signs, strict=True):
                if x in self._absorbed_nodes and _is_sum(self._old[x]):
                    left.append((x, of_x))
                else:
                    terms.append((self._factors(x) if x in self._absorbed_nodes else [x], of_x))
        return terms

    def _factors(self, number: int) -> list[int]:
        """Return the factors of a product, with those of absorbed products."""
        factors, left = [], [number]
        while left:
            for x in self._old[left.pop()].arguments:
                (left if x in self._absorbed_nodes else factors).append(x)
        return factors

    def _add_factored_sum(self, terms: Sequence[Term]) -> Signed:
        """Add a sum of products with common factors in front; return it, negative if all terms are."""
        left = list(terms)
        while True:
            times = Counter(factor for factors, _ in left if len(factors) > 1 for factor in set(factors))
            latest = max((x for x in times if times[x] > 1), key=lambda x: (self._ready[x], x), default=None)
            if latest is None:
                return self._add_sum([(self._add_product(factors), sign) for factors, sign in left])
            having = [len(factors) > 1 and latest in factors for factors, _ in left]
            common, rests = _common_factors([term for term, has in zip(left, having, strict=True) if has], latest)
            rest, sign = self._add_factored_sum(rests)
            left = [term for term, has in zip(left, having, strict=True) if not has] + [([rest, *common], sign)]

    def _add_sum(self, leaves: Sequence[Signed]) -> Signed:
        """Add a sum, of the nodes that are ready first; return it with its sign."""
        heap = [(self._ready[number], number, sign) for number, sign in leaves]
        heapq.heapify(heap)
        while len(heap) > 1:
            (_, x, of_x), (_, y, of_y) = heapq.heappop(heap), heapq.heappop(heap)
            if of_x == of_y:
                number = self._add_operation(Instruction.of(ca.OP_ADD, *sorted((x, y))))
            else:
                number = self._add_operation(Instruction.of(ca.OP_SUB, *((x, y) if of_x > 0 else (y, x))))
            heapq.heappush(heap, (self._ready[number], number, of_x if of_x == of_y else 1))
        return heap[0][1:]

    def _add_product(self, factors: Sequence[int]) -> int:
        """Add a product, of the nodes that are ready first."""
        heap = [(self._ready[number], number) for number in factors]
        heapq.heapify(heap)
        while len(heap) > 1:
            (_, x), (_, y) = heapq.heappop(heap), heapq.heappop(heap)
            number = self._add_operation(
                Instruction.of(ca.OP_SQ, x) if x == y else Instruction.of(ca.OP_MUL, *sorted((x, y)))
            )
            heapq.heappush(heap, (self._ready[number], number))
        return heap[0][1]

    def _add_quotient(self, dividend: int, divisor: int) -> int:
        """Add a quotient; of a divisor that is ready long before, a product with its reciprocal."""
        reciprocal = Instruction.of(ca.OP_INV, divisor)
        by_division, inverted = Instruction.of(ca.OP_DIV, dividend, divisor), self._latency(reciprocal)
        if max(inverted, self._ready[dividend]) + _CYCLES[ca.OP_MUL] >= self._latency(by_division):
            return self._add_operation(by_division)
        return self._add_operation(Instruction.of(ca.OP_MUL, *sorted((dividend, self._add_operation(reciprocal)))))

    def _add_operation(self, node: Instruction) -> int:
        return self._add_node(node, self._latency(node))

    def _latency(self, node: Instruction) -> int:
        """Return the cycles until the result of an operation is ready."""
        assert node.operation is not None
        return max(self._ready[x] for x in node.arguments) + _CYCLES.get(node.operation, _CALL)

    def _add_node(self, node: Instruction, ready: int) -> int:
        if node not in self._numbers or node.constant is not None:
            self._numbers[node] = len(self.nodes)
            self.nodes.append(node)
            self._ready.append(ready)
        return self._numbers[node]


def _absorbed_nodes(nodes: Sequence[Instruction], outputs: Sequence[Sequence[int]]) -> set[int]:
    """Return the sums used in one other sum only, and the products used in one other sum or product only."""
    uses = Counter(argument for node in nodes if node.operation is not None for argument in node.arguments)
    uses.update(number for entries in outputs for number in entries)
    inner: set[int] = set()
    for user in nodes:
        if _is_sum(user):
            inner.update(x for x in user.arguments if _is_sum(nodes[x]) or nodes[x].is_a(ca.OP_MUL))
        elif user.is_a(ca.OP_MUL):
            inner.update(x for x in user.arguments if nodes[x].is_a(ca.OP_MUL))
    return {number for number in inner if uses[number] == 1}


def _is_sum(node: Instruction) -> bool:
    return node.operation in _SUMS


def _common_factors(terms: Sequence[Term], factor: int) -> tuple[list[int], list[Term]]:
    """Return common factors of terms, ``factor`` among them, and the rest of each term, which is not empty."""
    common = reduce(and_, (Counter(factors) for factors, _ in terms))
    if any(len(factors) == common.total() for factors, _ in terms):
        common = Counter([factor])
    return list(common.elements()), [(list((Counter(factors) - common).elements()), sign) for factors, sign in terms]
