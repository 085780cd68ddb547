"""``plan``: from what is wanted of a mechanism to the motion of its active coordinates that does it at least cost."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import groupby, pairwise
from typing import Any

import numpy as np

from liaisons.arguments import finite, named, shown, whole
from liaisons.library import Target
from liaisons.operators.guesses import guesses
from liaisons.operators.plans import Plan
from liaisons.operators.problems import (
    Cost,
    Expression,
    Goal,
    PlanError,
    Problem,
    Value,
    closed_names,
    move_names,
    problem_of,
)
from liaisons.operators.transcription import DEGREE, INTERRUPTED, Arc, Array, Clock, Solution, Track, path_rates, solve
from liaisons.operators.verifying import NOTHING, hamiltonian_scale
from liaisons.progress import progress_bar

_NEAR = 1e-4
"""How near a row of the path is to its bound, relative to its range, to be held there."""

_ALIKE = 1e-3
"""How much more, relatively, a motion with arcs may cost than one whose mesh blurs the switches."""
_MOST_INTERVALS = 100
"""How fine a mesh may become."""
_LAW = 1e-6
"""Of the Hamiltonian's terms: as constant as it has to be."""
_SINGULAR = 1e-3
"""An effective mass that is so small beside the others vanishes nearby."""
_FEASIBLE = 1e-6
"""Residual of the equations below which what was stopped on the way is a motion at all."""


def plan(
    mechanism: Target,
    /,
    moves: str | Sequence[str] | None = None,
    *,
    start: Mapping[str, Value] | Expression | None = None,
    end: Mapping[str, Value] | Expression | None = None,
    closed: bool | str | Sequence[str] = False,
    duration: float | tuple[float, float],
    minimize: Cost = "motion",
    bounds: Mapping[str, tuple[float | None, float | None]] | None = None,
    intervals: int = 20,
    accuracy: float | None = 1e-8,
    tries: int = 1,
    guess: Plan | None = None,
    time_limit: float = 60.0,
    progress: bool = False,
    **values: float,
) -> Plan:
    """Find the motion of active coordinates that takes a mechanism from start to end at least cost.

    ::

        motion = plan(
            "PlanarCat", ["psi_1", "psi_2"], start={"phi": 0}, end={"phi": -1.047}, closed=True, duration=0.9,
            bounds={"psi_1": (-3, 3), "psi_2": (-3, 3)}, arm_1=0.25, arm_2=0.25,
        )

    Names are those of the FMU.  What is not said of the start is as declared, at rest; an orientation goes by its own
    name, as a quaternion.  A function of the mechanism (``lambda m: m.bob_x - 1``) or the same as text stands for
    start or end where something has to vanish, and for ``minimize``.

    :param mechanism: name, file or class of a mechanism or chain.
    :param moves: active coordinates that the plan moves; all unless given.  The others stay.
    :param start: values of states (q, q_dot, p_q, σ, σ̇); (low, high) a range, None: free.
    :param end: values of anything that can be read.
    :param closed: True, or names: what is moved comes back to where it was.
    :param duration: [s]; (low, high): free.
    :param minimize: ``"motion"``: ∫ ½ σ̇ᵀΘσ̇ dt; ``"effort"``: ∫ λ² dt; ``"time"``; or an integrand.
    :param bounds: (low, high) of anything that can be read: coordinates, rates, accelerations, forces, power.
    :param intervals: of the first mesh.
    :param accuracy: the mesh is refined until the Hamiltonian is constant to this; None: it stays as it is.
    :param tries: how many motions to start from, where extremals compete; the best one is kept.
    :param guess: a plan of the same kind to start from.
    :param time_limit: [s]; what there is then, or at Ctrl-C, is returned, ``motion.proved`` False.
    :param progress: show a progress bar on stderr.
    :param values: parameters, and inputs that stay constant.
    :returns: the motion.  What IPOPT says is not enough: ``motion.verify()`` replays it through the FMUs.
    :raises PlanError: for an unknown name, with the nearest one; for what cannot be reached, with the obstacle.
    """
    names = move_names(mechanism, moves)
    goal = Goal(
        component=mechanism,
        moves=names,
        start={} if start is None else start,
        end={} if end is None else end,
        closed=closed_names(closed, names),
        duration=_duration(duration),
        minimize=minimize,
        bounds=named("bounds", bounds or {}, PlanError),
        values=values,
    )
    whole("intervals", intervals, PlanError)
    whole("tries", tries, PlanError)
    finite("time_limit", time_limit, PlanError)
    problem = problem_of(goal)
    starts = guesses(problem, intervals, tries) if guess is None else [_warm(problem, guess, intervals)]
    with progress_bar(f"plan {problem.name}" if progress else "", "{:.0f} of {:g} s", 0, time_limit) as show:
        clock = Clock(time_limit, show)
        best = _best(problem, starts, clock)
        if best.proved:
            try:
                for finer in _refined(problem, best, np.inf if accuracy is None else accuracy, clock):
                    best = finer
            except KeyboardInterrupt:
                best = replace(best, proved=False)
    if minimize == "motion" and best.proved:
        _refuse_singularity(problem, best)
    return Plan(goal, problem, best)


