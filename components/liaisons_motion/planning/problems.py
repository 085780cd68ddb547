"""The problem of optimal control of a goal: rates, cost and rows in CasADi.

The plan controls σ, σ̇ or σ̈: the lowest derivative on which motion, cost and constraints allow a choice, as tests at
states nearby show.  Its number is the order of control:

=====  ===========================  ==================================================================================
order  state, beside (q, p)         when
=====  ===========================  ==================================================================================
0      -; σ is chosen, it may jump  neither motion, cost nor bounds depend on σ̇
1      σ; σ̇ is chosen               the motion is linear in σ̇; no row has σ̈ or forces, and none at an end rates
2      σ, σ̇; σ̈ is chosen            else
=====  ===========================  ==================================================================================

States on which neither rows nor cost depend are left out (where a falling cat is), and so are conserved ones.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Self

import casadi as ca
import numpy as np

from liaisons.algebra import closure, stack
from liaisons.base.array_names import by_name
from liaisons.base.arrays import Floats
from liaisons.base.port_names import port_names
from liaisons.errors import PlanError, suggestion
from liaisons.language import Orientation
from liaisons_motion.goals import Goal, GoalSymbols, goal_symbols, range_middle
from liaisons_motion.planning.goal_rows import GoalRows, Row, goal_rows, refuse_singular_mass, with_sizes


@dataclass(frozen=True, eq=False)
class Rows:
    """Scalar constraints: low <= function <= high."""

    labels: tuple[str, ...]
    function: ca.Function
    low: Floats
    high: Floats
    sizes: Floats

    @property
    def equalities(self) -> list[int]:
        """Indices of the rows with equal bounds."""
        return [int(i) for i in np.flatnonzero(self.low == self.high)]

    def in_relative_units(self, *sizes: Floats) -> Rows:
        """The constraints divided by their sizes, as a function of arguments divided by theirs."""
        function = _relative_function(self.function, self.sizes, *sizes)
        return replace(self, function=function, low=self.low / self.sizes, high=self.high / self.sizes)

    def violation(self, values: Floats) -> Floats:
        """Distances of values (rows,) or (rows, points) from the ranges of their rows; 0 inside."""
        return np.abs(values - values.T.clip(self.low, self.high).T)


@dataclass(frozen=True, eq=False)
class Scales:
    """Sizes of the variables of an optimal control problem."""

    states: Floats
    controls: Floats
    time: float
    energy: float
    cost: float


@dataclass(frozen=True, eq=False)
class Problem:
    """Optimal control problem: minimise ∫ cost dt with X' = rates(X, U) and rows at start, end and along the path."""

    name: str  # of the component
    moves: tuple[str, ...]
    control_order: int
    states: tuple[str, ...]
    controls: tuple[str, ...]  # of moved coordinates, then forces
    initial_state: Floats  # where it is free, as declared
    terminal_state: dict[str, float]  # states that are given at the end, quaternions of the nearer sign
    initial_sigma: Floats  # where σ is no state
    rates: ca.Function
    cost: ca.Function
    path: Rows
    start: Rows
    end: Rows
    closed: tuple[int, ...]  # states that end as they start
    duration: tuple[float, float]
    constrained: bool  # the states obey constraints, which straight lines would break
    mass: ca.Function  # Θ of the states
    start_names: tuple[str, ...]  # parameters of the FMU that are start values
    start_values: ca.Function  # these
    scales: Scales
    modes: Mapping[str, float] = field(default_factory=dict)  # values of the FMU's variables for modes of contacts
    phases: tuple[Problem, ...] = ()  # of contacts; their rates, cost, path and duration take the place of these
    junctions: tuple[Rows, ...] = ()  # between phases, of the states before and after, impulses and controls after

    @property
    def forces(self) -> tuple[str, ...]:
        """Names of the controls that are forces."""
        return self.controls[len(self.moves) :]

    @property
    def is_loop(self) -> bool:
        """Whether all moved coordinates are closed, and there are some."""
        closed = {self.states[i] for i in self.closed}
        return bool(self.moves) and bool(closed) and set(self.moves) <= closed

    def phase(self, k: int) -> Problem:
        """The k-th phase; the problem itself without phases."""
        return self.phases[k] if self.phases else self

    def indices(self, names: Iterable[str]) -> list[int]:
        """Indices of states by name."""
        return [self.states.index(name) for name in names]

    def end_values(self, state: Floats) -> Floats:
        """Values of the rows at the end (rows,) from the last state."""
        return np.array(self.end.function(state)).ravel()

    @cached_property
    def relative_problem(self) -> Problem:
        """The problem in units of its scales, whose numbers do not depend on units."""
        scales, X, U = self.scales, self.scales.states, self.scales.controls
        sizes, shape = by_name(self.states, X), U[: len(self.moves)] * scales.time**self.control_order
        low, high = self.duration
        return replace(
            self,
            initial_state=self.initial_state / X,
            terminal_state={name: value / sizes[name] for name, value in self.terminal_state.items()},
            initial_sigma=self.initial_sigma / shape,
            rates=_relative_function(self.rates, X / scales.time, X, U),
            cost=_relative_function(self.cost, np.array([scales.cost / scales.time]), X, U),
            path=self.path.in_relative_units(X, U),
            start=self.start.in_relative_units(X),
            end=self.end.in_relative_units(X),
            duration=(low / scales.time, high / scales.time),
            mass=_relative_function(self.mass, scales.energy * scales.time**2 / np.outer(shape, shape), X, U),
            phases=tuple(phase.relative_problem for phase in self.phases),
            junctions=tuple(
                rows.in_relative_units(X, X, np.ones(rows.function.size1_in(2)), U) for rows in self.junctions
            ),
        )


