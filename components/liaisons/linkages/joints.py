"""Bodies, the joints between them, and springs: what a linkage declares."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from math import isfinite, pi
from typing import Any, Literal, TypeAlias

import casadi as ca
import numpy as np

from liaisons.contacts import dry_friction, unilateral
from liaisons.language import (
    ActiveCoordinate,
    Coordinate,
    Declaration,
    Orientation,
    Parameter,
    point,
)

Vector: TypeAlias = Sequence[float]
"""Three numbers."""

NamedDeclarations: TypeAlias = Iterator[tuple[str, Declaration]]
"""What a body or joint declares, by name."""

MOMENTS = ("xx", "yy", "zz", "xy", "xz", "yz")
"""Elements of a tensor of inertia, in their order in a declaration."""

_AXES = {"x": (1.0, 0.0, 0.0), "y": (0.0, 1.0, 0.0), "z": (0.0, 0.0, 1.0)}
_UNITS = {"stiffness": "N/m", "damping": "N.s/m", "friction": "N", "armature": "kg"}
_TURNING = {"stiffness": "N.m/rad", "damping": "N.m.s/rad", "friction": "N.m", "armature": "kg.m2"}
_ZERO = (0.0, 0.0, 0.0)


@dataclass(frozen=True, eq=False)
class Frame:
    """A frame that one coordinate, or the orientation of a spherical joint, moves against its parent."""

    name: str  # of its coordinate
    joint: Any  # a BodyJoint
    body: Any  # a Body; None: a massless body inside a joint
    parent: int  # its number; -1: ground
    rotation: ca.SX  # rotation matrix, frame to parent (3, 3)
    position: ca.SX  # of its origin, in the parent (3, 1)
    axes: ca.SX  # S, constant in the frame: v = X v_parent + S q̇ (6, k)
    prescribed: bool
    rows: list[int]  # of its coordinates among the free velocities, or the active coordinates
    armature: ca.SX  # inertia against these rates alone (k, k)


@dataclass(frozen=True, eq=False)
class BodyFrame:
    """Symbols of a body's frame in an instance."""

    matrix: ca.SX  # rotation matrix, body to inertial frame (3, 3)
    origin: ca.SX  # (3, 1)
    spin: ca.SX  # angular velocity in the body frame (3, 1)
    velocity: ca.SX  # of the origin, in the body frame (3, 1)

    def position(self, at: Sequence[Any] | ca.SX = _ZERO) -> ca.SX:
        """Inertial coordinates of a point of the body [m], (3, 1)."""
        return self.origin + self.matrix @ column(at)

    def velocity_of(self, at: Sequence[Any] | ca.SX = _ZERO) -> ca.SX:
        """Velocity of a point of the body along the inertial axes [m/s], (3, 1)."""
        return self.matrix @ (self.velocity + skew(self.spin) @ column(at))


