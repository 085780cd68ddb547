"""References by integration: Lagrange's equations by SymPy, by two rules and in two precisions."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from itertools import pairwise
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

    :ivar dynamics: of instant, states and where the last jump was: their rates, the forces of the prescribed joints,
        and the energy.
    :ivar motions: of the prescribed joints.
    :ivar start: of the states, of which the first ``asked`` are asked.
    :ivar jumps: instant -> what is added to the work there.
    """

    dynamics: Callable[..., tuple[Sequence[Any], Sequence[Any], Any]]
    motions: Sequence[Motion]
    start: Sequence[float]
    asked: int
    stop: float
    jumps: Mapping[float, float] = field(default_factory=dict)

    def pieces(self, stop: float) -> Iterator[tuple[float, float, float, Rates]]:
        """Begin, end, the work that is added at the end, and rates with that of the work."""
        for begin, end in pairwise([0.0, *(t for t in self.jumps if t < stop), stop]):

            def rates(t: Any, y: Sequence[Any], begin: float = begin) -> list[Any]:
                states, forces, _ = self.dynamics(t, y[:-1], begin)
                speeds = (motion(t, begin)[1] for motion in self.motions)
                return [*states, sum(f * v for f, v in zip(forces, speeds, strict=True))]

            yield begin, end, self.jumps.get(end, 0.0) * (end < stop), rates

    def integrated(self, times: NDArray) -> tuple[NDArray, NDArray]:
        """At instants, states and work (times, n), and the force of the first joint; at a jump those before it."""
        y = np.array([*self.start, 0.0])
        rows, forces = [], []
        for begin, end, work, rates in self.pieces(float(times[-1])):
            inside = times[(times > begin + NEAR) & (times <= end + NEAR)]
            points = np.unique(np.minimum([*inside, end], end))
            run = solve_ivp(rates, (begin, end), y, "DOP853", t_eval=points, rtol=3e-14, atol=1e-15, max_step=0.004)
            for t in inside:
                rows.append(run.y[:, np.argmin(np.abs(points - t))])
                forces.append(self.dynamics(t, rows[-1][:-1], begin)[1][0])
            y = run.y[:, -1].copy()
            y[-1] += work
        return np.array(rows), np.array(forces)

    def answer(self, times: NDArray) -> Answer:
        rows, forces = self.integrated(times)
        return Answer(rows[:, : self.asked], forces, rows[:, -1])

    def checks(self) -> dict[str, float]:
        """The other method, and the energy account, relative to size."""
        [end], _ = self.integrated(np.array([self.stop]))
        y = np.array([*self.start, 0.0], dtype=np.longdouble)
        for begin, until, work, rates in self.pieces(self.stop):
            count = math.ceil((until - begin) / 0.02)
            size = np.longdouble(until - begin) / count
            for k in range(count):
                y = _extrapolated(rates, begin + k * size, y, size)
            y[-1] += work
        last = self.dynamics(self.stop, end[:-1], max(self.jumps, default=0.0))[2]
        lost = last - self.dynamics(0.0, self.start, 0.0)[2] - end[-1]
        return {
            "extrapolation": float(np.max(np.abs(end - y) / np.maximum(np.abs(y), 1))),
            "energy account": float(abs(lost) / max(1.0, abs(end[-1]))),
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
    def functions(self) -> list[Callable[..., Any]]:
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

        def function(arguments: Sequence[Any], values: Sequence[Any]) -> Callable[..., Any]:
            inputs, outputs = (
                [sympy.sympify(value).xreplace(symbols) for value in each] for each in (arguments, values)
            )
            return sympy.lambdify(inputs, outputs, [{"sin": sin, "cos": cos}, "math"], cse=True)

        accelerations = [*matrix.LUsolve(right)] if n else []
        return [function(known, accelerations), function([*known, *unknown], [*left[n:], energy])]

    def dynamics(self, t: Any, y: Sequence[Any], since: float) -> tuple[Sequence[Any], Sequence[Any], Any]:
        motions = [motion(t, since) for motion in self.prescribed.values()]
        known = [*(motion[k] for k in range(3) for motion in motions), *y]
        accelerations = self.functions[0](*known)
        *forces, energy = self.functions[1](*known, *accelerations)
        return [*y[len(self.start) :], *accelerations], forces, energy

    def task(self, name: str, stop: float, jumps: Mapping[float, float] | None = None, **more: Any) -> Task:
        start = [value for values in zip(*self.start.values(), strict=True) for value in values]
        motions = {str(q.func): motion for q, motion in self.prescribed.items()}
        equations = Equations(self.dynamics, [*motions.values()], start, len(self.start), stop, jumps or {})
        starts = {str(q.func): values for q, values in self.start.items()}
        fields = {"start": starts, "asked": [*starts], "answer": equations.answer, "checks": equations.checks}
        fields |= {"lagrange": self, "jumps": tuple(equations.jumps)}
        return Task(name, stop, motions, **(fields | more))


def pieces(
    first: Any, leaves: Callable[[float, Any], float], following: Callable[[float, Any], Any], stop: float
) -> list[Any]:
    """Of a motion: each begins at its first value, and lasts until ``leaves`` changes its sign."""
    found = [first]
    while True:
        last = found[-1]
        for t in np.arange(last[0] + 1e-7, stop, 1e-3):
            if leaves(t, last) * leaves(t + 1e-3, last) <= 0:
                found.append(following(float(brentq(leaves, t, t + 1e-3, (last,), xtol=1e-16, rtol=1e-15)), last))
                break
        else:
            return found


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
