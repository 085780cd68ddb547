"""The passages of a program with all their operations numbered, and where each number comes from."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import chain

import casadi as ca

from liaisons.expressions import OPERATIONS, Instruction
from liaisons.expressions import program as operations
from liaisons.expressions.algebra import stack
from liaisons.expressions.rows import Carry, RowProgram, Vector, key, scalars, substituted
from liaisons.fmu.loops.loop_fusion import Passage, Passages

CHEAP = {OPERATIONS[code] for code in (ca.OP_ADD, ca.OP_SUB, ca.OP_MUL, ca.OP_NEG, ca.OP_SQ, ca.OP_TWICE)}
"""Operations that cost no more than a number that is stored and read again."""

AtLink = tuple[bool, int]
"""(True, -1): the link before; (False, 3): link 3, counted from 0."""
_HERE: AtLink = (True, 0)


@dataclass(frozen=True, slots=True)
class Leaf:
    """Where a number comes from."""

    text: str  # in C
    each: bool  # whether it is another one at each link
    home: int = -1  # the passage that carries it: there it is a variable, to later ones it comes from work space


@dataclass(frozen=True, slots=True)
class PassagePlan:
    """A passage; numbers are those of nodes, edges are the links that are written out."""

    inward: bool | None  # None: nothing is carried
    links: range  # those of the loop
    rows: list[tuple[str, int]]  # arrays, and what fills them
    edges: list[tuple[str, int]]  # places in arrays, and what fills them
    sums: list[tuple[str, int, list[int]]]  # variables, terms in the loop, terms of edges
    carried: list[tuple[str, int, int]]  # variables, what the first link meets, what the next one meets

    @property
    def targets(self) -> list[int]:
        """What is calculated in the loop."""
        return [*(x for _, x in self.rows), *(x for _, x, _ in self.sums), *(x for _, _, x in self.carried)]

    def renumbered(self, of: Sequence[int]) -> PassagePlan:
        """The same with other numbers."""
        return PassagePlan(
            self.inward,
            self.links,
            [(name, of[x]) for name, x in self.rows],
            [(name, of[x]) for name, x in self.edges],
            [(name, of[x], [of[edge] for edge in edges]) for name, x, edges in self.sums],
            [(name, of[start], of[x]) for name, start, x in self.carried],
        )


class PassagePlans:
    """The plans of a program.

    :ivar pointers: declarations of the arrays, by their names.
    :ivar plans: in their order.
    :ivar ends: results that are single numbers: where they go, and their nodes.
    :ivar nodes: all operations and what they begin with, each once.
    :ivar each: whether a node is another number at each link.
    :ivar kept: nodes that later passages find in work space: the array, and the passage that fills it.
    """

    def __init__(self, program: RowProgram) -> None:
        self._n, self._passages = program.n, Passages(program)
        self._arrays: dict[int, str] = {}  # of symbols that stand for one number a link
        self._origins: dict[object, tuple[ca.SX, Leaf]] = {}
        self._expressions: list[ca.SX] = []
        self._reach = 0  # how far expressions look along the row
        self.pointers: dict[str, str] = {}
        self.kept: dict[int, tuple[str, int]] = {}

        for place, vector in enumerate(program.arguments):
            self._take(place, vector)
        ends = [end for place, vector in enumerate(program.results) for end in self._give(place, vector)]
        plans = [self._plan(place, passage) for place, passage in enumerate(self._passages.found)]
        numbered = [(where, self._number(entry, _HERE)) for where, entry in ends]
        neighbourly = any(len(plan.links) < self._n for plan in plans)
        named = [] if neighbourly else [x for _, column in self._passages.definitions for x in scalars(column)]
        named_numbers = [self._number(x, _HERE) for x in named]

        self._leaves = [leaf for _, leaf in self._origins.values()]
        found = operations([stack(symbol for symbol, _ in self._origins.values())], [stack(self._expressions)])
        self.nodes, of = found.nodes, found.outputs[0]
        self.plans = [plan.renumbered(of) for plan in plans]
        self.ends = [(where, of[number]) for where, number in numbered]
        self.each: list[bool] = []
        for number, node in enumerate(self.nodes):
            leaf = self.leaf(number)
            self.each.append(leaf.each if leaf else any(self.each[i] for i in operands(node)))
        if not neighbourly:  # there the links at the ends would have to keep it too
            self._keep({of[number] for number in named_numbers})

    def leaf(self, number: int) -> Leaf | None:
        """Where a number comes from that is no operation and no constant."""
        node = self.nodes[number]
        return self._leaves[node.arguments[1]] if node.operation is None and node.constant is None else None

    def needed(self, targets: Iterable[int], is_known: Callable[[int], bool]) -> tuple[set[int], set[int]]:
        """What at a link has to be calculated for targets, and what of the known that takes."""
        needed: set[int] = set()
        read: set[int] = set()
        ahead = [number for number in targets if self.each[number]]
        while ahead:
            number = ahead.pop()
            if is_known(number):
                read.add(number)
            elif number not in needed:
                needed.add(number)
                ahead += [i for i in operands(self.nodes[number]) if self.each[i]]
        return needed, read

    def kept_in(self, place: int) -> list[tuple[str, int]]:
        """Arrays in work space that a passage fills, and with what."""
        return [(array, number) for number, (array, since) in self.kept.items() if since == place]

    # ---- what there is to calculate -------------------------------------------------------------------------------

    def _take(self, place: int, vector: Vector) -> None:
        """An argument."""
        for i, (symbol, offset) in enumerate(zip(scalars(vector.entries), vector.offsets(self._n), strict=False)):
            if vector.each[i]:
                self._arrays[key(symbol)] = name = f"x{place}_{i}"
                self.pointers[name] = f"const double *restrict {name} = argument[{place}] + {offset};"
            else:
                self._origins[key(symbol)] = symbol, Leaf(f"argument[{place}][{offset}]", each=False)

    def _give(self, place: int, vector: Vector) -> Iterator[tuple[str, ca.SX]]:
        """A result: rows to the passages, and where its single numbers go."""
        entries = scalars(self._passages.inlined(vector.entries))
        for i, (entry, offset) in enumerate(zip(entries, vector.offsets(self._n), strict=False)):
            if vector.each[i]:
                name = f"z{place}_{i}"
                self.pointers[name] = f"double *restrict {name} = result[{place}] + {offset};"
                self._passages.at_links(entry).rows.append((name, entry))
            else:
                yield f"result[{place}][{offset}]", entry

    def _plan(self, place: int, passage: Passage) -> PassagePlan:
        symbols, last, starts, following = (
            [x for carry in passage.carries for x in scalars(column(carry))]
            for column in (lambda s: s.symbols, lambda s: s.last, lambda s: s.start, lambda s: s.following)
        )
        variables = [f"c{place}_{i}" for i in range(len(symbols))]
        for variable, symbol, at_end in zip(variables, symbols, last, strict=True):
            self._origins[key(symbol)] = symbol, Leaf(variable, each=True, home=place)
            self._origins[key(at_end)] = at_end, Leaf(variable, each=False)
        self._reach = 0
        rows = [(array, self._number(x, _HERE)) for array, x in passage.rows]
        terms = [self._number(x, _HERE) for _, x in passage.sums]
        carried = [
            (variable, self._number(start, _HERE), self._number(x, _HERE))
            for variable, start, x in zip(variables, starts, following, strict=True)
        ]
        reach = min(self._reach, self._n)
        outside = sorted({*range(reach), *range(self._n - reach, self._n)})
        edges = [(f"{array}[{j}]", self._number(x, (False, j))) for j in outside for array, x in passage.rows]
        sums = []
        for i, (symbol, term) in enumerate(passage.sums):
            at_edges = [self._number(term, (False, j)) for j in outside]
            self._origins[key(symbol)] = symbol, Leaf(f"t{place}_{i}", each=False)
            sums.append((f"t{place}_{i}", terms[i], at_edges))
        return PassagePlan(passage.inward, range(reach, self._n - reach), rows, edges, sums, carried)

    def _number(self, expression: ca.SX, link: AtLink) -> int:
        """The number of an expression of one link, at this one."""
        self._expressions.append(self._at(expression, link))
        return len(self._expressions) - 1

    def _at(self, expression: ca.SX, link: AtLink) -> ca.SX:
        pairs = []
        for symbol in ca.symvar(expression):
            name = key(symbol)
            if name in self._arrays:
                pairs.append((symbol, self._entry(self._arrays[name], link)))
            elif name in self._passages.neighbours:
                pairs.append((symbol, self._handed(*self._passages.neighbours[name], link)))
            elif name in self._passages.ends:
                carry, i = self._passages.ends[name]
                pairs.append((symbol, self._at(carry.following[i], (False, 0 if carry.inward else self._n - 1))))
        return substituted(expression, pairs)

    def _handed(self, carry: Carry, i: int, link: AtLink) -> ca.SX:
        """What a link meets: what the one before it hands on, or the start."""
        moving, place = link
        before = place + 1 if carry.inward else place - 1
        if moving:
            self._reach = max(self._reach, abs(before))
        elif not 0 <= before < self._n:
            return self._at(carry.start[i], link)
        return self._at(carry.following[i], (moving, before))

    def _entry(self, array: str, link: AtLink) -> ca.SX:
        moving, place = link
        if moving:
            self._reach = max(self._reach, abs(place))
        if (array, link) not in self._origins:
            index = (f"i {'+-'[place < 0]} {abs(place)}" if place else "i") if moving else str(place)
            self._origins[array, link] = ca.SX.sym("x"), Leaf(f"{array}[{index}]", each=moving)
        return self._origins[array, link][0]

    # ---- what is kept for later passages --------------------------------------------------------------------------

    def _keep(self, named: set[int]) -> None:
        """Give work space to what is carried, costs much or has a name, and is needed in a later passage."""
        times = Counter(chain.from_iterable(self.needed(plan.targets, lambda _: False)[0] for plan in self.plans))
        operation = [node.operation for node in self.nodes]
        shared = {i for i, count in times.items() if count > 1 and operation[i]}
        shared = {i for i in shared if operation[i] not in CHEAP or i in named}
        known: dict[int, int] = {}
        for place, plan in enumerate(self.plans):
            needed, read = self.needed(plan.targets, known.__contains__)
            for number in needed:
                leaf = self.leaf(number)
                if leaf and leaf.home not in {-1, place}:
                    known[number] = leaf.home
                    read.add(number)
            for number in sorted(read - self.kept.keys()):
                array, offset = f"w{len(self.kept)}", len(self.kept) * self._n
                self.pointers[array] = f"double *restrict {array} = work + {offset};"
                self.kept[number] = array, known[number]
            known |= dict.fromkeys(needed & shared, place)


def operands(node: Instruction) -> tuple[int, ...]:
    """The numbers that an operation takes."""
    return node.arguments if node.operation is not None else ()
