"""URDF: the Unified Robot Description Format."""

from pathlib import Path
from typing import Any
from xml.etree.ElementTree import Element

import numpy as np
from scipy.spatial.transform import Rotation

from liaisons import Body, Free, Planar, Prismatic, Revolute, Weld, ground
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
    rotation_onto,
)

_JOINTS: dict[str, type[BodyJoint]] = {
    "revolute": Revolute,
    "continuous": Revolute,
    "prismatic": Prismatic,
    "fixed": Weld,
    "floating": Free,
    "planar": Planar,
}
_SHAPES = {"box": "box", "cylinder": "rod", "capsule": "rod", "sphere": "ball"}
_READ = {  # attributes by tag; elements and attributes that are not here are listed as left out
    "robot": "name version",
    "link": "name",
    "joint": "name type",
    "inertial": "",
    "mass": "value",
    "inertia": "ixx ixy ixz iyy iyz izz",
    "visual": "name",
    "geometry": "",
    "box": "size",
    "cylinder": "radius length",
    "capsule": "radius length",
    "sphere": "radius",
    "parent": "link",
    "child": "link",
    "origin": "xyz rpy quat_xyzw",
    "axis": "xyz",
    "limit": "lower upper",
    "dynamics": "damping friction",
    "mimic": "joint multiplier offset",
}


def read_urdf(path: Path | str, options: RobotOptions) -> Robot:
    """Bodies, joints and shapes of a URDF file, whose root link is the ground, or moves freely.

    :raises ComponentError: for a file that is no tree of links, or has a value that no robot has.
    """
    robot = Robot(path, "robot", options)
    _refuse_xacro(robot)
    links, joints = _elements_by_name(robot, "link"), _elements_by_name(robot, "joint")
    _list_unread(robot, robot.document)
    inner: dict[str, str] = {}
    ends = {name: _link_names(robot, name, element, links) for name, element in joints.items()}
    for name, (_, child) in ends.items():
        if child in inner:
            both = f"joints {shown(inner[child])} and {shown(name)}"
            robot.refuse(f"link {shown(child)}", f"{both} hold it; URDF has trees alone")
        inner[child] = name
    roots = [name for name in links if name not in inner]
    if links and len(roots) != 1:
        why = f"{shown(roots)} have no joint to a parent" if roots else "the joints make a circle"
        robot.refuse(robot.item("its links", links[(roots or [*links])[-1]]), f"{why}; one is the root")
    is_ground = dict.fromkeys(roots * (not options.floating_base), ground)
    bodies = {name: is_ground.get(name) or _declare_body(robot, name, element) for name, element in links.items()}
    if options.floating_base and roots:
        robot.declare_joint(Free, "floating_base", (ground, bodies[roots[0]]), Pose())
    for name, element in links.items():
        _add_shapes(robot, f"link {shown(name)}", bodies[name], element)
    for name, element in joints.items():
        parent, child = ends[name]
        _declare_joint(robot, name, element, (bodies[parent], bodies[child]))
    for name, element in joints.items():
        _couple(robot, name, element, joints)
    robot.declare_couplings()
    return robot


def _refuse_xacro(robot: Robot) -> None:
    for element in robot.document.iter():
        if "xacro" in element.tag.partition("}")[0] or any("${" in value for value in element.attrib.values()):
            tag = element.tag.rpartition("}")[2]
            robot.refuse(robot.item(f"<{tag}>", element), "it is one of xacro; expand it with xacro first")


def _list_unread(robot: Robot, element: Element) -> None:
    """List elements and attributes that are not read, and what is in those that are."""
    robot.list_unread(element, _READ[element.tag])
    for child in element:
        if child.tag not in _READ:
            picture = " of a picture" * (element.tag == "geometry")
            robot.ignored[f"<{child.tag}>{picture}"] += 1
        else:
            _list_unread(robot, child)


def _elements_by_name(robot: Robot, tag: str) -> dict[str, Element]:
    elements: dict[str, Element] = {}
    for i, element in enumerate(robot.document.findall(tag), start=1):
        name = element.get("name", "")
        robot.item(f"{tag} {shown(name)}", element)
        if not name or name in elements:
            robot.refuse(robot.item(f"<{tag}> {i}", element), f"name = {shown(name)}: each has a name of its own")
        elements[name] = element
    return elements


def _link_names(robot: Robot, name: str, element: Element, links: dict[str, Element]) -> list[str]:
    """Names of the parent and child links of a joint."""
    item = f"joint {shown(name)}"
    ends = {tag: _child_or_empty(element, tag).get("link", "") for tag in ("parent", "child")}
    for tag, link in ends.items():
        if link not in links:
            robot.refuse(item, f"its {tag} {shown(link)} is no link{suggestion(link, links)}")
    return [*ends.values()]


