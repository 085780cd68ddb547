"""Starts of the search: simple motions, those that miss the end least first."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from itertools import count, pairwise, product
from typing import Any

import numpy as np

from liaisons.base.array_names import by_name
from liaisons.base.arrays import Floats
from liaisons.base.port_names import port_names
from liaisons.language import Orientation
from liaisons_motion.planning.problems import Problem
from liaisons_motion.planning.transcription import DEGREE, Arc, CollocatedTrajectory, anchor_weights

_EXTENSION = 1.3
"""Duration of a way that ends in motion, relative to that of the motion: it is cut off before it comes to rest."""
_LOOPS_TRIED = 4
"""Number of loops of which the one that misses the end least becomes a start."""
_DIRECTIONS = (4, 5, 6)
"""Directions of far motions."""
_REACHES = (1.0, 3.0, 10.0, 30.0)
"""Distances of far motions, in units of sizes."""
_PARTS = (0.4, 0.5, 0.6, 0.7, 0.8, 0.9)
"""Parts of these distances that are tried."""
_PRIMES = (2, 3, 5, 7, 11, 13)
_AMPLITUDES = (0.02, 0.5, 0.1, 1.5)
"""Amplitudes of the waves on successive ways."""


def guesses(problem: Problem, intervals: int) -> Iterator[CollocatedTrajectory]:
    """Endless series of starting trajectories: loops if σ is closed, else transfers from start to end.

    The states of loops, and of ways under constraints, are integrated; other ways are straight lines.

    :param problem: in relative units.
    """
    if problem.phases:
        return _phased_guesses(problem, intervals)
    if problem.is_loop:
        return _closed_guesses(problem, intervals)
    return (
        (_integrated_transfer if problem.constrained else _straight_transfer)(problem, intervals, k) for k in count()
    )


def _phased_guesses(problem: Problem, intervals: int) -> Iterator[CollocatedTrajectory]:
    """Endless series of straight lines from start to end through all phases, whose durations vary."""
    ranges = np.array([phase.duration for phase in problem.phases])
    arcs = (Arc(max(3, -(-intervals // len(ranges)))),) * len(ranges)
    for k in count():
        trajectory = _straight_transfer(problem, intervals, k)
        shares = np.array([0.2 + _halton(k, 1 + i) for i in range(len(ranges))])
        yield trajectory.interpolated(arcs, (trajectory.durations * shares / shares.sum()).clip(*ranges.T))


def arbitrary_motion(problem: Problem, intervals: int, k: int, reach: float) -> CollocatedTrajectory:
    """The k-th motion of σ with integrated states: a loop, or a way that goes so far in some direction."""
    if problem.is_loop:
        return _halton_ellipse(problem, intervals, k)
    return _integrated_transfer(problem, intervals, k, reach)


def far_guesses(problem: Problem, intervals: int) -> Iterator[CollocatedTrajectory]:
    """Starts where all others fail: of motions near and far, those that miss the end least.

    What σ does may begin behind a gap.
    """

    def miss(trajectory: CollocatedTrajectory) -> float:
        """Norm of the violation of the end; infinite where the motion is not finite."""
        missed = problem.end.violation(problem.end_values(trajectory.knots[:, -1]))
        return float(np.nan_to_num(np.linalg.norm(missed), nan=np.inf))

    keys = [(k, sign * reach) for k in _DIRECTIONS for reach in _REACHES for sign in (1, -1)]
    motions = {key: arbitrary_motion(problem, intervals, *key) for key in keys}
    for k, reach in sorted(keys, key=lambda key: miss(motions[key]))[:2]:
        motions |= {(k, reach * part): arbitrary_motion(problem, intervals, k, reach * part) for part in _PARTS}
    yield from sorted(motions.values(), key=miss)[:2]


def _halton(k: int, dimension: int) -> float:
    """The k-th number in (0, 1) of Halton's low-discrepancy sequence, in a dimension counted from 0."""
    base, value, digit = _PRIMES[dimension % len(_PRIMES)], 0.0, 1.0
    while k > 0:
        digit /= base
        k, remainder = divmod(k, base)
        value += digit * remainder
    return value