def _best(problem: Problem, starts: Sequence[Track], clock: Clock) -> Solution:
    """The best of what comes of these starts; of those that come to an end in time.

    :raises PlanError: if none leads to the end.
    """
    found: list[Solution] = []
    for track in starts:
        try:
            found.append(solve(problem, track, clock))
        except KeyboardInterrupt:
            if not found:
                raise
            found[-1] = replace(found[-1], proved=False)
        if not found[-1].proved:
            break
    stopped = not found[-1].proved
    good = [one for one in found if one.succeeded or (stopped and one.residual < _FEASIBLE)]
    if not good and found[-1].status in INTERRUPTED:
        raise KeyboardInterrupt
    if not good:
        raise PlanError(_obstacle(problem, starts[0], found[0]))
    best = min(good, key=lambda one: (not one.succeeded, one.cost))
    return replace(best, proved=not stopped)


def _duration(given: Any) -> tuple[float, float]:
    pair: tuple[Any, Any] = tuple(given) if isinstance(given, (tuple, list)) and len(given) == 2 else (given, given)
    low, high = pair
    for value in (low, high):
        finite("duration", value, PlanError)
    if not 0 < low <= high:
        raise PlanError(f"duration = {shown(given)}: give seconds > 0, or (low, high)")
    return float(low), float(high)


def _warm(problem: Problem, guess: Plan, intervals: int) -> Track:
    """Another plan, where it has the same states; on its own arcs if it has several."""
    if not isinstance(guess, Plan) or guess.problem.states != problem.states:
        raise PlanError(f"{problem.name}: guess = {shown(guess)}: give a plan of the same coordinates and costs")
    track = guess.solution.track
    total = track.durations.sum()
    return track.on((Arc(intervals),), np.array([total]))


# ---- switching instants -------------------------------------------------------------------------------------------


def _refined(problem: Problem, solution: Solution, accuracy: float, clock: Clock) -> Iterator[Solution]:
    """The same motion with its arcs, on meshes twice as fine each until its Hamiltonian is constant."""
    while True:
        if len(solution.track.arcs) == 1:
            solution = _with_arcs(problem, solution, clock)
        yield solution
        arcs = tuple(replace(arc, intervals=2 * arc.intervals) for arc in solution.track.arcs)
        is_law = np.ptp(solution.hamiltonian) <= max(accuracy * hamiltonian_scale(problem, solution), NOTHING)
        if not solution.proved or is_law or sum(arc.intervals for arc in arcs) > _MOST_INTERVALS:
            return
        finer = solve(problem, solution.track.on(arcs, solution.track.durations), clock, near=True)
        solution = finer if finer.succeeded else replace(solution, proved=finer.proved)
        if not finer.succeeded:
            yield solution
            return


def _with_arcs(problem: Problem, solution: Solution, clock: Clock) -> Solution:
    """The same motion with its arcs: where controls switch between bounds, the instants become unknowns.

    What is better is kept: where holding the rows does not work out, the solution stays as it is.
    """
    arcs, durations = _arcs(problem, solution)
    if len(arcs) < 2 and not any(arc.held for arc in arcs):
        return solution
    moved = {i for i, label in enumerate(problem.path.labels) if label in problem.moves and problem.order > 0}
    if any(i in moved and dict(other.held).get(i, x) != x for one, other in pairwise(arcs) for i, x in one.held):
        return solution  # from one bound to another takes time: the mesh is too coarse to show on which arc
    found = solve(problem, solution.track.on(arcs, durations), clock, near=True)
    shortest = float(np.min(found.track.durations)) / float(durations.sum())
    alike = found.cost <= solution.cost + _ALIKE * max(abs(solution.cost), 1e-12)
    return found if found.succeeded and alike and shortest > 1e-5 else replace(solution, proved=found.proved)


