"""Models that are connected become one model: the reference that a co-simulation of them is measured against.

The inputs v that are connected obey v = h(t, y, v), where h are outputs of the models.  Most follow one from the other;
where they need each other, as acceleration and force between two mechanisms do, h is linear in them and is solved
symbolically.  So the one model has no coupling error: it is the equations of motion of the whole.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any

import casadi as ca
import numpy as np

from liaisons.errors import ComponentError, suggestion
from liaisons.language.variables import Experiment, Terminal, TerminalMember, Variable
from liaisons.mechanics.bookkeeping import function
from liaisons.mechanics.model import ActiveInput, Model, State


def compose(
    name: str,
    models: Mapping[str, Model],
    connections: Mapping[str, str],
    *,
    starts: Mapping[str, float] | None = None,
    experiment: Experiment | None = None,
) -> Model:
    """One model out of several, with their connections solved.

    Its variables are called ``part.variable``.  Inputs that are connected become outputs, and the ports that
    they belong to are closed.

    :param models: the models by the name of the part.
    :param connections: by input the output that it takes its value from, ``{"swing.length": "motor.y"}``.
    :param starts: start values of parameters and inputs where they differ from the models', ``{"swing.theta_0": 0.1}``.
    :param experiment: default experiment; that of the longest part unless given.
    :raises ComponentError: for an unknown variable, or inputs that depend on each other in a way that is not linear.
    """
    flat = {part: model.flat() for part, model in models.items()}
    values = {variable: float(value) for variable, value in (starts or {}).items()}
    found = {group: [v for p, m in flat.items() for v in _named(p, m, group)] for group in _GROUPS}
    _check(name, found, connections, values)
    joined = _Joined(name, flat, connections)

    def started(variables: list[Variable]) -> tuple[Variable, ...]:
        left = (v for v in variables if v.name not in connections)
        return tuple(replace(v, start=values.get(v.name, v.start)) for v in left)

    inner = (v for v in found["inputs"] if v.name in connections)
    ports = (port for p, m in flat.items() for port in _ports(p, m))
    triples = ((p, a) for p, m in flat.items() for a in m.active)
    return Model(
        name=name,
        description="composition of " + ", ".join(f"{part} ({model.name})" for part, model in flat.items()),
        documentation=_documentation(flat, connections),
        parameters=started(found["parameters"]),
        inputs=started(found["inputs"]),
        outputs=(*found["outputs"], *(replace(v, causality="output", start=None) for v in inner)),
        states=tuple(State(f"{p}.{s.name}", f"{p}.{s.derivative}") for p, m in flat.items() for s in m.states),
        memory=tuple(f"{p}.{memory}" for p, m in flat.items() for memory in m.memory),
        **joined.functions(),
        condition_texts=tuple(text for text, _ in joined.conditions()),
        start_only=sum(model.start_only for model in flat.values()),
        active=tuple(
            ActiveInput(f"{p}.{a.value}", f"{p}.{a.rate}", f"{p}.{a.acceleration}")
            for p, a in triples
            if f"{p}.{a.value}" not in connections
        ),
        ports=tuple(port for port in ports if not any(member.variable in connections for member in port.members)),
        experiment=experiment or max((model.experiment for model in flat.values()), key=lambda e: e.stop_time),
    )


_GROUPS = ("parameters", "inputs", "outputs")


@dataclass(frozen=True, eq=False)
class _Part:
    """One model and the symbols that are its own; of its inputs some are connected."""

    name: str
    model: Model
    y: Any
    u: Any
    k: Any
    m: Any

    def at(self, group: str, t: Any, y: Any = None, m: Any = None) -> list[Any]:
        """Results of one of the model's functions; for state and memory others may be put in."""
        called: ca.Function = getattr(self.model, group)
        if group == "start":
            return list(called.call([t, self.u, self.k]))
        if group == "events":
            return list(called.call([self.k]))
        arguments = [t, self.y if y is None else y, self.u, self.k, self.m if m is None else m]
        return list(called.call(arguments[: called.n_in()]))


