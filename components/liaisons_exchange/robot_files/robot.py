"""Bodies, joints and shapes of a robot's file, as members of a class."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Callable, Container, Iterable, Iterator, Mapping
from dataclasses import dataclass
from decimal import Decimal
from functools import partial
from math import isfinite
from pathlib import Path
from typing import Any, NamedTuple, NoReturn, final
from xml.etree.ElementTree import Element
from xml.parsers import expat

import casadi as ca
import numpy as np
from scipy.spatial.transform import Rotation

from liaisons import Body, Prismatic, Revolute, Weld
from liaisons.base.arguments import as_path, name_list, shown
from liaisons.base.xml_documents import read_tree
from liaisons.errors import ComponentError, suggestion
from liaisons.language import Ball, Box, Declaration, Gravity, Parameter, Rod, Shape, constraint
from liaisons.linkages import BodyFrame, BodyJoint

_MOST_BODIES = 1000
_MOST_FILES = 100
_MOMENTS = ("xx", "yy", "zz", "xy", "xz", "yz")
_COEFFICIENTS = ("offset", "multiplier", "quadratic", "cubic", "quartic")
_DEEPEST = 200  # nesting of elements, includes expanded
_RESERVED = {"gravity", "ground"}
_GIVEN = {"energy", "work", "power", "dissipated", "dissipation", "energy_balance", "impact_loss", "time", "dot"}
"""Names that every FMU has of its own: bodies called so are renamed."""


class Pose(NamedTuple):
    """Rotation and origin (3,) [m] of a frame in another."""

    axes: Rotation = Rotation.identity()
    origin: np.ndarray = np.zeros(3)

    def times(self, inner: Pose) -> Pose:
        """Pose of a frame in the outer one, from its pose in this frame."""
        return Pose(self.axes * inner.axes, self.origin + self.axes.apply(inner.origin))

    def relative_to(self, outer: Pose) -> Pose:
        """Pose in another frame, whose pose is known in the same outer one."""
        inverse = outer.axes.inv()
        return Pose(inverse * self.axes, inverse.apply(self.origin - outer.origin))

    def rotated_tensor(self, moments: np.ndarray) -> np.ndarray:
        """Tensor (3, 3) along the outer axes, from that along the axes of this frame."""
        return self.axes.as_matrix() @ moments @ self.axes.inv().as_matrix()


class MassProperties(NamedTuple):
    """Mass [kg], its centre [m] (3,), and the tensor about the centre [kg.m2] (3, 3), along the axes of a body."""

    mass: float = 0.0
    centre: np.ndarray = np.zeros(3)
    tensor: np.ndarray = np.zeros((3, 3))


@dataclass(frozen=True)
class RobotOptions:
    """What a user says of a robot's file.

    :param prescribe: joints that an operator prescribes; ``limits``: whether limits of joints become stops.
    :param balance_inertia: whether a tensor that no body has gets the mean of its principal moments.
    :param floating_base: whether the root link of a URDF file moves freely.
    :param leave_out: names of elements or attributes that move the bodies, which a linkage cannot, and need not have.
    """

    prescribe: Iterable[str] = ()
    limits: bool = False
    balance_inertia: bool = False
    floating_base: bool = False
    leave_out: Iterable[str] = ()


class Coupling(NamedTuple):
    """Condition on coordinates q of joints: Σ a (q - r) = c₀ + c₁ x + c₂ x² + ..., x = Σ b (q - r).

    Its coefficients are parameters, called by its name; r are the reference values of the joints.
    """

    item: str
    name: str
    terms: Mapping[str, float]  # a, by joint
    others: Mapping[str, float]  # b
    polynomial: tuple[float, ...]
    units: tuple[str, str] = ("", "")  # of both sides; by default those of their joints

    @property
    def description(self) -> str:
        """What the condition does, for people."""
        followers, leaders = (", ".join(side) for side in (self.terms, self.others))
        return f"{followers} follows {leaders}" if leaders else f"{followers} stays"

    def parameters(self, units: Mapping[str, str]) -> Iterator[tuple[str, Parameter]]:
        """Parameters of the coefficients, by name.

        :param units: of the coordinates, by joint.
        """
        sides = (("", self.terms), ("_leader", self.others))
        given = zip(self.units, sides, strict=True)
        left, right = (unit or next((units[joint] for joint in side), "1") for unit, (_, side) in given)
        for (middle, side), whole in zip(sides, (left, right), strict=True):
            for joint, factor in side.items():
                unit = _quotient(whole, units[joint], 1)
                if (unit, factor) != ("1", 1):
                    text = f"factor of {joint} in {self.name}"
                    yield f"{self.name}{middle}_{joint}", Parameter(factor, unit, text)
        for power, (ending, value) in enumerate(zip(_COEFFICIENTS, self.polynomial, strict=False)):
            if value:
                unit = _quotient(left, right, power)
                yield f"{self.name}_{ending}", Parameter(value, unit, f"{ending} coefficient of {self.name}")

    def residual(self, value: Callable[[str, float], Any]) -> Any:
        """Left less right side.

        :param value: of a coordinate or parameter by its name; the number for one that is not there.
        """
        left, x = (
            sum(value(f"{self.name}{middle}_{q}", 1) * (value(q, 0) - value(f"{q}_reference", 0)) for q in side)
            for middle, side in (("", self.terms), ("_leader", self.others))
        )
        powers = (value(f"{self.name}_{ending}", 0) * x**power for power, ending in enumerate(_COEFFICIENTS))
        return left - sum(powers)


@final
class Robot:
    """Declarations of a robot's file; errors name the file and the link or joint.

    :param root: tag of the document.
    :raises ComponentError: for a file that cannot be read, as every method for what it cannot declare.
    """

    def __init__(self, path: Path | str, root: str, options: RobotOptions) -> None:
        self.path, self.limits = as_path("path", path, ComponentError), options.limits
        self.balance_inertia = options.balance_inertia
        self.prescribe = dict.fromkeys(name_list("prescribe", options.prescribe, ComponentError), False)
        self.leave_out = dict.fromkeys(name_list("leave_out", options.leave_out, ComponentError), False)
        self._sources: dict[Path, list[Element]] = {}  # elements by file, as they come in it
        self.document = self._read_document(self.path)
        self.couplings: list[Coupling] = []
        self.members: dict[str, Any] = {}
        self.visuals: dict[str, list[Any]] = {}  # functions of a BodyFrame, by body
        self.ignored: Counter[str] = Counter()
        self.remarks: list[str] = []
        self.gravity: np.ndarray | None = None  # acceleration [m/s2]; None: a linkage's own
        self._unread: dict[str, dict[str, None]] = {}  # attributes by tag
        self._elements: dict[str, Element] = {}  # by the label of an item, and by the name of what it declares
        if self.document.tag != root:
            self.refuse(f"<{shown(self.document.tag)}>", f"the document must be <{root}>")
        joints = (*self.document.iter("joint"), *self.document.iter("freejoint"))
        self._joints = {identifier(joint.get("name", "")) for joint in joints}

    @property
    def name(self) -> str:
        """Identifier made of the document's name, else of the file's."""
        name = self.document.get("name") or self.document.get("model") or ""
        return identifier(name) or identifier(self.path.stem) or "Robot"

    def item(self, label: str, element: Element) -> str:
        """Label of an element, whose line a refusal names."""
        self._elements.setdefault(label, element)
        return label

    def refuse(self, item: str, why: str) -> NoReturn:
        """Raise a ComponentError about an item of the file."""
        tag = re.fullmatch(r"<(\w+)>", item)
        element = self._elements.get(item, self.document.find(f".//{tag[1]}") if tag else None)
        raise ComponentError(f"{self.path}: {self._line(element)}{item}: {why}")

    def leave_out_or_refuse(self, key: str, item: str, why: str) -> None:
        """List what moves the bodies, and a linkage has not, if a user leaves it out by its name; else refuse it."""
        if key not in self.leave_out:
            self.refuse(item, f"{why}; or leave it out: leave_out={[key]}, --leave-out {key}")
        self.leave_out[key] = True
        self.remarks.append(f"{key} of {item}, on request" if key not in item else f"{item}, on request")

    def include_files(self, *roots: str) -> None:
        """Put what each <include> names in its place: files in the folder of the document, each once.

        :param roots: tags that their documents may have.
        """
        self._include_into(self.document, roots, 1)

    def _include_into(self, parent: Element, roots: tuple[str, ...], depth: int) -> None:
        for child in [*parent]:
            if depth >= _DEEPEST:
                self.refuse(self.item(f"<{child.tag}>", child), f"its elements are nested more than {_DEEPEST} deep")
            if child.tag != "include":
                self._include_into(child, roots, depth + 1)
                continue
            name, folder = child.get("file", ""), self.path.resolve().parent
            item = f"<include> of {shown(name)}"
            self._elements[item] = child
            path = (folder / name).resolve()
            if not name or Path(name).is_absolute() or not path.is_relative_to(folder):
                self.refuse(item, "the file does not lie in the folder of the document; move it there")
            if path in self._sources or path == self.path.resolve():
                self.refuse(item, "the file is there already; include each file once, and no file in itself")
            if len(self._sources) > _MOST_FILES:
                self.refuse(item, f"the document has more than {_MOST_FILES} files")
            try:
                included = self._read_document(path)
            except ComponentError as error:
                self.refuse(item, str(error).removeprefix(f"{path}: "))
            if included.tag not in roots:
                self.refuse(item, f"its document is <{shown(included.tag)}>; it must be <{roots[0]}>")
            self._include_into(included, roots, depth + 1)
            where = [*parent].index(child)
            parent[where : where + 1] = [*included]

    def _read_document(self, path: Path) -> Element:
        try:
            with path.open("rb") as file:
                document = read_tree(file)
        except (OSError, ValueError) as error:
            raise ComponentError(f"{path}: {getattr(error, 'strerror', None) or error}") from None
        self._sources[path] = [*document.iter()]
        return document

    def located(self, text: str) -> str:
        """Text of an error in a declaration, after the file and the line of what it names."""
        named = (self._elements[word] for word in re.findall(r"\w+", text)[1:] if word in self._elements)
        wrong = "exceeds the sum" in text or "principal moments are" in text
        hint = "; balance_inertia=True or --balance-inertia takes their mean" * wrong
        hint += "; prescribe=[...] or --prescribe holds joints without mass" * ("no mass moves" in text)
        return f"{self.path}: {self._line(next(named, None))}{text}{hint}"

    def _line(self, element: Element | None) -> str:
        """``"line 3: "`` of an element; empty for None."""
        for path, elements in self._sources.items():
            lines = _lines(path) if any(other is element for other in elements) else []
            for other, line in zip(elements, lines, strict=False):
                if other is element:
                    return f"{path.name}: " * (path != self.path) + f"line {line}: "
        return ""

    def list_unread(self, element: Element, read: str = "") -> None:
        """List the attributes of an element as left out, but for those that are read."""
        unread = dict.fromkeys(key for key in element.attrib if key not in read.split())
        if unread:
            self._unread.setdefault(element.tag, {}).update(unread)

    def numbers(
        self, item: str, element: Element, key: str, default: str | None, *counts: int, minimum: float = -np.inf
    ) -> np.ndarray:
        """Finite numbers of an attribute; without a default it is required.

        :param counts: how many there may be.
        """
        text = element.get(key, default)
        try:  # Python reads 1_000, and digits of other scripts, too
            values = [] if re.search(r"[^-+.\deE\s]", text or "", re.ASCII) else list(map(float, (text or "").split()))
        except ValueError:
            values = []
        if len(values) not in counts or not all(map(isfinite, values)):
            self.refuse(item, f"{key} = {shown(text)}: it must have {' or '.join(map(str, counts))} finite numbers")
        if min(values) < minimum:
            self.refuse(item, f"{key} = {shown(text)}: it must be >= {minimum:g}")
        return np.array(values)

    def number(self, item: str, element: Element, key: str, default: str | None = "0", **domain: float) -> float:
        """Finite number of an attribute.

        :param domain: as of :meth:`numbers`.
        """
        return float(self.numbers(item, element, key, default, 1, **domain)[0])

    def direction(self, item: str, element: Element, key: str, default: str | None = None) -> np.ndarray:
        """Unit vector (3,) of an attribute."""
        return self.unit_vector(item, self.numbers(item, element, key, default, 3), f"{key} of <{element.tag}>")

    def unit_vector(self, item: str, vector: Iterable[float], label: str = "its orientation") -> np.ndarray:
        """Unit vector in the direction of a vector, which may not be 0."""
        column = np.array(vector)
        if not column.any():
            self.refuse(item, f"{label} = {column.tolist()}: it must have a direction")
        column = column / np.abs(column).max()  # whose square is finite
        return column / np.linalg.norm(column)

    def balanced(self, item: str, tensor: np.ndarray, text: str, mass: float, *, mean: bool = False) -> np.ndarray:
        """Tensor of inertia that a body may have, if a given one is wrong by the rounding of its digits alone.

        Principal moments of which one exceeds the sum of the others by what the last digits leave open, or by single
        precision, change by as little as makes them equal; those of less than 1e-18 m2 times the mass become 0.

        :param text: numbers that were rounded.
        :param mean: whether any other wrong tensor gets the mean of its moments; so it does by ``balance_inertia``.
        """
        if not np.isfinite(tensor).all():
            return tensor
        moments, axes = np.linalg.eigh(tensor)
        excess = max(moments[2] - moments[0] - moments[1], -moments[0])
        if moments[0] >= -1e-12 * moments[2] and excess <= 1e-9 * moments[2]:
            return tensor
        numbers = [number for number in map(Decimal, text.split()) if number]
        digits = max([3, *(len(number.as_tuple().digits) for number in numbers)])
        last = 0.5 * 10.0 ** (max([number.adjusted() for number in numbers], default=-400) + 1 - digits)
        positive = np.maximum(moments, 0)
        if np.abs(moments).max() <= max(1e-18 * mass, 1e-30):
            new = np.zeros(3)
        elif excess <= max(2 * np.linalg.norm(last * (tensor != 0), 2) + 3 * last, 1e-6 * moments[2]):
            new = positive + max(0, positive[2] - positive[0] - positive[1]) / 3 * np.array([1, 1, -1])
        elif mean or self.balance_inertia:
            new = np.full(3, positive.mean())
        else:
            return tensor
        change = " to ".join(str([float(f"{x:.6g}") for x in values]) for values in (moments, new))
        self.remarks.append(f"inertia of {item} as printed: its principal moments are balanced, {change}")
        return axes @ np.diag(new) @ axes.T

    def declare_body(self, name: str, inertia: MassProperties = MassProperties(), tag: str = "link") -> Body:  # noqa: B008 - immutable
        """Declare a body, and return it; one that is called as a joint gets its tag behind the name."""
        item = f"{tag} {shown(name)}"
        own = self.free_name(item, identifier(name), tag, self._joints | _RESERVED | _GIVEN)
        if not np.isfinite([inertia.mass, *inertia.centre, *inertia.tensor.flat]).all():
            self.refuse(item, "its mass, centre of mass or inertia exceeds all numbers; check sizes and places")
        smallest = 1e-15 * np.abs(inertia.tensor).max()
        moments = (inertia.tensor["xyz".index(i), "xyz".index(j)] for i, j in _MOMENTS)
        body = Body(
            inertia.mass,
            tuple(float(moment) if abs(moment) > smallest else 0.0 for moment in moments),
            _floats(inertia.centre * bool(inertia.mass)),
        )
        self._declare(item, own, body)
        return body

    def free_name(self, item: str, name: str, tag: str, taken: Container[str]) -> str:
        """Name of an item; with its tag behind it, and a remark, if it is taken."""
        if name not in taken:
            return name
        self.remarks.append(f"name of {item}, which a joint or the FMU has: its variables begin with {name}_{tag}")
        return f"{name}_{tag}"

    def declare_joint(self, kind: type[BodyJoint], name: str, ends: tuple[Body, Body], pose: Pose, **more: Any) -> None:
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
        low, high = _floats(more.pop("limits", (-np.inf, np.inf)))
        if low == high:
            self.remarks.append(f"limits of {item}, which are both {low:g}")
        elif self.limits and isfinite(low):
            start = more.get("start", 0.0)
            more |= {"limits": (low, high), "start": start if low <= start <= high else (low + high) / 2}
        elif isfinite(low):
            self.ignored["limits of joints (limits=True or --limits makes stops of them)"] += 1
        more = {key: value for key, value in more.items() if np.any(value)}
        more |= {"at": _floats(pose.origin), "rotation": roll_pitch_yaw(pose.axes), "prescribed": bool(requested)}
        self._declare(item, label, kind(*ends, **more))

    def add_shape(self, body: Body, shape: str, pose: Pose, size: Iterable[float]) -> None:
        """Add a shape to the picture of a body.

        :param shape: a box, a rod along z, or a ball.
        :param size: full lengths of a box, radius and length of a rod, radius of a ball [m].
        """
        function = partial(_shape, shape=shape, axes=pose.axes.as_matrix(), centre=pose.origin, size=_floats(size))
        self.visuals.setdefault(body.name, []).append(function)

    def scale_masses(self, total: float) -> None:
        """Scale masses and inertias of all bodies, so that their masses have this sum [kg]."""
        bodies = [member for member in self.members.values() if isinstance(member, Body)]
        factor = total / (sum(body.mass for body in bodies) or np.nan)
        for body in bodies:
            body.mass, body.inertia = body.mass * factor, tuple(factor * np.array(body.inertia))

    def declare_couplings(self) -> None:
        """Declare the couplings of joints as constraints, and let the first joint of each start where they hold."""
        joints: dict[str, Any] = {
            name: item for name, item in self.members.items() if isinstance(item, (Revolute, Prismatic))
        }
        units = {name: "m" if isinstance(joint, Prismatic) else "rad" for name, joint in joints.items()}
        values = {f"{name}_reference": joint.reference for name, joint in joints.items()}
        for coupling in self.couplings:
            for name in {*coupling.terms, *coupling.others}.difference(joints):
                self.refuse(coupling.item, f"joint {shown(name)}: it has no single coordinate")
            for name, parameter in coupling.parameters(units):
                self._declare(coupling.item, name, parameter)
                values[name] = parameter.start
            unit = coupling.units[0] or units[next(iter(coupling.terms))]
            declaration = constraint(unit, coupling.description)(partial(_residual, coupling=coupling))
            self._declare(coupling.item, coupling.name, declaration)

        def at_start(name: str, default: float) -> float:
            return joints[name].start if name in joints else values.get(name, default)

        for _ in self.couplings:  # as those that follow may follow others
            for coupling in self.couplings:
                own = (joint for joint in coupling.terms if joint not in coupling.others)
                name = next(own, next(iter(coupling.terms)))
                factor = coupling.terms[name]
                joints[name].start -= coupling.residual(at_start) / factor
        for coupling in self.couplings:
            if not abs(coupling.residual(at_start)) < 1e-9:
                self.refuse(coupling.item, "it contradicts another coupling at the start; delete one")

    def class_members(self) -> dict[str, Any]:
        """Attributes of the class of a linkage."""
        unknown = next((name for name, is_present in self.leave_out.items() if not is_present), None)
        if unknown is not None:
            self.refuse(f"leave_out = {shown(unknown)}", "the file has nothing of this name that a linkage lacks")
        missing = next((name for name, is_present in self.prescribe.items() if not is_present), None)
        if missing is not None:
            self.refuse(f"prescribe = {shown(missing)}", f"no joint is called so{suggestion(missing, self._joints)}")
        if all(isinstance(item, (Body, Weld)) for item in self.members.values()):
            base = "floating_base=True or --floating-base lets its root link move freely"
            hint = f"; {base}" * (self.document.tag == "robot")
            self.refuse(f"<{self.document.tag}>", f"it has no joint that moves, and a linkage has one{hint}")
        general: dict[str, Any] = {
            "__doc__": f"{self.name}, as {self.path.name} describes it.",
            "__module__": f"_file_{self.path.stem}",
            "left_out": (
                *(f"{count} {key}" for key, count in self.ignored.items()),
                *(f"{', '.join(keys)} of <{tag}>" for tag, keys in self._unread.items()),
                *self.remarks,
            ),
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
        declaration.name, self.members[name] = name, declaration
        if item in self._elements:
            self._elements[name] = self._elements[item]


def identifier(name: str) -> str:
    """Identifier of a name: ``_`` replaces what is no ASCII letter or digit, ``n`` comes before a first digit."""
    word = re.sub(r"\W", "_", name, flags=re.ASCII).strip("_")
    return f"n{word}" if word[:1].isdigit() else word


def rotation_onto(direction: np.ndarray) -> Rotation:
    """Shortest rotation of z onto a unit vector."""
    across = np.array([-direction[1], direction[0], 0.0])
    length = np.linalg.norm(across)
    return Rotation.from_rotvec(np.arctan2(length, direction[2]) * (across / length if length else np.eye(3)[0]))


def roll_pitch_yaw(axes: Rotation) -> tuple[float, ...]:
    """Angles about the fixed x, y and z [rad]; accurate at a pitch of a right angle, too."""
    R = axes.as_matrix()
    yaw = np.arctan2(R[1, 0], R[0, 0]) if np.hypot(R[0, 0], R[1, 0]) > 1e-8 else 0.0
    s, c = np.sin(yaw), np.cos(yaw)
    pitch = np.arctan2(-R[2, 0], c * R[0, 0] + s * R[1, 0])
    return _floats([np.arctan2(s * R[0, 2] - c * R[1, 2], c * R[1, 1] - s * R[0, 1]), pitch, yaw])


def _floats(values: Iterable[Any]) -> tuple[float, ...]:
    return tuple(map(float, values))


def _lines(path: Path) -> list[int]:
    """Lines of all elements of a file."""
    lines: list[int] = []
    parser = expat.ParserCreate()
    parser.StartElementHandler = lambda *_: lines.append(parser.CurrentLineNumber)
    parser.Parse(path.read_bytes(), True)
    return lines


def _residual(m: Any, *, coupling: Coupling) -> ca.SX:
    return coupling.residual(lambda name, default: m.symbols.get(name, default or ca.SX(1, 1)))


def _quotient(unit: str, other: str, power: int) -> str:
    """Unit of a quotient by a power of another unit."""
    power = power - 1 if unit == other else power
    over = f"{other}{power}" if power > 1 else other
    above = "1" if unit == other else unit
    return unit if power < 0 else f"{above}/{over}" if power and other != "1" else above


def _shape(frame: BodyFrame, *, shape: str, axes: np.ndarray, centre: np.ndarray, size: Any) -> Shape:
    def position(point: np.ndarray) -> dict[str, ca.SX]:
        return dict(zip("xyz", ca.vertsplit(frame.position(list(point))), strict=True))

    if shape == "ball":
        return Ball(position(centre), *size)
    if shape == "rod":
        half = axes[:, 2] * size[1] / 2
        return Rod(position(centre - half), position(centre + half), size[0])
    return Box(position(centre), frame.matrix @ ca.SX(ca.sparsify(ca.DM(axes))), size)
