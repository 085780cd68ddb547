"""Verdicts on a plan, independent of what IPOPT reports."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field, replace
from functools import cache, partial

import numpy as np

from liaisons import Result, Verdict, verdict
from liaisons.base.arrays import Floats
from liaisons_motion.planning.problems import Rows
from liaisons_motion.planning.transcription import (
    Clock,
    Solution,
    interval_count,
    phase_points,
    reduced_hessian_eigenvalues,
    solve,
)

MULTIPLIER_ERROR = 1e-10
"""Error of IPOPT's multipliers; smaller numbers count as 0."""
HAMILTONIAN_VARIATION = 1e-6
"""Variation of the Hamiltonian, relative to its terms, that the verdict allows: a resolved extremal has 1e-8."""
_ZERO_CURVATURE = 1e-7
"""Eigenvalues of the reduced Hessian below this, relative to the largest, count as 0."""
_SLOPE_TOLERANCE = 1e-4
"""Tolerance of the slope of the cost, relative to the multipliers."""
_DIRECTION_ITERATIONS = 3
"""Iterations that turn the displacement of the end until the multipliers are constant."""
MODE_DISTANCES = (1e-6, 3e-5, 1e-3)
"""Distances of communication points from the ends of phases, relative to the duration."""
_END_SHIFT = 1e-4
"""Displacement of the end, in units of sizes, whose cost is compared with the multipliers."""


def verdicts(solution: Solution, replay: Result, clock: Clock) -> list[Verdict]:
    """All verdicts on the solution of a plan.

    :param solution: in relative units.
    :param replay: the motion as the FMUs perform it, in SI units.
    :param clock: time limit of further solutions; a claim for which no time is left fails.
    """
    text = (
        f"the search came to its end: best of {solution.starts} {'start' if solution.starts == 1 else 'starts'}, "
        f"with {solution.optima} {'optimum' if solution.optima == 1 else 'optima'}"
    )
    finer = cache(partial(_on_finer_mesh, solution, clock))
    claims = [
        verdict(text, error=0.0 if solution.finished else 1.0, tolerance=0.0),
        *_replay_verdicts(solution, replay),
        *_hamiltonian_verdicts(solution),
        _second_order_verdict((lambda: solution, finer), clock),
    ]
    return [*claims, *_cost_verdicts(solution, finer, clock)]


