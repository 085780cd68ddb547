"""Composition of connected models into one: the reference for a co-simulation of them.

The inputs v that are connected obey v = h(t, y, v), where h are outputs of the models.  Most follow one from the other;
where they need each other, as acceleration and force between two mechanisms do, h is linear in them and is solved
symbolically.  So the one model has no coupling error: it is the equations of motion of the whole.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import reduce
from typing import Any

import casadi as ca
import numpy as np

from liaisons.errors import ComponentError, suggestion
from liaisons.language.variables import Terminal, TerminalMember, Variable
from liaisons.mechanics.functions import model_functions, results_of
from liaisons.mechanics.model import NEXT_EVENT, ActiveInput, Contact, Equation, Model, State
from liaisons.mechanics.unilateral import with_modes


def compose(
    name: str,
    models: Mapping[str, Model],
    connections: Mapping[str, str],
    *,
    starts: Mapping[str, float] | None = None,
) -> Model:
    """Model of several connected models, with the equations of the connections solved.

    Its variables are called ``part.variable``; its default experiment is that of the longest part.  Inputs that are
    connected become outputs, and the ports that they belong to are closed.

    :param models: the models by the name of the part.
    :param connections: by input the output that it takes its value from, ``{"swing.length": "motor.y"}``.
    :param starts: start values of parameters and inputs where they differ from the models', ``{"swing.theta_0": 0.1}``.
    :raises ComponentError: for an unknown variable, or inputs that depend on each other in a way that is not linear.
    """
    parts = [_named(part, (model.relaxed or model).flat()) for part, model in models.items()]
    longest = max((part.experiment for part in parts), key=lambda e: e.stop_time)
    values = {variable: float(value) for variable, value in (starts or {}).items()}
    _check(name, parts, connections, values)
    joined = _Joined(name, parts, connections)

    def started(variables: Iterable[Variable]) -> tuple[Variable, ...]:
        left = (v for v in variables if v.name not in connections)
        return tuple(replace(v, start=values.get(v.name, v.start)) for v in left)

    inner = (replace(v, causality="output", start=None) for v in _all(parts, "inputs") if v.name in connections)
    conditions = joined.conditions()
    contacts = _all(parts, "contacts")
    whole = Model(
        name=name,
        description="composition of " + ", ".join(f"{part} ({model.name})" for part, model in models.items()),
        documentation=_documentation(models, connections),
        parameters=started(_all(parts, "parameters")),
        inputs=started(_all(parts, "inputs")),
        outputs=(*_all(parts, "outputs"), *inner),
        states=_all(parts, "states"),
        memory=_all(parts, "memory"),
        **joined.functions(row for _, row in conditions),
        condition_texts=tuple(text for text, _ in conditions),
        start_only=sum(part.start_only for part in parts),
        active=tuple(a for a in _all(parts, "active") if a.value not in connections),
        ports=tuple(p for p in _all(parts, "ports") if not any(m.variable in connections for m in p.members)),
        experiment=replace(longest, reference={}),  # the start values are those of the whole
        equations=tuple(_equations(models, connections)),
        contacts=contacts,
    )
    return with_modes(whole) if contacts else whole


def _equations(models: Mapping[str, Model], connections: Mapping[str, str]) -> Iterator[Equation]:
    """Those of the parts, with the name of the part in front of all names, and the connections."""
    for part, model in models.items():
        for e in model.equations:
            own = [symbol for symbol in ca.symvar(e.right) if symbol.name() != "t"]
            full = [ca.SX.sym(f"{part}.{symbol.name()}") for symbol in own]
            right = ca.substitute(e.right, ca.vertcat(*own), ca.vertcat(*full))
            yield Equation(e.section, e.left if e.left == "0" else f"{part}.{e.left}", right)
    for target, source in connections.items():
        yield Equation("connections", target, ca.SX.sym(source))


def _named(part: str, model: Model) -> Model:
    """Model with the name of the part in front of all names."""

    def full(name: str) -> str:
        return f"{part}.{name}"

    return replace(
        model,
        **{
            group: tuple(
                replace(v, name=full(v.name), derivative_of=v.derivative_of and full(v.derivative_of))
                for v in getattr(model, group)
            )
            for group in ("parameters", "inputs", "outputs")
        },
        states=tuple(State(full(s.name), full(s.derivative)) for s in model.states),
        memory=tuple(map(full, model.memory)),
        contacts=tuple(Contact(full(c.name), c.friction, c.normal and full(c.normal)) for c in model.contacts),
        condition_texts=tuple(f"{part}: {text}" for text in model.condition_texts),
        active=tuple(ActiveInput(full(a.value), full(a.rate), full(a.acceleration)) for a in model.active),
        ports=tuple(
            Terminal(full(p.name), p.kind, tuple(TerminalMember(m.role, full(m.variable)) for m in p.members))
            for p in model.ports
        ),
    )


def _all(parts: Iterable[Model], group: str) -> tuple[Any, ...]:
    """Members of all parts of one kind."""
    return tuple(item for part in parts for item in getattr(part, group))


@dataclass(frozen=True, eq=False)
class _Part:
    """A model with its symbols; some of its inputs are connected."""

    model: Model
    t: Any
    y: Any
    u: Any
    k: Any
    m: Any

    def at(self, group: str, y: Any = None, m: Any = None) -> list[Any]:
        """Results of one of the model's functions, at other states or memory if need be."""
        vectors = {"t": self.t, "y": self.y if y is None else y, "u": self.u, "k": self.k}
        return results_of(group, getattr(self.model, group), vectors | {"m": self.m if m is None else m})


