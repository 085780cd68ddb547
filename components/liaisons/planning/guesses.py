"""What a plan starts from: motions that need no thought, those that miss the end least first."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from itertools import count, pairwise
from typing import Any

import numpy as np

from liaisons.errors import PlanError
from liaisons.language import Orientation
from liaisons.planning.goals import Array, by_name, motion_names
from liaisons.planning.problems import Problem
from liaisons.planning.transcription import DEGREE, Arc, CollocatedTrajectory, mixture

_FINE = 30
"""So many intervals, of six steps each, on which Runge and Kutta's method leaves 1e-9 of a loop."""
_ALIKE = 1e-9
"""By how much ends may differ, in units of their sizes, that are the same."""
_OFF = 1e-3
"""By how much an end that stays has to be off, in units of its size, to be refused."""
_BEYOND = 1.3
"""So much longer takes a way that is not at rest at its end."""
_EACH = 4
"""Of so many loops the one that misses the end least is taken."""
_PRIMES = (2, 3, 5, 7, 11, 13)
_SHAKES = (0.02, 0.5, 0.1, 1.5)
"""Of waves on the straight way, in turn."""


def guesses(problem: Problem, intervals: int) -> Iterator[CollocatedTrajectory]:
    """Motions to start from, without end: loops where σ is closed, else ways from start to end.

    Of loops the states follow from the rates; on ways they are joined by straight lines, unless constraints forbid it.

    :param problem: a relative one.
    """
    if problem.is_loop:
        return _loops(problem, intervals)
    return ((_constrained_way if problem.constrained else _way)(problem, intervals, k) for k in count())


def refuse_invariants(problem: Problem) -> None:
    """Refuse an end that stays as it is whatever is moved, as some motions show.

    :param problem: a relative one.
    :raises PlanError: naming it.
    """
    end, given = problem.end, set(problem.start.labels)
    started = {state for state in problem.states if state in given or state in problem.moves}
    if not end.labels or len(started) < len(problem.states):
        return
    values, spread, off = np.empty((len(end.labels), 0)), np.zeros(0), np.zeros(0)
    for k in range(1, 6):
        trajectory = _ellipse(problem, _FINE, k) if problem.is_loop else _drift(problem, k)
        values = np.hstack([values, np.array(end.function(trajectory.knots[:, -1]))])
        spread = np.ptp(values, axis=1)
        off = np.maximum(end.low - values.max(axis=1), values.min(axis=1) - end.high)
        if k > 1 and not ((spread < _ALIKE) & (off > _OFF)).any():
            return
    for i in np.flatnonzero((spread < _ALIKE) & (off > _OFF)):
        size, stays = end.sizes[i], round(float(values[i, 0]), 5) + 0.0
        required = float(np.clip(values[i, 0], end.low[i], end.high[i]) * size)
        how = " and comes back" if problem.is_loop else ""
        raise PlanError(
            f"{problem.name}: end: {end.labels[i]} = {required:.6g} cannot be reached: "
            f"however {', '.join(problem.moves)} moves{how}, it ends at {stays * size:.6g}"
        )


def _spread(k: int, dimension: int) -> float:
    """The k-th of numbers that fill (0, 1) evenly from the first on, in each dimension its own; J. H. Halton."""
    base, value, digit = _PRIMES[dimension % len(_PRIMES)], 0.0, 1.0
    while k > 0:
        digit /= base
        k, remainder = divmod(k, base)
        value += digit * remainder
    return value


def _blank(problem: Problem, intervals: int, k: int = 0) -> CollocatedTrajectory:
    """A motion that rests at the start.

    Where its duration is free, that of the k-th is the geometric mean at first, then all over the range.
    """
    low, high = problem.duration
    T = low + (high - low) * _spread(k, 0) if k > 0 else float(np.sqrt(max(low, 1e-3 * high) * high))
    knots, inner = (np.repeat(problem.initial_state[:, None], m, axis=1) for m in (intervals + 1, intervals * DEGREE))
    controls = np.zeros((len(problem.moves), intervals * DEGREE))
    return CollocatedTrajectory((Arc(intervals),), np.array([T]), knots, inner, controls)


