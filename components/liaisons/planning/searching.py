"""The search of a plan: many starts on a coarse mesh, what is promising on finer ones, with arcs between switches.

A start from which IPOPT does not come to the end goes by way of the nearest end: first in the duration that it has,
then in any.  A motion on a mesh is believed if the equations, integrated under its controls from knot to knot, lead
where the mesh does: implicit schemes have solutions that differential equations do not have.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import groupby, islice, pairwise

import casadi as ca
import numpy as np

from liaisons.errors import PlanError
from liaisons.planning.goals import Array
from liaisons.planning.problems import Problem
from liaisons.planning.transcription import (
    DEGREE,
    TO_POWERS,
    Arc,
    Clock,
    CollocatedTrajectory,
    Solution,
    interval_count,
    path_rates,
    solve,
)
from liaisons.planning.verifying import NOTHING, hamiltonian_scale

COARSE = 10
"""Intervals of the mesh on which starts are tried."""
STARTS = 8
"""Greatest number of starts, unless ``tries`` is given."""
_AGREED = 2
"""So many that lead to the same optimum are enough then; one more where the duration is free, two where σ is closed."""
_ALIKE = 1e-3
"""Costs that differ by less, relatively, on coarse meshes, whose switches are blurred, may be those of one optimum."""
_WORSE = 5e-2
"""What costs so much more on a coarse mesh does not become the best on a finer one."""
_SAME = 1e-6
"""Costs on one mesh that differ by less, relatively, are those of one optimum."""
_MARGIN = 4.0
"""So many times its own first mesh's error may that of another motion be,"""
_LEAST_MARGIN = 1e-4
"""and at least so much of the cost."""
_NEAR = 1e-4
"""How near a row of the path is to its bound, relative to its range, to be held there."""
_MOST_INTERVALS = 100
"""How fine a mesh may become."""
_LAW = 1e-6
"""Of the Hamiltonian's terms: as constant as it has to be."""
_LAWLESS = 1e-3
"""What is less constant on its finest mesh is no extremal."""
_SINGULAR = 1e-3
"""An effective mass that is so small beside the others vanishes nearby."""
_FEASIBLE = 1e-6
"""Residual of the equations below which what was stopped on the way is a motion at all."""
_REACHED = 1e-6
"""By how much an end is missed, in units of its size, that a solver may still reach."""
_BLURRED = 3e-2
"""By how much at most an end is missed, in units of its size, because a coarse mesh blurs switches."""
_LED = 1e-5
"""Where a mesh resolves a motion its knots are as near, in units of their sizes, to those of the equations."""
_LED_ROUGHLY = 0.1
"""On coarse meshes; a solution that the differential equations do not have is off by its own size."""
_CORRECTIONS = 6
"""How often arcs are inserted where the Hamiltonian is less at another bound, or removed where they vanish."""
_SUBSTEPS = 32
"""Of Runge and Kutta's method in an interval: of fourth order, these leave 1e-8 of what a mesh of order 10 resolves."""


@dataclass(frozen=True)
class Settings:
    """Of a search.

    :ivar intervals: of the mesh on which what is promising is refined first.
    :ivar accuracy: to which the Hamiltonian is constant in the end; None: the mesh stays as it is.
    :ivar tries: how many starts; None: until some agree.
    """

    intervals: int
    accuracy: float | None
    tries: int | None


def search(problem: Problem, starts: Iterable[CollocatedTrajectory], clock: Clock, settings: Settings) -> Solution:
    """The best of what comes of these starts, of as many as there is time for.

    All that may be the best is refined, so that more starts lead to nothing worse.

    :param problem: a relative one.
    :param starts: on coarse meshes.
    :raises PlanError: if none leads to the end.
    :raises KeyboardInterrupt: if there was one, and nothing before it.
    """
    rough: list[Solution] = []  # on coarse meshes, in the order of the starts
    optima: list[float] = []  # costs that differ
    failures: list[Solution] = []
    best: Solution | None = None
    count, stopped = 0, False
    low, high = problem.duration
    enough = _AGREED + (2 if problem.is_loop else int(low < high))
    for trajectory in islice(starts, settings.tries or STARTS):
        candidate = _tried(problem, trajectory, settings.intervals, clock)
        if candidate.succeeded:
            rough += [] if any(_is_alike(candidate, one, _SAME) for one in rough) else [candidate]
            optima += [] if any(_differ(candidate.cost, cost) <= _ALIKE for cost in optima) else [candidate.cost]
        elif candidate.finished:
            failures.append(candidate)
        elif (
            not rough
            and candidate.residual < _FEASIBLE
            and missed(problem, candidate) < _FEASIBLE
            and _is_believed(problem, candidate, settings)
        ):
            best = candidate
        count += candidate.finished
        agreed, stopped = len(optima) == 1 and not failures, not candidate.finished
        if clock.is_over or stopped or (settings.tries is None and count == enough and agreed):
            break
    led, astray = _compared(problem, rough, settings, clock, stopped=stopped)
    best = led or best
    if best is not None:
        return replace(best, finished=not (stopped or clock.is_over), starts=max(1, count), optima=max(1, len(optima)))
    if clock.is_interrupted:
        raise KeyboardInterrupt
    for solution in astray:
        refuse_singularity(problem, solution)
    raise PlanError(_obstacle(problem, failures, astray))