class _Joined:
    """Functions of all parts as those of one model."""

    def __init__(self, name: str, models: Sequence[Model], connections: Mapping[str, str]) -> None:
        scalar = all(model.outputs_function.is_a("SXFunction") for model in models)
        kind: Any = ca.SX if scalar else ca.MX
        self.name, self.kind, self.t = name, kind, kind.sym("t")
        inputs = [v.name for v in _all(models, "inputs")]
        self.inner = [variable for variable in inputs if variable in connections]
        self.v = kind.sym("v", len(self.inner))
        self.u = kind.sym("u", len(inputs) - len(self.inner))
        inner, outer = iter(range(self.v.shape[0])), iter(range(self.u.shape[0]))
        symbol_of = {v: self.v[next(inner)] if v in connections else self.u[next(outer)] for v in inputs}
        counts = [[len(getattr(m, group)) for m in models] for group in ("states", "parameters", "memory")]
        self.y, self.k, self.m = (kind.sym(letter, sum(count)) for letter, count in zip("ykm", counts, strict=True))
        split = [
            ca.vertsplit(vector, np.cumsum([0, *count]).tolist())
            for vector, count in zip((self.y, self.k, self.m), counts, strict=True)
        ]
        self.parts = [
            _Part(model, self.t, y, self._stack(symbol_of[v.name] for v in model.inputs), k, m)
            for model, y, k, m in zip(models, *split, strict=True)
        ]
        outputs = [v.name for v in _all(models, "outputs")]
        self.sources = [outputs.index(connections[variable]) for variable in self.inner]

    def functions(self, conditions: Iterable[Any]) -> dict[str, Any]:
        """Functions of the model, by name."""
        z = self._stacked("outputs_function")
        v = self._solved(z)
        start = [part.at("start") for part in self.parts]
        y_0, m_0 = (self._stack(column) for column in zip(*start, strict=True))
        z_0 = self._stack(part.at("outputs_function", *at)[0] for part, at in zip(self.parts, start, strict=True))
        v_0 = self._solved(z_0)

        def connected(expression: Any, values: Any = v) -> Any:
            return ca.substitute(expression, self.v, values) if self.inner else expression

        results = {
            "start": (connected(y_0, v_0), connected(m_0, v_0)),
            "outputs_function": connected(self._stack([z, self.v])),
            "conditions": connected(self._stack(conditions)),
            "events": self._stacked("events"),
        }
        results |= {name: connected(self._stacked(name)) for name in ("derivatives", "nominals", "jump", "remember")}
        if any(part.model.project is not None for part in self.parts):
            rows = (part.y if part.model.project is None else part.at("project")[0] for part in self.parts)
            results["project"] = connected(self._stack(rows))
        announcing = [part.at("draw")[0] for part in self.parts if NEXT_EVENT in part.model.drawn]
        results["draw"] = connected(reduce(ca.fmin, announcing)) if announcing else None
        vectors = {"t": self.t, "y": self.y, "u": self.u, "k": self.k, "m": self.m}
        return {**model_functions(vectors, results), "drawn": (NEXT_EVENT,) if announcing else ()}

    def conditions(self) -> list[tuple[str, Any]]:
        """Conditions with their messages: domains of connected inputs, lasting ones, then those of the start."""
        lasting, at_start = [*self._domains()], []
        for part in self.parts:
            texts = part.model.condition_texts
            conditions_of_part = list(zip(texts, ca.vertsplit(part.at("conditions")[0]) if texts else [], strict=True))
            count = len(conditions_of_part) - part.model.start_only
            lasting, at_start = lasting + conditions_of_part[:count], at_start + conditions_of_part[count:]
        return lasting + at_start

    def _domains(self) -> Iterator[tuple[str, Any]]:
        variables = {v.name: v for part in self.parts for v in part.model.inputs}
        for i, name in enumerate(self.inner):
            low, high, unit = variables[name].minimum, variables[name].maximum, variables[name].unit
            if low is not None:
                yield f"{name} must stay > {low:g} {unit}", self.v[i] - low
            if high is not None:
                yield f"{name} must stay < {high:g} {unit}", high - self.v[i]

    def _stacked(self, group: str) -> Any:
        return self._stack(part.at(group)[0] for part in self.parts)

    def _stack(self, columns: Any) -> Any:
        rows = [self.kind(column) for column in columns]
        return ca.vertcat(*rows) if rows else self.kind(0, 1)

    def _solved(self, z: Any) -> Any:
        """v from v = h(v), h the outputs that the inputs are connected to: set by set, in the order of dependence."""
        if not self.inner:
            return self.v
        booked = self.m.shape[0] and ca.jacobian_sparsity(z[self.sources], self.m).nnz()
        if booked:
            raise ComponentError(f"{self.name}: work and energy_balance cannot be connected; integrate the power")
        h = ca.substitute(z[self.sources], self.m, self.kind.zeros(*self.m.shape))
        needs = _needs(ca.jacobian_sparsity(h, self.v))
        solved = [self.kind(0)] * len(self.inner)
        left = set(range(len(solved)))
        while left:
            # The input with the fewest open dependences has none, or is in a loop with all of them.
            first = min(left, key=lambda i: (len(needs[i] & left), i))
            members = sorted(needs[first] & left)
            explicit = ca.substitute(h, self.v, ca.vertcat(*solved))  # members are 0 in it
            values = self._loop(h, members, solved, explicit[members]) if members else explicit[first]
            for i, value in zip(members or [first], ca.vertsplit(values), strict=True):
                solved[i] = value
            left -= {first, *members}
        return ca.vertcat(*solved)

    def _loop(self, h: Any, members: list[int], solved: list[Any], explicit: Any) -> Any:
        """Values v of an algebraic loop, h = H v + explicit."""
        inside = ca.vertcat(*(self.v[i] if i in members else value for i, value in enumerate(solved)))
        H = ca.jacobian(ca.substitute(h, self.v, inside)[members], self.v)[:, members]
        if ca.depends_on(H, self.v):
            names = ", ".join(self.inner[i] for i in members)
            raise ComponentError(f"{self.name}: {names} depend on each other, and not linearly; open the loop")
        return ca.solve(ca.densify(self.kind.eye(len(members)) - H), explicit)


