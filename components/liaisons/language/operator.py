"""An operator: a source of σ(t), with its two derivatives taken from one expression."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Mapping
from typing import ClassVar

import casadi as ca

from liaisons import units
from liaisons.errors import ComponentError
from liaisons.expressions.algebra import stack
from liaisons.expressions.dimensions import check_units
from liaisons.language.component import Component, call, check_internal_rates, checked, declared, scalar
from liaisons.language.declarations import Input, InternalState

TRIPLE = ("y", "y_dot", "y_ddot")


class Operator(Component, abstract=True):
    """Source of a signal y(t) and its derivatives, for an active port; abstract.

    A subclass declares parameters and defines :meth:`signal`; where the signal is not smooth, :meth:`events`.  One
    that closes a loop declares inputs and internal states with :meth:`internal_rates`; the signal then depends on the
    states, and through at least three of them on an input, so that y, y_dot and y_ddot are continuous.
    The outputs ``y``, ``y_dot``, ``y_ddot`` carry no unit: they take that of the port they are connected to.

    :raises ComponentError: when the subclass is defined, for an unknown symbol, a wrong size, or a signal one of whose
        derivatives jumps with an input.
    """

    inputs: ClassVar[tuple[Input, ...]] = ()
    internal_states: ClassVar[tuple[InternalState, ...]] = ()
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

    def internal_rates(self) -> Mapping[str, ca.SX]:
        """Rates of the internal states, by name."""
        return {}

    def events(self) -> list[ca.SX]:
        """Instants at which y or one of its first two derivatives is not smooth."""
        return []

    @classmethod
    def variable_names(cls) -> list[str]:
        names = [*(p.name for p in cls.parameters), *(item.name for item in cls.inputs), *TRIPLE]
        for state in cls.internal_states:
            names += [f"{state.name}_0", state.name, f"{state.name}_dot"]
        return names

    @classmethod
    def _collect(cls) -> None:
        super()._collect()
        cls.inputs = declared(cls, Input)
        cls.internal_states = declared(cls, InternalState)

    @classmethod
    def _check(cls) -> None:
        picture = cls()
        signal = scalar(cls, "signal", call(picture, "signal", picture.clock), picture.symbols | {"t": picture.clock})
        formulas = list(checked(cls, "signal", signal, units.ANY))
        for i, instant in enumerate(call(picture, "events")):
            label = f"events[{i}]"
            formulas += checked(cls, label, scalar(cls, label, instant, picture.symbols), "s")
        formulas += check_internal_rates(picture, picture.internal_states, picture.symbols)
        known = {item.name: item.checked_unit for item in (*cls.parameters, *cls.inputs, *cls.internal_states)}
        symbols = {name: (symbol, known[name]) for name, symbol in picture.symbols.items()}
        check_units(symbols | {"t": (picture.clock, "s")}, formulas)
        for name, expression in zip(TRIPLE, picture.triple(), strict=True):
            if picture.inputs and ca.depends_on(expression, picture.input_column):
                raise ComponentError(
                    f"{cls.__name__}: {name} jumps with an input; pass the input through three internal states, "
                    "each of which follows the one before"
                )

    def triple(self) -> list[ca.SX]:
        """y and its derivatives along the motion of the internal states."""
        rates = stack(ca.SX(rate) for rate in self.rates())
        triple = [ca.SX(self.signal(self.clock))]
        for _ in range(2):
            y = triple[-1]
            triple.append(ca.jacobian(y, self.clock) + ca.jtimes(y, self.internal, rates))
        return triple

    def rates(self) -> list[ca.SX]:
        """Rates of the internal states, in their order."""
        rates = self.internal_rates()
        return [rates[state.name] for state in self.internal_states]
