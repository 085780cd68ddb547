"""Components in discrete time: states and outputs that change at samples alone."""

from abc import abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import final

import casadi as ca

from liaisons.algebra import stack
from liaisons.base.clocks import CLOCK_ERROR
from liaisons.base.units import ANY
from liaisons.errors import ComponentError
from liaisons.language.checks import Formulas
from liaisons.language.component import DeclarationsOf, SignalComponent
from liaisons.language.declarations import DiscreteOutput, DiscreteState, Parameter
from liaisons.language.layout import Layout, event_output

LATE = "each sample has to be a communication point: choose a communication step that divides the period"
"""Message of a step across a sample, at which the inputs are unknown."""


class SampledStates(SignalComponent, abstract=True):
    """Discrete states that are updated at samples; abstract, and the base of what has them.

    The memory of its FMU has the discrete states before the last sample, those after it, and its instant [s], so that a
    sample can be taken again while inputs at its instant change.
    """

    period = Parameter(0.1, "s", "sampling period", above=0)
    discrete_states = DeclarationsOf(DiscreteState)
    discrete: ca.SX

    def __init__(self) -> None:
        super().__init__()
        self.discrete = self._add_symbols(state.name for state in self.discrete_states)

    @abstractmethod
    def update(self) -> Mapping[str, ca.SX]:
        """Discrete states after a sample, by name; the symbols are those before it, and the inputs at its instant."""

    def last_sample(self, t: ca.SX) -> ca.SX:
        """Instant [s] of the last sample before or at t, up to an error of clocks; a multiple of the period."""
        return self.period * ca.floor(t / self.period + CLOCK_ERROR)

    @classmethod
    @final
    def is_sampled(cls) -> bool:
        return True

    def visible_states(self, memory: ca.SX) -> ca.SX:
        """Discrete states that other formulas of the component see."""
        return self._memory_parts(memory)[1]

    @final
    def after_sample(self, memory: ca.SX) -> ca.SX:
        """Memory after a sample at ``clock``, one that is due or is taken again; without one, the same memory."""
        before, after, last = self._memory_parts(memory)
        instant, near = self.last_sample(self.clock), CLOCK_ERROR * self.period
        is_sample = self.clock - instant <= near
        before = ca.if_else(ca.logic_and(is_sample, instant > last + 2 * near), after, before)
        is_due = ca.logic_and(is_sample, instant > last - 2 * near)
        return ca.vertcat(
            before, ca.if_else(is_due, self._states_after_update(before), after), ca.if_else(is_due, instant, last)
        )

    def memory_at_start(self, start: ca.SX) -> ca.SX:
        """Memory at initialization; in an operator, before a sample that is due at the start.

        :param start: discrete states.
        """
        return ca.vertcat(start, start, self.clock - 3 * CLOCK_ERROR * self.period)

    @final
    def missed_sample_margin(self, memory: ca.SX) -> ca.SX:
        """Number [s] that is > 0 unless a sample before ``clock`` was missed."""
        near = CLOCK_ERROR * self.period
        return self._memory_parts(memory)[2] + 2 * near - self.last_sample(self.clock - 4 * near)

    def layout(self) -> Layout:
        inner, states = super().layout(), self.discrete_states
        starts = (state.start_parameter() for state in states)
        held = (event_output(item.name, item.unit, item.description, causality=item.causality) for item in states)
        return replace(inner, parameters=(*inner.parameters, *starts), outputs=(*inner.outputs, *held))

    def _memory_parts(self, memory: ca.SX) -> list[ca.SX]:
        """Discrete states before the last sample, those after it, and its instant, from the memory."""
        n = self.discrete.numel()
        return ca.vertsplit(memory, [0, n, 2 * n, 2 * n + 1])

    def _check_update(self, formulas: Formulas) -> None:
        unit = {item.name: ANY if item.unchecked else item.unit for item in self.discrete_states}
        formulas.check_mapping("update", self.symbols | {"t": self.clock}, unit)

    def _states_after_update(self, before: ca.SX) -> ca.SX:
        values = self.update()
        after = stack(ca.SX(values[item.name]) for item in self.discrete_states)
        return ca.substitute(after, self.discrete, before)


class Sampled(SampledStates, abstract=True):
    """Discrete-time component that reads its inputs once per period, at t = 0, period, 2 period, ...; abstract.

    A subclass declares inputs, parameters, discrete states and outputs, and defines ``update``.  Outputs are
    constant between samples; with a delay of computation they change so much later.

    :raises ComponentError: when the subclass is defined, for an unknown symbol, a wrong size or unit.
    """

    delay = Parameter(0.0, "s", "delay of computation: from a sample to the change of outputs", minimum=0)

    def _check(self) -> None:
        if not self.discrete_states:
            raise ComponentError(f"{type(self).__name__} declares no DiscreteState and no DiscreteOutput")
        formulas = Formulas(self)
        self._check_update(formulas)
        formulas.check_units(self.layout().variables, self.symbols | {"t": self.clock}, t="s")

    @final
    def visible_states(self, memory: ca.SX) -> ca.SX:
        """Discrete states that other formulas see: outputs change after the delay of computation."""
        before, after, last = map(ca.vertsplit, self._memory_parts(memory))
        is_ready = self.clock >= last[0] + self.delay - CLOCK_ERROR * self.period
        return stack(
            ca.if_else(is_ready, new, old) if isinstance(item, DiscreteOutput) else new
            for item, new, old in zip(self.discrete_states, after, before, strict=True)
        )

    @final
    def memory_at_start(self, start: ca.SX) -> ca.SX:
        return self.after_sample(super().memory_at_start(start))

    @final
    def conditions(self) -> dict[str, ca.SX]:
        return {"delay must stay <= period": (1 + CLOCK_ERROR) * self.period - self.delay}

    @final
    def events(self) -> Sequence[ca.SX]:
        """The next sample and the next change of outputs, after an instant that clocks of importers may miss."""
        # A delay of a whole period is the next sample, to the bit.
        is_whole = self.delay > (1 - CLOCK_ERROR) * self.period
        late = self.last_sample(self.clock - self.delay) + self.period
        after = ca.if_else(is_whole, self.last_sample(late + self.delay), late + self.delay)
        return [self.last_sample(self.clock) + self.period, after]

    @final
    def next_event_time(self) -> ca.SX:
        """The first of :meth:`events`."""
        return ca.fmin(*self.events())
