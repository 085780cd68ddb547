"""Rows of a goal: scalar expressions with bounds at the start, at the end and along the motion, and its cost."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Any

import casadi as ca
import numpy as np

from liaisons.base.arguments import shown
from liaisons.base.array_names import by_name
from liaisons.base.port_names import port_names
from liaisons.errors import FormulaError, LiaisonsError, PlanError
from liaisons.typed_formulas import formula
from liaisons_motion.goals import GoalSymbols


@dataclass(frozen=True, eq=False)
class Row:
    """A scalar expression that has to lie in a range."""

    label: str
    expression: ca.SX
    low: float = 0.0
    high: float = 0.0
    size: float = 1.0

    @property
    def relative_expression(self) -> ca.SX:
        """The expression divided by its size."""
        return self.expression / self.size

    @property
    def nearest_to_zero(self) -> float:
        """The number of the range that is nearest to 0."""
        return min(max(self.low, 0.0), self.high)

    @property
    def range(self) -> str:
        """Text of the range: ``"0.5"``, or ``"(0, 1)"``."""
        return f"{self.low:g}" if self.low == self.high else f"({self.low:g}, {self.high:g})"


@dataclass(frozen=True, eq=False)
class GoalRows:
    """The constraints and the cost of a goal in symbols."""

    start: list[Row]
    end: list[Row]
    path: list[Row]
    cost: ca.SX
    cost_size: float

    @property
    def relative_cost_and_path(self) -> ca.SX:
        """Column of the cost and of the rows along the motion, each divided by its size."""
        return ca.vertcat(self.cost / self.cost_size, *(row.relative_expression for row in self.path))


def goal_rows(symbols: GoalSymbols) -> GoalRows:
    """Constraints and cost of a goal, as expressions of the symbols.

    :raises PlanError: for an unknown name, or what is no range.
    """
    start, end, path = (with_sizes(symbols, rows(symbols)) for rows in (_start_rows, _end_rows, _path_rows))
    cost = _cost(symbols)
    return GoalRows(start, end, path, cost, symbols.magnitude(cost))


def with_sizes(symbols: GoalSymbols, rows: Iterable[Row]) -> list[Row]:
    """The rows, to which the sizes of their variables or expressions are given."""
    sizes = symbols.sizes
    return [replace(row, size=sizes.get(row.label) or symbols.magnitude(row.expression)) for row in rows]


def refuse_singular_mass(symbols: GoalSymbols, label: str) -> None:
    """Raise an error if the effective mass Θ is singular at the start: forces do not determine accelerations.

    :param label: what needs the forces.
    """
    sizes = symbols.motion_sizes[0][: len(symbols.goal.moves)]
    relative = symbols.evaluate(symbols.mass, 0.0) * np.outer(sizes, sizes) / (symbols.energy * symbols.time**2)
    eigenvalues = np.linalg.eigvalsh(relative)
    if eigenvalues[0] <= 1e-9 * max(1e-300, np.max(np.abs(eigenvalues))) or eigenvalues[-1] <= 1e-12:
        raise PlanError(
            f"{symbols.name}: {label}: the effective mass Θ at {', '.join(symbols.goal.moves)} is singular at the "
            "start, so that no bounded force tells the acceleration; bound or weigh accelerations, or give the part "
            "a mass"
        )


def _user_values(symbols: GoalSymbols, label: str, expression: Any) -> ca.SX:
    """Column of the values of a function or formula of the variables, which a user has written.

    :raises PlanError: for errors in it.
    """
    try:
        value = formula(expression, symbols.signals) if isinstance(expression, str) else expression(symbols.signals)
        value = ca.vertcat(*value) if isinstance(value, (list, tuple)) else ca.SX(value)
    except FormulaError as error:
        raise PlanError(f"{symbols.name}: {label}: {error}") from None
    except LiaisonsError:
        raise
    except Exception as error:
        raise PlanError(f"{symbols.name}: {label}: {type(error).__name__}: {error}") from error
    program = ca.Function("value", ca.symvar(value), [value])
    steps = (i for i in range(program.n_instructions()) if program.instruction_id(i) == ca.OP_CONST)
    if not np.all(np.isfinite([program.instruction_constant(i) for i in steps])):
        raise PlanError(f"{symbols.name}: {label} = {shown(expression)}: a number in it is not finite")
    return ca.vec(value)


def _vanishing_rows(symbols: GoalSymbols, label: str, expression: Any) -> list[Row]:
    """Rows expression = 0, one for each of its values."""
    value = _user_values(symbols, label, expression)
    return [Row(f"{label}[{i}]", row) for i, row in enumerate(ca.vertsplit(value))]


def _start_rows(symbols: GoalSymbols) -> list[Row]:
    """Rows of the state, σ and σ̇ at the start: those of the goal; states and σ of which it says nothing as declared."""
    if symbols.goal.is_expression(symbols.goal.start):
        return _vanishing_rows(symbols, "start", symbols.goal.start)
    goal, names, starts = symbols.goal, symbols.state_names, symbols.start_parameters
    for name in goal.controls:
        if name in symbols.start:
            raise PlanError(f"{symbols.name}: start: {name} is a control, which may have any value at once: bound it")
    values: dict[str, Any] = {name: symbols.parameters[starts[name]] for name in names if name in starts}
    moved = [name for move in goal.moves for name in port_names(move)[:2]]
    sigma = by_name(goal.driven, symbols.initial_sigma)
    values |= {name: None if name in goal.closed else sigma.get(name) for name in moved} | dict(symbols.start)
    implied, rows = by_name(names, ca.vertsplit(symbols.state - symbols.initial_state)), []
    for name in (*names, *moved):
        if name not in values:
            rows.append(Row(name, implied[name]))
        elif values[name] is not None:
            rows.append(Row(name, symbols.signals[name], *symbols.value_range("start", name, values[name])))
    return rows


def _end_rows(symbols: GoalSymbols) -> list[Row]:
    """Rows at the end: values and ranges of the goal; for a quaternion the vector part of its rotation to the goal."""
    owner, end = symbols.name, symbols.goal.end
    if symbols.goal.is_expression(end):
        return _vanishing_rows(symbols, "end", end)
    rows: list[Row] = []
    for name, value in symbols.values_by_element(f"{owner}: end", end).items():
        if value is None:
            continue
        if name in symbols.quaternions:
            w, x, y, z = symbols.unit_quaternion(name, value)
            q = ca.vertcat(*(symbols.signals[axis] for axis in symbols.quaternions[name]))
            vector = ca.DM([[-x, w, z, -y], [-y, -z, w, x], [-z, y, -x, w]]) @ q  # of conjugate(goal) ⊗ q
            rows += [Row(f"{name}[{i + 1}]", vector[i]) for i in range(3)]
        else:
            rows.append(Row(name, symbols.signals[name], *symbols.value_range("end", name, value)))
    return rows


def _path_rows(symbols: GoalSymbols) -> list[Row]:
    """Rows along the motion: the bounds of the goal, and the domains of coordinates without bounds."""
    owner = symbols.name
    rows: dict[str, Row] = {}
    for name, value in symbols.values_by_element(f"{owner}: bounds", symbols.goal.bounds).items():
        pair = value if isinstance(value, (tuple, list, np.ndarray)) else shown(value)
        rows[name] = Row(name, symbols.signals[name], *symbols.value_range("bounds", name, pair))
    domains: dict[str, Any] = {v.name: v for v in symbols.model.inputs}
    domains |= {s.name: s for s in symbols.component.coordinates}
    start_sizes = by_name(symbols.goal.driven, map(float, symbols.initial_sigma_sizes))
    for name in (*symbols.goal.moves, *symbols.state_names):
        domain = domains.get(name)
        if domain is None or name in rows or (domain.minimum is None and domain.maximum is None):
            continue
        value = symbols.parameters.get(symbols.start_parameters.get(name, ""), 0.0)
        around = start_sizes.get(name) or abs(value) or symbols.sizes.get(name, 1.0)
        margin = 1e-3 * around if domain.strict else 0.0  # a singularity lies there
        low = -np.inf if domain.minimum is None else float(domain.minimum) + margin
        high = np.inf if domain.maximum is None else float(domain.maximum) - margin
        rows[name] = Row(name, symbols.signals[name], low, high)
    return [*rows.values()]


def _cost(symbols: GoalSymbols) -> ca.SX:
    """Integrand of the cost."""
    goal = symbols.goal
    moved = len(goal.moves)
    minimize, rates = goal.minimize, symbols.motion[1][:moved]
    if minimize == "time":
        return ca.SX(1)
    if minimize == "effort":
        if moved:
            refuse_singular_mass(symbols, "effort")
        forces = (symbols.motion[0][i] for i in range(moved, len(goal.driven)))
        return ca.sumsqr(ca.vertcat(*(ca.vertsplit(symbols.forces) if moved else ()), *forces))
    if minimize == "motion":
        if not moved:
            raise PlanError(f"{symbols.name}: minimize = 'motion' is of moved coordinates; weigh forces by 'effort'")
        return ca.bilin(symbols.mass, rates, rates) / 2
    value = _user_values(symbols, "minimize", minimize)
    if value.shape != (1, 1):
        raise PlanError(f"{symbols.name}: minimize gives {value.shape[0]} numbers; one is wanted")
    return value
