"""References by integration: Lagrange's equations by SymPy, by two rules and in two precisions."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import sympy
from numpy.typing import NDArray
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from referee.task import NEAR, Answer, Motion, Task, cos, sin

TIME = sympy.Symbol("t")
Rates = Callable[[Any, Sequence[Any]], Sequence[Any]]


def coordinates(names: str) -> list[Any]:
    """Functions of time."""
    return [sympy.Function(name)(TIME) for name in names.split()]


@dataclass(frozen=True)
class Equations:
    """Integrated by Dormand and Prince's rule of order 8 (SciPy), and by extrapolation.

    :ivar dynamics: of instant and states (and of where the last jump was, if there are any): their rates, the forces
        of the prescribed joints, and the energy.
    :ivar motions: of the prescribed joints.
    :ivar start: of the states.
    :ivar asked: of the states, how many are asked.
    :ivar jumps: instant -> what is added to the work there.
    """

    dynamics: Callable[..., tuple[Sequence[Any], Sequence[Any], Any]]
    motions: Sequence[Motion]
    start: Sequence[float]
    asked: int
    stop: float
    jumps: Mapping[float, float]

    def pieces(self, stop: float) -> list[tuple[float, float, float, Rates]]:
        """Begin, end, the work that is added at the end, and rates with that of the work."""
        marks = [*(t for t in self.jumps if t < stop), stop]
        found = []
        for begin, end in zip([0.0, *marks], marks, strict=False):
            since = (begin,) if self.jumps else ()

            def rates(t: Any, y: Sequence[Any], since: tuple[float, ...] = since) -> list[Any]:
                states, forces, _ = self.dynamics(t, y[:-1], *since)
                speeds = [motion(t, *since)[1] for motion in self.motions]
                return [*states, sum(f * v for f, v in zip(forces, speeds, strict=True))]

            found.append((begin, end, self.jumps.get(end, 0.0) * (end < stop), rates))
        return found

    def states(self, times: NDArray) -> NDArray:
        """At instants, (states and work, times); at a jump those before it."""
        y, columns = np.array([*self.start, 0.0]), []
        for begin, end, work, rates in self.pieces(float(times[-1])):
            inside = times[(times > begin + NEAR) & (times <= end + NEAR)]
            points = np.unique(np.minimum([*inside, end], end))
            run = solve_ivp(rates, (begin, end), y, "DOP853", t_eval=points, rtol=3e-14, atol=1e-15, max_step=0.004)
            columns += [column for t, column in zip(points, run.y.T, strict=True) if np.any(np.abs(inside - t) < NEAR)]
            y = run.y[:, -1].copy()
            y[-1] += work
        return np.array(columns).T

    def answer(self, times: NDArray) -> Answer:
        y = self.states(times)
        since = [[max([0.0, *(j for j in self.jumps if j < t - NEAR)])] if self.jumps else [] for t in times]
        forces = [self.dynamics(t, c[:-1], *s)[1][0] for t, c, s in zip(times, y.T, since, strict=True)]
        return Answer(y[: self.asked].T, np.array(forces), y[-1])

    def checks(self) -> dict[str, float]:
        """The other method, and the energy account, relative to size."""
        end, y = self.states(np.array([self.stop]))[:, 0], np.array([*self.start, 0.0], dtype=np.longdouble)
        for begin, until, work, rates in self.pieces(self.stop):
            count = math.ceil((until - begin) / 0.02)
            for k in range(count):
                size = np.longdouble(until - begin) / count
                y = _extrapolated(rates, begin + k * size, y, size)
            y[-1] += work
        since = (0.0, max(self.jumps)) if self.jumps else ()
        first, last = (
            self.dynamics(t, states, *since[k : k + 1])[2]
            for k, (t, states) in enumerate([(0.0, self.start), (self.stop, end[:-1])])
        )
        return {
            "extrapolation": float(np.max(np.abs(end - y) / np.maximum(np.abs(y), 1))),
            "energy account": float(abs(last - first - end[-1]) / max(1.0, abs(end[-1]))),
        }


@dataclass(frozen=True)
class Lagrange:
    """Lagrange's equations: of the free coordinates for their accelerations, of the prescribed ones for their forces.

    :ivar start: free coordinate -> place and rate.
    :ivar prescribed: coordinate -> motion.
    """

    lagrangian: Any
    start: Mapping[Any, tuple[float, float]]
    prescribed: Mapping[Any, Motion]

    @cached_property
    def functions(self) -> tuple[Callable[..., Any], Callable[..., Any]]:
        """Of σ, σ̇, σ̈, then of q and q̇: the accelerations; of these, too: the forces and the energy."""
        every, n = [*self.start, *self.prescribed], len(self.start)
        momenta = [self.lagrangian.diff(q.diff(TIME)) for q in every]
        left = [p.diff(TIME) - self.lagrangian.diff(q) for p, q in zip(momenta, every, strict=True)]
        unknown = [q.diff(TIME, 2) for q in self.start]
        matrix, right = sympy.linear_eq_to_matrix(left[:n], unknown) if n else (sympy.eye(0), sympy.Matrix())
        energy = sum(p * q.diff(TIME) for p, q in zip(momenta, every, strict=True)) - self.lagrangian
        known = [q.diff(TIME, k) for k in range(3) for q in self.prescribed]
        known += [q.diff(TIME, k) for k in range(2) for q in self.start]
        symbols = {value: sympy.Dummy() for value in [*known, *unknown]}
        return tuple(  # type: ignore[return-value] - two
            sympy.lambdify(
                [symbols[value] for value in arguments],
                [sympy.sympify(value).xreplace(symbols) for value in values],
                [{"sin": sin, "cos": cos}, "math"],
                cse=True,
            )
            for arguments, values in (
                (known, [*matrix.LUsolve(right)] if n else []),
                ([*known, *unknown], [*left[n:], energy]),
            )
        )

    def dynamics(self, t: Any, y: Sequence[Any], *since: float) -> tuple[Sequence[Any], Sequence[Any], Any]:
        motions = [motion(t, *since) for motion in self.prescribed.values()]
        known = [*(motion[k] for k in range(3) for motion in motions), *y]
        accelerations = self.functions[0](*known)
        *forces, energy = self.functions[1](*known, *accelerations)
        return [*y[len(self.start) :], *accelerations], forces, energy

    def equations(self, stop: float, jumps: Mapping[float, float]) -> Equations:
        start = [value for values in zip(*self.start.values(), strict=True) for value in values]
        return Equations(self.dynamics, list(self.prescribed.values()), start, len(self.start), stop, jumps)

    def task(self, name: str, stop: float, jumps: Mapping[float, float] | None = None, **more: Any) -> Task:
        equations = self.equations(stop, jumps or {})
        fields = {"start": {str(q.func): values for q, values in self.start.items()}}
        fields["asked"] = list(fields["start"])
        fields["motions"] = {str(q.func): motion for q, motion in self.prescribed.items()}
        fields["lagrange"] = self
        fields |= {"jumps": tuple(equations.jumps), "answer": equations.answer, "checks": equations.checks}
        return Task(name, stop, **(fields | more))


def first_root(function: Callable[[float], float], begin: float, stop: float) -> float:
    """At which the sign changes; ``stop`` if it does not."""
    for t in np.arange(begin + 1e-7, stop, 1e-3):
        if function(t) * function(t + 1e-3) <= 0:
            return float(brentq(function, t, t + 1e-3, xtol=1e-16, rtol=1e-15))
    return stop


def _extrapolated(rates: Rates, begin: Any, y: NDArray, size: Any) -> NDArray:
    """A step of Gragg, Bulirsch and Stoer of order 14, in extended precision."""
    counts, table = range(2, 16, 2), []
    for row, n in enumerate(counts):
        h = size / n
        before, now = y, y + h * np.array(rates(begin, y))
        for k in range(1, n):
            before, now = now, before + 2 * h * np.array(rates(begin + k * h, now))
        line = [(before + now + h * np.array(rates(begin + size, now))) / 2]
        for k in range(row):
            line.append(line[k] + (line[k] - table[row - 1][k]) / ((n / counts[row - 1 - k]) ** 2 - 1))
        table.append(line)
    return table[-1][-1]
