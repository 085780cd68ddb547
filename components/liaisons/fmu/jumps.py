"""What a jump of a prescribed coordinate does: the limit of an ever faster straight motion, where there is one.

While σ goes the way δ in a time ε, at a constant rate δ/ε, states move by y' = f(y, σ, σ̇).  Where f is linear in σ̇
this has a limit for ε → 0, in which everything but σ̇ has no time to act (the horizontal lift of M 3.6, 7)::

    dy/dτ = f(y, σ + τ δ, σ̇ + δ) - f(y, σ + τ δ, σ̇),    0 <= τ <= 1

Of a mechanism f is x' = A⁻¹ (p - B σ̇), p' = ∂L/∂x + Q, whose term of second order in σ̇ is ½ σ̇ᵀ (∂Θ/∂x) σ̇: the
effective mass Θ (M eq. 50) must not depend on x, that is the vector field -X_K of M eq. 52 must vanish.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache, partial
from itertools import combinations

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
    samples = _samples(model, size) if a else []
    if a and len(samples) < _SAMPLES:
        return unknown
    rates, accelerations = ([place[i] for place in places] for i in (1, 2))
    for sample in samples:
        resting = sample.u.copy()
        resting[rates] = 0
        for i in range(a):
            moves[i] |= sample.changes(resting, rates[i]).any()
            # On accelerations rates depend where these make constraint forces: momenta are no states of motion then.
            mixes[i, i] |= sample.changes(sample.u, accelerations[i]).any()
            for j in range(i + 1):
                mixes[i, j] |= sample.changes(sample.u, rates[i], rates[j]).any()
                mixes[j, i] = mixes[i, j]
    for sample in samples:
        for i in np.flatnonzero(~np.diag(mixes)):
            moved[:size] |= sample.changes(sample.u, rates[i])
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
    """A random state that is allowed."""

    rates: Callable[[NDArray], NDArray]  # of the states, by the inputs
    u: NDArray
    steps: NDArray  # of order 1, to change u by
    sizes: NDArray  # of the coupled states

    def changes(self, u: NDArray, *places: int) -> NDArray[np.bool_]:
        """Which rates have a term with these inputs as factors: an alternating sum is more than rounding errors."""
        terms = []
        for count in range(len(places) + 1):
            for chosen in combinations(places, count):
                moved = u.copy()
                np.add.at(moved, list(chosen), self.steps[list(chosen)])
                terms.append((-1) ** count * self.rates(moved)[: self.sizes.size])
        return np.abs(sum(terms)) > _NOTHING * (np.max(np.abs(terms), axis=0) + self.sizes)


def _active_places(model: Model) -> list[tuple[int, int, int]]:
    """Places among the inputs of σ, σ̇, σ̈; one row a number."""
    first: dict[str, range] = {}
    end = 0
    for variable in model.inputs:
        first[variable.name] = range(end, end := end + variable.count)
    return [row for a in model.active for row in zip(first[a.value], first[a.rate], first[a.acceleration], strict=True)]


def _samples(model: Model, coupled_states: int) -> list[_Sample]:
    """Some of them; seeded."""

    def rates(t: float, y: NDArray, k: NDArray, u: NDArray) -> NDArray:
        return _column(model.derivatives.call([t, y, u, k])[0])

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
        if np.all(margins > 0) and np.all(np.isfinite(np.concatenate([y, sizes, rates(t, y, k, u)]))):
            steps = random.uniform(0.5, 1.5, u.size)
            found.append(_Sample(partial(rates, t, y, k), u, steps, sizes[:coupled_states]))
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
