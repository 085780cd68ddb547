"""MJCF: the format of models of MuJoCo."""

from collections.abc import Callable, Iterator
from functools import partial
from math import pi
from pathlib import Path
from typing import Any, TypeAlias, final
from xml.etree.ElementTree import Element

import numpy as np
from scipy.spatial.transform import Rotation

from liaisons import Body, Free, Prismatic, Revolute, Spherical, Weld, ground
from liaisons.base.arguments import shown
from liaisons.errors import suggestion
from liaisons.linkages import BodyJoint
from liaisons_exchange.robot_files.robot import (
    Coupling,
    MassProperties,
    Pose,
    Robot,
    RobotOptions,
    identifier,
    roll_pitch_yaw,
    rotation_onto,
)

_JOINTS: dict[str, type[BodyJoint]] = {"hinge": Revolute, "slide": Prismatic, "ball": Spherical, "free": Free}
_CLOSING: dict[str, type[BodyJoint]] = {"connect": Spherical, "weld": Weld}
_REFUSED = ["frame", "replicate", "attach", "composite", "flexcomp"]
_ORIENTATIONS = ("euler", "axisangle", "xyaxes", "zaxis")
_PLACE = " ".join(("pos", "quat", *_ORIENTATIONS))
_READ = {  # attributes by tag; what others have is listed as left out
    "compiler": "angle autolimits balanceinertia boundinertia boundmass coordinate eulerseq inertiafromgeom "
    "inertiagrouprange settotalmass",
    "option": "gravity density viscosity",
    "flag": "gravity spring damper frictionloss limit equality constraint contact",
    "body": f"name childclass mocap gravcomp {_PLACE}",
    "inertial": f"mass diaginertia fullinertia {_PLACE}",
    "joint": "name class type pos axis range limited ref springref stiffness damping frictionloss armature "
    "springdamper springyield",
    "freejoint": "name",
    "geom": f"name class type size fromto mass density group mesh shellinertia {_PLACE}",
    "equality/connect": "name class body1 body2 anchor active",
    "equality/joint": "name class joint1 joint2 polycoef active",
    "equality/tendon": "name class tendon1 tendon2 polycoef active",
    "equality/weld": "name class body1 body2 relpose active",
    "tendon/fixed": "name class stiffness damping frictionloss armature limited range",
    "tendon/spatial": "name class stiffness damping frictionloss armature limited range",
}
_ACTUATORS = (
    *("general", "motor", "position", "velocity", "intvelocity", "orientation", "pid", "damper", "cylinder"),
    *("muscle", "adhesion", "dcmotor"),
)
_SECTIONS = ["default", "worldbody", "equality"]
_DENSITY = "1000"  # [kg/m3] of a geom without mass


def read_mjcf(path: Path | str, options: RobotOptions) -> Robot:
    """Bodies, joints and shapes of an MJCF file.

    :raises ComponentError: for a file with a wrong value, or with what would move the bodies in another manner.
    """
    robot = Robot(path, "mujoco", options)
    robot.include_files("mujoco", "mujocoinclude")
    _Reader(robot).read()
    return robot


