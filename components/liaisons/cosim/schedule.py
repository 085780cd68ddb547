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
t and is given them; one that interpolates remembers those at t and is given those at t + H.  An FMU of another make
is given the newest values that there are.  With Jacobi coupling every input holds the value at t.

In a cycle the components are stepped in the order in which they were added, and what feeds back to an earlier one
belongs to t: an error of first order in H.  If in a cycle outputs depend directly on inputs all the way round (an
acceleration-force loop), one sweep in that order stands for the solution.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from typing import Literal, final

Coupling = Literal["gauss-seidel", "jacobi"]
Action = Literal["set", "step", "get"]
Operation = tuple[Action, str]
"""Set all connected inputs of a component, step it, or read its outputs."""

Place = tuple[str, str]
"""A variable of a system: component and name."""

Feeds = Mapping[Place, Place]
"""Input -> the output that feeds it."""

Depends = Callable[[Place, Place], bool]
"""Whether an output depends directly on an input of the same component."""


def groups(names: Iterable[str], feeds: Feeds) -> list[list[str]]:
    """Sources before what they feed; each cycle is one group, its components as they were added.

    Where connections say nothing, the order of addition stays.  (Kosaraju's algorithm.)
    """
    number = {name: k for k, name in enumerate(names)}
    sources: dict[str, list[str]] = {name: [] for name in number}
    targets: dict[str, list[str]] = {name: [] for name in number}
    for (target, _), (source, _) in feeds.items():
        sources[target].append(source)
        targets[source].append(target)
    seen: set[str] = set()
    found = [_reached([name], targets, seen) for name in reversed(_reached(number, sources, set())) if name not in seen]
    return [sorted(group, key=number.__getitem__) for group in reversed(found)]


def _reached(roots: Iterable[str], edges: Mapping[str, list[str]], seen: set[str]) -> list[str]:
    """What can be reached, each after what it leads to, and put into ``seen``."""
    finished: list[str] = []
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


def order(names: Iterable[str], feeds: Feeds) -> list[str]:
    """Sources before what they feed; as added where nothing else is said, and within a cycle."""
    return [name for group in groups(names, feeds) for name in group]


def late_inputs(ordered: Sequence[str], feeds: Feeds, name: str, coupling: Coupling) -> list[Place]:
    """Connected inputs of a component whose value at the end of a step is not known when it is stepped."""
    earlier = set(ordered[: ordered.index(name)]) if coupling == "gauss-seidel" else set()
    return [place for place, (source, _) in feeds.items() if place[0] == name and source not in earlier]


def consistent(ordered: Sequence[str], feeds: Feeds, depends: Depends) -> list[Operation]:
    """Make all outputs and inputs belong to the present instant: for initialization, and after it."""
    program = _Program(ordered, feeds, depends)
    for name in ordered:
        program.get(name)
    return program.finish()


def step(
    ordered: Sequence[str], feeds: Feeds, depends: Depends, coupling: Coupling, newest: Collection[str]
) -> list[Operation]:
    """One communication step, from consistent values at t to consistent values at t + H.

    :param newest: components that are given the newest values before a step, instead of those at t.
    """
    program = _Program(ordered, feeds, depends)
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
class _Program:
    """Operations that are written down, and which values belong to the new instant after them."""

    def __init__(self, ordered: Sequence[str], feeds: Feeds, depends: Depends) -> None:
        self._feeds = feeds
        self._depends = depends
        self._inputs: dict[str, list[Place]] = {name: [] for name in ordered}
        self._outputs: dict[str, list[Place]] = {name: [] for name in ordered}
        for place, source in feeds.items():
            self._inputs[place[0]].append(place)
            self._outputs[source[0]].append(source)
        self._operations: list[Operation] = []
        self._new: set[Place] = set()
        self._waiting: dict[str, list[Place]] = {}  # inputs that are still old, of components that were read

    def set(self, name: str) -> None:
        self._operations.append(("set", name))
        self._new.update(place for place in self._inputs[name] if self._feeds[place] in self._new)

    def step(self, name: str) -> None:
        self._operations.append(("step", name))

    def get(self, name: str) -> None:
        self._operations.append(("get", name))
        old = [place for place in self._inputs[name] if place not in self._new]
        self._new.update(o for o in self._outputs[name] if not any(self._depends(o, place) for place in old))
        if old:
            self._waiting[name] = old
        else:
            self._waiting.pop(name, None)

    def refresh(self) -> None:
        """Hand new outputs on to the components that were read and can have all their inputs new."""
        while (ready := self._first(all)) is not None:
            self._visit(ready)

    def finish(self) -> list[Operation]:
        """Refresh everything, going round cycles once, and drop readings that nobody looks at."""
        self.refresh()
        while self._waiting:
            partly = self._first(any)
            if partly is not None:
                self._visit(partly)
            else:  # outputs depend directly on inputs all the way round: begin with what there is
                first = next(iter(self._waiting.values()))
                self._new.update(self._feeds[place] for place in first)
            self.refresh()
        return self._useful()

    def _first(self, quantity: Callable[[Iterable[bool]], bool]) -> str | None:
        """The first component of whose old inputs all, or any, are fed by new outputs."""
        waiting = self._waiting.items()
        return next((name for name, old in waiting if quantity(self._feeds[place] in self._new for place in old)), None)

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
