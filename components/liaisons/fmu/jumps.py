"""What a jump of a prescribed coordinate does: the limit of an ever faster straight motion, where there is one.

While σ goes the way δ in a time ε, at a constant rate δ/ε, states move by y' = f(y, σ, σ̇).  Where f is linear in σ̇
this has a limit for ε → 0, in which everything but σ̇ has no time to act (the horizontal lift of M 3.6, 7)::

    dy/dτ = f(y, σ + τ δ, σ̇ + δ) - f(y, σ + τ δ, σ̇),    0 <= τ <= 1

Of a mechanism f is x' = A⁻¹ (p - B σ̇), p' = ∂L/∂x + Q, whose term of second order in σ̇ is ½ σ̇ᵀ (∂Θ/∂x) σ̇: the
effective mass Θ (M eq. 50) must not depend on x, that is the vector field -X_K of M eq. 52 must vanish.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from liaisons.fmu.dependencies import coupled, shown_states
from liaisons.language import Variable
from liaisons.mechanics.model import Model

_SAMPLES, _TRIES = 6, 60
_MOST = 64
"""Prescribed numbers beyond which their pairs are not looked at: there are too many."""

_NOTHING = 1e-9
"""Differences of rates are rounding errors below this part of the rates."""


@dataclass(frozen=True, eq=False)
class Jumps:
    """What jumps of a numbers that an operator prescribes do to the first `coupled` states."""

    moves: NDArray[np.bool_]  # (a,) a jump of this one moves states, also where all others rest
    mixes: NDArray[np.bool_]  # (a, a) both rates are factors of a term of the rates of states; of one: its square
    moved: NDArray[np.bool_]  # (states,) may move in a jump that has a limit

    @property
    def limited(self) -> NDArray[np.bool_]:
        """Which of them can jump alone as the limit of a fast motion; (a,)."""
        return ~np.diag(self.mixes)

    @property
    def any(self) -> bool:
        """Whether some jump moves states."""
        alone = self.limited
        return bool(alone.any() and np.any(alone & (self.moves | self.mixes.any(axis=1))))


@lru_cache(maxsize=4)  # the FMUs of one component are built one after the other
def jump_effects(model: Model) -> Jumps:
    """Find out what jumps of prescribed coordinates do, from rates at seeded random states.

    Structure would not do: a term that cancels is there, too.
    """
    places = _active_places(model)
    a, states = len(places), model.start.numel_out(0)
    moves, moved = np.zeros(a, dtype=bool), np.zeros(states, dtype=bool)
    unknown = Jumps(moves, np.broadcast_to(True, (a, a)), moved)
    if a > _MOST:
        return unknown
    mixes, size = np.zeros((a, a), dtype=bool), coupled(model) if a else 0
    samples = [_Rates(model, sample, size) for sample in _samples(model)] if a else []
    if a and len(samples) < _SAMPLES:
        return unknown
    rates, accelerations = ([place[i] for place in places] for i in (1, 2))
    for found in samples:
        for i in range(a):
            moves[i] |= found.differ([rates[i]], at_rest=rates).any()
            # On accelerations rates depend where these make constraint forces: momenta are no states of motion then.
            mixes[i, i] |= found.curve(rates[i]) or found.differ([accelerations[i]]).any()
            for j in range(i):
                mixes[i, j] |= found.mix(rates[i], rates[j])
                mixes[j, i] = mixes[i, j]
    for found in samples:
        for i in np.flatnonzero(~np.diag(mixes)):
            changes = found.differ([rates[i]])
            moved[: changes.size] |= changes
    return Jumps(moves, mixes, moved)


def jump_table(model: Model) -> list[list[int]]:
    """The same for the FMU's runtime (JUMPS, MIXES of core.h), a row a number; empty where jumps move nothing."""
    found = jump_effects(model)
    return (np.diag(found.moves.astype(int)) + 2 * found.mixes).tolist() if found.any else []


def states_moved_along(model: Model) -> set[str]:
    """States that a jump of a prescribed coordinate moves."""
    if not jump_effects(model).any:
        return set()
    found, end, moved = set[str](), 0, jump_effects(model).moved
    for state in shown_states(model):
        if moved[end : (end := end + state.count)].any():
            found.add(state.name)
    return found


