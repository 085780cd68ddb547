"""Variables of a component: names, units and descriptions, the same rules for every FMU (docs/reference/fmu.md)."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Self

from liaisons.base import units
from liaisons.base.array_names import array_and_index, suffixed_name
from liaisons.language.declarations import InternalState
from liaisons.language.variables import (
    ActiveInput,
    Dimension,
    State,
    Terminal,
    TerminalKind,
    TerminalMember,
    Variable,
)

# Names of connector members as in the Modelica Standard Library: position, rate, acceleration, force; impulse is ours.
_TRANSLATION = ("s", "v", "a", "f", "impulse")
_ROTATION = ("phi", "w", "a", "tau", "impulse")


@dataclass(frozen=True, kw_only=True)
class Layout:
    """Variables of a component in the order of their value references, with states, ports and dimensions."""

    parameters: tuple[Variable, ...]
    inputs: tuple[Variable, ...]
    outputs: tuple[Variable, ...]
    states: tuple[State, ...]
    ports: tuple[Terminal, ...]
    active: tuple[ActiveInput, ...] = ()
    dimensions: tuple[Dimension, ...] = ()

    @property
    def variables(self) -> tuple[Variable, ...]:
        """All variables: parameters, inputs, outputs."""
        return self.parameters + self.inputs + self.outputs

    def flat(self) -> Self:
        """Layout with a variable for each element of an array."""
        names = {v.name: [item.name for item in v.elements()] for v in self.variables}

        def each(*group: str) -> Iterator[tuple[str, ...]]:
            """Tuples of names, element by element."""
            return zip(*(names[name] for name in group), strict=True)

        def elements(group: Iterable[Variable]) -> tuple[Variable, ...]:
            return tuple(item for v in group for item in v.elements())

        return replace(
            self,
            parameters=elements(self.parameters),
            inputs=elements(self.inputs),
            outputs=elements(self.outputs),
            states=tuple(State(*pair) for state in self.states for pair in each(*state)),
            active=tuple(ActiveInput(*triple) for item in self.active for triple in each(*item)),
            ports=tuple(
                Terminal(name, p.kind, tuple(map(TerminalMember, (m.role for m in p.members), variables)))
                for p in self.ports
                for name, *variables in each(p.name, *(m.variable for m in p.members))
            ),
        )

    def with_arrays(self, dimensions: Mapping[int, Dimension]) -> Layout:
        """Layout with arrays in the place of their elements.

        :param dimensions: by their number of elements.
        """

        def arrays(variables: Iterable[Variable]) -> tuple[Variable, ...]:
            groups: dict[str, list[Variable]] = {}
            for variable in variables:
                groups.setdefault(array_and_index(variable.name)[0], []).append(variable)
            return tuple(_joined(name, group, dimensions) for name, group in groups.items())

        states = dict.fromkeys(State(*(array_and_index(name)[0] for name in state)) for state in self.states)
        ports = dict.fromkeys(
            Terminal(
                array_and_index(p.name)[0],
                p.kind,
                tuple(TerminalMember(m.role, array_and_index(m.variable)[0]) for m in p.members),
            )
            for p in self.ports
        )
        return replace(
            self,
            parameters=arrays(self.parameters),
            inputs=arrays(self.inputs),
            outputs=arrays(self.outputs),
            states=tuple(states),
            ports=tuple(ports),
        )


def _joined(name: str, elements: Sequence[Variable], dimensions: Mapping[int, Dimension]) -> Variable:
    first = elements[0]
    if first.name == name:  # a scalar
        return first
    return replace(
        first,
        name=name,
        description=first.description.replace("[1]", ""),
        start=None if first.start is None else tuple(x for item in elements for x in item.starts),
        derivative_of=first.derivative_of and array_and_index(first.derivative_of)[0],
        dimension=dimensions[len(elements)],
    )


readable = partial(Variable, causality="output", variability="continuous")
"""An output that changes continuously, from name, unit and description."""

event_output = partial(Variable, causality="output", variability="discrete")
"""A number that changes at events alone."""

zero = partial(Variable, causality="input", variability="continuous", start=0.0)
"""An input that is 0 until it is set."""

zero_sum = partial(zero, variability="discrete")
"""An input that sums what happens at events."""


def rate(name: str, unit: str, text: str, dimension: Dimension | None = None) -> Variable:
    """The rate of a state, where it is no output."""
    own = suffixed_name(name, "_dot")
    return readable(own, unit, text, causality="local", derivative_of=name, dimension=dimension)


def start(name: str, unit: str, value: float | tuple[float, ...], dimension: Dimension | None = None) -> Variable:
    """Parameter of an initial value without a declaration."""
    text = f"initial value of {name}"
    return Variable(suffixed_name(name, "_0"), unit, text, "parameter", "fixed", start=value, dimension=dimension)


def of_internal(state: InternalState) -> Iterator[Variable]:
    """An internal state and its rate."""
    yield readable(state.name, state.unit, state.description, symbol=state.symbol)
    yield rate(state.name, units.rate(state.unit), f"rate of {state.name}")


def start_of_internal(state: InternalState) -> Variable:
    """Initial value of an internal state."""
    return state.variable("parameter", "fixed", f"{state.name}_0")


def port(name: str, unit: str, kind: TerminalKind, *, impulse: bool = True) -> Terminal:
    """The terminal of a mechanical connection: position, rate, acceleration, force or load, and impulses."""
    endings = ("", "_dot", "_ddot", "_force" if kind == "active" else "_load", *["_impulse"] * impulse)
    variables = [suffixed_name(name, ending) for ending in endings]
    roles = _ROTATION if unit == "rad" else _TRANSLATION
    return Terminal(name, kind, tuple(map(TerminalMember, roles, variables)))