@dataclass(frozen=True, eq=False)
class StateCandidate:
    """A candidate for a state of the problem."""

    name: str
    symbol: ca.SX
    rate: ca.SX
    size: float


def smooth_problem(goal: Goal) -> Problem:
    """The problem of optimal control of a goal without phases.

    :raises PlanError: for an unknown name, with the nearest one, or a goal that cannot be reached.
    """
    symbols = goal_symbols(goal)
    rows = goal_rows(symbols)
    if goal.moves and any(r.label.endswith(("_force", "_power")) and r.label not in goal.controls for r in rows.path):
        refuse_singular_mass(symbols, "bounds on forces")
    _refuse_ends_out_of_bounds(symbols, rows)
    _refuse_rest_of_moving(symbols, rows.end)
    order = _control_order(symbols, rows)
    if order == 0:
        rows = replace(rows, start=[row for row in rows.start if row.label not in goal.moves])
    accelerations = symbols.motion[2][: len(goal.moves)]
    if order == 2 and symbols.depends(rows.relative_cost_and_path, accelerations):
        rows = replace(rows, start=[*rows.start, *rows_at_rest(symbols, {row.label for row in rows.start})])
    elif order == 2:
        _refuse_impulses(symbols, rows)
    states = candidate_states(symbols, order)
    closed = _closed_states(symbols, {state.name for state in states})
    conserved = _conserved_states(symbols, states, rows.start) - set(closed)
    needed = _needed_states(symbols, [state for state in states if state.name not in conserved], rows, closed)
    return _problem_in_states(symbols, rows, order, closed, [state for state in states if state.name in needed])


def problem_in_all_states(symbols: GoalSymbols, rows: GoalRows) -> Problem:
    """The problem that controls σ̈, with all states of the mechanism, σ and σ̇ as states."""
    states = candidate_states(symbols, 2)
    return _problem_in_states(symbols, rows, 2, _closed_states(symbols, {state.name for state in states}), states)


