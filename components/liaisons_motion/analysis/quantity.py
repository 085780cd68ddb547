"""Quantities of a mechanism that are evaluated by the names of its symbols."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike, NDArray

from liaisons import derive
from liaisons.base.arguments import shown
from liaisons.errors import ComponentError
from liaisons.expressions import nonzero_states
from liaisons.language import Component, MechanicalComponent, Mechanism, checked_scalar
from liaisons.mechanics import Equations

Source = type[Mechanism] | Equations
"""A mechanism, or the equations that were derived from it."""

Formula = Callable[[Any], Any]
"""Takes the mechanism and returns a CasADi expression, as a component's own methods do: ``lambda m: m.mass * m.x``."""

Values = Mapping[str, ArrayLike]
"""Numbers or arrays by the names of symbols."""

STATES, _WIDE_STATES = 16, 24
_SIZES = -3, 4  # powers of ten
_ROUNDING = 1e-11  # relative: some thousand operations in doubles
_NOISE, _PROJECTED_NOISE = 1e-12, 1e-8  # relative, above the errors of doubles, and of states on constraints
_MOST_SHOWN = 3  # coordinates of a state in a message
_ROUNDS = 10  # projections, each of some Newton steps, from a random state onto the constraints


@dataclass(frozen=True, eq=False)
class Quantity:
    """An expression in the symbols of a mechanism; quantities of one class belong together."""

    equations: Equations
    expression: ca.SX  # (r, c)
    conservative: bool = False  # whether friction, drives and loads were left out, so that evaluate() refuses them

    def evaluate(self, **values: ArrayLike) -> NDArray:
        """Evaluate the quantity at one state or at many.

        :param values: symbols by name, numbers or arrays of shapes that broadcast: parameters, ``q``, ``p_q`` or
            ``q_dot``, ``s``, ``s_dot``, ``s_ddot``, ``q_force``, ``q_load``, ``P_x_load``.  A momentum that is not
            given follows from the rates, p = ∂L/∂q̇, and all rates from momenta alone; the others take their defaults
            or 0.
        :returns: array; its axes are those of the quantity (scalars and columns drop the axes of length 1), then those
            of the values.
        :raises ComponentError: for an unknown symbol, a value that is not finite or outside its domain, a result that
            is not finite, or friction, drives and loads in what is ``conservative``.
        """
        if self.conservative and np.any(Quantity(self.equations, _applied_forces(self.equations)).evaluate(**values)):
            raise ComponentError(
                f"{self.equations.name}: friction, drives and loads do not enter these equations, and are not 0 here; "
                "set them to 0, or take phase_velocity()"
            )
        result = self.numbers(values)
        if not np.all(np.isfinite(result)):
            raise ComponentError(f"{self.equations.name}: not finite at these values; give others for its coordinates")
        return result

    def numbers(self, values: Values) -> NDArray:
        """Values of the quantity as :meth:`evaluate` has them, finite or not."""
        equations, free = self.equations, self.equations.mechanism.free
        numbers = symbol_values(equations, values)
        missing = [i for i, p in enumerate(ca.vertsplit(free.p)) if str(p) not in values]
        expression = self.expression
        if len(missing) < free.p.shape[0] and values.keys().isdisjoint(map(str, ca.vertsplit(free.q_dot))):
            expression = ca.substitute(expression, free.q_dot, equations.velocities)
        expression = ca.substitute(expression, free.p[missing], (free.frame @ equations.momenta)[missing])
        (rows, columns), shape = expression.shape, np.broadcast_shapes(*map(np.shape, numbers.values()))
        function = ca.Function("evaluate", [ca.vertcat(*equations.symbols.values())], [ca.densify(expression)])
        table = np.array([np.broadcast_to(number, shape).ravel() for number in numbers.values()])
        result = np.asarray(function(table)).reshape(rows, -1, columns).swapaxes(1, 2)
        axes = () if (rows, columns) == (1, 1) else (rows,) if columns == 1 else (rows, columns)
        return result.reshape((*axes, *shape))

    def time_derivative(self) -> Quantity:
        """da/dt = ∂a/∂t + Σ (q̇ ∂a/∂q + ṗ ∂a/∂p) along the motion (K eq. 86), with friction, drives and loads.

        Time enters by the active coordinates: ∂a/∂t = ṡ ∂a/∂s + s̈ ∂a/∂ṡ.

        :raises ComponentError: for contacts.
        """
        equations, m = self.equations, self.equations.mechanism
        require_no_contacts(equations, "a rate")
        a = equations.in_phase_space(self.expression)
        column = ca.vertcat(m.free.q, m.free.p, m.internal, m.active.s, m.active.s_dot)
        q_dot = m.free.kinematics @ m.free.q_dot
        rates = ca.vertcat(q_dot, equations.momentum_rates, equations.internal_rates, m.active.s_dot, m.active.s_ddot)
        return Quantity(equations, ca.jtimes(a, column, equations.in_phase_space(rates)))


