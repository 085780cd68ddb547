"""Optimal control as a nonlinear program: Gauss-Legendre collocation, solved by IPOPT through CasADi's Opti.

In each interval the state is the polynomial through its first point whose rates hold at ``DEGREE`` Gauss points; the
controls are numbers at these points.  The scheme is symplectic: adjoints follow from the program's multipliers, and the
Hamiltonian H = cost + adjoint · rates is constant along an extremal up to the error of the mesh.

A mesh is a row of arcs with durations of their own, all unknown where the duration is; in an arc rows of the path may
be held at a bound, which is how switching instants are found to the last digits.  Phases of contacts have an arc each:
there the state jumps between arcs, by impulses that are unknowns, too.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from itertools import pairwise
from typing import Any

import casadi as ca
import numpy as np
from scipy.linalg import null_space
from scipy.sparse import csc_matrix
from scipy.sparse.linalg import splu

from liaisons.base.arrays import Floats
from liaisons_motion.planning.problems import Problem, Rows

DEGREE = 5
"""Collocation points in an interval: of order 10 at its ends."""

_ACTIVE_DISTANCE = 1e-7
"""Distance from a bound, in units of the row's size, below which a row is active at a solution of IPOPT."""
_MOST_ITERATIONS = 400
"""Of IPOPT, without a solution nearby: those that converge take 50 to 200."""
_SUCCESSES = ("Solve_Succeeded", "Solved_To_Acceptable_Level")
_STOPS = ("User_Requested_Stop", "NonIpopt_Exception_Thrown", "Maximum_WallTime_Exceeded", "Maximum_CpuTime_Exceeded")


POINTS = np.array(ca.collocation_points(DEGREE, "legendre"))
"""Gauss points in (0, 1)."""
POWERS = np.arange(DEGREE)
TO_POWERS = np.linalg.inv(POINTS[:, None] ** POWERS)
"""Values at the Gauss points -> coefficients of the polynomial through them."""
A = (POINTS[:, None] ** (POWERS + 1) / (POWERS + 1)) @ TO_POWERS
"""Runge-Kutta matrix of the collocation."""
B = (1 / (POWERS + 1)) @ TO_POWERS
"""Its weights."""


@dataclass(frozen=True)
class Arc:
    """A part of a mesh: its number of equal intervals, and the rows of the path that are held at a bound."""

    intervals: int
    active_bounds: tuple[tuple[int, float], ...] = ()


def interval_count(arcs: Sequence[Arc]) -> int:
    """Number of intervals of all arcs."""
    return sum(arc.intervals for arc in arcs)


def phase_points(problem: Problem, arcs: Sequence[Arc]) -> list[tuple[Problem, slice]]:
    """The problem of each phase with its collocation points; without phases the whole problem with all points."""
    ends = np.cumsum([0, *(arc.intervals * DEGREE for arc in arcs)]).tolist()
    if not problem.phases:
        return [(problem, slice(0, ends[-1]))]
    return [(phase, slice(*pair)) for phase, pair in zip(problem.phases, pairwise(ends), strict=True)]