def _compared(
    problem: Problem, rough: list[Solution], settings: Settings, clock: Clock, *, stopped: bool
) -> tuple[Solution | None, list[Solution]]:
    """The best of what becomes of solutions on coarse meshes, and those that the equations do not follow.

    What is refined depends on earlier starts alone, so that more of them add to it.  Where there is no time left, the
    least of what has not been refined counts, too.
    """
    best: Solution | None = None
    refined: list[Solution] = []  # on first meshes
    margin = 0.0  # above the best, within which the first mesh of a motion that is better may lie
    astray: list[Solution] = []
    for k, one in enumerate(rough):
        if clock.is_over or stopped:
            rest = [*([best] if best else []), *(replace(other, finished=False) for other in rough[k:])]
            believed = (other for other in rest if _is_believed(problem, other, settings))
            return min(believed, key=lambda other: _rank(problem, other), default=None), astray
        if best is not None and one.cost > best.cost + _WORSE * abs(best.cost):
            continue
        first = _on_first_mesh(problem, one, settings, clock)
        if any(_is_alike(first, other, _SAME) for other in refined) or (best and first.cost > best.cost + margin):
            continue
        refined.append(first)
        candidate = _refined(problem, first, settings.accuracy, clock) if first.finished else first
        if not _is_believed(problem, candidate, settings):
            astray.append(candidate)
        elif best is None or _rank(problem, candidate) < _rank(problem, best):
            best = candidate
            margin = max(_MARGIN * abs(best.cost - first.cost), _LEAST_MARGIN * abs(best.cost))
    return best, astray


def _differ(cost: float, other: float) -> float:
    """By how much, relatively."""
    return abs(cost - other) / max(abs(cost), abs(other), NOTHING)


def _is_alike(one: Solution, other: Solution, tolerance: float) -> bool:
    return len(one.trajectory.arcs) == len(other.trajectory.arcs) and _differ(one.cost, other.cost) <= tolerance


def _rank(problem: Problem, solution: Solution) -> tuple[bool, float]:
    """Extremals first, then by cost: a mesh that is too coarse can undercut what is possible."""
    return bool(np.ptp(solution.hamiltonian) > _LAWLESS * hamiltonian_scale(problem, solution)), solution.cost


def _is_believed(problem: Problem, solution: Solution, settings: Settings) -> bool:
    """Whether the equations lead where the mesh does; where it stays as it is, ``verify`` says so."""
    return settings.accuracy is None or _is_led(problem, solution, _LED if solution.finished else _LED_ROUGHLY)


def _tried(problem: Problem, trajectory: CollocatedTrajectory, intervals: int, clock: Clock) -> Solution:
    """What comes of a start: the solution, or where IPOPT stood, nearest to the end."""
    candidate = _brought(problem, trajectory, clock)
    coarse = interval_count(trajectory.arcs)
    if candidate.succeeded or not candidate.finished or coarse >= intervals or missed(problem, candidate) > _BLURRED:
        return candidate
    return _brought(problem, trajectory.on((Arc(intervals),), trajectory.durations), clock)


def _brought(problem: Problem, trajectory: CollocatedTrajectory, clock: Clock) -> Solution:
    """From a start to the end, if need be by way of the nearest end."""
    candidate = solve(problem, trajectory, clock)
    if candidate.succeeded or not candidate.finished:
        return candidate
    low, high = problem.duration
    T = float(trajectory.durations.sum())
    rules = [problem] if low == high else [replace(problem, duration=(T, T)), problem]
    nearest = candidate
    for rule in rules:
        nearest = solve(rule, trajectory, clock, soft=True)
        trajectory = nearest.trajectory
        if not nearest.finished:
            return nearest
    if missed(problem, nearest) < _REACHED:
        candidate = solve(problem, trajectory, clock)
        if candidate.succeeded or not candidate.finished:
            return candidate
    arcs, durations = _arcs(_patterns(problem, nearest), nearest.trajectory)
    if low < high and len(arcs) > 1 and missed(problem, nearest) < _BLURRED:
        candidate = solve(problem, trajectory.on(arcs, durations), clock)
        if candidate.succeeded or not candidate.finished:
            return candidate
    return replace(nearest, status=candidate.status)


