"""A mechanism: free and active coordinates, energies, friction.  Its instance holds the symbols of M 3.4."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from copy import copy
from dataclasses import dataclass
from functools import cache
from typing import Self

import casadi as ca
import numpy as np

from liaisons.algebra import gradient, hessian, is_quadratic, jacobian
from liaisons.base import units
from liaisons.base.array_names import suffixed_name
from liaisons.errors import ComponentError
from liaisons.expressions import called_functions, jumping_table
from liaisons.language.checks import Formulas, call, checked_scalar, declarations_of
from liaisons.language.component import DeclarationsOf
from liaisons.language.declarations import (
    ActiveCoordinate,
    ContactFormula,
    Coordinate,
    Declaration,
    Parameter,
    ParameterArray,
    Size,
    assertion,
)
from liaisons.language.mechanical import MechanicalComponent


@dataclass(frozen=True, eq=False)
class FreeColumns:
    """Symbols of the free motion: n numbers that give the configuration, f velocities and momenta.

    For a coordinate these are q, q̇, p = ∂L/∂q̇.  For an orientation they are the quaternion (4), the angular velocity
    in the body frame (3) and the angular momentum in the inertial frame (3).
    """

    q: ca.SX  # (n, 1)
    sizes: ca.DM  # nominal values (n, 1)
    q_dot: ca.SX  # (f, 1)
    rate_sizes: ca.DM  # at the nominal value per second (f, 1)
    q_ddot: ca.SX  # (f, 1)
    p: ca.SX  # (f, 1)
    kinematics: ca.SX  # K with dq/dt = K q̇, (n, f)
    frame: ca.SX  # F with ∂L/∂q̇ = Fᵀ p, (f, f)


@dataclass(frozen=True, eq=False)
class ActiveColumns:
    """Symbols of the a active coordinates, their rates, accelerations and the operator's forces; each (a, 1)."""

    s: ca.SX
    s_dot: ca.SX
    s_ddot: ca.SX
    force: ca.SX
    adapted: int  # so many are coordinates, the others values of rheonomic constraints

    @property
    def adapted_columns(self) -> tuple[ca.SX, ca.SX]:
        """Adapted active coordinates and their rates, without the values of rheonomic constraints."""
        return self.s[: self.adapted, 0], self.s_dot[: self.adapted, 0]


@dataclass(frozen=True, eq=False)
class PlaceholderColumns:
    """Symbols in place of some points, as if these were coordinates; none in an ordinary instance."""

    names: tuple[str, ...]  # of the points
    w: ca.SX  # (w, 1)
    w_dot: ca.SX  # (w, 1)


