"""What is asked of a plan, by names, and the problem of optimal control that it is: rates, cost and rows in CasADi.

Of the coordinates that are moved, σ, the plan chooses the highest derivative that the equations let it choose, tested
numerically at states nearby.  This is the order of control:

=====  ===========================  ==================================================================================
order  state, beside (q, p)         when
=====  ===========================  ==================================================================================
0      -; σ is chosen, it may jump  neither motion, cost nor bounds know σ̇
1      σ; σ̇ is chosen               the motion is linear in σ̇, and nobody asks for σ̈, forces or rates at an end
2      σ, σ̇; σ̈ is chosen            else
=====  ===========================  ==================================================================================

States that nothing asked for depends on are left out (the place of a falling cat), and so are those that are conserved.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from numbers import Real
from typing import Any, Literal, TypeAlias

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from liaisons.arguments import finite, listed, named, shown
from liaisons.errors import LiaisonsError, suggestion
from liaisons.expressions.formulas import FormulaError, formula
from liaisons.language import Chain, Mechanism, Orientation
from liaisons.library import Target, component, model
from liaisons.mechanics import Model
from liaisons.operators.scaling import Scales, base_scales, size

Expression: TypeAlias = "Callable[[Readings], Any] | str"
"""Of the mechanism's variables: ``lambda m: m.pivot_x_ddot**2``, or the same as text, ``"pivot_x_ddot**2"``."""
Value: TypeAlias = "float | tuple[float | None, float | None] | Sequence[float] | None"
"""A number; a range; four numbers for an orientation; None: free."""
Cost: TypeAlias = "Literal['motion', 'effort', 'time'] | Expression"


_ROUNDING = 1e-10
"""Nothing that is smaller than this, in units of its size, can be told from 0."""


class PlanError(LiaisonsError):
    """What is asked for cannot be planned, or was not reached."""


@dataclass(frozen=True, eq=False)
class Goal:
    """What a user asks for; the arguments of :func:`liaisons.plan`."""

    component: Target
    moves: tuple[str, ...]
    start: Mapping[str, Value] | Expression
    end: Mapping[str, Value] | Expression
    closed: tuple[str, ...]
    duration: tuple[float, float]
    minimize: Cost
    bounds: Mapping[str, tuple[float | None, float | None]]
    values: Mapping[str, float]


@dataclass(frozen=True, eq=False)
class Rows:
    """Scalars that have to lie in ranges: low <= function <= high."""

    labels: tuple[str, ...]
    function: ca.Function
    low: NDArray[np.float64]
    high: NDArray[np.float64]

    def relative(self, scales: NDArray[np.float64], *sizes: NDArray[np.float64]) -> Rows:
        """The same in units of scales, of arguments that are in units of theirs."""
        function = _relative(self.function, scales, *sizes)
        return Rows(self.labels, function, self.low / scales, self.high / scales)


@dataclass(frozen=True, eq=False)
class Problem:
    """Optimal control: X' = rates(X, U), least ∫ cost dt, rows at the start, at the end and on the way."""

    name: str  # of the component
    moves: tuple[str, ...]
    order: int
    states: tuple[str, ...]
    controls: tuple[str, ...]
    initial_state: NDArray[np.float64]  # of the states; where they are free, as declared
    terminal_state: dict[str, float]  # states that are given at the end, quaternions on the shorter way
    initial_sigma: NDArray[np.float64]  # σ at the start, where it is no state
    rates: ca.Function
    cost: ca.Function
    path: Rows
    start: Rows
    end: Rows
    closed: tuple[int, ...]  # states that end as they start
    duration: tuple[float, float]
    constrained: bool  # the states obey constraints, which straight lines would break
    mass: ca.Function  # Θ of the states
    fmu_starts: Callable[[NDArray[np.float64], NDArray[np.float64]], dict[str, float]]  # start values of the FMU
    scales: Scales

    @property
    def is_loop(self) -> bool:
        """Whether all that is moved comes back to where it was."""
        closed = {self.states[i] for i in self.closed}
        return bool(closed) and set(self.moves) <= closed

    @cached_property
    def relative(self) -> Problem:
        """The same problem in units of its scales, so that no number in it depends on units."""
        scales, X, U = self.scales, self.scales.states, self.scales.controls
        sizes, shape = dict(zip(self.states, X, strict=True)), U * scales.time**self.order
        return replace(
            self,
            initial_state=self.initial_state / X,
            terminal_state={name: value / sizes[name] for name, value in self.terminal_state.items()},
            initial_sigma=self.initial_sigma / shape,
            rates=_relative(self.rates, X / scales.time, X, U),
            cost=_relative(self.cost, np.array([scales.cost / scales.time]), X, U),
            path=self.path.relative(scales.path, X, U),
            start=self.start.relative(scales.start, X),
            end=self.end.relative(scales.end, X),
            duration=(self.duration[0] / scales.time, self.duration[1] / scales.time),
            mass=_relative(self.mass, scales.energy * scales.time**2 / np.outer(shape, shape), X, U),
        )


