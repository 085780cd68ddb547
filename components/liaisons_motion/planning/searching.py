"""The search of a plan: solutions from several starts on a coarse mesh, the best of them refined, with switching arcs.

If IPOPT does not reach the end from a start, it is first led to the nearest end that it can reach: in the duration of
the start, then in any duration.  A solution is accepted if integration of the equations under its controls, from knot
to knot, agrees with its knots: implicit schemes have solutions that the differential equations do not have.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import chain, groupby, islice, pairwise
from typing import final

import casadi as ca
import numpy as np

from liaisons.base.arrays import Floats
from liaisons.errors import PlanError
from liaisons.expressions import is_smooth_function
from liaisons_motion.goals import runge_kutta
from liaisons_motion.planning.problems import Problem
from liaisons_motion.planning.transcription import (
    DEGREE,
    TO_POWERS,
    Arc,
    Clock,
    CollocatedTrajectory,
    Solution,
    interval_count,
    path_rates,
    phase_points,
    solve,
)
from liaisons_motion.planning.verifying import (
    HAMILTONIAN_VARIATION,
    MULTIPLIER_ERROR,
    hamiltonian_scale,
    largest_hamiltonian_range,
)


@final
@dataclass(frozen=True)
class SearchConstants:
    """Constants of the search; costs and deviations are relative to their sizes.

    With them every plan of ``benchmarks/plans.py`` has the least cost of its closed form to 1e-9, in 4 s at most.
    """

    coarse_intervals: int = 10
    """Intervals of the mesh on which starts are tried: of order 10 it resolves smooth motions, and blurs switches."""
    most_starts: int = 8
    """Largest number of starts, unless ``tries`` is given."""
    agreeing_starts: int = 2
    """Number of starts with one optimum that end the search; one more if the duration is free, two if σ is closed, for
    there optima compete."""
    similar_cost: float = 1e-3
    """Costs on coarse meshes that differ by less may belong to one optimum: blurred switches change them."""
    higher_cost: float = 5e-2
    """Solutions whose cost on a coarse mesh is higher by more are not refined: fifty times what blurs can change."""
    same_cost: float = 1e-6
    """Costs on one mesh that differ by less belong to one optimum: IPOPT ends at 1e-10."""
    refinement_change: float = 4.0
    """Largest change of a cost by refinement, in units of the change of the best one's cost."""
    least_refinement_change: float = 1e-4
    """The same in units of the cost, if that is more."""
    at_bound: float = 1e-4
    """Distance from a bound, relative to the range, below which a row is active: IPOPT's barrier leaves less."""
    most_intervals: int = 100
    """Largest number of intervals of a refined mesh, ten times the coarse one: at order 10 1e-10 of its error."""
    most_intervals_of_arcs: int = 300
    """The same of several arcs, of which those are refined along which the Hamiltonian varies."""
    vain_refinements: int = 2
    """Refinements of several arcs after which the Hamiltonian varies more than before: multipliers are noise there."""
    extremal_variation: float = 1e-3
    """Variation of the Hamiltonian on the finest mesh above which a solution ranks behind the extremals."""
    singular_mass: float = 1e-3
    """An effective mass below this part of the greatest vanishes at a point nearby, which no mesh resolves."""
    feasible_residual: float = 1e-6
    """Residual of the equations, and miss of the end, below which an unfinished iterate is a motion."""
    reached_miss: float = 1e-6
    """Miss of the end, in units of sizes, below which IPOPT can reach it from the nearest end."""
    blurred_miss: float = 3e-2
    """Miss of the end, in units of sizes, that a coarse mesh may cause by a switch: a third of an interval."""
    integration_difference: float = 1e-5
    """Difference between knots and integrated states on a mesh that resolves the motion: the root of 1e-10 of IPOPT."""
    kink_integration_difference: float = 1e-4
    """The same where rates have kinks: in the interval of a kink mesh and integration both are of low order."""
    rough_integration_difference: float = 0.1
    """The same on coarse meshes; a solution that the differential equations do not have differs by its own size."""
    corrections: int = 6
    """Largest number of insertions and removals of arcs: each takes as long as a start."""


SEARCH = SearchConstants()
"""Constants of every search."""


@dataclass(frozen=True)
class SearchSettings:
    """Arguments of a search.

    :ivar intervals: of the first mesh of a refinement.
    :ivar accuracy: of the Hamiltonian, at which the refinement ends; None: it ends with the first mesh.
    :ivar tries: number of starts; None: until some agree.
    """

    intervals: int
    accuracy: float | None
    tries: int | None


