"""What mechanisms and chains have in common: coordinates, energies, friction, named points, and the FMU's variables."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Iterable, Mapping
from dataclasses import replace

import casadi as ca

from liaisons import units
from liaisons.errors import ComponentError
from liaisons.language import layout
from liaisons.language.checks import Formulas, components_of, declared, require_units
from liaisons.language.component import Component, Every
from liaisons.language.declarations import (
    ActiveCoordinate,
    Coordinate,
    InternalState,
    Orientation,
    calculated,
    constraint,
    non_holonomic,
    output,
    point,
    submersion,
)
from liaisons.language.layout import Layout
from liaisons.language.shapes import Ball, Shapes
from liaisons.language.variables import ActiveInput, Dimension, Variable


class _Actives(Every[ActiveCoordinate]):
    """The active coordinates, those that belong to submersions last."""

    def find(self, owner: type) -> tuple[ActiveCoordinate, ...]:
        return (*super().find(owner), *(item.active for item in declared(owner, submersion)))


class MechanicalComponent(Component, abstract=True):
    """What is described by its energies: a mechanism, or one link of a chain; abstract."""

    coordinates = Every(Coordinate)
    actives = _Actives(ActiveCoordinate)
    orientations = Every(Orientation)
    internal_states = Every(InternalState)
    submersions = Every(submersion)
    constraints = Every(constraint)
    non_holonomic = Every(non_holonomic)
    points = Every(point)
    outputs = Every(output)
    calculated_parameters = Every(calculated)
    dimension: Dimension | None = None  # of what there is one of at each link

    @abstractmethod
    def kinetic_energy(self) -> ca.SX:
        """T, quadratic in the rates (K eq. 12); usually by :meth:`speed_squared`."""

    def potential_energy(self) -> ca.SX:
        """V of the configuration; zero unless the component says otherwise."""
        return ca.SX(0)

    def friction_coefficient(self) -> ca.SX:
        """η of K eq. 64, Q = −η ∂T/∂q̇: the declared Friction, zero without one."""
        return self._declared_friction

    def dissipation_function(self) -> ca.SX:
        """Rayleigh's D [W] of further friction, Q = −∂D/∂q̇; zero unless the component says otherwise.

        A damper c between two parts, with the rate v of one relative to the other: D = c v²/2.
        """
        return ca.SX(0)

    @abstractmethod
    def dot(self, expression: ca.SX) -> ca.SX:
        """Total time derivative of an expression of the configuration and its rates; of any shape."""

    def speed_squared(self, position: Mapping[str, ca.SX]) -> ca.SX:
        """``|ṙ|²`` of a point given by its Cartesian components."""
        return ca.SX(sum(self.dot(component) ** 2 for component in position.values()))

    def picture(self) -> Shapes:
        """What it looks like: shapes between its points; of a chain one link, the ``self.number``-th."""
        return [Ball(getattr(self, item.name)) for item in self.points]

    def point_components(self) -> dict[str, ca.SX]:
        """Components of all named points, ``"bob_x"`` and so on."""
        found = ((item.name, components_of(self, item.name)) for item in self.points)
        return {f"{name}_{axis}": ca.SX(value) for name, axes in found for axis, value in axes.items()}

    def layout(self) -> Layout:
        place_of = {item.name: item for item in self.points}
        places = {name: place_of[name.rpartition("_")[0]] for name in self.point_components()}
        turns, internal = self.orientations, [state.name for state in self.internal_states]
        passive = (*self.constraints, *self.non_holonomic)
        return Layout(
            parameters=(
                *self._declared_parameters(),
                *self._sized(v for q in self.coordinates for v in layout.start_of(q)),
                *(v for turn in turns for v in layout.start_of_turn(turn)),
                *map(layout.start_of_internal, self.internal_states),
            ),
            inputs=(
                *(v for s in self.actives for v in layout.triple(s)),
                *self._sized(v for q in self.coordinates for v in layout.forces_on(q)),
                *self._sized(layout.load_at(name, place) for name, place in places.items()),
            ),
            outputs=(
                *self._sized(v for q in self.coordinates for v in layout.of_coordinate(q)),
                *(v for turn in turns for v in layout.of_turn(turn)),
                *(v for state in self.internal_states for v in layout.of_internal(state)),
                *map(layout.residual, (*passive, *self.submersions)),
                *(layout.multiplier(item, units.force(item.unit)) for item in self.constraints),
                *(layout.multiplier(item, units.multiplier(item.unit)) for item in self.non_holonomic),
                *(v for s in self.actives for v in layout.of_active(s)),
                *self._sized(v for name, place in places.items() for v in layout.of_point(name, place)),
                *layout.of_energies(),
                *(layout.readable(item.name, item.unit, item.description) for item in self.outputs),
                *map(layout.of_calculated, self.calculated_parameters),
            ),
            states=layout.moving(
                [
                    *(q.name for q in self.coordinates),
                    *(name for turn in turns for name in turn.quaternion),
                    *(f"p_{q.name}" for q in self.coordinates),
                    *(name for turn in turns for name in turn.momenta),
                    *internal,
                ]
            ),
            ports=(
                *(layout.port(q.name, q.unit, "free") for q in self.coordinates),
                *(layout.port(s.name, s.unit, "active") for s in self.actives),
                *(layout.port(name, place.unit, "point") for name, place in places.items()),
            ),
            active=tuple(ActiveInput(s.name, f"{s.name}_dot", f"{s.name}_ddot") for s in self.actives),
            dimensions=() if self.dimension is None else (self.dimension,),
        )

    def _sized(self, variables: Iterable[Variable]) -> Iterable[Variable]:
        return (replace(variable, dimension=self.dimension) for variable in variables)

    def _check_points(self, formulas: Formulas, configuration: Mapping[str, ca.SX]) -> None:
        if not self.coordinates and not self.orientations:
            raise ComponentError(f"{type(self).__name__}: declare at least one Coordinate that moves freely")
        require_units(type(self))
        for item in self.points:
            for axis, component in components_of(self, item.name).items():
                formulas.take(f"{item.name}[{axis!r}]", component, configuration, item.unit)
