"""``hold``: sampled feedback that keeps a mechanism at an equilibrium, or at a planned motion.

At each communication point the regulators read the mechanism's states and add corrections to σ, which third-order
integrators generate (see :class:`liaisons.models.Regulator`), and to forces, which are constant from sample to sample
(:class:`liaisons.models.ForceRegulator`), or beside a planned σ straight lines, for the mechanism interpolates there.
To first order the FMUs perform x(t + H) = A x(t) + B w over one step, see :mod:`liaisons_motion.holding.sampling`.
The gains solve Riccati's equation of this discrete system, or of a periodic one; uncontrollable directions have none.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np

from liaisons.base.arguments import check_finite, check_positive, merged_start_values, name_dictionary, shown
from liaisons.base.array_names import by_name
from liaisons.base.arrays import Floats
from liaisons.base.clocks import CLOCK_ERROR, time_rounding
from liaisons.base.port_names import port_names
from liaisons.errors import PlanError
from liaisons.language import Orientation
from liaisons.library import Target
from liaisons_motion.holding.controllers import After, Controller, ReferenceTrajectory
from liaisons_motion.holding.feedback import (
    RANK,
    Step,
    controllability_matrix,
    discrete_lqr_gains,
    distributed_correction,
    image_basis,
    named_sum,
    periodic_riccati,
    reachable_subspace,
    rest_offsets,
    riccati_recursion,
    spectral_radius,
    transition_matrix,
)
from liaisons_motion.holding.observers import observe
from liaisons_motion.holding.sampling import SampledMechanism, in_directions
from liaisons_motion.holding.subjects import planned_motion, sampled_subject
from liaisons_motion.planning import Plan

_BOUND_NAMES = ("least", "most", "slowest", "fastest", "lowest", "highest")
"""Names that a Regulator has for the bounds of a correction, of its rate and of its acceleration."""
_UNBOUNDED = 1e30
_LEAST_GROWTH = 1 + 1e-6
"""Multipliers above it grow."""
_MOST_STEPS = 10_000
"""Most communication steps of a plan: each has a matrix, 5 kB for the 24 states that a Regulator reads."""
_DRIFT_WEIGHT = 1e-3
"""Weight of the rate of a moved coordinate that is not held, beside 1 of a held one: without a weight nothing stops
it.  Alone, v' = w, it decays by exp(-t √(weight / effort)): in 30 radians, after the held coordinates."""
_INTEGRATION_ERROR = 1e-10
"""Relative error of the matrix of a step, by the Runge-Kutta steps of :mod:`liaisons_motion.holding.sampling`."""
_NEGLIGIBLE_MASS = 1e-3
"""An effective mass below this part of the greatest on the trajectory is 0: bounds on its force would be bounds on
an acceleration a thousand times as large as elsewhere."""
_KNOTS_AHEAD = 6
"""Corrections respect the bounds at this many knots to come, after which their accelerations have decayed to
exp(-6) = 2.5e-3."""
_LARGEST_MISS = 1e-3
"""Largest miss of the plan's end, relative to sizes: its square, which first order neglects, is ``_CLOSURE``."""
_FORCE_CORRECTIONS = 8
"""Most corrections of held forces: each is Newton's step, which squares the miss."""
_HELD_MISS = 1e-9
"""Miss of a plan's end by held forces that needs no further correction, relative to sizes: a thousandth of
``_CLOSURE``."""
_CLOSURE = 1e-6
"""Tolerance for calling a plan closed, or at rest at its end, relative to sizes: verified plans keep 1e-8."""


