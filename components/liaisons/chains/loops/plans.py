"""The loops of a program with all their operations numbered, and the source of each number."""

from __future__ import annotations

from collections import Counter
from collections.abc import Container, Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import chain

import casadi as ca

from liaisons.algebra import stack
from liaisons.chains.loops.loop_fusion import FusedLoop, LoopFusion
from liaisons.chains.rows import Carry, RowProgram, Vector, key, scalars, substituted
from liaisons.expressions import Instruction, Program

CHEAP = {ca.OP_ADD, ca.OP_SUB, ca.OP_MUL, ca.OP_NEG, ca.OP_SQ, ca.OP_TWICE}
"""Operations that cost no more than storing a number and reading it again."""

AtLink = tuple[bool, int]
"""(True, -1): the link before; (False, 3): link 3, counted from 0."""
_HERE: AtLink = (True, 0)


@dataclass(frozen=True, slots=True)
class Leaf:
    """A number that is read."""

    text: str  # in C
    each: bool  # whether it differs from link to link
    home: int = -1  # the loop that carries it as a variable; later ones read it from work space


@dataclass(frozen=True, slots=True)
class LoopPlan:
    """A loop; numbers are those of nodes, edges are the links that are written out."""

    inward: bool | None  # direction; None: nothing is carried
    links: range  # of the loop
    rows: list[tuple[str, int]]  # arrays, elements
    edges: list[tuple[str, int]]  # elements of arrays, values
    sums: list[tuple[str, int, list[int]]]  # variables, terms in the loop, terms of edges
    carried: list[tuple[str, int, int]]  # variables, values at the first link, values at the next link

    @property
    def targets(self) -> list[int]:
        """Numbers of the nodes that the loop calculates at each link."""
        return [*(x for _, x in self.rows), *(x for _, x, _ in self.sums), *(x for _, _, x in self.carried)]

    def renumbered(self, new: Sequence[int]) -> LoopPlan:
        """Plan with each number x replaced by ``new[x]``."""
        return LoopPlan(
            self.inward,
            self.links,
            [(name, new[x]) for name, x in self.rows],
            [(name, new[x]) for name, x in self.edges],
            [(name, new[x], [new[edge] for edge in edges]) for name, x, edges in self.sums],
            [(name, new[start], new[x]) for name, start, x in self.carried],
        )


