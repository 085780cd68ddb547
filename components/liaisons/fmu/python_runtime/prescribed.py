"""Prescribed coordinates: mismatch of σ, σ̇ and σ̈, and jumps of σ; as ``prescribed.c``, with CasADi's solver.

The motion follows σ by its rate: from the value at the start of a step to ``followed`` at its end.  The difference to σ
at the next communication point is a jump.  Interpolation reaches σ, unless a polynomial through both ends would have to
move much faster than σ̇ and σ̈ there: such a step is extrapolated, too, and σ jumps at its end.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from functools import lru_cache

import casadi as ca
import numpy as np

from .calls import Call
from .motion import EXTRAPOLATE, HOLD, INTERPOLATE, LEAST, PART
from .table import Table
from .vectors import Vectors

JUMPS, MIXES = 1, 2  # in the table of jumps: one moves states; rates of both are factors in those of the states

_ROUNDING = 1e-14  # jumps below this part of σ are rounding errors
# Parts of σ, and of the distance by its rate, that are the tolerance of the source of σ.
_VALUE, _RATE = 1e-6, 1e-3
_FAR = 5.0  # a difference so many times the distance by rate and acceleration is a jump


class Prescribed:
    """The prescribed coordinates of one instance.

    :param mode: input_reconstruction.
    :param tolerance: of the importer.
    """

    def __init__(self, table: Table, mode: int, tolerance: float, vectors: Vectors) -> None:
        v = vectors
        self._table, self._mode, self._vectors = table, mode, v
        self._warned: set[int] = set()
        self._checks = bool(table.active) and (
            mode == INTERPOLATE or (mode != HOLD and any(index >= 0 for index in table.mismatches))
        )
        self._leaping = np.zeros(len(table.active))  # whether each σ jumps at the end of an interpolated step
        last_step = v.past_H, v.past_u, v.u
        if self._checks:
            self._largest = np.zeros(1)
            ends = (v.H, v.u, v.given) if mode == INTERPOLATE else last_step
            self._compare = Call(_comparison(table), (*ends, v.m), (v.m, v.went, self._largest, self._leaping))
        self.contradicted = self._checks  # whether σ may differ from what its rates said
        self._moves_states = any(map(any, table.jumps))
        if self._moves_states:
            jump, followed, self._moves, self._error = (
                np.zeros(n) for n in (len(table.active), len(table.active), 1, 1)
            )
            self._largest_error = max(PART * tolerance, LEAST)
            self._y_next = np.zeros(table.coupled)
            self._point = (v.t, v.y, v.u, v.k, v.size, jump, followed)
            short, self._long = _jump_integrators(table, self._largest_error)
            self._find_jumps = Call(_jumps(table, mode), last_step, (jump, followed, self._moves))
            self._jump_at_once = Call(short, self._point, (self._y_next, self._error))

    def arrive(self, H: float) -> None:
        """End a step of length H, whose inputs at the start are still in u; 0: start again from the inputs in u."""
        self._vectors.past_H[0] = H
        self._vectors.past_u[:] = self._vectors.u

    def compare(self, H: float) -> bool:
        """Compare u with that at the start of the last step; in interpolation both ends of the next one.

        Without interpolation there is nothing to compare where the inputs are still those of the end of the last step.

        :returns: whether the next step has to be extrapolated to a jump instead of interpolated.
        """
        interpolating, v = self._mode == INTERPOLATE, self._vectors
        if not self._checks or (v.past_H[0] == 0 and not interpolating):
            return False
        self._compare.run()
        v.compared_at[:] = v.t + H if interpolating else v.t
        self.contradicted = bool(self._largest[0] > 0)
        return interpolating and bool(self._leaping.any())

    def extrapolate(self, H: float) -> None:
        """Replace the given inputs of each σ that jumps at the end of the step by extrapolated ones."""
        for leaping, indices in zip(self._leaping, self._table.active, strict=True):
            if leaping:
                value, rate, acceleration = (self._vectors.u[i] for i in indices)
                ends = value + H * rate + H**2 * acceleration / 2, rate + H * acceleration, acceleration
                self._vectors.given[list(indices)] = ends

    def jump_to_inputs(self) -> None:
        """Jump to the given inputs, at the end of a step that was extrapolated."""
        self.arrive(0.0)
        self._vectors.u[:] = self._vectors.given
        self.jump()

    def warnings(self) -> Iterator[str]:
        """Mismatches before the present step, once for each coordinate."""
        if not self.contradicted:
            return
        names = [entry.name for entry in self._table.inputs]
        for i, (index, indices) in enumerate(zip(self._table.mismatches, self._table.active, strict=True)):
            mismatch = 0.0 if index < 0 else self._vectors.m[index]
            if mismatch == 0 or i in self._warned:
                continue
            self._warned.add(i)
            value, rate, acceleration = (names[index] for index in indices)
            when = f"{self._vectors.compared_at[0]:.9g}"
            if abs(mismatch) > _FAR * self._vectors.went[i]:
                yield (
                    f"{value} jumps by {mismatch:.6g} at t = {when}, of which {rate} and {acceleration} say nothing: "
                    + self._treatment(i)
                )
            else:
                yield (
                    f"{value}, {rate} and {acceleration} contradict each other: at t = {when}, after a step, "
                    f"{value} is off by {mismatch:.6g} from what they said"
                )

    def jump(self) -> None:
        """Move the states along with jumps, where that has a limit."""
        if not self._moves_states:
            return
        self._find_jumps.run()
        if not self._moves[0]:
            return
        self._jump_at_once.run()
        y, count = self._y_next, self._table.coupled
        states = self._vectors.y[:count]
        if not self._error[0] <= self._largest_error:
            size = self._vectors.size[:count]
            try:
                x = self._long(x0=states / size, p=np.concatenate(self._point))["xf"]
            except RuntimeError:
                return  # through a singularity there is no limit
            y = np.asarray(x).ravel() * size
        if np.isfinite(y).all():
            states[:] = y

    def _treatment(self, i: int) -> str:
        if self._table.jumps and not self._table.jumps[i][i] & MIXES:
            return "it is taken as the limit of an ever faster motion"
        if "project" in self._table.functions:
            return "the state is put back onto the constraints"
        return "coordinates and momenta stay as they are"


@lru_cache(maxsize=64)
def _comparison(table: Table) -> ca.Function:
    """(H, u at the start of a step, u at its end, m) → (m with the mismatches, distances, largest mismatch, jumps).

    Distances are the most that rates and accelerations explain; a difference far beyond is a jump.  A mismatch is the
    difference between σ and where its rates led, if the step does not explain it.
    """
    H, u_0, u_1 = _step_symbols(table)
    m = ca.SX.sym("m", table.functions["start"].numel_out(1))
    m_next, distances, leaping = ca.SX(m), [], []
    for index, indices in zip(table.mismatches, table.active, strict=True):
        before, now = ([u[i] for i in indices] for u in (u_0, u_1))
        difference = now[0] - _followed(EXTRAPOLATE, H, before)
        rate, acceleration = (ca.fmax(ca.fabs(before[i]), ca.fabs(now[i])) for i in (1, 2))
        distance = H * (rate + H * acceleration / 2)
        # A rate that jumps inside the step moves σ by up to H times the jump, an acceleration by up to half of H².
        explained = H * (ca.fabs(now[1] - before[1]) + H * ca.fabs(now[2] - before[2]) / 2) + _RATE * distance
        explained += _VALUE * ca.fmax(ca.fabs(before[0]), ca.fabs(now[0])) + math.ulp(1.0)
        distances.append(distance)
        leaping.append(ca.fabs(difference) > _FAR * distance)
        if index >= 0:
            m_next[index] = ca.if_else(ca.fabs(difference) > explained, difference, 0)
    mismatches = [index for index in table.mismatches if index >= 0]
    largest = ca.norm_inf(m_next[mismatches]) if mismatches else ca.SX(0)
    results = [m_next, ca.vertcat(*distances), largest, ca.vertcat(*leaping)]
    return ca.Function("comparison", [H, u_0, u_1, m], [ca.densify(result) for result in ca.cse(results)])


def _step_symbols(table: Table) -> tuple[ca.SX, ca.SX, ca.SX]:
    """Length of a step, inputs at its start and at its end."""
    return ca.SX.sym("H"), ca.SX.sym("u_0", len(table.inputs)), ca.SX.sym("u_1", len(table.inputs))


def _followed(mode: int, H: ca.SX, start: list[ca.SX]) -> ca.SX:
    """Where σ, σ̇, σ̈ at the start of a step of size H have led at its end."""
    return start[0] + H * (start[1] if mode == HOLD else start[1] + H * start[2] / 2)


@lru_cache(maxsize=64)
def _jumps(table: Table, mode: int) -> ca.Function:
    """(H, u at the start of the last step, u now) → (jump of each σ, its start, whether states move by a limit)."""
    H, u_0, u_1 = _step_symbols(table)
    jumps, starts = [], []
    for indices in table.active:
        before, value = [u_0[i] for i in indices], u_1[indices[0]]
        followed = _followed(mode, H, before)
        rounding = _ROUNDING * ca.fmax(ca.fabs(value), ca.fabs(followed))
        stays = ca.logic_or(value == before[0], ca.fabs(value - followed) <= rounding)
        jumps.append(ca.if_else(stays, 0, value - followed))
        starts.append(followed)
    moves, mixed = ca.SX(0), ca.SX(0)
    for i, row in enumerate(table.jumps):
        if row[i] & JUMPS:
            moves = ca.logic_or(moves, jumps[i] != 0)
        for j, kind in enumerate(row):
            if kind & MIXES:
                moves = ca.logic_or(moves, ca.logic_and(jumps[i] != 0, u_1[table.active[j][1]] != 0))
                mixed = ca.logic_or(mixed, ca.logic_and(jumps[i] != 0, jumps[j] != 0))
    moving = ca.logic_and(moves, ca.logic_not(mixed))
    return ca.Function("jumps", [H, u_0, u_1], ca.cse([ca.vertcat(*jumps), ca.vertcat(*starts), moving]))


@lru_cache(maxsize=64)
def _jump_integrators(table: Table, tolerance: float) -> tuple[ca.Function, ca.Function]:
    """Jumps in a fictitious time of length 1: what the jump, added to the rate of σ, adds to the rates of the states.

    ``short`` (t, y, u, k, n, jump, followed) → (y, largest error / (n + abs(y))) is the midpoint rule, ``long``
    (y/n, of p = all of these) → (y/n,) the adaptive pair of order 5(4).
    """
    f, count, a = table.functions["derivatives"], table.coupled, len(table.active)
    sizes = {name: f.numel_in(i) for i, name in enumerate("tyuk")}
    sizes |= {"n": sizes["y"], "jump": a, "followed": a}
    point = [ca.SX.sym(name, size) for name, size in sizes.items()]
    t, y, u, k, n, jump, followed = point
    scale = n[:count]

    def rates(part: ca.SX | float, x: ca.SX) -> ca.SX:
        """Contribution of the jump to the rates of the coupled states."""
        resting = ca.SX(u)
        for i, (value, _, _) in enumerate(table.active):
            resting[value] = ca.if_else(jump[i] == 0, u[value], followed[i] + part * jump[i])
        jumping = ca.SX(resting)
        for i, (_, rate, _) in enumerate(table.active):
            jumping[rate] += jump[i]
        state = ca.vertcat(x, y[count:])
        return (f(t, state, jumping, k) - f(t, state, resting, k))[:count]

    begin = rates(0.0, y[:count])
    middle = rates(0.5, y[:count] + begin / 2)
    error = ca.norm_inf((middle - begin) / (scale + ca.fabs(y[:count])))
    x, part = ca.SX.sym("x", count), ca.SX.sym("part")
    problem = {"x": x, "t": part, "p": ca.vertcat(*point), "ode": rates(part, scale * x) / scale}
    options = {"abstol": tolerance, "reltol": tolerance, "show_eval_warnings": False}
    return (
        ca.Function("short", point, ca.cse([y[:count] + middle, error])),
        ca.integrator("long", "erk", problem, 0, 1, options),
    )