def hold(
    motion: Plan | Target,
    /,
    at: Mapping[str, Any] | None = None,
    moves: str | Sequence[str] | None = None,
    *,
    controls: str | Sequence[str] | None = None,
    step_size: float | None = None,
    weights: Mapping[str, float] | None = None,
    effort: float = 1.0,
    bounds: Mapping[str, tuple[float, float]] | None = None,
    measured: str | Sequence[str] | None = None,
    noise: Mapping[str, float] | None = None,
    disturbance: Mapping[str, float] | None = None,
    bias: Mapping[str, float] | None = None,
    unknown_forces: Mapping[str, float] | None = None,
    deviations: Mapping[str, float] | None = None,
    start_values: Mapping[str, float] | None = None,
    **keywords: float,
) -> Controller:
    """Design the sampled feedback that keeps a mechanism at an equilibrium, or at a planned motion.

    ::

        regulator = hold("Pendulum", {"theta": np.pi, "pivot_x": 0}, "pivot_x", step_size=0.02)
        run = regulator.simulate(10, theta_0=np.pi + 0.2)

        regulator = hold("FurutaPendulum", {"swing": np.pi}, controls="turn_force", bounds={"turn_force": (-0.2, 0.2)})
        run = regulator.simulate(3, swing_0=np.pi + 0.1)

        regulator = hold(plan("Satellite", end={"attitude": (0, 0, 0, 1)}, duration=2.0))
        run = regulator.simulate(30, inputs={"torque_x": lambda t: 0.01})

    Once a step the regulators read the states x and choose accelerations of σ, or forces, w, that minimise the sum of Σ
    weight (x - x_0)² + effort w² over all steps.  A force acts one step after the sample from which it is computed; in
    a plan that also moves coordinates it is linear between samples.  Each variable is divided by its typical size: 1
    for an angle; for a length, the length at which the mass has the moment of inertia of the angles (for a pendulum its
    length).  Time is measured in radians of the free motion.  A moved coordinate on which no equation depends (the
    angle of a wheel) is held only if it is given by name.  A closed plan is repeated; if the mechanism can rest at the
    end of a plan, it is held there.

    :param motion: a plan; or name, file or class of a mechanism.
    :param at: equilibrium: values of coordinates, and of rates of σ; others as declared, at rest.
    :param moves: active coordinates that the feedback moves; unless given all, those of the plan, or none beside
        controls.
    :param controls: forces that the feedback sets, ``"theta_force"``.  Values that ``at`` does not give them are those
        at which the mechanism rests.
    :param step_size: sampling period, the distance of communication points [s]; unless given about a sixteenth radian
        of the free motion, for a plan at most a fortieth of its duration.
    :param weights: of states by name; unless given 1 for coordinates, 0 for momenta.
    :param effort: weight of accelerations and forces; by default 1, like that of the coordinates (Bryson's rule), since
        all variables are divided by their sizes.
    :param bounds: (low, high) of σ, σ̇, σ̈, controls and operator forces, ``{"pivot_x_ddot": (-5, 5)}``, at which the
        feedback saturates, beside those of the plan.  Bounds of forces become bounds of σ̈ along the undisturbed motion.
    :param measured: outputs that are measured: the regulators read the estimates of an observer (LQG); with ``noise``,
        ``disturbance``, ``bias``, ``unknown_forces`` and ``deviations`` as for :func:`liaisons.observe`.
    :param start_values: parameters by name; ``keywords`` are further ones, where they are no settings.
    :raises PlanError: if the mechanism is not in equilibrium, or a state is not controllable, or with ``measured`` not
        observable; the state is named.
    """
    values = merged_start_values("hold", start_values, keywords, PlanError)
    check_positive("effort", effort, PlanError)
    weights, bounds = (
        name_dictionary("weights", weights or {}, PlanError),
        name_dictionary("bounds", bounds or {}, PlanError),
    )
    sampled, step_size = sampled_subject("hold", motion, at, moves, controls, step_size, values)
    arguments = sampled, step_size, _state_weights(sampled, weights), effort
    planned = isinstance(motion, Plan)
    controller = _hold_along(motion, *arguments, bounds=bounds) if planned else _hold_at_rest(*arguments, bounds=bounds)
    if measured is None:
        if any((noise, disturbance, bias, unknown_forces, deviations)):
            raise PlanError("hold: noise and disturbances are for an observer: give measured, too")
        return controller
    samples = controller.trajectory.times / step_size
    if not np.allclose(samples, np.round(samples), rtol=0, atol=1e-3):
        raise PlanError(
            f"{sampled.name}: σ̈ jumps between two samples of {step_size:g} s: give a step_size that divides its arcs"
        )
    observer = observe(
        motion,
        measured,
        noise or {},
        disturbance,
        at=at,
        moves=None if planned else sampled.moves or None,
        controls=None if planned else sampled.controls or None,
        bias=bias,
        unknown_forces=unknown_forces,
        deviations=deviations,
        step_size=step_size,
        start_values=values,
    )
    return replace(controller, observer=observer)


