"""``hold``: feedback that keeps a mechanism at an equilibrium, or at what was planned, once a communication step.

The regulators read the mechanism's states at each communication point, and add corrections to the motion that they
know; these are integrators of third order (see :class:`liaisons.models.Regulator`).  What happens over one step to
first order, x(t + H) = A x(t) + B w, is what the FMUs do, see :mod:`liaisons.holding.sampling`.  The gains solve
Riccati's equation of this discrete system, of a periodic one round by round; what cannot be controlled is left alone.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import numpy as np
from scipy.linalg import svd

from liaisons.base.arguments import finite, merged, named, numbers, positive, shown
from liaisons.cosim.structure.sources import rounding
from liaisons.errors import PlanError
from liaisons.holding.controllers import After, Controller, LinearPrediction, ReferenceTrajectory
from liaisons.holding.feedback import (
    RANK,
    Array,
    Step,
    backward,
    least_defects,
    periodic,
    pushes,
    reachable,
    riccati,
    steady,
    through,
)
from liaisons.holding.sampling import SampledMechanism, reduced
from liaisons.language import Orientation
from liaisons.library import Target, component
from liaisons.planning.goals import Goal, duration_range, is_expression, motion_names, move_names
from liaisons.planning.plans import Plan
from liaisons.planning.symbols import ROUNDING, goal_symbols

_PAIRS = (("least", "most"), ("slowest", "fastest"), ("lowest", "highest"))
"""Bounds of a correction, its rate and its acceleration, as a Regulator calls them."""
_FAR = 1e30
_MASSLESS = 1e-3
"""An effective mass that is less than this, of the greatest on the way, is none."""
_DRIFT = 1e-3
"""Weight of the rate of what moves without being held, beside 1 for what is: it must be weighted, or nothing stops it;
alone, v' = w, it comes back by exp(-t √(_DRIFT / effort)), in 30 radians of the free motion, after what is held."""
_STEPS, _LONGEST = 40, 0.25
"""Communication steps of a plan, and how long they are at most, in radians of the free motion, unless said: of samples
25 a period, the usual 20 to 30 (Åström and Wittenmark, Computer-Controlled Systems, 4.3), ten times Nyquist's two."""
_RADIANS, _PARTS = 3, 30
"""A free motion counts of which a plan has so many radians: a slower one is no more than a drift on the way.  Without
one states change by their sizes in such a part, the fastest that so many steps can still sample."""
_MANY = 1000
"""In an equilibrium a step is no smaller part of such a time."""
_PER_RADIAN = 16
"""Communication steps of an equilibrium in a radian of the free motion, unless said."""
_INSTANT = 1e-9
"""How long before a jump, relative to the duration, the regulators are asked once more."""
_MOST = 10_000
"""Steps of a plan: a matrix each."""
_UNKNOWN = 1e-10
"""Of a step's matrix, relative: what the integration leaves."""
_AHEAD = 6
"""So many knots ahead corrections keep to the room that there will be."""
_FAR_OFF = 1e-3
"""Of its size: what is of second order in it is as small as what a plan may miss."""
_SAME = 1e-6
"""By how much a motion that returns may miss its begin: more than a mesh leaves, less than what anybody means."""


