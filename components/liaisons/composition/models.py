"""Composition of connected models into one: the reference for a co-simulation of them.

The inputs v that are connected obey v = h(t, y, v), where h are outputs of the models.  Most follow one from the other;
where they need each other, as acceleration and force between two mechanisms do, h is linear in them and is solved
symbolically.  So the one model has no coupling error: it is the equations of motion of the whole.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import reduce
from itertools import pairwise
from typing import Any

import casadi as ca
import numpy as np

from liaisons.algebra import at_zero
from liaisons.errors import ComponentError, suggestion
from liaisons.language import ActiveInput, Layout, State, Terminal, TerminalMember, Variable
from liaisons.mechanics import (
    CONTACT_NUMBERS,
    NEXT_EVENT,
    Equation,
    Model,
    contact_functions,
    contact_method,
    domain_conditions,
)


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
    parts = [_prefixed(part, model.flat()) for part, model in models.items()]
    longest = max((part.experiment for part in parts), key=lambda e: e.stop_time)
    values = {variable: float(value) for variable, value in (starts or {}).items()}
    _check_names(name, parts, connections, values)
    joined = _Joined(name, parts, connections)

    def started(group: str) -> tuple[Variable, ...]:
        left = (v for v in _concatenated(parts, group) if v.name not in connections)
        return tuple(replace(v, start=values.get(v.name, v.start)) for v in left)

    inner = (
        replace(v, causality="output", start=None) for v in _concatenated(parts, "inputs") if v.name in connections
    )
    layout = Layout(
        parameters=started("parameters"),
        inputs=started("inputs"),
        outputs=(*_concatenated(parts, "outputs"), *inner),
        states=_concatenated(parts, "states"),
        active=tuple(a for a in _concatenated(parts, "active") if a.value not in connections),
        ports=tuple(p for p in _concatenated(parts, "ports") if not any(m.variable in connections for m in p.members)),
    )
    return Model(
        **vars(layout),
        name=name,
        description="composition of " + ", ".join(f"{part} ({model.name})" for part, model in models.items()),
        documentation=_documentation(models, connections),
        **joined.functions(layout),
        start_only=sum(part.start_only for part in parts),
        redundant=sum(part.redundant for part in parts),
        reaches=_concatenated(parts, "reaches"),
        configuration=_concatenated(parts, "configuration"),
        experiment=replace(longest, reference={}),  # the start values are those of the whole
        equations=tuple(_prefixed_equations(models, connections)),
    )


def _prefixed_equations(models: Mapping[str, Model], connections: Mapping[str, str]) -> Iterator[Equation]:
    """Yield the equations of the parts, in variables called ``part.variable``, and the connections."""
    for part, model in models.items():
        for e in model.equations:
            own = [symbol for symbol in ca.symvar(e.right) if symbol.name() != "t"]
            full = [ca.SX.sym(f"{part}.{symbol.name()}") for symbol in own]
            right = ca.substitute(e.right, ca.vertcat(*own), ca.vertcat(*full))
            yield Equation(e.section, e.left if e.left == "0" else f"{part}.{e.left}", right)
    for target, source in connections.items():
        yield Equation("connections", target, ca.SX.sym(source))


def _prefixed(part: str, model: Model) -> Model:
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
        states=tuple(State(*map(full, state)) for state in model.states),
        memory=tuple(map(full, model.memory)),
        configuration=tuple(map(full, model.configuration)),
        contacts=tuple(contact.renamed(full) for contact in model.contacts),
        condition_texts=tuple(f"{part}: {text}" for text in model.condition_texts),
        reaches=tuple(
            replace(r, text=f"{part}: {r.text}", prescribed=tuple(map(full, r.prescribed))) for r in model.reaches
        ),
        active=tuple(ActiveInput(*map(full, item)) for item in model.active),
        ports=tuple(
            Terminal(full(p.name), p.kind, tuple(TerminalMember(m.role, full(m.variable)) for m in p.members))
            for p in model.ports
        ),
    )


def _concatenated(parts: Iterable[Model], group: str) -> tuple[Any, ...]:
    """Members of one kind of all parts, one after the other."""
    return tuple(item for part in parts for item in getattr(part, group))


@dataclass(frozen=True, eq=False)
class _Part:
    """A model with its symbols; some of its inputs are connected."""

    model: Model
    vectors: Mapping[str, Any]  # by letter

    def function_results(self, name: str, **vectors: Any) -> list[Any]:
        """Results of a function of the model under contact forces that are symbols.

        :param vectors: in place of those of the part, by letter.
        """
        arguments, forced = {**self.vectors, **vectors}, self.model.forced_motion
        if forced is not None and name in forced.name_out():
            return [self.model.results("forced_motion", arguments)[forced.index_out(name)]]
        return self.model.results(name, arguments)


class _Joined:
    """Functions of all parts as those of one model."""

    def __init__(self, name: str, models: Sequence[Model], connections: Mapping[str, str]) -> None:
        self.contacts = tuple(sorted(_concatenated(models, "contacts"), key=lambda contact: contact.friction))
        scalar = all(model.outputs_function.is_a("SXFunction") for model in models)
        if method := contact_method(self.contacts):
            scalar = True  # chains are written out link by link
            method.refuse(name, self.contacts, max((model.loops.links for model in models if model.loops), default=0))
        kind: Any = ca.SX if scalar else ca.MX
        self.name, self.kind = name, kind
        inputs = _concatenated(models, "inputs")
        self.inner = [variable for variable in inputs if variable.name in connections]
        self.v = kind.sym("v", len(self.inner))
        outer = [variable for variable in inputs if variable.name not in connections]
        self.memory, symbol = _concatenated(models, "memory"), kind.sym
        u, x = symbol("u", len(outer)), symbol("x", len(self.contacts))
        symbols = zip((*self.inner, *outer), ca.vertsplit(ca.vertcat(self.v, u)), strict=True)
        symbol_of = {variable.name: value for variable, value in symbols}
        force_of = dict(zip(self.contacts, ca.vertsplit(x), strict=True))
        counts = {
            letter: [len(getattr(model, group)) for model in models]
            for letter, group in (("y", "states"), ("k", "parameters"), ("m", "memory"))
        }
        own = {letter: symbol(letter, sum(count)) for letter, count in counts.items()}
        self.vectors = {"t": symbol("t"), "u": u, "x": x, **own}
        split = [ca.vertsplit(own[letter], np.cumsum([0, *count]).tolist()) for letter, count in counts.items()]
        self.parts = [
            _Part(
                model,
                {
                    "t": self.vectors["t"],
                    "u": self._to_column(symbol_of[v.name] for v in model.inputs),
                    "x": self._to_column(force_of[contact] for contact in model.contacts),
                    **dict(zip(counts, columns, strict=True)),
                },
            )
            for model, *columns in zip(models, *split, strict=True)
        ]
        outputs = [v.name for v in _concatenated(models, "outputs")]
        self.sources = [outputs.index(connections[variable.name]) for variable in self.inner]

    def functions(self, layout: Layout) -> dict[str, Any]:
        """Functions of the composed model, and what belongs to them: arguments of Model."""
        z = self._stacked_results("outputs_function")
        v = self._connected_inputs(z)
        start = [part.function_results("start") for part in self.parts]
        y_0, m_0 = (self._to_column(column) for column in zip(*start, strict=True))
        at_start = zip(self.parts, start, strict=True)
        z_0 = self._to_column(part.function_results("outputs_function", y=y, m=m)[0] for part, (y, m) in at_start)
        v_0 = self._connected_inputs(z_0)

        def connected(expression: Any, values: Any = v) -> Any:
            return ca.substitute(expression, self.v, values) if self.inner else expression

        results = {
            "start": (connected(y_0, v_0), connected(m_0, v_0)),
            "outputs_function": connected(self._to_column([z, self.v])),
            "events": self._stacked_results("events"),
        }
        results |= {
            name: connected(self._stacked_results(name)) for name in ("derivatives", "nominals", "jump", "remember")
        }
        partial_results = self._results_of_some_parts()
        results |= {name: None if row is None else connected(row) for name, row in partial_results.items()}
        conditions = {text: connected(row) for text, row in self._conditions().items()}
        results["conditions"] = self._to_column(conditions.values())
        numbers = {name: connected(self._contact_numbers(name, kinds)) for name, kinds in CONTACT_NUMBERS.items()}
        own = contact_functions(
            self.contacts,
            vectors=self.vectors,
            forced=results,
            numbers=numbers,
            layout=layout,
            memory=self.memory,
            condition_texts=tuple(conditions),
        )
        return own | {"drawn": () if partial_results["draw"] is None else (NEXT_EVENT,)}

    def _results_of_some_parts(self) -> dict[str, Any]:
        """Results of functions that not every model has, stacked or the least of all; None if no model has one."""
        results: dict[str, Any] = {}
        if any(part.model.project is not None for part in self.parts):
            rows = (
                part.vectors["y"] if part.model.project is None else part.function_results("project")[0]
                for part in self.parts
            )
            results["project"] = self._to_column(rows)
        bounded = [part for part in self.parts if part.model.reach is not None]
        if bounded:
            rows = [(len(part.model.reaches), part.function_results("reach")[0]) for part in bounded]
            columns = [*(row[:count] for count, row in rows), *(row[count:] for count, row in rows)]
            results["reach"] = self._to_column(columns)
        margins = [part.function_results("margin")[0] for part in self.parts if part.model.margin is not None]
        results["margin"] = reduce(ca.fmin, margins) if margins else None
        announcing = [part.function_results("draw")[0] for part in self.parts if NEXT_EVENT in part.model.drawn]
        results["draw"] = reduce(ca.fmin, announcing) if announcing else None
        return results

    def _contact_numbers(self, name: str, kinds: tuple[bool, ...]) -> ca.SX:
        """Column of one of :data:`CONTACT_NUMBERS` of the contacts of some kinds."""
        row_of = dict[Any, ca.SX]()
        for part in self.parts:
            contacts = [contact for contact in part.model.contacts if contact.friction in kinds]
            row_of |= dict(zip(contacts, ca.vertsplit(part.function_results(name)[0]), strict=True)) if contacts else {}
        return self._to_column(row_of[contact] for contact in self.contacts if contact in row_of)

    def _conditions(self) -> dict[str, Any]:
        """Expressions that stay > 0, by message: domains of connected inputs, conditions of parts, then starts."""
        lasting, at_start = dict[str, Any](), list[tuple[str, Any]]()
        for variable, value in zip(self.inner, ca.vertsplit(self.v), strict=True):
            lasting |= domain_conditions(variable, value)
        for part in self.parts:
            conditions = list(
                zip(part.model.condition_texts, ca.vertsplit(part.function_results("conditions")[0]), strict=True)
            )
            first = sum(bool(contact.normal) for contact in part.model.contacts)  # Painlevé's
            count = len(conditions) - part.model.start_only
            lasting, at_start = lasting | dict(conditions[first:count]), at_start + conditions[count:]
        return lasting | dict(at_start)

    def _stacked_results(self, name: str) -> Any:
        """Column of the results that a function has for each part."""
        return self._to_column(part.function_results(name)[0] for part in self.parts)

    def _to_column(self, columns: Any) -> Any:
        """Columns stacked, as SX or MX like the composition."""
        rows = [self.kind(column) for column in columns]
        return ca.vertcat(*rows) if rows else self.kind(0, 1)

    def _connected_inputs(self, z: Any) -> Any:
        """Solution v of v = h(v) for the connected inputs, h the outputs: loop by loop, in the order of dependence."""
        if not self.inner:
            return self.v
        memory = self.vectors["m"]
        booked = memory.shape[0] and ca.jacobian_sparsity(z[self.sources], memory).nnz()
        if booked:
            raise ComponentError(f"{self.name}: work and energy_balance cannot be connected; integrate the power")
        h = at_zero(z[self.sources], memory)
        pattern = ca.jacobian_sparsity(h, self.v)
        solved = [self.kind(0)] * len(self.inner)
        _, order, starts = pattern.T.scc()  # those that others depend on first
        for first, end in pairwise(starts):
            members = sorted(order[first:end])
            explicit = ca.substitute(h, self.v, ca.vertcat(*solved))[members]  # members are 0 in it
            is_loop = len(members) > 1 or pattern.has_nz(members[0], members[0])
            values = self._solve_linear_loop(h, members, solved, explicit) if is_loop else explicit
            for i, value in zip(members, ca.vertsplit(values), strict=True):
                solved[i] = value
        return ca.vertcat(*solved)

    def _solve_linear_loop(self, h: Any, members: list[int], solved: list[Any], explicit: Any) -> Any:
        """Solution v of the linear algebraic loop v = H v + explicit.

        :raises ComponentError: if the loop is not linear.
        """
        inside = ca.vertcat(*(self.v[i] if i in members else value for i, value in enumerate(solved)))
        H = ca.jacobian(ca.substitute(h, self.v, inside)[members], self.v)[:, members]
        if ca.depends_on(H, self.v):
            names = ", ".join(self.inner[i].name for i in members)
            raise ComponentError(f"{self.name}: {names} depend on each other, and not linearly; open the loop")
        return ca.solve(ca.densify(self.kind.eye(len(members)) - H), explicit)


def _documentation(models: Mapping[str, Model], connections: Mapping[str, str]) -> str:
    """Documentation of a composed model: its parts and connections."""
    parts = [f"{part}: {model.description}" for part, model in models.items()]
    wires = [f"    {target} = {source}" for target, source in connections.items()]
    return "\n".join(["Composition of connected components.", "", *parts, "", "Connections::", "", *wires])


def _check_names(
    name: str, parts: Sequence[Model], connections: Mapping[str, str], starts: Mapping[str, float]
) -> None:
    """Raise a ComponentError for names of unknown variables, and for outputs that cannot be connected."""
    inputs, outputs, parameters = (
        [v.name for v in _concatenated(parts, of)] for of in ("inputs", "outputs", "parameters")
    )
    for kind, names, declared in (
        ("input", connections.keys(), inputs),
        ("output", connections.values(), outputs),
        ("parameter or input", starts.keys(), [*inputs, *parameters]),
    ):
        for variable in names:
            if variable not in declared:
                raise ComponentError(f"{name}: no {kind} is called {variable!r}{suggestion(variable, declared)}")