def _perturbed_radius(matrix: Floats) -> float:
    """Greatest spectral radius of the matrix and of four perturbations as large as the integration error."""
    random, size = np.random.default_rng(0), _INTEGRATION_ERROR * np.max(np.abs(matrix), initial=0.0)
    near = [matrix, *(matrix + random.uniform(-size, size, matrix.shape) for _ in range(4))]
    return max(map(spectral_radius, near))


def _state_weights(sampled: SampledMechanism, weights: Mapping[str, float]) -> Floats:
    """Weights of the squares of all deviations, in the order of the states: those given, others as declared."""
    by_state = {name: float(name in sampled.free) for name in sampled.states}
    drifting = (move for move in sampled.moves if move not in sampled.held_moves)
    by_state |= {f"{move}_dot": _DRIFT_WEIGHT for move in drifting}
    for name, weight in weights.items():
        if name not in by_state:
            raise PlanError(f"{sampled.name}: weights of {name!r}: the states are {', '.join(sampled.states)}")
        check_finite(f"weight of {name}", weight, PlanError)
        if weight < 0:
            raise PlanError(f"{sampled.name}: weight of {name} = {weight:g}: must be >= 0")
        by_state[name] = weight
    return np.array([*by_state.values()])


# ---- an equilibrium -----------------------------------------------------------------------------------------------


def _hold_at_rest(
    sampled: SampledMechanism, step_size: float, weights: Floats, effort: float, *, bounds: Mapping[str, Any]
) -> Controller:
    """The controller of least cost at an equilibrium.

    :raises PlanError: if a held coordinate is not controllable.
    """
    sigma = sampled.sigma
    planned = np.dstack([sigma, sigma])
    planned[:, :2, 1] += step_size * sigma[:, 1:]
    reference, steps = sampled.steps(np.array([0.0, step_size]), planned, step_size)
    trajectory = ReferenceTrajectory(np.zeros(1), planned[:, :, :1], reference[:, :1], "rests")
    D = sampled.directions(reference[:, 0], sigma)
    ((A, B),) = in_directions(steps, [D, D])
    Q = (D.T * weights) @ D
    constant = _constant_directions([(A, B)])
    steps_per_time = sampled.time / step_size
    is_reached = np.all(np.abs(A) < 1 / RANK)  # else no direction stands out from rounding
    V, U = reachable_subspace((A - np.eye(len(A))) * steps_per_time, B * steps_per_time) if is_reached else (A, A)
    R = effort * np.eye(B.shape[1])
    K = np.zeros((len(R), len(A)))
    with suppress(np.linalg.LinAlgError):
        if is_reached and V.size:
            K = discrete_lqr_gains(V.T @ A @ V, V.T @ B, V.T @ Q @ V, R) @ V.T
    if not (is_reached and _perturbed_radius(V.T @ (A - B @ K) @ V) < 1):
        raise PlanError(
            f"{sampled.name} cannot be held there: {', '.join(sampled.driven)} every {step_size:g} s hardly reach all "
            "that falls; Riccati's equation has no solution in 16 digits"
        )
    if U.size:
        offsets, beyond = _offsets_at_rest(sampled, D, A, (V, U), constant)
        K -= K @ V @ offsets @ beyond.T
    _refuse_bounds(sampled, bounds, sigma)
    return _controller(
        sampled,
        step_size,
        trajectory,
        gains=[K],
        directions=[D],
        bounds=bounds,
        loop=A - B @ K,
        reach=V,
        conserved=_states_along(sampled, D, constant),
        returns=True,
        cost=None if U.size else (B, Q, R),
    )