def hold(
    motion: Plan | Target,
    /,
    at: Mapping[str, Any] | None = None,
    moves: str | Sequence[str] | None = None,
    *,
    step_size: float | None = None,
    weights: Mapping[str, float] | None = None,
    effort: float = 1.0,
    bounds: Mapping[str, tuple[float, float]] | None = None,
    start_values: Mapping[str, float] | None = None,
    **keywords: float,
) -> Controller:
    """Find the feedback that keeps a mechanism at an equilibrium, or at a motion that was planned.

    ::

        regulator = hold("Pendulum", {"theta": np.pi, "pivot_x": 0}, "pivot_x", step_size=0.02)
        run = regulator.simulate(10, theta_0=np.pi + 0.2)

        regulator = hold(plan("Satellite", end={"attitude": (0, 0, 0, 1)}, duration=2.0))
        run = regulator.simulate(30, inputs={"torque_x": lambda t: 0.01})

    Once a step the states are read and the accelerations of what moves are chosen, so that the sum over all steps of
    Σ weight (x - x_0)² + effort w² is least, each divided by its size: an angle's is 1, a length's that at which the
    mass has the angles' moment of inertia (of a pendulum its length), time is in radians of the free motion.  Where a
    moved coordinate enters nothing (the angle of a wheel), it is held only if it is given by name.  A plan that
    returns to where it began is repeated; one after which the mechanism can rest is held there.

    :param motion: a plan; or name, file or class of a mechanism.
    :param at: values of coordinates at the equilibrium, and of rates of what moves; the others as declared, at rest.
    :param moves: active coordinates that the feedback moves; all unless given, or those of the plan.
    :param step_size: distance of the communication points [s], which is the sampling period; else about a sixteenth
        radian of the free motion, of a plan a fortieth at most.
    :param weights: of states by name; coordinates have 1, momenta 0.
    :param effort: weight of the accelerations; 1, as that of the coordinates, by Bryson's rule: all are divided by the
        sizes that they may have.
    :param bounds: (low, high) of σ, σ̇, σ̈ and forces of what moves, ``{"pivot_x_ddot": (-5, 5)}``, beside those of the
        plan: there the feedback saturates.  Of forces it knows what they are along the motion.
    :param start_values: parameters by name; ``keywords`` are further ones, where they are no settings.
    :raises PlanError: if it is no equilibrium, or if what is to be held cannot be controlled, with what stays.
    """
    values = merged("hold", start_values, keywords, PlanError)
    positive("effort", effort, PlanError)
    if step_size is not None:
        positive("step_size", step_size, PlanError)
        duration_range(step_size, "step_size")
    criterion = _Criterion(named("weights", weights or {}, PlanError), effort, named("bounds", bounds or {}, PlanError))
    if isinstance(motion, Plan):
        if at is not None or moves is not None or values:
            raise PlanError("hold: a plan says what moves, where, and with which parameters; leave at and moves out")
        return _along(motion, step_size, criterion)
    if at is None:
        raise PlanError("hold keeps an equilibrium or a plan: give a mechanism and at={name: value, ...}, or a plan")
    for name, value in named("at", at, PlanError).items():
        if not np.all(np.isfinite(numbers(f"at: {name}", value, PlanError))):
            raise PlanError(f"at: {name} = {shown(value)}: finite numbers only")
    usual = component(motion).experiment.step_size
    H = usual if step_size is None else step_size
    goal = Goal(motion, move_names(motion, moves), (H, H), values, at)
    sampled = SampledMechanism(goal, at, interpolate=False, time=H, longest=_MANY * H)
    if step_size is None and sampled.moves_freely:
        H = _plain(sampled.time / _PER_RADIAN)
    return _at_rest(sampled, H, criterion)


def _greatest_near(matrix: Array) -> float:
    """The greatest multiplier of matrices that differ from one by what is not known of it."""
    random, size = np.random.default_rng(0), _UNKNOWN * np.max(np.abs(matrix), initial=0.0)
    near = [matrix, *(matrix + random.uniform(-size, size, matrix.shape) for _ in range(4))]
    return float(np.max(np.abs(np.linalg.eigvals(near)), initial=0.0))


def _plain(value: float) -> float:
    """1, 2 or 5 times a power of ten, that is not above a value."""
    power = 10.0 ** np.floor(np.log10(value))
    return float(max(digit * power for digit in (1, 2, 5) if digit * power <= value * (1 + 1e-9)))