@dataclass(frozen=True, eq=False)
class _Functions:
    """Functions of state and controls, where the states that are constant have their initial values.

    :param fixed: symbols of those, and of derivatives of σ above the control; ``values``: theirs.
    """

    symbols: GoalSymbols
    X: ca.SX
    U: ca.SX
    fixed: ca.SX
    values: ca.SX

    @classmethod
    def in_states(
        cls, symbols: GoalSymbols, order: int, states: list[StateCandidate], initial: Mapping[str, float]
    ) -> Self:
        """Functions of some of the states; the others are constant.

        :param initial: values of all states.
        """
        moved, names = len(symbols.goal.moves), {state.name for state in states}
        constants = [state for state in candidate_states(symbols, order) if state.name not in names]
        X = ca.vertcat(*(state.symbol for state in states))
        U = stack(symbols.motion[order if i < moved else 0][i] for i in range(len(symbols.goal.driven)))
        absent = stack(motion[i] for motion in symbols.motion[order + 1 :] for i in range(moved))
        fixed = ca.vertcat(absent, *(state.symbol for state in constants))
        values = ca.SX(ca.DM([0.0] * absent.numel() + [initial[state.name] for state in constants]))
        return cls(symbols, X, U, fixed, values)

    def with_constants(self, expression: ca.SX) -> ca.SX:
        """An expression with the initial values of the states that are constant."""
        return ca.cse(ca.densify(ca.substitute(ca.SX(expression), self.fixed, self.values)))

    def of(self, label: str, expression: ca.SX, *arguments: ca.SX) -> ca.Function:
        """Function of the arguments, of state and controls unless given."""
        return ca.Function(label, arguments or [self.X, self.U], [self.with_constants(expression)])

    def of_rows(self, label: str, candidates: Iterable[Row], *arguments: ca.SX) -> Rows:
        """One function of the rows among the candidates that a plan can change."""
        with_constants = self.with_constants
        chosen = [r for r in candidates if _can_change(self.symbols, r, with_constants(r.expression), arguments, label)]
        low, high, sizes = (np.array([getattr(row, name) for row in chosen]) for name in ("low", "high", "size"))
        rows = self.of(label, stack(row.expression for row in chosen), *arguments)
        return Rows(tuple(row.label for row in chosen), rows, low, high, sizes)


def _problem_in_states(
    symbols: GoalSymbols, rows: GoalRows, order: int, closed: list[str], states: list[StateCandidate]
) -> Problem:
    """The problem with some of the states; the others are constant, with their initial values.

    :param order: of control; ``closed``: names of the states that end as they start.
    """
    goal, moved = symbols.goal, len(symbols.goal.moves)
    initial = initial_values(symbols, candidate_states(symbols, order), rows.start)
    functions = _Functions.in_states(symbols, order, states, initial)
    controls = (*(port_names(move)[order] for move in goal.moves), *goal.controls)
    X, U, names = functions.X, functions.U, tuple(state.name for state in states)
    path = functions.of_rows("path", rows.path, X, U)
    if goal.minimize == "time" and path.function.jac_sparsity(0, 1).nnz() == 0:
        raise PlanError(f"{symbols.name}: minimize = 'time' would take none: bound {', '.join(controls)}, or forces")
    _refuse_ends_of_controls(symbols, rows, U, controls)
    ranges = {row.label: (row.low, row.high) for row in rows.start if row.expression.is_symbolic()}
    initial = {name: range_middle(ranges.get(name), initial[name]) for name in names}
    constraints = ("constraints", "non_holonomic", "rheonomic_constraints")
    return Problem(
        name=symbols.name,
        moves=goal.moves,
        control_order=order,
        states=names,
        controls=controls,
        initial_state=np.array([*initial.values()]),
        terminal_state=_terminal_state(symbols, initial, rows.end),
        initial_sigma=symbols.initial_sigma[:moved],
        rates=functions.of("rates", ca.vertcat(*(state.rate for state in states))),
        cost=functions.of("cost", rows.cost),
        path=path,
        start=functions.of_rows("start", rows.start, X),
        end=functions.of_rows("end", rows.end, X),
        closed=tuple(names.index(name) for name in closed if name in names),
        duration=goal.duration,
        constrained=any(getattr(symbols.component, kind, ()) for kind in constraints),
        mass=functions.of("mass", symbols.mass),
        start_names=tuple(symbols.start_parameters.values()),
        start_values=functions.of("start_values", stack(symbols.signals[name] for name in symbols.start_parameters)),
        scales=Scales(
            states=np.array([state.size for state in states]),
            controls=np.append(symbols.motion_sizes[order][:moved], symbols.motion_sizes[0][moved:]),
            time=symbols.time,
            energy=symbols.energy,
            cost=rows.cost_size * symbols.time,
        ),
    )


def candidate_states(symbols: GoalSymbols, order: int) -> list[StateCandidate]:
    """States of the mechanism, then those of σ and its rates that are below the order of control."""
    columns = [(symbols.state_names, symbols.state, symbols.rates, symbols.state_sizes)]
    names = [tuple(port_names(move)[n] for move in symbols.goal.moves) for n in range(3)]
    columns += [(names[n], *symbols.motion[n : n + 2], symbols.motion_sizes[n]) for n in range(order)]
    return [
        StateCandidate(name, symbol[i], rate[i], sizes[i])
        for names, symbol, rate, sizes in columns
        for i, name in enumerate(names)
    ]