def _offsets_at_rest(
    sampled: SampledMechanism, D: Floats, A: Floats, subspaces: tuple[Floats, Floats], constant: list[int]
) -> tuple[Floats, Floats]:
    """Offsets of the reachable directions where the others stay off, and a basis of these, the constant ones first.

    :param D: directions; ``A``: transition of a step in these; ``constant``: indices of directions that stay.
    :param subspaces: bases of what is reachable, and of the rest.
    :raises PlanError: if what is not reachable grows, or moves a held coordinate.
    """
    V, U = subspaces
    fixed = np.eye(len(A))[:, constant]
    U = np.hstack([fixed, image_basis(U - fixed @ (fixed.T @ U))])
    is_bounded = spectral_radius(U.T @ A @ U) < _LEAST_GROWTH
    free = [sampled.states.index(name) for name in sampled.free]
    offsets, missed = rest_offsets(A, D[free], V, U)
    for j in range(U.shape[1]):
        if not is_bounded or (j >= len(constant) and missed[j] > RANK):
            raise _uncontrollable_error(sampled, D, U[:, j])
    return offsets, U


# ---- a plan -------------------------------------------------------------------------------------------------------


def _hold_along(
    motion: Plan,
    sampled: SampledMechanism,
    step_size: float,
    weights: Floats,
    effort: float,
    *,
    bounds: Mapping[str, Any],
) -> Controller:
    """The controller of least cost along a plan.

    :raises PlanError: if a growing deviation is not controllable, or the gains do not converge.
    """
    trajectory, steps, returns = _reference_trajectory(motion, sampled, step_size)
    D = [sampled.directions(*point) for point in trajectory.states_and_motion]
    steps, costs = in_directions(steps, D), [(one.T * weights) @ one for one in D]
    R = effort * np.eye(len(sampled.driven))
    (V, U), gains = _feedback_along(
        sampled, trajectory, steps, costs, R=R, D=D[-1], step_size=step_size, returns=returns
    )
    constant = _constant_directions(steps)
    fixed = np.eye(len(U))[:, constant]
    conserved = _states_along(sampled, D[0], constant)
    conserved += tuple(_sum_of_states(sampled, D[-1], u) for u in image_basis(U - fixed @ (fixed.T @ U)).T)
    _refuse_bounds(sampled, bounds)
    quantities = _bounded_quantities(sampled)
    planned_bounds = {name: pair for name, pair in motion.goal.bounds.items() if name in quantities}
    return _controller(
        sampled,
        step_size,
        trajectory,
        gains=gains,
        directions=D,
        bounds={**planned_bounds, **bounds},
        loop=transition_matrix(steps, gains),
        reach=V,
        conserved=conserved,
        returns=returns,
        cost=None,
    )


def _feedback_along(
    sampled: SampledMechanism,
    trajectory: ReferenceTrajectory,
    steps: list[Step],
    costs: list[Floats],
    *,
    R: Floats,
    D: Floats,
    step_size: float,
    returns: bool,
) -> tuple[tuple[Floats, Floats], list[Floats]]:
    """Bases of what is reachable and of the rest, and gains of each step and after the last, by Riccati's recursion.

    After the plan the mechanism rests, or the plan is repeated, or nothing is controlled any more.

    :param steps: in directions; ``costs``: of deviations; ``R``: of controls; ``D``: directions at the end.
    :raises PlanError: if a growing deviation is not controllable, or the gains do not converge.
    """
    transition, inputs = transition_matrix(steps), controllability_matrix(steps)
    after = np.zeros((len(R), D.shape[1]))
    if trajectory.after == "rests":
        y = trajectory.states[: len(sampled.names), -1]
        planned = trajectory.motion[:, :, [-1, -1]]
        _, at_rest = sampled.steps(np.array([0.0, step_size]), planned, step_size, y)
        at_rest = in_directions(at_rest, [D, D])
        ((A, B),) = at_rest
        V, U = reachable_subspace(A - np.eye(len(A)), np.hstack([B, inputs]))
        _refuse_uncontrolled_growth(sampled, D, U, A)
        end = periodic_riccati(at_rest, costs[-1:], R)
        after = end and end[0][0]
        solution = end and riccati_recursion(steps, costs[:-1], R, end[1])
    elif returns:
        V, U = reachable_subspace(transition - np.eye(len(transition)), inputs)
        _refuse_uncontrolled_growth(sampled, D, U, transition)
        solution = periodic_riccati(steps, costs[:-1], R)
    else:
        V, U = reachable_subspace(np.zeros_like(transition), inputs)
        solution = riccati_recursion(steps, costs[:-1], R, costs[-1])
    if solution is None or after is None:
        raise PlanError(f"{sampled.name}: no feedback keeps {', '.join(sampled.free)}: the gains do not converge")
    return (V, U), [*solution[0], after]


