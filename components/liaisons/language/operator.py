"""An operator: source of σ(t) and its two derivatives, from one expression."""

import logging
import sys
from abc import abstractmethod
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from functools import reduce
from itertools import pairwise, takewhile
from typing import Any, final

import casadi as ca

from liaisons.algebra import stack
from liaisons.base import units
from liaisons.errors import ComponentError
from liaisons.expressions import is_smooth
from liaisons.language.checks import Formulas, call
from liaisons.language.component import SignalComponent
from liaisons.language.declarations import ParameterArray
from liaisons.language.layout import Layout, readable
from liaisons.language.sampled import SampledStates
from liaisons.language.variables import Terminal, TerminalMember

_log = logging.getLogger(__name__)

TRIPLE = ("y", "y_dot", "y_ddot")
_TEXTS = ("signal", "first derivative of the signal", "second derivative of the signal")


@final
@dataclass(frozen=True, eq=False)
class Lookup:
    """Two rows of a table, as symbols."""

    time: ca.SX
    columns: tuple[str, ...]
    rests: bool
    begin: ca.SX
    end: ca.SX


class Operator(SignalComponent, abstract=True):
    """Source of a signal y(t) and its derivatives, for an active port; abstract.

    A subclass declares parameters and defines :meth:`signal`; where the signal is not smooth, also :meth:`events`,
    which become communication points.  A controller declares inputs and internal states with ``internal_rates``;
    its signal depends on an input through at least three states, so that y, y_dot and y_ddot are continuous.  One that
    is ``SampledStates``, too, reads its inputs at samples.
    The outputs ``y``, ``y_dot``, ``y_ddot`` have the unit of the port they are connected to.

    :raises ComponentError: when the subclass is defined, for an unknown symbol, a wrong size, or a signal one of whose
        derivatives jumps with an input.
    """

    lookups: list[Lookup] | None = None  # a list: rows are symbols, kept in it

    @abstractmethod
    def signal(self, t: ca.SX) -> ca.SX:
        """Signal y as an expression of time, parameters and internal states."""

    def interval(self, t: ca.SX, *columns: str, rests: bool = False) -> tuple[list[ca.SX], list[ca.SX]]:
        """Values of these columns of the table at both ends of its interval that contains t.

        The parameter arrays that are declared first and have one dimension are the table, a column each; the first of
        them has the instants of the rows, ascending, and ends where they no longer ascend.  Before all rows it is the
        first interval, behind them the last one; intervals without length are none.  An FMU's runtime looks rows up,
        and the functions generated for it see no others; a file in its resources may hold more rows.

        :param t: instant; may depend on time, internal states, inputs and other parameters.
        :param columns: names of the parameter arrays.
        :param rests: behind all rows both are the last one.
        """
        if self.lookups is None:
            return self._selected_rows(t, columns, rests=rests)
        for lookup in self.lookups:
            if (lookup.columns, lookup.rests) == (columns, rests) and ca.is_equal(lookup.time, t, 100):
                break
        else:
            begin, end = (ca.vertcat(*(ca.SX.sym(f"{c}[{row}]") for c in columns)) for row in ("k", "k+1"))
            lookup = Lookup(t, columns, rests, begin, end)
            self.lookups.append(lookup)
        return ca.vertsplit(lookup.begin), ca.vertsplit(lookup.end)

    def _selected_rows(self, t: ca.SX, columns: Sequence[str], *, rests: bool) -> tuple[list[ca.SX], list[ca.SX]]:
        """Values of :meth:`interval` as expressions of the whole table, without a look-up at run time."""
        instants, ascends = ca.vertsplit(self.table[0].value_in(self)), ca.SX(1)
        last = len(instants) - 1
        has_length = []
        for t_0, t_1 in pairwise(instants):
            ascends = ca.logic_and(ascends, t_1 >= t_0)
            has_length.append(ca.logic_and(ascends, ca.logic_or(rests, t_1 > t_0)))
        row = ca.SX(0 if rests else -1)
        for k, begin in enumerate(instants[1:] if rests else instants[:-1]):
            reached = t >= begin if rests else ca.logic_or(t >= begin, row < 0)
            row = ca.if_else(ca.logic_and(has_length[k], reached), k + rests, row)
        begun = stack(row == k for k in range(last + 1))
        if not rests:  # where no interval has a length
            begun[last - 1] = ca.logic_or(begun[last - 1], row < 0)
        has_next = stack([*has_length, 0]) if rests else 1
        ended = stack([0, *ca.vertsplit(begun * has_next)[:-1]]) + begun * (1 - has_next)
        whole = [next(p for p in self.table if p.name == name).value_in(self) for name in columns]
        return [ca.dot(begun, x) for x in whole], [ca.dot(ended, x) for x in whole]

    @property
    def table(self) -> list[ParameterArray]:
        """Columns of :meth:`interval`: the parameter arrays of one dimension that are declared first."""
        arrays: list[Any] = list(takewhile(lambda p: isinstance(p, ParameterArray), self.parameters))
        return [p for p in arrays if p.dimension == arrays[0].dimension]

    def events(self) -> Sequence[ca.SX]:
        """Instants [s] at which y or one of its first two derivatives is not smooth; the solver stops there.

        Expressions of parameters.  Where events recur, of ``clock``, too: instants about that time, the first one
        after it among them.  With ``k = ca.floor(self.clock / self.period)``, which rounding may put off by one, these
        are ``[i * self.period for i in (k, k + 1, k + 2)]``.
        """
        return []

    def layout(self) -> Layout:
        inner = super().layout()
        signals = (readable(name, units.ANY, text) for name, text in zip(TRIPLE, _TEXTS, strict=True))
        return replace(
            inner,
            outputs=(*signals, *inner.outputs),
            ports=(Terminal("y", "signal", tuple(map(TerminalMember, ("s", "v", "a"), TRIPLE))),),
            dimensions=tuple(dict.fromkeys(p.dimension for p in self.parameters if isinstance(p, ParameterArray))),
        )

    def _check(self) -> None:
        formulas, symbols = Formulas(self), self.symbols | {"t": self.clock}
        formulas("signal", symbols, units.ANY, self.clock)
        for i, instant in enumerate(call(self, "events")):
            formulas.add(f"events[{i}]", instant, symbols, "s")
        if call(self, "next_event_time") is None and not is_smooth(ca.SX(self.signal(self.clock)), self.clock):
            _log.warning(
                "%s: the signal has kinks or jumps (abs, sign, fmin, fmax, floor, if_else, ...); return their instants "
                "in events(), or whoever follows it may step over them",
                type(self).__name__,
            )
        formulas.check_internal_rates(symbols if isinstance(self, SampledStates) else self.symbols)
        if isinstance(self, SampledStates):
            self._check_update(formulas)
        formulas.check_units(self.layout().variables, symbols, t="s")
        for name, expression in zip(TRIPLE, self.triple(), strict=True):
            if self.inputs and ca.depends_on(expression, self.input_column):
                raise ComponentError(
                    f"{type(self).__name__}: {name} jumps with an input; pass the input through three internal states, "
                    "each of which follows the one before"
                )

    def triple(self) -> list[ca.SX]:
        """Signal y and its first two derivatives, along the motion of the internal states."""
        rates, triple = self.internal_rate_column(), [ca.SX(self.signal(self.clock))]
        for _ in range(2):
            y = triple[-1]
            triple.append(ca.jacobian(y, self.clock) + ca.jtimes(y, self.internal, rates))
        return triple

    def next_event_time(self) -> ca.SX | None:
        """First instant [s] after ``clock`` at which the signal is not smooth; None: it always is.

        The first of :meth:`events`.  An operator whose instants depend on internal states returns its own,
        ``self.first_after(instants)``.
        """
        instants = self.events()
        return self.first_after(instants) if instants else None

    @final
    def first_after(self, instants: Iterable[ca.SX]) -> ca.SX:
        """Earliest of these instants after ``clock`` [s]; the greatest double if there is none."""
        after = [ca.if_else(instant > self.clock, instant, sys.float_info.max) for instant in instants]
        return reduce(ca.fmin, after, ca.SX(sys.float_info.max))
