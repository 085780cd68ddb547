"""Values at which a closed form is compared with the equations, and what it gives there."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass
from functools import cached_property
from time import perf_counter
from typing import final

import numpy as np
from numpy.typing import NDArray

from liaisons.closed_forms import ClosedForm
from liaisons.errors import LiaisonsError, ValidityError
from liaisons_motion.examination.motions import EquationsOfMotion, Motion

POINTS = 24
"""Times at which a motion is compared."""
_UNCERTAIN = 1e-4
"""Bound of the integration's error, relative to size, from which on a motion is no longer compared."""
_FEWEST = 4
"""Fewest times that are compared."""


@final
@dataclass(frozen=True)
class Trial:
    """Values by name that a closed form covers, its solution there, and the motion by the equations."""

    values: Mapping[str, float]
    solution: Motion
    motion: Motion
    bounds: Motion

    def differences(self, solution: Motion | None = None, motion: Motion | None = None) -> dict[str, float]:
        """Largest difference of each variable, relative to what rounding and integration allow: above 1 is wrong.

        :param solution: another solution in place of the closed form's, ``motion`` another motion.
        """
        solution = self.solution if solution is None else solution
        motion, ratios = self.motion if motion is None else motion, dict[str, float]()
        for name, exact in solution.items():
            size = max(float(np.max(np.abs(exact), initial=0.0, where=np.isfinite(exact))), self.sizes[name], 1e-3)
            bounds = np.maximum.accumulate(self.bounds[name])
            certain = bounds < _UNCERTAIN * size
            if np.count_nonzero(certain) >= _FEWEST:
                with np.errstate(all="ignore"):
                    errors = np.abs(motion[name] - exact)[certain] / (1e-8 * size + 10 * bounds[certain])
                ratios[name] = float(np.max(np.nan_to_num(errors, nan=np.inf)))
        return ratios

    def until(self, count: int) -> Trial:
        """The same trial at its first times."""
        parts = (self.solution, self.motion, self.bounds)
        return Trial(self.values, *({name: row[:count] for name, row in part.items()} for part in parts))

    @cached_property
    def sizes(self) -> Mapping[str, float]:
        """Largest value of each output while the motion is certain."""
        return {
            name: float(np.max(np.abs(values), initial=0.0, where=np.isfinite(values)))
            for name, values in self.motion.items()
        }


def times_of(equations: EquationsOfMotion) -> NDArray:
    """Times of a comparison: a fifth of the default experiment, not evenly spaced."""
    end = equations.model.experiment.stop_time / 5
    return end * np.linspace(0.0, 1.0, POINTS) ** 1.2


def solution_of(closed: ClosedForm, values: Mapping[str, float], declared: Mapping[str, float], t: NDArray) -> Motion:
    """Solution of a closed form at values, those that differ from the declared ones by name.

    :raises ValidityError: if it does not cover them.
    :raises TypeError: if it returns no arrays of the shape of t by name.
    """
    changed = {name: value for name, value in values.items() if value != declared[name]}
    with np.errstate(all="ignore"):
        solution = closed(t, **changed)
    if not isinstance(solution, Mapping) or not solution:
        what = "nothing" if solution is None or isinstance(solution, Mapping) else type(solution).__name__
        raise TypeError(f"it returns {what}; return arrays by the names of variables")
    arrays = dict[str, NDArray]()
    for name, value in solution.items():
        array = np.asarray(value, dtype=float)
        arrays |= {name: array} if array.ndim < 2 else {f"{name}[{k + 1}]": row for k, row in enumerate(array.T)}
    if wrong := [name for name, value in arrays.items() if value.shape != t.shape]:
        raise TypeError(f"{wrong[0]} has the shape {arrays[wrong[0]].shape} at times of the shape {t.shape}")
    return arrays


def trials_of(
    equations: EquationsOfMotion, closed: ClosedForm, seed: int, count: int, end: float = math.inf
) -> Iterator[Trial]:
    """Trials at values that are declared, and at others that the closed form covers as well.

    :param end: value of ``perf_counter`` after which no further one begins.
    :raises Exception: whatever the closed form raises at the declared values.
    """
    t, random, declared = times_of(equations), np.random.default_rng(seed), equations.declared
    values, first = _first_covered(equations, closed, t)
    if unknown := [name for name in first if name not in equations.outputs]:
        raise TypeError(f"it gives {unknown[0]}, which is no output of the component")
    yield _trial(equations, values, first, t)
    distances = equations.distances(values)
    limits = np.minimum(distances, distances / 2)  # no nearer to where a condition fails
    for _ in range(count):
        other, solution = dict(values), first
        for name in random.permutation(sorted(values)).tolist():
            value = _other_value(equations, name, values[name], random)
            if perf_counter() > end:
                return
            try:
                candidate = solution_of(closed, other | {name: value}, declared, t)
            except LiaisonsError:
                continue
            is_inside = not np.any(equations.distances(other | {name: value}) < limits)
            if is_inside and all(np.all(np.isfinite(value)) for value in candidate.values()):
                other[name], solution = value, candidate
        if _starts_as_told(trial := _trial(equations, other, solution, t)):
            yield trial


def _first_covered(equations: EquationsOfMotion, closed: ClosedForm, t: NDArray) -> tuple[Mapping[str, float], Motion]:
    """Values of the default experiment, without accelerations or as declared if the closed form covers no others."""
    declared, values = equations.declared, equations.values
    even = {name: declared[name] if name.endswith("_ddot") else value for name, value in values.items()}
    for candidate in (values, even):
        with suppress(ValidityError):
            return candidate, solution_of(closed, candidate, declared, t)
    return declared, solution_of(closed, declared, declared, t)


def _trial(equations: EquationsOfMotion, values: Mapping[str, float], solution: Motion, t: NDArray) -> Trial:
    return Trial(dict(values), solution, *equations.motion(values, t))


def _other_value(equations: EquationsOfMotion, name: str, value: float, random: np.random.Generator) -> float:
    """Another value in the variable's domain."""
    variable = equations.variables[name]
    size = abs(value) or abs(variable.nominal or 1.0)
    for _ in range(20):
        other = value * random.uniform(0.7, 1.4) if value else size * random.uniform(-0.5, 0.5)
        if variable.allows(other):
            return float(other)
    return value


def _starts_as_told(trial: Trial) -> bool:
    """Whether the motion begins at the start values, which constraints may not allow."""
    told = {name.removesuffix("_0"): value for name, value in trial.values.items() if name.endswith("_0")}
    kept = [(trial.motion[name][0], value) for name, value in told.items() if name in trial.motion]
    return all(abs(start - value) < 1e-9 * max(1.0, abs(value)) for start, value in kept)