def rows_at_rest(symbols: GoalSymbols, specified: set[str]) -> list[Row]:
    """Rows σ̇ = 0 at the start, but for closed coordinates and for rates that are specified."""
    goal = symbols.goal
    if goal.is_expression(goal.start):
        return []
    rates = [(i, f"{name}_dot") for i, name in enumerate(goal.moves) if name not in goal.closed]
    return with_sizes(symbols, (Row(rate, symbols.motion[1][i]) for i, rate in rates if rate not in specified))


def _control_order(symbols: GoalSymbols, rows: GoalRows) -> int:
    """Order of the derivative of σ that is controlled, 0 to 2, by the table of the module."""
    if not symbols.goal.moves:
        return 0
    value, rate, acceleration = (motion[: len(symbols.goal.moves)] for motion in symbols.motion)
    declared = set(symbols.goal.moves) - set(symbols.start)  # where σ would start if it could not jump at once
    start = (row for row in rows.start if row.label not in declared)
    ends = ca.vertcat(*(row.relative_expression for row in (*start, *rows.end)))
    along = ca.vertcat(symbols.relative_rates, rows.relative_cost_and_path)
    curved = symbols.depends(symbols.scaled_jacobian(symbols.relative_rates, rate), rate)
    if curved or symbols.depends(ca.vertcat(ends, along), acceleration) or symbols.depends(ends, rate):
        return 2
    return int(bool(symbols.goal.closed) or symbols.depends(along, rate) or symbols.depends(ends, value))


def _closed_states(symbols: GoalSymbols, states: set[str]) -> list[str]:
    """Names of the states that end as they start, σ̇ of closed σ among them."""
    goal = symbols.goal
    for name in goal.closed:
        if name not in states:
            raise PlanError(f"{symbols.name}: closed = {name!r} is no state of the plan{suggestion(name, states)}")
    rates = [f"{name}_dot" for name in goal.closed if f"{name}_dot" in states and name in goal.moves]
    return [*goal.closed, *rates]


def initial_values(symbols: GoalSymbols, states: list[StateCandidate], start: list[Row]) -> dict[str, float]:
    """Initial values of all states by name."""
    values = {state.name: 0.0 for state in states}
    values |= by_name(symbols.state_names, map(float, symbols.first_state))
    values |= by_name(symbols.goal.moves, map(float, symbols.initial_sigma[: len(symbols.goal.moves)]))
    return values | {r.label: r.low for r in start if r.low == r.high and r.expression.is_symbolic()}


def _terminal_state(symbols: GoalSymbols, initial: dict[str, float], end: list[Row]) -> dict[str, float]:
    """Values of the states at the end that the goal gives, by name; quaternions of the sign nearer to the start."""
    rows = (row for row in end if row.label in initial)
    terminal = {row.label: float(np.clip(initial[row.label], row.low, row.high)) for row in rows}
    end_values = symbols.goal.end if isinstance(symbols.goal.end, Mapping) else {}
    for name, axes in symbols.quaternions.items():
        if end_values.get(name) is not None and set(axes) <= set(initial):
            goal = symbols.unit_quaternion(name, end_values[name])
            sign = -1.0 if goal @ [initial[axis] for axis in axes] < 0 else 1.0
            terminal |= by_name(axes, sign * goal)
    return terminal


def _conserved_states(symbols: GoalSymbols, states: list[StateCandidate], start: list[Row]) -> set[str]:
    """Names of the states that keep a number from the start: their rates vanish."""
    started = {row.label for row in start if row.low == row.high}
    relative = {state.name: state.rate * (symbols.time / state.size) for state in states if state.name in started}
    return {name for name, rate in relative.items() if symbols.vanishes(rate)}


def _needed_states(symbols: GoalSymbols, states: list[StateCandidate], rows: GoalRows, closed: list[str]) -> set[str]:
    """Names of the states on which constraints and cost depend, directly or through rates."""
    column = stack(state.symbol for state in states)
    uses = symbols.dependencies(stack(state.rate * (symbols.time / state.size) for state in states), column)
    acting = symbols.dependencies(
        ca.vertcat(rows.relative_cost_and_path, *(row.relative_expression for row in rows.end)), column
    )
    first = np.any([*acting, [state.name in closed for state in states]], axis=0)
    needed = {states[i].name for i in closure(uses, first)}
    if not needed:
        raise PlanError(f"{symbols.name}: nothing that {', '.join(symbols.goal.driven)} can change is part of the goal")
    return needed


