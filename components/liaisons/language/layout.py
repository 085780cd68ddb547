"""Variables of a component: names, units and descriptions, the same rules for every FMU (docs/reference/fmu.md)."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from liaisons import units
from liaisons.language.declarations import InternalState
from liaisons.language.variables import (
    ActiveInput,
    Causality,
    Dimension,
    NumberType,
    State,
    Terminal,
    TerminalKind,
    TerminalMember,
    Variable,
)

# Names of connector members as in the Modelica Standard Library: position, rate, acceleration, force.
_TRANSLATION = ("s", "v", "a", "f")
_ROTATION = ("phi", "w", "a", "tau")


@dataclass(frozen=True)
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
        """All of them: parameters, inputs, outputs."""
        return self.parameters + self.inputs + self.outputs


def readable(
    name: str,
    unit: str,
    text: str,
    causality: Causality = "output",
    *,
    derivative_of: str | None = None,
    symbol: str = "",
    dimension: Dimension | None = None,
) -> Variable:
    """An output that changes continuously."""
    of = {"derivative_of": derivative_of, "symbol": symbol, "dimension": dimension}
    return Variable(name, unit, text, causality, "continuous", **of)


def event_output(
    name: str, unit: str, text: str, causality: Causality = "output", of_type: NumberType = "Real"
) -> Variable:
    """A number that changes at events alone."""
    return Variable(name, unit, text, causality, "discrete", type=of_type)


def rate(name: str, unit: str, text: str, dimension: Dimension | None = None) -> Variable:
    """The rate of a state, where it is no output."""
    return readable(f"{name}_dot", unit, text, "local", derivative_of=name, dimension=dimension)


def start(name: str, unit: str, value: float, dimension: Dimension | None = None) -> Variable:
    """Parameter of an initial value without a declaration."""
    text = f"initial value of {name}"
    return Variable(f"{name}_0", unit, text, "parameter", "fixed", start=value, dimension=dimension)


def zero(name: str, unit: str, text: str, dimension: Dimension | None = None) -> Variable:
    """An input that is 0 until it is set."""
    return Variable(name, unit, text, "input", "continuous", start=0.0, dimension=dimension)


def of_internal(state: InternalState) -> Iterator[Variable]:
    """An internal state and its rate."""
    yield readable(state.name, state.unit, state.description, symbol=state.symbol)
    yield rate(state.name, units.rate(state.unit), f"rate of {state.name}")


def start_of_internal(state: InternalState) -> Variable:
    """Initial value of an internal state."""
    return state.variable("parameter", "fixed", f"{state.name}_0")


def port(name: str, unit: str, kind: TerminalKind) -> Terminal:
    """A connector: position, rate, acceleration, and force or load."""
    variables = (name, f"{name}_dot", f"{name}_ddot", f"{name}_{'force' if kind == 'active' else 'load'}")
    roles = _ROTATION if unit == "rad" else _TRANSLATION
    return Terminal(name, kind, tuple(TerminalMember(role, name) for role, name in zip(roles, variables, strict=True)))