class Readings(Mapping[str, ca.SX]):
    """The variables of the mechanism by name, as its FMU has them: ``m.theta_dot``, ``m["theta[3]"]``."""

    def __init__(self, owner: str, found: Mapping[str, ca.SX]) -> None:
        self._owner, self._found = owner, found

    def __getitem__(self, name: str) -> ca.SX:
        if name in self._found:
            return self._found[name]
        elements = [value for element, value in self._found.items() if element.startswith(f"{name}[")]
        if elements:
            return ca.vertcat(*elements)
        raise PlanError(f"{self._owner} has no variable {name!r}{suggestion(name, self._found)}")

    def __getattr__(self, name: str) -> ca.SX:
        if name.startswith("__"):
            raise AttributeError(name)
        return self[name]

    def __iter__(self) -> Any:
        return iter(self._found)

    def __len__(self) -> int:
        return len(self._found)


def problem_of(goal: Goal) -> Problem:
    """Read a goal.

    :raises PlanError: for an unknown name, with the nearest one, or for what cannot be.
    """
    return GoalSymbols(goal).problem()


@dataclass(frozen=True, eq=False)
class _Row:
    label: str
    expression: ca.SX
    low: float
    high: float
    size: float = 1.0

    @property
    def relative(self) -> ca.SX:
        """In units of its size."""
        return self.expression / self.size


@dataclass(frozen=True, eq=False)
class _Asked:
    """What is asked for, in symbols."""

    start: list[_Row]
    end: list[_Row]
    path: list[_Row]
    cost: ca.SX
    cost_size: float

    @property
    def relative(self) -> ca.SX:
        """What is weighed or bounded on the way, in units of sizes."""
        return ca.vertcat(self.cost / self.cost_size, *(row.relative for row in self.path))


@dataclass(frozen=True, eq=False)
class _State:
    name: str
    symbol: ca.SX
    rate: ca.SX
    size: float