@dataclass(frozen=True)
class _Criterion:
    weights: Mapping[str, float]
    effort: float
    bounds: Mapping[str, tuple[float | None, float | None]]

    def costs(self, sampled: SampledMechanism, directions: Sequence[Array]) -> list[Array]:
        """Weights in the directions in which the states can differ."""
        cost = {name: float(name in sampled.free) for name in sampled.states}
        cost |= {f"{m}_dot": _DRIFT for m in sampled.moves if m not in sampled.held_moves}
        for name, weight in self.weights.items():
            if name not in cost:
                raise PlanError(f"{sampled.name}: weights of {name!r}: the states are {', '.join(sampled.states)}")
            finite(f"weight of {name}", weight, PlanError)
            if weight < 0:
                raise PlanError(f"{sampled.name}: weight of {name} = {weight:g}: must be >= 0")
            cost[name] = weight
        return [(D.T * [*cost.values()]) @ D for D in directions]


# ---- an equilibrium -----------------------------------------------------------------------------------------------


def _at_rest(sampled: SampledMechanism, H: float, criterion: _Criterion) -> Controller:
    """The feedback of least cost at an equilibrium."""
    y, sigma = sampled.start[sampled.state_indices], sampled.sigma
    still = dict(zip(sampled.names, sampled.rates(y, sigma), strict=True))
    still |= {m: sigma[i, 1] for i, m in enumerate(sampled.moves) if m in sampled.held_moves}
    sizes = dict(zip(sampled.states, sampled.sizes, strict=True))
    worst = max(still, key=lambda name: abs(still[name]) / sizes[name])
    if not abs(still[worst]) * sampled.time <= 1e-9 * sizes[worst]:
        raise PlanError(f"{sampled.name}: this is no equilibrium: the rate of {worst} is {still[worst]:.3g}")
    planned = np.dstack([sigma, sigma + H * np.column_stack([sigma[:, 1:], np.zeros(len(sigma))])])
    reference, steps = sampled.steps(np.array([0.0, H]), planned, H)
    trajectory = ReferenceTrajectory(np.zeros(1), planned[:, :, :1], reference[:, :1], "rests")
    D = sampled.directions(reference[:, 0], sigma)
    ((A, B),) = reduced(steps, [D, D])
    (Q,) = criterion.costs(sampled, [D])
    still_ones = unmoved([(A, B)])
    V, U = reachable((A - np.eye(len(A))) * (sampled.time / H), B * (sampled.time / H))
    K = np.zeros((B.shape[1], len(A)))
    with suppress(np.linalg.LinAlgError):
        K = riccati(V.T @ A @ V, V.T @ B, V.T @ Q @ V, criterion.effort * np.eye(B.shape[1])) @ V.T
    if not _greatest_near(V.T @ (A - B @ K) @ V) < 1:
        raise PlanError(
            f"{sampled.name} cannot be held there: {', '.join(sampled.moves)} every {H:g} s hardly reach all that "
            "falls; Riccati's equation has no solution in 16 digits"
        )
    if U.size:
        fixed = np.eye(len(A))[:, still_ones]
        U = np.hstack([fixed, svd(U - fixed @ (fixed.T @ U))[0][:, : U.shape[1] - len(still_ones)]])
        stays = bool(np.max(np.abs(np.linalg.eigvals(U.T @ A @ U))) < 1 + 1e-6)
        target, missed = steady(A, D[[sampled.states.index(name) for name in sampled.free]], V, U)
        for j in range(U.shape[1]):
            if not stays or (j >= len(still_ones) and missed[j] > RANK):
                raise PlanError(_cannot(sampled, D, U[:, j]))
        K -= K @ V @ target @ U.T
    bounds = _checked(sampled, criterion.bounds, sigma)
    prediction = LinearPrediction(A - B @ K, D, D, V, _named(sampled, D, still_ones), returns=True)
    gains = [K @ np.linalg.pinv(D)]
    return _controller(sampled, H, trajectory, gains=gains, bounds=bounds, prediction=prediction)


# ---- a plan -------------------------------------------------------------------------------------------------------


