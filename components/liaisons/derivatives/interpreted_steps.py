"""The same steps without a compiler."""

from __future__ import annotations

from itertools import pairwise
from typing import final

import casadi as ca
import numpy as np

from liaisons.derivatives.steps import METHOD, Floats, Integers, Segment, Steps
from liaisons.ensembles.right_hand_sides import RightHandSide

_NODES = (*METHOD.nodes, 1.0)
_SUMS = [np.array(row) for row in (*METHOD.matrix, METHOD.weights)]


@final
class InterpretedSteps:
    """Steps by CasADi and NumPy, with the methods of :class:`CompiledSteps`."""

    def __init__(self, equations: RightHandSide) -> None:
        t, k, s, y = equations.symbols
        projected = y if equations.projected is None else equations.projected

        def function(value: ca.SX) -> ca.Function:
            slopes = (ca.densify(ca.jacobian(value, x)) for x in (t, k, y))
            return ca.Function("value", [t, k, s, y], ca.cse([ca.densify(value), *slopes]))

        self._rates, self._project = function(equations.rates), function(projected)

    def _evaluated(
        self, steps: Segment | Steps, stage: int, n: int, time: float, *, k: Floats, y: Floats
    ) -> list[Floats]:
        """Rates at a stage of a step, or a projected state after the last one; and derivatives by t, k and y.

        :param n: number of the step, or of the interval that it is in.
        """
        low, high = steps.limits
        function = self._rates if stage < METHOD.stages else self._project
        clipped = low if time < low else min(time, high)
        value, *slopes = (np.array(x.full()) for x in function(clipped, k, steps.table[steps.rows[n]], y))
        return [value.ravel(), *slopes]

    def _step(
        self, steps: Segment | Steps, n: int, t: float, h: float, *, k: Floats, y: Floats
    ) -> tuple[Floats, Floats]:
        """State at the end, and those of the stages."""
        rates, stages = np.zeros((0, len(y))), list[Floats]()
        for stage, (node, row) in enumerate(zip(_NODES, _SUMS, strict=True)):
            stages.append(y + h * (row @ rates))
            value = self._evaluated(steps, stage, n, t + node * h, k=k, y=stages[-1])[0]
            rates = np.vstack([rates, value])
        return rates[-1], np.array(stages)

    def choose(
        self, segment: Segment, k: Floats, y: Floats, size: Floats, *, tolerance: float, sizes: Floats
    ) -> tuple[Floats, Integers]:
        ends, counts = list[float](), list[int]()
        for n, (begin, end) in enumerate(pairwise(segment.cuts.tolist())):
            t = begin
            while len(counts) == n:
                is_last = size[0] >= 0.999999 * (end - t)
                h = end - t if is_last else min(size[0], 0.5 * (end - t))
                whole, _ = self._step(segment, n, t, h, k=k, y=y)
                halves, _ = self._step(segment, n, t, h / 2, k=k, y=y)
                halves, _ = self._step(segment, n, t + h / 2, h / 2, k=k, y=halves)
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

    def advance(self, steps: Steps, k: Floats, y: Floats, *, keep: bool = False) -> tuple[Floats, Floats]:
        states, kept = list[Floats](), list[Floats]()
        for n, (t, h) in enumerate(zip(steps.t.tolist(), steps.h.tolist(), strict=True)):
            y, stages = self._step(steps, n, t, h, k=k, y=y)
            states.append(y)
            kept.append(stages)
        return np.array(states), np.array(kept if keep else kept[:1])

    def tangents(self, steps: Steps, k: Floats, kept: Floats, of_k: Floats, of_y: Floats) -> tuple[Floats, Floats]:
        records = np.empty((steps.records, *of_y.shape))
        for n, (t, h) in enumerate(zip(steps.t.tolist(), steps.h.tolist(), strict=True)):
            of_t, of_h = (rows[n % len(rows)] for rows in (steps.of_t, steps.of_h))
            rates, slopes = np.zeros((0, len(of_y))), np.zeros((0, *of_y.shape))
            for stage, (node, row) in enumerate(zip(_NODES, _SUMS, strict=True)):
                value, by_t, by_k, by_y = self._evaluated(steps, stage, n, t + node * h, k=k, y=kept[n, stage])
                along = of_y + h * np.tensordot(row, slopes, 1) + np.outer(row @ rates, of_h)
                along = by_y @ along + by_k @ of_k + by_t * (of_t + node * of_h)
                rates, slopes = np.vstack([rates, value]), np.concatenate([slopes, along[None]])
            of_y = slopes[-1]
            if steps.record[n] >= 0:
                records[steps.record[n]] = of_y
        return records, of_y

    def adjoint(
        self, steps: Steps, k: Floats, kept: Floats, weights: Floats, of_y: Floats
    ) -> tuple[Floats, Floats, Floats]:
        of_k, of_t, of_h = np.zeros(len(k)), np.zeros(len(steps.t)), np.zeros(len(steps.t))
        for n in reversed(range(len(steps.t))):
            t, h, by_stage = steps.t[n], steps.h[n], np.zeros((METHOD.stages + 1, len(of_y)))
            if steps.record[n] >= 0:
                of_y += weights[steps.record[n]]
            for stage in reversed(range(METHOD.stages + 1)):
                factors = sum(_SUMS[later][stage] * by_stage[later] for later in range(stage + 1, len(_SUMS)))
                scaled = h * factors if stage < METHOD.stages else of_y.copy()
                value, by_t, by_k, by_y = self._evaluated(steps, stage, n, t + _NODES[stage] * h, k=k, y=kept[n, stage])
                by_stage[stage] = scaled @ by_y
                of_k += scaled @ by_k
                of_t[n] += scaled @ by_t[:, 0]
                of_h[n] += _NODES[stage] * (scaled @ by_t[:, 0]) + (value @ factors if stage < METHOD.stages else 0)
            of_y[:] = by_stage.sum(axis=0)
        return of_k, of_t, of_h