def observable(source: Source, formula: Formula) -> Quantity:
    """Quantity on phase space of a formula in coordinates and rates: q̇ is expressed by q and p (K 3.3).

    :param formula: for example ``lambda m: m.x * m.momentum(m.y)`` or ``lambda m: m.angular_momentum``.
    :raises ComponentError: if it is no scalar expression in the symbols of the mechanism, or contains forces of
        contacts, accelerations under them included.
    """
    equations = equations_of(source)
    owner = type(equations.mechanism)
    expression = checked_scalar(owner, "observable", formula(equations.mechanism), equations.symbols)
    expression = equations.in_phase_space(expression)
    if ca.depends_on(expression, equations.mechanism.contact_forces):
        require_no_contacts(equations, "an observable that contains forces")
    return Quantity(equations, expression)


def equations_of(source: Source) -> Equations:
    """Equations of a mechanism, with the same symbols at each call."""
    if isinstance(source, Equations):
        return source
    abstract = getattr(source, "is_abstract", False)
    if isinstance(source, type) and issubclass(source, Component) and (abstract or not issubclass(source, Mechanism)):
        chain = "a chain; write its links as arrays of a Mechanism"
        kind = "abstract" if abstract else chain if issubclass(source, MechanicalComponent) else "an operator"
        raise ComponentError(f"{source.__name__}: analysis takes mechanisms, which have a Lagrangian, and it is {kind}")
    if not (isinstance(source, type) and issubclass(source, Mechanism)):
        by_name = f", or derive({source!r})" if isinstance(source, str) and not source.endswith(".fmu") else ""
        raise ComponentError(f"{shown(source)} is no mechanism; give its class{by_name}")
    return _derived(source)


_derived = cache(derive)


def symbol_values(equations: Equations, values: Values) -> dict[str, NDArray]:
    """Number or array for each symbol, in the order of ``equations.symbols``; see :meth:`Quantity.evaluate`."""
    m, numbers = equations.mechanism, equations.numbers(values)
    for name, value in values.items():
        if not np.all(np.isfinite(value)):
            raise ComponentError(f"{equations.name}: {name} = {value} must be finite")
    for item in (*m.parameters, *m.coordinates, *m.actives):
        variable = item.variable("parameter", "fixed")
        for extreme in (np.min, np.max):
            value = float(extreme(values.get(item.name, item.start)))
            if not variable.allows(value):
                raise ComponentError(f"{equations.name}: {item.name} = {value:g} must be {variable.domain()}")
    return {name: np.asarray(number, dtype=float) for name, number in numbers.items()}


def all_rates(equations: Equations) -> ca.SX:
    """Rates of the free coordinates, then of the active ones; a column."""
    return ca.vertcat(equations.mechanism.free.q_dot, equations.mechanism.active.s_dot)


def require_independent_coordinates(equations: Equations, purpose: str) -> None:
    """Raise a ComponentError for constraints, contacts and orientations."""
    require_no_constraints(equations, purpose)
    require_no_contacts(equations, purpose)
    require_no_orientations(equations, purpose)


def require_no_orientations(equations: Equations, purpose: str) -> None:
    """Raise a ComponentError for orientations."""
    if orientations := [item.name for item in equations.mechanism.orientations]:
        raise ComponentError(
            f"{equations.name}: {purpose} needs coordinates; describe the mechanism by angles instead of the "
            f"orientation {', '.join(orientations)}"
        )