def _along(motion: Plan, step_size: float | None, criterion: _Criterion) -> Controller:
    """The feedback of least cost along a plan."""
    sampled = _beside(motion)
    longest = min(motion.duration / _STEPS, _LONGEST * sampled.time)
    H = motion.duration / np.ceil(motion.duration / longest - 1e-9) if step_size is None else step_size
    trajectory, steps, returns = _reference_trajectory(motion, sampled, H)
    D = [sampled.directions(*point) for point in trajectory.points]
    steps, costs = reduced(steps, D), criterion.costs(sampled, D)
    R = criterion.effort * np.eye(len(motion.goal.moves))
    whole, after = through(steps), np.zeros((len(R), D[-1].shape[1]))
    if trajectory.after == "rests":
        y, planned = trajectory.states[: len(sampled.names), -1], trajectory.motion[:, :, [-1, -1]]
        lasting = reduced(sampled.steps(np.array([0.0, H]), planned, H, y)[1], [D[-1], D[-1]])
        ((A, B),) = lasting
        V, U = reachable(A - np.eye(len(A)), np.hstack([B, pushes(steps)]))
        _refuse_growth(sampled, D[-1], U, A)
        end = periodic(lasting, costs[-1:], R)
        after = end and end[0][0]
        solution = end and backward(steps, costs[:-1], R, end[1])
    elif returns:
        V, U = reachable(whole - np.eye(len(whole)), pushes(steps))
        _refuse_growth(sampled, D[-1], U, whole)
        solution = periodic(steps, costs[:-1], R)
    else:
        V, U = reachable(np.zeros_like(whole), pushes(steps))
        solution = backward(steps, costs[:-1], R, costs[-1])
    if solution is None or after is None:
        raise PlanError(f"{sampled.name}: no feedback keeps {', '.join(sampled.free)}: the gains do not converge")
    gains, still = [*solution[0], after], unmoved(steps)
    loop = through(steps, gains)
    fixed = np.eye(len(whole))[:, still]
    left: Any = svd(U - fixed @ (fixed.T @ U), full_matrices=False)
    conserved = _named(sampled, D[0], still)
    conserved += tuple(_combination(sampled, D[-1], u) for u in left[0][:, left[1] > RANK].T)
    bounds = {n: pair for n, pair in motion.goal.bounds.items() if n in _bounded(sampled)}
    bounds |= _checked(sampled, criterion.bounds)
    gains = [K @ np.linalg.pinv(basis) for K, basis in zip(gains, D, strict=True)]
    prediction = LinearPrediction(loop, D[0], D[-1], V, conserved, returns)
    return _controller(sampled, H, trajectory, gains=gains, bounds=bounds, prediction=prediction)


def _beside(motion: Plan) -> SampledMechanism:
    """The mechanism at the start of the plan."""
    goal, T = motion.goal, motion.duration
    bare, symbols = Goal(goal.component, goal.moves, (T, T), goal.values, {}), goal_symbols(goal)
    first, starts = motion.sigma(0.0), motion.fmu_starts
    start: dict[str, Any] = {name: starts[parameter] for name, parameter in symbols.start_parameters.items()}
    start |= {name: float(first[name]) for m in goal.moves for name in motion_names(m)[:2]}
    # What IPOPT leaves of a 0 would be a size.
    start = {name: x if abs(x) > ROUNDING * symbols.sizes.get(name, 1.0) else 0.0 for name, x in start.items()}
    groups: list[Any] = [group for group in (goal.start, goal.end, goal.closed) if not is_expression(group)]
    required = {name for group in groups for name in group}
    trajectory, states = motion.solution.trajectory, motion.problem.states
    extents = dict(zip(states, np.abs(trajectory.knots).max(axis=1), strict=True))
    extents |= {m: float(np.abs(motion.sigma(trajectory.breaks)[m]).max()) for m in goal.moves}
    return SampledMechanism(
        replace(bare, start=start),
        required,
        interpolate=True,
        time=T / _PARTS,
        longest=T / _RADIANS,
        extents=extents,
    )