def search(
    problem: Problem,
    starts: Iterable[CollocatedTrajectory],
    clock: Clock,
    settings: SearchSettings,
    further: Iterable[CollocatedTrajectory] = (),
) -> Solution:
    """The best solution of a problem, from as many starts as agree or as the time allows.

    Every candidate that may be the best is refined, so that more starts give nothing worse.

    :param problem: in relative units.
    :param starts: on coarse meshes; ``further`` ones where none of them leads to the end, unless ``tries`` is given.
    :raises PlanError: if no start leads to the end.
    :raises KeyboardInterrupt: at an interrupt before the first solution.
    """
    rough: list[Solution] = []  # on coarse meshes, in the order of the starts
    optima: list[float] = []  # their costs, one for each optimum
    failures: list[Solution] = []
    best: Solution | None = None
    count, stopped = 0, False
    low, high = problem.duration
    enough = SEARCH.agreeing_starts + (2 if problem.is_loop else int(low < high))
    left = (start for start in further if settings.tries is None and not rough and best is None)
    for trajectory in chain(islice(starts, settings.tries or SEARCH.most_starts), left):
        candidate = _solve_start(problem, trajectory, settings.intervals, clock)
        if candidate.succeeded:
            rough += [] if any(_is_same_optimum(candidate, one) for one in rough) else [candidate]
            if all(_difference(candidate.cost, cost) > SEARCH.similar_cost for cost in optima):
                optima.append(candidate.cost)
        elif candidate.finished:
            failures.append(candidate)
        elif not rough and max(candidate.residual, end_miss(candidate)) < SEARCH.feasible_residual:
            best = candidate if _is_accepted(candidate, settings) else best
        count += candidate.finished
        agreed, stopped = len(optima) == 1 and not failures, not candidate.finished
        if clock.is_over or stopped or (settings.tries is None and count == enough and agreed):
            break
    refined, rejected = _refine_all(rough, settings, clock, stopped=stopped)
    best = refined or best
    if best is not None:
        return replace(best, finished=not (stopped or clock.is_over), starts=max(1, count), optima=max(1, len(optima)))
    if clock.is_interrupted:
        raise KeyboardInterrupt
    for solution in rejected:
        refuse_singularity(solution)
    raise PlanError(_failure_text(problem, failures, rejected))


def _refine_all(
    rough: list[Solution], settings: SearchSettings, clock: Clock, *, stopped: bool
) -> tuple[Solution | None, list[Solution]]:
    """The best refined solution, None if there is none, and those that were not accepted.

    Whether one is refined depends on earlier starts alone, so that more starts only add candidates.  When the time is
    over, the unrefined ones compete, too.
    """
    best: Solution | None = None
    on_first_meshes: list[Solution] = []
    margin = 0.0  # above the best cost, within which the first mesh of a better motion may lie
    rejected: list[Solution] = []
    for k, one in enumerate(rough):
        if clock.is_over or stopped:
            rest = [*([best] if best else []), *(replace(other, finished=False) for other in rough[k:])]
            accepted = (other for other in rest if _is_accepted(other, settings))
            return min(accepted, key=_sort_key, default=None), rejected
        if best is not None and one.cost > best.cost + SEARCH.higher_cost * abs(best.cost):
            continue
        first = _on_first_mesh(one, settings, clock)
        if any(_is_same_optimum(first, other) for other in on_first_meshes) or (
            best and first.cost > best.cost + margin
        ):
            continue
        on_first_meshes.append(first)
        candidate = _refine(first, settings.accuracy, clock) if first.finished else first
        if not _is_accepted(candidate, settings):
            rejected.append(candidate)
        elif best is None or _sort_key(candidate) < _sort_key(best):
            best = candidate
            margin = max(
                SEARCH.refinement_change * abs(best.cost - first.cost), SEARCH.least_refinement_change * abs(best.cost)
            )
    return best, rejected


def _difference(cost: float, other: float) -> float:
    """Relative difference of two costs."""
    return abs(cost - other) / max(abs(cost), abs(other), MULTIPLIER_ERROR)


def _is_same_optimum(one: Solution, other: Solution) -> bool:
    """Whether two solutions, on meshes of the same size, belong to one optimum: arcs and costs agree."""
    return (
        len(one.trajectory.arcs) == len(other.trajectory.arcs) and _difference(one.cost, other.cost) <= SEARCH.same_cost
    )