@final
class _Reader:
    """Reader of a document, which declares what it reads in a robot."""

    def __init__(self, robot: Robot) -> None:
        self.robot = robot
        self.compiler, self.flags = self._merged("compiler"), self._merged("option/flag")
        keyword = partial(self._word, "<compiler>", self.compiler)
        self.unit = pi / 180 if keyword("angle", "degree", "radian") == "degree" else 1.0
        self.autolimits = keyword("autolimits", "true", "false") == "true"
        keyword("coordinate", "local")
        self.balances = keyword("balanceinertia", "false", "true") == "true"
        self.from_geoms = keyword("inertiafromgeom", "auto", "true", "false")
        self.sequence = self.compiler.get("eulerseq", "xyz")
        if len(self.sequence) != 3 or set(self.sequence.lower()) - {*"xyz"}:
            robot.refuse("<compiler>", f"eulerseq = {shown(self.sequence)}: it has three letters of xyzXYZ")
        self.groups = robot.numbers("<compiler>", self.compiler, "inertiagrouprange", "0 5", 2)
        self.least = [robot.number("<compiler>", self.compiler, key) for key in ("boundmass", "boundinertia")]
        self.total_mass = robot.number("<compiler>", self.compiler, "settotalmass", "-1")
        self.defaults: dict[str, dict[str, dict[str, str]]] = {"main": {}}
        for element in robot.document.findall("default"):
            self._read_default(element, "main", "main")
            self.defaults[element.get("class", "main")] = self.defaults["main"]
        # The body, its pose in the world, and that of the file's frame, which does not lie at the joint.
        self.bodies: dict[str, tuple[Body, Pose, Pose]] = {"world": (ground, Pose(), Pose())}
        self.joints: dict[str, str] = {}  # their identifiers
        self.tendons: dict[str, dict[str, float]] = {}
        self.fixed: list[Body] = [ground]

    def read(self) -> None:
        """Declare the bodies and joints of the document, and the joints that close loops."""
        robot = self.robot
        self._list_what_is_left_out()
        for world in robot.document.findall("worldbody"):
            self._read_contents(world, ground, Pose(), Pose(), "main")
        self.tendons = dict(map(self._read_tendon, robot.document.findall("tendon/*")))
        for element in robot.document.findall("equality/*"):
            self._read_equality(element)
        robot.declare_couplings()
        if self.total_mass > 0:
            robot.scale_masses(self.total_mass)

    def _list_what_is_left_out(self) -> None:
        """List or refuse what the document has beside bodies, joints and tendons; take its gravity."""
        robot, option = self.robot, self._merged("option")
        for tag in _REFUSED:
            if robot.document.find(f".//{tag}") is not None:
                robot.refuse(f"<{tag}>", "it is not read; write out the bodies that it makes")
        for element in (self.compiler, self.flags, option):
            self._list_unread(element)
        robot.gravity = robot.numbers("<option>", option, "gravity", "0 0 -9.81", 3) * self._has("gravity")
        for medium in ("density", "viscosity"):
            if robot.number("<option>", option, medium):
                why = f"{medium} = {option.get(medium)}: a linkage has no medium that resists motion; delete it"
                robot.leave_out_or_refuse(medium, "<option>", why)
        for section in (section for section in robot.document if section.tag not in _SECTIONS):
            robot.list_unread(section, " ".join(section.attrib) if section.tag in ("compiler", "option") else "")
            robot.ignored.update(f"<{child.tag}> of <{section.tag}>" for child in section if child.tag != "flag")
        if robot.document.find("worldbody//geom") is not None and self._has("contact"):
            robot.remarks.append("contacts between geoms")
        for element in (element for element in robot.document.iter() if element.tag in _ACTUATORS):
            self._check_actuator(element)

    def _word(self, item: str, element: Element, key: str, default: str, *others: str) -> str:
        """Keyword of an attribute, one of these."""
        word = element.get(key, default)
        if word not in (default, *others):
            allowed = " or ".join(map(repr, (default, *others)))
            self.robot.refuse(item, f"{key} = {shown(word)}: only {allowed} is read")
        return word

    def _has(self, flag: str) -> bool:
        """Whether a part of mechanics is not disabled by its flag, or by that of all constraints."""
        of_constraints = flag in ("frictionloss", "limit", "equality", "contact")
        flags = [flag, *["constraint"] * of_constraints]
        return all(self._word("<flag>", self.flags, name, "enable", "disable") == "enable" for name in flags)

    def _list_unread(self, element: Element, group: str = "") -> None:
        key = f"{group}/{element.tag}" if group in ("equality", "tendon") else element.tag
        self.robot.list_unread(element, _READ.get(key, "name class"))

    def _merged(self, tag: str) -> Element:
        """An element with the attributes of all elements of this tag, the last value of each."""
        merged = Element(tag.rpartition("/")[2])
        for element in self.robot.document.findall(tag):
            merged.attrib.update(element.attrib)
        return merged

    def _read_default(self, element: Element, name: str, outer: str) -> None:
        if not name:
            self.robot.refuse(self.robot.item("<default>", element), "it has no class; give it one")
        own = self.defaults.setdefault(name, {})
        for tag in ("joint", "geom", "equality", "tendon"):
            child = element.find(tag)
            own[tag] = self.defaults[outer].get(tag, {}) | ({} if child is None else child.attrib)
        for child in element:
            if child.tag == "default":
                self._read_default(child, child.get("class", ""), name)
            elif child.tag not in own:
                self.robot.ignored[f"<{child.tag}> of <default>"] += 1

    def _resolved(self, item: str, element: Element, childclass: str, tag: str = "") -> Element:
        """The element with its own attributes and those of its default class.

        :param tag: of the defaults; none: its own.
        """
        name = element.get("class", childclass)
        if name not in self.defaults:
            self.robot.refuse(
                item, f"class = {shown(name)}: no <default> is called so{suggestion(name, self.defaults)}"
            )
        resolved = Element(element.tag, self.defaults[name].get(tag or element.tag, {}) | element.attrib)
        self._list_unread(resolved, tag)
        return resolved

    def _pose(self, item: str, element: Element) -> Pose:
        def numbers(key: str, count: int, default: str | None = None) -> np.ndarray:
            return self.robot.numbers(item, element, key, default, count)

        position = numbers("pos", 3, "0 0 0")
        if len(spellings := [key for key in _ORIENTATIONS if key in element.attrib]) > 1:
            self.robot.refuse(item, f"it has {' and '.join(spellings)}; an orientation is given once")
        if "euler" in element.attrib:
            rotation = Rotation.identity()
            for letter, angle in zip(self.sequence, numbers("euler", 3).tolist(), strict=True):
                turn = Rotation.from_euler(letter.lower(), self.unit * angle)
                rotation = rotation * turn if letter.islower() else turn * rotation
            return Pose(rotation, position)
        if "axisangle" in element.attrib:
            *axis, angle = numbers("axisangle", 4)
            return Pose(Rotation.from_rotvec(self.unit * angle * self.robot.unit_vector(item, axis)), position)
        if "xyaxes" in element.attrib:
            x, y = np.split(numbers("xyaxes", 6), 2)
            x, y = self.robot.unit_vector(item, x), self.robot.unit_vector(item, y)
            if np.linalg.norm(np.cross(x, y)) < 1e-10:
                self.robot.refuse(item, f"xyaxes = {shown(element.get('xyaxes'))}: its axes are parallel")
            y = self.robot.unit_vector(item, y - x * (x @ y))
            return Pose(Rotation.from_matrix(np.column_stack([x, y, np.cross(x, y)])), position)
        if "zaxis" in element.attrib:
            return Pose(rotation_onto(self.robot.unit_vector(item, numbers("zaxis", 3))), position)
        quaternion = self.robot.unit_vector(item, numbers("quat", 4, "1 0 0 0"))
        return Pose(Rotation.from_quat(np.roll(quaternion, -1)), position)

    def _read_contents(self, element: Element, body: Body, inner: Pose, world: Pose, childclass: str) -> None:
        """Draw the geoms of a body, and declare the bodies in it.

        :param inner: pose of the file's frame in that of the body; ``world`` in the inertial one.
        """
        for child in element:
            if child.tag == "body":
                self._read_body(child, body, inner, world, childclass)
            elif child.tag == "geom":
                item = self._geom_item(child, body.name)
                self._add_shape(item, self._resolved(item, child, childclass), body, inner)
            elif child.tag not in ("joint", "freejoint", "inertial") or element.tag == "worldbody":
                self.robot.ignored[f"<{child.tag}>"] += 1

    def _read_body(self, element: Element, parent: Body, inner: Pose, world: Pose, childclass: str) -> None:
        """Declare the body of an element, its joints, and what it contains."""
        robot, name = self.robot, element.get("name") or f"body_{len(self.bodies)}"
        item, childclass = robot.item(f"body {shown(name)}", element), element.get("childclass", childclass)
        self._list_unread(element)
        if name in self.bodies:
            robot.refuse(item, "another body has this name; rename it")
        if element.get("mocap", "false") != "false":
            robot.refuse(item, "mocap: let joints hold the body, and prescribe them")
        if robot.number(item, element, "gravcomp"):
            robot.leave_out_or_refuse("gravcomp", item, "gravcomp: weights of a linkage are not compensated; delete it")
        pose = self._pose(item, element)
        originals = [child for child in element if child.tag in ("joint", "freejoint")]
        joints = [self._resolved(item, child, childclass) for child in originals]
        is_fixed = parent in self.fixed and not joints
        if not joints:
            joints = originals = [Element("fixed")]
        anchors = [Pose(origin=robot.numbers(item, joint, "pos", "0 0 0", 3)) for joint in joints]
        if any(_joint_type(joint) == "free" for joint in joints):
            anchors = [Pose()]  # MuJoCo ignores it
            if len(joints) > 1 or parent is not ground:
                robot.refuse(item, "a free joint is alone in a body of the world; delete the others")
        with np.errstate(all="ignore"):  # sizes without bounds are refused with the body
            inertia = self._mass_properties(item, element, childclass, is_fixed=is_fixed)
        last = anchors[-1]
        body = robot.declare_body(name, inertia._replace(centre=inertia.centre - last.origin), "body")
        self.fixed += [body] * is_fixed
        first, step = parent, inner.times(pose).times(anchors[0])
        for i, joint in enumerate(joints):
            own = joint.get("name") or f"{name}_joint{f'_{i + 1}' if i else ''}"
            robot.item(f"joint {shown(own)}", originals[i])
            second = body if i + 1 == len(joints) else robot.declare_body(f"{own}_frame", tag="body")
            self._read_joint(own, joint, (first, second), step)
            if second is not body:
                robot.visuals[second.name] = []  # nothing to be drawn
                first, step = second, anchors[i + 1].relative_to(anchors[i])
        world = world.times(pose)
        self.bodies[name] = body, world.times(last), world
        self._read_contents(element, body, Pose().relative_to(last), world, childclass)

    def _read_joint(self, name: str, element: Element, ends: tuple[Body, Body], pose: Pose) -> None:
        """Declare the joint of an element between two bodies.

        :param pose: of the joint in the first body.
        """
        robot, item, kind = self.robot, f"joint {shown(name)}", _joint_type(element)
        if kind == "fixed":
            robot.declare_joint(Weld, name, ends, pose)
            return
        if kind not in _JOINTS:
            robot.refuse(item, f"type = {shown(kind)}: no joint of MJCF{suggestion(kind, _JOINTS)}")
        more = self._joint_law(item, element, kind)
        if kind in ("hinge", "slide"):
            more["axis"] = tuple(robot.direction(item, element, "axis", "0 0 1"))
        more |= self._joint_limits(item, element, kind)
        robot.declare_joint(_JOINTS[kind], name, ends, pose, **more)
        self.joints[name] = identifier(name)

    def _joint_law(self, item: str, element: Element, kind: str) -> dict[str, Any]:
        """Armature, stiffness, damping and dry friction of a joint, and where its coordinate and spring begin."""
        robot, law = self.robot, dict[str, Any]()
        flags = {"armature": None, "stiffness": "spring", "damping": "damper", "frictionloss": "frictionloss"}
        for key, flag in flags.items():
            value, *higher = robot.numbers(item, element, key, "0", 1, 2, 3, minimum=0)
            law[key] = value * (flag is None or self._has(flag))
            if any(higher):
                robot.refuse(item, f"{key} = {shown(element.get(key))}: delete all but the first number")
        for key in [*["springdamper"] * self._has("spring"), *["springyield"] * bool(law["stiffness"])]:
            if robot.numbers(item, element, key, "0", 1, 2).any():
                robot.leave_out_or_refuse(key, item, f"{key}: springs of a linkage have one stiffness; delete it")
        lacking = {"free": [*law], "ball": ["stiffness", "frictionloss"]}.get(kind, [])
        for key in (key for key in lacking if law[key]):
            why = f"{key} = {law[key]:g}: a {kind} joint of a linkage has none; set it to 0"
            robot.leave_out_or_refuse(key, item, why)
            del law[key]
        law["friction"] = law.pop("frictionloss", 0.0)
        if kind in ("hinge", "slide"):
            unit = self.unit if kind == "hinge" else 1.0
            law["reference"] = law["start"] = unit * robot.number(item, element, "ref")
            law["unstressed"] = unit * robot.number(item, element, "springref") * bool(law["stiffness"])
        return law

    def _check_actuator(self, element: Element) -> None:
        """Refuse armature and damping of an actuator, or of actuators by default."""
        for key in (key for key in ("armature", "damping") if key in element.attrib):
            item = self.robot.item(f"{element.tag} {shown(element.get('name', 'without name'))}", element)
            if self.robot.numbers(item, element, key, "0", 1, 2, 3).any():
                why = f"{key} = {shown(element.get(key))}: actuators are left out; give it to the joint"
                self.robot.leave_out_or_refuse(key, item, why)

    def _read_tendon(self, element: Element) -> tuple[str, dict[str, float]]:
        """Name of a tendon, and the factors of its joints; none of one through space."""
        robot, name = self.robot, element.get("name") or f"tendon_{len(self.tendons)}"
        item = robot.item(f"{element.tag} tendon {shown(name)}", element)
        resolved = self._resolved(item, element, "main", "tendon")
        flags = {"armature": None, "stiffness": "spring", "damping": "damper", "frictionloss": "frictionloss"}
        for key, flag in flags.items():
            if robot.numbers(item, resolved, key, "0", 1, 2, 3).any() and (flag is None or self._has(flag)):
                why = f"{key} = {resolved.get(key)}: tendons of a linkage exert no force; delete it"
                robot.leave_out_or_refuse(key, item, why)
        limited = self._word(item, resolved, "limited", "auto", "true", "false")
        if self._has("limit") and (limited == "true" or (limited == "auto" and "range" in resolved.attrib)):
            robot.leave_out_or_refuse("range", item, "range: tendons of a linkage have no limits; delete it")
        terms: dict[str, float] = {}
        for joint in element.findall("joint") if element.tag == "fixed" else ():
            own = joint.get("joint", "")
            if own not in self.joints:
                robot.refuse(item, f"{shown(own)} is no joint{suggestion(own, self.joints)}")
            terms[self.joints[own]] = robot.number(item, joint, "coef", None)
        return name, terms

    def _joint_limits(self, item: str, element: Element, kind: str) -> dict[str, Any]:
        """Limits of a joint, if it has any."""
        limited = self._word(item, element, "limited", "auto", "true", "false")
        text = shown(element.get("range"))
        low, high = self.robot.numbers(item, element, "range", "0 0", 2) * (1.0 if kind == "slide" else self.unit)
        if limited == "auto" and "range" in element.attrib and not self.autolimits:
            self.robot.refuse(item, f"range = {text}: it needs limited='true' or 'false', as autolimits is 'false'")
        if limited == "true" and not low < high:
            self.robot.refuse(item, f"range = {text}: the lower limit comes first")
        if limited == "false" or low >= high or kind == "free" or not self._has("limit"):
            return {}
        if kind == "ball":
            self.robot.remarks.append(f"limit of {item}, which is a ball joint")
            return {}
        return {"limits": (low, high)}

    def _mass_properties(self, item: str, element: Element, childclass: str, *, is_fixed: bool) -> MassProperties:
        """MassProperties of a body: as its <inertial> says, else the sum over its geoms; then as the compiler asks."""
        inertial, robot, text = element.find("inertial"), self.robot, ""
        if inertial is None or (self.from_geoms == "true" and element.find("geom") is not None):
            named = [(self._geom_item(geom, item), geom) for geom in element.findall("geom")]
            geoms = [(label, self._resolved(label, geom, childclass)) for label, geom in named]
            of_groups = [g for g in geoms if self.groups[0] <= robot.number(*g, "group") <= self.groups[1]]
            parts = [part for g in of_groups for part in self._geom_mass_properties(*g, is_fixed=is_fixed)]
            mass, centre, tensor = _total_mass_properties(parts if self.from_geoms != "false" else [])
            pose = Pose(origin=centre)
        else:
            self._list_unread(inertial)
            pose, mass = self._pose(item, inertial), robot.number(item, inertial, "mass", None)
            key, count = ("fullinertia", 6) if "fullinertia" in inertial.attrib else ("diaginertia", 3)
            numbers, text = robot.numbers(item, inertial, key, None, count), inertial.get(key, "")
            tensor = np.diag(numbers) if count == 3 else numbers[[[0, 3, 4], [3, 1, 5], [4, 5, 2]]]
        least_mass, least_moment = self.least
        if least_moment > 0 and np.isfinite(tensor).all():
            moments, axes = np.linalg.eigh(tensor)
            tensor = axes @ np.diag(np.maximum(moments, least_moment)) @ axes.T
        tensor = robot.balanced(item, tensor, text, mass, mean=self.balances)
        mass = max(mass, least_mass) if least_mass else mass
        return MassProperties(mass, pose.origin, pose.rotated_tensor(tensor))

    def _geom_item(self, geom: Element, owner: str) -> str:
        return self.robot.item(f"geom {shown(geom.get('name', 'without name'))} of {owner}", geom)

    def _geometry(self, item: str, geom: Element) -> tuple[str, np.ndarray, Pose]:
        """Kind, half sizes and pose of a geom; no sizes for a kind without a volume."""
        kind = "mesh" if "mesh" in geom.attrib else geom.get("type", "sphere")
        if kind not in _SOLIDS:
            return kind, np.zeros(3), Pose()
        count = _SOLIDS[kind][0]
        if "fromto" not in geom.attrib:
            size = self.robot.numbers(item, geom, "size", None, *range(count, 4), minimum=0)
            return kind, size[:count], self._pose(item, geom)
        first, last = np.split(self.robot.numbers(item, geom, "fromto", None, 6), 2)
        radius = self.robot.numbers(item, geom, "size", None, 1, 2, 3, minimum=0)[0]
        size = np.array([*[radius] * (count - 1), np.linalg.norm(last - first) / 2])
        return kind, size, Pose(rotation_onto(self.robot.unit_vector(item, last - first)), (first + last) / 2)

    def _geom_mass_properties(self, item: str, geom: Element, *, is_fixed: bool) -> Iterator[MassProperties]:
        """MassProperties of a geom; none for one without mass, or whose mass never moves and cannot be computed."""
        kind, size, pose = self._geometry(item, geom)
        mass = self.robot.number(item, geom, "mass", "0", minimum=0)
        density = 0.0 if "mass" in geom.attrib else self.robot.number(item, geom, "density", _DENSITY, minimum=0)
        if not (mass or density):
            return
        if is_fixed and kind not in _SOLIDS:
            return
        if kind not in _SOLIDS or geom.get("shellinertia", "false") != "false":
            self.robot.refuse(item, f"the mass of its geom of type {shown(kind)} is not computed; give <inertial>")
        volume, squares = _SOLIDS[kind][1](*size)
        mass = mass or density * volume
        yield MassProperties(mass, pose.origin, pose.rotated_tensor(mass * np.diag(sum(squares) - np.array(squares))))

    def _add_shape(self, item: str, geom: Element, body: Body, inner: Pose) -> None:
        """Add a geom to the picture of a body, or note that it is left out."""
        kind, size, pose = self._geometry(item, geom)
        if kind not in _SOLIDS:
            self.robot.ignored[f"<geom> of type {kind}"] += 1
            return
        if kind == "box":
            shape, lengths = "box", 2 * size
        elif len(size) == 2:
            shape, lengths = "rod", size * [1, 2]
        else:
            shape, lengths = "ball", size.mean(keepdims=True)
        self.robot.add_shape(body, shape, inner.times(pose), lengths)

    def _read_equality(self, element: Element) -> None:
        """Declare the joint that an equality constraint stands for."""
        robot = self.robot
        name = element.get("name") or f"{element.tag}_{len(robot.members) + len(robot.couplings)}"
        item, owner = robot.item(f"{element.tag} {shown(name)}", element), element.get("body1", "")
        element = self._resolved(item, element, "main", "equality")
        if self._word(item, element, "active", "true", "false") == "false" or not self._has("equality"):
            robot.remarks.append(f"{item}, which is not active")
            return
        if element.tag in ("joint", "tendon"):
            self._couple(name, item, element)
            return
        if element.tag not in _CLOSING or not owner or "relpose" in element.attrib:
            robot.refuse(item, "of equalities only connect and weld of bodies, at the start, are joints; delete it")
        names = [owner, element.get("body2", "world")]
        for body in names:
            if body not in self.bodies:
                robot.refuse(item, f"{shown(body)} is no body{suggestion(body, self.bodies)}")
        if names[1] == "world":
            names.reverse()
        (first, outer, _), (second, inner, _) = (self.bodies[body] for body in names)
        pose = self.bodies[owner][2]
        if element.tag == "connect":
            pose = pose.times(Pose(origin=robot.numbers(item, element, "anchor", None, 3)))
        far = pose.relative_to(inner)
        angles, position = roll_pitch_yaw(far.axes), tuple(map(float, far.origin))
        robot.declare_joint(
            _CLOSING[element.tag],
            robot.free_name(item, identifier(name), element.tag, robot.members),
            (first, second),
            pose.relative_to(outer),
            at_child=position,
            rotation_child=angles,
        )

    def _couple(self, name: str, item: str, element: Element) -> None:
        """Declare the coupling of two joints or fixed tendons, or the value of one."""
        robot, sides = self.robot, [dict[str, float](), dict[str, float]()]
        references = {name: {joint: 1.0} for name, joint in self.joints.items()}
        known = references if element.tag == "joint" else self.tendons
        for i, key in enumerate((f"{element.tag}1", f"{element.tag}2")):
            if (own := element.get(key)) is not None and not known.get(own):
                robot.refuse(
                    item,
                    f"{shown(own)} is no {'fixed ' * (element.tag == 'tendon')}{element.tag}{suggestion(own, known)}",
                )
            sides[i] = known[own] if own is not None else {}
        if not sides[0]:
            robot.refuse(item, f"it has no {element.tag}1")
        given = robot.numbers(item, element, "polycoef", "0 1", 1, 2, 3, 4, 5)
        polynomial = [*given, *[0.0, 1.0, 0.0, 0.0, 0.0][len(given) :]]
        own_name = robot.free_name(item, identifier(name), f"{element.tag}s", robot.members)
        units = ("", "") if element.tag == "joint" else ("m", "m")
        robot.couplings.append(Coupling(item, own_name, sides[0], sides[1], tuple(polynomial), units))


