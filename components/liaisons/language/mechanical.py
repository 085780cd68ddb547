"""Base of mechanisms and chains: coordinates, energies, friction, named points, and the FMU's variables."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from functools import partial
from typing import Literal

import casadi as ca

from liaisons.base import units
from liaisons.base.array_names import suffixed_name
from liaisons.errors import ComponentError
from liaisons.expressions.algebra import stack
from liaisons.language import layout
from liaisons.language.checks import Formulas, call, components_of, declared, require_units, shapes_of
from liaisons.language.component import Component, DeclarationsOf
from liaisons.language.declarations import (
    ActiveCoordinate,
    ContactFormula,
    Coordinate,
    Declaration,
    Orientation,
    Size,
    calculated,
    constraint,
    dry_friction,
    non_holonomic,
    output,
    point,
    rheonomic_constraint,
    unilateral,
)
from liaisons.language.layout import Layout
from liaisons.language.shapes import Ball, Shapes
from liaisons.language.variables import ActiveInput, Dimension, State, Variable

_AFFIXES = {"quaternion": ("", ""), "rates": ("", "_dot"), "accelerations": ("", "_ddot"), "momenta": ("p_", "")}


class _Actives(DeclarationsOf[ActiveCoordinate]):
    """The active coordinates, those of rheonomic constraints last."""

    def find(self, owner: type) -> tuple[ActiveCoordinate, ...]:
        return (*super().find(owner), *(item.active for item in declared(owner, rheonomic_constraint)))


class MechanicalComponent(Component, abstract=True):
    """A component described by its energies: a mechanism, or one link of a chain; abstract."""

    coordinates = DeclarationsOf(Coordinate)
    actives = _Actives(ActiveCoordinate)
    orientations = DeclarationsOf(Orientation)
    rheonomic_constraints = DeclarationsOf(rheonomic_constraint)
    constraints = DeclarationsOf(constraint)
    non_holonomic = DeclarationsOf(non_holonomic)
    unilaterals = DeclarationsOf(unilateral)
    dry_frictions = DeclarationsOf(dry_friction)
    points = DeclarationsOf(point)
    outputs = DeclarationsOf(output)
    calculated_parameters = DeclarationsOf(calculated)
    dimension: Dimension | None = None  # of the variables of links
    contact_forces: ca.SX  # of unilateral liaisons, then of dry friction
    sizes: dict[str, int]

    @abstractmethod
    def kinetic_energy(self) -> ca.SX:
        """T, quadratic in the rates (K eq. 12); usually by :meth:`speed_squared`."""

    def potential_energy(self) -> ca.SX:
        """V of the configuration; zero by default."""
        return ca.SX(0)

    def friction_coefficient(self) -> ca.SX:
        """η of K eq. 64, Q = −η ∂T/∂q̇: the declared Friction, zero without one."""
        return self._declared_friction

    def dissipation_function(self) -> ca.SX:
        """Rayleigh's D [W] of further friction, Q = −∂D/∂q̇; zero by default.

        That of a damper c at the relative velocity v is D = c v²/2.
        """
        return ca.SX(0)

    @abstractmethod
    def dot(self, expression: ca.SX) -> ca.SX:
        """Total time derivative of an expression of the configuration and its rates; of any shape."""

    def speed_squared(self, position: Mapping[str, ca.SX]) -> ca.SX:
        """``|ṙ|²`` of a point given by its Cartesian components."""
        return ca.SX(sum(self.dot(component) ** 2 for component in position.values()))

    def picture(self) -> Shapes:
        """Shapes between its points; of a chain those of the ``self.number``-th link."""
        return [Ball(getattr(self, item.name)) for item in self.points]

    def point_components(self) -> dict[str, ca.SX]:
        """Components of all named points, ``"bob_x"`` and so on."""
        components = ((item.name, components_of(self, item.name)) for item in self.points)
        return {f"{name}_{axis}": ca.SX(value) for name, axes in components for axis, value in axes.items()}

    def contact_rates(self) -> ca.SX:
        """Rates of the unilateral liaisons, then the relative velocities of dry friction; (c,)."""
        return stack(
            [*map(self.dot, map(self.expression_of, self.unilaterals)), *map(self.expression_of, self.dry_frictions)]
        )

    def threshold(self, name: str) -> ca.SX:
        """Value of a parameter or method that bounds dry friction, or of a restitution; that of "" is 0."""
        return ca.SX(call(self, name) if name else 0)

    @property
    def passive_constraints(self) -> tuple[constraint | non_holonomic, ...]:
        """Constraints that no operator moves."""
        return (*self.constraints, *self.non_holonomic)

    @property
    def all_constraints(self) -> tuple[constraint | non_holonomic | rheonomic_constraint, ...]:
        """All constraints, in the order of their rows."""
        return (*self.passive_constraints, *self.rheonomic_constraints)

    @property
    def contact_formulas(self) -> tuple[unilateral | dry_friction, ...]:
        """Unilateral liaisons, then dry friction: the order of all columns of contacts."""
        return (*self.unilaterals, *self.dry_frictions)

    def expression_of(self, item: Declaration) -> ca.SX:
        """Expression of a declaration, or of an element of an array."""
        return ca.SX(getattr(self, item.name))

    def motion_names(self, kind: Literal["quaternion", "rates", "accelerations", "momenta"]) -> list[str]:
        """Names of coordinates, their rates, accelerations or momenta, then those of an orientation."""
        start, end = _AFFIXES[kind]
        return [
            *(start + suffixed_name(q.name, end) for q in self.coordinates),
            *(name for item in self.orientations for name in getattr(item, kind)),
        ]

    def layout(self) -> Layout:
        unit_of = {item.name: item.unit for item in self.points}
        units_at = {name: unit_of[name.rpartition("_")[0]] for name in self.point_components()}
        internal = (state.name for state in self.internal_states)
        moving = (*self.motion_names("quaternion"), *self.motion_names("momenta"), *internal)
        extents = [extent for item in declared(type(self), Declaration) if (extent := item.extent(type(self)))]
        variables = Layout(
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
                Dimension(size.name, self.sizes[size.name], size.description) for size in declared(type(self), Size)
            ),
        )
        return variables.with_arrays({extent.count: extent for extent in extents}) if extents else variables

    def _start_parameters(self) -> Iterator[Variable]:
        """Start values of configuration, and rates or momenta."""
        size = self.dimension
        for q in self.coordinates:
            position = q.variable("parameter", "fixed", suffixed_name(q.name, "_0"))
            text = f"{q.description}, at the start"
            yield replace(position, description=text, start=q.leading or q.start, dimension=size)
            yield layout.start(suffixed_name(q.name, "_dot"), units.rate(q.unit), q.leading_rates or q.start_rate, size)
        for orientation in self.orientations:
            by_rate = orientation.start == "rate"
            names, unit = (orientation.rates, "rad/s") if by_rate else (orientation.momenta, "kg.m2/s")
            yield from (
                layout.start(name, "1", float(name == orientation.quaternion[0])) for name in orientation.quaternion
            )
            yield from (layout.start(name, unit, 0.0) for name in names)
        yield from map(layout.start_of_internal, self.internal_states)

    def _inputs(self, units_at: Mapping[str, str]) -> Iterator[Variable]:
        """σ, σ̇ and σ̈ of active coordinates; drives and loads of free ones; loads at points, by their units."""
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
        """Coordinates, orientations, internal states, their momenta and rates."""
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
            yield layout.rate(momentum, units.force(q.unit), text, size)
        for orientation in self.orientations:
            for name in orientation.quaternion:
                yield readable(name, "1", f"{orientation.description}: quaternion, scalar first")
                yield layout.rate(name, "1/s", f"rate of {name}")
            for name in orientation.rates:
                yield readable(name, "rad/s", f"{orientation.description}: angular velocity in the body frame")
                yield readable(f"{name}_dot", "rad/s2", f"rate of {name}")
            for name in orientation.momenta:
                yield readable(name, "kg.m2/s", f"{orientation.description}: angular momentum in the inertial frame")
                yield layout.rate(name, "N.m", f"rate of {name}: torque")
        for state in self.internal_states:
            yield from layout.of_internal(state)

    def _dynamics_outputs(self) -> Iterator[Variable]:
        """Constraints, operators, points, energies, and what is declared beside them."""
        readable, size = layout.readable, self.dimension
        for item in self.all_constraints:
            yield readable(f"{item.name}_residual", item.unit, f"what is not kept of: {item.description}")
        for item in self.passive_constraints:
            unit = units.force(item.unit) if isinstance(item, constraint) else units.multiplier_unit(item.unit)
            yield readable(f"lambda_{item.name}", unit, f"multiplier of: {item.description} (K eq. 7)")
        for s in self.actives:
            text = f"generalised force of the operator on this mechanism along +{s.name} (M eq. 27)"
            yield readable(f"{s.name}_force", units.force(s.unit), text)
            yield readable(f"{s.name}_power", "W", f"power of the operator through {s.name} (M eq. 28)")
            text = (
                f"what {s.name} went in the last communication step beyond what {s.name}_dot and {s.name}_ddot say, "
                "where they contradict each other; else 0, as in model exchange and in hold mode"
            )
            yield Variable(f"{s.name}_mismatch", s.unit, text, "local", "discrete")
        yield from self._contact_outputs()
        for item in self.points:
            for axis in components_of(self, item.name):
                name, speed = f"{item.name}_{axis}", units.rate(item.unit)
                yield readable(name, item.unit, f"{axis} of {item.description}", dimension=size)
                yield readable(f"{name}_dot", speed, f"rate of {name}", dimension=size)
                yield readable(f"{name}_ddot", units.rate(speed), f"acceleration of {name}", dimension=size)
        yield readable("kinetic_energy", "J", "kinetic energy T (K eq. 12)")
        yield readable("potential_energy", "J", "potential energy V")
        yield readable("energy", "J", "energy T + V (K eq. 31)")
        yield readable("work", "J", "work done on this mechanism through all its ports since the start")
        text = "energy lost by friction, or taken out by non-holonomic constraints, since the start"
        yield readable("dissipated", "J", text)
        lost = ""
        if self.contact_formulas:
            lost = " + impact_loss"
            yield layout.event_output("impact_loss", "J", "energy lost by impacts since the start")
        text = f"energy - energy at start - work + dissipated{lost}: 0 up to the integration error"
        yield readable("energy_balance", "J", text)
        yield readable("power", "W", "power through all ports", causality="local", derivative_of="work")
        text = "power lost by friction, the rates times the gradient of the dissipation function (K eq. 67)"
        yield readable("dissipation", "W", text, causality="local", derivative_of="dissipated")
        yield from (readable(item.name, item.unit, item.description) for item in self.outputs)
        for item in self.calculated_parameters:
            yield Variable(item.name, item.unit, item.description, "calculatedParameter", "fixed")

    def _contact_outputs(self) -> Iterator[Variable]:
        """Unilateral liaisons and dry friction (DESIGN of names: docs/reference/fmu.md)."""
        for item in self.unilaterals:
            readable, at_events = self._of_contact(item)
            name, of, momentum = item.name, partial(suffixed_name, item.name), units.momentum(item.unit)
            yield readable(name, item.unit, item.description)
            yield readable(of("_dot"), units.rate(item.unit), f"rate of {name}")
            yield readable(of("_force"), units.force(item.unit), f"force that upholds {name} >= 0")
            yield at_events(of("_impulse"), momentum, f"sum of the impulses of impacts at {name}")
            yield at_events(of("_closed"), "1", f"whether {name} rests at 0", type="Boolean")
            text = f"how many impacts {name} has had, after falls from more than a millionth of its size"
            yield at_events(of("_impacts"), "1", text, type="Integer")
            yield at_events(of("_rests_from"), "s", f"when the bounces of {name} end, or have ended", causality="local")
            yield readable(of("_indicator"), "1", f"event indicator of {name}", causality="local")
        for item in self.dry_frictions:
            readable, at_events = self._of_contact(item)
            name, of = item.name, partial(suffixed_name, item.name)
            yield readable(name, item.unit, item.description)
            yield readable(of("_force"), units.multiplier_unit(item.unit), f"force of dry friction along +{name}")
            yield at_events(of("_sticks"), "1", f"whether {name} is held at 0 by friction", type="Boolean")
            yield at_events(of("_direction"), "1", f"sign of {name} while it slides, else 0", causality="local")
            yield readable(of("_indicator"), "1", f"event indicator of {name}", causality="local")
        if self.contact_formulas:
            for s in self.actives:
                text = f"sum of the impulses of {s.name}_force at impacts"
                yield layout.event_output(f"{s.name}_impulse", units.momentum(s.unit), text)

    def _of_contact(self, item: ContactFormula) -> tuple[Callable[..., Variable], Callable[..., Variable]]:
        """Functions that make continuous and discrete outputs of a contact, in a chain arrays of its links."""
        size = None if item.last else self.dimension
        return partial(layout.readable, dimension=size), partial(layout.event_output, dimension=size)

    def _check_points(self, formulas: Formulas, configuration: Mapping[str, ca.SX]) -> None:
        if not (self.coordinates or self.orientations or (self.actives and self.dimension is None)):
            raise ComponentError(f"{type(self).__name__}: declare at least one Coordinate")
        require_units(type(self))
        for item in self.points:
            for axis, component in components_of(self, item.name).items():
                formulas.take(f"{item.name}[{axis!r}]", component, configuration, item.unit)
        shapes_of(self)