def require_no_constraints(equations: Equations, purpose: str) -> None:
    """Raise a ComponentError for constraints."""
    m = equations.mechanism
    if constraints := [item.name for item in (*m.constraints, *m.non_holonomic, *m.rheonomic_constraints)]:
        raise ComponentError(
            f"{equations.name}: {purpose} needs independent coordinates; describe the mechanism without "
            f"the constraint {', '.join(constraints)}"
        )


def require_no_contacts(equations: Equations, purpose: str) -> None:
    """Raise a ComponentError for unilateral liaisons and dry friction."""
    type(equations.mechanism).refuse_contacts(purpose, "describe the mechanism without them")


def _applied_forces(equations: Equations) -> ca.SX:
    """Friction on free and active coordinates, drives and loads; a column."""
    applied = equations.applied
    return ca.vertcat(applied.friction.forces_against(all_rates(equations)), applied.outer)


def require_conservative(equations: Equations, purpose: str, values: Values) -> None:
    """Raise a ComponentError for friction, drives and loads that are not 0 at these values."""
    if where_nonzero(equations, _applied_forces(equations), values):
        raise ComponentError(f"{equations.name}: {purpose} has no friction, drives and loads; set them to 0")


def require_free_coordinates(equations: Equations, purpose: str) -> None:
    """Raise a ComponentError where all coordinates are prescribed."""
    if not equations.mechanism.free.q_dot.shape[0]:
        raise ComponentError(f"{equations.name}: {purpose} needs a free coordinate; all are prescribed")


def require_constants_at_rest(equations: Equations, values: Values) -> None:
    """Raise a ComponentError for values of rates of active coordinates that are not 0, as they are held constant."""
    for name in map(str, ca.vertsplit(equations.mechanism.active.s_dot)):
        if np.any(values.get(name, 0)):
            raise ComponentError(
                f"{equations.name}: {name} = {values[name]} of an active coordinate that is held; set it to 0, or give "
                "the coordinate as it moves"
            )


def generator_matrix(equations: Equations) -> ca.SX:
    """Matrix G (n, f) from the directions of the momenta p to changes of q: dq = G ε.

    ε are shifts of coordinates, and of orientations rotations about the inertial axes.
    """
    free = equations.mechanism.free
    return free.kinematics @ free.frame.T


def orientation_cross_products(equations: Equations, u: ca.SX, v: ca.SX) -> ca.SX:
    """Cross products u × v of the three components of each orientation, 0 for other coordinates; (f,)."""
    count = len(equations.mechanism.coordinates)
    axes = (slice(count + 3 * i, count + 3 * i + 3) for i in range(len(equations.mechanism.orientations)))
    crossed = [ca.cross(u[part], v[part]) for part in axes]
    return ca.vertcat(ca.SX.zeros(count, 1), *crossed)


def random_states(equations: Equations, values: Values, *, wide: bool = False) -> dict[str, ArrayLike]:
    """Random states about the start, the same ones at each call; ``values`` are taken as they are.

    :param wide: after those near the start, states of all sizes, from 1e-3 to 1e4 times that of the start, or of 1.
    """
    m, rng = equations.mechanism, np.random.default_rng(0)
    centres, count = m.start_values(), STATES + _WIDE_STATES * wide
    states: dict[str, ArrayLike] = {}
    sizes = np.ones(count)

    def spread(centre: float, size: float) -> NDArray:
        """Numbers about a centre."""
        if wide:
            sizes[STATES:] = 10 ** rng.uniform(*_SIZES, _WIDE_STATES)
        return centre + size * sizes * rng.uniform(-1, 1, count)

    for item in (*m.coordinates, *m.actives):
        near = spread(centres[item.name], (abs(item.start) or 1.0) / 2)
        allows = item.variable("parameter", "fixed").allows
        inside = [k if k < STATES or allows(x) else k % STATES for k, x in enumerate(near)]
        states[item.name] = near[inside]
    for orientation in m.orientations:
        attitudes = rng.normal(size=(4, count))
        states |= dict(zip(orientation.quaternion, attitudes / np.linalg.norm(attitudes, axis=0), strict=True))
    for rate in ca.vertsplit(ca.vertcat(m.free.q_dot, m.active.s_dot, m.internal)):
        states[str(rate)] = spread(centres[str(rate)], 1.0)
    return states | dict(values)