@dataclass(frozen=True, eq=False)
class _Sample:
    t: float
    y: NDArray
    u: NDArray
    k: NDArray
    sizes: NDArray  # of y
    steps: NDArray  # to change u by


class _Rates:
    """Differences of the rates of the coupled states at one sample, where inputs change by steps of order 1."""

    def __init__(self, model: Model, sample: _Sample, size: int) -> None:
        self._model, self._sample, self._sizes = model, sample, sample.sizes[:size]

    def differ(self, places: list[int], at_rest: list[int] | None = None) -> NDArray[np.bool_]:
        """Which rates of states change with these inputs; before, some others are 0."""
        u = self._sample.u.copy()
        u[at_rest or []] = 0
        return self._counts([(1, self._at(u, places)), (-1, self._at(u, []))])

    def curve(self, place: int) -> bool:
        """Whether some are not linear in this input."""
        u = self._sample.u
        terms = [(1, self._at(u, [place])), (-2, self._at(u, [])), (1, self._at(u, [place], -1.0))]
        return bool(self._counts(terms).any())

    def mix(self, a: int, b: int) -> bool:
        """Whether some have a product of these inputs."""
        signs = {(a, b): 1, (a,): -1, (b,): -1, (): 1}
        return bool(self._counts([(sign, self._at(self._sample.u, list(at))) for at, sign in signs.items()]).any())

    def _at(self, u: NDArray, places: list[int], step: float = 1.0) -> NDArray:
        moved, s = u.copy(), self._sample
        moved[places] += step * s.steps[places]
        return _column(self._model.derivatives.call([s.t, s.y, moved, s.k])[0])[: self._sizes.size]

    def _counts(self, terms: list[tuple[int, NDArray]]) -> NDArray[np.bool_]:
        """Whether a sum is more than rounding errors of its terms."""
        scale = np.max([np.abs(rates) for _, rates in terms], axis=0) + self._sizes
        return np.abs(sum(factor * rates for factor, rates in terms)) > _NOTHING * scale


def _active_places(model: Model) -> list[tuple[int, int, int]]:
    """Places among the inputs of σ, σ̇, σ̈; one row a number."""
    first: dict[str, range] = {}
    end = 0
    for variable in model.inputs:
        first[variable.name] = range(end, end := end + variable.count)
    return [row for a in model.active for row in zip(first[a.value], first[a.rate], first[a.acceleration], strict=True)]


def _samples(model: Model) -> list[_Sample]:
    """Random states that are allowed; seeded."""
    random = np.random.default_rng(20240229)
    found: list[_Sample] = []
    lasting = len(model.condition_texts) - model.start_only
    for _ in range(_TRIES):
        u, k = (_random(random, variables) for variables in (model.inputs, model.parameters))
        t = float(random.uniform(0.1, 1))
        y = _column(model.start.call([t, u, k])[0])
        sizes = np.abs(_column(model.nominals.call([t, y, u, k])[0]))
        y = y + random.normal(size=y.size) * sizes
        if model.project is not None:
            y = _column(model.project.call([t, y, u, k])[0])
        margins = _column(model.conditions.call([t, y, u, k])[0])[:lasting]
        rates = _column(model.derivatives.call([t, y, u, k])[0])
        if np.all(margins > 0) and np.all(np.isfinite(np.concatenate([y, sizes, rates]))):
            found.append(_Sample(t, y, u, k, sizes, random.uniform(0.5, 1.5, u.size)))
        if len(found) == _SAMPLES:
            break
    return found


def _random(random: np.random.Generator, variables: tuple[Variable, ...]) -> NDArray:
    """Numbers near the start values and in the domains; coefficients that start at 0 are small."""
    numbers: list[float] = []
    for variable in variables:
        scale = 0.05 if variable.causality == "parameter" else 1.0
        for start in variable.starts:
            bounded = variable.minimum is not None or variable.maximum is not None
            near = (start or 0.3) * random.uniform(0.7, 1.3)
            number = near if start or bounded else random.normal(scale=scale)
            numbers.append(number if variable.allows(number) else start)
    return np.array(numbers)


def _column(value: ca.DM) -> NDArray:
    return np.array(value, dtype=float).ravel()
