"""Mechanisms that tests share, most with unilateral liaisons and dry friction that are taken to their limits."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache

import casadi as ca

from liaisons import (
    ActiveCoordinate,
    Coordinate,
    Gravity,
    Mechanism,
    Parameter,
    constraint,
    dry_friction,
    non_holonomic,
    unilateral,
)
from liaisons.language import Size, unchecked
from liaisons.models import BallRow

NUMBERS = "made of bare numbers, in SI units"


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
    """Ball above two tables, one in the other where they are at the same height; an operator moves the second one."""

    mass = Parameter(1.0, "kg", "mass", above=0)
    gravity = Gravity()
    height = Coordinate("m", "height of the ball", start=1.0)
    second = ActiveCoordinate("m", "height of the second table")

    def kinetic_energy(self) -> ca.SX:
        return self.mass / 2 * self.dot(self.height) ** 2

    def potential_energy(self) -> ca.SX:
        return self.mass * self.gravity * self.height

    @unilateral("m", "distance of ball and first table")
    def first_gap(self) -> ca.SX:
        return self.height

    @unilateral("m", "distance of ball and second table")
    def second_gap(self) -> ca.SX:
        return self.height - self.second


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


def table(legs: Sequence[tuple[float, float]]) -> type[Mechanism]:
    """Table of low height that tilts about two axes, on legs at these places in units of its size."""

    def leg(i: int, x: float, y: float) -> object:
        def height(self: Mechanism) -> ca.SX:
            return self.z + self.size * (x * ca.sin(self.pitch) + y * ca.sin(self.roll))

        height.__name__ = f"leg_{i}"
        return unilateral("m", f"height of leg {i}", restitution="bounce")(height)

    def kinetic_energy(self: Mechanism) -> ca.SX:
        turning = self.dot(self.pitch) ** 2 + self.dot(self.roll) ** 2
        return self.mass / 2 * self.dot(self.z) ** 2 + self.inertia / 2 * turning

    members = {
        "__doc__": "Table on legs.",
        "mass": Parameter(2.0, "kg", "mass", above=0),
        "inertia": Parameter(0.5, "kg.m2", "moment of inertia", above=0),
        "size": Parameter(1.0, "m", "size", above=0),
        "bounce": Parameter(0.0, "1", "coefficient of restitution", minimum=0, maximum=1),
        "gravity": Gravity(),
        "z": Coordinate("m", "height of the centre"),
        "pitch": Coordinate("rad", "angle about the first axis"),
        "roll": Coordinate("rad", "angle about the second axis"),
        **{f"leg_{i}": leg(i, *place) for i, place in enumerate(legs)},
        "kinetic_energy": kinetic_energy,
        "potential_energy": lambda self: self.mass * self.gravity * self.z,
    }
    return type(f"Table{len(legs)}", (Mechanism,), members)


Table = table([(-1.0, -0.8), (1.0, -0.8), (1.2, 0.9), (-0.9, 0.7)])
SquareTable = table([(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)])


FEET = (
    *((-1.0, -1.0), (1.0, -1.0), (-1.0, 1.0), (1.0, 1.0)),
    *((i * 0.7549 % 2 - 1, i * 1.1398 % 2 - 1) for i in range(60)),
)
"""Corners of a square, and points inside."""


class Plank(Mechanism):
    """Plank in a plane on feet in a row, of which the first two are at its ends."""

    n = Size(4, "number of feet")
    mass = Parameter(2.0, "kg", "mass", above=0)
    inertia = Parameter(0.5, "kg.m2", "moment of inertia", above=0)
    bounce = Parameter(0.5, "1", "coefficient of restitution", minimum=0, maximum=1)
    along = Parameter(tuple(x for x, _ in FEET), "m", "positions of the feet", size="n")
    gravity = Gravity()
    z = Coordinate("m", "height of the centre")
    pitch = Coordinate("rad", "angle with the horizontal")

    def kinetic_energy(self) -> ca.SX:
        return self.mass / 2 * self.dot(self.z) ** 2 + self.inertia / 2 * self.dot(self.pitch) ** 2

    def potential_energy(self) -> ca.SX:
        return self.mass * self.gravity * self.z

    @unilateral("m", "heights of the feet", restitution="bounce", size="n")
    def gap(self) -> ca.SX:
        return self.z + self.along * ca.sin(self.pitch)


class Plate(Plank):
    """Plate on feet, of which the first four are at its corners; it tilts about two axes."""

    across = Parameter(tuple(y for _, y in FEET), "m", "positions of the feet across", size="n")
    roll = Coordinate("rad", "angle with the horizontal across")

    def kinetic_energy(self) -> ca.SX:
        return super().kinetic_energy() + self.inertia / 2 * self.dot(self.roll) ** 2

    @unilateral("m", "heights of the feet", restitution="bounce", size="n")
    def gap(self) -> ca.SX:
        return self.z + self.along * ca.sin(self.pitch) + self.across * ca.sin(self.roll)


@cache
def on_feet(kind: type[Plank], feet: int) -> type[Plank]:
    """Plank or plate on so many feet."""
    return type(f"{kind.__name__}{feet}", (kind,), {"__doc__": kind.__doc__, "n": Size(feet, "number of feet")})


class Skid(Mechanism):
    """Body in a plane on two rough feet, which stick and slide together."""

    mass = Parameter(2.0, "kg", "mass", above=0)
    inertia = Parameter(0.5, "kg.m2", "moment of inertia", above=0)
    length = Parameter(1.0, "m", "distance of the front foot from below the centre", above=0)
    grip = Parameter(0.4, "1", "coefficient of static friction", minimum=0)
    drag = Parameter(0.4, "1", "coefficient of sliding friction", minimum=0)
    gravity = Gravity()
    x = Coordinate("m", "place of the centre")
    z = Coordinate("m", "height of the centre above that of rest")
    pitch = Coordinate("rad", "angle with the horizontal")

    def kinetic_energy(self) -> ca.SX:
        turning = self.inertia / 2 * self.dot(self.pitch) ** 2
        return self.mass / 2 * self.speed_squared({"x": self.x, "z": self.z}) + turning

    def potential_energy(self) -> ca.SX:
        return self.mass * self.gravity * self.z

    def foot(self, part: float) -> tuple[ca.SX, ca.SX]:
        """Place and height of a foot at this part of the length, and at half of it below the centre."""
        sine, cosine, half = ca.sin(self.pitch), ca.cos(self.pitch), self.length / 2
        return (
            self.x + part * self.length * cosine + half * sine,
            self.z + part * self.length * sine + half * (1 - cosine),
        )

    @unilateral("m", "height of the front foot")
    def front(self) -> ca.SX:
        return self.foot(1.0)[1]

    @unilateral("m", "height of the rear foot")
    def rear(self) -> ca.SX:
        return self.foot(-0.6)[1]

    @dry_friction("m/s", "sliding of the front foot", static="grip", sliding="drag", normal="front")
    def front_slip(self) -> ca.SX:
        return self.dot(self.foot(1.0)[0])

    @dry_friction("m/s", "sliding of the rear foot", static="grip", sliding="drag", normal="rear")
    def rear_slip(self) -> ca.SX:
        return self.dot(self.foot(-0.6)[0])


class Twelve(BallRow):
    """Twelve balls on a line."""

    n = Size(12, "number of balls")


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


class Bead(Mechanism):
    """A bead on a circle in a plane."""

    x = Coordinate("m", "in the plane", start=1.0)
    y = Coordinate("m", "out of the plane")
    z = Coordinate("m", "in the plane", start_rate=1.0)

    @constraint("m", "out of the plane")
    def plane(self) -> ca.SX:
        return self.y

    @constraint("m2", "circle", unchecked=NUMBERS)
    def circle(self) -> ca.SX:
        return self.x**2 + self.z**2 - 1

    @unchecked(NUMBERS)
    def kinetic_energy(self) -> ca.SX:
        return self.speed_squared({"x": self.x, "y": self.y, "z": self.z}) / 2

    @unchecked(NUMBERS)
    def potential_energy(self) -> ca.SX:
        return 9.81 * self.z + 2.0 * self.y


class TwiceHeldBead(Bead):
    """The same bead with the circle stated once more, as a sphere that cuts the plane."""

    @constraint("m2", "sphere", unchecked=NUMBERS)
    def sphere(self) -> ca.SX:
        return self.x**2 + self.y**2 + self.z**2 - 1
