"""Jumps of prescribed coordinates: the limit of an ever faster straight motion, where it exists.

While σ changes by δ in a time ε, at a constant rate δ/ε, states move by y' = f(y, σ, σ̇).  Where f is linear in σ̇ this
has a limit for ε → 0, in which nothing but σ̇ acts (the horizontal lift of M 7)::

    dy/dτ = f(y, σ + τ δ, σ̇ + δ) - f(y, σ + τ δ, σ̇),    0 <= τ <= 1

Of a mechanism f is x' = A⁻¹ (p - B σ̇), p' = ∂L/∂x + Q, whose term of second order in σ̇ is ½ σ̇ᵀ (∂Θ/∂x) σ̇: the
effective mass Θ (M eq. 50) must not depend on x, that is the vector field -X_K of M eq. 52 must vanish.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import lru_cache, partial
from itertools import combinations
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from liaisons.fmu.dependencies import coupled_state_count, state_outputs
from liaisons.fmu.layout import index_ranges
from liaisons.language import Variable
from liaisons.mechanics import Model, results_of

_SAMPLES, _TRIES = 6, 60
_MOST = 64
"""Prescribed numbers beyond which there are too many pairs to sample."""

_NOTHING = 1e-9
"""Differences of rates below this part of the rates are rounding errors."""


@dataclass(frozen=True, eq=False)
class Jumps:
    """Effects of jumps of the a prescribed numbers on the states."""

    moves: NDArray[np.bool_]  # (a,) a jump of this one moves states, also where all others rest
    mixes: NDArray[np.bool_]  # (a, a) both rates are factors of a term of the rates of states; of one: its square
    moved: NDArray[np.bool_]  # (states,) may move in a jump that has a limit

    @property
    def have_limit(self) -> NDArray[np.bool_]:
        """Whether a jump of each prescribed number alone is the limit of a fast motion; shape (a,)."""
        return ~np.diag(self.mixes)

    @property
    def move_states(self) -> bool:
        """Whether some jump with a limit moves states."""
        return bool(np.any(self.have_limit & (self.moves | self.mixes.any(axis=1))))


@lru_cache(maxsize=4)  # the FMUs of one component are built one after the other
def jump_effects(model: Model) -> Jumps:
    """Effects of jumps of prescribed coordinates, from rates at seeded random states.

    Sparsity is not enough: it has terms that cancel.
    """
    inputs = index_ranges(model.inputs)
    numbers = [i for a in model.active for i in zip(inputs[a.rate], inputs[a.acceleration], strict=True)]
    a, states = len(numbers), model.start.numel_out(0)
    moves, moved = np.zeros(a, dtype=bool), np.zeros(states, dtype=bool)
    size = coupled_state_count(model) if 0 < a <= _MOST else 0
    samples = _valid_samples(model, size) if 0 < a <= _MOST else []
    if a and len(samples) < _SAMPLES:  # unknown
        return Jumps(moves, np.broadcast_to(True, (a, a)), moved)
    mixes = np.zeros((a, a), dtype=bool)
    for sample in samples:
        resting = sample.u.copy()
        resting[[rate for rate, _ in numbers]] = 0
        for i, (rate, acceleration) in enumerate(numbers):
            moves[i] |= sample.depends_on_product(resting, rate).any()
            # Rates depend on accelerations that make constraint forces: momenta are not states of motion then.
            mixes[i, i] |= sample.depends_on_product(sample.u, acceleration).any()
            for j, (second_rate, _) in enumerate(numbers[: i + 1]):
                mixes[i, j] |= sample.depends_on_product(sample.u, rate, second_rate).any()
                mixes[j, i] = mixes[i, j]
    for sample in samples:
        for i in np.flatnonzero(~np.diag(mixes)):
            moved[:size] |= sample.depends_on_product(sample.u, numbers[i][0])
    return Jumps(moves, mixes, moved)


def jump_flags(model: Model) -> list[list[int]]:
    """Flags JUMPS and MIXES of core.h, a row and a column for each prescribed number; none if nothing moves."""
    effects = jump_effects(model)
    return (np.diag(effects.moves.astype(int)) + 2 * effects.mixes).tolist() if effects.move_states else []


def states_moved_by_jumps(model: Model) -> set[str]:
    """Names of the states that a jump of a prescribed coordinate moves."""
    effects = jump_effects(model)
    states = index_ranges(state_outputs(model)) if effects.move_states else {}
    return {name for name, indices in states.items() if effects.moved[indices].any()}


@dataclass(frozen=True, eq=False)
class _Sample:
    """A random state in the domain."""

    rates: Callable[[NDArray], NDArray]  # of the states, by the inputs
    u: NDArray
    steps: NDArray  # of order 1, to change u by
    sizes: NDArray  # of the coupled states

    def depends_on_product(self, u: NDArray, *indices: int) -> NDArray[np.bool_]:
        """Whether each rate has a term with all of these inputs as factors, by differences; shape (coupled states,)."""
        terms = []
        for count in range(len(indices) + 1):
            for chosen in combinations(indices, count):
                moved = u.copy()
                np.add.at(moved, list(chosen), self.steps[list(chosen)])
                terms.append((-1) ** count * self.rates(moved)[: self.sizes.size])
        with np.errstate(invalid="ignore"):  # rates may leave the domain of L: no number is a change
            return ~(np.abs(sum(terms)) <= _NOTHING * (np.max(np.abs(terms), axis=0) + self.sizes))


def _valid_samples(model: Model, coupled_states: int) -> list[_Sample]:
    """Seeded random samples of states and inputs that satisfy the conditions of the model."""
    random = np.random.default_rng(20240229)
    samples: list[_Sample] = []
    lasting = len(model.condition_texts) - model.start_only
    for _ in range(_TRIES):
        u, k = (_random_numbers(random, variables) for variables in (model.inputs, model.parameters))
        t = float(random.uniform(0.1, 1))
        y, memory = map(_to_array, model.start.call([t, u, k]))
        x = random.normal(size=len(model.contacts))
        sizes = np.abs(_to_array(model.nominals.call([t, y, u, k])[0]))
        y = y + random.normal(size=y.size) * sizes
        if model.project is not None:
            y = _to_array(model.project.call([t, y, u, k])[0])
        vectors = {"t": t, "y": y, "u": u, "k": k, "m": memory, "x": x}
        margins = _to_array(results_of("conditions", model.conditions, vectors)[0])[:lasting]
        rates = partial(_state_rates, model, vectors)
        if np.all(margins > 0) and np.all(np.isfinite(np.concatenate([y, sizes, rates(u)]))):
            steps = random.uniform(0.5, 1.5, u.size)
            samples.append(_Sample(rates, u, steps, sizes[:coupled_states]))
        if len(samples) == _SAMPLES:
            break
    return samples


def _state_rates(model: Model, vectors: Mapping[str, Any], u: NDArray) -> NDArray:
    """Rates of the states, with contact forces that do not depend on the inputs."""
    name = "forced_motion" if model.contacts else "derivatives"
    return _to_array(results_of(name, getattr(model, name), {**vectors, "u": u})[0])


def _random_numbers(random: np.random.Generator, variables: tuple[Variable, ...]) -> NDArray:
    """Random values of variables near their start values and in their domains."""
    numbers: list[float] = []
    for variable in variables:
        scale = 0.05 if variable.causality == "parameter" else 1.0
        for start in variable.starts:
            bounded = variable.minimum is not None or variable.maximum is not None
            near = (start or 0.3) * random.uniform(0.7, 1.3)
            number = near if start or bounded else random.normal(scale=scale)
            numbers.append(number if variable.allows(number) else start)
    return np.array(numbers)


def _to_array(value: ca.DM) -> NDArray:
    """Column of CasADi as an array, shape (n,)."""
    return np.array(value, dtype=float).ravel()
