"""A mechanism: free and active coordinates, energies, friction.  Its instance holds the symbols of M 3.4."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Iterator, Mapping, Sequence
from copy import copy
from dataclasses import dataclass
from typing import ClassVar, Self

import casadi as ca
import numpy as np

from liaisons import units
from liaisons.errors import ComponentError
from liaisons.expressions.algebra import gradient
from liaisons.expressions.dimensions import Declared, check_units
from liaisons.language.component import (
    Component,
    call,
    check_internal_rates,
    checked,
    components_of,
    declared,
    require_units,
    scalar,
)
from liaisons.language.declarations import (
    ActiveCoordinate,
    Calculated,
    Condition,
    Constraint,
    Coordinate,
    Declaration,
    InternalState,
    NonHolonomic,
    Orientation,
    Output,
    Parameter,
    Point,
    Submersion,
)


@dataclass(frozen=True, eq=False)
class FreeColumns:
    """Symbols of the free motion: n numbers that give the configuration, f velocities and momenta.

    For a coordinate these are q, q̇, p = ∂L/∂q̇.  For an orientation they are the quaternion (4), the angular velocity
    in the body frame (3) and the angular momentum in the inertial frame (3).
    """

    q: ca.SX  # (n, 1)
    q_dot: ca.SX  # (f, 1)
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


@dataclass(frozen=True, eq=False)
class PlaceholderColumns:
    """Symbols in the place of some points, as if these were coordinates; none in an ordinary picture."""

    names: tuple[str, ...]  # of the points
    w: ca.SX  # (w, 1)
    w_dot: ca.SX  # (w, 1)


class Mechanism(Component, abstract=True):
    """Mechanical system with active constraints, described by its energies; abstract.

    A subclass declares parameters and coordinates and defines :meth:`kinetic_energy` and, as needed,
    :meth:`potential_energy`, :meth:`friction_coefficient`, :meth:`dissipation_function`, :meth:`lagrangian`, points,
    outputs and conditions.

    :raises ComponentError: when the subclass is defined, if a symbol is unknown, a size or unit is wrong, two names
        clash, or the mass matrix at the start is not positive definite.
    """

    coordinates: ClassVar[tuple[Coordinate, ...]] = ()
    actives: ClassVar[tuple[ActiveCoordinate, ...]] = ()
    orientations: ClassVar[tuple[Orientation, ...]] = ()
    internal_states: ClassVar[tuple[InternalState, ...]] = ()
    submersions: ClassVar[tuple[Submersion, ...]] = ()
    constraints: ClassVar[tuple[Constraint, ...]] = ()
    non_holonomic: ClassVar[tuple[NonHolonomic, ...]] = ()
    points: ClassVar[tuple[Point, ...]] = ()
    outputs: ClassVar[tuple[Output, ...]] = ()
    calculated_parameters: ClassVar[tuple[Calculated, ...]] = ()
    conditions: ClassVar[tuple[Condition, ...]] = ()
    free: FreeColumns
    active: ActiveColumns
    internal: ca.SX
    multipliers: ca.SX
    placeholders: PlaceholderColumns

    def __init__(self) -> None:
        super().__init__()
        free, turns = [c.name for c in self.coordinates], list(self.orientations)
        rates, momenta = [f"{q}_dot" for q in free], [f"p_{q}" for q in free]
        for turn in turns:
            rates, momenta = [*rates, *turn.rates], [*momenta, *turn.momenta]
        configuration = self._symbols([*free, *(name for turn in turns for name in turn.quaternion)])
        velocities = self._symbols(rates)
        momentum_symbols = self._symbols(momenta)
        attitudes = [getattr(self, turn.name) for turn in turns]
        self.free = FreeColumns(
            q=configuration,
            q_dot=velocities,
            q_ddot=self._symbols(
                f"{name.removesuffix('_dot')}_{'ddot' if name.endswith('_dot') else 'dot'}" for name in rates
            ),
            p=momentum_symbols,
            kinematics=ca.diagcat(ca.SX.eye(len(free)), *(attitude.kinematics for attitude in attitudes)),
            frame=ca.diagcat(ca.SX.eye(len(free)), *(attitude.matrix for attitude in attitudes)),
        )
        active = [c.name for c in self.actives]
        self.active = ActiveColumns(
            s=self._symbols(active),
            s_dot=self._symbols(f"{s}_dot" for s in active),
            s_ddot=self._symbols(f"{s}_ddot" for s in active),
            force=self._symbols(f"{s}_force" for s in active),
        )
        self.internal = self._symbols(state.name for state in self.internal_states)
        self.multipliers = self._symbols(f"lambda_{c.name}" for c in (*self.constraints, *self.non_holonomic))
        self.placeholders = PlaceholderColumns((), ca.SX(0, 1), ca.SX(0, 1))

    # ---- what a component defines -----------------------------------------------------------------------------

    @abstractmethod
    def kinetic_energy(self) -> ca.SX:
        """T, quadratic in the rates (K eq. 12); usually by :meth:`speed_squared`."""

    def potential_energy(self) -> ca.SX:
        """V(q, s); zero unless the component says otherwise."""
        return ca.SX(0)

    def friction_coefficient(self) -> ca.SX:
        """η of K eq. 64, Q = −η ∂T/∂q̇: the declared Friction, zero without one."""
        return self.declared_friction()

    def dissipation_function(self) -> ca.SX:
        """Rayleigh's D(q, q̇, s, ṡ) [W] of further friction, Q = −∂D/∂q̇; zero unless the component says otherwise.

        A damper c between two parts, with the rate v of one relative to the other: D = c v²/2.
        """
        return ca.SX(0)

    def lagrangian(self) -> ca.SX:
        """L = T − V (K eq. 18); override it where forces depend on the velocity (K eq. 24)."""
        return self.kinetic_energy() - self.potential_energy()

    def internal_rates(self) -> Mapping[str, ca.SX]:
        """Rates of the internal states, by name."""
        return {}

    # ---- what it may use --------------------------------------------------------------------------------------

    def dot(self, expression: ca.SX) -> ca.SX:
        """Total time derivative along the motion of an expression of coordinates and rates; of any shape."""
        free, active = self.free, self.active
        where = ca.vertcat(free.q, self.placeholders.w, active.s, free.q_dot, active.s_dot)
        turning = free.kinematics @ free.q_dot
        rates = ca.vertcat(turning, self.placeholders.w_dot, active.s_dot, free.q_ddot, active.s_ddot)
        return ca.jtimes(ca.SX(expression), where, rates)

    def speed_squared(self, position: Mapping[str, ca.SX]) -> ca.SX:
        """|ṙ|² of a point given by its Cartesian components."""
        return ca.SX(sum(self.dot(component) ** 2 for component in position.values()))

    def momentum(self, coordinate: ca.SX) -> ca.SX:
        """p = ∂L/∂q̇ of a free coordinate; for outputs."""
        return self._of(f"p_{coordinate}", "momentum", self.coordinates)

    def constraint_force(self, name: str) -> ca.SX:
        """λ of a constraint of this name: its force is λ times the constraint's gradient; for outputs."""
        return self._of(f"lambda_{name}", "constraint_force", (*self.constraints, *self.non_holonomic))

    def operator_force(self, coordinate: ca.SX | str) -> ca.SX:
        """λ of M eq. 27, the generalised force of the operator along an active coordinate; for outputs.

        :param coordinate: the coordinate, or its name; the name for a submersion.
        """
        return self._of(f"{coordinate}_force", "operator_force", self.actives)

    def with_placeholders(self, names: Sequence[str]) -> Self:
        """The same picture with symbols for these points, so that expressions show how they depend on them."""
        twin = copy(self)
        places = {name: {axis: ca.SX.sym(f"{name}_{axis}") for axis in getattr(self, name)} for name in names}
        w = ca.vertcat(*(symbol for axes in places.values() for symbol in axes.values()))
        rates = [ca.SX.sym(f"{symbol}_dot") for symbol in ca.vertsplit(w)]
        twin.formulas = dict(places)
        twin.placeholders = PlaceholderColumns(tuple(names), w, ca.vertcat(*rates))
        return twin

    def _of(self, name: str, method: str, kind: Sequence[Declaration]) -> ca.SX:
        if name not in self.symbols:
            names = ", ".join(c.name for c in kind) or "none is declared"
            raise ComponentError(
                f"{type(self).__name__}: {method}() takes one of its coordinates or constraints: {names}"
            )
        return self.symbols[name]

    # ---- what the package makes of it -------------------------------------------------------------------------

    @classmethod
    def variable_names(cls) -> list[str]:
        picture = cls()
        names = [p.name for p in (*cls.parameters, *cls.outputs, *cls.calculated_parameters)]
        for name in (f"{point.name}_{axis}" for point in cls.points for axis in components_of(picture, point)):
            names += [name, f"{name}_dot", f"{name}_ddot", f"{name}_load"]
        for q in (c.name for c in cls.coordinates):
            names += [f"{q}_0", f"{q}_dot_0", q, f"{q}_dot", f"{q}_ddot", f"p_{q}", f"p_{q}_dot"]
            names += [f"{q}_force", f"{q}_load"]
        for turn in cls.orientations:
            names += [f"{name}{end}" for name in (*turn.quaternion, *turn.rates, *turn.momenta) for end in ("", "_dot")]
            names += [f"{name}_0" for name in (*turn.quaternion, *turn.start_names)]
        for state in (state.name for state in cls.internal_states):
            names += [state, f"{state}_dot", f"{state}_0"]
        for c in (*cls.constraints, *cls.non_holonomic):
            names += [f"{c.name}_residual", f"lambda_{c.name}"]
        names += [f"{c.name}_residual" for c in cls.submersions]
        for s in (c.name for c in cls.actives):
            names += [s, f"{s}_dot", f"{s}_ddot", f"{s}_force", f"{s}_power", f"{s}_mismatch"]
        names += ["kinetic_energy", "potential_energy", "energy", "work", "dissipated", "energy_balance"]
        return [*names, "power", "dissipation"]

    @classmethod
    def _collect(cls) -> None:
        super()._collect()
        cls.coordinates = declared(cls, Coordinate)
        cls.orientations = declared(cls, Orientation)
        if len(cls.orientations) > 1:
            raise ComponentError(
                f"{cls.__name__}: declare one Orientation at most; the names of its variables are fixed"
            )
        cls.internal_states = declared(cls, InternalState)
        cls.submersions = declared(cls, Submersion)
        cls.constraints = declared(cls, Constraint)
        cls.non_holonomic = declared(cls, NonHolonomic)
        cls.actives = (*declared(cls, ActiveCoordinate), *(item.active for item in cls.submersions))
        cls.points = declared(cls, Point)
        cls.outputs = declared(cls, Output)
        cls.calculated_parameters = declared(cls, Calculated)
        cls.conditions = declared(cls, Condition)

    @classmethod
    def _check(cls) -> None:
        if not cls.coordinates and not cls.orientations:
            raise ComponentError(f"{cls.__name__}: declare at least one Coordinate that moves freely")
        for item in cls.coordinates:
            if item.leading:
                raise ComponentError(
                    f"{cls.__name__}.{item.name}: start = {item.leading}: only a Chain starts by links"
                )
        require_units(cls)
        picture = cls()
        parameters = _named(picture, picture.parameter_column)
        internal = _named(picture, picture.internal)
        configuration = parameters | _named(picture, picture.free.q, picture.active.s)
        motion = configuration | _named(picture, picture.free.q_dot, picture.active.s_dot)
        formulas: list[Declared] = []  # those that others are made of first

        def check(name: str, symbols: dict[str, ca.SX], unit: str) -> ca.SX:
            expression = scalar(cls, name, call(picture, name), symbols)
            formulas.extend(checked(cls, name, expression, unit))
            return expression

        known: dict[tuple[Declaration, ...], dict[str, ca.SX]] = {
            (*cls.constraints, *cls.submersions): configuration,
            (*cls.non_holonomic, *cls.conditions): motion,
            cls.outputs: picture.symbols,
            cls.calculated_parameters: parameters,
        }
        for item in cls.points:
            for axis, component in components_of(picture, item).items():
                label = f"{item.name}[{axis!r}]"
                formulas.extend(checked(cls, label, scalar(cls, label, component, configuration), item.unit))
        kinetic = check("kinetic_energy", motion, "J")
        check("potential_energy", configuration, "J")
        lagrangian = scalar(cls, "lagrangian", call(picture, "lagrangian"), motion)
        if cls.lagrangian is not Mechanism.lagrangian:  # T - V has been looked at
            formulas.extend(checked(cls, "lagrangian", lagrangian, "J"))
        check("friction_coefficient", parameters | internal, "1/s")
        check("dissipation_function", motion | internal, "W")
        for items, symbols in known.items():
            for item in items:
                check(item.name, symbols, units.ANY if isinstance(item, Condition) else item.unit)
        formulas += check_internal_rates(picture, cls.internal_states, motion | internal)
        check_units(_symbols_with_units(picture), formulas)
        _check_mass_matrix(picture, lagrangian, kinetic, motion)


