"""In which order the FMUs of a system are set, stepped and read: pure bookkeeping, no FMU is touched.

What an input holds.  At every communication point all outputs and inputs belong to the same instant t (inputs are
refreshed, outputs that depend on them directly are read again), and that is what is recorded.  Over the step from t
to t + H, with Gauss-Seidel coupling::

                                    t                                     t + H
    source                          y(t) ------------ doStep -----------> y(t + H)
    target, hold or extrapolate     u = y(t) -------- doStep -----------> u := y(t + H), outputs are read
    target, interpolate             u := y(t + H) --- doStep -----------> outputs are read
    target of another make          u := y(t + H) --- doStep -----------> outputs are read

An FMU of ours (it has the parameter ``input_reconstruction``) that holds or extrapolates takes its inputs for those at
t and is given them; one that interpolates remembers those at t and is given those at t + H.  So do all whose sources
are stepped before them, unless the user has said otherwise: they have order 6 at ports, not 3.  An FMU of another make
is given the newest values that there are.  With Jacobi coupling every input holds the value at t.

In a cycle the components are stepped in the order in which they were added, and what feeds back to an earlier one
belongs to t: an error of first order in H.  If in a cycle outputs depend directly on inputs all the way round (an
acceleration-force loop), one sweep in that order stands for the solution.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Hashable, Iterable, Mapping, Sequence
from heapq import heappop, heappush
from typing import Literal, TypeVar, final

Coupling = Literal["gauss-seidel", "jacobi", "implicit", "waveform"]
Action = Literal["set", "step", "get"]
Operation = tuple[Action, str]
"""Set all connected inputs of a component, step it, or read its outputs."""

VariableReference = tuple[str, str]
"""A variable of a system: component and name."""

Feeds = Mapping[VariableReference, VariableReference]
"""Input -> the output that feeds it."""

Depends = Callable[[VariableReference, VariableReference], bool]
"""Whether an output depends directly on an input of the same component."""

_Vertex = TypeVar("_Vertex", bound=Hashable)


def groups(names: Iterable[str], feeds: Feeds) -> list[list[str]]:
    """Sources before what they feed; each cycle is one group, its components as they were added.

    Where connections say nothing, the order of addition stays.  (Kosaraju's algorithm.)
    """
    targets: dict[str, list[str]] = {name: [] for name in names}
    for target, source in dict.fromkeys((target, source) for (target, _), (source, _) in feeds.items()):
        targets[source].append(target)
    return _strong(targets)


def in_cycles(groups: Iterable[Sequence[str]], feeds: Feeds) -> set[str]:
    """Components that feed each other, or themselves."""
    own = {target for (target, _), (source, _) in feeds.items() if target == source}
    return {name for group in groups for name in group if len(group) > 1 or name in own}


def _strong(edges: Mapping[_Vertex, list[_Vertex]]) -> list[list[_Vertex]]:
    """Nodes that lead to each other, grouped; groups before what they lead to, nodes as they are listed."""
    number = {node: k for k, node in enumerate(edges)}
    back: dict[_Vertex, list[_Vertex]] = {node: [] for node in edges}
    for node, others in edges.items():
        for other in others:
            back[other].append(node)
    seen: set[_Vertex] = set()
    found = [_reached([node], edges, seen) for node in reversed(_reached(number, back, set())) if node not in seen]
    return [sorted(group, key=number.__getitem__) for group in reversed(found)]


def _reached(roots: Iterable[_Vertex], edges: Mapping[_Vertex, list[_Vertex]], seen: set[_Vertex]) -> list[_Vertex]:
    """What can be reached, each after what it leads to, and put into ``seen``."""
    finished: list[_Vertex] = []
    for root in roots:
        path = [] if root in seen else [(root, iter(edges[root]))]
        seen.add(root)
        while path:
            name, rest = path[-1]
            following = next((other for other in rest if other not in seen), None)
            if following is None:
                finished.append(name)
                path.pop()
            else:
                seen.add(following)
                path.append((following, iter(edges[following])))
    return finished


def algebraic_loops(feeds: Feeds, depends: Depends) -> list[list[VariableReference]]:
    """Cycles in which every output depends directly on the input before it; of entangled ones, one.

    :returns: of each, outputs and the inputs that they feed in turn, the first one again at the end.
    """
    inputs: dict[str, list[VariableReference]] = {}
    for place in feeds:
        inputs.setdefault(place[0], []).append(place)
    nodes = dict.fromkeys([*feeds.values(), *feeds])
    edges: dict[VariableReference, list[VariableReference]] = {node: [] for node in nodes}
    for target, source in feeds.items():
        edges[source].append(target)
    for source in dict.fromkeys(feeds.values()):
        for place in inputs.get(source[0], ()):
            if depends(source, place):
                edges[place].append(source)
    return [_round(group[0], set(group), edges) for group in _strong(edges) if len(group) > 1]


def _round(start: _Vertex, group: Collection[_Vertex], edges: Mapping[_Vertex, list[_Vertex]]) -> list[_Vertex]:
    """A shortest way from a node back to itself, breadth first."""
    came: dict[_Vertex, _Vertex] = {}
    front = [start]
    while start not in came:
        following = [(other, node) for node in front for other in edges[node] if other in group and other not in came]
        came.update(reversed(following))
        front = list(dict.fromkeys(other for other, _ in following))
    way = [start, came[start]]
    while way[-1] != start:
        way.append(came[way[-1]])
    return way[::-1]


def order(names: Iterable[str], feeds: Feeds) -> list[str]:
    """Sources before what they feed; as added where nothing else is said, and within a cycle."""
    return [name for group in groups(names, feeds) for name in group]


def late_inputs(ordered: Sequence[str], feeds: Feeds, coupling: Coupling) -> list[VariableReference]:
    """Connected inputs whose value at the end of a step is not known when their component is stepped."""
    if coupling != "gauss-seidel":
        return list(feeds) if coupling == "jacobi" else []
    turn = {name: k for k, name in enumerate(ordered)}
    return [place for place, (source, _) in feeds.items() if turn[source] >= turn[place[0]]]


def consistent(ordered: Sequence[str], feeds: Feeds, depends: Depends) -> list[Operation]:
    """Make all outputs and inputs belong to the present instant: for initialization, and after it."""
    program = _Writer(ordered, feeds, depends)
    for name in ordered:
        program.get(name)
    return program.finish()


def step(
    ordered: Sequence[str], feeds: Feeds, depends: Depends, coupling: Coupling, newest: Collection[str]
) -> list[Operation]:
    """One communication step, from consistent values at t to consistent values at t + H.

    :param newest: components that are given the newest values before a step, instead of those at t.
    """
    program = _Writer(ordered, feeds, depends)
    if coupling == "jacobi":
        for name in ordered:
            program.step(name)
        for name in ordered:
            program.get(name)
        return program.finish()
    for name in ordered:
        if name in newest:
            program.set(name)
        program.step(name)
        program.get(name)
        program.refresh()
    return program.finish()


@final
class _Writer:
    """Operations that are written down, and which values belong to the new instant after them."""

    def __init__(self, ordered: Sequence[str], feeds: Feeds, depends: Depends) -> None:
        self._feeds = feeds
        self._depends = depends
        self._inputs: dict[str, list[VariableReference]] = {name: [] for name in ordered}
        self._outputs: dict[str, list[VariableReference]] = {name: [] for name in ordered}
        self._targets: dict[VariableReference, list[VariableReference]] = {}
        for place, source in feeds.items():
            self._inputs[place[0]].append(place)
            self._outputs[source[0]].append(source)
            self._targets.setdefault(source, []).append(place)
        self._operations: list[Operation] = []
        self._new: set[VariableReference] = set()
        self._waiting: dict[str, set[VariableReference]] = {}  # inputs that are still old, of components that were read
        self._missing: dict[str, int] = {}  # how many of them are fed by outputs that are old, too
        self._turn = {name: k for k, name in enumerate(ordered)}
        self._ready: list[tuple[int, str]] = []  # components that may have all of these new, as a heap
        self._partly: list[tuple[int, str]] = []  # components that may have some of these new

    def set(self, name: str) -> None:
        self._operations.append(("set", name))
        self._new.update(place for place in self._inputs[name] if self._feeds[place] in self._new)

    def step(self, name: str) -> None:
        self._operations.append(("step", name))

    def get(self, name: str) -> None:
        self._operations.append(("get", name))
        old = {place for place in self._inputs[name] if place not in self._new}
        self._waiting.pop(name, None)
        if old:
            self._waiting[name] = old
            self._missing[name] = sum(self._feeds[place] not in self._new for place in old)
            if self._missing[name] < len(old):
                heappush(self._partly, (self._turn[name], name))
            if self._missing[name] == 0:
                heappush(self._ready, (self._turn[name], name))
        self._renew(o for o in self._outputs[name] if not any(self._depends(o, place) for place in old))

    def _renew(self, outputs: Iterable[VariableReference]) -> None:
        """These outputs belong to the new instant."""
        for output in outputs:
            if output in self._new:
                continue
            self._new.add(output)
            for place in self._targets[output]:
                name = place[0]
                if place in self._waiting.get(name, ()):
                    self._missing[name] -= 1
                    heappush(self._partly, (self._turn[name], name))
                    if self._missing[name] == 0:
                        heappush(self._ready, (self._turn[name], name))

    def refresh(self) -> None:
        """Hand new outputs on to the components that were read and can have all their inputs new."""
        while self._ready:
            _, name = heappop(self._ready)
            if name in self._waiting and self._missing[name] == 0:
                self._visit(name)

    def finish(self) -> list[Operation]:
        """Refresh everything, going round cycles once, and drop readings that nobody looks at."""
        self.refresh()
        while self._waiting:
            partly = self._next_partly()
            if partly is not None:
                self._visit(partly)
            else:  # outputs depend directly on inputs all the way round: begin with what there is
                first = min(self._waiting, key=self._turn.__getitem__)
                self._renew([self._feeds[place] for place in self._inputs[first] if place in self._waiting[first]])
            self.refresh()
        return self._useful()

    def _next_partly(self) -> str | None:
        while self._partly:
            _, name = heappop(self._partly)
            if self._missing.get(name, 0) < len(self._waiting.get(name, ())):
                return name
        return None

    def _visit(self, name: str) -> None:
        self.set(name)
        self.get(name)

    def _useful(self) -> list[Operation]:
        """The operations without those readings after which the same is read again before it is handed on."""
        useful: list[Operation] = []
        again: set[str] = set()
        for action, name in reversed(self._operations):
            if action == "set":
                again.difference_update(self._feeds[place][0] for place in self._inputs[name])
            if action != "get" or name not in again:
                useful.append((action, name))
            if action == "get":
                again.add(name)
        return useful[::-1]