class _Joined:
    """The functions of all parts as those of one model."""

    def __init__(self, name: str, models: Mapping[str, Model], connections: Mapping[str, str]) -> None:
        scalar = all(model.outputs_function.is_a("SXFunction") for model in models.values())
        kind: Any = ca.SX if scalar else ca.MX
        self.name, self.kind = name, kind
        self.t = kind.sym("t")
        inputs = [v.name for p, m in models.items() for v in _named(p, m, "inputs")]
        self.inner = [variable for variable in inputs if variable in connections]
        self.v = kind.sym("v", len(self.inner))
        self.u = kind.sym("u", len(inputs) - len(self.inner))
        inner, outer = iter(range(self.v.shape[0])), iter(range(self.u.shape[0]))
        place = {v: self.v[next(inner)] if v in connections else self.u[next(outer)] for v in inputs}
        counts = [(len(m.states), len(m.parameters), len(m.memory)) for m in models.values()]
        self.y, self.k, self.m = (
            kind.sym(letter, sum(column)) for letter, column in zip("ykm", zip(*counts, strict=True), strict=True)
        )
        split = [
            ca.vertsplit(vector, np.cumsum([0, *column]).tolist())
            for vector, column in zip((self.y, self.k, self.m), zip(*counts, strict=True), strict=True)
        ]
        self.parts = [
            _Part(p, model, y, self._stack(place[v.name] for v in _named(p, model, "inputs")), k, m)
            for (p, model), y, k, m in zip(models.items(), *split, strict=True)
        ]
        outputs = [v.name for p, m in models.items() for v in _named(p, m, "outputs")]
        self.sources = [outputs.index(connections[variable]) for variable in self.inner]

    def functions(self) -> dict[str, Any]:
        """The functions of the model, by name."""
        motion = [self.t, self.y, self.u, self.k]
        booked = [*motion, self.m]
        z = self._all("outputs_function")
        v = self._solved(z)
        start = [part.at("start", self.t) for part in self.parts]
        y_0, m_0 = (self._stack(column) for column in zip(*start, strict=True))
        z_0 = self._stack(
            part.at("outputs_function", self.t, y, m)[0] for part, (y, m) in zip(self.parts, start, strict=True)
        )
        v_0 = self._solved(z_0)

        def connected(expression: Any, values: Any = v) -> Any:
            return ca.substitute(expression, self.v, values) if self.inner else expression

        whole = {
            "start": function("start", [self.t, self.u, self.k], connected(y_0, v_0), connected(m_0, v_0)),
            "outputs_function": function("outputs", booked, connected(self._stack([z, self.v]))),
            "conditions": function("conditions", motion, connected(self._stack(row for _, row in self.conditions()))),
            "events": function("events", [self.k], self._all("events")),
        }
        for group, arguments in (("derivatives", motion), ("nominals", motion), ("jump", booked), ("remember", booked)):
            whole[group] = function(group, arguments, connected(self._all(group)))
        if any(part.model.project is not None for part in self.parts):
            rows = (part.y if part.model.project is None else part.at("project", self.t)[0] for part in self.parts)
            whole["project"] = function("project", motion, connected(self._stack(rows)))
        return whole

    def conditions(self) -> list[tuple[str, Any]]:
        """By the message to give: domains of the connected inputs, conditions that last, then those of the start."""
        lasting, at_start = [*self._domains()], []
        for part in self.parts:
            rows = ca.vertsplit(part.at("conditions", self.t)[0]) if part.model.condition_texts else []
            found = [(f"{part.name}: {text}", row) for text, row in zip(part.model.condition_texts, rows, strict=True)]
            count = len(found) - part.model.start_only
            lasting, at_start = lasting + found[:count], at_start + found[count:]
        return lasting + at_start

    def _domains(self) -> Iterator[tuple[str, Any]]:
        variables = {v.name: v for part in self.parts for v in _named(part.name, part.model, "inputs")}
        for i, name in enumerate(self.inner):
            low, high, unit = variables[name].minimum, variables[name].maximum, variables[name].unit
            if low is not None:
                yield f"{name} must stay > {low:g} {unit}", self.v[i] - low
            if high is not None:
                yield f"{name} must stay < {high:g} {unit}", high - self.v[i]

    def _all(self, group: str) -> Any:
        return self._stack(part.at(group, self.t)[0] for part in self.parts)

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
            # What needs the fewest of those left needs none, or is in a loop with all that it needs.
            first = min(left, key=lambda i: (len(needs[i] & left), i))
            members = sorted(needs[first] & left)
            explicit = ca.substitute(h, self.v, ca.vertcat(*solved))  # members are 0 in it
            values = self._loop(h, members, solved, explicit[members]) if members else explicit[first]
            for i, value in zip(members or [first], ca.vertsplit(values), strict=True):
                solved[i] = value
            left -= {first, *members}
        return ca.vertcat(*solved)

    def _loop(self, h: Any, members: list[int], solved: list[Any], explicit: Any) -> Any:
        """v of the members of a loop, h = H v + explicit."""
        inside = ca.vertcat(*(self.v[i] if i in members else value for i, value in enumerate(solved)))
        H = ca.jacobian(ca.substitute(h, self.v, inside)[members], self.v)[:, members]
        if ca.depends_on(H, self.v):
            names = ", ".join(self.inner[i] for i in members)
            raise ComponentError(f"{self.name}: {names} depend on each other, and not linearly; open the loop")
        return ca.solve(ca.densify(self.kind.eye(len(members)) - H), explicit)


def _needs(pattern: ca.Sparsity) -> list[set[int]]:
    """Of each input all that it needs, directly or by others."""
    reach = np.zeros(pattern.shape, dtype=bool)
    reach[tuple(np.array(pattern.get_triplet(), dtype=int))] = True
    for k in range(len(reach)):  # Warshall
        reach |= np.outer(reach[:, k], reach[k])
    return [set(np.flatnonzero(row).tolist()) for row in reach]


def _named(part: str, model: Model, group: str) -> list[Variable]:
    variables: tuple[Variable, ...] = getattr(model, group)
    return [
        replace(v, name=f"{part}.{v.name}", derivative_of=v.derivative_of and f"{part}.{v.derivative_of}")
        for v in variables
    ]


def _ports(part: str, model: Model) -> list[Terminal]:
    return [
        Terminal(
            f"{part}.{port.name}",
            port.kind,
            tuple(TerminalMember(m.role, f"{part}.{m.variable}") for m in port.members),
        )
        for port in model.ports
    ]


def _documentation(models: Mapping[str, Model], connections: Mapping[str, str]) -> str:
    parts = [f"{part}: {model.description}" for part, model in models.items()]
    wires = [f"    {target} = {source}" for target, source in connections.items()]
    return "\n".join(["Composition of connected components.", "", *parts, "", "Connections::", "", *wires])


def _check(
    name: str, found: Mapping[str, list[Variable]], connections: Mapping[str, str], starts: Mapping[str, float]
) -> None:
    inputs, outputs = ([v.name for v in found[group]] for group in ("inputs", "outputs"))
    settable = [*inputs, *(v.name for v in found["parameters"])]
    for kind, wanted, known in (
        ("input", connections.keys(), inputs),
        ("output", connections.values(), outputs),
        ("parameter or input", starts.keys(), settable),
    ):
        for variable in wanted:
            if variable not in known:
                raise ComponentError(f"{name}: no {kind} is called {variable!r}{suggestion(variable, known)}")