def _needs(pattern: ca.Sparsity) -> list[set[int]]:
    """Transitive dependences of each input."""
    reach = np.zeros(pattern.shape, dtype=bool)
    reach[tuple(np.array(pattern.get_triplet(), dtype=int))] = True
    for k in range(len(reach)):  # Warshall
        reach |= np.outer(reach[:, k], reach[k])
    return [set(np.flatnonzero(row).tolist()) for row in reach]


def _documentation(models: Mapping[str, Model], connections: Mapping[str, str]) -> str:
    parts = [f"{part}: {model.description}" for part, model in models.items()]
    wires = [f"    {target} = {source}" for target, source in connections.items()]
    return "\n".join(["Composition of connected components.", "", *parts, "", "Connections::", "", *wires])


def _check(name: str, parts: Sequence[Model], connections: Mapping[str, str], starts: Mapping[str, float]) -> None:
    inputs, outputs, parameters = ([v.name for v in _all(parts, of)] for of in ("inputs", "outputs", "parameters"))
    for kind, names, declared in (
        ("input", connections.keys(), inputs),
        ("output", connections.values(), outputs),
        ("parameter or input", starts.keys(), [*inputs, *parameters]),
    ):
        for variable in names:
            if variable not in declared:
                raise ComponentError(f"{name}: no {kind} is called {variable!r}{suggestion(variable, declared)}")