class Body(Declaration[BodyFrame]):
    """A rigid body, whose frame lies at its joint; on an instance ``self.body`` has the frame's symbols.

    Numbers that are not 0 are parameters of the FMU: ``B_mass``, ``B_inertia_xx``, ``B_centre_x``, ...

    :param mass: [kg]; 0 of a body that only connects joints.
    :param inertia: tensor about the centre of mass [kg.m2]: one number, the diagonal, or xx, yy, zz, xy, xz, yz.
    :param centre: centre of mass in the body's frame [m].
    """

    example = "Body(mass=2.0, inertia=(0.1, 0.1, 0.02), centre=(0, 0, 0.5))"

    def __init__(self, mass: float = 0.0, inertia: float | Vector = 0.0, centre: Vector = _ZERO) -> None:
        super().__init__("kg", "body")
        self.mass, self.inertia, self.centre = mass, inertia, centre

    def value_in(self, instance: Any) -> BodyFrame:
        return instance.frame_of(self)

    def declarations(self) -> NamedDeclarations:
        """Parameters of the mass, the inertia and the centre of mass."""
        (mass,) = finite_numbers(self, "mass", [self.mass], 1)
        moments = self.inertia if isinstance(self.inertia, Sequence) else [self.inertia] * 3
        inertia = finite_numbers(self, "inertia", moments, 3, 6)
        tensor = np.zeros((3, 3))
        for name, value in zip(MOMENTS, inertia, strict=False):
            i, j = ("xyz".index(axis) for axis in name)
            tensor[i, j] = tensor[j, i] = value
        principal = np.linalg.eigvalsh(tensor)
        if mass < 0:
            self.refuse(f"mass = {mass:g}: it must be >= 0")
        if principal[0] < -1e-12 * principal[2]:
            self.refuse(f"inertia = {self.inertia}: its principal moments are {principal}; they must be >= 0")
        if principal[2] > (principal[0] + principal[1]) * (1 + 1e-9):
            why = f"of its principal moments {principal} one exceeds the sum of the others"
            self.refuse(f"inertia = {self.inertia}: {why}")
        if mass == 0 and any(finite_numbers(self, "centre", self.centre, 3)):
            self.refuse(f"centre = {self.centre}: a body without mass has none; give its mass")
        name = self.name
        yield from nonzero_parameters(f"{name}_mass", [""], [mass], "kg", f"mass of {name}", above=0)
        text, endings = f"moment of inertia of {name} about its centre of mass", [f"_{moment}" for moment in MOMENTS]
        yield from nonzero_parameters(f"{name}_inertia", endings[:3], inertia[:3], "kg.m2", text, above=0)
        yield from nonzero_parameters(f"{name}_inertia", endings[3:], inertia[3:], "kg.m2", text)
        yield from position_parameters(self, "centre", self.centre, f"{name}_centre", f"centre of mass of {name}")


ground = Body()
"""The inertial frame, to which joints attach bodies."""
ground.name = "ground"