def _sort_key(solution: Solution) -> tuple[bool, float]:
    """Key that sorts extremals before other solutions, and each by cost.

    Coarse meshes undercut what is possible.
    """
    variation = largest_hamiltonian_range(solution)
    return bool(variation > SEARCH.extremal_variation * hamiltonian_scale(solution)), solution.cost


def _is_accepted(solution: Solution, settings: SearchSettings) -> bool:
    """Whether integration of the equations confirms a solution; true for searches without refinement."""
    tolerance = SEARCH.integration_difference if solution.finished else SEARCH.rough_integration_difference
    return settings.accuracy is None or _satisfies_equations(solution, tolerance)


def _solve_start(problem: Problem, trajectory: CollocatedTrajectory, intervals: int, clock: Clock) -> Solution:
    """The solution from a start, if need be on a finer mesh; without one, the iterate nearest to the end."""
    candidate = _solve_directly_or_by_nearest_end(problem, trajectory, clock)
    coarse = interval_count(trajectory.arcs)
    if candidate.ends_search or coarse >= intervals or end_miss(candidate) > SEARCH.blurred_miss:
        return candidate
    return _solve_directly_or_by_nearest_end(
        problem, trajectory.interpolated((Arc(intervals),), trajectory.durations), clock
    )


def _solve_directly_or_by_nearest_end(problem: Problem, trajectory: CollocatedTrajectory, clock: Clock) -> Solution:
    """Solution from an initial trajectory: directly, else by way of the nearest end that IPOPT reaches."""
    candidate = solve(problem, trajectory, clock)
    if candidate.ends_search:
        return candidate
    low, high = problem.duration
    T = float(trajectory.durations.sum())
    rules = [problem] if low == high else [replace(problem, duration=(T, T)), problem]
    nearest = candidate
    for rule in rules:
        nearest = solve(rule, trajectory, clock, to_nearest_end=True)
        trajectory = nearest.trajectory
        if not nearest.finished:
            return nearest
    if end_miss(nearest) < SEARCH.reached_miss:
        candidate = solve(problem, trajectory, clock)
        if candidate.ends_search:
            return candidate
    if problem.phases:
        return replace(nearest, status=candidate.status)
    arcs, durations = _arcs(_active_bounds(nearest), nearest.trajectory)
    if low < high and len(arcs) > 1 and end_miss(nearest) < SEARCH.blurred_miss:
        candidate = solve(problem, trajectory.interpolated(arcs, durations), clock)
        if candidate.ends_search:
            return candidate
    return replace(nearest, status=candidate.status)


def end_miss(solution: Solution) -> float:
    """Norm of the violation of the end, in units of sizes."""
    problem = solution.problem
    return float(np.linalg.norm(problem.end.violation(problem.end_values(solution.trajectory.knots[:, -1]))))


def _on_first_mesh(rough: Solution, settings: SearchSettings, clock: Clock) -> Solution:
    """The solution on the first mesh of the settings; the coarse one if IPOPT has none there."""
    problem, trajectory = rough.problem, rough.trajectory
    if len(trajectory.arcs) == 1 and trajectory.arcs[0].intervals < settings.intervals:
        finer = trajectory.interpolated((Arc(settings.intervals),), trajectory.durations)
        for near in (True, False):
            candidate = solve(problem, finer, clock, is_near=near)
            if not candidate.finished:
                return replace(rough, finished=False)
            if candidate.succeeded:
                return candidate
    return rough


# ---- switching instants -------------------------------------------------------------------------------------------


def _refine(solution: Solution, accuracy: float | None, clock: Clock) -> Solution:
    """The solution with switching arcs, on finer and finer meshes until its Hamiltonian is constant."""
    problem = solution.problem
    if not problem.phases:
        solution = _insert_arcs(solution, clock)
    best, vain = solution, 0
    while accuracy is not None and solution.finished:
        trajectory = solution.trajectory
        tolerance = max(accuracy * hamiltonian_scale(solution), MULTIPLIER_ERROR)
        variation = largest_hamiltonian_range(solution)
        if variation <= tolerance and _satisfies_equations(solution):
            return solution
        arcs = _finer_arcs(solution, tolerance)
        is_one_mesh = len(arcs) == 1 or problem.phases
        is_new = is_one_mesh or len(best.trajectory.arcs) < len(arcs)
        is_better = is_new or variation <= largest_hamiltonian_range(best)
        best, vain = (solution, 0) if is_better else (best, vain + 1)
        most = SEARCH.most_intervals if is_one_mesh else SEARCH.most_intervals_of_arcs
        if interval_count(arcs) > most or vain == SEARCH.vain_refinements:
            break
        finer = solve(problem, trajectory.interpolated(arcs, trajectory.durations), clock, is_near=True)
        if not finer.succeeded:
            return replace(best, finished=finer.finished)
        if problem.phases and largest_hamiltonian_range(finer) > variation:
            break  # the barrier of gaps that close prevails
        solution = finer if len(arcs) > 1 else _insert_arcs(finer, clock)
    return best if solution.finished else solution


