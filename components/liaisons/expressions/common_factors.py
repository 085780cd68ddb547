"""Common factors of the terms of a sum, put in front of it: a ω + b ω = (a + b) ω.

Derivatives of energies have many: right-hand sides of the catalogue have 8 % more operations without, up to a fifth.
Only operations with a single use are reassociated, so that their number does not grow; sums and products become
balanced trees.
"""

from __future__ import annotations

from collections import Counter, deque
from collections.abc import Sequence
from functools import reduce
from operator import and_
from typing import final

import casadi as ca

from liaisons.expressions.operations import Instruction

_SUMS = (ca.OP_ADD, ca.OP_SUB)

SignedNode = tuple[int, int]
"""A node, and 1 or -1."""

Term = tuple[list[int], int]
"""The factors of a product, and 1 or -1."""


@final
class Factored:
    """Program with common factors in front of sums: ``nodes`` and ``outputs``."""

    def __init__(self, nodes: Sequence[Instruction], outputs: Sequence[Sequence[int]]) -> None:
        self._old, self._absorbed_nodes = nodes, _absorbed_nodes(nodes, outputs)
        self.nodes: list[Instruction] = []
        self._numbers: dict[Instruction, int] = {}
        new: dict[int, int] = {}
        for number, node in enumerate(nodes):
            if number in self._absorbed_nodes:
                continue
            if _is_sum(node):
                terms = [([new[x] for x in factors], sign) for factors, sign in self._terms(number)]
                new[number], _ = self._add_factored_sum(terms)  # positive, as one of the terms is
            elif node.operation == ca.OP_MUL:
                new[number] = self._add_product([new[x] for x in self._factors(number)])
            else:
                new[number] = self._add_node(node.renumbered(new))
        self.outputs = [[new[number] for number in entries] for entries in outputs]

    def _terms(self, number: int) -> list[Term]:
        """Terms of a sum, and of the sums that it has absorbed."""
        terms: list[Term] = []
        left = [(number, 1)]
        while left:
            number, sign = left.pop()
            node = self._old[number]
            signs = (sign, -sign if node.operation == ca.OP_SUB else sign)
            for x, of_x in zip(node.arguments, signs, strict=True):
                if x in self._absorbed_nodes and _is_sum(self._old[x]):
                    left.append((x, of_x))
                else:
                    terms.append((self._factors(x) if x in self._absorbed_nodes else [x], of_x))
        return terms

    def _factors(self, number: int) -> list[int]:
        """Factors of a product, and of the products that it has absorbed."""
        factors, left = [], [number]
        while left:
            for x in self._old[left.pop()].arguments:
                (left if x in self._absorbed_nodes else factors).append(x)
        return factors

    def _add_factored_sum(self, terms: Sequence[Term]) -> SignedNode:
        """Add a sum of products with common factors in front; return its node and sign, -1 if all terms have it."""
        left = list(terms)
        while True:
            times = Counter(factor for factors, _ in left if len(factors) > 1 for factor in set(factors))
            latest = max((x for x in times if times[x] > 1), default=None)
            if latest is None:
                return self._add_sum([(self._add_product(factors), sign) for factors, sign in left])
            having = [len(factors) > 1 and latest in factors for factors, _ in left]
            common, rests = _common_factors([term for term, has in zip(left, having, strict=True) if has], latest)
            rest, sign = self._add_factored_sum(rests)
            left = [term for term, has in zip(left, having, strict=True) if not has] + [([rest, *common], sign)]

    def _add_sum(self, terms: Sequence[SignedNode]) -> SignedNode:
        """Add a sum; return its node and sign."""
        left = deque(sorted(terms))
        while len(left) > 1:
            (x, of_x), (y, of_y) = left.popleft(), left.popleft()
            if of_x == of_y:
                left.append((self._add_node(Instruction(ca.OP_ADD, tuple(sorted((x, y))))), of_x))
            else:
                left.append((self._add_node(Instruction(ca.OP_SUB, (x, y) if of_x > 0 else (y, x))), 1))
        return left[0]

    def _add_product(self, factors: Sequence[int]) -> int:
        """Add a product; return its node."""
        left = deque(sorted(factors))
        while len(left) > 1:
            x, y = left.popleft(), left.popleft()
            square, product = Instruction(ca.OP_SQ, (x,)), Instruction(ca.OP_MUL, tuple(sorted((x, y))))
            left.append(self._add_node(square if x == y else product))
        return left[0]

    def _add_node(self, node: Instruction) -> int:
        if node not in self._numbers or node.constant is not None:
            self._numbers[node] = len(self.nodes)
            self.nodes.append(node)
        return self._numbers[node]


def _absorbed_nodes(nodes: Sequence[Instruction], outputs: Sequence[Sequence[int]]) -> set[int]:
    """Nodes to be absorbed: sums with a single use, in a sum; products with a single one, in either."""
    uses = Counter(argument for node in nodes if node.operation is not None for argument in node.arguments)
    uses.update(number for entries in outputs for number in entries)
    inner: set[int] = set()
    for user in nodes:
        if _is_sum(user):
            inner.update(x for x in user.arguments if _is_sum(nodes[x]) or nodes[x].operation == ca.OP_MUL)
        elif user.operation == ca.OP_MUL:
            inner.update(x for x in user.arguments if nodes[x].operation == ca.OP_MUL)
    return {number for number in inner if uses[number] == 1}


def _is_sum(node: Instruction) -> bool:
    return node.operation in _SUMS


def _common_factors(terms: Sequence[Term], factor: int) -> tuple[list[int], list[Term]]:
    """Common factors of terms, at least ``factor``, and the other factors of each term, never none."""
    common = reduce(and_, (Counter(factors) for factors, _ in terms))
    if any(len(factors) == common.total() for factors, _ in terms):
        common = Counter([factor])
    return list(common.elements()), [(list((Counter(factors) - common).elements()), sign) for factors, sign in terms]
