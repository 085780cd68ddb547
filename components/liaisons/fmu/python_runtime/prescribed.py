"""Coordinates that an operator prescribes: how far σ, σ̇ and σ̈ contradict each other, and what a jump of σ does.

The motion follows σ by its rate: from the value at the start of a step to ``followed`` at its end.  What σ is off that
at the next communication point it has jumped.  In interpolation σ is met, unless a polynomial through both ends would
have to move much faster than σ̇ and σ̈ there say: such a step is extrapolated, too, and σ jumps at its end.  The same as
``prescribed.c`` of the native FMUs, with CasADi's solver.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from functools import lru_cache

import casadi as ca
import numpy as np

from .calls import Array, Call, view
from .motion import EXTRAPOLATE, HOLD, INTERPOLATE, LEAST, PART
from .table import Table

JUMPS, MIXES = 1, 2  # in the table of jumps: it moves states; rates of both are factors in those of the states

_ROUNDING = 1e-14  # jumps below this part of σ are rounding errors
# Parts of σ, and of what its rate says of a step, that are owed to the tolerance of whoever computes it.
_VALUE, _RATE = 1e-6, 1e-3
_FAR = 5.0  # what is so many times as much as its rate and acceleration say is a jump


def past_size(table: Table) -> int:
    """How many numbers there are in the past of :class:`Prescribed`."""
    return 2 + len(table.inputs) + len(table.active)


class Prescribed:
    """The prescribed coordinates of one instance, on arrays that the caller shares.

    :param mode: input_reconstruction.
    :param tolerance: of the importer.
    :param now: array (t, y, u); u are the inputs of the present time.
    :param H: array with the length of the step.
    :param given: inputs as set by the importer.
    :param m: memory, some of which is the mismatches.
    :param size: sizes of the states, which the tolerance is relative to.
    :param past: array (H, u) of the last step and its start, H = 0 if there was none; then, of the last comparison, how
        far the rates said that each σ went, and when.
    """

    def __init__(
        self,
        table: Table,
        mode: int,
        tolerance: float,
        *,
        now: Array,
        H: Array,
        given: Array,
        k: Array,
        m: Array,
        size: Array,
        past: Array,
    ) -> None:
        self._table, self._mode = table, mode
        t, self._y, u = np.split(now, [1, 1 + size.size])
        H_then, u_then, went, when = np.split(past, [1, 1 + u.size, 1 + u.size + len(table.active)])
        self._t, self._now, self._m, self._past = map(view, (t, u, m, past))
        self._H_then, self._then, self._went, self._when = map(view, (H_then, u_then, went, when))
        self._warned: set[int] = set()
        self._u, self._given = u, given
        self._checks = bool(table.active) and (
            mode == INTERPOLATE or (mode != HOLD and any(place >= 0 for place in table.mismatches))
        )
        self._hurries = np.zeros(len(table.active))  # whether what is interpolated would have to hurry
        if self._checks:
            m_next, went_next, largest = np.zeros(m.size), np.zeros(went.size), np.zeros(1)
            ends = (H, u, given) if mode == INTERPOLATE else (H_then, u_then, u)
            self._compare = Call(_comparison(table), (*ends, m), (m_next, went_next, largest, self._hurries))
            self._m_next, self._went_next, self._largest = map(view, (m_next, went_next, largest))
        self.contradicted = self._checks  # whether σ may be off what its rates said
        self._leaps = any(map(any, table.jumps))
        if self._leaps:
            jump, followed, moves, error = (np.zeros(n) for n in (len(table.active), len(table.active), 1, 1))
            self._largest_error = max(PART * tolerance, LEAST)
            self._y_next = np.zeros(table.coupled)
            self._point = (t, self._y, u, k, size, jump, followed)
            short, self._long = _leaps(table, self._largest_error)
            self._find_jumps = Call(_jumps(table, mode), (H_then, u_then, u), (jump, followed, moves))
            self._leap_at_once = Call(short, self._point, (self._y_next, error))
            self._moves, self._error = view(moves), view(error)

    def follow(self) -> None:
        """Begin anew: the motion has followed what is prescribed now."""
        self.arrive(0.0)

    def arrive(self, H: float) -> None:
        """A communication step ends; its inputs at the start are still those of the present time."""
        self._H_then[0] = H
        self._then[:] = self._now

    def compare(self, H: float) -> bool:
        """What is prescribed now and was at the start of the last step; in interpolation the ends of the next one.

        Without interpolation there is nothing to compare where the inputs are still those of the end of the last step.

        :returns: whether the next step is to be extrapolated to a jump, where it would be interpolated.
        """
        interpolating = self._mode == INTERPOLATE
        if not self._checks or (self._H_then[0] == 0 and not interpolating):
            return False
        self._compare.run()
        self._m[:], self._went[:] = self._m_next, self._went_next
        self._when[0] = self._t[0] + H if interpolating else self._t[0]
        self.contradicted = self._largest[0] > 0
        return interpolating and bool(self._hurries.any())

    def extrapolate(self, H: float) -> None:
        """Put the values to which σ is extrapolated in place of those that it would hurry to."""
        for hurries, places in zip(self._hurries.tolist(), self._table.active, strict=True):
            if hurries:
                value, rate, acceleration = (self._now[place] for place in places)
                ends = value + H * rate + H**2 * acceleration / 2, rate + H * acceleration, acceleration
                self._given[list(places)] = ends

    def leap_to_inputs(self) -> None:
        """At the end of a step that was extrapolated: from where the rates have led to what was given."""
        self.arrive(0.0)
        self._u[:] = self._given
        self.leap()

    def warnings(self) -> Iterator[str]:
        """What has been found before the present step, once for each of them."""
        if not self.contradicted:
            return
        names = [entry.name for entry in self._table.inputs]
        for i, (place, places) in enumerate(zip(self._table.mismatches, self._table.active, strict=True)):
            mismatch = 0.0 if place < 0 else self._m[place]
            if mismatch == 0 or i in self._warned:
                continue
            self._warned.add(i)
            value, rate, acceleration = (names[place] for place in places)
            when = f"{self._when[0]:.9g}"
            if abs(mismatch) > _FAR * self._went[i]:
                yield (
                    f"{value} jumps by {mismatch:.6g} at t = {when}, of which {rate} and {acceleration} say nothing: "
                    + self._treatment(i)
                )
            else:
                yield (
                    f"{value}, {rate} and {acceleration} contradict each other: at t = {when}, after a step, "
                    f"{value} is off by {mismatch:.6g} from what they said"
                )

    def leap(self) -> None:
        """Move the states along with jumps, where that has a limit."""
        if not self._leaps:
            return
        self._find_jumps.run()
        if not self._moves[0]:
            return
        self._leap_at_once.run()
        y, count = self._y_next, self._table.coupled
        if not self._error[0] <= self._largest_error:
            size = self._point[4][:count]
            try:
                x = self._long(x0=self._y[:count] / size, p=np.concatenate(self._point))["xf"]
            except RuntimeError:
                return  # the way leads through a singularity, and there is no limit
            y = np.asarray(x).ravel() * size
        if np.isfinite(y).all():
            self._y[:count] = y

    def _treatment(self, i: int) -> str:
        if self._table.jumps and not self._table.jumps[i][i] & MIXES:
            return "it is taken as the limit of an ever faster motion"
        if "project" in self._table.functions:
            return "the state is put back onto the constraints"
        return "coordinates and momenta stay as they are"


@lru_cache(maxsize=64)
def _comparison(table: Table) -> ca.Function:
    """(H, u at the start of a step, u at its end, m) → (m with the mismatches, how far σ went, largest, hurries).

    How far it went at most is what rates and accelerations say; what is off by far more would have to hurry.  A
    mismatch is what σ is off, after a step of size H, from where it was said to be, if the step does not explain it.
    """
    H = ca.SX.sym("H")
    u_0, u_1 = (ca.SX.sym(name, len(table.inputs)) for name in ("u_0", "u_1"))
    m = ca.SX.sym("m", table.functions["start"].numel_out(1))
    m_next, wents, hurries = ca.SX(m), [], []
    for place, places in zip(table.mismatches, table.active, strict=True):
        then, now = ([u[i] for i in places] for u in (u_0, u_1))
        difference = now[0] - _followed(EXTRAPOLATE, H, then)
        rate, acceleration = (ca.fmax(ca.fabs(then[i]), ca.fabs(now[i])) for i in (1, 2))
        went = H * (rate + H * acceleration / 2)
        # A rate that jumps on the way moves σ by up to H times the jump, an acceleration by up to half of H².
        explained = H * (ca.fabs(now[1] - then[1]) + H * ca.fabs(now[2] - then[2]) / 2) + _RATE * went
        explained += _VALUE * ca.fmax(ca.fabs(then[0]), ca.fabs(now[0])) + math.ulp(1.0)
        wents.append(went)
        hurries.append(ca.fabs(difference) > _FAR * went)
        if place >= 0:
            m_next[place] = ca.if_else(ca.fabs(difference) > explained, difference, 0)
    kept = [place for place in table.mismatches if place >= 0]
    largest = ca.norm_inf(m_next[kept]) if kept else ca.SX(0)
    results = [m_next, ca.vertcat(*wents), largest, ca.vertcat(*hurries)]
    return ca.Function("comparison", [H, u_0, u_1, m], [ca.densify(result) for result in ca.cse(results)])


def _followed(mode: int, H: ca.SX, then: list[ca.SX]) -> ca.SX:
    """Where σ, σ̇, σ̈ at the start of a step of size H have led at its end."""
    return then[0] + H * (then[1] if mode == HOLD else then[1] + H * then[2] / 2)


@lru_cache(maxsize=64)
def _jumps(table: Table, mode: int) -> ca.Function:
    """(H, u at the start of the last step, u now) → (how far each σ jumps, from where, whether that moves states).

    It does not where it has no limit.
    """
    H = ca.SX.sym("H")
    u_0, u_1 = (ca.SX.sym(name, len(table.inputs)) for name in ("u_0", "u_1"))
    jumps, starts = [], []
    for places in table.active:
        then, value = [u_0[i] for i in places], u_1[places[0]]
        followed = _followed(mode, H, then)
        rounding = _ROUNDING * ca.fmax(ca.fabs(value), ca.fabs(followed))
        stays = ca.logic_or(value == then[0], ca.fabs(value - followed) <= rounding)
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