class Mechanism(MechanicalComponent, abstract=True):
    """Mechanical system with active constraints, described by its energies; abstract.

    A subclass declares parameters and coordinates and defines :meth:`kinetic_energy` and, as needed,
    :meth:`potential_energy`, :meth:`friction_coefficient`, :meth:`dissipation_function`, :meth:`lagrangian`, points,
    outputs and conditions.  One that defines :meth:`lagrangian` alone may have any that is hyper-regular in its free
    rates (M 3); then E = Σ q̇ ∂L/∂q̇ + Σ σ̇ ∂L/∂σ̇ − L, V is E at rest, and T is E − V.

    :raises ComponentError: when the subclass is defined, if a symbol is unknown, a size or unit is wrong, two names
        clash, or the mass matrix at the start is not positive definite; if L is not quadratic in the free rates, for
        constraints, contacts, an orientation and a friction coefficient.
    """

    assertions = DeclarationsOf(assertion)
    free: FreeColumns
    active: ActiveColumns
    multipliers: ca.SX
    placeholders: PlaceholderColumns

    def __init__(self) -> None:
        super().__init__()
        self.sizes = {size.name: size.default for size in declarations_of(type(self), Size)}
        free, orientations = [c.name for c in self.coordinates], self.orientations
        if len({orientation.quaternion for orientation in orientations}) < len(orientations):
            raise ComponentError(
                f"{type(self).__name__}: variables of two orientations have the same names; give each a prefix"
            )
        nominals, turning = [q.nominal for q in self.coordinates], len(orientations)
        self.free = FreeColumns(
            q=self._add_symbols(self.motion_names("quaternion")),
            sizes=ca.DM([*nominals, *[1.0] * 4 * turning]),
            q_dot=self._add_symbols(self.motion_names("rates")),
            rate_sizes=ca.DM([*nominals, *[1.0] * 3 * turning]),
            p=self._add_symbols(self.motion_names("momenta")),
            q_ddot=self._add_symbols(self.motion_names("accelerations")),
            kinematics=ca.diagcat(ca.SX.eye(len(free)), *(getattr(self, o.name).kinematics for o in orientations)),
            frame=ca.diagcat(ca.SX.eye(len(free)), *(getattr(self, o.name).matrix for o in orientations)),
        )
        active = [c.name for c in self.actives]
        self.active = ActiveColumns(
            s=self._add_symbols(active),
            s_dot=self._add_symbols(f"{s}_dot" for s in active),
            s_ddot=self._add_symbols(f"{s}_ddot" for s in active),
            force=self._add_symbols(f"{s}_force" for s in active),
            adapted=len(active) - len(self.rheonomic_constraints),
        )
        self.internal = self._add_symbols(state.name for state in self.internal_states)
        self.multipliers = self._add_symbols(f"lambda_{c.name}" for c in self.passive_constraints)
        self.contact_forces = self._add_symbols(suffixed_name(c.name, "_force") for c in self.contact_formulas)
        self.placeholders = PlaceholderColumns((), ca.SX(0, 1), ca.SX(0, 1))

    # ---- defined by components -----------------------------------------------------------------------------

    def kinetic_energy(self) -> ca.SX:
        """Kinetic energy T (K eq. 12), usually by :meth:`speed_squared`; by default from the Lagrangian."""
        rates, L = _rates(self), self.lagrangian()
        return ca.jtimes(L, rates, rates) - L - self.potential_energy()

    def potential_energy(self) -> ca.SX:
        """Potential energy V; zero by default, or −L at rest where only the Lagrangian is defined."""
        rates = _rates(self)
        return ca.SX(0) if self.has_energies() else -ca.substitute(self.lagrangian(), rates, ca.SX.zeros(rates.shape))

    def lagrangian(self) -> ca.SX:
        """Lagrangian L = T − V (K eq. 18); override it for forces that depend on the velocity (K eq. 24).

        :raises ComponentError: if neither it nor :meth:`kinetic_energy` is defined.
        """
        if not self.has_energies():
            raise ComponentError(f"{type(self).__name__} defines no kinetic_energy(), which every Mechanism has to")
        return self.kinetic_energy() - self.potential_energy()

    @classmethod
    def of_size(cls, n: object) -> type[Mechanism]:
        """The same mechanism with n elements.

        :raises ComponentError: if it has no Size n, or n is not a whole number, or too small.
        """
        size = getattr(cls, "n", None)
        if not isinstance(size, Size):
            raise ComponentError(f"{cls.__name__}: n = {n!r}: only what declares n = Size(...) has a size")
        count = size.checked(cls.__name__, n)
        return cls if count == size.default else _resized(cls, count, size.description)

    # ---- for use in methods --------------------------------------------------------------------------------------

    def dot(self, expression: ca.SX) -> ca.SX:
        """Total time derivative along the motion of an expression of coordinates and rates; of any shape."""
        free, active = self.free, self.active
        where = ca.vertcat(free.q, self.placeholders.w, active.s, free.q_dot, active.s_dot)
        turning = free.kinematics @ free.q_dot
        rates = ca.vertcat(turning, self.placeholders.w_dot, active.s_dot, free.q_ddot, active.s_ddot)
        column = ca.SX(expression)
        if called_functions(column):  # rates as factors, not as arguments of calls, so that what is quadratic is seen
            return ca.reshape(jacobian(column, where) @ rates, column.shape)
        return ca.jtimes(column, where, rates)

    def momentum(self, coordinate: ca.SX) -> ca.SX:
        """Momentum p = ∂L/∂q̇ of a free coordinate, for outputs."""
        return self._symbol(f"p_{coordinate}", "momentum()", self.coordinates)

    def constraint_force(self, name: str) -> ca.SX:
        """Multiplier λ of a constraint, for outputs; the force is λ times the constraint's gradient."""
        return self._symbol(f"lambda_{name}", "constraint_force()", self.passive_constraints)

    def contact_force(self, name: str) -> ca.SX:
        """Force of a unilateral liaison or of dry friction, for outputs."""
        of = "unilateral liaisons or dry frictions"
        return self._symbol(suffixed_name(name, "_force"), f"contact_force({name!r})", self.contact_formulas, of)

    def operator_force(self, coordinate: ca.SX | str) -> ca.SX:
        """Generalised force λ of the operator along an active coordinate (M eq. 27), for outputs.

        :param coordinate: the coordinate, or its name; the name for a rheonomic constraint.
        """
        return self._symbol(f"{coordinate}_force", "operator_force()", self.actives)

    def with_symbolic_points(self, names: Sequence[str]) -> Self:
        """Copy of the instance in which these points are symbols, not expressions of the coordinates."""
        twin = copy(self)
        points = {name: {axis: ca.SX.sym(f"{name}_{axis}") for axis in getattr(self, name)} for name in names}
        w = ca.vertcat(*(symbol for axes in points.values() for symbol in axes.values()))
        rates = [ca.SX.sym(f"{symbol}_dot") for symbol in ca.vertsplit(w)]
        twin.formulas = dict(points)
        twin.placeholders = PlaceholderColumns(tuple(names), w, ca.vertcat(*rates))
        return twin

    def _symbol(
        self, name: str, method: str, kind: Sequence[Declaration], of: str = "coordinates or constraints"
    ) -> ca.SX:
        if name not in self.symbols:
            names = ", ".join(c.name for c in kind) or "none is declared"
            raise ComponentError(f"{type(self).__name__}: {method} takes one of its {of}: {names}")
        return self.symbols[name]

    # ---- derived -------------------------------------------------------------------------

    @classmethod
    def has_energies(cls) -> bool:
        """Whether the class defines its kinetic energy, not the Lagrangian alone."""
        return cls.kinetic_energy is not Mechanism.kinetic_energy

    def start_values(self) -> dict[str, float]:
        """Start values of all symbols by name: as declared, else 0."""
        declared = (*self.parameters, *self.coordinates, *self.actives, *self.internal_states)
        values = dict.fromkeys(self.symbols, 0.0) | {item.name: item.start for item in declared}
        values |= {orientation.quaternion[0]: 1.0 for orientation in self.orientations}
        return values | {suffixed_name(q.name, "_dot"): q.start_rate for q in self.coordinates}

    def _check(self) -> None:
        for item in (*self.coordinates, *self.parameters):
            if item.leading and not isinstance(item, ParameterArray):
                item.refuse(f"starts with {item.leading}: only an array does; say size='n', with n = Size(...)")
        for item in declarations_of(type(self), ContactFormula):
            extent, column = item.extent(type(self)), call(self, item.name)
            if extent and ca.SX(column).shape != (extent.count, 1):
                item.refuse(f"returns {column}: it must be a column of {item.size} = {extent.count} elements")
        parameters, internal = self._symbols_by_name(self.parameter_column), self._symbols_by_name(self.internal)
        configuration = parameters | self._symbols_by_name(self.free.q, self.active.s)
        motion = configuration | self._symbols_by_name(self.free.q_dot, self.active.s_dot)
        formulas = Formulas(self)
        self._check_points(formulas, configuration)
        if self.has_energies():
            formulas("kinetic_energy", motion, "J")
            formulas("potential_energy", configuration, "J")
        lagrangian = checked_scalar(type(self), "lagrangian", call(self, "lagrangian"), motion)
        if type(self).lagrangian is not Mechanism.lagrangian:  # T - V is checked already
            formulas.add("lagrangian", lagrangian, motion, "J")
        formulas("friction_coefficient", parameters | internal, "1/s")
        formulas("dissipation_function", motion | internal, "W")
        allowed: dict[tuple[Declaration, ...], dict[str, ca.SX]] = {
            (*self.constraints, *self.rheonomic_constraints): configuration,
            (*self.non_holonomic, *self.assertions): motion,
            self.outputs: self.symbols,
            self.calculated_parameters: parameters,
        }
        self.check_contacts(formulas, configuration, motion, (self.free.q, self.free.q_dot))
        for items, symbols in allowed.items():
            for item in items:
                formulas(item.name, symbols, units.ANY if isinstance(item, assertion) else item.unit)
        self._refuse_kinked_tables(lagrangian)
        formulas.check_internal_rates(motion | internal)
        formulas.check_units(self.layout().variables, self.symbols)
        self._check_mass_matrix(lagrangian, motion)
        if not is_quadratic(lagrangian, self.free.q_dot):
            self._check_nonquadratic()

    def _refuse_kinked_tables(self, lagrangian: ca.SX) -> None:
        """Raise a ComponentError for linear interpolants at whose points rates would jump."""
        words = "which is interpolated linearly and has kinks, at which rates would jump; interpolate by 'bspline'"
        if table := jumping_table(lagrangian, slope=True):
            raise ComponentError(
                f"{type(self).__name__}: the kinetic energy contains the slope of the table {table!r}, {words}"
            )
        for item in (*self.constraints, *self.rheonomic_constraints, *self.unilaterals):
            if table := jumping_table(ca.SX(getattr(self, item.name)), slope=False):
                item.refuse(f"contains the table {table!r}, {words}")

    def _check_mass_matrix(self, lagrangian: ca.SX, motion: dict[str, ca.SX]) -> None:
        name, kinetic = type(self).__name__, ca.SX(self.kinetic_energy())
        metric, rates = hessian(lagrangian, self.free.q_dot), _rates(self)
        if self.has_energies() and ca.depends_on(metric, rates):
            raise ComponentError(
                f"{name}.kinetic_energy must be quadratic in the rates; its mass matrix depends on them: define "
                "lagrangian() alone, from which the energies follow"
            )
        start = self.start_values()
        at_rest = ca.substitute(ca.vertcat(kinetic, gradient(kinetic, rates)), rates, ca.SX.zeros(rates.shape))
        function = ca.Function("check", list(motion.values()), [metric, kinetic, at_rest])
        at_start = ", ".join(f"{c.name} = {c.start:g}" for c in (*self.coordinates, *self.actives))

        def evaluate(values: Mapping[str, float]) -> list[np.ndarray]:
            return list(map(np.asarray, function(*(values[symbol] for symbol in motion))))

        matrix, energy, left = evaluate(start)
        if not (np.isfinite(matrix).all() and np.isfinite(energy)):
            raise ComponentError(
                f"{name}: the kinetic energy is not finite at the start ({at_start}); move the start value"
            )
        if self.has_energies() and np.any(left != 0):
            raise ComponentError(
                f"{name}.kinetic_energy must be quadratic in the rates; at rest it or its momenta are "
                f"{left.ravel().tolist()} instead of 0: what is linear in the rates belongs to lagrangian()"
            )
        if is_positive_definite(matrix):
            return
        still = [str(v) for row, v in zip(matrix.T, ca.vertsplit(self.free.q_dot), strict=True) if not row.any()]
        what = f"no mass moves with {still[0]}" if still else f"mass matrix {matrix.tolist()} is not positive definite"
        self._refuse_start_values(what, lambda item, other: evaluate(start | {item.name: other})[0])
        if still:
            why = _singularity_reason(self, lagrangian, motion[still[0]])
            raise ComponentError(f"{name}: mass matrix is singular at the start ({at_start}): {why}")
        raise ComponentError(
            f"{name}: {what} at the start ({at_start}); check the masses and that every free coordinate moves one"
        )

    def _refuse_start_values(
        self, what: str, mass_matrix: Callable[[Parameter | Coordinate | ActiveCoordinate, float], np.ndarray]
    ) -> None:
        """Name a start value or a parameter with another value of which the mass matrix would be positive definite.

        :param what: what is wrong with it at the start.
        """
        for item, other in _trial_values(self):
            if not is_positive_definite(mass_matrix(item, other)):
                continue
            value = f"{item.name} = {item.start:g}" + ("" if item.unit == "1" else f" {item.unit}")
            if isinstance(item, Parameter):
                raise ComponentError(f"{type(self).__name__}: {what} while {value}; let its default be > 0")
            raise ComponentError(
                f"{type(self).__name__}: {what} at {value}, where the start lies on a singularity; "
                "give another start, and exclude the singularity by above=, below= or an @assertion"
            )

    def _check_nonquadratic(self) -> None:
        """Raise a ComponentError for what a Lagrangian that is not quadratic in the rates cannot have."""
        others = [item.name for item in (*self.all_constraints, *self.contact_formulas, *self.orientations)]
        if others or not ca.SX(self.friction_coefficient()).is_zero():
            name = (others or ["friction_coefficient"])[0]
            raise ComponentError(
                f"{type(self).__name__}: {name} needs a Lagrangian that is quadratic in the rates; take independent "
                "coordinates, and dissipation_function() for friction"
            )