class BodyJoint(Declaration[ca.SX]):
    """A joint between two bodies; abstract.

    The frame of the joint lies at ``at`` in the first body's frame, turned by ``rotation``; the second body's frame
    coincides with it while the coordinates are 0.  A second joint of a body closes a loop: it becomes constraints, and
    ``at_child``, ``rotation_child`` say where it lies in that body.  Numbers that are not 0 are parameters of the FMU.

    :param at: [m].
    :param rotation: roll, pitch and yaw [rad]: about x, then the fixed y, then the fixed z.
    :param axis: of the joint, in its frame: ``"x"``, ``"y"``, ``"z"``, ``"-x"``, ..., or a vector.
    :param prescribed: whether an operator prescribes the coordinates; or which, by their endings, ``("angle",)``.
    :param start: start value; of several coordinates a tuple.
    :param start_rate: likewise.
    :param limits: lowest and highest value: unilateral liaisons, or the domain of a prescribed coordinate.
    :param restitution: of the impacts at the limits.
    :param stiffness: [N/m, N.m/rad].
    :param unstressed: value of the coordinate at which the spring has no force [m, rad].
    :param damping: [N.s/m, N.m.s/rad].
    :param friction: of dry friction [N, N.m].
    :param armature: inertia of what turns or shifts with the coordinate alone, as a rotor does [kg, kg.m2].
    :param reference: value of the coordinate at which both frames coincide, instead of 0.
    """

    example = "Revolute(ground, crank, axis='y', at=(0, 0, 1))"
    motions: tuple[tuple[str, Literal["shift", "turn", "ball"], str], ...] = ()  # ending, kind, axis ("": as declared)

    def __init__(
        self,
        parent: Body,
        child: Body,
        *,
        axis: str | Vector = "z",
        at: Vector = _ZERO,
        rotation: Vector = _ZERO,
        at_child: Vector = _ZERO,
        rotation_child: Vector = _ZERO,
        prescribed: bool | tuple[str, ...] = False,
        start: float | tuple[float, ...] = 0.0,
        start_rate: float | tuple[float, ...] = 0.0,
        limits: tuple[float, float] | None = None,
        restitution: float = 0.0,
        stiffness: float = 0.0,
        damping: float = 0.0,
        friction: float = 0.0,
        armature: float = 0.0,
        reference: float = 0.0,
        unstressed: float = 0.0,
    ) -> None:
        super().__init__("1", "joint")
        self.parent, self.child, self.axis = parent, child, axis
        endings = tuple(ending.removeprefix("_") for ending, _, _ in self.motions)
        self.prescribed = endings if prescribed is True else prescribed or ()
        self.at, self.rotation, self.at_child, self.rotation_child = at, rotation, at_child, rotation_child
        self.start, self.start_rate, self.limits, self.restitution = start, start_rate, limits, restitution
        self.stiffness, self.damping, self.friction, self.armature = stiffness, damping, friction, armature
        self.reference, self.unstressed = reference, unstressed

    @property
    def bodies(self) -> tuple[Any, ...]:
        """The two bodies."""
        return self.parent, self.child

    def value_in(self, instance: Any) -> ca.SX:
        """Column of the coordinates."""
        return ca.vertcat(*(instance.symbols[f"{self.name}{end}"] for end, kind, _ in self.motions if kind != "ball"))

    def is_prescribed(self, ending: str) -> bool:
        """Whether an operator prescribes the coordinate whose name has this ending."""
        return ending.removeprefix("_") in self.prescribed

    def declarations(self, closes: bool) -> NamedDeclarations:
        """Parameters of the joint's position, and, unless it closes a loop, its coordinates with limits and laws."""
        if not np.all(np.isfinite(unit_vector(self.axis))):
            self.refuse(f"axis = {self.axis!r}: it is 'x', 'y', 'z', or a vector of three numbers that are not all 0")
        for argument in ("rotation", "rotation_child"):
            finite_numbers(self, argument, getattr(self, argument), 3)
        text = f"place of {self.name} in "
        yield from position_parameters(self, "at", self.at, f"{self.name}_at", text + self.parent.name)
        in_child = [
            *position_parameters(self, "at_child", self.at_child, f"{self.name}_at_child", text + self.child.name)
        ]
        if not closes and (in_child or any(self.rotation_child)):
            self.refuse(f"at_child is for a joint that closes a loop; this one lies at the origin of {self.child.name}")
        yield from in_child if closes else self._motion_declarations()

    def _motion_declarations(self) -> NamedDeclarations:
        """Coordinates of the motions, with the parameters and contacts that act on them."""
        endings = tuple(ending.removeprefix("_") for ending, kind, _ in self.motions if kind != "ball")
        if self.prescribed and len(endings) < len(self.motions):
            self.refuse("an orientation cannot be prescribed: three Revolute joints with massless bodies between can")
        for ending in set(self.prescribed).difference(endings):
            self.refuse(f"prescribed = {self.prescribed}: {ending!r} is not one of its coordinates {endings}")
        if self.friction and all(map(self.is_prescribed, endings)):
            self.refuse("friction is against a free coordinate, and all of this joint are prescribed")
        starts, rates = (
            finite_numbers(self, name, [x] * len(endings) if isinstance(x, (int, float)) else x, len(endings))
            for name, x in (("start", self.start), ("start_rate", self.start_rate))
        )
        low, high = self._checked_limits() if self.limits is not None else (None, None)
        yield from self._law_parameters()
        for i, (ending, kind, _) in enumerate(self.motions):
            text = f"{'orientation' if kind == 'ball' else kind} of {self.child.name} against {self.parent.name}"
            unit, name = "m" if kind == "shift" else "rad", f"{self.name}{ending}"
            if kind == "ball":
                yield name, Orientation(text, prefix=f"{name}_")
            elif self.is_prescribed(ending):
                yield name, ActiveCoordinate(unit, text, start=starts[i], minimum=low, maximum=high)
            else:
                yield name, Coordinate(unit, text, start=starts[i], start_rate=rates[i])
                if low is not None and high is not None:
                    yield from _stop_declarations(name, unit, low, high, self.restitution)
                if self.friction:
                    slip = dry_friction(f"{unit}/s", f"slip of {name}", static=f"{self.name}_friction")
                    yield f"{name}_slip", slip(partial(_rate_of, name=name))

    def _checked_limits(self) -> list[float]:
        """Lowest and highest value of the one coordinate."""
        limits = finite_numbers(self, "limits", self.limits, 2)
        if len(self.motions) != 1 or self.motions[0][1] == "ball":
            self.refuse(f"limits = {self.limits}: only for one coordinate; use a joint for each")
        if limits[0] >= limits[1]:
            self.refuse(f"limits = {self.limits}: the lower one comes first")
        return limits

    def _law_parameters(self) -> NamedDeclarations:
        """Parameters of stiffness, damping, dry friction and armature, and of the values where the first two begin."""
        kinds = {kind for _, kind, _ in self.motions}
        for name in ("reference", "unstressed"):
            (number,) = finite_numbers(self, name, [getattr(self, name)], 1)
            if number and (len(self.motions) != 1 or "ball" in kinds):
                self.refuse(f"{name} = {number:g}: only for one coordinate; use a joint for each")
            unit = "m" if kinds == {"shift"} else "rad"
            yield from nonzero_parameters(f"{self.name}_{name}", [""], [number], unit, f"{name} value of {self.name}")
        for name, unit in (_UNITS if kinds == {"shift"} else _TURNING).items():
            if not (value := getattr(self, name)):
                continue
            if len(kinds) != 1 or (kinds == {"ball"} and name not in ("damping", "armature")):
                self.refuse(
                    f"{name} = {value}: of coordinates of different kinds; use SpringDamper, or a joint for each"
                )
            (number,) = finite_numbers(self, name, [value], 1)
            if number < 0:
                self.refuse(f"{name} = {number:g}: it must be >= 0")
            yield f"{self.name}_{name}", Parameter(number, unit, f"{name} of {self.name}", minimum=0)

    def frames(self, m: Any, parent: int, count: int, rows: Mapping[str, list[int]]) -> Iterator[Frame]:
        """Frames that the motions move, one each, from the first body to the second; that of a weld is fixed.

        :param parent: number of the first body's frame.
        :param count: that of the first new one.
        :param rows: by coordinate or orientation.
        """
        rotation, position = roll_pitch_yaw_rotation(self.rotation), m.parameter_vector(f"{self.name}_at")
        for i, (ending, kind, axis) in enumerate(self.motions or [("", "weld", "")]):
            name = f"{self.name}{ending}" if kind != "ball" else self.name
            unit, axes = ca.SX(ca.sparsify(ca.DM(unit_vector(axis or self.axis)))), ca.SX(6, 0)
            if kind == "ball":
                rotation, axes = rotation @ getattr(m, name).matrix, ca.vertcat(ca.SX.eye(3), ca.SX(3, 3))
            elif kind != "weld":
                q = m.symbols[name] - m.parameter_or_zero(f"{self.name}_reference")
                advance = m.parameter_or_zero(f"{self.name}_pitch") / (2 * pi)
                position += rotation @ unit * (q if kind == "shift" else advance * q)
                axes = ca.vertcat(ca.SX(3, 1), unit) if kind == "shift" else ca.vertcat(unit, advance * unit)
                rotation = rotation @ axis_rotation(unit, q) if kind == "turn" else rotation
            last = i + 1 >= len(self.motions)
            prescribed = kind == "weld" or self.is_prescribed(ending)
            body, own = self.child if last else None, rows.get(name, [])
            armature = m.parameter_or_zero(f"{self.name}_armature") * ca.SX.eye(axes.shape[1])
            yield Frame(name, self, body, parent, rotation, position, axes, prescribed, own, armature)
            rotation, position, parent = ca.SX.eye(3), ca.SX(3, 1), count + i


