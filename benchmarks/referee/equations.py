"""References by integration: Lagrange's equations by SymPy, by Gauss's rule and by Dormand and Prince's."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import cache
from typing import Any

import numpy as np
import sympy
from numpy.polynomial import legendre
from numpy.typing import NDArray
from scipy.integrate import solve_ivp
from scipy.optimize import brentq
from sympy.physics.mechanics import LagrangesMethod

from referee.task import GRAVITY, Answer, Motion, Task

TIME = sympy.Symbol("t")  # of SymPy's mechanics
Rates = Callable[[Any, NDArray], NDArray]
STAGES, WEIGHTS = legendre.leggauss(9)
INVERSE = np.linalg.inv(legendre.legvander(STAGES, len(STAGES) - 1))
MATRIX = legendre.legval(STAGES, legendre.legint(INVERSE, lbnd=-1)).T
SWEEPS = 14  # to the last digit of extended precision


def dormand_prince(rates: Rates, begin: float, end: float, y: NDArray) -> NDArray:
    return solve_ivp(rates, (begin, end), y, "DOP853", rtol=3e-14, atol=1e-15, max_step=0.004).y[:, -1]


def gauss(rates: Rates, begin: float, end: float, y: NDArray) -> NDArray:
    """Steps of order 18, in extended precision."""
    count = math.ceil((end - begin) / 0.02)
    half = np.longdouble(end - begin) / count / 2
    for middle in begin + half * np.arange(1, 2 * count, 2):
        slopes = np.zeros((len(STAGES), len(y)), np.longdouble)
        for _ in range(SWEEPS):
            for k, stage in enumerate(STAGES):
                slopes[k] = rates(middle + half * stage, y + half * MATRIX[k] @ slopes)
        y = y + half * WEIGHTS @ slopes
    return y


def integrated(
    dynamics: Callable[[Any, NDArray], tuple[NDArray, Any, Any]],
    start: Sequence[float],
    asked: int,
    jumps: Mapping[float, float],
) -> Callable[[NDArray], tuple[Answer, Mapping[str, float]]]:
    """The reference by integration, from one jump to the next.

    :param dynamics: of instant and states, of which the last is the work: their rates, the force of the first
        prescribed joint, and the energy.
    :param start: of the states, of which the first ``asked`` are asked.
    :param jumps: instant -> what is added to the work there; nothing is asked at that instant.
    """
    first, work_only = np.array(start), np.eye(len(start))[-1]

    def states(times: NDArray, rule: Callable[..., NDArray]) -> NDArray:
        begin, y, rows = 0.0, first, {}
        for end in sorted({*times, *jumps}):
            last = np.nextafter(end, begin)  # what moves after a jump is no concern of this side
            rows[end] = rule(lambda t, y, last=last: dynamics(min(t, last), y)[0], begin, end, y)
            begin, y = end, rows[end] + jumps.get(end, 0.0) * work_only
        return np.array([rows[t] for t in times], dtype=float)

    def reference(times: NDArray) -> tuple[Answer, Mapping[str, float]]:
        rows, others = (states(times, rule) for rule in (gauss, dormand_prince))
        work = rows[:, -1]
        _, force, energy = (np.array(found) for found in zip(*map(dynamics, times, rows), strict=True))
        lost = energy - dynamics(0.0, first)[2] - work
        checks = {
            "Dormand and Prince": np.max(abs(rows - others) / np.maximum(abs(others), 1)),
            "energy account": max(abs(lost)) / max(1, *abs(work)),
        }
        return Answer(rows[:, :asked], force, work), checks

    return reference


def point(mass: float, x: Any, z: Any, gravity: float = GRAVITY) -> Any:
    """Lagrangian of a point at x and, upwards, z."""
    return mass * ((x.diff(TIME) ** 2 + z.diff(TIME) ** 2) / 2 - gravity * z)


def lagrange(
    name: str,
    stop: float,
    lagrangian: Any,
    start: Mapping[Any, tuple[float, float]],
    prescribed: Mapping[Any, Motion],
    *,
    closure: Sequence[Any] = (),
    jumps: Mapping[float, float] | None = None,
    **more: Any,
) -> Task:
    """Task whose reference integrates Lagrange's equations.

    :param start: free coordinate -> place and rate.
    :param prescribed: coordinate -> motion.
    :param closure: functions of the coordinates that stay 0, as they are at the start.
    :param more: other fields of the task.
    """
    every, n = [*start, *prescribed], len(start)

    @cache  # derived for those who ask
    def dynamics(modules: str = "numpy") -> Callable[..., Any]:
        """Function of σ, σ̇, σ̈, then of q and q̇: accelerations, forces of prescribed joints, energy."""
        method = LagrangesMethod(lagrangian, every, hol_coneqs=closure)
        left = sympy.Matrix(method.form_lagranges_equations())
        unknown = [*(q.diff(TIME, 2) for q in start), *method.lam_vec]
        system = sympy.Matrix([*left[:n], *(gap.diff(TIME, 2) for gap in closure)])
        solution = system.jacobian(unknown).LUsolve(-system.subs(dict.fromkeys(unknown, 0)))
        forces = left[n:, :].subs(dict(zip(unknown, solution, strict=True)))
        energy = sum(q.diff(TIME) * lagrangian.diff(q.diff(TIME)) for q in every) - lagrangian
        known = [q.diff(TIME, k) for k in range(3) for q in prescribed]
        known += [q.diff(TIME, k) for k in range(2) for q in start]
        return sympy.lambdify(known, [*solution[:n], *forces, energy], modules, cse=True)

    def found(t: Any, y: NDArray) -> tuple[NDArray, Any, Any]:
        moved = np.array([motion(t) for motion in prescribed.values()]).T
        *values, energy = dynamics()(*moved.ravel(), *y[:-1])
        return np.array([*y[n:-1], *values[:n], moved[1] @ values[n:]]), values[n], energy

    motions, starts = ({str(q.func): value for q, value in which.items()} for which in (prescribed, start))
    fields = {"asked": [*starts], "start": starts, "dynamics": dynamics} | more
    states = [*np.ravel([*start.values()], "F"), 0.0]
    reference = integrated(found, states, len(fields["asked"]), jumps or {})
    return Task(name, stop, motions, reference=reference, jumps=tuple(jumps or ()), **fields)


def pieces(
    piece: Any, leaves: Callable[[float, Any], float], following: Callable[[float, Any], Any], stop: float
) -> Iterator[Any]:
    """Of a motion: each begins at its first value, and lasts until ``leaves`` changes its sign."""
    yield piece
    step = 1e-3
    for t in np.arange(piece[0] + 1e-7, stop, step):
        if leaves(t, piece) * leaves(t + step, piece) <= 0:
            end = brentq(leaves, t, t + step, (piece,), xtol=1e-16, rtol=1e-15)
            yield from pieces(following(end, piece), leaves, following, stop)
            return
