"""Base of mechanisms and chains: coordinates, energies, friction, named points, and the FMU's variables."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Iterator, Mapping
from dataclasses import replace
from functools import partial
from typing import Any, Literal

import casadi as ca

from liaisons.algebra import stack
from liaisons.base import units
from liaisons.base.array_names import array_and_index, suffixed_name
from liaisons.errors import ComponentError
from liaisons.language import layout
from liaisons.language.checks import Formulas, call, components_of, declarations_of, require_units, shapes_of
from liaisons.language.component import Component, DeclarationsOf, elements_of
from liaisons.language.declarations import (
    ActiveCoordinate,
    ContactFormula,
    Coordinate,
    Declaration,
    Friction,
    Orientation,
    Size,
    calculated,
    constraint,
    non_holonomic,
    output,
    point,
    rheonomic_constraint,
)
from liaisons.language.layout import Layout
from liaisons.language.shapes import Ball, Shapes
from liaisons.language.variables import ActiveInput, Dimension, State, Variable

IMPACT_LOSS = ("impact_loss", "energy lost by impacts since the start")
"""Name and description of what every account may have."""

_AFFIXES = {"quaternion": ("", ""), "rates": ("", "_dot"), "accelerations": ("", "_ddot"), "momenta": ("p_", "")}


class _Actives(DeclarationsOf[ActiveCoordinate]):
    """The active coordinates, those of rheonomic constraints last."""

    def __get__(self, instance: object, owner: type) -> tuple[ActiveCoordinate, ...]:
        return (*super().__get__(instance, owner), *(item.active for item in elements_of(owner, rheonomic_constraint)))


class _ContactsOf(DeclarationsOf[ContactFormula]):
    """The contacts of one kind."""

    def __init__(self, *, friction: bool) -> None:
        super().__init__(ContactFormula)
        self._is_friction = friction

    def __get__(self, instance: object, owner: type) -> tuple[Any, ...]:
        return tuple(item for item in super().__get__(instance, owner) if item.is_friction == self._is_friction)


class MechanicalComponent(Component, abstract=True):
    """A component described by its energies: a mechanism, or one link of a chain; abstract."""

    coordinates = DeclarationsOf(Coordinate)
    actives = _Actives(ActiveCoordinate)
    orientations = DeclarationsOf(Orientation)
    rheonomic_constraints = DeclarationsOf(rheonomic_constraint)
    constraints = DeclarationsOf(constraint)
    non_holonomic = DeclarationsOf(non_holonomic)
    unilaterals = _ContactsOf(friction=False)
    dry_frictions = _ContactsOf(friction=True)
    points = DeclarationsOf(point)
    outputs = DeclarationsOf(output)
    calculated_parameters = DeclarationsOf(calculated)
    dimension: Dimension | None = None  # of the variables of links
    contact_forces: ca.SX  # of unilateral liaisons, then of dry friction
    sizes: dict[str, int]

    @abstractmethod
    def kinetic_energy(self) -> ca.SX:
        """Kinetic energy T, quadratic in the rates (K eq. 12); usually by :meth:`speed_squared`."""

    def potential_energy(self) -> ca.SX:
        """Potential energy V of the configuration; zero by default."""
        return ca.SX(0)

    def friction_coefficient(self) -> ca.SX:
        """Coefficient η of K eq. 64, Q = −η ∂T/∂q̇: the declared Friction; zero without one."""
        return ca.SX(sum(self.symbols[p.name] for p in self.parameters if isinstance(p, Friction)))

    def dissipation_function(self) -> ca.SX:
        """Dissipation function D [W] after Rayleigh, Q = −∂D/∂q̇; zero by default.

        That of a damper c at the relative velocity v is D = c v²/2.
        """
        return ca.SX(0)

    @abstractmethod
    def dot(self, expression: ca.SX) -> ca.SX:
        """Total time derivative of an expression of the configuration and its rates; of any shape."""

    def speed_squared(self, position: Mapping[str, ca.SX]) -> ca.SX:
        """Squared speed ``|ṙ|²`` of a point with these Cartesian components."""
        return ca.SX(sum(self.dot(component) ** 2 for component in position.values()))

    def picture(self) -> Shapes:
        """Shapes of the picture, between named points; in a chain, those of the link ``self.number``."""
        return [Ball(getattr(self, item.name)) for item in self.points]

    def point_components(self) -> dict[str, ca.SX]:
        """Components of all named points, ``"bob_x"`` and so on."""
        components = ((item.name, components_of(self, item.name)) for item in self.points)
        return {f"{name}_{axis}": ca.SX(value) for name, axes in components for axis, value in axes.items()}

    def contact_rates(self) -> ca.SX:
        """Column of the rates of unilateral liaisons, then of the relative velocities of dry friction (c, 1)."""
        return stack(
            [*map(self.dot, map(self.expression_of, self.unilaterals)), *map(self.expression_of, self.dry_frictions)]
        )

    def contact_coefficient(self, name: str) -> ca.SX:
        """Value of the parameter or method of this name, a bound of dry friction or a restitution; 0 for ``""``."""
        return ca.SX(call(self, name) if name else 0)

    @property
    def passive_constraints(self) -> tuple[constraint | non_holonomic, ...]:
        """Constraints without an operator: holonomic, then non-holonomic."""
        return (*self.constraints, *self.non_holonomic)

    @property
    def all_constraints(self) -> tuple[constraint | non_holonomic | rheonomic_constraint, ...]:
        """All constraints, in the order of their rows."""
        return (*self.passive_constraints, *self.rheonomic_constraints)

    @property
    def contact_formulas(self) -> tuple[ContactFormula, ...]:
        """Unilateral liaisons, then dry frictions, in the order of all columns of contacts."""
        return (*self.unilaterals, *self.dry_frictions)

    @classmethod
    def contact_names(cls) -> tuple[str, ...]:
        return tuple(item.name for item in (*cls.unilaterals, *cls.dry_frictions))

    def expression_of(self, item: Declaration) -> ca.SX:
        """Expression of a declaration, which may be an element of an array."""
        return ca.SX(getattr(self, item.name))

    def motion_names(self, kind: Literal["quaternion", "rates", "accelerations", "momenta"]) -> list[str]:
        """Names of one kind for all coordinates, then for all orientations.

        :param kind: ``"quaternion"`` means the coordinates themselves.
        """
        start, end = _AFFIXES[kind]
        return [
            *(start + suffixed_name(q.name, end) for q in self.coordinates),
            *(name for item in self.orientations for name in getattr(item, kind)),
        ]

    def layout(self) -> Layout:
        extents = (item.extent(type(self)) for item in declarations_of(type(self), Declaration))
        return self._layout_of_elements().with_arrays({extent.count: extent for extent in extents if extent})

    def claimed_names(self) -> list[tuple[str, str]]:
        # Before elements become arrays, which takes those of one name for one.
        layout = self._layout_of_elements()
        of_elements = ((*array_and_index(v.name), v.description) for v in (*layout.variables, *layout.dimensions))
        names = [(name, description) for name, index, description in of_elements if index in (None, (1,))]
        return names if self.contact_formulas else [*names, IMPACT_LOSS]

    def _layout_of_elements(self) -> Layout:
        """Layout in which arrays of a mechanism are written element by element."""
        unit_of = {item.name: item.unit for item in self.points}
        units_at = {name: unit_of[name.rpartition("_")[0]] for name in self.point_components()}
        internal = (state.name for state in self.internal_states)
        moving = (*self.motion_names("quaternion"), *self.motion_names("momenta"), *internal)
        return Layout(
            parameters=(*self._declared_parameters(), *self._start_parameters()),
            inputs=tuple(self._inputs(units_at)),
            outputs=(*self._motion_outputs(), *self._dynamics_outputs()),
            states=(
                *(State(name, suffixed_name(name, "_dot")) for name in moving),
                State("work", "power"),
                State("dissipated", "dissipation"),
            ),
            ports=(
                *(layout.port(q.name, q.unit, "free") for q in self.coordinates),
                *(layout.port(s.name, s.unit, "active", impulse=bool(self.contact_formulas)) for s in self.actives),
                *(layout.port(name, unit, "point") for name, unit in units_at.items()),
            ),
            active=tuple(ActiveInput(s.name, f"{s.name}_dot", f"{s.name}_ddot") for s in self.actives),
            dimensions=tuple(
                Dimension(size.name, self.sizes[size.name], size.description)
                for size in declarations_of(type(self), Size)
            ),
        )

    def _start_parameters(self) -> Iterator[Variable]:
        """Parameters for the start of the configuration, and of rates or momenta."""
        size = self.dimension
        for q in self.coordinates:
            text = f"{q.description}, at the start"
            yield replace(q.start_parameter(), description=text, start=q.leading or q.start, dimension=size)
            yield layout.start_parameter(
                suffixed_name(q.name, "_dot"), units.rate(q.unit), q.leading_rates or q.start_rate, size
            )
        for orientation in self.orientations:
            by_rate = orientation.start == "rate"
            names, unit = (orientation.rates, "rad/s") if by_rate else (orientation.momenta, "kg.m2/s")
            yield from (
                layout.start_parameter(name, "1", float(name == orientation.quaternion[0]))
                for name in orientation.quaternion
            )
            yield from (layout.start_parameter(name, unit, 0.0) for name in names)
        yield from (state.start_parameter() for state in self.internal_states)

    def _inputs(self, units_at: Mapping[str, str]) -> Iterator[Variable]:
        """Inputs: σ, σ̇ and σ̈ of active coordinates, drives and loads of free ones, loads at points.

        :param units_at: units of the components of points.
        """
        zeros, zero_sums = (partial(make, dimension=self.dimension) for make in (layout.zero, layout.zero_sum))
        together = "to be set with it, in model exchange too"
        for s in self.actives:
            speed = units.rate(s.unit)
            yield s.variable("input", "continuous")
            yield layout.zero(f"{s.name}_dot", speed, f"rate of {s.name}, {together}")
            yield layout.zero(f"{s.name}_ddot", units.rate(speed), f"acceleration of {s.name}, {together}")
            if self.contact_formulas:
                text = f"sum of the jumps of {s.name}_dot in reaction to impulses, {together}"
                yield layout.zero_sum(f"{s.name}_dot_jump", speed, text)
        for q in self.coordinates:
            unit, along = units.force(q.unit), f"along +{q.name}"
            text = f"generalised force on this mechanism {along} (K eq. 14)"
            yield zeros(suffixed_name(q.name, "_force"), unit, text)
            load = f"generalised force that this mechanism exerts {along} on what is attached to it"
            yield zeros(suffixed_name(q.name, "_load"), unit, load)
            text = f"sum of the impulses that this mechanism exerts {along} on what is attached to it"
            yield zero_sums(suffixed_name(q.name, "_impulse"), units.momentum(q.unit), text)
        for name, of in units_at.items():
            text = f"force that this mechanism exerts along +{name} on what is attached there"
            yield zeros(f"{name}_load", units.force(of), text)
            text = f"sum of the impulses that this mechanism exerts along +{name} on what is attached there"
            yield zero_sums(f"{name}_impulse", units.momentum(of), text)

    def _motion_outputs(self) -> Iterator[Variable]:
        """Outputs of coordinates, orientations and internal states, with momenta and rates."""
        size = self.dimension
        readable = partial(layout.readable, dimension=size)
        for q in self.coordinates:
            speed, momentum = units.rate(q.unit), f"p_{q.name}"
            rate, acceleration = (suffixed_name(q.name, end) for end in ("_dot", "_ddot"))
            yield readable(q.name, q.unit, q.description, symbol=q.symbol)
            yield readable(rate, speed, f"rate of {q.name}", derivative_of=q.name)
            yield readable(acceleration, units.rate(speed), f"acceleration of {q.name}")
            yield readable(momentum, units.momentum(q.unit), f"momentum conjugate to {q.name}")
            text = f"rate of {momentum}: all generalised forces along {q.name}"
            yield layout.local_rate(momentum, units.force(q.unit), text, size)
        for orientation in self.orientations:
            for name in orientation.quaternion:
                yield readable(name, "1", f"{orientation.description}: quaternion, scalar first")
                yield layout.local_rate(name, "1/s", f"rate of {name}")
            for name in orientation.rates:
                yield readable(name, "rad/s", f"{orientation.description}: angular velocity in the body frame")
                yield readable(f"{name}_dot", "rad/s2", f"rate of {name}")
            for name in orientation.momenta:
                yield readable(name, "kg.m2/s", f"{orientation.description}: angular momentum in the inertial frame")
                yield layout.local_rate(name, "N.m", f"rate of {name}: torque")
        for state in self.internal_states:
            yield from layout.internal_state_outputs(state)

    def _dynamics_outputs(self) -> Iterator[Variable]:
        """Outputs of constraints, operators, contacts, points and energies, and the declared ones."""
        readable, size = layout.readable, self.dimension
        for item in self.all_constraints:
            yield readable(f"{item.name}_residual", item.unit, f"what is not kept of: {item.description}")
        for item in self.passive_constraints:
            unit = units.force(item.unit) if isinstance(item, constraint) else units.multiplier_unit(item.unit)
            yield readable(f"lambda_{item.name}", unit, f"multiplier of: {item.description} (K eq. 7)")
        yield from self._operator_outputs()
        yield from self._contact_outputs()
        for item in self.points:
            for axis in components_of(self, item.name):
                name, speed = f"{item.name}_{axis}", units.rate(item.unit)
                yield readable(name, item.unit, f"{axis} of {item.description}", dimension=size)
                yield readable(f"{name}_dot", speed, f"rate of {name}", dimension=size)
                yield readable(f"{name}_ddot", units.rate(speed), f"acceleration of {name}", dimension=size)
        yield from self._energy_outputs()
        yield from (readable(item.name, item.unit, item.description) for item in self.outputs)
        for item in self.calculated_parameters:
            yield Variable(item.name, item.unit, item.description, "calculatedParameter", "fixed")

    def _operator_outputs(self) -> Iterator[Variable]:
        """Force and power of each operator, and how what it prescribes was taken."""
        readable = layout.readable
        for s in self.actives:
            text = f"generalised force of the operator on this mechanism along +{s.name} (M eq. 27)"
            yield readable(f"{s.name}_force", units.force(s.unit), text)
            yield readable(f"{s.name}_power", "W", f"power of the operator through {s.name} (M eq. 28)")
            text = (
                f"what {s.name} went in the last communication step beyond what {s.name}_dot and {s.name}_ddot say, "
                "where they contradict each other; else 0, as in model exchange and in hold mode"
            )
            yield Variable(f"{s.name}_mismatch", s.unit, text, "local", "discrete")
            text = (
                f"what the FMU derives from {s.name} at communication points, as it stays 0: 0 nothing, "
                f"1 {s.name}_ddot, 2 {s.name}_dot and {s.name}_ddot; in model exchange what is missing"
            )
            yield Variable(f"{s.name}_derived", "1", text, "local", "discrete")

    def _energy_outputs(self) -> Iterator[Variable]:
        """Energies, works and powers, and their balance."""
        readable = layout.readable
        yield readable("kinetic_energy", "J", "kinetic energy T (K eq. 12)")
        yield readable("potential_energy", "J", "potential energy V")
        yield readable("energy", "J", "energy T + V (K eq. 31)")
        yield readable("work", "J", "work done on this mechanism through all its ports since the start")
        text = "energy lost by friction, or taken out by non-holonomic constraints, since the start"
        yield readable("dissipated", "J", text)
        lost = ""
        if self.contact_formulas:
            lost = " + impact_loss"
            yield layout.event_output(IMPACT_LOSS[0], "J", IMPACT_LOSS[1])
        text = f"energy - energy at start - work + dissipated{lost}: 0 up to the integration error"
        yield readable("energy_balance", "J", text)
        yield readable("power", "W", "power through all ports", causality="local", derivative_of="work")
        text = "power lost by friction, the rates times the gradient of the dissipation function (K eq. 67)"
        yield readable("dissipation", "W", text, causality="local", derivative_of="dissipated")

    def _contact_outputs(self) -> Iterator[Variable]:
        """Outputs of unilateral liaisons and dry friction; in a chain, arrays over the links."""
        for item in self.contact_formulas:
            size = None if item.last else self.dimension
            yield from item.variables(
                *(partial(make, dimension=size) for make in (layout.readable, layout.event_output))
            )
        if self.contact_formulas:
            for s in self.actives:
                text = f"sum of the impulses of {s.name}_force at impacts"
                yield layout.event_output(f"{s.name}_impulse", units.momentum(s.unit), text)

    def check_contacts(
        self,
        formulas: Formulas,
        configuration: Mapping[str, ca.SX],
        motion: Mapping[str, ca.SX],
        free: tuple[ca.SX, ca.SX],
    ) -> None:
        """Raise a ComponentError for a unilateral liaison or dry friction that is declared wrongly.

        :param configuration: symbols that a gap may depend on, by name.
        :param motion: symbols that a slip may depend on.
        :param free: coordinates and their rates.
        """
        for item in self.contact_formulas:
            if item.last and self.dimension is None:
                item.refuse("has last=True, which is of a Chain; leave it out")
        for item in self.contact_formulas:
            item.check(self, formulas, configuration, motion, free)

    def _check_points(self, formulas: Formulas, configuration: Mapping[str, ca.SX]) -> None:
        if not (self.coordinates or self.orientations or (self.actives and self.dimension is None)):
            raise ComponentError(f"{type(self).__name__}: declare at least one Coordinate")
        require_units(type(self))
        for item in self.points:
            for axis, component in components_of(self, item.name).items():
                formulas.add(f"{item.name}[{axis!r}]", component, configuration, item.unit)
        shapes_of(self)