@dataclass(frozen=True, eq=False)
class CollocatedTrajectory:
    """States and controls on a mesh: n states, c controls, m intervals in all."""

    arcs: tuple[Arc, ...]
    durations: Floats  # of the arcs [s]
    knots: Floats  # states at the ends of the intervals (n, m + 1)
    inner: Floats  # states at the collocation points (n, m · DEGREE)
    controls: Floats  # (c, m · DEGREE)

    @property
    def breaks(self) -> Floats:
        """Instants [s] of the ends of the intervals, (m + 1,)."""
        ends = np.append(0.0, np.cumsum(self.durations))
        arcs = zip(ends[:-1], self.arcs, self.durations, strict=True)
        inside = [start + float(T) * np.arange(1, arc.intervals) / arc.intervals for start, arc, T in arcs]
        return np.sort(np.concatenate([ends, *inside]))

    @property
    def instants(self) -> Floats:
        """Instants [s] of the collocation points, (m · DEGREE,)."""
        breaks = self.breaks
        return (breaks[:-1, None] + np.diff(breaks)[:, None] * POINTS).ravel()

    def evaluate(self, function: ca.Function, inside: slice = slice(None)) -> Floats:
        """Values (rows, points) of a function of states and controls at all or some collocation points."""
        inner, controls = self.inner[:, inside], self.controls[:, inside]
        return np.array(function.map(inner.shape[1])(inner, controls))

    def cost_and_rates(self, problem: Problem) -> tuple[Floats, Floats]:
        """Cost (m · DEGREE,) and rates of the states (n, m · DEGREE) at the collocation points."""
        parts = phase_points(problem, self.arcs)
        cost, rates = (
            np.hstack([self.evaluate(getattr(phase, name), inside) for phase, inside in parts])
            for name in ("cost", "rates")
        )
        return cost.ravel(), rates

    def hamiltonian(self, problem: Problem, adjoints: Floats) -> Floats:
        """Cost + adjoints · rates at the collocation points."""
        cost, rates = self.cost_and_rates(problem)
        return cost + (adjoints * rates).sum(axis=0)

    def interpolated(self, arcs: tuple[Arc, ...], durations: Floats) -> CollocatedTrajectory:
        """The trajectory on another mesh, by the polynomials of the intervals, stretched to its duration."""
        blank = CollocatedTrajectory(arcs, durations, *(np.zeros((0, 0)),) * 3)
        breaks, scale = self.breaks, durations.sum()

        def resampled(rows: Floats, times: Floats) -> Floats:
            """Values of rows at times of the other mesh; at a break those before it."""
            own_times = times / scale * breaks[-1]
            interval = np.searchsorted(breaks[1:-1], own_times)
            fractions = (own_times - breaks[interval]) / np.diff(breaks)[interval]
            points = interval[:, None] * DEGREE + np.arange(DEGREE)
            return (rows[:, points] * (fractions[:, None] ** POWERS @ TO_POWERS)).sum(axis=-1)

        knots, inner = (resampled(self.inner, times) for times in (blank.breaks, blank.instants))
        return replace(blank, knots=knots, inner=inner, controls=resampled(self.controls, blank.instants))


@dataclass(frozen=True, eq=False)
class Clock:
    """Time limit of all solutions together, with progress and interrupts.

    :param limit: [s].
    :param show: function that shows the elapsed seconds.
    :param interrupts: interrupts from the keyboard, collected because CasADi swallows exceptions.
    """

    limit: float = 60.0
    show: Callable[[float], None] | None = None
    interrupts: Sequence[int] = ()
    begin: float = field(default_factory=time.perf_counter, init=False)

    @property
    def elapsed(self) -> float:
        """Elapsed time [s], at most the limit."""
        return min(self.limit, time.perf_counter() - self.begin)

    @property
    def remaining(self) -> float:
        """Remaining time [s], at least 0.01."""
        return max(1e-2, self.limit - self.elapsed)

    @property
    def is_interrupted(self) -> bool:
        """Whether there was an interrupt from the keyboard."""
        return len(self.interrupts) > 0

    @property
    def is_over(self) -> bool:
        """Whether no time is left, or there was an interrupt."""
        return self.is_interrupted or self.elapsed >= self.limit

    def tick(self, _iteration: int) -> None:
        """Show the elapsed time, or raise what was interrupted; IPOPT calls it at each iteration.

        :raises KeyboardInterrupt: after an interrupt, to end IPOPT.
        """
        if self.show is not None:
            self.show(self.elapsed)
        if self.is_interrupted:
            raise KeyboardInterrupt


