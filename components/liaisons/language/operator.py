"""An operator: a source of σ(t), with its two derivatives taken from one expression."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Mapping, Sequence

import casadi as ca

from liaisons import units
from liaisons.errors import ComponentError
from liaisons.expressions.algebra import stack
from liaisons.language.checks import Formulas, call
from liaisons.language.component import Component, Every
from liaisons.language.declarations import Input, InternalState, ParameterArray
from liaisons.language.layout import Layout, of_internal, readable, start_of_internal
from liaisons.language.variables import State, Terminal, TerminalMember

TRIPLE = ("y", "y_dot", "y_ddot")
_TEXTS = ("signal", "first derivative of the signal", "second derivative of the signal")


class Operator(Component, abstract=True):
    """Source of a signal y(t) and its derivatives, for an active port; abstract.

    A subclass declares parameters and defines :meth:`signal`; where the signal is not smooth, :meth:`events`.  One
    that closes a loop declares inputs and internal states with :meth:`internal_rates`; the signal then depends on the
    states, and through at least three of them on an input, so that y, y_dot and y_ddot are continuous.
    The outputs ``y``, ``y_dot``, ``y_ddot`` carry no unit: they take that of the port they are connected to.

    :raises ComponentError: when the subclass is defined, for an unknown symbol, a wrong size, or a signal one of whose
        derivatives jumps with an input.
    """

    inputs = Every(Input)
    internal_states = Every(InternalState)
    clock: ca.SX
    internal: ca.SX
    input_column: ca.SX

    def __init__(self) -> None:
        super().__init__()
        self.clock = ca.SX.sym("t")
        self.internal = self._symbols(state.name for state in self.internal_states)
        self.input_column = self._symbols(item.name for item in self.inputs)

    @abstractmethod
    def signal(self, t: ca.SX) -> ca.SX:
        """y as an expression of time, the parameters and the internal states."""

    def piece(self, t: ca.SX, ends: ca.SX) -> ca.SX | None:
        """The signal between two rows of a table, whose columns are the parameter arrays; None: there is no table.

        :param ends: one row after the other.
        """

    def internal_rates(self) -> Mapping[str, ca.SX]:
        """Rates of the internal states, by name."""
        return {}

    def events(self) -> Sequence[ca.SX]:
        """Instants at which y or one of its first two derivatives is not smooth."""
        return []

    def layout(self) -> Layout:
        of_states = [list(of_internal(state)) for state in self.internal_states]
        return Layout(
            parameters=(*self._declared_parameters(), *map(start_of_internal, self.internal_states)),
            inputs=tuple(item.variable("input", "continuous") for item in self.inputs),
            outputs=(
                *(readable(name, units.ANY, text) for name, text in zip(TRIPLE, _TEXTS, strict=True)),
                *(state for state, _ in of_states),
                *(rate for _, rate in of_states),
            ),
            states=tuple(State(state.name, f"{state.name}_dot") for state in self.internal_states),
            ports=(Terminal("y", "signal", tuple(map(TerminalMember, ("s", "v", "a"), TRIPLE))),),
            dimensions=tuple(dict.fromkeys(p.dimension for p in self.parameters if isinstance(p, ParameterArray))),
        )

    def _check(self) -> None:
        formulas, symbols = Formulas(self), self.symbols | {"t": self.clock}
        formulas("signal", symbols, units.ANY, self.clock)
        for i, instant in enumerate(call(self, "events")):
            formulas.take(f"events[{i}]", instant, self.symbols, "s")
        formulas.internal_rates(self.internal_states, self.symbols)
        formulas.check_units(self.layout().variables, symbols, t="s")
        for name, expression in zip(TRIPLE, self.triple(), strict=True):
            if self.inputs and ca.depends_on(expression, self.input_column):
                raise ComponentError(
                    f"{type(self).__name__}: {name} jumps with an input; pass the input through three internal states, "
                    "each of which follows the one before"
                )

    def triple(self, signal: ca.SX | None = None) -> list[ca.SX]:
        """y and its derivatives along the motion of the internal states; of another signal, if one is given."""
        rates = stack(ca.SX(rate) for rate in self.rates())
        triple = [ca.SX(self.signal(self.clock) if signal is None else signal)]
        for _ in range(2):
            y = triple[-1]
            triple.append(ca.jacobian(y, self.clock) + ca.jtimes(y, self.internal, rates))
        return triple

    def rates(self) -> list[ca.SX]:
        """Rates of the internal states, in their order."""
        rates = self.internal_rates()
        return [rates[state.name] for state in self.internal_states]