def _reference_trajectory(
    motion: Plan, sampled: SampledMechanism, step_size: float
) -> tuple[ReferenceTrajectory, list[Step], bool]:
    """The plan at its communication points, its linearised steps, and whether it ends where it begins.

    Where it begins up to the mechanism's orientation is enough.

    :raises PlanError: for too many steps, or if they miss the plan's end.
    """
    T, moves, order = motion.duration, motion.goal.moves, motion.problem.control_order
    if T / step_size > _MOST_STEPS:
        words = f"more than {_MOST_STEPS} steps; give a longer one"
        raise PlanError(f"{sampled.name}: step_size = {step_size:g} over {T:g} s: {words}")
    times, instant = _communication_points(motion, sampled, step_size)
    planned = planned_motion(motion, times)
    reference, steps = _corrected_steps(motion, sampled, times, planned, step_size)
    gap = np.abs(reference[:, -1] - reference[:, 0])
    extents = np.maximum(sampled.sizes, np.abs(reference).max(axis=1))
    may_jump = {name for m in moves for name in port_names(m)[order:]} | {*sampled.controls}
    open_states = {sampled.states[i] for i in np.flatnonzero(gap > _CLOSURE * extents).tolist()}
    open_states -= {*sampled.cyclic_coordinates, *may_jump}
    at_rest = planned[:, :, -1].copy()
    stops = [order < 2 or m in sampled.held_moves for m in sampled.driven]
    size = sampled.input_sizes[:, None] * sampled.time ** np.array([2.0, 1.0, 0.0])  # of σ, σ̇, σ̈
    size[len(moves) :] = sampled.input_sizes[len(moves) :, None]  # of forces
    is_moving = np.abs(at_rest[:, 1]) > _CLOSURE * size[:, 1]
    at_rest[stops, 1] = at_rest[:, 2] = 0.0
    after: After = "ends"
    last = planned[:, :, -1]
    end = reference[: len(sampled.names), -1]
    if sampled.controls:
        at_rest = sampled.balanced(end, at_rest, sampled.controls)
    if not open_states:
        after, last = "repeats", planned[:, :, 0]
    elif order < 2 or not np.any(is_moving & stops):
        rates = np.abs(sampled.rates(end, at_rest)) * sampled.time
        ends = [_finite_ends(motion.goal.bounds.get(name, (None, None))) for name in sampled.controls]
        has_force = all(a <= x <= b for x, (a, b) in zip(at_rest[len(moves) :, 0], ends, strict=True))
        if has_force and np.all(rates <= _CLOSURE * sampled.sizes[: len(end)]):
            after, last = "rests", at_rest
    if not moves:
        planned[:, :, -1] = last
        reference[sampled.rows.index(len(sampled.names)) :, -1] = last[:, 0]
    elif np.any(np.abs(last - planned[:, :, -1]) > _CLOSURE * size):
        times = np.append(times[:-1], [T - instant, T])
        planned = np.dstack([planned[:, :, :-1], planned_motion(motion, times[-2:-1]), last])
        reference, steps = _corrected_steps(motion, sampled, times, planned, step_size)
    returns = all(name.endswith(Orientation.quaternion) for name in open_states)
    return ReferenceTrajectory(times, planned, reference, after), steps, returns


def _communication_points(motion: Plan, sampled: SampledMechanism, step_size: float) -> tuple[Floats, float]:
    """Equal steps between the switches of a plan, with points just before jumps; and how long before [s]."""
    T = motion.duration
    instant = max(motion.jump_lead, 3 * time_rounding(T))  # so far apart a run distinguishes two instants
    if sampled.interpolates_forces:
        instant = 10 * CLOCK_ERROR * step_size  # and regulators of forces two samples
    parts = []
    for begin, end in pairwise([0.0, *motion.switches, T]):
        count = max(1, int(np.ceil((end - begin) / step_size - 1e-9)))
        parts.append(np.linspace(begin, end, count, endpoint=False))
    before_jumps = motion.switches[: len(motion.switches) * bool(motion.goal.moves)] - instant  # forces: at a sample
    return np.unique(np.concatenate([*parts, before_jumps, [T]])), instant