def _trajectory_at_rest(problem: Problem, intervals: int, k: int = 0) -> CollocatedTrajectory:
    """The trajectory that rests at the start.

    A free duration is the geometric mean of its range for k = 0, else spread over the range.
    """
    low, high = problem.duration
    T = low + (high - low) * _halton(k, 0) if k > 0 else float(np.sqrt(max(low, 1e-3 * high) * high))
    knots, inner = (np.repeat(problem.initial_state[:, None], m, axis=1) for m in (intervals + 1, intervals * DEGREE))
    controls = np.zeros((len(problem.controls), intervals * DEGREE))
    return CollocatedTrajectory((Arc(intervals),), np.array([T]), knots, inner, controls)


def _straight_transfer(problem: Problem, intervals: int, k: int) -> CollocatedTrajectory:
    """The trajectory along straight lines from start to end, with the k-th random waves on its controls."""
    trajectory = _trajectory_at_rest(problem, intervals, k)
    T, start, names = trajectory.durations[0], problem.initial_state, problem.states
    knots, points = trajectory.breaks / T, trajectory.instants / T
    axes = [i for i, name in enumerate(names) if name.endswith(Orientation.quaternion)]
    change = np.array([problem.terminal_state.get(name, x) - x for name, x in zip(names, start, strict=True)])
    moves = {name: change[names.index(name)] for name in problem.moves if name in names}

    def states(u: Floats) -> Floats:
        """States (states, times) at fractions u of the duration."""
        rise, rate, _ = _smooth_step(u, T)
        x = start[:, None] + change[:, None] * rise
        for four in zip(*[iter(axes)] * 4, strict=True):  # all of them 0 where w alone is given as 0
            x[[*four]] /= np.maximum(np.linalg.norm(x[[*four]], axis=0), 1e-9)
        for name, by in moves.items():
            if f"{name}_dot" in names:
                x[names.index(f"{name}_dot")] = by * rate
        return x

    profile = _smooth_step(points, T)[problem.control_order]
    controls = np.array([moves.get(name, 0.0) * profile for name in (*problem.moves, *problem.forces)])
    if problem.control_order == 0:
        controls[: len(problem.moves)] += problem.initial_sigma[:, None]
    size = _AMPLITUDES[k % len(_AMPLITUDES)] * (1 + np.abs(change).max()) / T**problem.control_order
    w = np.pi * np.arange(1, 4)[:, None]
    sines, cosines = np.random.default_rng(k).normal(size=(len(controls), 2, 3)).swapaxes(0, 1) / w.T
    shake = size * (sines @ np.sin(w * points) + cosines @ np.cos(w * points))
    return replace(trajectory, knots=states(knots), inner=states(points), controls=controls + shake)


def _smooth_step(u: Any, T: float) -> tuple[Any, Any, Any]:
    """Value, rate [1/s] and acceleration [1/s²] of the quintic from 0 to 1 that rests at both ends."""
    return u**3 * (10 - 15 * u + 6 * u**2), 30 * u**2 * (1 - u) ** 2 / T, 60 * u * (1 - u) * (1 - 2 * u) / T**2


def _closed_guesses(problem: Problem, intervals: int) -> Iterator[CollocatedTrajectory]:
    """Endless series of loops with integrated states: the best of simple circles, then ellipses of all kinds."""

    def miss(trajectory: CollocatedTrajectory) -> float:
        """Norm of the violation of the end, and greatest violation of the bounds."""
        missed = problem.end.violation(problem.end_values(trajectory.knots[:, -1]))
        beyond = problem.path.violation(trajectory.evaluate(problem.path.function))
        return float(np.linalg.norm(missed) + np.max(beyond, initial=0.0))

    yield min(_simple_circles(problem, intervals), key=miss)
    if not _has_sigma_start(problem):
        yield from _circles_about_opposite_shapes(problem, intervals)
    for k in count(1):
        yield min((_halton_ellipse(problem, intervals, _LOOPS_TRIED * k + i) for i in range(_LOOPS_TRIED)), key=miss)


