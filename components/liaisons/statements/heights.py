"""Sums and products in an order in which processors wait least: what is known late comes last.

In l (cos θ ω) nothing can begin before ω is known, in (l cos θ) ω one multiplication is done by then.  Right-hand sides
are chains from one stage of a solver to the next, so that their length, not the number of operations, is their time.
Only what is used nowhere else is put in another order: the number of operations does not grow.
"""

from __future__ import annotations

import heapq
from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from typing import final

import casadi as ca

from liaisons.statements.nodes import Node
from liaisons.statements.operations import OPERATIONS

_CYCLES = {OPERATIONS[code]: 4 for code in (ca.OP_ADD, ca.OP_SUB, ca.OP_MUL, ca.OP_SQ, ca.OP_TWICE)}
_CYCLES |= {OPERATIONS[code]: 15 for code in (ca.OP_DIV, ca.OP_INV, ca.OP_SQRT)} | {OPERATIONS[ca.OP_NEG]: 1}
_CALL = 60  # of an elementary function

Signed = tuple[int, int]
"""A node, and 1 or -1."""


@final
class Reordering:
    """The nodes of a program once more, in another order where that pays."""

    def __init__(self, nodes: Sequence[Node], outputs: Sequence[Sequence[int]]) -> None:
        self._old = nodes
        self._uses = Counter(argument for node in nodes if node.operation for argument in node.arguments)
        self._uses.update(number for entries in outputs for number in entries)
        self.nodes: list[Node] = []
        self._ready: list[int] = []  # cycles until a node is known
        self._numbers: dict[Node, int] = {}
        new: dict[int, int] = {}
        for number, node in enumerate(nodes):
            if node.is_a(ca.OP_ADD) or node.is_a(ca.OP_SUB):
                new[number] = self._sum([(new[leaf], sign) for leaf, sign in self._leaves(number, 1)])
            elif node.is_a(ca.OP_MUL):
                new[number] = self._product([new[leaf] for leaf in self._factors(number)])
            elif node.operation is None:
                new[number] = self._number(node, 0)
            else:
                new[number] = self._operation(replace(node, arguments=tuple(new[x] for x in node.arguments)))
        self.outputs = [[new[number] for number in entries] for entries in outputs]

    def _leaves(self, number: int, sign: int) -> list[Signed]:
        """What a sum adds, through sums that nobody else uses."""
        leaves = []
        node = self._old[number]
        for argument, of_argument in zip(node.arguments, (sign, -sign if node.is_a(ca.OP_SUB) else sign), strict=True):
            inner = self._old[argument]
            if self._uses[argument] == 1 and (inner.is_a(ca.OP_ADD) or inner.is_a(ca.OP_SUB)):
                leaves += self._leaves(argument, of_argument)
            else:
                leaves.append((argument, of_argument))
        return leaves

    def _factors(self, number: int) -> list[int]:
        factors = []
        for argument in self._old[number].arguments:
            if self._uses[argument] == 1 and self._old[argument].is_a(ca.OP_MUL):
                factors += self._factors(argument)
            else:
                factors.append(argument)
        return factors

    def _sum(self, leaves: Sequence[Signed]) -> int:
        heap = [(self._ready[number], number, sign) for number, sign in leaves]
        heapq.heapify(heap)
        while len(heap) > 1:
            (_, x, of_x), (_, y, of_y) = heapq.heappop(heap), heapq.heappop(heap)
            if of_x == of_y:
                number = self._operation(Node.of(ca.OP_ADD, *sorted((x, y))))
            else:
                number = self._operation(Node.of(ca.OP_SUB, *((x, y) if of_x > 0 else (y, x))))
            heapq.heappush(heap, (self._ready[number], number, of_x if of_x == of_y else 1))
        return heap[0][1]

    def _product(self, factors: Sequence[int]) -> int:
        heap = [(self._ready[number], number) for number in factors]
        heapq.heapify(heap)
        while len(heap) > 1:
            (_, x), (_, y) = heapq.heappop(heap), heapq.heappop(heap)
            number = self._operation(Node.of(ca.OP_SQ, x) if x == y else Node.of(ca.OP_MUL, *sorted((x, y))))
            heapq.heappush(heap, (self._ready[number], number))
        return heap[0][1]

    def _operation(self, node: Node) -> int:
        assert node.operation is not None
        return self._number(node, max(self._ready[x] for x in node.arguments) + _CYCLES.get(node.operation, _CALL))

    def _number(self, node: Node, ready: int) -> int:
        if node not in self._numbers or node.constant is not None:
            self._numbers[node] = len(self.nodes)
            self.nodes.append(node)
            self._ready.append(ready)
        return self._numbers[node]