def _reference_trajectory(
    motion: Plan, sampled: SampledMechanism, H: float
) -> tuple[ReferenceTrajectory, list[Step], bool]:
    """The plan at its communication points, and whether it comes back to where it was, up to how it is turned."""
    T, moves, order = motion.duration, motion.goal.moves, motion.problem.order
    if T / H > _MOST:
        raise PlanError(f"{sampled.name}: step_size = {H:g} over {T:g} s: more than {_MOST} steps; give a longer one")
    instant = max(_INSTANT * T, 3 * rounding(T))  # a run tells two instants apart that far
    edges = [0.0, *motion.switches, T]
    parts = [np.linspace(a, b, max(1, int(np.ceil((b - a) / H - 1e-9))), endpoint=False) for a, b in pairwise(edges)]
    times = np.unique(np.concatenate([*parts, motion.switches - instant, [T]]))
    sigma = motion.sigma(times)
    planned = np.array([[sigma[name] for name in motion_names(m)] for m in moves])
    reference, steps = _stepped(motion, sampled, times, planned, H)
    gap = np.abs(reference[:, -1] - reference[:, 0])
    may_jump = {name for m in moves for name in motion_names(m)[order:]}
    missed = gap > _SAME * np.maximum(sampled.sizes, np.abs(reference).max(axis=1))
    missing = {name for name, is_off in zip(sampled.states, missed, strict=True) if is_off}
    missing -= {*sampled.cyclic, *may_jump}
    still = planned[:, :, -1].copy()
    stops = [order < 2 or m in sampled.held_moves for m in moves]
    size = sampled.input_sizes[:, None] * sampled.time ** np.array([2.0, 1.0, 0.0])  # of σ, σ̇, σ̈
    fast = np.abs(still[:, 1]) > _SAME * size[:, 1]
    still[stops, 1], still[:, 2] = 0.0, 0.0
    rests = order < 2 or not np.any(fast & stops)
    after: After = "ends"
    last, end = planned[:, :, -1], reference[: len(sampled.names), -1]
    if not missing:
        after, last = "repeats", planned[:, :, 0]
    elif rests and np.all(np.abs(sampled.rates(end, still)) * sampled.time <= _SAME * sampled.sizes[: len(end)]):
        after, last = "rests", still
    if np.any(np.abs(last - planned[:, :, -1]) > _SAME * size):
        times = np.append(times[:-1], [T - instant, T])
        planned = np.dstack([planned, last])
        reference, steps = _stepped(motion, sampled, times, planned, H)
    return ReferenceTrajectory(times, planned, reference, after), steps, not missing - {*Orientation.quaternion}


def _stepped(
    motion: Plan, sampled: SampledMechanism, times: Array, planned: Array, H: float
) -> tuple[Array, list[Step]]:
    """States and matrices of steps along the plan, to its very end: what is unstable leaves it without feedback.

    :raises PlanError: if the steps miss the end of the plan by so much that nothing of first order leads there.
    """
    reference, steps = sampled.steps(times, planned, H)
    n = len(sampled.names)
    ends = dict(zip(motion.problem.states, motion.solution.trajectory.knots[:, -1], strict=True))
    missed = np.array([ends.get(*pair) - pair[1] for pair in zip(sampled.names, reference[:n, -1], strict=True)])
    missed /= sampled.sizes[:n]
    if not np.max(np.abs(missed), initial=0.0) <= _FAR_OFF:
        i = int(np.argmax(np.abs(missed)))
        raise PlanError(
            f"{sampled.name}: in steps of {H:.3g} s the motion misses the plan's end, {sampled.names[i]} by "
            f"{missed[i] * sampled.sizes[i]:.2g}: give a shorter step_size, or plan it with a finer mesh (accuracy)"
        )
    reference[:n] += least_defects([A[:n, :n] for A, _ in steps], missed) * sampled.sizes[:n, None]
    return reference, steps


# ---- both ---------------------------------------------------------------------------------------------------------


