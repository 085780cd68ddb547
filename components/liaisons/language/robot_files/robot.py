"""Bodies, joints and shapes of a robot's file, as members of a class."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable
from functools import partial
from math import isfinite
from pathlib import Path
from typing import Any, NamedTuple, NoReturn, final
from xml.etree.ElementTree import Element

import casadi as ca
import numpy as np
from scipy.spatial.transform import Rotation

from liaisons.base.arguments import as_path, name_list, shown
from liaisons.base.xml_documents import read_tree
from liaisons.errors import ComponentError, suggestion
from liaisons.language.declarations import Declaration, Gravity
from liaisons.language.joints import MOMENTS, Body, BodyFrame, BodyJoint, Weld, named
from liaisons.language.shapes import Ball, Box, Rod, Shape

_MOST_BODIES = 1000
_RESERVED = {"gravity", "ground"}


class Pose(NamedTuple):
    """Rotation and origin (3,) [m] of a frame in another."""

    axes: Rotation = Rotation.identity()
    origin: np.ndarray = np.zeros(3)

    def times(self, inner: Pose) -> Pose:
        """Pose of a frame, from its pose in this one."""
        return Pose(self.axes * inner.axes, self.origin + self.axes.apply(inner.origin))

    def inside(self, outer: Pose) -> Pose:
        """Pose in another frame, both in the same one."""
        inverse = outer.axes.inv()
        return Pose(inverse * self.axes, inverse.apply(self.origin - outer.origin))

    def tensor(self, moments: np.ndarray) -> np.ndarray:
        """Tensor (3, 3) along the outer axes."""
        return self.axes.as_matrix() @ moments @ self.axes.inv().as_matrix()


class MassProperties(NamedTuple):
    """Mass [kg], its centre [m] (3,), and the tensor about the centre [kg.m2] (3, 3), along the axes of a body."""

    mass: float = 0.0
    centre: np.ndarray = np.zeros(3)
    tensor: np.ndarray = np.zeros((3, 3))


@final
class Robot:
    """Declarations of a robot's file; errors name the file and the link or joint.

    :param root: tag of the document.
    :param prescribe: joints that an operator prescribes; ``limits``: whether limits of joints become stops.
    :raises ComponentError: for a file that cannot be read, as every method for what it cannot declare.
    """

    def __init__(self, path: Path | str, root: str, prescribe: Iterable[str], *, limits: bool) -> None:
        self.path, self.limits = as_path("path", path, ComponentError), limits
        self.prescribe = dict.fromkeys(name_list("prescribe", prescribe, ComponentError), False)
        try:
            with self.path.open("rb") as file:
                self.document = read_tree(file)
        except (OSError, ValueError) as error:
            raise ComponentError(f"{path}: {getattr(error, 'strerror', None) or error}") from None
        if self.document.tag != root:
            self.refuse(f"<{shown(self.document.tag)}>", f"the document must be <{root}>")
        self.members: dict[str, Any] = {}
        self.visuals: dict[str, list[Any]] = {}  # functions of a BodyFrame, by body
        self.ignored: Counter[str] = Counter()
        self.remarks: list[str] = []
        self.gravity: np.ndarray | None = None  # acceleration [m/s2]; None: a linkage's own
        self._joints = {identifier(joint.get("name", "")) for joint in self.document.iter("joint")}

    @property
    def name(self) -> str:
        """Identifier of the document's name, or of the file's."""
        name = self.document.get("name") or self.document.get("model") or ""
        return identifier(name) or identifier(self.path.stem) or "Robot"

    def refuse(self, item: str, why: str) -> NoReturn:
        """Raise a ComponentError about a link or joint."""
        raise ComponentError(f"{self.path}: {item}: {why}")

    def numbers(
        self, item: str, element: Element, key: str, default: str | None, *counts: int, minimum: float = -np.inf
    ) -> np.ndarray:
        """Finite numbers of an attribute, so many; without a default it must be there."""
        text = element.get(key, default)
        try:
            values = [float(word) for word in (text or "").split()]
        except ValueError:
            values = []
        if len(values) not in counts or not all(map(isfinite, values)):
            self.refuse(item, f"{key} = {shown(text)}: it must have {' or '.join(map(str, counts))} finite numbers")
        if min(values) < minimum:
            self.refuse(item, f"{key} = {shown(text)}: it must be >= {minimum:g}")
        return np.array(values)

    def number(self, item: str, element: Element, key: str, default: str | None = "0", **domain: float) -> float:
        """Finite number of an attribute."""
        return float(self.numbers(item, element, key, default, 1, **domain)[0])

    def direction(self, item: str, element: Element, key: str, default: str | None = None) -> np.ndarray:
        """Unit vector (3,) of an attribute."""
        vector = self.numbers(item, element, key, default, 3)
        if not vector.any():
            self.refuse(item, f"{key} = 0 0 0 of <{element.tag}>: it must have a direction")
        return vector / np.linalg.norm(vector)

    def body(self, name: str, inertia: MassProperties = MassProperties(), tag: str = "link") -> Body:  # noqa: B008 - immutable
        """Declare a body."""
        word = identifier(name)
        smallest = 1e-15 * np.abs(inertia.tensor).max()
        moments = (inertia.tensor["xyz".index(i), "xyz".index(j)] for i, j in MOMENTS)
        body = Body(
            inertia.mass,
            tuple(float(moment) if abs(moment) > smallest else 0.0 for moment in moments),
            _floats(inertia.centre * bool(inertia.mass)),
        )
        self._declare(f"{tag} {shown(name)}", f"{word}_{tag}" if word in self._joints | _RESERVED else word, body)
        return body

    def joint(self, kind: type[BodyJoint], name: str, ends: tuple[Body, Body], pose: Pose, **more: Any) -> None:
        """Declare a joint.

        :param pose: of its frame in that of the first body.
        :param more: arguments of the joint; those that are 0 are left out.
        """
        item, label = f"joint {shown(name)}", identifier(name)
        requested = [key for key in self.prescribe if key in (name, label)]
        self.prescribe |= dict.fromkeys(requested, True)
        if requested and kind is Weld:
            self.refuse(item, "it does not move; prescribe one that does")
        if requested and more.pop("friction", 0):
            self.remarks.append(f"friction of {item}, which is prescribed")
        low, high = _floats(more.pop("limits", (0.0, 0.0)))
        if (low or high) and self.limits:
            more |= {"limits": (low, high), "start": 0.0 if low <= 0 <= high else (low + high) / 2}
        elif low or high:
            self.ignored["limits of joints (limits=True or --limits makes stops of them)"] += 1
        more = {key: value for key, value in more.items() if np.any(value)}
        more |= {"at": _floats(pose.origin), "rotation": roll_pitch_yaw(pose.axes), "prescribed": bool(requested)}
        self._declare(item, label, kind(*ends, **more))

    def draw(self, body: Body, shape: str, pose: Pose, size: Iterable[float]) -> None:
        """Add a shape to the picture of a body.

        :param shape: a box, a rod along z, or a ball.
        :param size: full lengths of a box, radius and length of a rod, radius of a ball [m].
        """
        function = partial(_shape, shape=shape, axes=pose.axes.as_matrix(), centre=pose.origin, size=_floats(size))
        self.visuals.setdefault(body.name, []).append(function)

    def members_of_class(self) -> dict[str, Any]:
        """Members of a linkage's class."""
        missing = next((name for name, is_present in self.prescribe.items() if not is_present), None)
        if missing is not None:
            self.refuse(f"prescribe = {shown(missing)}", f"no joint is called so{suggestion(missing, self._joints)}")
        if all(isinstance(item, (Body, Weld)) for item in self.members.values()):
            self.refuse("its joints", "none moves; a linkage has one that does")
        general: dict[str, Any] = {
            "__doc__": f"{self.name}, as {self.path.name} describes it.",
            "__module__": f"_file_{self.path.stem}",
            "left_out": (*(f"{count} {key}" for key, count in self.ignored.items()), *self.remarks),
            "visuals": self.visuals,
        }
        if self.gravity is not None:
            general["gravity"] = Gravity()
            general["gravity"].start = strength = float(np.linalg.norm(self.gravity))
            if strength:
                general["gravity_direction"] = _floats(self.gravity / strength)
        return general | self.members

    def _declare(self, item: str, name: str, declaration: Declaration[Any]) -> None:
        if not name:
            self.refuse(item, "its name has no letter or digit; rename it")
        if name in self.members or name in _RESERVED:
            self.refuse(item, f"the name {name!r}, made of its own, is taken; rename it")
        if len(self.members) >= 2 * _MOST_BODIES:
            self.refuse(item, f"the file has more than {_MOST_BODIES} bodies")
        self.members[name] = named(declaration, name)