def start_values(picture: Mechanism) -> dict[str, float]:
    """Defaults of parameters, coordinates, rates and inputs; what is not declared starts at 0."""
    values = dict.fromkeys(picture.symbols, 0.0)
    values |= {item.name: item.start for item in (*picture.parameters, *picture.coordinates, *picture.actives)}
    values |= {item.name: item.start for item in picture.internal_states}
    values |= {turn.quaternion[0]: 1.0 for turn in picture.orientations}
    return values | {f"{q.name}_dot": q.start_rate for q in picture.coordinates}


def _symbols_with_units(picture: Mechanism) -> dict[str, tuple[ca.SX, str]]:
    """All symbols of a mechanism by name, with the units that they have in its formulas."""
    unit = {p.name: p.checked_unit for p in picture.parameters}
    unit |= {state.name: state.checked_unit for state in picture.internal_states}
    for q in (*picture.coordinates, *picture.actives):
        speed = units.rate(q.unit)
        unit |= {q.name: q.unit, f"{q.name}_dot": speed, f"{q.name}_ddot": units.rate(speed)}
        unit |= {f"p_{q.name}": units.momentum(q.unit), f"{q.name}_force": units.force(q.unit)}
    for turn in picture.orientations:
        kinds = zip((turn.quaternion, turn.rates, turn.momenta), ("1", "rad/s", "kg.m2/s"), strict=True)
        unit |= {name: kind for names, kind in kinds for name in names}
        unit |= {f"{name}_dot": "rad/s2" for name in turn.rates}
    unit |= {f"lambda_{c.name}": units.force(c.unit) for c in picture.constraints}
    unit |= {f"lambda_{c.name}": units.multiplier(c.unit) for c in picture.non_holonomic}
    return {name: (symbol, unit.get(name, units.ANY)) for name, symbol in picture.symbols.items()}