@dataclass(frozen=True, eq=False)
class Solution:
    """A solution of the nonlinear program, or the last iterate."""

    problem: Problem
    trajectory: CollocatedTrajectory
    cost: float
    status: str  # of IPOPT
    hamiltonian: Floats  # at the collocation points; constant along an extremal
    adjoints: Floats  # (n, m · DEGREE)
    end_multipliers: Floats  # dJ/d(row at the end), of rows that are given as numbers
    residual: float = 0.0  # the largest violation of an equation
    finished: bool = True  # False: stopped on the way
    starts: int = 1  # of how many it is the best,
    optima: int = 1  # with so many different costs

    @property
    def succeeded(self) -> bool:
        """Whether IPOPT reports success."""
        return self.status in _SUCCESSES

    @property
    def ends_search(self) -> bool:
        """Whether no further attempt is needed, or there is no time for one."""
        return self.succeeded or not self.finished


def in_si(problem: Problem, solution: Solution) -> Solution:
    """A solution of the problem in relative units as one in SI units."""
    return _rescaled_solution(problem, solution, 1)


def in_relative_units(problem: Problem, solution: Solution) -> Solution:
    """A solution in SI units as one of the problem in relative units."""
    return _rescaled_solution(problem.relative_problem, solution, -1)


def _rescaled_solution(problem: Problem, solution: Solution, power: int) -> Solution:
    """A solution of the same problem in other units, as one of this problem.

    :param power: of the scales by which its numbers are multiplied, 1 or -1.
    """
    scales, path = problem.scales, solution.problem.path
    X, U, ends = (size[:, None] ** power for size in (scales.states, scales.controls, problem.end.sizes))
    time, cost = scales.time**power, scales.cost**power

    def active_bound(i: int, bound: float) -> tuple[int, float]:
        """The active bound of the i-th row in the units of this problem."""
        return i, float(problem.path.low[i] if bound == path.low[i] else problem.path.high[i])

    trajectory, (low, high) = solution.trajectory, problem.duration
    if low == high:
        time = low / float(trajectory.durations.sum())  # to the last digit
    return replace(
        solution,
        problem=problem,
        trajectory=CollocatedTrajectory(
            arcs=tuple(
                replace(arc, active_bounds=tuple(active_bound(*row) for row in arc.active_bounds))
                for arc in trajectory.arcs
            ),
            durations=trajectory.durations * time,
            knots=trajectory.knots * X,
            inner=trajectory.inner * X,
            controls=trajectory.controls * U,
        ),
        cost=solution.cost * cost,
        hamiltonian=solution.hamiltonian * (cost / scales.time**power),
        adjoints=solution.adjoints * (cost / X),
        end_multipliers=solution.end_multipliers * (cost / ends.ravel()),
    )


@dataclass(frozen=True, eq=False)
class _Program:
    """The nonlinear program: unknowns, expressions and constraints of CasADi's Opti."""

    opti: ca.Opti
    durations: Any  # (1, arcs)
    knots: Any
    inner: Any
    controls: Any
    later: list[int]  # first points of the phases but the first
    after: Any  # states there
    impulses: Any  # of the contacts there
    residuals: Any  # of the equations at the collocation points, and at the ends of the intervals
    cost: Any