@cache
def _random_constrained_states(equations: Equations, values: tuple[tuple[str, float], ...]) -> dict[str, ArrayLike]:
    """Random states projected onto the constraints; those that do not converge are left out."""
    states = random_states(equations, dict(values), wide=True)
    constraints, free = equations.constraints, equations.mechanism.free
    residuals = ca.norm_1(ca.vertcat(constraints.residuals, constraints.rate_residuals))
    assert equations.projection is not None  # constraints have one
    projection = equations.projection
    steps = ((ca.vertcat(free.q, free.p), projection), (free.q_dot, equations.velocities))
    for column, moved in steps * _ROUNDS:
        rows = Quantity(equations, moved).numbers(states)
        states = states | dict(zip(map(str, ca.vertsplit(column)), rows, strict=True))
    on = Quantity(equations, residuals).numbers(states) <= _ROUNDING
    if not np.any(on):
        raise ComponentError(
            f"{equations.name}: no states on its constraints near the start; give values for coordinates"
        )
    selected = {name: np.asarray(value)[on] if np.shape(value) == on.shape else value for name, value in states.items()}
    return selected | dict(values)


def where_nonzero(
    equations: Equations,
    expression: ca.SX,
    values: Mapping[str, Any],
    *,
    noise: float = _NOISE,
    constrained: bool = True,
) -> str | None:
    """Text on a state at which an expression is not 0; None if it vanishes identically.

    :param values: symbols that are held; ``noise``: relative error of numbers in the expression.
    :param constrained: whether it is enough that it vanishes where the constraints hold.
    """
    if arrays := [name for name, value in values.items() if np.ndim(value)]:
        raise ComponentError(f"{equations.name}: {arrays[0]} must be one number here, not an array")
    if not expression.nnz():
        return None
    states = _table(equations, random_states(equations, values, wide=True))
    found, text = _is_nonzero(equations, expression, states, noise)
    if not found:
        return None
    if constrained and equations.projection is not None and equations.constraints.matrix.shape[0]:
        states = _table(equations, _random_constrained_states(equations, tuple(values.items())))
        found, text = _is_nonzero(equations, expression, states, max(noise, _PROJECTED_NOISE))
    return text if found else None


def _table(equations: Equations, states: Mapping[str, ArrayLike]) -> NDArray:
    """States as a table, a row for each symbol; momenta are random where they are symbols of their own."""
    m, numbers = equations.mechanism, symbol_values(equations, states)
    shape = np.broadcast_shapes(*map(np.shape, numbers.values()))
    momenta = np.random.default_rng(1).normal(size=(m.free.p.shape[0], *shape))
    numbers |= {str(p): row for p, row in zip(ca.vertsplit(m.free.p), momenta, strict=True) if str(p) not in states}
    return np.array([np.broadcast_to(number, shape) for number in numbers.values()]).reshape(len(numbers), -1)


def _is_nonzero(equations: Equations, expression: ca.SX, states: NDArray, noise: float) -> tuple[bool, str]:
    """Whether an expression is not 0 somewhere, and a text on where."""
    symbols = ca.vertcat(*equations.symbols.values())
    found = nonzero_states(expression, symbols, states, noise)
    if not np.any(found >= 0):
        return False, ""
    state, used = int(np.min(found[found >= 0])), ca.symvar(expression)
    if state == states.shape[1]:
        return True, "where a condition in it (fmax, if_else, ...) comes out otherwise"
    names = {str(symbol) for symbol in used}
    moving = zip(equations.symbols, states, strict=True)
    shown = [f"{name} = {row[state]:.3g}" for name, row in moving if name in names and np.ptp(row) > 0][:_MOST_SHOWN]
    return True, f"at {', '.join(shown)}" if shown else "at all states"