def _arcs(problem: Problem, solution: Solution) -> tuple[tuple[Arc, ...], Array]:
    """Arcs on which the same rows are at their bounds, and their durations."""
    path, track = problem.path, solution.track
    reached = [function.jac_sparsity(0, 1).row() for function in (path.function, path_rates(problem))]
    by_controls = {i for rows in reached[: 1 + (problem.order > 0)] for i in rows}  # at once, or by their rates
    holdable = [i for i, label in enumerate(path.labels) if label in problem.moves or i in by_controls]
    span = np.where(np.isfinite(path.high - path.low), path.high - path.low, 1.0)

    def held(column: Array) -> tuple[tuple[int, float], ...]:
        ends = ((i, float(bound)) for i in holdable for bound in (path.low[i], path.high[i]))
        rows = [(i, bound) for i, bound in ends if abs(column[i] - bound) <= _NEAR * span[i]]
        return tuple(rows[: len(problem.controls)])

    patterns = [held(column) for column in solution.path.T]
    runs = [(pattern, len(list(group))) for pattern, group in groupby(patterns)]
    longest = max(length for _, length in runs)
    ends: list[list[Any]] = []  # pattern, first point, end
    at = 0
    for pattern, length in runs:
        if length >= min(3, longest):
            ends.append([pattern, at, at + length])
        at += length
    merged: list[list[Any]] = []
    for item in ends:
        if merged and merged[-1][0] == item[0]:
            merged[-1][2] = item[2]
        else:
            merged.append(item)
    instants, total = track.instants, track.breaks[-1]
    cuts = [(instants[one[2] - 1] + instants[other[1]]) / 2 for one, other in pairwise(merged)]
    edges = np.array([0.0, *cuts, total])
    m = len(patterns) // DEGREE
    arcs = tuple(
        Arc(max(3, round(m * (after - before) / total)), pattern)
        for (pattern, _, _), before, after in zip(merged, edges[:-1], edges[1:], strict=True)
    )
    return arcs, np.diff(edges)


# ---- what stands in the way ---------------------------------------------------------------------------------------


def _refuse_singularity(problem: Problem, solution: Solution) -> None:
    """Refuse a motion through a place where a coordinate costs nothing, and of which no mesh can tell how it goes."""
    track, count = solution.track, len(problem.moves)
    if np.ptp(solution.hamiltonian) <= _LAW * hamiltonian_scale(problem, solution):
        return
    points = track.inner.shape[1]
    masses = np.array(problem.mass.map(points)(track.inner, track.controls)).reshape(count, points, count)
    sizes, directions = np.linalg.eigh(masses.transpose(1, 0, 2))
    worst = int(np.argmin(sizes[:, 0]))
    if sizes[worst, 0] > _SINGULAR * sizes.max():
        return
    name = problem.moves[int(np.argmax(np.abs(directions[worst, :, 0])))]
    raise PlanError(
        f"{problem.name}: at t = {track.instants[worst]:.4g} s the effective mass of {name} vanishes, so that there it "
        "may turn at no cost: keep away from such a shape by bounds"
    )


def _obstacle(problem: Problem, guess: Track, found: Solution) -> str:
    """Why there is no plan: the nearest end that was reached, and the bounds that are in the way."""
    if not found.proved:
        return f"{problem.name}: no motion was found in time ({found.status}); raise time_limit"
    nearest = solve(problem, guess, soft=True)
    end = np.array(problem.end.function(nearest.track.knots[:, -1])).ravel()
    off = np.maximum(problem.end.low - end, end - problem.end.high)
    names, low, high = problem.end.labels, problem.end.low, problem.end.high
    missed = [
        f"{names[i]} = {end[i]:.6g} instead of {np.clip(end[i], low[i], high[i]):.6g}"
        for i in np.flatnonzero(off > 1e-6)
    ]
    if not missed:
        return f"{problem.name}: not solved ({found.status}); the end can be reached: try other intervals or tries=5"
    path = problem.path
    ends = [(i, name, bound) for i, name in enumerate(path.labels) for bound in (path.low[i], path.high[i])]
    active = [
        f"{name} = {bound:g}"
        for i, name, bound in ends
        if np.isfinite(bound) and np.any(np.abs(nearest.path[i] - bound) <= 1e-4 * max(1.0, abs(bound)))
    ]
    T = nearest.track.durations.sum()
    if np.isclose(T, problem.duration[1]):
        active.append(f"duration = {T:g}")
    bounds = f"; active: {', '.join(active)}" if active else ""
    return f"{problem.name}: the end was not reached, nearest {', '.join(missed)}{bounds}"