def _controller(
    sampled: SampledMechanism,
    H: float,
    trajectory: ReferenceTrajectory,
    *,
    gains: Sequence[Array],
    bounds: Mapping[str, Any],
    prediction: LinearPrediction,
) -> Controller:
    """The controller with start values and the limits of corrections; gains are those of states divided by sizes."""
    symbols = sampled.symbols
    starts = {parameter: float(symbols.parameters[parameter]) for parameter in symbols.start_parameters.values()}
    for i, m in enumerate(sampled.moves):
        starts |= dict(zip(motion_names(m), map(float, trajectory.motion[i, :, 0]), strict=True))
    at = trajectory.states[:, 0], trajectory.motion[:, :, 0], prediction.directions
    return Controller(
        name=sampled.name,
        component=symbols.goal.component,
        moves=sampled.moves,
        step_size=H,
        free=sampled.free,
        states=sampled.states,
        trajectory=trajectory,
        gains=np.array([sampled.input_sizes[:, None] * K / sampled.sizes for K in gains]),
        correction_limits=_correction_limits(sampled, trajectory, bounds),
        prediction=prediction,
        values=symbols.goal.values,
        sizes=sampled.sizes,
        energy=sampled.energy,
        time=sampled.time,
        starts=starts,
        perturbations=_perturbations(sampled, *at, starts),
    )


def _perturbations(
    sampled: SampledMechanism, reference: Array, sigma: Array, directions: Array, starts: Mapping[str, float]
) -> tuple[dict[str, float], ...]:
    """Start values that lead into all directions."""
    parameters, sizes = sampled.symbols.start_parameters, sampled.sizes[:, None]
    if sampled.is_constrained:  # rates have to keep the constraints, too
        rates = sampled.rates_off(reference, sigma, directions)
        names = [*sampled.states, *(f"{name}_dot" for name in sampled.names)]
        columns = np.vstack([sizes * directions, rates]).T.tolist()
        keys = [parameters.get(name, name) for name in names]
        return tuple({k: x for k, x in zip(keys, column, strict=True) if k in starts} for column in columns)
    axes = {*Orientation.quaternion}
    columns = [{sampled.states[i]: float(x[i]) for i in np.flatnonzero(x)} for x in (sizes * directions).T]
    rotations = ({parameters[name]: x for name, x in column.items()} for column in columns if axes & column.keys())
    names = {parameter: name for name, parameter in parameters.items()}
    singles = [names.get(start, start) for start in starts]
    return (*rotations, *({parameters.get(n, n): sampled.start_sizes[n]} for n in singles if n not in axes))


def _correction_limits(
    sampled: SampledMechanism, trajectory: ReferenceTrajectory, bounds: Mapping[str, Any]
) -> dict[str, Array]:
    """What corrections and their two rates may be at each knot, by the names of a Regulator: (moves, knots)."""
    shape = len(sampled.moves), trajectory.times.size
    n = len(sampled.names)
    forces, masses = np.split(np.array([sampled.forces(x[:n], sigma) for x, sigma in trajectory.points]), [1], axis=2)
    limits = {name: np.empty(shape) for pair in _PAIRS for name in pair}
    allowed: dict[str, Any] = {v.name: (v.minimum, v.maximum) for v in sampled.symbols.model.inputs} | dict(bounds)
    for i, m in enumerate(sampled.moves):
        for n, (low, high) in enumerate(_PAIRS):
            least, most = _ends(allowed[motion_names(m)[n]])
            limits[low][i] = np.minimum(0.0, least - trajectory.motion[i, n])
            limits[high][i] = np.maximum(0.0, most - trajectory.motion[i, n])
    for j, m in enumerate(sampled.moves):
        if f"{m}_force" not in bounds:
            continue
        sizes = np.abs(masses[:, j])
        if np.min(sizes.max(axis=1)) <= _MASSLESS * np.max(sizes):
            raise PlanError(
                f"{sampled.name}: bounds of {m}_force: the effective mass at {m} vanishes where it is held, so that no "
                f"acceleration tells the force; bound {m}_ddot"
            )
        least, most = _ends(bounds[f"{m}_force"])
        left = np.array([np.minimum(0, least - forces[:, j, 0]), np.maximum(0, most - forces[:, j, 0])])
        acts = sizes > _MASSLESS * sizes.max()
        for i in np.flatnonzero(acts.any(axis=0)):  # each takes its share
            low, high = np.sort(left / np.where(acts[:, i], masses[:, j, i] * acts.sum(axis=1), _MASSLESS), axis=0)
            limits["lowest"][i] = np.maximum(limits["lowest"][i], low)
            limits["highest"][i] = np.minimum(limits["highest"][i], high)
    ahead = np.arange(trajectory.times.size)[:, None] + np.arange(_AHEAD + 1)
    last = trajectory.times.size - 1
    ahead = ahead % max(1, last) if trajectory.after == "repeats" else np.minimum(ahead, last)
    low = {name for name, _ in _PAIRS}
    return {name: (np.max if name in low else np.min)(values[:, ahead], axis=2) for name, values in limits.items()}


