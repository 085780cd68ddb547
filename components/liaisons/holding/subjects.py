"""Equilibria and plans as sampled mechanisms, with the numbers of the synthesis."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from liaisons.base.arguments import check_positive, float_array, name_dictionary, shown
from liaisons.errors import PlanError
from liaisons.holding.sampling import SampledMechanism
from liaisons.library import Target, component
from liaisons.planning.goals import Array, Goal, by_name, duration_range, is_expression, motion_names, move_names
from liaisons.planning.plans import Plan
from liaisons.planning.symbols import ROUNDING, goal_symbols


@dataclass(frozen=True)
class SynthesisSettings:
    """Numbers of the synthesis, with their reasons; times are in radians of the fastest free motion."""

    fewest_steps: int = 40
    """Least number of communication steps of a plan, unless given: it is resolved even without a free motion."""
    longest_step: float = 0.25
    """Longest communication step of a plan, in radians, unless given: 25 samples a period, of the usual 20 to 30
    (Åström and Wittenmark, Computer-Controlled Systems, 4.3)."""
    steps_per_radian: int = 16
    """Communication steps in a radian at an equilibrium, unless given: 100 samples a period."""
    steps_per_time: int = 1000
    """Longest radian at an equilibrium, in steps: slower free motions move by less than 1e-3 in a step, and are treated
    as drift."""
    least_radians: int = 3
    """Free motions slower than this many radians over the plan, half a period, are treated as drift."""
    parts_without_motion: int = 30
    """Without a free motion states change by their sizes in this part of the plan: the fastest change that
    ``fewest_steps`` sample more than once."""
    most_steps: int = 10_000
    """Most communication steps of a plan: each has a matrix, 5 kB for the 24 states that a Regulator reads."""
    drift_weight: float = 1e-3
    """Weight of the rate of a moved coordinate that is not held, beside 1 of a held one: without a weight nothing stops
    it.  Alone, v' = w, it decays by exp(-t √(weight / effort)): in 30 radians, after the held coordinates."""
    integration_error: float = 1e-10
    """Relative error of the matrix of a step, by the Runge-Kutta steps of :mod:`liaisons.holding.sampling`."""
    negligible_mass: float = 1e-3
    """An effective mass below this part of the greatest on the trajectory is 0: bounds on its force would be bounds on
    an acceleration a thousand times as large as elsewhere."""
    knots_ahead: int = 6
    """Corrections respect the bounds at this many knots to come, after which their accelerations have decayed to
    exp(-6) = 2.5e-3."""
    largest_miss: float = 1e-3
    """Largest miss of the plan's end, relative to sizes: its square, which first order neglects, is ``closure``."""
    closure: float = 1e-6
    """Tolerance for calling a plan closed, or at rest at its end, relative to sizes: verified plans keep 1e-8."""


SETTINGS = SynthesisSettings()


def sampled_subject(  # noqa: PLR0917 - those of hold, in its order
    caller: str,
    motion: Plan | Target,
    at: Mapping[str, Any] | None,
    moves: str | Sequence[str] | None,
    step_size: float | None,
    values: Mapping[str, float],
) -> tuple[SampledMechanism, float]:
    """The mechanism of a plan or at an equilibrium, and its sampling period; arguments as of :func:`liaisons.hold`.

    :raises PlanError: if it is not in equilibrium.
    """
    if step_size is not None:
        check_positive("step_size", step_size, PlanError)
        duration_range(step_size, "step_size")
    if isinstance(motion, Plan):
        if motion.goal.phases:
            raise PlanError(f"{caller} takes no plan with phases, between which contacts change modes; replay it")
        if at is not None or moves is not None or values:
            words = "a plan says what moves, where, and with which parameters; leave at and moves out"
            raise PlanError(f"{caller}: {words}")
        sampled = sampled_mechanism(motion)
        longest = min(motion.duration / SETTINGS.fewest_steps, SETTINGS.longest_step * sampled.time)
        return sampled, step_size or float(motion.duration / np.ceil(motion.duration / longest - 1e-9))
    if at is None:
        raise PlanError(
            f"{caller}: no equilibrium and no plan: give a mechanism and at={{name: value, ...}}, or a plan"
        )
    for name, value in name_dictionary("at", at, PlanError).items():
        if not np.all(np.isfinite(float_array(f"at: {name}", value, PlanError))):
            raise PlanError(f"at: {name} = {shown(value)}: finite numbers only")
    usual = component(motion).experiment.step_size
    H = usual if step_size is None else step_size
    goal = Goal(motion, move_names(motion, moves), (H, H), values, at)
    sampled = SampledMechanism(goal, at, interpolate=False, time=H, longest=SETTINGS.steps_per_time * H)
    if step_size is None and sampled.moves_freely:
        H = _round_down(sampled.time / SETTINGS.steps_per_radian)
    rates = by_name(sampled.names, sampled.rates(sampled.start[sampled.state_indices], sampled.sigma))
    rates |= {m: sampled.sigma[i, 1] for i, m in enumerate(sampled.moves) if m in sampled.held_moves}
    sizes = by_name(sampled.states, sampled.sizes)
    worst = max(rates, key=lambda name: abs(rates[name]) / sizes[name], default="")
    if worst and not abs(rates[worst]) * sampled.time <= 1e-9 * sizes[worst]:
        raise PlanError(f"{sampled.name}: this is no equilibrium: the rate of {worst} is {rates[worst]:.3g}")
    return sampled, H


def _round_down(value: float) -> float:
    """The greatest number not above a value that is 1, 2 or 5 times a power of ten."""
    power = 10.0 ** np.floor(np.log10(value))
    return float(max(digit * power for digit in (1, 2, 5) if digit * power <= value * (1 + 1e-9)))


def sampled_mechanism(motion: Plan) -> SampledMechanism:
    """The mechanism of a plan, with the start and the sizes that the plan has."""
    goal, T = motion.goal, motion.duration
    symbols = goal_symbols(goal)
    first, starts = motion.sigma(0.0), motion.fmu_starts
    start: dict[str, Any] = {name: starts[parameter] for name, parameter in symbols.start_parameters.items()}
    start |= {name: float(first[name]) for m in goal.moves for name in motion_names(m)[:2]}
    # The residual that IPOPT leaves where a start is 0 must not become a size.
    start = {name: x if abs(x) > ROUNDING * symbols.sizes.get(name, 1.0) else 0.0 for name, x in start.items()}
    groups: list[Any] = [group for group in (goal.start, goal.end, goal.closed) if not is_expression(group)]
    required = {name for group in groups for name in group}
    trajectory, states = motion.solution.trajectory, motion.problem.states
    extents = by_name(states, np.abs(trajectory.knots).max(axis=1))
    extents |= {m: float(np.abs(motion.sigma(trajectory.breaks)[m]).max()) for m in goal.moves}
    return SampledMechanism(
        Goal(goal.component, goal.moves, (T, T), goal.values, start),
        required,
        interpolate=True,
        time=T / SETTINGS.parts_without_motion,
        longest=T / SETTINGS.least_radians,
        extents=extents,
    )


def planned_motion(motion: Plan, times: ArrayLike) -> Array:
    """σ and its two rates at times [s], (moves, 3, times)."""
    sigma = motion.sigma(times)
    return np.array([[sigma[name] for name in motion_names(m)] for m in motion.goal.moves])