def _named(picture: Mechanism, *columns: ca.SX) -> dict[str, ca.SX]:
    names = {str(element) for column in columns for element in ca.vertsplit(column)}
    return {name: picture.symbols[name] for name in names}


def _check_mass_matrix(picture: Mechanism, lagrangian: ca.SX, kinetic: ca.SX, motion: dict[str, ca.SX]) -> None:
    name = type(picture).__name__
    metric, rates = ca.hessian(lagrangian, picture.free.q_dot)[0], ca.vertcat(picture.free.q_dot, picture.active.s_dot)
    if ca.depends_on(metric, rates):
        raise ComponentError(f"{name}.kinetic_energy must be quadratic in the rates; its mass matrix depends on them")
    start = start_values(picture)
    at_rest = ca.substitute(ca.vertcat(kinetic, gradient(kinetic, rates)), rates, ca.SX.zeros(rates.shape))
    function = ca.Function("check", list(motion.values()), [metric, kinetic, at_rest])
    at_start = ", ".join(f"{c.name} = {c.start:g}" for c in (*picture.coordinates, *picture.actives))

    def at(values: Mapping[str, float]) -> tuple[np.ndarray, float, np.ndarray]:
        metric, energy, left = function(*(values[symbol] for symbol in motion))
        return np.asarray(metric), float(energy), np.asarray(left)

    matrix, energy, left = at(start)
    if not (np.all(np.isfinite(matrix)) and np.isfinite(energy)):
        raise ComponentError(
            f"{name}: the kinetic energy is not finite at the start ({at_start}); move the start value"
        )
    if np.any(left != 0):
        raise ComponentError(
            f"{name}.kinetic_energy must be quadratic in the rates; at rest it or its momenta are "
            f"{left.ravel().tolist()} instead of 0: what is linear in the rates belongs to lagrangian()"
        )
    if _is_inertia(matrix):
        return
    still = [str(v) for row, v in zip(matrix.T, ca.vertsplit(picture.free.q_dot), strict=True) if not row.any()]
    what = f"no mass moves with {still[0]}" if still else f"mass matrix {matrix.tolist()} is not positive definite"
    for item, other in _other_values(picture):
        if not _is_inertia(at(start | {item.name: other})[0]):
            continue
        value = f"{item.name} = {item.start:g}" + ("" if item.unit == "1" else f" {item.unit}")
        if isinstance(item, Parameter):
            raise ComponentError(f"{name}: {what} while {value}; let its default be > 0")
        raise ComponentError(
            f"{name}: {what} at {value}, where the start lies on a singularity; "
            "give another start, and exclude the singularity by above=, below= or a @condition"
        )
    if still:
        raise ComponentError(
            f"{name}: mass matrix is singular at the start ({at_start}): no kinetic energy belongs to {still[0]}; "
            "let kinetic_energy depend on it, or make its coordinate an ActiveCoordinate"
        )
    raise ComponentError(
        f"{name}: {what} at the start ({at_start}); check the masses and that every free coordinate moves one"
    )


def _is_inertia(matrix: np.ndarray) -> bool:
    """Whether a mass matrix is finite and positive definite."""
    finite = bool(np.all(np.isfinite(matrix)))
    return finite and bool(np.min(np.linalg.eigvalsh(matrix)) > 1e-14 * np.max(np.abs(matrix)))


def _other_values(picture: Mechanism) -> Iterator[tuple[Parameter | Coordinate | ActiveCoordinate, float]]:
    """What could make a mass matrix singular, one at a time, with a value at which it might not do so."""
    yield from ((item, 1.0) for item in picture.parameters if item.start <= 0)
    for item in (*picture.coordinates, *picture.actives):
        size = item.nominal if isinstance(item, Coordinate) else 1.0
        yield from ((item, item.start + change * size) for change in (0.1, -0.1))