def _way(problem: Problem, intervals: int, k: int) -> CollocatedTrajectory:
    """From start to end by straight lines; the later ones are shaken."""
    trajectory = _blank(problem, intervals, k)
    T, start, names = trajectory.durations[0], problem.initial_state, problem.states
    knots, points = trajectory.breaks / T, trajectory.instants / T
    axes = [i for i, name in enumerate(names) if name in Orientation.quaternion]
    change = np.array([problem.terminal_state.get(name, x) - x for name, x in zip(names, start, strict=True)])
    moves = {name: change[names.index(name)] for name in problem.moves if name in names}

    def states(u: Array) -> Array:
        rise, rate, _ = _smooth_step(u, T)
        x = start[:, None] + change[:, None] * rise
        if len(axes) == 4:  # all of them 0 where w alone is given as 0
            x[axes] /= np.maximum(np.linalg.norm(x[axes], axis=0), 1e-9)
        for name, by in moves.items():
            if f"{name}_dot" in names:
                x[names.index(f"{name}_dot")] = by * rate
        return x

    profile = _smooth_step(points, T)[problem.order]
    controls = np.array([moves.get(name, 0.0) * profile for name in problem.moves])
    if problem.order == 0:
        controls += problem.initial_sigma[:, None]
    rng = np.random.default_rng(k)
    size = _SHAKES[k % len(_SHAKES)] * (1 + np.abs(change).max()) / T**problem.order
    shake = size * np.array([_wave(rng, points) for _ in problem.moves])
    return replace(trajectory, knots=states(knots), inner=states(points), controls=controls + shake)


def _smooth_step(u: Any, T: float) -> tuple[Any, Any, Any]:
    """From 0 to 1 while u does, at rest at both ends; rate and acceleration [1/s, 1/s²] in the time T."""
    return u**3 * (10 - 15 * u + 6 * u**2), 30 * u**2 * (1 - u) ** 2 / T, 60 * u * (1 - u) * (1 - 2 * u) / T**2


def _wave(rng: np.random.Generator, u: Array) -> Array:
    a, b = rng.normal(size=(2, 3))
    k = np.pi * np.arange(1, 4)
    return a / k @ np.sin(np.outer(k, u)) + b / k @ np.cos(np.outer(k, u))


def _loops(problem: Problem, intervals: int) -> Iterator[CollocatedTrajectory]:
    """Circles and ellipses, with states that follow them: of some simple ones the best, then all over the ranges."""

    def miss(trajectory: CollocatedTrajectory) -> float:
        """By how much a motion misses the end, and its bounds."""
        missed = problem.end.violation(problem.end_values(trajectory.knots[:, -1]))
        beyond = problem.path.violation(trajectory.evaluate(problem.path.function))
        return float(np.linalg.norm(missed) + np.max(beyond, initial=0.0))

    yield min(_circles(problem, intervals), key=miss)
    if not _is_begun(problem):
        yield from _far_circles(problem, intervals)
    for k in count(1):
        yield min((_ellipse(problem, intervals, _EACH * k + i) for i in range(_EACH)), key=miss)


def _ranges(problem: Problem) -> tuple[Array, Array]:
    """Where what is moved may be: middles and half widths, of its bounds, else a half turn or so round the start."""
    start = problem.initial_state[problem.indices(problem.moves)]
    bounds = by_name(problem.path.labels, zip(problem.path.low, problem.path.high, strict=True))
    low, high = np.array([bounds.get(name, (-np.inf, np.inf)) for name in problem.moves]).T
    low = np.where(np.isfinite(low), low, np.minimum(start - np.pi, high - 2 * np.pi))
    high = np.where(np.isfinite(high), high, np.maximum(start + np.pi, low + 2 * np.pi))
    return (low + high) / 2, (high - low) / 2


def _is_begun(problem: Problem) -> bool:
    """Whether it is said where loops begin."""
    return set(problem.moves) <= set(problem.start.labels)


def _ellipse(problem: Problem, intervals: int, k: int) -> CollocatedTrajectory:
    c = len(problem.moves)
    u = np.array([[_spread(k, 1 + 3 * i + j) for j in range(3)] for i in range(c)])
    middles, widths = _ranges(problem)
    radii = widths * (0.1 + 0.7 * u[:, 1])
    centres = middles + (widths - radii) * (2 * u[:, 0] - 1)
    phases = 2 * np.pi * u[:, 2]
    if _is_begun(problem):
        centres = problem.initial_state[problem.indices(problem.moves)]
    else:
        phases -= np.angle(mixture(c) @ (radii * np.exp(1j * phases)))
    return _loop(problem, _blank(problem, intervals, k), centres, radii, phases)


def _far_circles(problem: Problem, intervals: int) -> Iterator[CollocatedTrajectory]:
    """Small and large ones, about what is opposite to the start and between, where joints may turn as they like."""
    middles, widths = _ranges(problem)
    widths = np.minimum(widths, np.pi)
    between = widths / 2 * (-1) ** np.arange(len(widths))
    for offset, radius, sense in ((widths, 0.16, 1), (-between, 0.45, -1), (widths, 0.8, -1), (between, 0.45, 1)):
        phases, extremal = _phases(sense, len(widths))
        centre = middles + np.where(widths < np.pi, 0, offset)
        yield _loop(problem, _blank(problem, intervals), centre, radius * widths, phases - extremal)


def _phases(sense: int, size: int) -> tuple[Array, float]:
    """Phases of circles, and that at which a weighted sum of them is extremal."""
    phases: Any = sense * np.pi / 2 * np.arange(size)
    return phases, float(np.angle(mixture(size) @ np.exp(1j * phases)))