def _corrected_steps(
    motion: Plan, sampled: SampledMechanism, times: Floats, planned: Floats, step_size: float
) -> tuple[Floats, list[Step]]:
    """States and linearised steps along the plan; the states are corrected to end at its end.

    Without the feedback integration errors may grow on the way.  Forces, which between communication points are means
    of the planned ones, or straight lines, are corrected themselves, in place, where bounds leave room.

    :raises PlanError: if the steps miss the plan's end by more than a linear correction can mend.
    """
    n, planned_end = len(sampled.names), by_name(motion.problem.states, motion.solution.trajectory.knots[:, -1])

    def motion_and_miss() -> tuple[Floats, list[Step], Floats]:
        """States and steps, and by how much they miss the plan's end, divided by sizes."""
        reference, steps = sampled.steps(times, planned, step_size)
        ends = zip(sampled.names, reference[:n, -1], strict=True)
        missed = np.array([planned_end.get(name, x) - x for name, x in ends])
        return reference, steps, missed / sampled.sizes[:n]

    reference, steps, missed = motion_and_miss()
    for _ in range(_FORCE_CORRECTIONS if sampled.controls else 0):
        if np.max(np.abs(missed)) <= _HELD_MISS:
            break
        _correct_forces(motion, sampled, planned, steps, missed)
        reference, steps, missed = motion_and_miss()
    if not np.max(np.abs(missed), initial=0.0) <= _LARGEST_MISS:
        i = int(np.argmax(np.abs(missed)))
        raise PlanError(
            f"{sampled.name}: in steps of {step_size:.3g} s the motion misses the plan's end, {sampled.names[i]} by "
            f"{missed[i] * sampled.sizes[i]:.2g}: give a shorter step_size, or plan it with a finer mesh (accuracy)"
        )
    reference[:n] += distributed_correction([A[:n, :n] for A, _ in steps], missed) * sampled.sizes[:n, None]
    return reference, steps


def _correct_forces(
    motion: Plan, sampled: SampledMechanism, planned: Floats, steps: list[Step], missed: Floats
) -> None:
    """Add to the sampled forces, in place, the least correction that makes up for a miss of the end, to first order.

    Each is weighed by its distance from its bounds, so that what is at a bound stays there.  The last one is not
    corrected, nor, where forces are interpolated, the first one, which may have to be the same.
    """
    n, c = len(sampled.names), len(sampled.moves)
    columns = [sampled.states.index(name) for name in sampled.controls]
    to_end, effects = np.eye(n), list[Floats]()
    for A, B in reversed(steps):
        if effects:
            effects[-1] += to_end @ B[:n, c:]  # a force at the end of this step is that at the start of the next one
        effects.append(to_end @ A[:n, columns])
        to_end = to_end @ A[:n, :n]
    sizes = sampled.input_sizes[c:, None]
    forces = planned[c:, 0, :-1]
    ends = np.array([motion.goal.bounds.get(name, (None, None)) for name in sampled.controls], dtype=float)[:, :, None]
    room = np.fmin(forces - ends[:, 0], ends[:, 1] - forces) / sizes  # not-a-number where there is no bound
    weights = np.where(np.isnan(room), 1.0, room.clip(0.0, 1.0))
    weights[:, :1] *= not sampled.interpolates_forces
    effect = np.stack(effects[::-1], axis=2).transpose(0, 2, 1)  # (states, steps, forces)
    weighed = (effect * weights.T).reshape(n, -1)
    change = np.linalg.lstsq(weighed, missed, rcond=1e-10)[0].reshape(-1, len(columns))
    forces += sizes * (change * weights.T).T


# ---- both ---------------------------------------------------------------------------------------------------------