def _finer_arcs(solution: Solution, tolerance: float) -> tuple[Arc, ...]:
    """Arcs with twice as many intervals where the Hamiltonian varies by more than the tolerance; all if nowhere."""
    arcs = solution.trajectory.arcs
    cuts = np.cumsum([arc.intervals * DEGREE for arc in arcs])[:-1]
    varies = [float(np.ptp(part)) > tolerance for part in np.split(solution.hamiltonian, cuts)]
    is_finer = varies if any(varies) and not solution.problem.phases else [True] * len(arcs)
    return tuple(
        replace(arc, intervals=arc.intervals * (1 + refined)) for arc, refined in zip(arcs, is_finer, strict=True)
    )


def _insert_arcs(solution: Solution, clock: Clock) -> Solution:
    """The solution with an arc between any two switches of its controls, whose durations are unknowns.

    Vanishing arcs are removed, and arcs are inserted where the Hamiltonian is less at another bound.  If no such
    solution is better, the given one is returned.
    """
    best, problem, trajectory = solution, solution.problem, solution.trajectory
    patterns = (_optimal_bounds if len(trajectory.arcs) > 1 else _active_bounds)(solution)
    if patterns is None:
        return solution
    arcs, durations = _arcs(patterns, trajectory)
    for _ in range(SEARCH.corrections):
        if _has_no_choice(problem, arcs) or not _has_continuous_bounds(problem, arcs):
            break
        candidate = solve(problem, trajectory.interpolated(arcs, durations), clock, is_near=True)
        if not candidate.finished:
            return replace(best, finished=False)
        trajectory, lengths = candidate.trajectory, candidate.trajectory.durations
        lasts = lengths >= 1e-5 * lengths.sum()
        if lasts.any() and not lasts.all():
            arcs, durations = _join_arcs(
                [(a, T) for a, T, is_kept in zip(arcs, lengths, lasts, strict=True) if is_kept]
            )
            continue
        if not candidate.succeeded:
            break
        undercut = 0.0
        if len(best.trajectory.arcs) == 1:
            undercut = SEARCH.higher_cost if _sort_key(candidate) < _sort_key(best) else SEARCH.similar_cost
        if candidate.cost <= best.cost + undercut * max(abs(best.cost), MULTIPLIER_ERROR):
            best = candidate
        patterns = _optimal_bounds(candidate)
        if patterns is None:
            break
        arcs, durations = _arcs(patterns, trajectory)
    return best


def _join_arcs(pieces: list[tuple[Arc, float]]) -> tuple[tuple[Arc, ...], Floats]:
    """Arcs and durations; neighbours with the same active bounds become one."""
    runs = [list(run) for _, run in groupby(pieces, key=lambda piece: piece[0].active_bounds)]
    arcs = tuple(replace(run[0][0], intervals=interval_count([arc for arc, _ in run])) for run in runs)
    return arcs, np.array([sum(T for _, T in run) for run in runs])


def _has_no_choice(problem: Problem, arcs: tuple[Arc, ...]) -> bool:
    """Whether inserted arcs are of no use: there is one without active bounds, or bounds leave nothing to optimise."""
    if len(arcs) == 1 and not arcs[0].active_bounds:
        return True
    unknown = len(arcs) - (problem.duration[0] == problem.duration[1])
    required = len(problem.end.equalities) + len(problem.closed)
    free = len(problem.states) - len(problem.start.equalities)
    return all(len(arc.active_bounds) == len(problem.controls) for arc in arcs) and unknown + free < required


def _has_continuous_bounds(problem: Problem, arcs: tuple[Arc, ...]) -> bool:
    """Whether no coordinate would have to jump from bound to bound between two arcs that hold it."""
    moved = {i for i, label in enumerate(problem.path.labels) if label in problem.moves and problem.control_order > 0}
    return not any(
        i in moved and dict(b.active_bounds).get(i, x) != x for a, b in pairwise(arcs) for i, x in a.active_bounds
    )