def solve(
    problem: Problem,
    guess: CollocatedTrajectory,
    clock: Clock,
    *,
    to_nearest_end: bool = False,
    shift: Floats | None = None,
    is_near: bool = False,
) -> Solution:
    """Solve the problem on the mesh of the guess.

    :param clock: time limit, at which the last iterate is returned as not finished.
    :param to_nearest_end: minimise the distance from the end instead of the cost.
    :param shift: displacement of the end.
    :param is_near: the guess is close to the solution, so that IPOPT starts with a small barrier.
    """
    program = _constrained_program(problem, guess, to_nearest_end=to_nearest_end, shift=shift)
    opti = program.opti
    status = _run_ipopt(
        opti,
        is_near=is_near,
        most_iterations=200 if to_nearest_end else 100 if is_near else _MOST_ITERATIONS,
        clock=clock,
    )

    def value(expression: Any, *shape: int) -> Floats:
        """Value of an expression at the last iterate."""
        return np.asarray(opti.debug.value(expression), dtype=float).reshape(shape, order="F")

    n, c, m = len(problem.states), len(problem.controls), program.knots.shape[1] - 1
    points = m * DEGREE
    trajectory = CollocatedTrajectory(
        arcs=guess.arcs,
        durations=value(program.durations, len(guess.arcs)),
        knots=value(program.knots, n, m + 1),
        inner=value(program.inner, n, points),
        controls=value(program.controls, c, points),
    )
    duals = value(opti.lam_g, -1)
    mu, nu = (part.reshape(n, -1, order="F") for part in np.split(duals[: n * (points + m)], [n * points]))
    adjoints = -(np.repeat(nu, DEGREE, axis=1) + (mu @ np.kron(np.eye(m), A)) / np.tile(B, m))
    multipliers, equalities = np.zeros(len(problem.end.labels)), problem.end.equalities
    if equalities and not to_nearest_end:
        multipliers[equalities] = -duals[-len(equalities) :]
    return Solution(
        problem=problem,
        trajectory=trajectory,
        cost=float(opti.debug.value(program.cost)),
        status=status,
        hamiltonian=trajectory.hamiltonian(problem, adjoints),
        adjoints=adjoints,
        end_multipliers=multipliers,
        residual=float(np.abs(value(program.residuals, -1)).max()),
        finished=status not in _STOPS and not clock.is_interrupted,
    )


def _constrained_program(
    problem: Problem, guess: CollocatedTrajectory, *, to_nearest_end: bool = False, shift: Floats | None = None
) -> _Program:
    """The nonlinear program with cost and constraints.

    The equations come first, the values at the end last, so that their multipliers can be told.  Arguments are those
    of :func:`solve`.
    """
    program = _collocated_program(problem, guess)
    opti = program.opti
    constraints = [program.residuals == 0, *_constraints(problem, guess, program)]
    end = problem.end.function(program.knots[:, -1]) - (0 if shift is None else shift)
    if to_nearest_end:
        opti.minimize(ca.sumsqr(end - ca.fmin(ca.fmax(end, problem.end.low), problem.end.high)))
    else:
        constraints += _row_constraints(problem.end, end)
        opti.minimize(program.cost)
    opti.subject_to(constraints)
    return program


def _constraints(problem: Problem, guess: CollocatedTrajectory, program: _Program) -> Iterator[ca.MX]:
    """All constraints but the equations and the end."""
    yield from _duration_constraints(problem, guess, program)
    first = 0
    for k, arc in enumerate(guess.arcs):
        yield from _path_constraints(problem.phase(k), arc, first, program)
        yield from _degree_constraints(problem.phase(k), arc, first, program)
        first += arc.intervals
    yield from _junction_constraints(problem, program)
    yield from _row_constraints(problem.start, problem.start.function(program.knots[:, 0]))
    for i in problem.closed:
        yield program.knots[i, -1] == program.knots[i, 0]
    yield from _loop_start_constraint(problem, program)


