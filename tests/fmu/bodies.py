"""Mechanisms that tests share, most with unilateral liaisons and dry friction that are taken to their limits."""

from __future__ import annotations

import casadi as ca

from liaisons import (
    ActiveCoordinate,
    Coordinate,
    Gravity,
    Mechanism,
    Parameter,
    dry_friction,
    non_holonomic,
    unilateral,
)


class Sledge(Mechanism):
    """Body on a belt that moves up and along, with Coulomb's friction."""

    mass = Parameter(1.0, "kg", "mass", above=0)
    bounce = Parameter(0.5, "1", "coefficient of restitution", minimum=0, maximum=1)
    grip = Parameter(0.4, "1", "coefficient of static friction", minimum=0)
    drag = Parameter(0.3, "1", "coefficient of sliding friction", minimum=0)
    gravity = Gravity()
    x = Coordinate("m", "place of the body")
    z = Coordinate("m", "height of the body")
    table = ActiveCoordinate("m", "height of the belt")
    belt = ActiveCoordinate("m", "way of the belt")

    def kinetic_energy(self) -> ca.SX:
        return self.mass / 2 * self.speed_squared({"x": self.x, "z": self.z})

    def potential_energy(self) -> ca.SX:
        return self.mass * self.gravity * self.z

    @unilateral("m", "distance of body and belt", restitution="bounce")
    def gap(self) -> ca.SX:
        return self.z - self.table

    @dry_friction("m/s", "sliding of the body on the belt", static="grip", sliding="drag", normal="gap")
    def slip(self) -> ca.SX:
        return self.dot(self.x) - self.dot(self.belt)


class Block(Mechanism):
    """Body at a spring, on a belt, with thresholds of its friction that are forces."""

    mass = Parameter(1.0, "kg", "mass", above=0)
    stiffness = Parameter(10.0, "N/m", "stiffness", above=0)
    grip = Parameter(2.0, "N", "threshold of sticking", minimum=0)
    drag = Parameter(1.0, "N", "force of sliding", minimum=0)
    x = Coordinate("m", "extension of the spring", start=1.0)
    belt = ActiveCoordinate("m", "way of the belt")

    def kinetic_energy(self) -> ca.SX:
        return self.mass / 2 * self.dot(self.x) ** 2

    def potential_energy(self) -> ca.SX:
        return self.stiffness / 2 * self.x**2

    @dry_friction("m/s", "sliding of the body on the belt", static="grip", sliding="drag")
    def slip(self) -> ca.SX:
        return self.dot(self.x) - self.dot(self.belt)


class Rod(Mechanism):
    """Rod that falls on a floor which rises and moves sideways; its left tip is rough."""

    mass = Parameter(1.0, "kg", "mass", above=0)
    length = Parameter(2.0, "m", "length", above=0)
    bounce = Parameter(0.5, "1", "coefficient of restitution", minimum=0, maximum=1)
    grip = Parameter(0.0, "1", "coefficient of static friction of the left tip", minimum=0)
    drag = Parameter(0.0, "1", "coefficient of its sliding friction", minimum=0)
    gravity = Gravity()
    x = Coordinate("m", "place of the centre")
    z = Coordinate("m", "height of the centre", start=2.0)
    angle = Coordinate("rad", "angle with the horizontal")
    belt = ActiveCoordinate("m", "way of the floor sideways")
    floor = ActiveCoordinate("m", "height of the floor")

    def kinetic_energy(self) -> ca.SX:
        turning = self.mass * self.length**2 / 24 * self.dot(self.angle) ** 2
        return self.mass / 2 * self.speed_squared({"x": self.x, "z": self.z}) + turning

    def potential_energy(self) -> ca.SX:
        return self.mass * self.gravity * self.z

    @unilateral("m", "height of the left tip", restitution="bounce")
    def left(self) -> ca.SX:
        return self.z - self.length / 2 * ca.sin(self.angle) - self.floor

    @unilateral("m", "height of the right tip", restitution="bounce")
    def right(self) -> ca.SX:
        return self.z + self.length / 2 * ca.sin(self.angle) - self.floor

    @dry_friction("m/s", "sliding of the left tip", static="grip", sliding="drag", normal="left")
    def slip(self) -> ca.SX:
        return self.dot(self.x - self.length / 2 * ca.cos(self.angle) - self.belt)