def _circles(problem: Problem, intervals: int) -> Iterator[CollocatedTrajectory]:
    """Of several sizes and centres, round both ways."""
    trajectory, start = _blank(problem, intervals), problem.initial_state[problem.indices(problem.moves)]
    middles, _ = _ranges(problem)
    turns = np.array([np.pi / 2 * (-1) ** i for i in range(len(start))])
    is_begun = _is_begun(problem)
    for centre in [start] if is_begun else [start, middles, start + turns, start - turns]:
        for radius in (0.25, 0.5, 0.9, 1.4):
            for sense in (1, -1):
                phases, extremal = _phases(sense, len(start))
                for first in (0.0, np.pi / 2, np.pi, -np.pi / 2) if is_begun else (extremal,):
                    yield _loop(problem, trajectory, centre, np.full(len(start), radius), phases - first)


def _loop(
    problem: Problem, trajectory: CollocatedTrajectory, centre: Array, radius: Array, phases: Any
) -> CollocatedTrajectory:
    """One round of σ on an ellipse; through its centre where it has to begin there."""
    w, shift = 2 * np.pi / trajectory.durations[0], np.cos(phases) if _is_begun(problem) else 0.0

    def motion(t: float) -> tuple[Array, Array, Array]:
        angle = w * t - phases
        value = centre + radius * (np.cos(angle) - shift)
        return value, -radius * w * np.sin(angle), -radius * w**2 * np.cos(angle)

    return _followed(problem, trajectory, motion)


def _drift(problem: Problem, k: int) -> CollocatedTrajectory:
    """Some motion from the start, small or large, that ends anywhere, at any rate."""
    trajectory, change = _blank(problem, _FINE, k), np.random.default_rng(k).normal(size=len(problem.moves))
    return _waves(problem, trajectory, _BEYOND * trajectory.durations[0], 1 + k, 10.0 ** (k % 3) * change)


def _constrained_way(problem: Problem, intervals: int, k: int) -> CollocatedTrajectory:
    trajectory = _blank(problem, intervals, k)
    return _waves(problem, trajectory, trajectory.durations[0], k)


def _waves(
    problem: Problem, trajectory: CollocatedTrajectory, T: float, k: int, by: Array | None = None
) -> CollocatedTrajectory:
    """From start to end of σ, or by a change, in the time T, at rest then; the k-th with waves on it."""
    start = by_name(problem.states, problem.initial_state)
    sigma = zip(problem.moves, problem.initial_sigma, strict=True)
    begin = {name: start.get(name, value) for name, value in sigma}
    first = np.array([*begin.values()])
    way = np.array([problem.terminal_state.get(name, x) for name, x in begin.items()]) - first
    size = _SHAKES[k % len(_SHAKES)] * (1 + np.abs(way).max())
    waves = size * np.random.default_rng(k).normal(size=(way.size, 3)) / np.arange(1, 4) ** 2
    way, w = way if by is None else by, 2 * np.pi * np.arange(1, 4) / T

    def motion(t: float) -> tuple[Array, Array, Array]:
        rise, rate, acceleration = (way * x for x in _smooth_step(t / T, T))
        value = first + rise + waves @ (1 - np.cos(w * t))
        return value, rate + waves @ (w * np.sin(w * t)), acceleration + waves @ (w**2 * np.cos(w * t))

    return _followed(problem, trajectory, motion)


def _followed(
    problem: Problem, trajectory: CollocatedTrajectory, motion: Callable[[float], tuple[Array, Array, Array]]
) -> CollocatedTrajectory:
    """States along a motion of σ, by Runge and Kutta's method through all points."""
    times = np.unique(np.concatenate([trajectory.breaks, trajectory.instants]))
    names = [(name, n, i) for i, move in enumerate(problem.moves) for n, name in enumerate(motion_names(move))]
    indices = [(problem.states.index(name), n, i) for name, n, i in names if name in problem.states]

    def put(x: Array, t: float) -> tuple[Array, Array]:
        sigma, x = motion(t), x.copy()
        for index, n, i in indices:
            x[index] = sigma[n][i]
        return x, sigma[problem.order]

    def slope(x: Array, t: float) -> Array:
        return np.array(problem.rates(*put(x, t))).ravel()

    states = {0.0: put(problem.initial_state, 0.0)[0]}
    for t, after in pairwise(times):
        x, h = states[t], after - t
        k1 = slope(x, t)
        k2 = slope(x + h / 2 * k1, t + h / 2)
        states[after] = put(x + h * slope(x + h / 2 * k2, t + h / 2), after)[0]
    knots, inner = (np.array([states[t] for t in ts]).T for ts in (trajectory.breaks, trajectory.instants))
    controls = np.array([motion(t)[problem.order] for t in trajectory.instants]).T
    return replace(trajectory, knots=knots, inner=inner, controls=controls)