def reduced_hessian_eigenvalues(solution: Solution, clock: Clock) -> Floats | None:
    """Eigenvalues of the reduced Hessian at a solution, ascending, relative to the greatest absolute one.

    None if IPOPT leaves the solution, or they are not finite.

    The Hessian is that of the Lagrangian, in the L2 norm of the controls: states follow from controls by the linearised
    equations, and its directions are those in which active constraints do not change.
    """
    problem, trajectory = solution.problem, solution.trajectory
    opti = _constrained_program(problem, trajectory).opti
    if _run_ipopt(opti, is_near=True, most_iterations=_MOST_ITERATIONS, clock=clock, barrier=1e-5) not in _SUCCESSES:
        return None
    x, g, value = opti.x, opti.g, opti.debug.value
    hessian, _ = ca.hessian(opti.f + ca.dot(opti.lam_g, g), x)
    W, J = (csc_matrix(value(matrix)) for matrix in (hessian, ca.jacobian(g, x)))
    row, low, high = map(value, (g, opti.lbg, opti.ubg))
    n, c = len(problem.states), len(problem.controls)
    m = trajectory.knots.shape[1] - 1
    equations = n * m * (DEGREE + 1)
    bound = np.minimum(np.abs(row - low), np.abs(row - high)) <= _ACTIVE_DISTANCE
    active = np.flatnonzero(bound[equations:]) + equations
    follow = slice(n, n + equations)  # knots but the first, and points inside
    free = np.r_[0:n, n + equations : x.numel()]
    lengths = np.repeat(np.diff(trajectory.breaks), DEGREE) * np.tile(B, m)
    weight = np.concatenate([np.ones(n), np.sqrt(np.repeat(lengths, c)), np.ones(free.size - n - c * m * DEGREE)])
    Z = np.zeros((x.numel(), free.size))
    Z[free, np.arange(free.size)] = 1
    with suppress(ValueError, RuntimeError):  # numbers that are not finite, or singular
        Z[follow] = -splu(J[:equations, follow]).solve(J[:equations][:, free].toarray())
        Z /= weight
        tangent = null_space(J[active] @ Z, rcond=_ACTIVE_DISTANCE) if active.size else np.eye(free.size)
        eigenvalues = np.linalg.eigvalsh(tangent.T @ (Z.T @ (W @ Z)) @ tangent)
        return eigenvalues / np.abs(eigenvalues).max(initial=np.finfo(float).tiny)
    return None


def _duration_constraints(problem: Problem, guess: CollocatedTrajectory, program: _Program) -> Iterator[ca.MX]:
    """Constraints by which unknown durations are positive, and they and their sum in their ranges."""
    if program.durations.is_constant():
        return
    yield ca.vec(program.durations) >= 1e-6 * float(guess.durations.sum())
    durations = [program.durations[k] for k in range(len(problem.phases))]
    for part, duration in zip((*problem.phases, problem), (*durations, ca.sum2(program.durations)), strict=True):
        yield _range_constraint(part.duration[0], duration, part.duration[1])