class Press(Mechanism):
    """Ball between a floor that does not move and a press that an operator moves."""

    mass = Parameter(1.0, "kg", "mass", above=0)
    bounce = Parameter(0.5, "1", "coefficient of restitution", minimum=0, maximum=1)
    height = Coordinate("m", "height of the ball", start=0.5)
    press = ActiveCoordinate("m", "height of the press", start=1.0)

    def kinetic_energy(self) -> ca.SX:
        return self.mass / 2 * self.dot(self.height) ** 2

    @unilateral("m", "distance of ball and floor", restitution="bounce")
    def floor_gap(self) -> ca.SX:
        return self.height

    @unilateral("m", "distance of ball and press", restitution="bounce")
    def press_gap(self) -> ca.SX:
        return self.press - self.height


class TwoFloors(Mechanism):
    """Ball above two tables, one in the other where they are at the same height."""

    mass = Parameter(1.0, "kg", "mass", above=0)
    gravity = Gravity()
    height = Coordinate("m", "height of the ball", start=1.0)
    depth = Parameter(0.0, "m", "depth of the second table", minimum=0)

    def kinetic_energy(self) -> ca.SX:
        return self.mass / 2 * self.dot(self.height) ** 2

    def potential_energy(self) -> ca.SX:
        return self.mass * self.gravity * self.height

    @unilateral("m", "distance of ball and first table")
    def first_gap(self) -> ca.SX:
        return self.height

    @unilateral("m", "distance of ball and second table")
    def second_gap(self) -> ca.SX:
        return self.height + self.depth


class Flat(Mechanism):
    """Particle above a gap that is flat where it ends: no force along it moves a mass there."""

    mass = Parameter(1.0, "kg", "mass", above=0)
    x = Coordinate("m", "place", start=1.0, start_rate=-1.0)

    def kinetic_energy(self) -> ca.SX:
        return self.mass / 2 * self.dot(self.x) ** 2

    @unilateral("m3", "cube of the distance")
    def cube(self) -> ca.SX:
        return self.x**3


def _balls(count: int) -> type[Mechanism]:
    """Balls that fall on one table side by side."""

    def gap(i: int) -> object:
        def distance(self: Mechanism) -> ca.SX:
            return getattr(self, f"z_{i}") - self.table

        distance.__name__ = f"gap_{i}"
        return unilateral("m", f"distance of ball {i} and table")(distance)

    def kinetic_energy(self: Mechanism) -> ca.SX:
        return sum((self.mass / 2 * self.dot(getattr(self, f"z_{i}")) ** 2 for i in range(count)), ca.SX(0))

    def potential_energy(self: Mechanism) -> ca.SX:
        return sum((self.mass * self.gravity * getattr(self, f"z_{i}") for i in range(count)), ca.SX(0))

    members = {
        "__doc__": "Balls that fall on one table.",
        "mass": Parameter(1.0, "kg", "mass", above=0),
        "gravity": Gravity(),
        "table": ActiveCoordinate("m", "height of the table"),
        **{f"z_{i}": Coordinate("m", f"height of ball {i}", start=1.0) for i in range(count)},
        **{f"gap_{i}": gap(i) for i in range(count)},
        "kinetic_energy": kinetic_energy,
        "potential_energy": potential_energy,
    }
    return type(f"Balls{count}", (Mechanism,), members)


Nine = _balls(9)


class Skate(Mechanism):
    """Knife edge on a slope that falls towards +x."""

    mass = Parameter(0.7, "kg", "mass", above=0)
    inertia = Parameter(0.3, "kg.m2", "moment of inertia", above=0)
    gravity = Parameter(2.0, "m/s2", "gravity along the slope")
    x = Coordinate("m", "down the slope")
    y = Coordinate("m", "along the slope")
    angle = Coordinate("rad", "direction of the edge from x", start_rate=1.5)

    @non_holonomic("m/s", "speed across the edge")
    def edge(self) -> ca.SX:
        return -self.dot(self.x) * ca.sin(self.angle) + self.dot(self.y) * ca.cos(self.angle)

    def kinetic_energy(self) -> ca.SX:
        return (
            self.mass / 2 * self.speed_squared({"x": self.x, "y": self.y})
            + self.inertia / 2 * self.dot(self.angle) ** 2
        )

    def potential_energy(self) -> ca.SX:
        return -self.mass * self.gravity * self.x