class GoalSymbols:
    """The symbols of one goal, and what is made of them step by step."""

    def __init__(self, goal: Goal) -> None:
        self.goal = goal
        found = component(goal.component)
        if not issubclass(found, (Mechanism, Chain)):
            raise PlanError(f"{found.__name__} is an operator; plan the motion of a mechanism")
        self.component, self.name = found, found.__name__
        sizes = {"n": goal.values["n"]} if issubclass(found, Chain) and "n" in goal.values else {}
        self.model: Model = model(found, **sizes).flat()
        self._check_moves()
        self.x_names = tuple(state.name for state in self.model.states[:-2])
        self.y = ca.vertcat(*(ca.SX.sym(name) for name in self.x_names))
        self.s, self.v, self.a = (ca.SX.sym(f"sigma{end}", len(goal.moves)) for end in ("", "_dot", "_ddot"))
        self.turns = {turn.name: turn.quaternion for turn in getattr(found, "orientations", ())}
        self._read_parameters()
        self._read_start()
        self._read_scales()
        self._evaluate()

    # ---- the mechanism ----------------------------------------------------------------------------------------

    def _check_moves(self) -> None:
        actives = [active.value for active in self.model.active]
        if not actives:
            raise PlanError(f"{self.name} has no active coordinate: there is nothing that an operator could move")
        for name in self.goal.moves:
            if name not in actives:
                free = name in {state.name for state in self.model.states}
                hint = f": it moves freely; moves takes {', '.join(actives)}" if free else suggestion(name, actives)
                raise PlanError(f"{self.name}: moves = {name!r} is no active coordinate{hint}")
        if len(set(self.goal.moves)) < len(self.goal.moves) or not self.goal.moves:
            raise PlanError(f"{self.name}: moves = {shown(list(self.goal.moves))}: name each coordinate once")

    def _read_parameters(self) -> None:
        inputs = {v.name: v for v in self.model.inputs}
        self.k = {v.name: v.starts[0] for v in self.model.parameters}
        self.u: dict[str, Any] = {v.name: v.starts[0] for v in self.model.inputs}
        moved = {f"{name}{end}" for name in self.goal.moves for end in ("", "_dot", "_ddot")}
        declared = {p.name: p.variable("parameter", "fixed") for p in self.component.parameters}
        for name, value in self.goal.values.items():
            if name == "n" and issubclass(self.component, Chain):
                continue
            if name in moved:
                raise PlanError(f"{self.name}: {name} is moved and cannot have the fixed value {shown(value)}")
            variable = declared.get(name) or inputs.get(name)
            if variable is None:
                known = [*declared, *inputs]
                raise PlanError(f"{self.name} has no parameter or input {name!r}{suggestion(name, known)}")
            finite(f"{self.name}: {name}", value, PlanError)
            if not variable.allows(float(value)):
                raise PlanError(f"{self.name}: {name} = {value} must be {variable.domain()}")
            (self.k if name in self.k else self.u)[name] = float(value)

    def _read_start(self) -> None:
        """Numbers of the start: of coordinates as declared, of rates and momenta 0."""
        self.is_free = callable(self.goal.start) or isinstance(self.goal.start, str)
        given = {} if self.is_free else self._elements("start", self.goal.start)  # type: ignore[arg-type]
        own = {name for parameter in self.component.parameters for name in parameter.names}
        self.starts = {re.sub(r"_0(\[\d+\])?$", r"\1", name): name for name in self.k if name not in own}
        rates = set(self.starts) - set(self.x_names)
        moved = {f"{name}{end}" for name in self.goal.moves for end in ("", "_dot")}
        known = {*self.x_names, *rates, *moved, *self.turns}
        for name in given:
            if name not in known:
                raise PlanError(f"{self.name}: start has no {name!r}{suggestion(name, known)}")
        self.given = given
        for name in rates:
            self.k[self.starts[name]] = self._number(name, given.get(name, 0.0))
        for name in self.x_names:
            if name in self.starts and isinstance(given.get(name), (int, float)):
                self.k[self.starts[name]] = float(given[name])
        for name in {*self.x_names, *moved} & given.keys():
            if given[name] is not None:
                self._range("start", name, given[name])
        declared = {active.value: self.u[active.value] for active in self.model.active}
        self.s_start = np.array([_middle(given.get(name), declared[name]) for name in self.goal.moves])

    def _read_scales(self) -> None:
        """Sizes of all quantities, from the numbers of parameters, start, end, bounds and duration."""
        variables = (*self.model.parameters, *self.model.inputs, *self.model.outputs)
        units = {variable.name: variable.unit for variable in variables}
        goal = self.goal
        wanted = [goal.bounds, {} if self.is_free else goal.start, goal.end if isinstance(goal.end, Mapping) else {}]
        numbers = [
            (value, units[name])
            for values in wanted
            for name, given in values.items()  # type: ignore[union-attr]
            for value in (given if isinstance(given, (tuple, list)) else [given])
            if name in units and isinstance(value, (int, float))
        ]
        numbers += [(value, units[name]) for name, value in (self.k | self.u).items()]
        base = base_scales([*numbers, *((value, "s") for value in goal.duration)])
        self.sizes = {name: size(base, unit) for name, unit in units.items()}
        self.time, self.energy = size(base, "s"), size(base, "J")
        self.y_size = np.array([self.sizes.get(name, 1.0) for name in self.x_names])
        self.s_size = np.array([self.sizes[name] for name in goal.moves])
        moved = [np.where(self.s_start == 0, self.s_size, np.abs(self.s_start))]  # what is > 0 stays so
        self._spread = [self.y_size, *moved, self.s_size / self.time, self.s_size / self.time**2]

    def _evaluate(self) -> None:
        """Rates and everything that can be read, in the symbols of state and σ."""
        u = dict(self.u)
        for i, name in enumerate(self.goal.moves):
            u |= {name: self.s[i], f"{name}_dot": self.v[i], f"{name}_ddot": self.a[i]}
        before = u | {f"{name}_ddot": 0.0 for name in self.goal.moves}
        before |= {f"{m}_dot": self._number(m, self.given.get(f"{m}_dot") or 0.0) for m in self.goal.moves}
        k = {self.starts[name]: self.y[i] for i, name in enumerate(self.x_names) if name in self.starts}
        column = ca.vertcat(*self.k.values())
        y, zero = ca.vertcat(self.y, 0, 0), ca.DM.zeros(len(self.model.memory), 1)
        rates = _expanded(self.model.derivatives)(0, y, _column(u), column)
        z = ca.vertsplit(_expanded(self.model.outputs_function)(0, y, _column(u), column, zero))
        start = _expanded(self.model.start)(0, _column(before), _column(self.k | k))[0]
        self.rates = ca.densify(rates[: len(self.x_names)])
        self.relative_rates = self.rates / (self.y_size / self.time)
        self.start_state = ca.densify(start[: len(self.x_names)])
        outputs = {v.name: value for v, value in zip(self.model.outputs, z, strict=True)}
        self.signals = outputs | dict(zip(self.x_names, ca.vertsplit(self.y), strict=True))
        self.signals |= {name: ca.SX(value) for name, value in (u | self.k).items()}

    # ---- names to rows ----------------------------------------------------------------------------------------

    def _number(self, name: str, value: Any) -> float:
        finite(f"{self.name}: {name}", value, PlanError)
        return float(value)

    def _elements(self, label: str, given: object) -> dict[str, Any]:
        """Names of scalars and orientations; an array has one value for all, or a list."""
        found: dict[str, Any] = {}
        for name, value in named(f"{self.name}: {label}", given, PlanError).items():
            elements = [v.name for v in self.model.variables if v.name.startswith(f"{name}[")]
            if not elements:
                found[name] = value
            else:
                values = value if isinstance(value, (list, tuple, np.ndarray)) else [value] * len(elements)
                if len(values) != len(elements):
                    raise PlanError(f"{self.name}: {label} of {name} has {len(values)} values; give {len(elements)}")
                found |= dict(zip(elements, values, strict=True))
        return found

    def _expression(self, label: str, given: Any) -> ca.SX:
        """What a user's function or text of the variables gives, a column."""
        try:
            value = formula(given, self._names()) if isinstance(given, str) else given(self._names())
            value = ca.vertcat(*value) if isinstance(value, (list, tuple)) else ca.SX(value)
        except FormulaError as error:
            raise PlanError(f"{self.name}: {label}: {error}") from None
        except LiaisonsError:
            raise
        except Exception as error:
            raise PlanError(f"{self.name}: {label}: {type(error).__name__}: {error}") from error
        return ca.vec(value)

    def _names(self) -> Readings:
        return Readings(self.name, self.signals)

    def _range(self, label: str, name: str, value: Any) -> tuple[float, float]:
        if isinstance(value, (tuple, list)):
            if len(value) != 2 or not all(x is None or (isinstance(x, Real) and not np.isnan(float(x))) for x in value):
                raise PlanError(f"{self.name}: {label} of {name} = {shown(value)}: give a number, or two, (low, high)")
            low, high = (-np.inf if value[0] is None else value[0]), (np.inf if value[1] is None else value[1])
        else:
            low = high = self._number(name, value)
        if not low <= high:
            raise PlanError(f"{self.name}: {label} of {name} = {shown(value)}: low must not exceed high")
        return float(low), float(high)

    def _start_rows(self) -> list[_Row]:
        if self.is_free:
            value = self._expression("start", self.goal.start)
            return [_Row(f"start[{i}]", row, 0.0, 0.0) for i, row in enumerate(ca.vertsplit(value))]
        rows: list[_Row] = []
        fixed = {axis: (turn, i) for turn, axes in self.turns.items() for i, axis in enumerate(axes)}
        for i, name in enumerate(self.x_names):
            symbol = self.y[i]
            if name in fixed and fixed[name][0] in self.given:
                turn, place = fixed[name]
                unit = self._quaternion(turn, self.given[turn])
                rows.append(_Row(name, symbol, unit[place], unit[place]))
            elif name in self.given:
                if self.given[name] is not None:
                    rows.append(_Row(name, symbol, *self._range("start", name, self.given[name])))
            elif name in self.starts:
                rows.append(_Row(name, symbol, *[self.k[self.starts[name]]] * 2))
            else:
                rows.append(_Row(name, symbol - self.start_state[i], 0.0, 0.0))
        for i, name in enumerate(self.goal.moves):
            default = None if name in self.goal.closed else self.s_start[i]
            for end, symbol, otherwise in (("", self.s[i], default), ("_dot", self.v[i], None)):
                value = self.given.get(name + end, otherwise)
                if value is not None:
                    rows.append(_Row(name + end, symbol, *self._range("start", name + end, value)))
        return rows

    def _end_rows(self) -> list[_Row]:
        if callable(self.goal.end) or isinstance(self.goal.end, str):
            value = self._expression("end", self.goal.end)
            return [_Row(f"end[{i}]", row, 0.0, 0.0) for i, row in enumerate(ca.vertsplit(value))]
        rows: list[_Row] = []
        for name, value in self._elements("end", self.goal.end).items():
            if value is None:
                continue
            if name in self.turns:
                w, x, y, z = self._quaternion(name, value)
                q = ca.vertcat(*(self.signals[axis] for axis in self.turns[name]))
                vector = ca.DM([[-x, w, z, -y], [-y, -z, w, x], [-z, y, -x, w]]) @ q  # of conjugate(goal) ⊗ q
                rows += [_Row(f"{name}[{i + 1}]", vector[i], 0.0, 0.0) for i in range(3)]
            else:
                expression = self._names()[name]
                rows.append(_Row(name, expression, *self._range("end", name, value)))
        return rows

    def _terminal_state(self, begin: dict[str, float], end: list[_Row]) -> dict[str, float]:
        terminal_state = {
            row.label: float(np.clip(begin[row.label], row.low, row.high)) for row in end if row.label in begin
        }
        for name, axes in self.turns.items():
            if isinstance(self.goal.end, Mapping) and self.goal.end.get(name) is not None and set(axes) <= set(begin):
                goal = self._quaternion(name, self.goal.end[name])
                sign = -1.0 if goal @ [begin[axis] for axis in axes] < 0 else 1.0
                terminal_state |= dict(zip(axes, sign * goal, strict=True))
        return terminal_state

    def _quaternion(self, name: str, value: Any) -> NDArray[np.float64]:
        try:
            found = np.array(value, dtype=float)
        except (TypeError, ValueError):
            found = np.zeros(0)
        if found.shape != (4,) or not np.linalg.norm(found) > 0:
            raise PlanError(f"{self.name}: {name} = {shown(value)}: give a quaternion (w, x, y, z)")
        return found / np.linalg.norm(found)

    def _path_rows(self) -> list[_Row]:
        known = self._names()
        rows: list[_Row] = []
        for name, value in self._elements("bounds", self.goal.bounds).items():
            low, high = self._range("bounds", name, value if isinstance(value, (tuple, list)) else shown(value))
            rows.append(_Row(name, known[name], low, high))
        bounded = {row.label for row in rows}
        domains = {v.name: v for v in self.model.inputs} | {s.name: s for s in self.component.coordinates}
        for name in (*self.goal.moves, *self.x_names):
            domain = domains.get(name)
            if domain is None or name in bounded or (domain.minimum is None and domain.maximum is None):
                continue
            low, high = (np.nan if x is None else float(x) for x in (domain.minimum, domain.maximum))
            margin = 1e-3 * self._room(name) if domain.strict else 0.0  # a singularity lies there
            rows.append(_Row(name, known[name], np.nan_to_num(low + margin, nan=-np.inf), _inf(high - margin)))
        return rows

    def _room(self, name: str) -> float:
        """Size of a coordinate: where it starts, if that is not 0."""
        if name in self.goal.moves:
            return float(self._spread[1][self.goal.moves.index(name)])
        return abs(self.k.get(self.starts.get(name, ""), 0.0)) or self.sizes.get(name, 1.0)

    def _mass(self) -> ca.SX:
        """The effective mass Θ of what is moved."""
        return ca.jacobian(ca.vertcat(*(self.signals[f"{name}_force"] for name in self.goal.moves)), self.a)

    def _cost(self) -> ca.SX:
        forces = ca.vertcat(*(self.signals[f"{name}_force"] for name in self.goal.moves))
        theta = self._mass()
        minimize = self.goal.minimize
        if minimize == "time":
            return ca.SX(1)
        if minimize == "effort":
            self._refuse_singular(theta, "effort")
            return ca.sumsqr(forces)
        if minimize == "motion":
            return ca.bilin(theta, self.v, self.v) / 2
        value = self._expression("minimize", minimize)
        if value.shape != (1, 1):
            raise PlanError(f"{self.name}: minimize gives {value.shape[0]} numbers; one is wanted")
        return value

    def _refuse_singular(self, theta: ca.SX, label: str) -> None:
        """Where the effective mass vanishes a finite force says nothing of the acceleration."""
        relative = self._at(theta, 0.0) * np.outer(self.s_size, self.s_size) / (self.energy * self.time**2)
        eigenvalues = np.linalg.eigvalsh(relative)
        if eigenvalues[0] <= 1e-9 * max(1e-300, np.max(np.abs(eigenvalues))) or eigenvalues[-1] <= 1e-12:
            raise PlanError(
                f"{self.name}: {label}: the effective mass Θ at {', '.join(self.goal.moves)} is singular at the start, "
                "so that no bounded force tells the acceleration; bound or weigh accelerations, or give the part a mass"
            )

    # ---- the order of control ---------------------------------------------------------------------------------

    def _at(self, expression: ca.SX, spread: float, seed: int = 0) -> NDArray[np.float64]:
        """Its numbers at the start, or at random states around it."""
        rng = np.random.default_rng(seed)
        y = np.array([self.k[self.starts[name]] if name in self.starts else 0.0 for name in self.x_names])
        y[[i for i, n in enumerate(self.x_names) if n == Orientation.quaternion[0]]] = 1.0
        arguments = [y, self.s_start, np.zeros(len(self.goal.moves)), np.zeros(len(self.goal.moves))]
        points = [
            x + spread * rng.uniform(-1, 1, x.shape) * factor * size
            for x, factor, size in zip(arguments, (1, 0.5, 3, 3), self._spread, strict=True)
        ]
        function = ca.Function("at", [self.y, self.s, self.v, self.a], [expression])
        return np.atleast_2d(np.array(function(*points)))

    @property
    def _symbols(self) -> dict[str, float]:
        """Sizes of the symbols by their names."""
        columns = zip((self.y, self.s, self.v, self.a), (self.y_size, *self._rates_of(self.s_size)), strict=True)
        pairs = ((ca.vertsplit(symbols), sizes) for symbols, sizes in columns)
        return {s.name(): float(x) for symbols, sizes in pairs for s, x in zip(symbols, sizes, strict=True)}

    def _rates_of(self, sizes: NDArray[np.float64]) -> list[NDArray[np.float64]]:
        return [sizes / self.time**n for n in range(3)]

    def _slope(self, expression: ca.SX, symbols: ca.SX) -> ca.SX:
        """Derivatives with respect to symbols in units of their sizes."""
        sizes = self._symbols
        columns = ca.DM([sizes[symbol.name()] for symbol in ca.vertsplit(symbols)])
        return ca.jacobian(expression, symbols) @ ca.diag(columns)

    def acts(self, expression: ca.SX, symbols: ca.SX) -> NDArray[np.bool_]:
        """Which symbols enter which rows, numerically: a rate that cancels still stands in the expression.

        :param expression: in units of its size.
        """
        slope = self._slope(expression, symbols)
        if slope.nnz() == 0:
            return np.zeros(slope.shape, dtype=bool)
        slope = ca.densify(slope)
        return np.any([np.abs(self._at(slope, 0.3, seed)) > _ROUNDING for seed in range(1, 4)], axis=0)

    def depends(self, expression: ca.SX, symbols: ca.SX) -> bool:
        """Whether any of the symbols enters.

        :param expression: in units of its size.
        """
        return bool(self.acts(expression, symbols).any())

    def _size(self, expression: ca.SX) -> float:
        """Of a scalar at states around the start: of its value and of its changes."""
        slope = self._slope(expression, ca.vertcat(self.y, self.s, self.v, self.a))
        column = ca.densify(ca.horzcat(expression, slope))
        values = np.array([np.linalg.norm(self._at(column, 0.5, seed)) for seed in range(1, 10)])
        found = float(np.median(values[np.isfinite(values)])) if np.isfinite(values).any() else 0.0
        return found or 1.0

    def _sized(self, rows: Iterable[_Row]) -> list[_Row]:
        return [replace(row, size=self.sizes.get(row.label) or self._size(row.expression)) for row in rows]

    def _asked(self) -> _Asked:
        start, end, path = map(self._sized, (self._start_rows(), self._end_rows(), self._path_rows()))
        cost = self._cost()
        return _Asked(start, end, path, cost, self._size(cost))

    def problem(self) -> Problem:
        """The whole."""
        goal = self.goal
        asked = self._asked()
        self._refuse_unbounded_forces(asked.path)
        self._refuse_excluded(asked)
        self._refuse_momenta(asked.end)
        order = self._order(asked)
        if order == 0:
            asked = replace(asked, start=[row for row in asked.start if row.label not in goal.moves])
        if order == 2 and self.depends(asked.relative, self.a):
            asked = replace(asked, start=[*asked.start, *self._at_rest({row.label for row in asked.start})])
        elif order == 2:
            self._refuse_impulses(asked)
        states = self._states(order)
        closed = self._closed({state.name for state in states})
        gone = self._conserved(states, asked.start) - set(closed)
        kept = self._needed([state for state in states if state.name not in gone], asked, closed)
        return self._laid_out(asked, order, states, kept, closed)

    def _laid_out(self, asked: _Asked, order: int, states: list[_State], kept: set[str], closed: list[str]) -> Problem:
        goal, numbers = self.goal, self._numbers(states, asked.start)
        X = ca.vertcat(*(state.symbol for state in states if state.name in kept))
        chosen, suffix = ((self.s, ""), (self.v, "_dot"), (self.a, "_ddot"))[order]
        absent = ca.vertcat(ca.SX(0, 1), *(self.s, self.v, self.a)[order + 1 :])
        others = ca.vertcat(absent, *(state.symbol for state in states if state.name not in kept))
        values = [0.0] * absent.numel() + [numbers[state.name] for state in states if state.name not in kept]

        def known(expression: Any) -> ca.SX:
            return ca.cse(ca.densify(ca.substitute(ca.SX(expression), others, ca.SX(ca.DM(values)))))

        def rows(found: Iterable[_Row], label: str, *arguments: ca.SX) -> Rows:
            found = [row for row in found if self._is_for_the_plan(row, known(row.expression), arguments, label)]
            column = known(ca.vertcat(ca.SX(0, 1), *(row.expression for row in found)))
            low, high = (np.array([getattr(row, end) for row in found]) for end in ("low", "high"))
            return Rows(tuple(row.label for row in found), ca.Function(label, list(arguments), [column]), low, high)

        def function(label: str, column: ca.SX) -> ca.Function:
            return ca.Function(label, [X, chosen], [known(column)])

        path = rows(asked.path, "path", X, chosen)
        if goal.minimize == "time" and path.function.jac_sparsity(0, 1).nnz() == 0:
            names = ", ".join(f"{name}{suffix}" for name in goal.moves)
            raise PlanError(f"{self.name}: minimize = 'time' would take none: bound {names}, or forces")
        self._refuse_chosen(
            ("start", asked.start), ("end", asked.end), chosen=chosen, names=[f"{n}{suffix}" for n in goal.moves]
        )
        start, end = rows(asked.start, "start", X), rows(asked.end, "end", X)
        names = tuple(state.name for state in states if state.name in kept)
        ranges = {row.label: (row.low, row.high) for row in asked.start}
        begin = {name: _middle(ranges.get(name), numbers[name]) for name in names}
        signals = function("signals", ca.vertcat(*self.signals.values()))
        return Problem(
            name=self.name,
            moves=goal.moves,
            order=order,
            states=names,
            scales=self._scales(asked, [state for state in states if state.name in kept], order, (path, start, end)),
            controls=tuple(f"{name}{suffix}" for name in goal.moves),
            initial_state=np.array([begin[name] for name in names]),
            terminal_state=self._terminal_state(begin, asked.end),
            initial_sigma=self.s_start,
            rates=function("rates", ca.vertcat(*(state.rate for state in states if state.name in kept))),
            cost=function("cost", asked.cost),
            path=path,
            start=start,
            end=end,
            closed=tuple(names.index(name) for name in closed if name in names),
            duration=goal.duration,
            constrained=any(
                getattr(self.component, kind, ()) for kind in ("constraints", "non_holonomic", "rheonomic_constraints")
            ),
            mass=ca.Function("mass", [X, chosen], [known(self._mass())]),
            fmu_starts=self._fmu_starts(signals, tuple(self.signals)),
        )

    def _scales(self, asked: _Asked, states: list[_State], order: int, kept: tuple[Rows, Rows, Rows]) -> Scales:
        sizes = ({row.label: row.size for row in rows} for rows in (asked.path, asked.start, asked.end))
        labels = (rows.labels for rows in kept)
        rows = [np.array([of[label] for label in names]) for of, names in zip(sizes, labels, strict=True)]
        return Scales(
            states=np.array([state.size for state in states]),
            controls=self._rates_of(self.s_size)[order],
            time=self.time,
            energy=self.energy,
            cost=asked.cost_size * self.time,
            path=rows[0],
            start=rows[1],
            end=rows[2],
        )

    def _states(self, order: int) -> list[_State]:
        s_size, v_size, _ = self._rates_of(self.s_size)
        states = [_State(name, self.y[i], self.rates[i], self.y_size[i]) for i, name in enumerate(self.x_names)]
        if order >= 1:
            states += [_State(name, self.s[i], self.v[i], s_size[i]) for i, name in enumerate(self.goal.moves)]
        if order == 2:
            states += [_State(f"{name}_dot", self.v[i], self.a[i], v_size[i]) for i, name in enumerate(self.goal.moves)]
        return states

    def _at_rest(self, said: set[str]) -> list[_Row]:
        """σ̇ = 0 at the start, where nothing else is said."""
        if self.is_free:
            return []
        waiting = [(i, f"{name}_dot") for i, name in enumerate(self.goal.moves) if name not in self.goal.closed]
        return self._sized(_Row(rate, self.v[i], 0.0, 0.0) for i, rate in waiting if rate not in said)

    def _order(self, asked: _Asked) -> int:
        declared = set(self.goal.moves) - set(self.given)  # where σ would start if it could not jump at once
        start = (row for row in asked.start if row.label not in declared)
        ends = ca.vertcat(*(row.relative for row in (*start, *asked.end)))
        way = ca.vertcat(self.relative_rates, asked.relative)
        curved = self.depends(self._slope(self.relative_rates, self.v), self.v)
        if curved or self.depends(ca.vertcat(ends, way), self.a) or self.depends(ends, self.v):
            return 2
        return int(bool(self.goal.closed) or self.depends(way, self.v) or self.depends(ends, self.s))

    def _closed(self, states: Iterable[str]) -> list[str]:
        known = set(states)
        for name in self.goal.closed:
            if name not in known:
                raise PlanError(f"{self.name}: closed = {name!r} is no state of the plan{suggestion(name, known)}")
        rates = [f"{name}_dot" for name in self.goal.closed if f"{name}_dot" in known and name in self.goal.moves]
        return [*self.goal.closed, *rates]

    def _numbers(self, states: list[_State], start: list[_Row]) -> dict[str, float]:
        """A number for each state at the start."""
        found = dict(zip(self.x_names, map(float, self._at(self.start_state, 0.0).ravel()), strict=True))
        found |= dict(zip(self.goal.moves, map(float, self.s_start), strict=True))
        found = {state.name: 0.0 for state in states} | found
        return found | {r.label: r.low for r in start if r.low == r.high and r.expression.is_symbolic()}

    def _conserved(self, states: list[_State], start: list[_Row]) -> set[str]:
        """States that start at a number and stay there."""
        started = {row.label for row in start if row.low == row.high}
        relative = {state.name: state.rate * (self.time / state.size) for state in states if state.name in started}
        return {name for name, rate in relative.items() if self._vanishes(rate)}

    def _vanishes(self, expression: ca.SX) -> bool:
        everything = ca.vertcat(self.s, self.v, self.a, self.y)
        return not self.depends(expression, everything) and abs(self._at(expression, 0.3).item()) < _ROUNDING

    def _needed(self, states: list[_State], asked: _Asked, closed: list[str]) -> set[str]:
        """Names of the states that what is asked for depends on."""
        wanted = ca.vertcat(asked.relative, *(row.relative for row in asked.end))
        waiting = [state for state in states if state.name in closed or self.depends(wanted, state.symbol)]
        kept: set[str] = set()
        while waiting:
            state = waiting.pop()
            kept.add(state.name)
            more = (other for other in states if other.name not in kept and other not in waiting)
            waiting += [other for other in more if self.depends(state.rate * (self.time / state.size), other.symbol)]
        if not kept:
            raise PlanError(f"{self.name}: nothing that {', '.join(self.goal.moves)} can change is asked for")
        return kept

    def _is_for_the_plan(self, row: _Row, expression: ca.SX, arguments: Iterable[ca.SX], label: str) -> bool:
        """Whether a row is the plan's to fulfil; at the end, what cannot change must fit already."""
        if ca.depends_on(expression, ca.vertcat(*arguments)):
            return True
        value = float(ca.Function("value", [], [expression])()["o0"])
        rounding = _ROUNDING * row.size
        if label == "end" and not row.low - rounding <= value <= row.high + rounding:
            what = f"{row.label} = {_shown(row)} cannot be reached: it is conserved and stays {value:g}"
            raise PlanError(f"{self.name}: end: {what}")
        return False

    def _refuse_excluded(self, asked: _Asked) -> None:
        bounds = {row.label: row for row in asked.path}
        for where, rows in (("start", asked.start), ("end", asked.end)):
            for row in rows:
                bound = bounds.get(row.label, row)
                if row.expression.is_symbolic() and (row.high < bound.low or row.low > bound.high):
                    what = f"{row.label} = {_shown(row)} lies outside of its bounds {_shown(bound)}"
                    raise PlanError(f"{self.name}: {where}: {what}")

    def _refuse_chosen(self, *ends: tuple[str, list[_Row]], chosen: ca.SX, names: list[str]) -> None:
        """Refuse to ask at an instant for what the plan chooses anew at each instant."""
        for where, rows in ends:
            for row in rows:
                if self.depends(row.relative, chosen):
                    what = f"{row.label} depends on {', '.join(names)}, which may be anything at a single instant"
                    raise PlanError(f"{self.name}: {where}: {what}: ask for states, or set bounds on {row.label}")

    def _refuse_unbounded_forces(self, path: list[_Row]) -> None:
        if any(row.label.endswith(("_force", "_power")) for row in path):
            self._refuse_singular(self._mass(), "bounds on forces")

    def _refuse_impulses(self, asked: _Asked) -> None:
        """Refuse given rates where these may jump: there is no least cost then, but ever shorter impulses."""
        rates = [f"{name}_dot" for name in self.goal.moves]
        given = [row.label for row in (*asked.start, *asked.end) if row.label in rates]
        through = [
            item.name for item in getattr(self.component, "rheonomic_constraints", ()) if item.name in self.goal.moves
        ]
        if given or through:
            name = (given or [f"{through[0]}_dot"])[0].removesuffix("_dot")
            what = f"{name}_dot may jump at no cost, so that no motion is the best: bound or weigh {name}_ddot"
            raise PlanError(
                f"{self.name}: {what}, or bound {name}_force{f', or leave {name}_dot free' if given else ''}"
            )

    def _refuse_momenta(self, end: list[_Row]) -> None:
        """Refuse to bring to rest what has a conserved momentum."""
        still = {row.label for row in end if row.low == row.high == 0}
        rates = [name for name in self.starts if name in self._rate_names()]
        if not rates or not still.issuperset([*rates, *(f"{name}_dot" for name in self.goal.moves)]):
            return
        started = self._at(self.start_state, 0.0).ravel()
        for i, name in enumerate(self.x_names):
            is_momentum = name not in self.starts or name in Orientation.momenta
            value = float(self.given.get(name) or started[i])
            is_moving = abs(value) > _ROUNDING * self.y_size[i]
            if is_momentum and is_moving and self._vanishes(self.relative_rates[i]):
                what = f"nothing can come to rest: {name} is conserved, and it is {value:g} at the start"
                raise PlanError(f"{self.name}: end: {what}")

    def _rate_names(self) -> set[str]:
        axes = {rate for turn in getattr(self.component, "orientations", ()) for rate in turn.rates}
        return {f"{q}_dot" for q in self.x_names} | axes

    def _fmu_starts(self, signals: ca.Function, names: tuple[str, ...]) -> Callable[..., dict[str, float]]:
        values = {name: value for name, value in self.goal.values.items() if name != "n"}

        def of(X: NDArray[np.float64], U: NDArray[np.float64]) -> dict[str, float]:
            found = dict(zip(names, np.array(signals(X, U)).ravel(), strict=True))
            return values | {parameter: float(found[name]) for name, parameter in self.starts.items()}

        return of