def _optimal_bounds(solution: Solution) -> list[_ActiveBounds] | None:
    """Active bounds at each point at which the Hamiltonian is least; None if they are those of the solution."""
    problem, trajectory, path = solution.problem, solution.trajectory, solution.problem.path
    held = [arc.active_bounds for arc in trajectory.arcs for _ in range(arc.intervals * DEGREE)]
    better = [dict(now) for now in held]
    for i, label in enumerate(path.labels):
        ends = (float(path.low[i]), float(path.high[i]))
        if label not in problem.controls or not np.isfinite(ends).all():
            continue
        is_controlled = np.arange(len(problem.controls))[:, None] == problem.controls.index(label)
        sides = (replace(trajectory, controls=np.where(is_controlled, x, trajectory.controls)) for x in ends)
        low, high = (side.hamiltonian(problem, solution.adjoints) for side in sides)
        least = HAMILTONIAN_VARIATION * np.abs(high - low).max()
        for now, more in zip(better, high - low, strict=True):
            if i in now and abs(more) > least:
                now[i] = ends[0] if more > 0 else ends[1]
    required = [tuple(now.items()) for now in better]
    return required if required != held else None


_ActiveBounds = tuple[tuple[int, float], ...]
"""Rows of the path with the bounds at which they are held."""


def _active_bounds(solution: Solution) -> list[_ActiveBounds]:
    """Active bounds at each point, of rows that controls can hold there.

    Runs of few points take those of their neighbours.
    """
    problem, path = solution.problem, solution.problem.path
    reached = [function.jac_sparsity(0, 1).row() for function in (path.function, path_rates(problem))]
    by_controls = {
        i for rows in reached[: 1 + (problem.control_order > 0)] for i in rows
    }  # directly, or by their rates
    holdable = [i for i, label in enumerate(path.labels) if label in problem.moves or i in by_controls]
    span = np.where(np.isfinite(path.high - path.low), path.high - path.low, 1.0)

    def bounds_at_point(column: Floats) -> _ActiveBounds:
        """Active bounds at a point with these values of the rows."""
        ends = ((i, float(bound)) for i in holdable for bound in (path.low[i], path.high[i]))
        rows = [(i, bound) for i, bound in ends if abs(column[i] - bound) <= SEARCH.at_bound * span[i]]
        return tuple(rows[: len(problem.controls)])

    patterns = [bounds_at_point(column) for column in solution.trajectory.evaluate(path.function).T]
    lengths = np.array([length for _, length in _equal_runs(patterns)])
    lasting = np.flatnonzero(np.repeat(lengths >= min(3, lengths.max()), lengths))
    nearest = np.abs(np.arange(len(patterns))[:, None] - lasting).argmin(axis=1)
    return [patterns[lasting[i]] for i in nearest]


def _equal_runs(patterns: list[_ActiveBounds]) -> list[tuple[_ActiveBounds, int]]:
    """Runs of equal patterns, each with its number of points."""
    return [(pattern, len(list(run))) for pattern, run in groupby(patterns)]


def _arcs(patterns: list[_ActiveBounds], trajectory: CollocatedTrajectory) -> tuple[tuple[Arc, ...], Floats]:
    """Arcs with constant active bounds, and their durations."""
    runs = _equal_runs(patterns)
    cuts = np.cumsum([length for _, length in runs])[:-1]
    instants, total = trajectory.instants, trajectory.breaks[-1]
    edges = np.array([0.0, *((instants[cuts - 1] + instants[cuts]) / 2), total])
    m = len(patterns) // DEGREE
    shares = np.diff(edges) / total
    return tuple(Arc(max(3, round(m * u)), p) for (p, _), u in zip(runs, shares, strict=True)), np.diff(edges)


# ---- refusals -----------------------------------------------------------------------------------------------------


def refuse_singularity(solution: Solution) -> None:
    """Raise an error for a motion through a singularity of the effective mass: a coordinate moves at no cost there.

    :raises PlanError: with instant and coordinate, unless the mesh resolves the motion.
    """
    problem, trajectory, count = solution.problem, solution.trajectory, len(solution.problem.moves)
    variation = largest_hamiltonian_range(solution)
    if problem.phases or not count or variation <= HAMILTONIAN_VARIATION * hamiltonian_scale(solution):
        return
    masses = trajectory.evaluate(problem.mass).reshape(count, -1, count)
    sizes, directions = np.linalg.eigh(masses.transpose(1, 0, 2))
    worst = int(np.argmin(sizes[:, 0]))
    if sizes[worst, 0] > SEARCH.singular_mass * sizes.max() or sizes.max() <= 0:  # massless, in every shape
        return
    name = problem.moves[int(np.argmax(np.abs(directions[worst, :, 0])))]
    raise PlanError(
        f"{problem.name}: at t = {trajectory.instants[worst] * problem.scales.time:.4g} s the effective mass of {name} "
        "vanishes, so that there it may turn at no cost: keep away from such a shape by bounds"
    )