class Revolute(BodyJoint):
    """Turn about an axis: coordinate J [rad]."""

    motions = (("", "turn", ""),)


class Prismatic(BodyJoint):
    """Shift along an axis: coordinate J [m]."""

    motions = (("", "shift", ""),)


class Cylindrical(BodyJoint):
    """Shift along an axis and turn about it: coordinates J_shift, J_angle."""

    motions = (("_shift", "shift", ""), ("_angle", "turn", ""))


class Screw(BodyJoint):
    """Turn about an axis with a shift in proportion: coordinate J [rad].

    :param pitch: shift in one revolution [m].
    """

    motions = (("", "turn", ""),)

    example = "Screw(ground, nut, pitch=0.01)"

    def __init__(self, parent: Body, child: Body, *, pitch: float, **more: Any) -> None:
        super().__init__(parent, child, **more)
        self.pitch = pitch

    def _motion_declarations(self) -> NamedDeclarations:
        pitch = finite_numbers(self, "pitch", [self.pitch], 1)
        yield from nonzero_parameters(f"{self.name}_pitch", [""], pitch, "m", f"shift of {self.name} in one revolution")
        yield from super()._motion_declarations()


class Universal(BodyJoint):
    """Turn about x, then about y of the turned frame: coordinates J_x, J_y [rad]."""

    motions = (("_x", "turn", "x"), ("_y", "turn", "y"))


