"""The signals of a system in a coupled step: their values and derivatives at both ends, and what follows for inputs."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass
from functools import lru_cache
from itertools import compress, count
from typing import Any, final

import numpy as np

from liaisons.base.arrays import as_indices
from liaisons.base.hermite import coefficient_matrix
from liaisons.cosim.compiled.calls import Call, Memory, Record
from liaisons.cosim.coupling.records import SignalHistoryRecord
from liaisons.cosim.structure.schedule import VariableReference
from liaisons.cosim.structure.simulation import Simulation
from liaisons.cosim.structure.sources import SIGNALS


@final
@dataclass(frozen=True)
class Curve:
    """Curve of an input within a step: a derivative of the polynomial through data at both ends.

    :param data: indices of value, first and second derivative, as far as there are any.
    :param order: which derivative the input is.
    :param rate: index of the derivative of the input; that of the zero if it is not known.
    """

    data: tuple[int, ...]
    order: int
    rate: int


HIGHEST = 5
"""Order of the highest derivative that an FMU of ours takes."""

_MOST = 6
"""Largest number of data of a curve: three at either end of a step."""


def polynomial_arrays(curves: Sequence[Curve], zero: int, highest: int) -> tuple[list[tuple[int, int]], dict[str, Any]]:
    """Arrays by which compiled code calculates derivatives of inputs at the start of a step from the signals.

    :param curves: curve of each input.
    :param zero: index of the last signal, which is 0.
    :param highest: order of the highest derivative; 1 leaves straight lines.
    :returns: input and order of each derivative, and the arrays: indices of the ``signals`` at both ends, and powers of
        H by which these are multiplied, ``scaling``; of each derivative the terms of its sum, ``term``, with
        ``factors``, both of shape (derivatives, terms), the power of H in the denominator, ``after``, the signal that
        it is at the start, ``begun``, and the input that it is a derivative ``of``.
    """
    return _polynomial_arrays(tuple(curves), zero, highest)


@lru_cache(maxsize=1024)
def _polynomial_arrays(
    curves: tuple[Curve, ...], zero: int, highest: int
) -> tuple[list[tuple[int, int]], dict[str, Any]]:
    """The arrays themselves, once for systems that are alike."""
    derivatives = [(k, order) for k in range(len(curves)) for order in range(1, highest + 1)]
    motions = [(*curve.data[curve.order :], *[zero] * HIGHEST) for curve in curves]
    followed = curves if highest > 1 else [Curve((c.data[c.order],), 0, c.rate) for c in curves]
    ends = (0, zero + 1)
    signals: dict[tuple[int, int], int] = {}
    terms = tuple(
        tuple(signals.setdefault((end + index, i), len(signals)) for end in ends for i, index in enumerate(curve.data))
        for curve in followed
    )
    indices, scaling = zip(*signals, strict=True)
    begun = as_indices([motions[k][order] for k, order in derivatives])
    shared = _shared_arrays(terms, tuple(curve.order for curve in followed), scaling, highest)
    return derivatives, {"signals": as_indices(indices), "begun": begun, **shared}


@lru_cache(maxsize=1024)
def _shared_arrays(
    terms: tuple[tuple[int, ...], ...], orders: tuple[int, ...], scaling: tuple[int, ...], highest: int
) -> dict[str, Any]:
    """The arrays that depend on no index of a signal; FMUs share them, to keep them in the processor's cache."""
    inputs = np.arange(len(terms)).repeat(highest)
    columns = np.empty((len(inputs), _MOST), dtype=np.intp)
    factors, after = np.zeros(columns.shape), np.empty_like(inputs)
    for row, k in enumerate(inputs):
        order, many = row % highest + 1, len(terms[k])
        power = after[row] = order + orders[k]
        columns[row] = terms[k][0]  # beyond the terms, times 0
        if power < many:
            columns[row, :many] = terms[k]
            factors[row, :many] = coefficient_matrix(many // 2)[power] * math.factorial(power)
    return {"scaling": as_indices(scaling), "term": columns, "factors": factors, "after": after, "of": inputs}


@final
class Signals:
    """Values of all connected outputs, and their slopes: derivatives by time, given by FMUs or estimated.

    Index i < n is a value, n + i its slope, 2n a zero that stands for an unknown number.

    :param references: the outputs, those of one component side by side.
    :ivar sloped: components that give derivatives of their outputs.
    :ivar ends: all at t and at t + H; ``earlier`` those at the point before t, ``since`` how long ago that was.
    :ivar rates: index of the derivative of each.
    :ivar sizes: the largest value of each unit so far; ``kinds`` says for each output, which of them is its.
    :ivar result: room for what one evaluation gives.
    :ivar memory: what a repeated step restores.
    :ivar held: whether a value is discrete: until t + H it stays as it was at t.
    """

    def __init__(self, simulation: Simulation, references: Sequence[VariableReference]) -> None:
        self._parts, self._feeds = simulation.parts, simulation.feeds
        self._prescribed = simulation.chosen_reconstructions
        self._port_and_order = simulation.port_and_order
        self.count = len(references)
        self.references = references
        self.index = dict(zip(references, count()))
        self.sloped = self._find_components_with_slopes()
        self.zero = 2 * self.count
        self.ends = np.zeros((2, self.zero + 1))
        self.before, self.now = self.ends  # at t, and the present guess at t + H
        self.earlier = np.zeros(self.zero + 1)  # at the point before t
        self.since = np.zeros(1)  # how long ago that was; 0: there was none
        self.held = np.zeros(self.zero + 1, dtype=bool)
        self.rates = np.full(self.zero + 1, self.zero, dtype=np.intp)
        for reference, k in self.index.items():
            owner, variable = reference
            self.held[k] = owner != SIGNALS and not self._parts[owner].fmu.variables[variable].continuous
            self.rates[k] = self._rate_index(reference)
        self.kinds = np.unique(simulation.units_of(references), return_inverse=True)[1]
        self.sizes = np.zeros(int(self.kinds.max(initial=-1)) + 1)
        self.result = np.zeros(self.zero + 1)
        self.memory = Memory([self.ends, self.earlier, self.since])

    def slope_index(self, reference: VariableReference) -> int:
        """Index of the slope of an output; that of the zero if nothing gives it.

        The slope of the acceleration of a port follows from a function of time that drives the port.
        """
        whole = reference[0] == SIGNALS and len(self._port_and_order(reference)[0]) == 3
        return self.count + self.index[reference] if whole or reference[0] in self.sloped else self.zero

    def curve(self, input_: VariableReference, cycle: Collection[str] = ()) -> Curve:
        """The curve of an input.

        :param cycle: components that are solved together with it, whose slopes are not estimated.
        """
        source = self._feeds[input_]
        triple, order = self._port_and_order(source)
        data = [*map(self.index.__getitem__, triple)]
        if len(data) == 1 and (source[0] in self.sloped or source[0] not in cycle):
            data.append(self.count + data[0])
        return Curve(tuple(data), order, self._rate_index(source))

    def port_value_index(self, input_: VariableReference, cycle: Collection[str]) -> int:
        """Index of the value of the port that feeds an input; that of the zero for a continuous one of its cycle."""
        source = self._feeds[input_]
        first = self.index[self._port_and_order(source)[0][0]]
        return self.zero if source[0] in cycle and not self.held[first] else first

    def port_of_acceleration(self, index: int) -> list[int]:
        """Indices of value, rate and acceleration of a port by that of its acceleration; else none."""
        triple, order = self._port_and_order(self.references[index])
        return [self.index[r] for r in triple] if order == 2 and all(r in self.index for r in triple) else []

    def _rate_index(self, source: VariableReference) -> int:
        triple, order = self._port_and_order(source)
        return self.index[triple[order + 1]] if order + 1 < len(triple) else self.slope_index(source)

    def _find_components_with_slopes(self) -> frozenset[str]:
        """Components that give derivatives of outputs and can be given those of all their inputs."""
        names = {name for name, c in self._parts.items() if c.fmu.output_derivative_order > 0}
        while True:
            self.sloped = frozenset(names)
            self.zero = 2 * self.count
            for (name, _), source in self._feeds.items():
                informed = self._parts[name].approximation.takes_polynomials and name not in self._prescribed
                if name in names and not (informed and self._rate_index(source) != self.zero):
                    names.discard(name)
            if len(names) == len(self.sloped):
                return self.sloped


@final
class SignalHistory:
    """Past values of the outputs of a strong component that feed others.

    Slopes that no FMU gives are estimated from the points before a step, else from two inside.  Discrete outputs keep
    their value from the start of a step until its end.

    :param curves: curves of the inputs that are fed.
    :ivar made: indices of the outputs whose slopes are estimated.
    :ivar memory: their values at the last two points, the steps between [s], and how many points there are.
    :ivar others: their values at two :attr:`instants` after the start of the step [s], if they have no past; shape
        (2, n).
    """

    def __init__(self, signals: Signals, curves: Iterable[Curve]) -> None:
        made: dict[int, bool] = {}
        for curve in curves:
            first, *further = curve.data
            made[first] = len(further) == 1 and signals.references[first][0] not in signals.sloped
        self.made = as_indices([*compress(made, made.values())])
        n = len(self.made)
        self.memory = Memory([np.zeros((2, n)), np.ones(2), np.ones(n, dtype=np.intp)])
        self.instants, self.others = np.zeros(2), np.zeros((2, n))

    def record(self, step_in_thirds: Call | None) -> Record:
        """The history for compiled code.

        :param step_in_thirds: makes a step, and sets :attr:`others` to the outputs inside it.
        """
        record = SignalHistoryRecord(made=len(self.made))
        record.point(**dict(zip(("past", "spans", "depth"), self.memory.arrays, strict=True)))
        record.point(values=self.made, instants=self.instants, others=self.others)
        record.step_in_thirds = step_in_thirds and step_in_thirds.compiled_record().function
        return record