def _sigma_ranges(problem: Problem) -> tuple[Floats, Floats]:
    """Middles and half widths of the bounds of σ, or of half a turn to both sides of the start."""
    start = problem.initial_state[problem.indices(problem.moves)]
    bounds = by_name(problem.path.labels, zip(problem.path.low, problem.path.high, strict=True))
    low, high = np.array([bounds.get(name, (-np.inf, np.inf)) for name in problem.moves]).T
    low = np.where(np.isfinite(low), low, np.minimum(start - np.pi, high - 2 * np.pi))
    high = np.where(np.isfinite(high), high, np.maximum(start + np.pi, low + 2 * np.pi))
    return (low + high) / 2, (high - low) / 2


def _has_sigma_start(problem: Problem) -> bool:
    """Whether the goal has values of all σ at the start."""
    return set(problem.moves) <= set(problem.start.labels)


def _halton_ellipse(problem: Problem, intervals: int, k: int) -> CollocatedTrajectory:
    """The k-th of a series of ellipses that fill the ranges of σ."""
    c = len(problem.moves)
    u = np.array([[_halton(k, 1 + 3 * i + j) for j in range(3)] for i in range(c)])
    middles, widths = _sigma_ranges(problem)
    radii = widths * (0.1 + 0.7 * u[:, 1])
    centres = middles + (widths - radii) * (2 * u[:, 0] - 1)
    phases = 2 * np.pi * u[:, 2]
    if _has_sigma_start(problem):
        centres = problem.initial_state[problem.indices(problem.moves)]
    return _ellipse(problem, _trajectory_at_rest(problem, intervals, k), centres, radii, phases)


def _circles_about_opposite_shapes(problem: Problem, intervals: int) -> Iterator[CollocatedTrajectory]:
    """Small and large circles of σ half a turn or a quarter from the start, for joints that turn freely."""
    middles, widths = _sigma_ranges(problem)
    widths = np.minimum(widths, np.pi)
    between = widths / 2 * (-1) ** np.arange(len(widths))
    for offset, radius, sense in ((widths, 0.16, 1), (-between, 0.45, -1), (widths, 0.8, -1), (between, 0.45, 1)):
        phases, centre = sense * np.pi / 2 * np.arange(len(widths)), middles + np.where(widths < np.pi, 0, offset)
        yield _ellipse(problem, _trajectory_at_rest(problem, intervals), centre, radius * widths, phases)


def _simple_circles(problem: Problem, intervals: int) -> Iterator[CollocatedTrajectory]:
    """Circles of σ of several sizes and centres, in both senses."""
    trajectory, start = _trajectory_at_rest(problem, intervals), problem.initial_state[problem.indices(problem.moves)]
    middles, _ = _sigma_ranges(problem)
    turns = np.array([np.pi / 2 * (-1) ** i for i in range(len(start))])
    centres, begins = [start, middles, start + turns, start - turns], [0.0]
    if _has_sigma_start(problem):
        centres, begins = [start], [0.0, np.pi / 2, np.pi, -np.pi / 2]
    for centre, radius, sense, begin in product(centres, (0.25, 0.5, 0.9, 1.4), (1, -1), begins):
        phases = sense * np.pi / 2 * np.arange(len(start)) - begin
        yield _ellipse(problem, trajectory, centre, np.full(len(start), radius), phases)


def _ellipse(
    problem: Problem, trajectory: CollocatedTrajectory, centre: Floats, radius: Floats, phases: Any
) -> CollocatedTrajectory:
    """The trajectory of one round of σ on an ellipse, with integrated states.

    It starts where a weighted sum of σ is extremal; at ``centre``, if the goal has values of σ at the start.
    """
    w, shift = 2 * np.pi / trajectory.durations[0], 0.0
    if _has_sigma_start(problem):
        shift = np.cos(phases)
    else:
        phases = phases - np.angle(anchor_weights(len(phases)) @ (radius * np.exp(1j * phases)))

    def motion(t: float) -> tuple[Floats, Floats, Floats]:
        """σ, σ̇ and σ̈ at a time."""
        angle = w * t - phases
        value = centre + radius * (np.cos(angle) - shift)
        return value, -radius * w * np.sin(angle), -radius * w**2 * np.cos(angle)

    return _with_integrated_states(problem, trajectory, motion)


