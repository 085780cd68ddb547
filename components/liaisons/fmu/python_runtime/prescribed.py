"""Coordinates that an operator prescribes: how far σ, σ̇ and σ̈ contradict each other, and what a jump of σ does.

The motion follows σ by its rate: from the value at the start of a step to ``followed`` at its end.  What σ is off that
at the next communication point it has jumped.  The same as ``prescribed.c`` of the native FMUs, with CasADi's solver.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from functools import lru_cache

import casadi as ca
import numpy as np

from .calls import Array, view
from .motion import HOLD, INTERPOLATE, LEAST, PART
from .table import Table

JUMPS, MIXES = 1, 2  # in the table of jumps: it moves states; rates of both are factors in those of the states

_ROUNDING = 1e-14  # jumps below this part of σ are rounding errors
# Parts of σ, and of what its rate says of a step, that are owed to the tolerance of whoever computes it.
_VALUE, _RATE = 1e-6, 1e-3
_FAR = 5.0  # what is so many times as much as its rate says is a jump

# Columns of the past: at the start of the step; its size, 0 if there was none; where the rate has led at its end; of
# the last comparison, what the rate said, and when.
_VALUE_THEN, _RATE_THEN, _ACCELERATION_THEN, _SIZE, _FOLLOWED, _WENT, _TIME = range(7)


class Prescribed:
    """The prescribed coordinates of one instance, on arrays that the caller shares.

    :param now: array (t, y, u); u are the inputs of the present time.
    :param given: inputs as set by the importer.
    :param m: memory, some of which is the mismatches.
    """

    def __init__(self, table: Table, *, now: Array, given: Array, k: Array, m: Array, size: Array) -> None:
        self._table, self._k, self._size = table, k, size
        self._t, self._y, self._u = np.split(now, [1, 1 + size.size])
        self._now, self._given, self._m = view(self._u), view(given), view(m)
        self.past = np.zeros((len(table.active), 7))
        self._warned: set[int] = set()

    def follow(self) -> None:
        """Begin anew: the motion has followed what is prescribed now."""
        for past, (value, _, _) in self._each():
            past[_SIZE], past[_VALUE_THEN], past[_FOLLOWED] = 0.0, self._now[value], self._now[value]

    def depart(self) -> None:
        """A communication step begins."""
        for past, places in self._each():
            past[:3] = [self._now[place] for place in places]

    def arrive(self, mode: int, H: float) -> None:
        """It has ended."""
        for past, (value, _, _) in self._each():
            went = H * past[_RATE_THEN] + (0.0 if mode == HOLD else H**2 / 2 * past[_ACCELERATION_THEN])
            past[_SIZE] = H
            past[_FOLLOWED] = self._now[value] if mode == INTERPOLATE else past[_VALUE_THEN] + went

    def compare(self, mode: int, H: float) -> None:
        """What is prescribed now and was at the start of the last step; in interpolation the ends of the next one."""
        for i, (past, places) in enumerate(self._each()):
            mismatch = self._table.mismatches[i]
            if mismatch < 0 or (mode != INTERPOLATE and past[_SIZE] == 0):
                continue
            now = [self._now[place] for place in places]
            if mode == INTERPOLATE:
                said, later = now[0] + H * (now[1] + H * now[2] / 2), [self._given[place] for place in places]
                found, past[_WENT] = _compare(said, now, later, H)
                past[_TIME] = self._t[0] + H
            else:
                found, past[_WENT] = _compare(past[_FOLLOWED], past[:3].tolist(), now, past[_SIZE])
                past[_TIME] = self._t[0]
            self._m[mismatch] = 0.0 if mode == HOLD else found

    def warnings(self, mode: int) -> Iterator[str]:
        """What has been found before the present step, once for each of them."""
        names = [entry.name for entry in self._table.inputs]
        for i, (past, places) in enumerate(self._each()):
            mismatch = 0.0 if self._table.mismatches[i] < 0 else self._m[self._table.mismatches[i]]
            if mismatch == 0 or i in self._warned:
                continue
            self._warned.add(i)
            value, rate, acceleration = (names[place] for place in places)
            when = f"{past[_TIME]:.9g}"
            if abs(mismatch) > _FAR * past[_WENT]:
                yield (
                    f"{value} jumps by {mismatch:.6g} at t = {when}, of which {rate} and {acceleration} say nothing: "
                    + self._treatment(i, mode)
                )
            else:
                yield (
                    f"{value}, {rate} and {acceleration} contradict each other: at t = {when}, after a step, "
                    f"{value} is off by {mismatch:.6g} from what they said"
                )

    def leap(self, tolerance: float) -> None:
        """Move the states along with jumps, where that has a limit."""
        jump = self._jumps()
        if jump is None:
            return
        short, long = _leaps(self._table, max(PART * tolerance, LEAST))
        followed, size = self.past[:, _FOLLOWED], self._size[: self._table.coupled]
        point = (self._t, self._y, self._u, self._k, self._size, jump, followed)
        y, error = short(*point)
        if not float(error) <= PART * tolerance:
            try:
                x = long(x0=self._y[: size.size] / size, p=np.concatenate(point))["xf"]
            except RuntimeError:
                return  # the way leads through a singularity, and there is no limit
            y = np.asarray(x).ravel() * size
        y = np.asarray(y).ravel()
        if np.isfinite(y).all():
            self._y[: size.size] = y

    def _each(self) -> Iterator[tuple[Array, tuple[int, int, int]]]:
        return zip(self.past, self._table.active, strict=True)

    def _jumps(self) -> Array | None:
        """How far each of them jumps; None if that moves no states or has no limit."""
        table = np.array(self._table.jumps)
        if not table.size:
            return None
        value, rate = (self._u[[places[i] for places in self._table.active]] for i in (0, 1))
        followed = self.past[:, _FOLLOWED]
        jump = value - followed
        rounding = _ROUNDING * np.maximum(np.abs(value), np.abs(followed))
        jump[(value == self.past[:, _VALUE_THEN]) | (np.abs(jump) <= rounding)] = 0.0
        jumping, mixed = jump != 0, (table & MIXES) != 0
        if mixed[np.ix_(jumping, jumping)].any():
            return None
        moves = (np.diag(table) & JUMPS)[jumping].any() or mixed[np.ix_(jumping, rate != 0)].any()
        return jump if moves else None

    def _treatment(self, i: int, mode: int) -> str:
        if mode == INTERPOLATE:
            return "it is interpolated over the step"
        if self._table.jumps and not self._table.jumps[i][i] & MIXES:
            return "it is taken as the limit of an ever faster motion"
        if "project" in self._table.functions:
            return "the state is put back onto the constraints"
        return "coordinates and momenta stay as they are"


def _compare(said: float, then: list[float], now: list[float], H: float) -> tuple[float, float]:
    """What σ is off, after a step of size H, from where it was said to be, if the step does not explain it; else 0.

    :param then: σ, σ̇, σ̈ at the start of the step.
    :returns: this, and how far the rate says that σ went.
    """
    difference, went = now[0] - said, H * max(abs(then[1]), abs(now[1]))
    # A rate that jumps on the way moves σ by up to H times the jump, an acceleration by up to half of H².
    explained = H * (abs(now[1] - then[1]) + H * abs(now[2] - then[2]) / 2) + _RATE * went
    explained += _VALUE * max(abs(then[0]), abs(now[0])) + math.ulp(1.0)
    return (difference if abs(difference) > explained else 0.0), went


@lru_cache(maxsize=64)
def _leaps(table: Table, tolerance: float) -> tuple[ca.Function, ca.Function]:
    """Jumps of length 1 in a fictitious time: what σ moves on by is added to its rate, what was there is taken away.

    ``short`` (t, y, u, k, n, jump, followed) → (y, largest error / (n + abs(y))) is the midpoint rule, ``long``
    (y/n, of p = all of these) → (y/n,) the adaptive pair of order 5(4).
    """
    f, count, a = table.functions["derivatives"], table.coupled, len(table.active)
    sizes = {name: f.numel_in(i) for i, name in enumerate(("t", "y", "u", "k"))}
    sizes |= {"n": sizes["y"], "jump": a, "followed": a}
    point = [ca.SX.sym(name, size) for name, size in sizes.items()]
    t, y, u, k, n, jump, followed = point
    scale = n[:count]

    def rates(part: ca.SX | float, x: ca.SX) -> ca.SX:
        """What the jump adds to the rates of the coupled states."""
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