def _rates(m: Mechanism) -> ca.SX:
    """Column of the rates of free, then of active coordinates."""
    return ca.vertcat(m.free.q_dot, m.active.s_dot)


@cache
def _resized(component: type[Mechanism], n: int, description: str) -> type[Mechanism]:
    own = {"n": Size(n, description), "__doc__": component.__doc__, "__module__": component.__module__}
    return type(component.__name__, (component,), own)


def _singularity_reason(m: Mechanism, lagrangian: ca.SX, rate: ca.SX) -> str:
    """Why no mass moves with a rate, and the remedy."""
    if ca.depends_on(gradient(lagrangian, rate), m.active.s_dot):
        return (
            f"{rate} is multiplied by rates of active coordinates alone, so that Lagrange's equation is a condition on "
            "the operator, and leaves the motion and the operator's force open (M eq. 39); give it a kinetic energy of "
            "its own"
        )
    return (
        f"no kinetic energy belongs to {rate}; let kinetic_energy depend on it, or make its coordinate an "
        "ActiveCoordinate"
    )


def is_positive_definite(matrix: np.ndarray) -> bool:
    """Whether a mass matrix is finite and positive definite."""
    if not np.all(np.isfinite(matrix)):
        return False
    least = np.min(np.linalg.eigvalsh(matrix), initial=np.inf)  # all coordinates may be prescribed
    return bool(least > 1e-14 * np.max(np.abs(matrix), initial=0.0))


def _trial_values(m: Mechanism) -> Iterator[tuple[Parameter | Coordinate | ActiveCoordinate, float]]:
    """Parameters, coordinates and actives whose start may make the mass matrix singular, each with a value to try."""
    yield from ((item, 1.0) for item in m.parameters if item.start <= 0)
    for item in (*m.coordinates, *m.actives):
        size = item.nominal if isinstance(item, Coordinate) else 1.0
        yield from ((item, item.start + change * size) for change in (0.1, -0.1))
