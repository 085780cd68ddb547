"""References by integration: Lagrange's equations by SymPy, by extrapolation and by Dormand and Prince's rule."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache
from typing import Any

import numpy as np
import sympy
from numpy.typing import NDArray
from scipy.integrate import solve_ivp
from scipy.optimize import brentq
from sympy.physics.mechanics import LagrangesMethod

from referee.task import Answer, Motion, Task, cos, sin

TIME = sympy.Symbol("t")  # of SymPy's mechanics
Rates = Callable[[Any, NDArray], NDArray]
COUNTS = range(2, 16, 2)


def dormand_prince(rates: Rates, begin: float, end: float, y: NDArray) -> NDArray:
    return solve_ivp(rates, (begin, end), y, "DOP853", rtol=3e-14, atol=1e-15, max_step=0.004).y[:, -1]


def extrapolated(rates: Rates, begin: float, end: float, y: NDArray) -> NDArray:
    """Gragg, Bulirsch and Stoer's steps of order 14, in extended precision."""
    count = math.ceil((end - begin) / 0.02)
    size = np.longdouble(end - begin) / count
    for t in begin + size * np.arange(count):
        line: list[Any] = []
        for n in COUNTS:
            h = size / n
            before, now = y, y + h * rates(t, y)
            for k in range(1, n):
                before, now = now, before + 2 * h * rates(t + k * h, now)
            last, line = line, [(before + now + h * rates(t + size, now)) / 2]
            for other, fewer in zip(last, COUNTS[len(last) - 1 :: -1], strict=False):
                line.append(line[-1] + (line[-1] - other) / ((n / fewer) ** 2 - 1))
        y = line[-1]
    return y


@dataclass(frozen=True)
class Equations:
    """Integrated from one jump to the next.

    :ivar dynamics: of instant and states: their rates, the forces of the prescribed joints, and the energy.
    :ivar motions: of the prescribed joints.
    :ivar start: of the states, of which the first ``asked`` are asked.
    :ivar jumps: instant -> what is added to the work there; nothing is asked at that instant.
    """

    dynamics: Callable[[Any, Sequence[Any]], tuple[Sequence[Any], Sequence[Any], Any]]
    motions: Sequence[Motion]
    start: Sequence[float]
    asked: int
    jumps: Mapping[float, float] = field(default_factory=dict)

    def solved(self, times: NDArray, solver: Callable[..., NDArray]) -> NDArray:
        """States and work at instants (times, n)."""
        begin, y, rows = 0.0, np.array([*self.start, 0.0]), {}
        for end in sorted({*times, *self.jumps}):

            def rates(t: Any, y: NDArray, last: float = np.nextafter(end, begin)) -> NDArray:
                before = min(t, last)  # what moves after a jump is no concern of this side
                states, forces, _ = self.dynamics(before, y[:-1])
                speeds = (motion(before)[1] for motion in self.motions)
                return np.array([*states, sum(f * v for f, v in zip(forces, speeds, strict=True))])

            rows[end] = solver(rates, begin, end, y)
            begin, y = end, rows[end].copy()
            y[-1] += self.jumps.get(end, 0.0)
        return np.array([rows[t] for t in times])

    def reference(self, times: NDArray) -> tuple[Answer, Mapping[str, float]]:
        """The answer; what the other method and the energy say of it, relative to size."""
        rows, others = (self.solved(times, solver).astype(float) for solver in (extrapolated, dormand_prince))
        work = rows[:, -1]
        _, forces, energy = zip(*(self.dynamics(t, row[:-1]) for t, row in zip(times, rows, strict=True)), strict=True)
        gained = np.array(energy) - self.dynamics(0.0, self.start)[2]
        checks = {
            "Dormand and Prince": float(np.max(abs(rows - others) / np.maximum(abs(others), 1))),
            "energy account": float(max(abs(gained - work)) / max(1, *abs(work))),
        }
        return Answer(rows[:, : self.asked], np.array(forces)[:, 0], work), checks


def lagrange(
    name: str,
    stop: float,
    lagrangian: Any,
    start: Mapping[Any, tuple[float, float]],
    prescribed: Mapping[Any, Motion],
    *,
    jumps: Mapping[float, float] | None = None,
    **more: Any,
) -> Task:
    """Task whose reference solves Lagrange's equations: for accelerations, and for the forces of prescribed joints.

    :param start: free coordinate -> place and rate.
    :param prescribed: coordinate -> motion.
    :param more: other fields of the task.
    """
    every, n = [*start, *prescribed], len(start)

    @cache  # derived for those who ask
    def functions() -> Sequence[Callable[..., Any]]:
        left = LagrangesMethod(lagrangian, every).form_lagranges_equations()
        unknown = [q.diff(TIME, 2) for q in start]
        rest = left[:n, :].subs(dict.fromkeys(unknown, 0))
        accelerations = [*left[:n, :].jacobian(unknown).LUsolve(-rest)] if n else []
        energy = sum(q.diff(TIME) * lagrangian.diff(q.diff(TIME)) for q in every) - lagrangian
        known = [q.diff(TIME, k) for k in range(3) for q in prescribed]
        known += [q.diff(TIME, k) for k in range(2) for q in start]
        return [
            sympy.lambdify(arguments, values, [{"sin": sin, "cos": cos}, "math"], cse=True)
            for arguments, values in ((known, accelerations), ([*known, *unknown], [*left[n:, :], energy]))
        ]

    def dynamics(t: Any, y: Sequence[Any]) -> tuple[Sequence[Any], Sequence[Any], Any]:
        known = [*np.ravel([motion(t) for motion in prescribed.values()], "F"), *y]
        solve, apply = functions()
        accelerations = solve(*known)
        *forces, energy = apply(*known, *accelerations)
        return [*y[n:], *accelerations], forces, energy

    states = np.ravel([*start.values()], "F").tolist()
    equations = Equations(dynamics, [*prescribed.values()], states, n, jumps or {})
    motions, starts = ({str(q.func): value for q, value in found.items()} for found in (prescribed, start))
    fields = {"asked": [*starts], "start": starts, "reference": equations.reference, "functions": functions}
    return Task(name, stop, motions, jumps=tuple(equations.jumps), **(fields | more))


def pieces(
    first: Any, leaves: Callable[[float, Any], float], following: Callable[[float, Any], Any], stop: float
) -> list[Any]:
    """Of a motion: each begins at its first value, and lasts until ``leaves`` changes its sign."""
    found, step = [first], 1e-3
    while True:
        last = found[-1]
        grid = np.arange(last[0] + 1e-7, stop, step)
        end = next((t for t in grid if leaves(t, last) * leaves(t + step, last) <= 0), None)
        if end is None:
            return found
        found.append(following(float(brentq(leaves, end, end + step, (last,), xtol=1e-16, rtol=1e-15)), last))