def _joint_type(joint: Element) -> str:
    return {"freejoint": "free", "fixed": "fixed"}.get(joint.tag) or joint.get("type", "hinge")


def _total_mass_properties(parts: list[MassProperties]) -> MassProperties:
    """MassProperties of rigidly joined parts, by the parallel axes theorem."""
    mass = sum(part.mass for part in parts)
    if not mass:
        return MassProperties()
    centre = np.sum([part.mass * part.centre for part in parts], axis=0) / mass
    tensor = np.zeros((3, 3))
    for part in parts:
        offset = part.centre - centre
        tensor += part.tensor + part.mass * (offset @ offset * np.eye(3) - np.outer(offset, offset))
    return MassProperties(mass, centre, tensor)


_VolumeMoments: TypeAlias = tuple[float, tuple[float, float, float]]
"""Volume [m3], and means of the squares of the own coordinates [m2]."""


def _ellipsoid_moments(a: float, b: float, c: float) -> _VolumeMoments:
    return 4 / 3 * pi * a * b * c, (a**2 / 5, b**2 / 5, c**2 / 5)


def _cylinder_moments(radius: float, half: float) -> _VolumeMoments:
    return 2 * pi * radius**2 * half, (radius**2 / 4, radius**2 / 4, half**2 / 3)


def _capsule_moments(radius: float, half: float) -> _VolumeMoments:
    """Moments of a cylinder with half a ball at either end."""
    (ball, (square, *_)), (middle, (across, _, along)) = (
        _ellipsoid_moments(radius, radius, radius),
        _cylinder_moments(radius, half),
    )
    ends, whole = square + half**2 + 0.75 * radius * half, ball + middle
    across = (ball * square + middle * across) / whole
    return whole, (across, across, (ball * ends + middle * along) / whole)


_SOLIDS: dict[str, tuple[int, Callable[..., _VolumeMoments]]] = {  # count of half sizes
    "sphere": (1, lambda r: _ellipsoid_moments(r, r, r)),
    "capsule": (2, _capsule_moments),
    "cylinder": (2, _cylinder_moments),
    "box": (3, lambda a, b, c: (8 * a * b * c, (a**2 / 3, b**2 / 3, c**2 / 3))),
    "ellipsoid": (3, _ellipsoid_moments),
}
