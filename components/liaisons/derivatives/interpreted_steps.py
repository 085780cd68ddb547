"""The same steps without a compiler, by CasADi."""

from __future__ import annotations

from itertools import pairwise
from typing import Any, final

import casadi as ca
import numpy as np

from liaisons.derivatives.steps import METHOD, Floats, Integers, Segment, Steps
from liaisons.ensembles.right_hand_sides import RightHandSide

_NODES = np.array([*METHOD.nodes, 1.0])


@final
class InterpretedSteps:
    """Steps with the methods of :class:`CompiledSteps`; what is kept of each is its first state."""

    def __init__(self, equations: RightHandSide) -> None:
        symbols = equations.symbols
        projected = symbols[3] if equations.projected is None else equations.projected
        rates, project = (ca.Function("value", list(symbols), [ca.densify(x)]) for x in (equations.rates, projected))
        t, k, s, y = (ca.MX.sym("x", x.numel()) for x in symbols)
        h, shifts = ca.MX.sym("h"), ca.MX.sym("shifts", len(_NODES))
        f = ca.MX(y.numel(), 0)
        for stage, row in enumerate((*METHOD.matrix, METHOD.weights)):
            at = y + h * (f @ ca.DM(row)) if row else y
            function = rates if stage < METHOD.stages else project
            f = ca.horzcat(f, function(t + _NODES[stage] * h + shifts[stage], k, s, at))
        self._step = ca.Function("step", [t, h, shifts, k, s, y], [f[:, -1]])
        self._backwards = self._step.reverse(1)

    def choose(
        self, segment: Segment, k: Floats, y: Floats, size: Floats, *, tolerance: float, sizes: Floats
    ) -> tuple[Floats, Integers]:
        ends, counts = list[float](), list[int]()
        for n, (begin, end) in enumerate(pairwise(segment.cuts.tolist())):
            t, s = begin, segment.table[segment.rows[n]]

            def stepped(t: float, h: float, y: Floats, s: Floats = s) -> Floats:
                return _array(self._step(*_times(segment, t, h), k, s, y))

            while len(counts) == n:
                is_last = size[0] >= 0.999999 * (end - t)
                h = end - t if is_last else min(size[0], 0.5 * (end - t))
                whole, halves = stepped(t, h, y), stepped(t + h / 2, h / 2, stepped(t, h / 2, y))
                error = np.max(np.abs(whole - halves) / (sizes + np.abs(whole)))
                factor = 0.9 * (tolerance / max(error, 1e-30)) ** (1 / (METHOD.order + 1)) if np.isfinite(error) else 0
                if not error <= tolerance:
                    size[0] = h * max(factor, 0.1)
                    if t + 1e-3 * size[0] == t:
                        return np.array(ends), np.zeros(0, dtype=int)
                    continue
                size[0] = max(size[0] if is_last else 0.0, h * min(factor, 4.0))
                t, y[:] = end if is_last else t + h, whole
                ends.append(t)
                if t >= end:
                    counts.append(len(ends))
        return np.array(ends), np.array(counts)

    def advance(self, steps: Steps, k: Floats, y: Floats, *, keep: bool = False) -> tuple[Floats, Floats]:  # noqa: ARG002 - kept in any case
        states = [y]
        for t, h, row in zip(steps.t, steps.h, steps.rows, strict=True):
            states.append(_array(self._step(*_times(steps, t, h), k, steps.table[row], states[-1])))
        return np.array(states[1:]), np.array(states[:-1])

    def tangents(self, steps: Steps, k: Floats, kept: Floats, of_k: Floats, of_y: Floats) -> tuple[Floats, Floats]:
        along, records = self._step.forward(of_k.shape[1]), np.empty((steps.records, *of_y.shape))
        nothing = [np.zeros((size, of_k.shape[1])) for size in (len(_NODES), steps.table.shape[1])]
        for n, (t, h, row, y) in enumerate(zip(steps.t, steps.h, steps.rows, kept, strict=True)):
            of_t, of_h = (rows[None, n % len(rows)] for rows in (steps.of_t, steps.of_h))
            point = [*_times(steps, t, h), k, steps.table[row], y, 0 * y]
            of_y = np.array(along(*point, of_t, of_h, nothing[0], of_k, nothing[1], of_y).full())
            if steps.record[n] >= 0:
                records[steps.record[n]] = of_y
        return records, of_y

    def adjoint(
        self, steps: Steps, k: Floats, kept: Floats, weights: Floats, of_y: Floats
    ) -> tuple[Floats, Floats, Floats]:
        of_k, of_t, of_h = np.zeros(len(k)), np.zeros(len(steps.t)), np.zeros(len(steps.t))
        for n in reversed(range(len(steps.t))):
            if steps.record[n] >= 0:
                of_y += weights[steps.record[n]]
            point = [*_times(steps, steps.t[n], steps.h[n]), k, steps.table[steps.rows[n]], kept[n], 0 * of_y]
            by_t, by_h, _, by_k, _, by_y = map(_array, self._backwards(*point, of_y))
            of_t[n], of_h[n], of_y[:] = by_t[0], by_h[0], by_y
            of_k += by_k
        return of_k, of_t, of_h


def _array(matrix: ca.DM) -> Floats:
    return np.array(matrix.full()).ravel()


def _times(steps: Segment | Steps, t: float, h: float) -> list[Any]:
    """Start, size, and shifts of the stages into the limits, as they are not differentiated."""
    times = t + h * _NODES
    low, high = steps.limits
    return [t, h, np.maximum(np.minimum(times, high), low) - times]