def _can_change(symbols: GoalSymbols, row: Row, expression: ca.SX, arguments: Iterable[ca.SX], label: str) -> bool:
    """Whether a row, as an expression of arguments, depends on them: else it is constant.

    :raises PlanError: if a constant row at the end lies outside of its range.
    """
    if ca.depends_on(expression, ca.vertcat(*arguments)):
        return True
    value = float(ca.Function("value", [], [expression])()["o0"])
    rounding = symbols.rounding * row.size
    if label == "end" and not row.low - rounding <= value <= row.high + rounding:
        raise PlanError(
            f"{symbols.name}: end: {row.label} = {row.range} cannot be reached: it is conserved and stays {value:g}"
        )
    return False


def _refuse_ends_out_of_bounds(symbols: GoalSymbols, rows: GoalRows) -> None:
    """Raise an error for values at the start or at the end that lie outside of their bounds."""
    bounds = {row.label: row for row in rows.path}
    for label, ends in (("start", rows.start), ("end", rows.end)):
        for row in ends:
            bound = bounds.get(row.label, row)
            if row.expression.is_symbolic() and (row.high < bound.low or row.low > bound.high):
                raise PlanError(
                    f"{symbols.name}: {label}: {row.label} = {row.range} lies outside of its bounds {bound.range}"
                )


def _refuse_ends_of_controls(symbols: GoalSymbols, rows: GoalRows, controls: ca.SX, names: tuple[str, ...]) -> None:
    """Raise an error if rows at start or end depend on controls, which may take any value at an instant."""
    for label, ends in (("start", rows.start), ("end", rows.end)):
        for row in ends:
            if symbols.depends(row.relative_expression, controls):
                raise PlanError(
                    f"{symbols.name}: {label}: {row.label} depends on {', '.join(names)}, which may be anything at a "
                    f"single instant: ask for states, or set bounds on {row.label}"
                )


def _refuse_impulses(symbols: GoalSymbols, rows: GoalRows) -> None:
    """Raise an error if start or end has values of rates that may jump: there is no optimum.

    Shorter impulses cost less.
    """
    moves = symbols.goal.moves
    rates = [f"{name}_dot" for name in moves]
    labels = [row.label for row in (*rows.start, *rows.end) if row.label in rates]
    rheonomic = [item.name for item in getattr(symbols.component, "rheonomic_constraints", ()) if item.name in moves]
    if labels or rheonomic:
        name = (labels or rheonomic)[0].removesuffix("_dot")
        free = f", or leave {name}_dot free" if labels else ""
        raise PlanError(
            f"{symbols.name}: {name}_dot may jump at no cost, so that no motion is the best: bound or weigh "
            f"{name}_ddot, or bound {name}_force{free}"
        )


def _refuse_rest_of_moving(symbols: GoalSymbols, end: list[Row]) -> None:
    """Raise an error for an end at rest if a momentum other than 0 is conserved."""
    still = {row.label for row in end if row.low == row.high == 0}
    starts = symbols.start_parameters
    axes = {rate for orientation in getattr(symbols.component, "orientations", ()) for rate in orientation.rates}
    rates = [name for name in starts if name in axes or name in {f"{q}_dot" for q in symbols.state_names}]
    if not rates or not still.issuperset([*rates, *(f"{name}_dot" for name in symbols.goal.moves)]):
        return
    for i, name in enumerate(symbols.state_names):
        is_momentum = name not in starts or name.endswith(Orientation.momenta)
        value = float(symbols.start.get(name) or symbols.first_state[i])
        is_moving = abs(value) > symbols.rounding * symbols.state_sizes[i]
        if is_momentum and is_moving and symbols.vanishes(symbols.relative_rates[i]):
            raise PlanError(
                f"{symbols.name}: end: nothing can come to rest: {name} is conserved, and it is {value:g} at the start"
            )


def _relative_function(function: ca.Function, value_size: Floats, *sizes: Floats) -> ca.Function:
    """The function of arguments in units of their sizes, whose value is in units of its size."""
    arguments = [ca.SX.sym(f"x{i}", size.size) for i, size in enumerate(sizes)]
    result = function(*(x * ca.DM(size) for x, size in zip(arguments, sizes, strict=True)))
    return ca.Function(function.name(), arguments, [ca.densify(result / ca.DM(value_size))])