class Spherical(BodyJoint):
    """Any orientation, as a unit quaternion: J_q_w, ..., J_omega_x, ..., J_H_x, ..."""

    motions = (("", "ball", "x"),)


class Planar(BodyJoint):
    """Shift along x and y, turn about z: coordinates J_x, J_y [m], J_angle [rad]."""

    motions = (("_x", "shift", "x"), ("_y", "shift", "y"), ("_angle", "turn", "z"))


class Free(BodyJoint):
    """All six degrees of freedom, of a body that no joint holds: J_x, J_y, J_z [m], and those of a spherical joint."""

    motions = (("_x", "shift", "x"), ("_y", "shift", "y"), ("_z", "shift", "z"), ("", "ball", "x"))


class Weld(BodyJoint):
    """No motion: two bodies as one."""


Attachment: TypeAlias = "Body | tuple[Body, Vector] | BodyPoint"
"""A body's frame, a point of a body, or one that is declared."""


class BodyPoint(point):
    """A named point of a body, as a port.

    :param at: in the body's frame [m].
    """

    example = "BodyPoint(load, at=(0, 0, -20))"

    def __init__(self, body: Body, at: Vector = _ZERO) -> None:
        super().__init__("m", "point of a body")
        self.body, self.at = body, at
        self.bodies = (body,)
        self.method = self._components

    def _components(self, m: Any) -> dict[str, ca.SX]:
        return dict(
            zip("xyz", ca.vertsplit(m.frame_of(self.body).position(m.parameter_vector(f"{self.name}_at"))), strict=True)
        )

    def declarations(self) -> NamedDeclarations:
        """Parameters of the position in the body's frame."""
        text = f"place of {self.name} in {self.body.name}"
        return position_parameters(self, "at", self.at, f"{self.name}_at", text)


class SpringDamper(Declaration[ca.SX]):
    """Spring and damper along the line between two points; ``self.spring`` is their distance.

    :param stiffness: [N/m].
    :param damping: [N.s/m].
    :param length: unstressed length [m].  All are parameters, ``S_stiffness``, ...
    """

    example = "SpringDamper((ground, (0, 0, 1)), (bar, (1, 0, 0)), stiffness=100.0, length=0.5)"

    def __init__(
        self, a: Attachment, b: Attachment, stiffness: float = 0.0, damping: float = 0.0, length: float = 0.0
    ) -> None:
        super().__init__("m", "spring")
        self.ends, self.laws = (a, b), {"stiffness": stiffness, "damping": damping, "length": length}

    @property
    def named_ends(self) -> tuple[tuple[Attachment, str], ...]:
        """The two ends, each with the name of the parameters of its position: ``S_a``, ``S_b``."""
        return tuple((end, f"{self.name}_{letter}") for end, letter in zip(self.ends, "ab", strict=True))

    @property
    def bodies(self) -> tuple[Any, ...]:
        """Bodies at the ends."""
        return tuple(e.body if isinstance(e, BodyPoint) else e[0] if isinstance(e, tuple) else e for e in self.ends)

    def value_in(self, instance: Any) -> ca.SX:
        """Distance of the ends [m]."""
        return ca.norm_2(self.vector_between(instance))

    def vector_between(self, m: Any) -> ca.SX:
        """Vector from end a to end b [m], (3, 1)."""
        a, b = (m.attached(end, name) for end, name in self.named_ends)
        return b - a

    def declarations(self) -> NamedDeclarations:
        """Parameters of stiffness, damping and length, and of the positions of the ends."""
        for name, value in self.laws.items():
            (number,) = finite_numbers(self, name, [value], 1)
            if number < 0:
                self.refuse(f"{name} = {number:g}: it must be >= 0")
            unit, text = "m" if name == "length" else _UNITS[name], f"{name} of {self.name}"
            yield from nonzero_parameters(f"{self.name}_{name}", [""], [number], unit, text, minimum=0)
        for end, name in self.named_ends:
            if isinstance(end, tuple):
                yield from position_parameters(self, "ends", end[1], name, f"end of {self.name}")


def _rate_of(m: Any, *, name: str) -> ca.SX:
    return m.dot(m.symbols[name])


