"""A sampled component: discrete states and outputs that change at samples alone."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Mapping, Sequence
from typing import final

import casadi as ca

from liaisons.errors import ComponentError
from liaisons.expressions.algebra import stack
from liaisons.language.checks import Formulas
from liaisons.language.component import Component, DeclarationsOf
from liaisons.language.declarations import DiscreteOutput, DiscreteState, Input, Parameter
from liaisons.language.layout import Layout, event_output

NEAR = 1e-6
"""Part of the period by which clocks of importers may miss a sample."""
_LATE = "each sample has to be a communication point: choose a communication step that divides the period"


class Sampled(Component, abstract=True):
    """Discrete-time component that reads its inputs once a period, at t = 0, period, 2 period, ...; abstract.

    A subclass declares inputs, parameters, discrete states and outputs, and defines :meth:`update`.  Outputs are
    constant between samples; with a delay of computation they change so much later.

    :raises ComponentError: when the subclass is defined, for an unknown symbol, a wrong size or unit.
    """

    period = Parameter(0.1, "s", "sampling period", above=0)
    delay = Parameter(0.0, "s", "delay of computation: from a sample to the change of outputs", minimum=0)
    inputs = DeclarationsOf(Input)
    discrete_states = DeclarationsOf(DiscreteState)
    clock: ca.SX
    input_column: ca.SX
    discrete: ca.SX

    def __init__(self) -> None:
        super().__init__()
        self.clock = ca.SX.sym("t")
        self.input_column = self._symbols(item.name for item in self.inputs)
        self.discrete = self._symbols(state.name for state in self.discrete_states)

    @abstractmethod
    def update(self) -> Mapping[str, ca.SX]:
        """Discrete states and outputs after a sample, by name, from those before it and the inputs."""

    @classmethod
    @final
    def is_sampled(cls) -> bool:
        return True

    def layout(self) -> Layout:
        return Layout(
            parameters=(
                *self._declared_parameters(),
                *(state.variable("parameter", "fixed", f"{state.name}_0") for state in self.discrete_states),
            ),
            inputs=tuple(item.variable("input", "continuous") for item in self.inputs),
            outputs=tuple(
                event_output(item.name, item.unit, item.description, item.causality) for item in self.discrete_states
            ),
            states=(),
            ports=(),
        )

    def _check(self) -> None:
        if not self.discrete_states:
            raise ComponentError(f"{type(self).__name__} declares no DiscreteState and no DiscreteOutput")
        formulas, symbols = Formulas(self), self.symbols | {"t": self.clock}
        formulas.each("update", symbols, {item.name: item.unit for item in self.discrete_states})
        formulas.check_units(self.layout().variables, symbols, t="s")

    @final
    def sample(self, memory: ca.SX) -> ca.SX:
        """Memory after the sample that is due at ``clock``, or was taken there; else the same.

        :param memory: discrete states before the last sample, those after it, and its instant [s].
        """
        before, after, last = self.split(memory)
        instant = self.period * self._index(self.clock)
        is_near = self.clock - instant <= NEAR * self.period
        is_new = instant > last + self.period / 2
        is_due = ca.logic_and(is_near, instant > last - self.period / 2)
        before = ca.if_else(ca.logic_and(is_near, is_new), after, before)
        return ca.vertcat(before, ca.if_else(is_due, self._updated(before), after), ca.if_else(is_due, instant, last))

    @final
    def start(self, start: ca.SX) -> ca.SX:
        """Memory at initialization, the first sample included if one is due.

        :param start: discrete states before it.
        """
        instant = self.period * self._index(self.clock)
        is_due = self.clock - instant <= NEAR * self.period
        return ca.vertcat(start, ca.if_else(is_due, self._updated(start), start), instant)

    @final
    def readable(self, memory: ca.SX) -> ca.SX:
        """Discrete states as they are read: outputs after the delay of computation."""
        before, after, last = map(ca.vertsplit, self.split(memory))
        is_ready = self.clock >= last[0] + self.delay - NEAR * self.period
        return stack(
            ca.if_else(is_ready, new, old) if isinstance(item, DiscreteOutput) else new
            for item, new, old in zip(self.discrete_states, after, before, strict=True)
        )

    @final
    def conditions(self, memory: ca.SX) -> dict[str, ca.SX]:
        """What has to stay > 0, by the message of its error."""
        due = self.split(memory)[2] + (1 + NEAR) * self.period
        return {
            _LATE: due - self.clock,
            "delay must stay <= period": self.period * (1 + NEAR) - self.delay,
        }

    @final
    def events(self) -> Sequence[ca.SX]:
        """The next sample and the next change of outputs, after an instant that clocks of importers may miss."""
        return [self._event(self._index(self.clock - lag) + 1, lag) for lag in (ca.SX(0), self.delay)]

    @final
    def next_event_time(self) -> ca.SX:
        """The first of :meth:`events`."""
        return ca.fmin(*self.events())

    def _event(self, index: ca.SX, lag: ca.SX) -> ca.SX:
        """Instant of a sample or, late, of the outputs; a delay of a whole period is the next sample, to the bit."""
        is_whole = lag > (1 - NEAR) * self.period
        return self.period * (index + is_whole) + ca.if_else(is_whole, 0, lag)

    def split(self, memory: ca.SX) -> list[ca.SX]:
        """Discrete states before and after the last sample, and its instant."""
        n = self.discrete.numel()
        return ca.vertsplit(memory, [0, n, 2 * n, 2 * n + 1])

    def _index(self, t: ca.SX) -> ca.SX:
        """Number of the last sample, put forward by rounding errors of clocks."""
        return ca.floor(t / self.period + NEAR)

    def _updated(self, before: ca.SX) -> ca.SX:
        values = self.update()
        after = stack(ca.SX(values[item.name]) for item in self.discrete_states)
        return ca.substitute(after, self.discrete, before)