def _relative(function: ca.Function, value: NDArray[np.float64], *sizes: NDArray[np.float64]) -> ca.Function:
    """A function in units of a size, of arguments in units of theirs."""
    arguments = [ca.SX.sym(f"x{i}", size.size) for i, size in enumerate(sizes)]
    result = function(*(x * ca.DM(size) for x, size in zip(arguments, sizes, strict=True)))
    return ca.Function(function.name(), arguments, [ca.densify(result / ca.DM(value))])


def _expanded(function: ca.Function) -> ca.Function:
    return function if function.is_a("SXFunction") else function.expand()


def _column(values: Mapping[str, Any]) -> ca.SX:
    return ca.vertcat(ca.SX(0, 1), *values.values())


def _middle(value: Any, otherwise: float) -> float:
    """A number in a range."""
    if value is None:
        return otherwise
    if isinstance(value, (tuple, list)):
        ends = [x for x in value if x is not None and np.isfinite(x)]
        return float(np.mean(ends)) if ends else otherwise
    return float(value)


def _inf(value: float) -> float:
    return float(np.inf) if np.isnan(value) else float(value)


def _shown(row: _Row) -> str:
    return f"{row.low:g}" if row.low == row.high else f"({row.low:g}, {row.high:g})"


def move_names(mechanism: Target, given: str | Sequence[str] | None) -> tuple[str, ...]:
    """Names of the active coordinates that move: all unless given."""
    if given is not None:
        return tuple(listed("moves", given, PlanError))
    found = component(mechanism)
    actives = tuple(active.name for active in getattr(found, "actives", ()))
    if not actives:
        raise PlanError(f"{found.__name__} has no active coordinate: there is nothing that an operator could move")
    return actives


def closed_names(closed: object, moves: Sequence[str]) -> tuple[str, ...]:
    """Names of what ends as it starts: True stands for what is moved."""
    if closed is True:
        return tuple(moves)
    return () if closed in (False, None) else tuple(listed("closed", closed, PlanError))