def missed(problem: Problem, solution: Solution) -> float:
    """By how much the end is missed."""
    return float(np.linalg.norm(problem.end.violation(problem.end_values(solution.trajectory.knots[:, -1]))))


def _on_first_mesh(problem: Problem, rough: Solution, settings: Settings, clock: Clock) -> Solution:
    """The same optimum on the first mesh that was asked for; stopped on the way, as it is."""
    trajectory = rough.trajectory
    if len(trajectory.arcs) == 1 and trajectory.arcs[0].intervals < settings.intervals:
        finer = trajectory.on((Arc(settings.intervals),), trajectory.durations)
        for near in (True, False):
            candidate = solve(problem, finer, clock, near=near)
            if not candidate.finished:
                return replace(rough, finished=False)
            if candidate.succeeded:
                return candidate
    return rough


# ---- switching instants -------------------------------------------------------------------------------------------


def _refined(problem: Problem, solution: Solution, accuracy: float | None, clock: Clock) -> Solution:
    """The same motion with its arcs, on meshes twice as fine each until its Hamiltonian is constant."""
    solution = _with_arcs(problem, solution, clock)
    while accuracy is not None and solution.finished:
        trajectory = solution.trajectory
        arcs = tuple(replace(arc, intervals=2 * arc.intervals) for arc in trajectory.arcs)
        is_law = np.ptp(solution.hamiltonian) <= max(accuracy * hamiltonian_scale(problem, solution), NOTHING)
        if interval_count(arcs) > _MOST_INTERVALS or (is_law and _is_led(problem, solution)):
            break
        finer = solve(problem, trajectory.on(arcs, trajectory.durations), clock, near=True)
        if not finer.succeeded:
            return replace(solution, finished=finer.finished)
        solution = finer if len(arcs) > 1 else _with_arcs(problem, finer, clock)
    return solution


def _with_arcs(problem: Problem, solution: Solution, clock: Clock) -> Solution:
    """The same motion with its arcs: where controls switch between bounds, the instants become unknowns.

    Arcs that vanish are left out, and where the Hamiltonian would be less at the other bound there is another arc.
    What is better is kept: where holding the rows does not work out, the solution stays as it is.
    """
    best, trajectory = solution, solution.trajectory
    patterns = (_switched if len(trajectory.arcs) > 1 else _patterns)(problem, solution)
    if patterns is None:
        return solution
    arcs, durations = _arcs(patterns, trajectory)
    for _ in range(_CORRECTIONS):
        if _is_determined(problem, arcs) or not _is_passable(problem, arcs):
            break
        candidate = solve(problem, trajectory.on(arcs, durations), clock, near=True)
        if not candidate.finished:
            return replace(best, finished=False)
        trajectory, lengths = candidate.trajectory, candidate.trajectory.durations
        vanishing = lengths < 1e-5 * lengths.sum()
        if vanishing.any() and not vanishing.all():
            arcs, durations = _joined([(a, T) for a, T, gone in zip(arcs, lengths, vanishing, strict=True) if not gone])
            continue
        if not candidate.succeeded:
            break
        undercut = 0.0
        if len(best.trajectory.arcs) == 1:
            undercut = _WORSE if _rank(problem, candidate) < _rank(problem, best) else _ALIKE
        if candidate.cost <= best.cost + undercut * max(abs(best.cost), NOTHING):
            best = candidate
        patterns = _switched(problem, candidate)
        if patterns is None:
            break
        arcs, durations = _arcs(patterns, trajectory)
    return best


def _joined(pieces: list[tuple[Arc, float]]) -> tuple[tuple[Arc, ...], Array]:
    """Arcs and their durations, neighbours of one kind as one."""
    groups = [list(group) for _, group in groupby(pieces, key=lambda piece: piece[0].active_bounds)]
    arcs = tuple(replace(group[0][0], intervals=interval_count([arc for arc, _ in group])) for group in groups)
    return arcs, np.array([sum(T for _, T in group) for group in groups])


def _is_determined(problem: Problem, arcs: tuple[Arc, ...]) -> bool:
    """Whether nothing is left to choose, be it that nothing is held or that all is."""
    if len(arcs) == 1 and not arcs[0].active_bounds:
        return True
    unknown = len(arcs) - (problem.duration[0] == problem.duration[1])
    required = len(problem.end.equalities) + len(problem.closed)
    free = len(problem.states) - len(problem.start.equalities)
    return all(len(arc.active_bounds) == len(problem.controls) for arc in arcs) and unknown + free < required


