"""What a plan starts from: motions that need no thought, those that miss the end least first."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from liaisons.language import Orientation
from liaisons.operators.problems import Problem
from liaisons.operators.transcription import DEGREE, Arc, Track, mixture

Array = NDArray[np.float64]


def guesses(problem: Problem, intervals: int, count: int) -> list[Track]:
    """So many motions to start from, the best one first: loops where σ is closed, else ways from start to end.

    Of loops the states follow from the rates; on ways they are joined by straight lines, unless constraints forbid it.
    """
    if _is_loop(problem):
        return sorted(_loops(problem, intervals), key=lambda track: _miss(problem, track))[:count]
    if not problem.constrained:
        return list(_ways(problem, intervals, count))
    track, _, _ = _blank(problem, intervals)
    return [_followed(problem, track, _Way(problem, track.durations[0], k)) for k in range(count)]


def duration_of(problem: Problem) -> float:
    """Where nothing is known of it: a second, if it may be."""
    low, high = problem.duration
    if low == high:
        return low
    return float(np.clip(1.0 if not np.isfinite(high) else np.sqrt(max(low, 1e-3 * high) * high), low, high))


def _is_loop(problem: Problem) -> bool:
    closed = {problem.states[i] for i in problem.closed}
    return bool(closed) and set(problem.moves) <= closed


def _blank(problem: Problem, intervals: int) -> tuple[Track, Array, Array]:
    """A motion that rests at the start, and where the knots and collocation points lie between 0 and 1."""
    m, n, c = intervals, len(problem.states), len(problem.moves)
    durations = np.array([duration_of(problem)])
    rest = np.repeat(problem.at_start[:, None], m * DEGREE + m + 1, axis=1)
    track = Track((Arc(m),), durations, rest[:, : m + 1], rest[:, m + 1 :], np.zeros((c, m * DEGREE)))
    assert track.knots.shape == (n, m + 1)
    return track, track.breaks / durations[0], track.instants / durations[0]


def _ways(problem: Problem, intervals: int, count: int) -> Iterator[Track]:
    """From start to end; the later ones are shaken."""
    track, knots, points = _blank(problem, intervals)
    T = track.durations[0]
    turned = [i for i, name in enumerate(problem.states) if name in Orientation.quaternion]
    way = np.array([problem.aims.get(name, x) - x for name, x in zip(problem.states, problem.at_start, strict=True)])

    def smooth(u: Array) -> tuple[Array, Array, Array]:
        return u**3 * (10 - 15 * u + 6 * u**2), 30 * u**2 * (1 - u) ** 2 / T, 60 * u * (1 - u) * (1 - 2 * u) / T**2

    def states(u: Array) -> Array:
        rise, rate, _ = smooth(u)
        found = problem.at_start[:, None] + way[:, None] * rise
        if len(turned) == 4:  # all of them 0 where w alone is given as 0
            found[turned] /= np.maximum(np.linalg.norm(found[turned], axis=0), 1e-9)
        for name in problem.moves:
            if f"{name}_dot" in problem.states and name in problem.states:
                found[problem.states.index(f"{name}_dot")] = way[problem.states.index(name)] * rate
        return found

    controls = np.zeros((len(problem.moves), points.size))
    for i, name in enumerate(problem.moves):
        if name in problem.states:
            controls[i] = way[problem.states.index(name)] * smooth(points)[problem.order]
        elif problem.order == 0:
            controls[i] = problem.rest[i]
    for k in range(count):
        rng = np.random.default_rng(k)
        size = (0.02 if k == 0 else 0.5) * (1 + np.abs(way).max()) / T**problem.order
        shake = size * np.array([_wave(rng, points) for _ in problem.moves])
        yield Track(track.arcs, track.durations, states(knots), states(points), controls + shake)


def _wave(rng: np.random.Generator, u: Array) -> Array:
    a, b = rng.normal(size=(2, 3))
    k = np.pi * np.arange(1, 4)[:, None]
    return (a / k.ravel()) @ np.sin(k * u) + (b / k.ravel()) @ np.cos(k * u)


def _loops(problem: Problem, intervals: int) -> Iterator[Track]:
    """Circles and ellipses of several sizes and centres, round both ways, with states that follow them."""
    track, _, _ = _blank(problem, intervals)
    T = track.durations[0]
    places = [problem.states.index(name) for name in problem.moves]
    bounds = dict(zip(problem.path.labels, zip(problem.path.low, problem.path.high, strict=True), strict=True))
    start = problem.at_start[places]
    middles = np.array([np.mean(bounds.get(name, (s, s))) for name, s in zip(problem.moves, start, strict=True)])
    middles = np.where(np.isfinite(middles), middles, start)
    turns = np.array([np.pi / 2 * (-1) ** i for i in range(len(places))])
    begins = "start" if set(problem.moves) <= set(problem.start.labels) else "free"
    centres = [start] if begins == "start" else [start, middles, start + turns, start - turns]
    for centre in centres:
        for radius in (0.25, 0.5, 0.9, 1.4):
            for way in (1, -1):
                phases = way * np.pi / 2 * np.arange(len(places))
                extremal = np.angle(mixture(len(places)) @ np.exp(1j * phases))
                for first in (extremal,) if begins == "free" else (0.0, np.pi / 2, np.pi, -np.pi / 2):
                    shape = _Loop(centre, radius, phases - first, begins == "start", T)
                    yield _followed(problem, track, shape)


class _Loop:
    """σ on an ellipse: one round in the time T; through its centre where it has to begin there."""

    def __init__(self, centre: Array, radius: float, phases: Any, through: bool, T: float) -> None:
        self.centre, self.radius, self.phases, self.rate = centre, radius, phases, 2 * np.pi / T
        self.shift = np.cos(phases) if through else np.zeros(len(phases))

    def __call__(self, t: float) -> tuple[Array, Array, Array]:
        angle, w = self.rate * t - self.phases, self.rate
        value = self.centre + self.radius * (np.cos(angle) - self.shift)
        return value, -self.radius * w * np.sin(angle), -self.radius * w**2 * np.cos(angle)


class _Way:
    """σ from start to end, at rest there; the k-th with waves on it."""

    def __init__(self, problem: Problem, T: float, k: int) -> None:
        at = {name: (x, problem.aims.get(name, x)) for name, x in zip(problem.states, problem.at_start, strict=True)}
        ends = [at.get(name, (rest, rest)) for name, rest in zip(problem.moves, problem.rest, strict=True)]
        self.begin, self.way, self.T = np.array([a for a, _ in ends]), np.array([b - a for a, b in ends]), T
        size = (0.02 if k == 0 else 0.3) * (1 + np.abs(self.way).max())
        self.waves = size * np.random.default_rng(k).normal(size=(len(ends), 3)) / np.arange(1, 4) ** 2

    def __call__(self, t: float) -> tuple[Array, Array, Array]:
        u, w = t / self.T, 2 * np.pi * np.arange(1, 4) / self.T
        value = self.begin + self.way * u**3 * (10 - 15 * u + 6 * u**2) + self.waves @ (1 - np.cos(w * t))
        rate = self.way * 30 * u**2 * (1 - u) ** 2 / self.T + self.waves @ (w * np.sin(w * t))
        return value, rate, self.way * 60 * u * (1 - u) * (1 - 2 * u) / self.T**2 + self.waves @ (w**2 * np.cos(w * t))


def _followed(problem: Problem, track: Track, motion: _Loop | _Way) -> Track:
    """States along a motion of σ, by Runge and Kutta's method through all points."""
    times = np.unique(np.concatenate([track.breaks, track.instants]))
    given = [(f"{name}{end}", n, i) for i, name in enumerate(problem.moves) for n, end in enumerate(("", "_dot"))]
    places = [(problem.states.index(name), n, i) for name, n, i in given if name in problem.states]

    def put(x: Array, t: float) -> tuple[Array, Array]:
        sigma = motion(t)
        x = x.copy()
        for place, n, i in places:
            x[place] = sigma[n][i]
        return x, sigma[problem.order]

    def slope(x: Array, t: float) -> Array:
        return np.array(problem.rates(*put(x, t))).ravel()

    x, found = put(problem.at_start, 0.0)[0], {0.0: put(problem.at_start, 0.0)[0]}
    for t, after in pairwise(times):
        h = after - t
        k1 = slope(x, t)
        k2 = slope(x + h / 2 * k1, t + h / 2)
        x = put(x + h * slope(x + h / 2 * k2, t + h / 2), after)[0]
        found[after] = x
    knots = np.array([found[t] for t in track.breaks]).T
    inner = np.array([found[t] for t in track.instants]).T
    controls = np.array([put(x, t)[1] for t, x in zip(track.instants, inner.T, strict=True)]).T
    return Track(track.arcs, track.durations, knots, inner, controls)


def _miss(problem: Problem, track: Track) -> float:
    """By how much a motion misses the end, and its bounds."""
    end = np.array(problem.end.function(track.knots[:, -1])).ravel()
    missed = np.maximum(problem.end.low - end, end - problem.end.high).clip(0)
    if not problem.path.labels:
        return float(np.linalg.norm(missed))
    way = np.array(problem.path.function.map(track.inner.shape[1])(track.inner, track.controls))
    beyond = np.maximum(problem.path.low[:, None] - way, way - problem.path.high[:, None]).clip(0)
    return float(np.linalg.norm(missed) + np.max(beyond, initial=0.0))