def _ends(pair: Sequence[float | None]) -> tuple[float, float]:
    low, high = pair
    return -_FAR if low is None else low, _FAR if high is None else high


def _bounded(sampled: SampledMechanism) -> dict[str, tuple[int, int]]:
    """Move and derivative, or 3 for the force, by the names of what regulators can bound."""
    names = [(*motion_names(m), f"{m}_force") for m in sampled.moves]
    return {name: (i, n) for i, quantities in enumerate(names) for n, name in enumerate(quantities)}


def _checked(
    sampled: SampledMechanism, bounds: Mapping[str, Any], at: Array | None = None
) -> dict[str, tuple[float, float]]:
    """Bounds that the regulators can keep; and that what is held keeps, (moves, 3)."""
    quantities = _bounded(sampled)
    for name, pair in bounds.items():
        if name not in quantities:
            raise PlanError(f"bounds of {name!r}: the regulators bound {', '.join(quantities)}")
        i, n = quantities[name]
        held = () if at is None or n == 3 else (at[i, n],)
        low, high = _ends(pair) if isinstance(pair, (tuple, list)) and len(pair) == 2 else (0.0, 0.0)
        if not all(a < b for a, b in pairwise((low, *held, high))):
            order = " < ".join(["low", *(f"{x:g}" for x in held), "high"])
            raise PlanError(f"bounds of {name} = {shown(pair)}: give (low, high) with {order}")
    return dict(bounds)


def unmoved(steps: Sequence[Step]) -> list[int]:
    """Directions that stay as they are, whatever is done."""
    n = len(steps[0][0])
    return [
        i for i in range(n) if all(np.allclose(A[i], np.eye(n)[i]) and not np.any(np.abs(B[i]) > 0) for A, B in steps)
    ]


def _named(sampled: SampledMechanism, directions: Array, places: Sequence[int]) -> tuple[str, ...]:
    """Names of the states that some of the directions are."""
    return tuple(n for n, row in zip(sampled.states, directions, strict=True) if set(np.flatnonzero(row)) & set(places))


def _combination(sampled: SampledMechanism, directions: Array, u: Array) -> str:
    """What a row of directions stands for, in names."""
    part = np.linalg.pinv(directions).T @ u
    vector = part / sampled.sizes
    places = [i for i in range(vector.size) if abs(part[i]) > 1e-3 * np.max(np.abs(part))]  # not what H adds
    terms = [f"{vector[i] / vector[places[0]]:+.3g}" for i in places]
    text = " ".join(f"{term[0]} {term[1:]} {sampled.states[i]}" for term, i in zip(terms, places, strict=True))
    return text.removeprefix("+ ").removeprefix("1 ")


def _refuse_growth(sampled: SampledMechanism, directions: Array, U: Array, A: Array) -> None:
    """Refuse what grows and cannot be reached."""
    if U.size and np.max(np.abs(np.linalg.eigvals(U.T @ A @ U))) > 1 + 1e-6:
        values, vectors = np.linalg.eig((U.T @ A @ U).T)
        worst = np.real(vectors[:, int(np.argmax(np.abs(values)))])
        raise PlanError(_cannot(sampled, directions, U @ worst))


def _cannot(sampled: SampledMechanism, directions: Array, u: Array) -> str:
    text = _combination(sampled, directions, u)
    return f"{sampled.name} cannot be held there: to first order {', '.join(sampled.moves)} cannot change {text}"