def identifier(name: str) -> str:
    """Identifier of a name: ``_`` for what is no ASCII letter or digit, none at its ends, ``n`` before a digit."""
    word = re.sub(r"\W", "_", name, flags=re.ASCII).strip("_")
    return f"n{word}" if word[:1].isdigit() else word


def rotation_onto(direction: np.ndarray) -> Rotation:
    """Shortest rotation of z onto a unit vector."""
    across = np.array([-direction[1], direction[0], 0.0])
    length = np.linalg.norm(across)
    return Rotation.from_rotvec(np.arctan2(length, direction[2]) * (across / length if length else np.eye(3)[0]))


def roll_pitch_yaw(axes: Rotation) -> tuple[float, ...]:
    """Angles of turns about the fixed x, y and z; accurate where pitch is a right angle, too."""
    R = axes.as_matrix()
    yaw = np.arctan2(R[1, 0], R[0, 0]) if np.hypot(R[0, 0], R[1, 0]) > 1e-8 else 0.0
    s, c = np.sin(yaw), np.cos(yaw)
    pitch = np.arctan2(-R[2, 0], c * R[0, 0] + s * R[1, 0])
    return _floats([np.arctan2(s * R[0, 2] - c * R[1, 2], c * R[1, 1] - s * R[0, 1]), pitch, yaw])


def _floats(values: Iterable[Any]) -> tuple[float, ...]:
    return tuple(map(float, values))


def _shape(frame: BodyFrame, *, shape: str, axes: np.ndarray, centre: np.ndarray, size: Any) -> Shape:
    def position(point: np.ndarray) -> dict[str, ca.SX]:
        return dict(zip("xyz", ca.vertsplit(frame.position(list(point))), strict=True))

    if shape == "ball":
        return Ball(position(centre), *size)
    if shape == "rod":
        half = axes[:, 2] * size[1] / 2
        return Rod(position(centre - half), position(centre + half), size[0])
    return Box(position(centre), frame.matrix @ ca.SX(ca.sparsify(ca.DM(axes))), size)
