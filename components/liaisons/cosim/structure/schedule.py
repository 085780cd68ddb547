"""Order in which the FMUs of a system are set, stepped and read, from its graph alone.

Values of inputs: at every communication point all outputs and inputs belong to the same instant t (inputs are
refreshed, outputs that depend on them directly are read again), and that is what is recorded.  Over the step from t
to t + H, with Gauss-Seidel coupling::

                                    t                                     t + H
    source                          y(t) ------------ doStep -----------> y(t + H)
    target, hold or extrapolate     u = y(t) -------- doStep -----------> u := y(t + H), outputs are read
    target, interpolate             u := y(t + H) --- doStep -----------> outputs are read
    foreign target                  u := y(t + H) --- doStep -----------> outputs are read

An FMU of ours (it has the parameter ``input_reconstruction``) that holds or extrapolates is given the inputs at t.  One
that interpolates still has the inputs at t, and is given those at t + H.  By default every FMU whose sources are
stepped before it interpolates, since its order at ports is then 6 instead of 3.  A foreign FMU gets the newest values.
With Jacobi coupling every input holds the value at t.

In a cycle the components are stepped in the order in which they were added, and values that feed back to an earlier
component are those at t: an error of first order in H.  If in a cycle outputs depend directly on inputs all the way
round (an acceleration-force loop), the loop is not solved: one sweep in that order is taken instead of the solution.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Collection, Hashable, Iterable, Mapping, Sequence
from heapq import heappop, heappush
from itertools import count
from operator import itemgetter
from typing import Literal, TypeVar, final

Coupling = Literal["gauss-seidel", "jacobi", "implicit", "waveform"]
Action = Literal["set", "step", "get"]
Operation = tuple[Action, str]
"""An operation on a component, by name: set all its connected inputs, step it, or get its outputs."""

VariableReference = tuple[str, str]
"""A variable of a system: component and name."""

component_of = itemgetter(0)
"""Component of a variable of a system."""
name_of = itemgetter(1)
"""Name of a variable in its component."""

Feeds = Mapping[VariableReference, VariableReference]
"""Reference of each connected input -> reference of the output that feeds it."""

OutputInput = tuple[VariableReference, VariableReference]
"""An output and an input."""

Depends = Callable[[VariableReference, VariableReference], bool]
"""Whether an output depends directly on an input of the same component."""

_Vertex = TypeVar("_Vertex", bound=Hashable)


def strong_components(names: Iterable[str], feeds: Feeds) -> list[list[str]]:
    """Strong components of the connection graph, lists of names, in execution order.

    Names in a strong component, and unconnected ones, keep their order.  (Kosaraju's algorithm.)
    """
    targets: dict[str, dict[str, None]] = {}
    for name in names:
        targets[name] = {}
    for (target, _), (source, _) in feeds.items():
        targets[source][target] = None
    return _strong_components(targets)


def _strong_components(edges: Mapping[_Vertex, Iterable[_Vertex]]) -> list[list[_Vertex]]:
    """Strongly connected components of a graph in topological order; each keeps the order of its vertices."""
    number = dict(zip(edges, count()))
    sources: defaultdict[_Vertex, list[_Vertex]] = defaultdict(list)
    for node, targets in edges.items():
        for target in targets:
            sources[target].append(node)
    seen: set[_Vertex] = set()
    components = [
        sorted(_postorder([node], edges, seen), key=number.__getitem__)
        for node in reversed(_postorder(edges, sources, set()))
        if node not in seen
    ]
    return components[::-1]


def _postorder(
    roots: Iterable[_Vertex], edges: Mapping[_Vertex, Iterable[_Vertex]], seen: set[_Vertex]
) -> list[_Vertex]:
    """Unseen vertices that are reachable from roots, in postorder; they are added to ``seen``."""
    finished: list[_Vertex] = []
    for root in roots:
        path = [] if root in seen else [(root, iter(edges[root]))]
        seen.add(root)
        while path:
            name, rest = path[-1]
            for other in rest:
                if other not in seen:
                    seen.add(other)
                    path.append((other, iter(edges[other])))
                    break
            else:
                finished.append(name)
                path.pop()
    return finished


def shortest_algebraic_loops(feeds: Feeds, depends: Depends) -> list[list[VariableReference]]:
    """One shortest algebraic loop of each strong component: outputs that depend directly on each other.

    :returns: lists of outputs and of the inputs that they feed, in turn; the first reference is repeated at the end.
    """
    inputs: dict[str, list[VariableReference]] = {}
    for input_ in feeds:
        inputs.setdefault(input_[0], []).append(input_)
    nodes = dict.fromkeys([*feeds.values(), *feeds])
    edges: dict[VariableReference, list[VariableReference]] = {node: [] for node in nodes}
    for target, source in feeds.items():
        edges[source].append(target)
    for source in dict.fromkeys(feeds.values()):
        for input_ in inputs.get(source[0], ()):
            if depends(source, input_):
                edges[input_].append(source)
    return [_shortest_cycle(group[0], set(group), edges) for group in _strong_components(edges) if len(group) > 1]


def _shortest_cycle(
    start: _Vertex, group: Collection[_Vertex], edges: Mapping[_Vertex, list[_Vertex]]
) -> list[_Vertex]:
    """Shortest cycle through a vertex inside a group, by breadth-first search; its last vertex is the first."""
    before: dict[_Vertex, _Vertex] = {}
    front = [start]
    while start not in before:
        following = [(other, node) for node in front for other in edges[node] if other in group and other not in before]
        before.update(reversed(following))
        front = list(dict.fromkeys(other for other, _ in following))
    cycle = [start, before[start]]
    while cycle[-1] != start:
        cycle.append(before[cycle[-1]])
    return cycle[::-1]


def late_inputs(ordered: Sequence[str], feeds: Feeds, coupling: Coupling) -> list[VariableReference]:
    """Connected inputs whose value at the end of a step is unknown when their component is stepped."""
    if coupling != "gauss-seidel":
        return list(feeds) if coupling == "jacobi" else []
    position = {name: k for k, name in enumerate(ordered)}
    return [input_ for input_, (source, _) in feeds.items() if position[source] >= position[input_[0]]]


def consistent_program(ordered: Sequence[str], feeds: Feeds, depends: Depends) -> list[Operation]:
    """Operations after which all inputs and outputs belong to one instant, for initialization."""
    program = _ProgramWriter(ordered, feeds, depends)
    for name in ordered:
        program.append_get(name)
    return program.finish()


def step_program(
    ordered: Sequence[str], feeds: Feeds, depends: Depends, coupling: Coupling, newest: Collection[str]
) -> list[Operation]:
    """Operations of a communication step, from consistent values at t to consistent values at t + H.

    :param newest: components whose inputs are set to the newest values before they are stepped.
    """
    program = _ProgramWriter(ordered, feeds, depends)
    if coupling == "jacobi":
        for name in ordered:
            program.append_step(name)
        for name in ordered:
            program.append_get(name)
        return program.finish()
    for name in ordered:
        if name in newest:
            program.append_set(name)
        program.append_step(name)
        program.append_get(name)
        program.refresh()
    return program.finish()


@final
class _ProgramWriter:
    """A growing list of operations, and the variables that have their new values after them."""

    def __init__(self, ordered: Sequence[str], feeds: Feeds, depends: Depends) -> None:
        self._feeds = feeds
        self._depends = depends
        self._inputs: dict[str, list[VariableReference]] = {name: [] for name in ordered}
        self._outputs: dict[str, list[VariableReference]] = {name: [] for name in ordered}
        self._targets: dict[VariableReference, list[VariableReference]] = {}
        for input_, source in feeds.items():
            self._inputs[input_[0]].append(input_)
            self._outputs[source[0]].append(source)
            self._targets.setdefault(source, []).append(input_)
        self._operations: list[Operation] = []
        self._new: set[VariableReference] = set()
        self._old_inputs: dict[str, set[VariableReference]] = {}  # of components that were read
        self._position = {name: k for k, name in enumerate(ordered)}
        self._ready: list[tuple[bool, int, str]] = []  # heap of components that new outputs feed; True: in part

    def append_set(self, name: str) -> None:
        """Append an operation that sets the inputs of a component."""
        self._operations.append(("set", name))
        self._new.update(input_ for input_ in self._inputs[name] if self._feeds[input_] in self._new)

    def append_step(self, name: str) -> None:
        """Append an operation that steps a component."""
        self._operations.append(("step", name))

    def append_get(self, name: str) -> None:
        """Append an operation that reads the outputs of a component."""
        self._operations.append(("get", name))
        old = {input_ for input_ in self._inputs[name] if input_ not in self._new}
        self._old_inputs.pop(name, None)
        if old:
            self._old_inputs[name] = old
            self._queue_component(name)
        self._mark_new(o for o in self._outputs[name] if not any(self._depends(o, input_) for input_ in old))

    def _mark_new(self, outputs: Iterable[VariableReference]) -> None:
        """Mark outputs whose values are new, and queue the components that they feed."""
        fresh = [output for output in outputs if output not in self._new]
        self._new.update(fresh)
        fed = [input_ for output in fresh for input_ in self._targets[output]]
        for name in dict.fromkeys(name for name, _ in fed):
            self._queue_component(name)

    def _queue_component(self, name: str) -> None:
        """Add a component to the heap if old inputs of it can be set to new values."""
        if count := self._count_settable(name):
            heappush(self._ready, (count < len(self._old_inputs[name]), self._position[name], name))

    def _count_settable(self, name: str) -> int:
        """Number of old inputs of a component that new outputs feed."""
        return [self._feeds[input_] in self._new for input_ in self._old_inputs.get(name, ())].count(True)

    def refresh(self) -> None:
        """Append the operations that set and read components all of whose old inputs can be set to new values."""
        while self._ready and not self._ready[0][0]:
            *_, name = heappop(self._ready)
            if (count := self._count_settable(name)) and count == len(self._old_inputs[name]):
                self._set_and_get(name)

    def finish(self) -> list[Operation]:
        """Append operations until no input is old, with one sweep in a cycle; returns all that are needed."""
        self.refresh()
        while self._old_inputs:
            if self._ready:
                *_, name = heappop(self._ready)
                if self._count_settable(name):
                    self._set_and_get(name)
            else:  # an algebraic loop: start with old values
                first = min(self._old_inputs, key=self._position.__getitem__)
                self._mark_new(
                    [self._feeds[input_] for input_ in self._inputs[first] if input_ in self._old_inputs[first]]
                )
            self.refresh()
        return self._needed_operations()

    def _set_and_get(self, name: str) -> None:
        self.append_set(name)
        self.append_get(name)

    def _needed_operations(self) -> list[Operation]:
        """The operations, without readings that are repeated before they are used."""
        useful: list[Operation] = []
        again: set[str] = set()
        for action, name in reversed(self._operations):
            if action == "set":
                again.difference_update(self._feeds[input_][0] for input_ in self._inputs[name])
            if action != "get" or name not in again:
                useful.append((action, name))
            if action == "get":
                again.add(name)
        return useful[::-1]