def _failure_text(problem: Problem, failures: list[Solution], rejected: list[Solution]) -> str:
    """Text of the error for a search without solution: the nearest end that was reached, and active bounds."""
    if not failures and not rejected:
        return f"{problem.name}: no motion was found in time; raise time_limit"
    end, X = problem.end, problem.end.sizes
    if not failures:
        names = ", ".join(end.labels) or "what has to close"
        return (
            f"{problem.name}: no motion was found: what meshes say of {names} the equations do not follow; give bounds "
            "of what moves, or another duration"
        )
    nearest = min(failures, key=end_miss)
    reached = problem.end_values(nearest.trajectory.knots[:, -1])
    required = np.clip(reached, end.low, end.high) * X
    missed_rows = np.flatnonzero(end.violation(reached) > SEARCH.reached_miss)
    wrong = [f"{end.labels[i]} = {reached[i] * X[i]:.6g} instead of {required[i]:.6g}" for i in missed_rows]
    if not wrong:
        return (
            f"{problem.name}: not solved ({nearest.status}); the end can be reached: try other intervals or more tries"
        )
    active = list(dict.fromkeys(_active_texts(nearest)))
    T = nearest.trajectory.durations.sum()
    if np.isclose(T, problem.duration[1]):
        active.append(f"duration = {T * problem.scales.time:g}")
    bounds = f"; active: {', '.join(active)}" if active else ""
    return f"{problem.name}: no motion was found from {len(failures)} starts, nearest {', '.join(wrong)}{bounds}"


def _active_texts(solution: Solution) -> Iterator[str]:
    """Texts "name = bound" of the bounds that are active somewhere."""
    for phase, inside in phase_points(solution.problem, solution.trajectory.arcs):
        path = phase.path
        values = solution.trajectory.evaluate(path.function, inside)
        ends = [(i, name, bound) for i, name in enumerate(path.labels) for bound in (path.low[i], path.high[i])]
        for i, name, bound in ends:
            is_active = np.abs(values[i] - bound) <= SEARCH.at_bound * max(1.0, abs(bound))
            if np.isfinite(bound) and np.any(is_active):
                yield f"{name} = {bound * path.sizes[i]:g}"


# ---- integration of the equations ----------------------------------------------------------------------------------


def _satisfies_equations(solution: Solution, tolerance: float = SEARCH.integration_difference) -> bool:
    """Whether integration from knot to knot agrees with the knots of a solution; true with phases.

    These are left to the replay.
    """
    if solution.problem.phases:
        return True
    trajectory = solution.trajectory
    before, after = trajectory.knots[:, :-1], trajectory.knots[:, 1:]
    integrate = _interval_integrator(solution.problem).map(before.shape[1])
    integrated = np.array(integrate(before, trajectory.controls, np.diff(trajectory.breaks)[None]))
    if not is_smooth_function(solution.problem.rates):
        tolerance = max(tolerance, SEARCH.kink_integration_difference)
    return bool(np.max(np.abs(integrated - after) / np.maximum(1.0, np.abs(after))) < tolerance)


@lru_cache(maxsize=2)
def _interval_integrator(problem: Problem) -> ca.Function:
    """Function (state, controls at the collocation points, length) -> state at the end of an interval."""
    n, c = len(problem.states), len(problem.controls)
    z, p = ca.MX.sym("z", n + 1), ca.MX.sym("p", c * DEGREE + 1)  # state and part of the interval; its length and U
    U, powers = ca.reshape(p[1:], c, DEGREE), ca.vertcat(*(z[n] ** k for k in range(DEGREE)))
    rates = p[0] * problem.rates(z[:n], U @ (ca.DM(TO_POWERS.T) @ powers))
    end = runge_kutta(z, p, ca.vertcat(rates, 1))
    X, U, h = ca.MX.sym("X", n), ca.MX.sym("U", c, DEGREE), ca.MX.sym("h")
    return ca.Function("interval", [X, U, h], [end(ca.vertcat(X, 0), ca.vertcat(h, ca.vec(U)), 1)[:n]])