def column(values: Sequence[Any] | ca.SX) -> ca.SX:
    """Column of numbers or expressions; zeros are structural."""
    return ca.sparsify(values if isinstance(values, ca.SX) else ca.vertcat(*map(ca.SX, values)))


def skew(r: ca.SX) -> ca.SX:
    """Matrix of the cross product r × (3, 3); zeros are structural."""
    return ca.sparsify(ca.skew(r))


def unit_vector(axis: Any) -> np.ndarray:
    """Unit vector of an axis, ``"-x"`` or three numbers; NaN if it is none."""
    try:
        named_axis = isinstance(axis, str) and _AXES[axis.removeprefix("-")]
        vector = np.array(named_axis or axis, dtype=float) * (-1 if named_axis and axis[0] == "-" else 1)
    except (KeyError, TypeError, ValueError):
        return np.full(3, np.nan)
    with np.errstate(invalid="ignore"):
        vector = vector / np.abs(vector).max(initial=0.0)  # whose square is finite
        return vector / np.linalg.norm(vector)


def axis_rotation(axis: ca.SX, angle: ca.SX) -> ca.SX:
    """Rotation matrix (3, 3) about a unit vector by an angle [rad], after Rodrigues; zeros are structural."""
    K, square = skew(axis), axis @ axis.T
    c, s = ca.cos(angle), ca.sin(angle)
    return ca.sparsify(square + c * (ca.SX.eye(3) - square) + s * K)


def roll_pitch_yaw_rotation(roll_pitch_yaw: Vector) -> ca.SX:
    """Rotation matrix (3, 3) of roll, pitch and yaw [rad]; zeros are structural."""
    matrix = np.eye(3)
    for axis, angle in zip("xyz", roll_pitch_yaw, strict=True):
        matrix = np.array(ca.DM(axis_rotation(ca.SX(ca.DM(_AXES[axis])), ca.SX(float(angle))))) @ matrix
    return ca.SX(ca.sparsify(ca.DM(np.where(np.abs(matrix) < 1e-15, 0.0, matrix))))


def finite_numbers(item: Declaration, argument: str, values: Any, *counts: int) -> list[float]:
    """Values of an argument of a declaration, which refuses them unless they are so many finite numbers."""
    try:
        numbers = [float(value) for value in values]
    except (TypeError, ValueError):
        numbers = []
    if len(numbers) not in counts or not all(map(isfinite, numbers)) or isinstance(values, str):
        item.refuse(f"{argument} = {values!r}: it must have {' or '.join(map(str, counts))} finite numbers")
    return numbers


def position_parameters(
    item: Declaration, argument: str, position: Vector, name: str, description: str
) -> NamedDeclarations:
    """Parameters ``name_x``, ``name_y``, ``name_z`` of a position; components that are 0 have none."""
    numbers = finite_numbers(item, argument, position, 3)
    return nonzero_parameters(name, ["_x", "_y", "_z"], numbers, "m", description)


def nonzero_parameters(
    name: str, endings: Iterable[str], values: Iterable[float], unit: str, description: str, **domain: Any
) -> NamedDeclarations:
    """Parameters of the values that are not 0, each with its ending of the name."""
    for ending, value in zip(endings, values, strict=False):
        if value:
            yield f"{name}{ending}", Parameter(value, unit, f"{description}{ending.replace('_', ', ')}", **domain)


def _stop_declarations(name: str, unit: str, low: float, high: float, restitution: float) -> NamedDeclarations:
    bounce = f"{name}_restitution" if restitution else None
    if bounce:
        yield bounce, Parameter(restitution, "1", f"restitution at the stops of {name}", minimum=0, maximum=1)
    for side, sign, bound in (("minimum", 1, low), ("maximum", -1, high)):
        limit = f"{name}_{side}"
        yield limit, Parameter(bound, unit, f"{side} of {name}")
        gap = unilateral(unit, f"distance of {name} from its {side}", restitution=bounce)
        ending = "above" if sign > 0 else "below"
        yield f"{name}_{ending}", gap(partial(_distance_to_limit, name=name, limit=limit, sign=sign))


def _distance_to_limit(m: Any, *, name: str, limit: str, sign: int) -> ca.SX:
    return sign * (m.symbols[name] - m.symbols[limit])