def _integrated_transfer(problem: Problem, intervals: int, k: int, reach: float | None = None) -> CollocatedTrajectory:
    """A motion of σ from start to end with the k-th waves, and integrated states.

    :param reach: distance to which it goes in the k-th direction, where it ends in motion; to the end unless given.
    """
    trajectory, rng = _trajectory_at_rest(problem, intervals, k), np.random.default_rng(k)
    start = by_name(problem.states, problem.initial_state)
    sigma = zip(problem.moves, problem.initial_sigma, strict=True)
    begin = {name: start.get(name, value) for name, value in sigma}
    first = np.array([*begin.values()])
    change = np.array([problem.terminal_state.get(name, x) for name, x in begin.items()]) - first
    size = _AMPLITUDES[k % len(_AMPLITUDES)] * (1 + np.abs(change).max(initial=0.0))
    waves = size * rng.normal(size=(change.size, 3)) / np.arange(1, 4) ** 2
    T = trajectory.durations[0]
    if reach is not None:
        change, T = reach * rng.normal(size=change.size), _EXTENSION * T
    of_forces = (reach or size) * rng.normal(size=(len(problem.forces), 3))
    w = 2 * np.pi * np.arange(1, 4) / T

    def motion(t: float) -> tuple[Floats, Floats, Floats]:
        """σ, σ̇ and σ̈ at a time."""
        rise, rate, acceleration = (change * x for x in _smooth_step(t / T, T))
        value = first + rise + waves @ (1 - np.cos(w * t))
        return value, rate + waves @ (w * np.sin(w * t)), acceleration + waves @ (w**2 * np.cos(w * t))

    return _with_integrated_states(problem, trajectory, motion, lambda t: of_forces @ np.sin(w * t))


def _with_integrated_states(
    problem: Problem,
    trajectory: CollocatedTrajectory,
    motion: Callable[[float], tuple[Floats, Floats, Floats]],
    forces: Callable[[float], Floats] | None = None,
) -> CollocatedTrajectory:
    """The trajectory with this motion of σ, and states integrated by the midpoint rule from point to point.

    :param forces: function of time; 0 unless given.
    """
    times = np.unique(np.concatenate([trajectory.breaks, trajectory.instants]))
    names = [(name, n, i) for i, move in enumerate(problem.moves) for n, name in enumerate(port_names(move)[:3])]
    still = np.zeros(len(problem.forces))
    indices = [(problem.states.index(name), n, i) for name, n, i in names if name in problem.states]

    def state_and_controls(x: Floats, t: float) -> tuple[Floats, Floats]:
        """The state x with σ and σ̇ of the motion, and the controls."""
        sigma, x = motion(t), x.copy()
        for index, n, i in indices:
            x[index] = sigma[n][i]
        return x, np.append(sigma[problem.control_order], forces(t) if forces else still)

    def slope(x: Floats, t: float) -> Floats:
        """Rates of the state x."""
        return np.array(problem.rates(*state_and_controls(x, t))).ravel()

    states = {0.0: state_and_controls(problem.initial_state, 0.0)[0]}
    for t, after in pairwise(times):
        x, h = states[t], after - t
        k1 = slope(x, t)
        k2 = slope(x + h / 2 * k1, t + h / 2)
        states[after] = state_and_controls(x + h * slope(x + h / 2 * k2, t + h / 2), after)[0]
    knots, inner = (np.array([states[t] for t in ts]).T for ts in (trajectory.breaks, trajectory.instants))
    controls = np.array([state_and_controls(problem.initial_state, t)[1] for t in trajectory.instants]).T
    return replace(trajectory, knots=knots, inner=inner, controls=controls)