def _pose(robot: Robot, item: str, element: Element) -> Pose:
    origin = _child_or_empty(element, "origin")
    position, angles = (robot.numbers(item, origin, key, "0 0 0", 3) for key in ("xyz", "rpy"))
    if "quat_xyzw" in origin.attrib:
        if "rpy" in origin.attrib:
            robot.refuse(item, "it has rpy and quat_xyzw; an orientation is given once")
        quaternion = robot.unit_vector(item, robot.numbers(item, origin, "quat_xyzw", None, 4))
        return Pose(Rotation.from_quat(quaternion), position)
    return Pose(Rotation.from_euler("xyz", angles), position)


def _declare_body(robot: Robot, name: str, link: Element) -> Body:
    inertial, item = link.find("inertial"), f"link {shown(name)}"
    if inertial is None:
        return robot.declare_body(name)
    pose, element = _pose(robot, item, inertial), _child_or_empty(inertial, "inertia")
    moments = np.array([[robot.number(item, element, f"i{min(i, j)}{max(i, j)}") for j in "xyz"] for i in "xyz"])
    mass = robot.number(item, _child_or_empty(inertial, "mass"), "value", None)
    moments = robot.balanced(item, moments, " ".join(element.get(key, "0") for key in _READ["inertia"].split()), mass)
    return robot.declare_body(name, MassProperties(mass, pose.origin, pose.rotated_tensor(moments)))


def _add_shapes(robot: Robot, item: str, body: Body, link: Element) -> None:
    """Add the visuals of a link to the picture of its body."""
    for visual in link.findall("visual"):
        for shape in _child_or_empty(visual, "geometry"):
            if shape.tag not in _SHAPES:
                continue
            keys = [key for key in ("size", "radius", "length") if key in shape.attrib]
            size = [x for key in keys for x in robot.numbers(item, shape, key, None, 1, 3, minimum=0)]
            if len(size) != {"box": 3, "rod": 2, "ball": 1}[_SHAPES[shape.tag]]:
                robot.refuse(item, f"<{shape.tag}> has the attributes {shown(shape.attrib)}: lengths are missing")
            robot.add_shape(body, _SHAPES[shape.tag], _pose(robot, item, visual), size)


def _declare_joint(robot: Robot, name: str, element: Element, ends: tuple[Body, Body]) -> None:
    """Declare a joint; a planar one by three, with the frame turned into its plane and back."""
    item, word = f"joint {shown(name)}", element.get("type", "")
    if word in ("floating", "planar") and element.find("limit") is not None:
        robot.remarks.append(f"limits of {item}, which has several coordinates")
    if word not in _JOINTS:
        robot.refuse(item, f"type = {shown(word)}: no joint of URDF{suggestion(word, _JOINTS)}")
    kind, pose = _JOINTS[word], _pose(robot, item, element)
    limit, dynamics = _child_or_empty(element, "limit"), _child_or_empty(element, "dynamics")
    axis = robot.direction(
        item, _child_or_empty(element, "axis") if word not in ("fixed", "floating") else dynamics, "xyz", "1 0 0"
    )
    if kind in (Revolute, Prismatic):
        more: dict[str, Any] = {key: robot.number(item, dynamics, key, minimum=0) for key in ("damping", "friction")}
        if word != "continuous" and limit.attrib:
            more["limits"] = [robot.number(item, limit, key) for key in ("lower", "upper")]
        robot.declare_joint(kind, name, ends, pose, axis=tuple(axis), **more)
        return
    if dynamics.attrib:
        robot.remarks.append(f"damping and friction of {item}, which has several coordinates or none")
    if kind is Planar:
        # Ours lies in the plane of x and y: the frame is turned into the plane, and back behind the joint.
        plane, middle = Pose(rotation_onto(axis)), robot.declare_body(f"{name}_plane")
        robot.declare_joint(Planar, name, (ends[0], middle), pose.times(plane))
        robot.declare_joint(Weld, f"{name}_behind", (middle, ends[1]), Pose().relative_to(plane))
    else:
        robot.declare_joint(kind, name, ends, pose)


def _couple(robot: Robot, name: str, element: Element, joints: dict[str, Element]) -> None:
    """Let a joint follow the one that it mimics."""
    mimic, item = element.find("mimic"), f"joint {shown(name)}"
    if mimic is None or element.get("type") == "fixed":
        return
    leader = mimic.get("joint", "")
    if leader not in joints:
        robot.refuse(item, f"it mimics {shown(leader)}, which is no joint{suggestion(leader, joints)}")
    own, other = identifier(name), identifier(leader)
    polynomial = robot.number(item, mimic, "offset"), robot.number(item, mimic, "multiplier", "1")
    robot.couplings.append(Coupling(item, f"{own}_mimic", {own: 1.0}, {other: 1.0}, polynomial))


def _child_or_empty(element: Element, tag: str) -> Element:
    child = element.find(tag)
    return Element(tag) if child is None else child