def _collocated_program(problem: Problem, guess: CollocatedTrajectory) -> _Program:
    """The nonlinear program before it has constraints: unknowns, residuals of the equations, and cost."""
    arcs = guess.arcs
    m = interval_count(arcs)
    n, c, points = len(problem.states), len(problem.controls), m * DEGREE
    opti = ca.Opti()
    knots, inner, controls = opti.variable(n, m + 1), opti.variable(n, points), opti.variable(c, points)
    parts = phase_points(problem, arcs)
    later = [inside.start for _, inside in parts[1:]]
    contacts = problem.junctions[0].function.size1_in(2) if later else 0
    after, impulses = opti.variable(n, len(later)), opti.variable(contacts, len(later))
    for unknown, first in ((knots, guess.knots), (inner, guess.inner), (controls, guess.controls)):
        opti.set_initial(unknown, first)
    for k, first in enumerate(later):
        opti.set_initial(after[:, k], guess.inner[:, first : first + DEGREE] @ TO_POWERS[0])
    durations = _durations(opti, problem, guess)
    lengths = [ca.repmat(durations[i] / arc.intervals, 1, arc.intervals * DEGREE) for i, arc in enumerate(arcs)]
    h = ca.horzcat(*lengths)  # of the interval of each point
    running, rates = (_at_points(name, parts, inner, controls) for name in ("cost", "rates"))
    begin = ca.MX(knots[:, :-1])
    for k, first in enumerate(later):
        begin[:, first // DEGREE] = after[:, k]
    begins = ca.reshape(ca.repmat(begin, DEGREE, 1), n, points)
    gained = rates * ca.repmat(h, n, 1)
    to_stages, to_ends = (ca.sparsify(ca.DM(np.kron(np.eye(m), block))) for block in (A.T, B[:, None]))
    return _Program(
        opti=opti,
        durations=durations,
        knots=knots,
        inner=inner,
        controls=controls,
        later=later,
        after=after,
        impulses=impulses,
        residuals=ca.veccat(inner - begins - gained @ to_stages, knots[:, 1:] - begin - gained @ to_ends),
        cost=ca.dot(ca.vec(running * h), np.tile(B, m)),
    )


def _durations(opti: ca.Opti, problem: Problem, guess: CollocatedTrajectory) -> ca.MX:
    """Durations of the arcs (1, arcs), which are unknown unless there is one whose duration is given."""
    (low, high), count = problem.duration, len(guess.arcs)
    if low == high and count == 1:
        return ca.MX(ca.DM(low))
    total, durations = float(guess.durations.sum()), opti.variable(1, count)
    opti.set_initial(durations, guess.durations[None, :] * np.clip(total, low, high) / total)
    return durations


def _at_points(name: str, parts: Iterable[tuple[Problem, slice]], states: ca.MX, controls: ca.MX) -> ca.MX:
    """Values of a function of each phase at its points, by the name of the function; a column a point."""
    return ca.horzcat(
        *(
            getattr(phase, name).map(inside.stop - inside.start)(states[:, inside], controls[:, inside])
            for phase, inside in parts
        )
    )


def _junction_constraints(problem: Problem, program: _Program) -> Iterator[ca.MX]:
    """Constraints of each junction on the states before and after it, impulses and controls."""
    for k, (rows, first) in enumerate(zip(problem.junctions, program.later, strict=True)):
        controls = program.controls[:, first : first + DEGREE] @ TO_POWERS[0]
        before = program.knots[:, first // DEGREE]
        values = rows.function(before, program.after[:, k], program.impulses[:, k], controls)
        yield from _row_constraints(rows, values)


def _run_ipopt(opti: ca.Opti, *, is_near: bool, most_iterations: int, clock: Clock, barrier: float = 1e-7) -> str:
    """Run IPOPT, and return its status."""
    ipopt = {
        "print_level": 0,
        "sb": "yes",
        "tol": 1e-10,
        "constr_viol_tol": 1e-12,
        "acceptable_tol": 1e-8,
        "acceptable_constr_viol_tol": 1e-10,
        "acceptable_iter": 25,
        "bound_relax_factor": 0.0,
        "max_iter": most_iterations,
        "max_wall_time": clock.remaining,
    }
    stay = {"mu_init": barrier, "bound_push": 1e-9, "bound_frac": 1e-9} if is_near else {}
    opti.callback(clock.tick)  # also keeps the last iterate at an interrupt
    opti.solver("ipopt", {"print_time": False, "ipopt": ipopt | stay})
    try:
        opti.solve()
    except RuntimeError:  # the status says why
        if not opti.stats():
            raise
    return str(opti.stats()["return_status"])


def _row_constraints(rows: Rows, values: Any) -> Iterator[ca.MX]:
    """Constraints by which values of rows are in their ranges; equalities come last, as one."""
    equalities = rows.equalities
    for i in range(len(rows.labels)):
        if i not in equalities:
            yield _range_constraint(rows.low[i], values[i], rows.high[i])
    if equalities:
        yield values[equalities] == rows.low[equalities]


def _range_constraint(low: float, value: Any, high: float) -> ca.MX:
    """The constraint low <= value <= high."""
    if low == high:
        return value == low
    if np.isinf(low):
        return value <= high
    return value >= low if np.isinf(high) else ca.Opti.bounded(low, value, high)


def _path_constraints(problem: Problem, arc: Arc, first: int, program: _Program) -> Iterator[ca.MX]:
    """Constraints that keep each row of the path in its range along an arc, or hold it at a bound.

    They act at the collocation points, on states at the knots, too.

    A moved coordinate is held at its bound by its control, a function of states by its rate: each has its value at the
    start of the arc, and no rate along it.

    :param first: interval of the arc.
    """
    if not problem.path.labels:
        return
    start, instant = problem.start, set(problem.path.function.jac_sparsity(0, 1).row())  # rows with controls
    last = first + arc.intervals
    inner = slice(first * DEGREE, last * DEGREE)
    held = dict(arc.active_bounds)
    points = arc.intervals * DEGREE, program.inner[:, inner], program.controls[:, inner]
    path, rates = (function.map(points[0])(*points[1:]) for function in (problem.path.function, path_rates(problem)))
    initial_labels = {start.labels[i] for i in start.equalities}
    for i, label in enumerate(problem.path.labels):
        low, high = problem.path.low[i], problem.path.high[i]
        if i in held and label in problem.moves and problem.control_order > 0:
            begin = {label: held[i], f"{label}_dot": 0.0} if problem.control_order == 2 else {label: held[i]}
            for name in begin.keys() - (initial_labels if first == 0 else set()):
                yield program.knots[problem.states.index(name), first] == begin[name]
            yield ca.vec(program.controls[problem.moves.index(label), inner]) == 0
            continue
        row = ca.vec(path[i, :])
        if i in held and problem.control_order > 0 and i not in instant:
            begin = problem.path.function(program.knots[:, first], program.controls[:, first * DEGREE])
            yield begin[i] == held[i]
            yield ca.vec(rates[i, :]) == 0
            continue
        yield row == held[i] if i in held else _range_constraint(low, row, high)
        if label in problem.states and i not in held:
            between = program.knots[problem.states.index(label), max(first, 1) : last]
            if between.numel():
                yield _range_constraint(low, ca.vec(between), high)


def path_rates(problem: Problem) -> ca.Function:
    """Function (state, controls) -> rates of the rows of the path, as far as they depend on states."""
    X, U = ca.SX.sym("X", len(problem.states)), ca.SX.sym("U", len(problem.controls))
    rows = problem.path.function(X, U)
    return ca.Function("path_rates", [X, U], [ca.densify(ca.jtimes(rows, X, problem.rates(X, U)))])


def _loop_start_constraint(problem: Problem, program: _Program) -> Iterator[ca.MX]:
    """Constraint by which a loop with a free start begins where a weighted sum of σ is extremal; else none."""
    closed = {problem.states[i] for i in problem.closed}
    if problem.control_order == 0 or problem.phases or not problem.is_loop or closed & set(problem.start.labels):
        return
    if problem.control_order == 1:
        rates = program.controls[:, :DEGREE] @ TO_POWERS[0]
    else:
        rates = program.knots[problem.indices(f"{name}_dot" for name in problem.moves), 0]
    yield ca.dot(anchor_weights(len(problem.moves)), rates) == 0


def _degree_constraints(problem: Problem, arc: Arc, first: int, program: _Program) -> Iterator[ca.MX]:
    """Constraints by which the degree of the controls in an arc is lower by one, if the cost has only states.

    Otherwise the controls are not unique: multiples of the Legendre polynomial of degree ``DEGREE``, which vanishes at
    all points, cost nothing if they alternate from interval to interval.

    :param first: interval of the arc.
    """
    inner = slice(first * DEGREE, (first + arc.intervals) * DEGREE)
    held = {problem.path.labels[i] for i, _ in arc.active_bounds}
    on_states_only = [problem.cost.jac_sparsity(0, i).nnz() > 0 for i in (0, 1)] == [True, False]
    driven = (*problem.moves, *problem.forces)
    if on_states_only and held <= set(driven):  # else all may be needed to hold the row
        for i, name in enumerate(driven):
            if name not in held:
                yield TO_POWERS[None, -1] @ ca.reshape(program.controls[i, inner], DEGREE, -1) == 0


def anchor_weights(count: int) -> Floats:
    """Weights of the coordinates in a sum of σ that varies even where one of them is at a bound."""
    return np.power(0.6, np.arange(count))