def _is_passable(problem: Problem, arcs: tuple[Arc, ...]) -> bool:
    """Whether no σ is to be at one bound and at once at another, the mesh too coarse to show on which arc it moves."""
    moved = {i for i, label in enumerate(problem.path.labels) if label in problem.moves and problem.order > 0}
    return not any(
        i in moved and dict(b.active_bounds).get(i, x) != x for a, b in pairwise(arcs) for i, x in a.active_bounds
    )


def _switched(problem: Problem, solution: Solution) -> list[_Pattern] | None:
    """What should be held at each point by Pontryagin's principle: the bound where H is less; None: it is."""
    trajectory, path = solution.trajectory, problem.path
    held = [arc.active_bounds for arc in trajectory.arcs for _ in range(arc.intervals * DEGREE)]
    better = [dict(now) for now in held]
    for i, label in enumerate(path.labels):
        ends = (float(path.low[i]), float(path.high[i]))
        if label not in problem.controls or not np.isfinite(ends).all():
            continue
        is_controlled = np.arange(len(problem.controls))[:, None] == problem.controls.index(label)
        sides = (replace(trajectory, controls=np.where(is_controlled, x, trajectory.controls)) for x in ends)
        low, high = (side.hamiltonian(problem, solution.adjoints) for side in sides)
        least = _LAW * np.abs(high - low).max()
        for now, more in zip(better, high - low, strict=True):
            if i in now and abs(more) > least:
                now[i] = ends[0] if more > 0 else ends[1]
    required = [tuple(now.items()) for now in better]
    return required if required != held else None


_Pattern = tuple[tuple[int, float], ...]
"""Rows that are held, and where."""


def _patterns(problem: Problem, solution: Solution) -> list[_Pattern]:
    """Which rows are at which of their bounds, at each point."""
    path = problem.path
    reached = [function.jac_sparsity(0, 1).row() for function in (path.function, path_rates(problem))]
    by_controls = {i for rows in reached[: 1 + (problem.order > 0)] for i in rows}  # at once, or by their rates
    holdable = [i for i, label in enumerate(path.labels) if label in problem.moves or i in by_controls]
    span = np.where(np.isfinite(path.high - path.low), path.high - path.low, 1.0)

    def held(column: Array) -> _Pattern:
        ends = ((i, float(bound)) for i in holdable for bound in (path.low[i], path.high[i]))
        rows = [(i, bound) for i, bound in ends if abs(column[i] - bound) <= _NEAR * span[i]]
        return tuple(rows[: len(problem.controls)])

    patterns = [held(column) for column in solution.trajectory.evaluate(path.function).T]
    lengths = np.array([length for _, length in _runs(patterns)])
    lasting = np.flatnonzero(np.repeat(lengths >= min(3, lengths.max()), lengths))
    nearest = np.abs(np.arange(len(patterns))[:, None] - lasting).argmin(axis=1)
    return [patterns[lasting[i]] for i in nearest]


def _runs(patterns: list[_Pattern]) -> list[tuple[_Pattern, int]]:
    """Each pattern with the number of points in a row at which it is the same."""
    return [(pattern, len(list(group))) for pattern, group in groupby(patterns)]


def _arcs(patterns: list[_Pattern], trajectory: CollocatedTrajectory) -> tuple[tuple[Arc, ...], Array]:
    """Arcs on which the same rows are at their bounds, and their durations."""
    runs = _runs(patterns)
    cuts = np.cumsum([length for _, length in runs])[:-1]
    instants, total = trajectory.instants, trajectory.breaks[-1]
    edges = np.array([0.0, *((instants[cuts - 1] + instants[cuts]) / 2), total])
    m = len(patterns) // DEGREE
    shares = np.diff(edges) / total
    return tuple(Arc(max(3, round(m * u)), p) for (p, _), u in zip(runs, shares, strict=True)), np.diff(edges)


# ---- refusals -----------------------------------------------------------------------------------------------------


def refuse_singularity(problem: Problem, solution: Solution) -> None:
    """Refuse a motion through a place where a coordinate costs nothing, and of which no mesh can tell how it goes."""
    trajectory, count = solution.trajectory, len(problem.moves)
    if np.ptp(solution.hamiltonian) <= _LAW * hamiltonian_scale(problem, solution):
        return
    masses = trajectory.evaluate(problem.mass).reshape(count, -1, count)
    sizes, directions = np.linalg.eigh(masses.transpose(1, 0, 2))
    worst = int(np.argmin(sizes[:, 0]))
    if sizes[worst, 0] > _SINGULAR * sizes.max():
        return
    name = problem.moves[int(np.argmax(np.abs(directions[worst, :, 0])))]
    raise PlanError(
        f"{problem.name}: at t = {trajectory.instants[worst] * problem.scales.time:.4g} s the effective mass of {name} "
        "vanishes, so that there it may turn at no cost: keep away from such a shape by bounds"
    )