def _on_finer_mesh(solution: Solution, clock: Clock) -> Solution:
    """The solution on a mesh with one and a half times as many intervals."""
    trajectory = solution.trajectory
    arcs = (replace(arc, intervals=max(arc.intervals + 2, 3 * arc.intervals // 2)) for arc in trajectory.arcs)
    return solve(solution.problem, trajectory.interpolated(tuple(arcs), trajectory.durations), clock, is_near=True)


def _second_order_verdict(meshes: Iterable[Callable[[], Solution]], clock: Clock) -> Verdict:
    """Verdict on the second-order condition, on the first of the meshes that satisfies it, else the last.

    A coarse mesh may add directions of negative curvature.
    """
    eigenvalues = None
    for solution in meshes:
        eigenvalues = None if clock.is_over else reduced_hessian_eigenvalues(solution(), clock)
        if eigenvalues is None or not eigenvalues.size or eigenvalues[0] >= -_ZERO_CURVATURE:
            break
    why = f"of the largest; what is less than {_ZERO_CURVATURE:g} cannot be told from 0"
    text = "a local minimum: the reduced Hessian is positive definite"
    if eigenvalues is None:
        return verdict(text, error=np.nan, tolerance=_ZERO_CURVATURE, reason=why)
    if not eigenvalues.size:
        return verdict("a local minimum: constraints leave nothing free", error=0.0, tolerance=0.0)
    least = float(eigenvalues[0])
    if least < _ZERO_CURVATURE:
        text = "second-order condition: no direction has negative curvature (some have none)"
    return verdict(text, error=max(0.0, -least), tolerance=_ZERO_CURVATURE, reason=why)


def _replay_verdicts(solution: Solution, replay: Result) -> Iterator[Verdict]:
    """Verdicts on the run of the FMUs: end, closed states, energy, bounds, and modes of contacts."""
    problem, scales = solution.problem, solution.problem.scales
    times = np.asarray(replay.time) / scales.time
    X = np.array([replay[name] for name in problem.states]) / scales.states[:, None]
    U = np.array([replay[name] for name in problem.controls]) / scales.controls[:, None]
    yield verdict(
        "replayed through the FMUs, the end is reached",
        error=_relative_violation(problem.end, np.array(problem.end.function(X[:, -1]))),
        tolerance=1e-8,
        reason="solver tolerance 1e-12; what is left is the mesh's",
    )
    if problem.closed:
        closed = list(problem.closed)
        gap = float(np.max(np.abs(X[closed, -1] - X[closed, 0])))
        yield verdict("what has to close is closed", error=gap, tolerance=1e-8, reason="as the end")
    energies = np.concatenate([replay[name] for name in ("kinetic_energy", "potential_energy", "work")])
    scale = max(1e-12 * scales.energy, float(np.ptp(energies)))
    balance = float(np.max(np.abs(replay["energy_balance"]))) / scale
    yield verdict("the energy gained is the operators' work", error=balance, tolerance=1e-7, reason="relative")
    ends = np.append(0.0, np.cumsum(solution.trajectory.durations))
    distances = np.abs(times[:, None] - ends[1:]).min(axis=1, initial=np.inf) / ends[-1]  # from phases' ends
    errors, late = [], 0.0
    for k, phase in enumerate(problem.phases or [problem]):
        is_inside = (ends[k] <= times) & (times <= ends[k + 1]) if problem.phases else np.full(times.size, True)
        for name, mode in phase.modes.items():
            late = max(late, distances[is_inside & (replay[name] != mode)].max(initial=0.0))
        is_inside &= distances > MODE_DISTANCES[0] / 4
        if phase.path.labels:
            values = phase.path.function.map(int(is_inside.sum()))(X[:, is_inside], U[:, is_inside])
            errors.append(_relative_violation(phase.path, np.array(values)))
    if errors:
        yield verdict("bounds are kept between the nodes", error=max(errors), tolerance=1e-6, reason="relative")
    if problem.phases:
        why = f"of the duration; looked at to {MODE_DISTANCES[0]:g} of it"
        yield verdict(
            "contacts change modes at the planned instants", error=late, tolerance=MODE_DISTANCES[0] / 2, reason=why
        )


def _hamiltonian_verdicts(solution: Solution) -> Iterator[Verdict]:
    """Verdicts: the Hamiltonian is constant, and 0 if the duration is free; a free motion is a geodesic."""
    problem, trajectory, path = solution.problem, solution.trajectory, solution.problem.path
    scale = hamiltonian_scale(solution)
    why = f"relative to its terms, or {MULTIPLIER_ERROR:g}; an extremal that the mesh resolves keeps it to 1e-8"
    yield verdict(
        "the Hamiltonian is constant",
        error=largest_hamiltonian_range(solution) / scale,
        tolerance=HAMILTONIAN_VARIATION,
        reason=why,
    )
    if _is_within(problem.duration, trajectory.durations.sum()):
        error = abs(float(np.mean(hamiltonians(solution)[0]))) / scale
        yield verdict("it is 0, for the duration is free", error=error, tolerance=HAMILTONIAN_VARIATION, reason=why)
    if problem.control_order != 1:
        return
    running = trajectory.evaluate(problem.cost).ravel()
    still = replace(trajectory, controls=np.zeros_like(trajectory.controls)).evaluate(problem.rates)
    values = trajectory.evaluate(path.function)
    room = np.minimum(values - path.low[:, None], path.high[:, None] - values)
    is_free = np.all(np.abs(still) < 1e-12) and np.all(room > 1e-6)
    if is_free and np.all(running > 0):
        speed = np.sqrt(running)
        error = float(np.ptp(speed) / np.mean(speed))
        yield verdict("the Θ-speed is constant: a geodesic", error=error, tolerance=1e-6, reason="relative")


def _is_within(duration: tuple[float, float], T: float) -> bool:
    """Whether T lies inside of the range of a duration, and not at an end."""
    low, high = duration
    return low < T * (1 - 1e-9) and high * (1 - 1e-9) > T


def hamiltonians(solution: Solution) -> list[Floats]:
    """Values of the Hamiltonian on each part of the motion along which it is constant.

    Phases of free duration are one part together, others one each.
    """
    problem, H = solution.problem, solution.hamiltonian
    points = phase_points(problem, solution.trajectory.arcs)
    durations = solution.trajectory.durations if problem.phases else [0.0]
    fixed = [
        inside
        for (phase, inside), T in zip(points, durations, strict=True)
        if problem.phases and not _is_within(phase.duration, T)
    ]
    free = np.delete(H, np.r_[*fixed]) if fixed else H
    return [part for part in (free, *(H[inside] for inside in fixed)) if part.size]


def largest_hamiltonian_range(solution: Solution) -> float:
    """Largest difference of values of the Hamiltonian within any one part, along which it is constant."""
    return float(max(map(np.ptp, hamiltonians(solution))))


def hamiltonian_scale(solution: Solution) -> float:
    """Mean sum of the absolute terms of the Hamiltonian."""
    running, rates = solution.trajectory.cost_and_rates(solution.problem)
    return max(
        MULTIPLIER_ERROR / HAMILTONIAN_VARIATION,
        float(np.mean(np.abs(running) + np.abs(solution.adjoints * rates).sum(axis=0))),
    )


def _cost_verdicts(solution: Solution, finer: Callable[[], Solution], clock: Clock) -> Iterator[Verdict]:
    """Verdicts on the costs on a finer mesh, and for displaced ends."""
    second = finer()
    scale = max(MULTIPLIER_ERROR / HAMILTONIAN_VARIATION, abs(solution.cost))
    error = abs(second.cost - solution.cost) / scale if second.succeeded else np.nan
    fine, coarse = (interval_count(each.trajectory.arcs) for each in (second, solution))
    text = f"a mesh of {fine} intervals costs the same as one of {coarse}"
    yield verdict(text, error=error, tolerance=1e-6, reason="relative")
    yield from _end_verdicts(solution, scale, clock)


@dataclass(frozen=True, eq=False)
class _DisplacedEnds:
    """Solutions whose end is displaced along a direction, by whole parts of a distance.

    :param costs: of those that have been solved, by the number of parts; not-a-number where there is none.
    """

    solution: Solution
    clock: Clock
    distance: float
    direction: Floats
    costs: dict[int, float] = field(default_factory=dict, init=False)

    def solve(self, parts: int) -> Solution:
        """The solution with the end displaced by so many parts."""
        shift = parts * self.distance * self.direction / np.linalg.norm(self.direction)
        return solve(self.solution.problem, self.solution.trajectory, self.clock, is_near=True, shift=shift)

    def cost(self, parts: int) -> float:
        """Cost for the displaced end; not-a-number if it is not solved."""
        if parts not in self.costs:
            shifted = self.solve(parts)
            self.costs[parts] = shifted.cost if shifted.succeeded else np.nan
        return self.costs[parts]

    @property
    def slope(self) -> float:
        """Slope of the cost from two ends, displaced to both sides."""
        return (self.cost(1) - self.cost(-1)) / (2 * self.distance)

    def one_sided_slope(self, parts: int) -> float:
        """Slope of the cost from the end and two ends displaced to one side, by a parabola."""
        far = 4 * self.cost(parts) - self.cost(2 * parts) - 3 * self.solution.cost
        return far / (2 * self.distance * parts)


def _end_verdicts(solution: Solution, scale: float, clock: Clock) -> Iterator[Verdict]:
    """Verdict on the multipliers of the end: slopes of the cost for displaced ends; none where they vanish.

    :param scale: of the cost.
    """
    gradient = solution.end_multipliers
    size = float(np.linalg.norm(gradient))
    if not size > 0:
        return
    # J'' δ² is far below the tolerance, and so is what IPOPT leaves, over δ.
    ends = _DisplacedEnds(solution, clock, _END_SHIFT * min(1.0, scale / size), gradient)
    least = max(size, 1e-3 * scale)
    kink = ", on one side: the cost of the end has a kink"
    text, slope = "another end costs what the multipliers say, dJ/d(end)", ends.slope
    if not abs(slope - size) <= _SLOPE_TOLERANCE * least:  # beyond one side no solution is near, or the slope jumps
        slopes = np.array([ends.one_sided_slope(parts) for parts in (1, -1, 2, -2)])
        off = np.abs(slopes - size)
        if np.isfinite(off).any():
            slope = slopes[np.nanargmin(off)]
        sides = [np.nanmax(off[i::2], initial=-np.inf) for i in (0, 1)]
        if np.isfinite(sides).all() and max(sides) > _SLOPE_TOLERANCE * least:
            text += kink
    error = abs(slope - size)
    if error > _SLOPE_TOLERANCE * least:
        # Of many optima the cheapest one for this end is another, with multipliers of its own.
        for _ in range(_DIRECTION_ITERATIONS):
            ends = replace(ends, direction=ends.direction + gradient - ends.solve(-1).end_multipliers)
        direction = ends.direction
        error = abs(ends.one_sided_slope(-1) - float(gradient @ direction) / float(np.linalg.norm(direction)))
        text = text.removesuffix(kink) + kink
    yield verdict(text, error=error / least, tolerance=_SLOPE_TOLERANCE, reason="relative")


def _relative_violation(rows: Rows, values: Floats) -> float:
    """Greatest distance of values from the ranges of their rows, relative to bounds above 1."""
    ends = np.where(np.isfinite([rows.low, rows.high]), np.abs([rows.low, rows.high]), 0).max(axis=0)
    return float(np.max(rows.violation(values) / np.maximum(1.0, ends)[:, None], initial=0.0))
