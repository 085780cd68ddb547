"""What makes a plan believed: IPOPT's word alone is never enough."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from liaisons.check import Verdict, verdict
from liaisons.operators.problems import Problem, Rows
from liaisons.operators.transcription import Array, Clock, Solution, curvature, interval_count, solve
from liaisons.results import Result

NOTHING = 1e-10
"""What IPOPT leaves of multipliers; nothing that is smaller can be told from 0."""
_RELATIVE = 1e-6
_FLAT = 1e-7
"""Eigenvalues of the reduced Hessian, relative to the largest, that are as good as 0."""
_SHIFT = 1e-4
"""By how much the end is moved to see what that costs."""


def verdicts(problem: Problem, solution: Solution, replay: Result, clock: Clock) -> list[Verdict]:
    """All of them.

    :param problem: a relative one.
    :param solution: its solution.
    :param replay: the motion as the FMUs perform it, in SI units.
    :param clock: how long further solutions may take; a claim for which no time is left fails.
    """
    text = f"the search came to its end: best of {_counted(solution.starts, 'start', 'starts')}"
    text += f", with {_counted(solution.optima, 'optimum', 'optima')}"
    ended = verdict(text, error=0.0 if solution.finished else 1.0, tolerance=0.0)
    claims = [ended, *_replayed(problem, replay), *_law(problem, solution), _curved(problem, solution, clock)]
    return [*claims, *_meshes(problem, solution, clock)]


def _counted(count: int, one: str, more: str) -> str:
    return f"{count} {one if count == 1 else more}"


def _curved(problem: Problem, solution: Solution, clock: Clock) -> Verdict:
    """The second-order condition, on the mesh of the solution."""
    hessian = None if clock.is_over else curvature(problem, solution, clock)
    why = f"of the largest; what is less than {_FLAT:g} cannot be told from 0"
    text = "a local minimum: the reduced Hessian is positive definite"
    if hessian is None:
        return verdict(text, error=np.nan, tolerance=_FLAT, reason=why)
    if hessian.freedom == 0:
        return verdict("a local minimum: constraints leave nothing free", error=0.0, tolerance=0.0)
    least = hessian.least / max(hessian.largest, np.finfo(float).tiny)
    if least < _FLAT:
        text = "second-order condition: no direction has negative curvature (some have none)"
    return verdict(text, error=max(0.0, -least), tolerance=_FLAT, reason=why)


def _replayed(problem: Problem, replay: Result) -> list[Verdict]:
    scales = problem.scales
    X = np.array([replay[name] for name in problem.states]) / scales.states[:, None]
    U = np.array([replay[name] for name in problem.controls]) / scales.controls[:, None]
    claims = [
        verdict(
            "replayed through the FMUs, the end is reached",
            error=_violation(problem.end, np.array(problem.end.function(X[:, -1]))),
            tolerance=1e-8,
            reason="solver tolerance 1e-12; what is left is the mesh's",
        )
    ]
    if problem.closed:
        closed = list(problem.closed)
        gap = float(np.max(np.abs(X[closed, -1] - X[closed, 0])))
        claims.append(verdict("what has to close is closed", error=gap, tolerance=1e-8, reason="as the end"))
    energies = np.concatenate([replay[name] for name in ("kinetic_energy", "potential_energy", "work")])
    scale = max(1e-12 * scales.energy, float(np.ptp(energies)))
    balance = float(np.max(np.abs(replay["energy_balance"]))) / scale
    claims.append(verdict("the energy gained is the operators' work", error=balance, tolerance=1e-7, reason="relative"))
    if problem.path.labels:
        path = np.array(problem.path.function.map(X.shape[1])(X, U))
        error = _violation(problem.path, path)
        claims.append(verdict("bounds are kept between the nodes", error=error, tolerance=1e-6, reason="relative"))
    return claims


def _law(problem: Problem, solution: Solution) -> list[Verdict]:
    """Along an extremal the Hamiltonian is constant; it is 0 where the duration is free."""
    trajectory = solution.trajectory
    running = trajectory.evaluate(problem.cost).ravel()
    H = solution.hamiltonian / hamiltonian_scale(problem, solution)
    why = f"relative to its terms, or {NOTHING:g}; an extremal that the mesh resolves keeps it to 1e-8"
    claims = [verdict("the Hamiltonian is constant", error=float(np.ptp(H)), tolerance=1e-6, reason=why)]
    low, high = problem.duration
    if low < trajectory.durations.sum() * (1 - 1e-9) and trajectory.durations.sum() < high * (1 - 1e-9):
        claims.append(
            verdict("it is 0, for the duration is free", error=abs(float(np.mean(H))), tolerance=1e-6, reason=why)
        )
    still = replace(trajectory, controls=np.zeros_like(trajectory.controls)).evaluate(problem.rates)
    inside = not problem.path.labels or _room(problem.path, solution.path) > 0
    if problem.order == 1 and np.max(np.abs(still), initial=0.0) < 1e-12 and inside and np.all(running > 0):
        speed = np.sqrt(running)
        error = float(np.ptp(speed) / np.mean(speed))
        claims.append(verdict("the Θ-speed is constant: a geodesic", error=error, tolerance=1e-6, reason="relative"))
    return claims


def hamiltonian_scale(problem: Problem, solution: Solution) -> float:
    """Size of the terms that the Hamiltonian is made of."""
    running = solution.trajectory.evaluate(problem.cost).ravel()
    rates = solution.trajectory.evaluate(problem.rates)
    return max(NOTHING / _RELATIVE, float(np.mean(np.abs(running) + np.abs(solution.adjoints * rates).sum(axis=0))))


def _meshes(problem: Problem, solution: Solution, clock: Clock) -> list[Verdict]:
    """A mesh half as fine again, and the price of another end."""
    trajectory = solution.trajectory
    finer = tuple(replace(arc, intervals=max(arc.intervals + 2, 3 * arc.intervals // 2)) for arc in trajectory.arcs)
    second = solve(problem, trajectory.on(finer, trajectory.durations), clock, near=True)
    scale = max(NOTHING / _RELATIVE, abs(solution.cost))
    error = abs(second.cost - solution.cost) / scale if second.succeeded else np.nan
    text = f"a mesh of {interval_count(finer)} intervals costs the same as one of {interval_count(trajectory.arcs)}"
    claims = [verdict(text, error=error, tolerance=1e-6, reason="relative")]
    gradient = solution.end_multipliers
    size = float(np.linalg.norm(gradient))
    if size > 0:
        # J'' δ² is far below the tolerance, and so is what IPOPT leaves, over δ.
        by = _SHIFT * min(1.0, scale / size)

        def cost(parts: int) -> float:
            shifted = solve(problem, trajectory, clock, near=True, shift=parts * by * gradient / size)
            return shifted.cost if shifted.succeeded else np.nan

        sides = {side: cost(side) for side in (1, -1)}
        slope = (sides[1] - sides[-1]) / (2 * by)
        if not np.isfinite(slope):  # beyond one side of the end no solution is near: also of second order in δ
            side = 1 if np.isfinite(sides[1]) else -1
            slope = side * (4 * sides[side] - cost(2 * side) - 3 * solution.cost) / (2 * by)
        text = "another end costs what the multipliers say, dJ/d(end)"
        claims.append(
            verdict(text, error=abs(slope - size) / max(size, 1e-3 * scale), tolerance=1e-4, reason="relative")
        )
    return claims


def _violation(rows: Rows, values: Array) -> float:
    """By how much values leave their ranges, relative to these where they are large."""
    ends = np.where(np.isfinite([rows.low, rows.high]), np.abs([rows.low, rows.high]), 0).max(axis=0)
    return float(np.max(rows.violation(values) / np.maximum(1.0, ends)[:, None], initial=0.0))


def _room(rows: Rows, values: Array) -> float:
    """How far the values stay off their bounds."""
    return float(np.min(np.minimum(values - rows.low[:, None], rows.high[:, None] - values))) - 1e-6