def _obstacle(problem: Problem, failures: list[Solution], astray: list[Solution]) -> str:
    """Why there is no plan: the nearest end that was reached, and the bounds that are in the way."""
    if not failures and not astray:
        return f"{problem.name}: no motion was found in time; raise time_limit"
    end, X, path = problem.end, problem.end.sizes, problem.path
    if not failures:
        nearest = astray[0]
        reached = problem.end_values(_led(problem, nearest, through=True)[:, -1])
        off = end.violation(reached)
        rows = np.flatnonzero(off > _LED) if (off > _LED).any() else np.arange(off.size)
        names = ", ".join(end.labels[i] for i in rows) or "what has to close"
        return (
            f"{problem.name}: the end was not reached: what {', '.join(problem.moves)} can do does not lead there, "
            f"and what meshes say of {names} the equations do not follow"
        )
    nearest = min(failures, key=lambda one: missed(problem, one))
    reached = problem.end_values(nearest.trajectory.knots[:, -1])
    required = np.clip(reached, end.low, end.high) * X
    missed_rows = np.flatnonzero(end.violation(reached) > _REACHED)
    wrong = [f"{end.labels[i]} = {reached[i] * X[i]:.6g} instead of {required[i]:.6g}" for i in missed_rows]
    if not wrong:
        return (
            f"{problem.name}: not solved ({nearest.status}); the end can be reached: try other intervals or more tries"
        )
    ends = [(i, name, bound) for i, name in enumerate(path.labels) for bound in (path.low[i], path.high[i])]
    values = nearest.trajectory.evaluate(path.function)
    active = [
        f"{name} = {bound * path.sizes[i]:g}"
        for i, name, bound in ends
        if np.isfinite(bound) and np.any(np.abs(values[i] - bound) <= _NEAR * max(1.0, abs(bound)))
    ]
    T = nearest.trajectory.durations.sum()
    if np.isclose(T, problem.duration[1]):
        active.append(f"duration = {T * problem.scales.time:g}")
    bounds = f"; active: {', '.join(active)}" if active else ""
    return f"{problem.name}: the end was not reached, nearest {', '.join(wrong)}{bounds}"


# ---- integration of the equations ----------------------------------------------------------------------------------


def _is_led(problem: Problem, solution: Solution, tolerance: float = _LED) -> bool:
    """Whether the equations lead from knot to knot as the mesh does."""
    knots = solution.trajectory.knots[:, 1:]
    return bool(np.max(np.abs(_led(problem, solution) - knots) / np.maximum(1.0, np.abs(knots))) < tolerance)


def _led(problem: Problem, solution: Solution, *, through: bool = False) -> Array:
    """Where the equations lead in each interval, from its first knot; or from the first of all, through all of them."""
    trajectory = solution.trajectory
    m, step, lengths = trajectory.knots.shape[1] - 1, _interval(problem), np.diff(trajectory.breaks)[None]
    if through:
        return np.array(step.mapaccum(m)(trajectory.knots[:, 0], trajectory.controls, lengths))
    return np.array(step.map(m)(trajectory.knots[:, :-1], trajectory.controls, lengths))


@lru_cache(maxsize=2)
def _interval(problem: Problem) -> ca.Function:
    """State, controls at the collocation points and length of an interval -> the state at its end."""
    n, c = len(problem.states), len(problem.controls)
    z, p = ca.MX.sym("z", n + 1), ca.MX.sym("p", c * DEGREE + 1)  # state and part of the interval; its length and U
    U, powers = ca.reshape(p[1:], c, DEGREE), ca.vertcat(*(z[n] ** k for k in range(DEGREE)))
    rates = p[0] * problem.rates(z[:n], U @ (ca.DM(TO_POWERS.T) @ powers))
    end = ca.simpleRK(ca.Function("rate", [z, p], [ca.vertcat(rates, 1)]), _SUBSTEPS)
    X, U, h = ca.MX.sym("X", n), ca.MX.sym("U", c, DEGREE), ca.MX.sym("h")
    return ca.Function("interval", [X, U, h], [end(ca.vertcat(X, 0), ca.vertcat(h, ca.vec(U)), 1)[:n]])
