"""Equilibria and plans as sampled mechanisms, with the numbers of the synthesis."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from liaisons.base.arguments import check_positive, float_array, name_dictionary, shown
from liaisons.base.array_names import by_name
from liaisons.base.arrays import Floats
from liaisons.base.port_names import port_names
from liaisons.errors import PlanError
from liaisons.library import Target, component
from liaisons_motion.goals import Goal, duration_range, goal_symbols
from liaisons_motion.holding.sampling import SampledMechanism
from liaisons_motion.planning import Plan

# Numbers of the synthesis; times are in radians of the fastest free motion.
_FEWEST_STEPS = 40
"""Least number of communication steps of a plan, unless given: it is resolved even without a free motion."""
_LONGEST_STEP = 0.25
"""Longest communication step of a plan, in radians, unless given: 25 samples a period, of the usual 20 to 30
(Åström and Wittenmark, Computer-Controlled Systems, 4.3)."""
_STEPS_PER_RADIAN = 16
"""Communication steps in a radian at an equilibrium, unless given: 100 samples a period."""
_STEPS_PER_TIME = 1000
"""Longest radian at an equilibrium, in steps: slower free motions move by less than 1e-3 in a step, and are treated
as drift."""
_LEAST_RADIANS = 3
"""Free motions slower than this many radians over the plan, half a period, are treated as drift."""
_PARTS_WITHOUT_MOTION = 30
"""Without a free motion states change by their sizes in this part of the plan: the fastest change that
``_FEWEST_STEPS`` sample more than once."""


def sampled_subject(  # noqa: PLR0917 - those of hold, in its order
    caller: str,
    motion: Plan | Target,
    at: Mapping[str, Any] | None,
    moves: str | Sequence[str] | None,
    controls: str | Sequence[str] | None,
    step_size: float | None,
    values: Mapping[str, float],
) -> tuple[SampledMechanism, float]:
    """The mechanism of a plan or at an equilibrium, and its sampling period [s].

    Arguments are those of :func:`liaisons.hold`; ``values`` are parameters, and ``caller`` its name in errors.

    :raises PlanError: if it is not in equilibrium.
    """
    if step_size is not None:
        check_positive("step_size", step_size, PlanError)
        duration_range(step_size, "step_size")
    if isinstance(motion, Plan):
        _refuse_plan(caller, motion)
        if any(given is not None for given in (at, moves, controls)) or values:
            words = "a plan says what moves, where, and with which parameters; leave at, moves and controls out"
            raise PlanError(f"{caller}: {words}")
        sampled = sampled_mechanism(motion)
        longest = min(motion.duration / _FEWEST_STEPS, _LONGEST_STEP * sampled.time)
        return sampled, step_size or float(motion.duration / np.ceil(motion.duration / longest - 1e-9))
    if at is None:
        raise PlanError(
            f"{caller}: no equilibrium and no plan: give a mechanism and at={{name: value, ...}}, or a plan"
        )
    for name, value in name_dictionary("at", at, PlanError).items():
        if not np.all(np.isfinite(float_array(f"at: {name}", value, PlanError))):
            raise PlanError(f"at: {name} = {shown(value)}: finite numbers only")
    period = step_size or component(motion).experiment.step_size
    goal = Goal.checked(motion, moves=moves, controls=controls, duration=period, values=values, start=at)
    sampled = SampledMechanism(goal, at, interpolate=False, time=period, longest=_STEPS_PER_TIME * period)
    unknown = [name for name in goal.controls if name not in at]
    if unknown:
        sampled.sigma = sampled.balanced(sampled.start[sampled.state_indices], sampled.sigma, unknown)
    if step_size is None and sampled.has_free_motion:
        period = _round_down(sampled.time / _STEPS_PER_RADIAN)
    rates = by_name(sampled.names, sampled.rates(sampled.start[sampled.state_indices], sampled.sigma))
    rates |= {m: sampled.sigma[i, 1] for i, m in enumerate(sampled.moves) if m in sampled.held_moves}
    sizes = by_name(sampled.states, sampled.sizes)
    worst = max(rates, key=lambda name: abs(rates[name]) / sizes[name], default="")
    if worst and not abs(rates[worst]) * sampled.time <= 1e-9 * sizes[worst]:
        raise PlanError(f"{sampled.name}: this is no equilibrium: the rate of {worst} is {rates[worst]:.3g}")
    return sampled, period


def _refuse_plan(caller: str, motion: Plan) -> None:
    """Raise an error for a plan with phases, or of forces beside motions that are observed or whose rates jump."""
    if motion.goal.phases:
        raise PlanError(f"{caller} takes no plan with phases, between which contacts change modes; replay it")
    is_mixed = motion.goal.moves and motion.goal.controls
    if is_mixed and caller == "observe":  # what is estimated there is not what it says of its errors
        raise PlanError(
            f"{caller} takes no plan of forces beside prescribed motions: plan one of both; or hold it alone"
        )
    if is_mixed and motion.problem.control_order < 2:
        rates = ", ".join(f"{move}_ddot" for move in motion.goal.moves)
        words = f"moved coordinates or their rates jump beside forces: weigh or bound {rates} in the plan"
        raise PlanError(f"{motion.problem.name}: {caller}: {words}")


def _round_down(value: float) -> float:
    """The greatest of 1, 2 or 5 times a power of ten that is not above a value."""
    power = 10.0 ** np.floor(np.log10(value))
    return float(max(digit * power for digit in (1, 2, 5) if digit * power <= value * (1 + 1e-9)))


def sampled_mechanism(motion: Plan) -> SampledMechanism:
    """The mechanism at the start of a plan, with sizes of states from the plan's motion."""
    goal, T = motion.goal, motion.duration
    symbols = goal_symbols(goal)
    first, starts = motion.sigma(0.0), motion.fmu_starts
    start: dict[str, Any] = {name: starts[parameter] for name, parameter in symbols.start_parameters.items()}
    start |= {name: float(first[name]) for m in goal.moves for name in port_names(m)[:2]}
    # The residual that IPOPT leaves where a start is 0 must not become a size.
    start = {name: x if abs(x) > symbols.rounding * symbols.sizes.get(name, 1.0) else 0.0 for name, x in start.items()}
    groups: list[Any] = [group for group in (goal.start, goal.end, goal.closed) if not goal.is_expression(group)]
    required = {name for group in groups for name in group}
    trajectory, states = motion.solution.trajectory, motion.problem.states
    extents = by_name(states, np.abs(trajectory.knots).max(axis=1))
    extents |= {m: float(np.abs(motion.sigma(trajectory.breaks)[m]).max()) for m in goal.moves}
    return SampledMechanism(
        Goal(goal.component, goal.moves, (T, T), goal.values, start, controls=goal.controls),
        required,
        interpolate=True,
        time=T / _PARTS_WITHOUT_MOTION,
        longest=T / _LEAST_RADIANS,
        extents=extents,
    )


def planned_motion(motion: Plan, times: ArrayLike) -> Floats:
    """σ and its two rates at times of a plan [s], (driven, 3, times).

    Forces alone are means over the interval to the next time, which regulators hold; the last one is that of the end.
    Beside σ they are values, between which the mechanism interpolates.
    """
    sigma, times = motion.sigma(times), np.asarray(times, dtype=float)
    rows = [[sigma[name] for name in port_names(m)[:3]] for m in motion.goal.moves]
    for name in motion.goal.controls:
        values = sigma[name]
        if not motion.goal.moves:
            values = np.append(np.diff(motion.impulse(name, times)) / np.diff(times), values[-1:])
        rows.append([values, 0 * values, 0 * values])
    return np.array(rows)