class LoopPlans:
    """The plans of a program.

    :ivar pointers: declarations of the arrays, by their names.
    :ivar plans: in the order of execution.
    :ivar ends: results that are single numbers: their text, and their nodes.
    :ivar nodes: all operations and their leaves, each once.
    :ivar each: whether a node differs from link to link.
    :ivar kept: nodes that later loops read from work space: the array, and the loop that writes it.
    """

    def __init__(self, program: RowProgram) -> None:
        self._n, self._fusion = program.n, LoopFusion(program)
        self._arrays: dict[int, str] = {}  # of symbols that stand for one number a link
        self._origins: dict[object, tuple[ca.SX, Leaf]] = {}
        self._expressions: list[ca.SX] = []
        self._reach = 0  # how far expressions look along the row
        self.pointers: dict[str, str] = {}
        self.kept: dict[int, tuple[str, int]] = {}

        for index, vector in enumerate(program.arguments):
            self._add_argument(index, vector)
        ends = [end for index, vector in enumerate(program.results) for end in self._add_result(index, vector)]
        plans = [self._loop_plan(index, loop) for index, loop in enumerate(self._fusion.loops)]
        numbered = [(text, self._add_expression(entry, _HERE)) for text, entry in ends]
        local = any(len(plan.links) < self._n for plan in plans)
        named = [] if local else [x for _, column in self._fusion.definitions for x in scalars(column)]
        named_numbers = [self._add_expression(x, _HERE) for x in named]

        self._leaves = [leaf for _, leaf in self._origins.values()]
        graph = Program.of([stack(symbol for symbol, _ in self._origins.values())], [stack(self._expressions)])
        self.nodes, node_of = graph.nodes, graph.outputs[0]
        self.plans = [plan.renumbered(node_of) for plan in plans]
        self.ends = [(text, node_of[number]) for text, number in numbered]
        self.each: list[bool] = []
        for number, node in enumerate(self.nodes):
            leaf = self.leaf(number)
            self.each.append(leaf.each if leaf else any(self.each[i] for i in operands(node)))
        if not local:  # else the links at the ends would have to keep it too
            self._assign_work_space({node_of[number] for number in named_numbers})

    def leaf(self, number: int) -> Leaf | None:
        """Leaf that a node reads; None for an operation or a constant."""
        node = self.nodes[number]
        return self._leaves[node.arguments[1]] if node.operation is None and node.constant is None else None

    def needed_nodes(self, targets: Iterable[int], stored: Container[int]) -> tuple[set[int], set[int]]:
        """Nodes that each link calculates for its targets, and the stored nodes that it reads."""
        needed: set[int] = set()
        read: set[int] = set()
        ahead = [number for number in targets if self.each[number]]
        while ahead:
            number = ahead.pop()
            if number in stored:
                read.add(number)
            elif number not in needed:
                needed.add(number)
                ahead += [i for i in operands(self.nodes[number]) if self.each[i]]
        return needed, read

    def stored_arrays(self, index: int) -> list[tuple[str, int]]:
        """Names of the arrays in work space that a loop writes, with the numbers of the nodes in them."""
        return [(array, number) for number, (array, since) in self.kept.items() if since == index]

    # ---- numbering ------------------------------------------------------------------------------------------------

    def _add_argument(self, index: int, vector: Vector) -> None:
        """Register the entries of an argument as arrays, or as leaves."""
        for i, (symbol, offset) in enumerate(zip(scalars(vector.entries), vector.offsets(self._n), strict=False)):
            if vector.each[i]:
                self._arrays[key(symbol)] = name = f"x{index}_{i}"
                self.pointers[name] = f"const double *restrict {name} = argument[{index}] + {offset};"
            else:
                self._origins[key(symbol)] = symbol, Leaf(f"argument[{index}][{offset}]", each=False)

    def _add_result(self, index: int, vector: Vector) -> Iterator[tuple[str, ca.SX]]:
        """Add the arrays of a result to the loops; yield C text and expression of each of its other entries."""
        entries = scalars(self._fusion.inlined(vector.entries))
        for i, (entry, offset) in enumerate(zip(entries, vector.offsets(self._n), strict=False)):
            if vector.each[i]:
                name = f"z{index}_{i}"
                self.pointers[name] = f"double *restrict {name} = result[{index}] + {offset};"
                self._fusion.assign_loop(entry).rows.append((name, entry))
            else:
                yield f"result[{index}][{offset}]", entry

    def _loop_plan(self, index: int, loop: FusedLoop) -> LoopPlan:
        """Plan of a loop, whose numbers are those of expressions."""
        symbols, last, starts, following = (
            [x for carry in loop.carries for x in scalars(column(carry))]
            for column in (lambda s: s.symbols, lambda s: s.last, lambda s: s.start, lambda s: s.following)
        )
        variables = [f"c{index}_{i}" for i in range(len(symbols))]
        for variable, symbol, at_end in zip(variables, symbols, last, strict=True):
            self._origins[key(symbol)] = symbol, Leaf(variable, each=True, home=index)
            self._origins[key(at_end)] = at_end, Leaf(variable, each=False)
        self._reach = 0
        rows = [(array, self._add_expression(x, _HERE)) for array, x in loop.rows]
        terms = [self._add_expression(x, _HERE) for _, x in loop.sums]
        carried = [
            (variable, self._add_expression(start, _HERE), self._add_expression(x, _HERE))
            for variable, start, x in zip(variables, starts, following, strict=True)
        ]
        reach = min(self._reach, self._n)
        outside = sorted({*range(reach), *range(self._n - reach, self._n)})
        edges = [(f"{array}[{j}]", self._add_expression(x, (False, j))) for j in outside for array, x in loop.rows]
        sums = []
        for i, (symbol, term) in enumerate(loop.sums):
            at_edges = [self._add_expression(term, (False, j)) for j in outside]
            self._origins[key(symbol)] = symbol, Leaf(f"t{index}_{i}", each=False)
            sums.append((f"t{index}_{i}", terms[i], at_edges))
        return LoopPlan(loop.inward, range(reach, self._n - reach), rows, edges, sums, carried)

    def _add_expression(self, expression: ca.SX, link: AtLink) -> int:
        """Append an expression for a link; returns its number."""
        self._expressions.append(self._expression_at(expression, link))
        return len(self._expressions) - 1

    def _expression_at(self, expression: ca.SX, link: AtLink) -> ca.SX:
        """Expression with symbols of arrays and neighbours replaced by those of a link."""
        pairs = []
        for symbol in ca.symvar(expression):
            name = key(symbol)
            if name in self._arrays:
                pairs.append((symbol, self._array_element(self._arrays[name], link)))
            elif name in self._fusion.neighbours:
                pairs.append((symbol, self._carried_value(*self._fusion.neighbours[name], link)))
            elif name in self._fusion.ends:
                carry, i = self._fusion.ends[name]
                pairs.append(
                    (symbol, self._expression_at(carry.following[i], (False, 0 if carry.inward else self._n - 1)))
                )
        return substituted(expression, pairs)

    def _carried_value(self, carry: Carry, i: int, link: AtLink) -> ca.SX:
        """Expression of a carried value at a link: of the link before, or of the start."""
        moving, offset = link
        before = offset + 1 if carry.inward else offset - 1
        if moving:
            self._reach = max(self._reach, abs(before))
        elif not 0 <= before < self._n:
            return self._expression_at(carry.start[i], link)
        return self._expression_at(carry.following[i], (moving, before))

    def _array_element(self, array: str, link: AtLink) -> ca.SX:
        """Return the symbol of the element of an array at a link, and register it as a leaf."""
        moving, offset = link
        if moving:
            self._reach = max(self._reach, abs(offset))
        if (array, link) not in self._origins:
            index = (f"i {'+-'[offset < 0]} {abs(offset)}" if offset else "i") if moving else str(offset)
            self._origins[array, link] = ca.SX.sym("x"), Leaf(f"{array}[{index}]", each=moving)
        return self._origins[array, link][0]

    # ---- work space -----------------------------------------------------------------------------------------------

    def _assign_work_space(self, named: set[int]) -> None:
        """Assign work space to nodes that later loops use and that are carried, expensive or named."""
        times = Counter(chain.from_iterable(self.needed_nodes(plan.targets, ())[0] for plan in self.plans))
        operation = [node.operation for node in self.nodes]
        shared = {i for i, count in times.items() if count > 1 and operation[i] is not None}
        shared = {i for i in shared if operation[i] not in CHEAP or i in named}
        calculated: dict[int, int] = {}  # by which loop
        for index, plan in enumerate(self.plans):
            needed, read = self.needed_nodes(plan.targets, calculated)
            for number in needed:
                leaf = self.leaf(number)
                if leaf and leaf.home not in {-1, index}:
                    calculated[number] = leaf.home
                    read.add(number)
            for number in sorted(read - self.kept.keys()):
                array, offset = f"w{len(self.kept)}", len(self.kept) * self._n
                self.pointers[array] = f"double *restrict {array} = work + {offset};"
                self.kept[number] = array, calculated[number]
            calculated |= dict.fromkeys(needed & shared, index)


def operands(node: Instruction) -> tuple[int, ...]:
    """Numbers of the nodes that are operands of an operation; none of a leaf."""
    return node.arguments if node.operation is not None else ()