def _controller(
    sampled: SampledMechanism,
    step_size: float,
    trajectory: ReferenceTrajectory,
    *,
    gains: Sequence[Floats],
    directions: Sequence[Floats],
    bounds: Mapping[str, Any],
    **prediction: Any,
) -> Controller:
    """The controller with these gains, its start values and limits of corrections.

    :param gains: at the knots, in coordinates of the directions of deviation there.
    """
    symbols = sampled.symbols
    starts = sampled.start_values
    for i, m in enumerate(sampled.moves):
        starts |= by_name(port_names(m)[:3], map(float, trajectory.motion[i, :, 0]))
    starts |= by_name(sampled.controls, map(float, trajectory.motion[len(sampled.moves) :, 0, 0]))
    return Controller(
        name=sampled.name,
        goal=symbols.goal,
        moves=sampled.moves,
        controls=sampled.controls,
        step_size=step_size,
        free=sampled.free,
        ports=tuple(sampled.free_inputs),
        states=sampled.states,
        trajectory=trajectory,
        gains=np.array(
            [
                sampled.input_sizes[:, None] * (K @ np.linalg.pinv(D)) / sampled.sizes
                for K, D in zip(gains, directions, strict=True)
            ]
        ),
        correction_limits=_correction_limits(sampled, trajectory, bounds),
        force_limits={name: _finite_ends(bounds[name]) for name in sampled.controls if name in bounds},
        input_sizes=sampled.input_sizes,
        directions=directions[0],
        final_directions=directions[-1],
        sizes=sampled.sizes,
        energy=sampled.energy,
        time=sampled.time,
        starts=starts,
        perturbations=_perturbations(sampled, trajectory, directions[0], starts),
        **prediction,
    )


def _perturbations(
    sampled: SampledMechanism, trajectory: ReferenceTrajectory, directions: Floats, starts: Mapping[str, float]
) -> tuple[dict[str, float], ...]:
    """Differences of start values that change the states along each direction of deviation."""
    parameters = sampled.symbols.start_parameters
    changes = by_name(sampled.states, sampled.sizes[:, None] * directions)
    changes |= sampled.rate_changes(*next(trajectory.states_and_motion), directions)
    rows = {parameters.get(name, name): row for name, row in changes.items()}
    return tuple(
        {name: float(row[j]) for name, row in rows.items() if name in starts} for j in range(directions.shape[1])
    )


def _correction_limits(
    sampled: SampledMechanism, trajectory: ReferenceTrajectory, bounds: Mapping[str, Any]
) -> dict[str, Floats]:
    """Limits of the corrections of σ, σ̇ and σ̈ by parameters of a Regulator, each (moves, knots).

    :raises PlanError: if a force is bounded where the effective mass vanishes.
    """
    n, last, motion = len(sampled.names), trajectory.times.size - 1, trajectory.motion[: len(sampled.moves)]
    if not sampled.moves:
        return {}
    points = ((sampled.full_state(x[:n]), *sigma.T) for x, sigma in trajectory.states_and_motion)
    along = np.array([sampled.forces_and_mass(*point) for point in points])
    forces, masses = along[:, :, 0], along[:, :, 1:]
    allowed: dict[str, Any] = {v.name: (v.minimum, v.maximum) for v in sampled.symbols.model.inputs}
    allowed |= bounds
    ends = np.array([[_finite_ends(allowed[name]) for name in port_names(m)[:3]] for m in sampled.moves])
    low = np.minimum(0.0, ends[:, :, :1] - motion)  # (moves, 3, knots)
    high = np.maximum(0.0, ends[:, :, 1:] - motion)
    for j, m in enumerate(sampled.moves):
        if f"{m}_force" not in bounds:
            continue
        sizes = np.abs(masses[:, j])
        if np.min(sizes.max(axis=1)) <= _NEGLIGIBLE_MASS * np.max(sizes):
            raise PlanError(
                f"{sampled.name}: bounds of {m}_force: the effective mass at {m} vanishes where it is held, so that no "
                f"acceleration tells the force; bound {m}_ddot"
            )
        least, most = _finite_ends(bounds[f"{m}_force"])
        margins = np.array(
            [
                np.minimum(0, least - forces[:, j]),
                np.maximum(0, most - forces[:, j]),
            ]
        )
        acts = sizes > _NEGLIGIBLE_MASS * sizes.max()
        shares = acts.sum(axis=1)
        for i in np.flatnonzero(acts.any(axis=0)):
            mass = np.where(acts[:, i], masses[:, j, i] * shares, _NEGLIGIBLE_MASS)
            least, most = np.sort(margins / mass, axis=0)
            low[i, 2] = np.maximum(low[i, 2], least)
            high[i, 2] = np.minimum(high[i, 2], most)
    ahead = np.add.outer(np.arange(last + 1), np.arange(_KNOTS_AHEAD + 1))
    ahead = ahead % max(1, last) if trajectory.after == "repeats" else np.minimum(ahead, last)
    low, high = low[:, :, ahead].max(axis=3), high[:, :, ahead].min(axis=3)
    limits = np.stack([low, high], axis=2).reshape(len(low), len(_BOUND_NAMES), -1)
    return by_name(_BOUND_NAMES, limits.swapaxes(0, 1))


