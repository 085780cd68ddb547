"""Quantities of a mechanism that are evaluated by the names of its symbols."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike, NDArray

from liaisons.base.arguments import shown
from liaisons.errors import ComponentError
from liaisons.language.chain import Chain
from liaisons.language.checks import checked_scalar
from liaisons.language.component import Component
from liaisons.language.mechanism import Mechanism
from liaisons.mechanics.equations import Equations, derive
from liaisons.mechanics.model import refuse_contacts

Source = type[Mechanism] | Equations
"""A mechanism, or the equations that were derived from it."""

Formula = Callable[[Any], Any]
"""Takes the mechanism and returns a CasADi expression, as a component's own methods do: ``lambda m: m.mass * m.x``."""

Values = Mapping[str, ArrayLike]
"""Numbers or arrays by the names of symbols."""

_STATES = 16  # an analytic identity that holds at this many random states holds everywhere
_ROUNDING = 1e-11  # relative: some thousand operations in doubles
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
        if not np.all(np.isfinite(result)):
            raise ComponentError(f"{equations.name}: not finite at these values; give others for its coordinates")
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
        kind = "abstract" if abstract else chain if issubclass(source, Chain) else "an operator"
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
    refuse_contacts(type(equations.mechanism), purpose, "describe the mechanism without them")


def _applied_forces(equations: Equations) -> ca.SX:
    """Friction on free and active coordinates, drives and loads; a column."""
    friction = equations.friction.forces_against(all_rates(equations))
    return ca.vertcat(friction, equations.drives, equations.loads, equations.point_loads)


def require_conservative(equations: Equations, purpose: str, values: Values) -> None:
    """Raise a ComponentError for friction, drives and loads that are not 0 at these values."""
    if largest_relative_value(equations, ca.norm_1(_applied_forces(equations)), ca.SX(1), values):
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


def random_states(equations: Equations, values: Values) -> dict[str, ArrayLike]:
    """Random states about the start, the same ones at each call; ``values`` are taken as they are."""
    m, rng = equations.mechanism, np.random.default_rng(0)
    centres = m.start_values()
    states: dict[str, ArrayLike] = {}
    for item in (*m.coordinates, *m.actives):
        spread = (abs(item.start) or 1.0) / 2
        states[item.name] = centres[item.name] + spread * rng.uniform(-1, 1, _STATES)
    for orientation in m.orientations:
        attitudes = rng.normal(size=(4, _STATES))
        states |= dict(zip(orientation.quaternion, attitudes / np.linalg.norm(attitudes, axis=0), strict=True))
    for rate in ca.vertsplit(ca.vertcat(m.free.q_dot, m.active.s_dot, m.internal)):
        states[str(rate)] = centres[str(rate)] + rng.uniform(-1, 1, _STATES)
    return states | dict(values)


@cache
def _random_constrained_states(equations: Equations, values: tuple[tuple[str, float], ...]) -> dict[str, ArrayLike]:
    """Random states projected onto the constraints; those that do not converge are left out."""
    states = random_states(equations, dict(values))
    constraints, free = equations.constraints, equations.mechanism.free
    if equations.projection is None or not constraints.matrix.shape[0]:
        return states
    residuals = ca.norm_1(ca.vertcat(constraints.residuals, constraints.rate_residuals))
    steps = ((ca.vertcat(free.q, free.p), equations.projection), (free.q_dot, equations.velocities))
    for column, moved in steps * _ROUNDS:
        rows = Quantity(equations, moved).evaluate(**states)
        states = states | dict(zip(map(str, ca.vertsplit(column)), rows, strict=True))
    on = Quantity(equations, residuals).evaluate(**states) <= _ROUNDING
    if not np.any(on):
        raise ComponentError(
            f"{equations.name}: no states on its constraints near the start; give values for coordinates"
        )
    selected = {name: np.asarray(value)[on] if np.shape(value) == on.shape else value for name, value in states.items()}
    return selected | dict(values)


def largest_relative_value(equations: Equations, expression: ca.SX, scale: ca.SX, values: Mapping[str, Any]) -> float:
    """Largest absolute value of an expression at random states, relative to ``scale``; 0.0 if it is rounding only."""
    if arrays := [name for name, value in values.items() if np.ndim(value)]:
        raise ComponentError(f"{equations.name}: {arrays[0]} must be one number here, not an array")
    states = _random_constrained_states(equations, tuple(values.items()))
    pair = Quantity(equations, ca.vertcat(expression, scale)).evaluate(**states)
    size, reference = np.max(np.abs(pair[0])), np.max(np.abs(pair[1]))
    return 0.0 if size <= _ROUNDING * reference else float(size / reference)