def _finite_ends(bounds: Sequence[float | None]) -> tuple[float, float]:
    """Both ends of a range, -1e30 and 1e30 for None."""
    low, high = bounds
    return -_UNBOUNDED if low is None else low, _UNBOUNDED if high is None else high


def _bounded_quantities(sampled: SampledMechanism) -> dict[str, tuple[int, int]]:
    """Index of the moved coordinate, and order of the rate, of all that regulators bound by name; 3 for a force."""
    names = [(*port_names(m)[:3], f"{m}_force") for m in sampled.moves]
    quantities = {name: (i, n) for i, quantities in enumerate(names) for n, name in enumerate(quantities)}
    return quantities | {name: (len(names) + i, 0) for i, name in enumerate(sampled.controls)}


def _refuse_bounds(sampled: SampledMechanism, bounds: Mapping[str, Any], point: Floats | None = None) -> None:
    """Raise an error for bounds that regulators cannot keep.

    :param point: σ and its rates at an equilibrium (moves, 3), which have to lie inside.
    """
    quantities = _bounded_quantities(sampled)
    for name, pair in bounds.items():
        if name not in quantities:
            raise PlanError(f"bounds of {name!r}: the regulators bound {', '.join(quantities)}")
        i, n = quantities[name]
        held = () if point is None or n == 3 else (point[i, n],)
        is_pair = isinstance(pair, (tuple, list)) and len(pair) == 2
        low, high = _finite_ends(pair) if is_pair else (0.0, 0.0)
        if not all(a < b for a, b in pairwise((low, *held, high))):
            chain = " < ".join(["low", *(f"{x:g}" for x in held), "high"])
            raise PlanError(f"bounds of {name} = {shown(pair)}: give (low, high) with {chain}")


def _constant_directions(steps: Sequence[Step]) -> list[int]:
    """Indices of the directions along which deviations are constant, whatever the inputs are."""
    rows = enumerate(np.eye(len(steps[0][0])))
    return [i for i, row in rows if all(np.allclose(A[i], row) and not B[i].any() for A, B in steps)]


def _states_along(sampled: SampledMechanism, directions: Floats, chosen: Sequence[int]) -> tuple[str, ...]:
    """Names of the states that change along the chosen directions."""
    changed = np.flatnonzero(directions[:, list(chosen)].any(axis=1))
    return tuple(sampled.states[i] for i in changed.tolist())


def _sum_of_states(sampled: SampledMechanism, directions: Floats, form: Floats) -> str:
    """Text of a linear form on the directions, as a sum of states."""
    return named_sum(sampled.states, np.linalg.pinv(directions).T @ form, sampled.sizes)


def _refuse_uncontrolled_growth(sampled: SampledMechanism, directions: Floats, U: Floats, A: Floats) -> None:
    """Raise an error if an uncontrollable deviation grows.

    :param U: basis of the uncontrollable directions; ``A``: matrix of a step or a round.
    """
    uncontrolled = U.T @ A @ U
    if spectral_radius(uncontrolled) > _LEAST_GROWTH:
        values, vectors = np.linalg.eig(uncontrolled.T)
        worst = np.real(vectors[:, int(np.argmax(np.abs(values)))])
        raise _uncontrollable_error(sampled, directions, U @ worst)


def _uncontrollable_error(sampled: SampledMechanism, directions: Floats, form: Floats) -> PlanError:
    """Error that names an uncontrollable sum of states, a linear form on the directions."""
    text = _sum_of_states(sampled, directions, form)
    driven = ", ".join(sampled.driven)
    return PlanError(f"{sampled.name} cannot be held there: to first order {driven} cannot change {text}")
