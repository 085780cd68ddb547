"""Linkages of URDF and MJCF files against matrices that are multiplied without them."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import casadi as ca
import numpy as np
import pytest
from robot_peers import MujocoFile, PinocchioFile, distances
from scipy.spatial.transform import Rotation

from liaisons import Linkage, Rod, build, derive, operator, simulate
from liaisons.errors import ComponentError
from liaisons.models import Sinusoid

ROBOTS = Path(__file__).parent / "robots"
URDF = ["ur5.urdf", "panda.urdf", "a1_leg.urdf"]
LINK = '<link name="{}"><inertial><mass value="{}"/><inertia ixx="1" iyy="1" izz="1"/></inertial></link>'
JOINT = '<joint name="{}" type="{}"><parent link="{}"/><child link="{}"/>{}</joint>'


def numbers(element: Any, key: str, default: str = "0 0 0") -> np.ndarray:
    return np.array([float(word) for word in (element.get(key, default) if element is not None else default).split()])


def transform(element: Any) -> np.ndarray:
    """Homogeneous transform of an <origin>."""
    origin, matrix = element.find("origin"), np.eye(4)
    matrix[:3, :3] = Rotation.from_euler("xyz", numbers(origin, "rpy")).as_matrix()
    matrix[:3, 3] = numbers(origin, "xyz")
    return matrix


def by_products(path: Path, q: dict[str, float], rates: list[str]) -> tuple[dict[str, np.ndarray], np.ndarray]:
    """Poses of the links, and the mass matrix as the sum of m Jᵀ J + Jᵀ R I Rᵀ J; read and computed here alone."""
    robot: Any = ElementTree.parse(path).getroot()
    poses: dict[Any, Any] = {}
    columns: dict[Any, list[Any]] = {}  # by link: name of a rate, angular velocity, velocity and its point
    joints = robot.findall("joint")
    children = {j.find("child").get("link") for j in joints}
    for link in robot.findall("link"):
        if link.get("name") not in children:
            poses[link.get("name")], columns[link.get("name")] = np.eye(4), []
    while joints:
        joint = next(j for j in joints if j.find("parent").get("link") in poses)
        joints.remove(joint)
        name, parent = joint.get("name"), joint.find("parent").get("link")
        pose = poses[parent] @ transform(joint)
        moves, own = np.eye(4), []
        if joint.get("type") == "floating":
            quaternion = [q[f"{name}_q_{x}"] for x in "xyzw"]
            moves[:3, :3] = Rotation.from_quat(quaternion).as_matrix()
            moves[:3, 3] = [q[f"{name}_{x}"] for x in "xyz"]
            own = [(f"{name}_{x}", np.zeros(3), pose[:3, i]) for i, x in enumerate("xyz")]
            body = pose @ moves
            own += [(f"{name}_omega_{x}", body[:3, i], np.zeros(3)) for i, x in enumerate("xyz")]
        elif joint.get("type") == "prismatic":
            axis = numbers(joint.find("axis"), "xyz", "1 0 0")
            moves[:3, 3] = q[name] * axis / np.linalg.norm(axis)
            own = [(name, np.zeros(3), pose[:3, :3] @ axis / np.linalg.norm(axis))]
        elif joint.get("type") in ("revolute", "continuous"):
            axis = numbers(joint.find("axis"), "xyz", "1 0 0")
            axis /= np.linalg.norm(axis)
            moves[:3, :3] = Rotation.from_rotvec(q[name] * axis).as_matrix()
            own = [(name, pose[:3, :3] @ axis, np.zeros(3))]
        child = joint.find("child").get("link")
        poses[child] = pose @ moves
        columns[child] = columns[parent] + [(*column, poses[child][:3, 3]) for column in own]
    return poses, mass_matrix_of(robot, poses, columns, rates)


def mass_matrix_of(
    robot: Any, poses: dict[str, np.ndarray], columns: dict[str, list[Any]], rates: list[str]
) -> np.ndarray:
    mass_matrix = np.zeros((len(rates), len(rates)))
    for link in robot.findall("link"):
        inertial = link.find("inertial")
        if inertial is None:
            continue
        centre = poses[link.get("name")] @ transform(inertial)
        tensor = np.zeros((3, 3))
        for i, j in ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2)):
            value = inertial.find("inertia").get(f"i{'xyz'[i]}{'xyz'[j]}")
            tensor[i, j] = tensor[j, i] = float(value)
        J = np.zeros((6, len(rates)))
        for name, omega, v, point in columns[link.get("name")]:
            J[:, rates.index(name)] = [*omega, *(v + np.cross(omega, centre[:3, 3] - point))]
        mass = float(inertial.find("mass").get("value"))
        R = centre[:3, :3]
        mass_matrix += mass * J[3:].T @ J[3:] + J[:3].T @ R @ tensor @ R.T @ J[:3]
    return mass_matrix


def state_of(tree: type[Linkage], seed: int) -> dict[str, float]:
    rng = np.random.default_rng(seed)
    state = {q.name: float(rng.uniform(-2, 2)) for q in tree.coordinates}
    for orientation in tree.orientations:
        q = rng.normal(size=4)
        state |= dict(zip(orientation.quaternion, (q / np.linalg.norm(q)).tolist(), strict=True))
    return state


def rates_of(tree: type[Linkage]) -> list[str]:
    return [*(q.name for q in tree.coordinates), *(name for o in tree.orientations for name in o.rates)]


def mass_matrix(tree: type[Linkage], state: dict[str, float]) -> np.ndarray:
    rates = {f"{q.name}_dot": 0.1 for q in tree.coordinates} | dict.fromkeys(rates_of(tree), 0.1)
    return np.array(derive(tree).evaluate("mass_matrix", **{**rates, **state}))


def poses_of(tree: type[Linkage], state: dict[str, float]) -> dict[str, np.ndarray]:
    m = tree()
    values = {**m.start_values(), **state}
    frames = {frame.body.name: m.frame_of(frame.body) for frame in m.frames if frame.body}
    symbols = [symbol for name, symbol in m.symbols.items() if name in values]
    function = ca.Function(
        "poses", symbols, [ca.densify(ca.horzcat(frame.matrix, frame.origin)) for frame in frames.values()]
    )
    result = function(*(values[str(symbol)] for symbol in symbols))
    return dict(zip(frames, map(np.array, result if isinstance(result, (list, tuple)) else [result]), strict=True))


def assert_equal(got: np.ndarray, expected: np.ndarray, digits: float = 1e-12) -> None:
    np.testing.assert_allclose(got, expected, rtol=0, atol=digits * np.abs(expected).max())


def imported(name: str, **options: Any) -> type[Linkage]:
    path = ROBOTS / name
    return (Linkage.from_urdf if path.suffix == ".urdf" else Linkage.from_mjcf)(path, **options)


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("name", URDF)
def test_kinematics_and_mass_matrix_are_products_of_transforms(name: str, seed: int) -> None:
    tree = imported(name)
    state = state_of(tree, seed)
    poses, expected = by_products(ROBOTS / name, state, rates_of(tree))
    own = poses_of(tree, state)
    assert len(own) == len(poses) - 1  # all but the ground
    for body, pose in own.items():
        assert_equal(pose, poses[body][:3])
    assert_equal(mass_matrix(tree, state), expected)


def test_the_same_robot_in_both_formats() -> None:
    first, second = imported("panda.urdf"), imported("panda.xml")
    assert [q.name for q in first.coordinates] == [q.name for q in second.coordinates]
    equations, others = derive(first), derive(second)
    for seed in range(3):
        state = state_of(first, seed) | {f"{q.name}_dot": 0.3 for q in first.coordinates}
        for quantity in ("mass_matrix", "accelerations"):
            got, expected = equations.evaluate(quantity, **state), others.evaluate(quantity, **state)
            scale = 1 if quantity == "mass_matrix" else np.linalg.cond(equations.evaluate("mass_matrix", **state))
            assert_equal(np.array(got), np.array(expected), 1e-12 * scale)


@pytest.mark.parametrize(
    ("name", "prescribe"),
    [("ur5.urdf", ["shoulder_pan", "elbow"]), ("panda.xml", ["joint2", "joint4"]), ("a1_leg.urdf", ["FL_hip_joint"])],
)
@pytest.mark.variants(core=0)
def test_fmus_keep_the_energy_account(name: str, prescribe: list[str], tmp_path: Path) -> None:
    tree = imported(name, prescribe=prescribe)
    assert [active.name for active in tree.actives] == prescribe
    moved = {joint: operator(Sinusoid, amplitude=0.3, angular_frequency=2.0) for joint in prescribe}
    settings: dict[str, Any] = {"stop_time": 0.5, "step_size": 0.02, "tolerance": 1e-12, "input_reconstruction": 2}
    result = simulate(build(tree, tmp_path), **moved, **settings)
    assert np.abs(result["energy_balance"]).max() <= 1e-9 * max(1.0, np.abs(result["energy"]).max())
    assert all(np.ptp(result[f"{joint}_force"]) > 0 for joint in prescribe)


def test_limits_are_stops_if_requested() -> None:
    assert not imported("panda.urdf").unilaterals
    with_stops = imported("panda.urdf", limits=True, prescribe=["joint1"])
    assert [u.name for u in with_stops.unilaterals][:2] == ["joint2_above", "joint2_below"]
    starts = {q.name: q.start for q in with_stops.coordinates}
    assert starts["joint4"] == pytest.approx(-1.5708)  # 0 is outside -3.0718 .. -0.0698
    assert starts["joint2"] == 0
    assert len(imported("panda.xml", limits=True).unilaterals) == len(imported("panda.urdf", limits=True).unilaterals)
    assert not any("limits" in line for line in with_stops.left_out)


def test_limits_that_leave_no_motion_are_named(tmp_path: Path) -> None:
    """Both are 0 where the file has an effort alone."""
    joint = JOINT.format("j", "revolute", "a", "b", '<limit effort="1"/>')
    for limits in (False, True):
        tree = urdf(tmp_path, *GOOD, joint, limits=limits)
        assert set(tree.left_out) == {"limits of joint 'j', which are both 0", "effort of <limit>"}
        assert not tree.unilaterals


def test_what_is_left_out_is_named() -> None:
    assert set(imported("ur5.urdf").left_out) == {
        "1 <transmission>",
        "1 <gazebo>",
        "6 <collision>",
        "1 <mesh> of a picture",
        "6 limits of joints (limits=True or --limits makes stops of them)",
        "effort, velocity of <limit>",
    }
    assert {"2 <motor> of <actuator>", "1 <jointpos> of <sensor>", "1 <light>"} < set(imported("panda.xml").left_out)


def test_shapes_of_links_are_drawn() -> None:
    shapes = [type(shape).__name__ for shape in imported("a1_leg.urdf")().picture()]
    assert shapes.count("Box") == 1  # the trunk
    assert shapes[-3:] == ["Box", "Rod", "Ball"]
    assert shapes.count("Ball") == 3  # thigh, calf, and the foot's sphere: what has no shape has a ball


def test_a_cylinder_is_a_rod_of_its_length(tmp_path: Path) -> None:
    geom = '<geom type="cylinder" size="0.1 0.7" pos="0 0 3" xyaxes="0 1 0 0 0 1"/>'  # along x
    m = mjcf(tmp_path, f'<body name="b"><joint name="j" axis="1 0 0"/>{geom}</body>')()
    (rod,) = (shape for shape in m.picture() if isinstance(shape, Rod))
    ends = [[float(ca.evalf(ca.substitute(x, m.free.q, 0))) for x in end.values()] for end in (rod.start, rod.end)]
    np.testing.assert_allclose(ends, [[-0.7, 0, 3], [0.7, 0, 3]], rtol=0, atol=1e-15)  # rounding of a rotation


# ---- small files ---------------------------------------------------------------------------------------------------


def urdf(tmp_path: Path, *lines: str, head: str = '<robot name="r">', **options: Any) -> type[Linkage]:
    path = tmp_path / "r.urdf"
    path.write_text("\n".join([head, *lines, "</robot>"]), encoding="utf-8")
    return Linkage.from_urdf(path, **options)


def mjcf(tmp_path: Path, text: str, before: str = "", after: str = "", **options: Any) -> type[Linkage]:
    path = tmp_path / "m.xml"
    path.write_text(f"<mujoco>{before}<worldbody>{text}</worldbody>{after}</mujoco>", encoding="utf-8")
    return Linkage.from_mjcf(path, **options)


def test_what_moves_the_bodies_is_left_out_by_its_name_alone(tmp_path: Path) -> None:
    body, option = '<body name="b"><joint name="j"/><geom size="1"/></body>', '<option wind="1 0 0" density="1.2"/>'
    with pytest.raises(ComponentError, match=r"line 1: <option>: density = 1.2: .*; or leave it out: leave_out=.*dens"):
        mjcf(tmp_path, body, option)
    tree = mjcf(tmp_path, body, option, leave_out=["density"])
    assert {"density of <option>, on request", "wind of <option>"} <= set(tree.left_out)
    with pytest.raises(ComponentError, match="leave_out = 'viscosity': the file has nothing of this name"):
        mjcf(tmp_path, body, option, leave_out=["density", "viscosity"])


def test_a_planar_joint_moves_in_the_plane_of_its_normal(tmp_path: Path) -> None:
    origin = '<origin xyz="0 0 1" rpy="0 0.3 0"/><axis xyz="2 1 2"/>'
    lines = LINK.format("a", 1), LINK.format("b", 2), JOINT.format("j", "planar", "a", "b", origin)
    tree = urdf(tmp_path, *lines)
    own = Rotation.from_euler("xyz", [0, 0.3, 0])
    normal = own.apply([2 / 3, 1 / 3, 2 / 3])
    at_start = poses_of(tree, {})["b"]
    assert_equal(at_start[:, :3], own.as_matrix())
    moved = poses_of(tree, {"j_x": 0.7, "j_y": -0.4, "j_angle": 0.5})["b"]
    shift = moved[:, 3] - at_start[:, 3]
    assert np.linalg.norm(shift) == pytest.approx(np.hypot(0.7, 0.4))
    assert normal @ shift == pytest.approx(0, abs=1e-14)
    assert_equal(moved[:, :3] @ at_start[:, :3].T, Rotation.from_rotvec(0.5 * normal).as_matrix())


def test_names_become_identifiers(tmp_path: Path) -> None:
    lines = LINK.format("base", 1), LINK.format("1-arm", 1), LINK.format("elbow", 1)
    joints = (
        JOINT.format("my joint!", "continuous", "base", "1-arm", ""),
        JOINT.format("elbow", "prismatic", "1-arm", "elbow", '<dynamics damping="2" friction="0.5"/>'),
    )
    tree = urdf(tmp_path, *lines, *joints, prescribe=["my joint!"])
    assert [q.name for q in tree.coordinates] == ["elbow"]
    assert [s.name for s in tree.actives] == ["my_joint"]
    names = {p.name: p.start for p in tree.parameters}
    assert {"n1_arm_mass", "elbow_link_mass"} < set(names)
    assert (names["elbow_damping"], names["elbow_friction"]) == (2, 0.5)


def test_several_joints_of_a_body_turn_about_their_own_points(tmp_path: Path) -> None:
    text = """<body name="b" pos="0 0 1" euler="0 0 90">
        <joint name="s" type="slide" axis="1 0 0"/><joint name="h" axis="0 0 1" pos="1 0 0"/>
        <joint name="k" axis="0 1 0" pos="0 0 2"/><inertial mass="2" pos="0 0 0.5" diaginertia="1 1 1"/></body>"""
    tree = mjcf(tmp_path, text, '<compiler angle="degree"/><option gravity="3 0 -4"/>')
    q = {"s": 0.3, "h": 0.4, "k": 0.5}
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = Rotation.from_euler("z", 90, degrees=True).as_matrix(), (0, 0, 1)
    for axis, point, angle in (([0, 0, 1], [1, 0, 0], 0.4), ([0, 1, 0], [0, 0, 2], 0.5)):
        if axis[2]:
            T[:3, 3] += T[:3, 0] * 0.3
        turned = np.eye(4)
        turned[:3, :3] = Rotation.from_rotvec(angle * np.array(axis)).as_matrix()
        turned[:3, 3] = point - turned[:3, :3] @ point
        T = T @ turned
    pose = poses_of(tree, q)["b"]
    assert_equal(pose[:, :3], T[:3, :3])
    assert_equal(pose[:, 3], (T @ [0, 0, 2, 1])[:3])  # our frame lies at the last joint
    assert tree.gravity_direction == pytest.approx((0.6, 0, -0.8))
    assert {p.name: p.start for p in tree.parameters}["gravity"] == pytest.approx(5)


def monte_carlo(inside: Callable[[np.ndarray], np.ndarray], half: np.ndarray) -> tuple[float, np.ndarray]:
    """Volume and second moments of a body by a grid of midpoints."""
    axes = [(np.arange(160) + 0.5) / 80 * h - h for h in half]
    points = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    points, cell = points[inside(points)], float(np.prod(half / 80))
    return len(points) * cell, np.trace(points.T @ points) * np.eye(3) * cell - points.T @ points * cell


@pytest.mark.parametrize(
    ("geom", "half", "inside"),
    [
        ('type="sphere" size="0.3"', [0.3] * 3, lambda r: np.linalg.norm(r, axis=1) < 0.3),
        ('type="box" size="0.1 0.2 0.3"', [0.1, 0.2, 0.3], lambda r: r[:, 0] < 1),
        ('type="ellipsoid" size="0.1 0.2 0.3"', [0.1, 0.2, 0.3], lambda r: ((r / [0.1, 0.2, 0.3]) ** 2).sum(1) < 1),
        ('type="cylinder" size="0.2 0.3"', [0.2, 0.2, 0.3], lambda r: np.hypot(r[:, 0], r[:, 1]) < 0.2),
        (
            'type="capsule" size="0.2 0.3"',
            [0.2, 0.2, 0.5],
            lambda r: np.hypot(np.hypot(r[:, 0], r[:, 1]), np.maximum(np.abs(r[:, 2]) - 0.3, 0)) < 0.2,
        ),
        (
            'type="capsule" size="0.2" fromto="0 0 -0.3 0 0 0.3"',
            [0.2, 0.2, 0.5],
            lambda r: np.hypot(np.hypot(r[:, 0], r[:, 1]), np.maximum(np.abs(r[:, 2]) - 0.3, 0)) < 0.2,
        ),
    ],
)
def test_geoms_have_the_inertia_of_their_volume(geom: str, half: list[float], inside: Any, tmp_path: Path) -> None:
    tree = mjcf(tmp_path, f'<body name="b"><joint name="j"/><geom density="500" {geom}/></body>')
    volume, tensor = monte_carlo(inside, np.array(half))
    names = {p.name: p.start for p in tree.parameters}
    assert names["b_mass"] == pytest.approx(500 * volume, rel=2e-3)
    for i, axis in enumerate("xyz"):
        assert names[f"b_inertia_{axis}{axis}"] == pytest.approx(500 * tensor[i, i], rel=5e-3)


def test_geoms_together_obey_the_parallel_axes_theorem(tmp_path: Path) -> None:
    geoms = '<geom type="box" size="0.1 0.2 0.3" mass="2" pos="1 0 0"/><geom mass="1" size="0.1" pos="-1 3 0"/>'
    tree = mjcf(tmp_path, f'<body name="b"><joint name="j"/>{geoms}</body>')
    names = {p.name: p.start for p in tree.parameters}
    assert (names["b_mass"], names["b_centre_x"], names["b_centre_y"]) == pytest.approx((3, 1 / 3, 1))
    reduced = 2 / 3  # of masses 2 and 1, (2, -3, 0) apart
    box, ball = 2 / 3 * (0.01 + 0.04), 0.4 * 0.01
    assert names["b_inertia_zz"] == pytest.approx(box + ball + reduced * 13)
    assert names["b_inertia_xy"] == pytest.approx(reduced * 6)


def test_connect_closes_a_loop(tmp_path: Path) -> None:
    geom = '<geom type="capsule" size="0.02" fromto="0 0 0 {} 0 {}"/>'
    crank = f'<body name="crank"><joint name="turn" axis="0 1 0"/>{geom.format(0, 1)}'
    coupler = f'<body name="coupler" pos="0 0 1"><joint name="elbow" axis="0 1 0"/>{geom.format(2, 1)}</body></body>'
    rocker = f'<body name="rocker" pos="2 0 0"><joint name="swing" axis="0 1 0"/>{geom.format(0, 2)}</body>'
    equality = '<equality><connect name="pin" body1="coupler" body2="rocker" anchor="2 0 1"/></equality>'
    tree = mjcf(tmp_path, crank + coupler + rocker, after=equality, prescribe=["turn"])
    assert len(tree.constraints) == 2
    assert tree.redundant  # across the plane
    assert all(abs(q.start) < 1e-12 for q in tree.coordinates)  # the file's configuration is closed
    weld = '<equality><weld name="pin" body1="rocker"/></equality>'
    held = mjcf(tmp_path, rocker, after=weld)
    assert len(held.constraints) == 1  # the one angle that the joint leaves


GOOD = (LINK.format("a", 1), LINK.format("b", 1))
ARM = JOINT.format("j", "continuous", "a", "b", "")


@pytest.mark.parametrize(
    ("lines", "words"),
    [
        ((*GOOD, JOINT.format("j", "revolute", "a", "c", "")), ["joint 'j'", "child 'c'", "did you mean|known"]),
        ((*GOOD, JOINT.format("j", "revolute", "", "b", "")), ["joint 'j'", "parent ''"]),
        ((), ["<robot>", "it has no joint"]),
        ((LINK.format("a", 1),), ["it has no joint"]),
        (
            (*GOOD, ARM, '<x:wheel xmlns:x="http://www.ros.org/wiki/xacro"/>'),
            ["line 5: <wheel>", "expand it with xacro first"],
        ),
        ((*GOOD, ARM.replace('"continuous"', '"${kind}"')), ["line 4: <joint>", "expand it with xacro first"]),
        ((*GOOD, ARM, LINK.format("d", 1)), ["links", "'a', 'd'", "one is the root"]),
        ((*GOOD, ARM, JOINT.format("k", "fixed", "b", "a", "")), ["circle"]),
        (
            (
                *(*GOOD, ARM, LINK.format("c", 1), LINK.format("d", 1)),
                *(JOINT.format(f"k{x}", "fixed", x, y, "") for x, y in ("cd", "dc")),
            ),
            ["hangs on"],
        ),
        ((*GOOD, ARM, JOINT.format("k", "fixed", "a", "b", "")), ["link 'b'", "'j' and 'k' hold it"]),
        ((*GOOD, LINK.format("a", 1), ARM), ["<link> 3", "'a'"]),
        ((*GOOD, ARM, ARM), ["<joint> 2", "'j'"]),
        ((GOOD[0], LINK.format("b", -1), ARM), ["b: mass = -1", ">= 0"]),
        ((GOOD[0], LINK.format("b", "nan"), ARM), ["link 'b'", "value = 'nan'", "finite"]),
        ((GOOD[0], LINK.format("b", "1e999"), ARM), ["link 'b'", "'1e999'", "finite"]),
        (
            (GOOD[0], LINK.format("b", 1).replace('izz="1"', 'izz="5"'), ARM),
            ["line 3: r.b: inertia", "exceeds the sum", "balance_inertia=True"],
        ),
        ((GOOD[0], LINK.format("b", 1).replace('izz="1"', 'izz="-1"'), ARM), ["b: inertia", ">= 0"]),
        (
            (*GOOD, JOINT.format("j", "revolute", "a", "b", '<axis xyz="0 0 0"/>')),
            ["joint 'j'", "xyz of <axis>"],
        ),
        (
            (*GOOD, JOINT.format("j", "revolute", "a", "b", '<axis xyz="1 0"/>')),
            ["joint 'j'", "xyz = '1 0'", "3 finite"],
        ),
        ((*GOOD, JOINT.format("j", "revolt", "a", "b", "")), ["joint 'j'", "'revolt'", "did you mean 'revolute'"]),
        (
            (*GOOD, JOINT.format("j", "revolute", "a", "b", '<mimic joint="k"/>')),
            ["joint 'j'", "it mimics 'k', which is no joint"],
        ),
        ((*GOOD, JOINT.format("j", "revolute", "a", "b", '<dynamics damping="-1"/>')), ["joint 'j'", "damping = '-1'"]),
        ((*GOOD, JOINT.format("j", "fixed", "a", "b", "")), ["<robot>", "no joint that moves", "floating_base=True"]),
        ((*GOOD, JOINT.format("***", "revolute", "a", "b", "")), ["joint '***'", "rename"]),
        ((*GOOD, JOINT.format("gravity", "revolute", "a", "b", "")), ["joint 'gravity'", "taken", "rename"]),
        ((*GOOD, JOINT.format("dot", "revolute", "a", "b", "")), ["dot", "taken", "choose another"]),
        ((*GOOD, JOINT.format("energy", "revolute", "a", "b", "")), ["line 4: r: ", "energy is the energy T + V:"]),
        (
            (
                *(*GOOD, JOINT.format("j", "planar", "a", "b", ""), LINK.format("c", 1)),
                JOINT.format("j_x", "continuous", "b", "c", ""),
            ),
            ["declares j_x"],
        ),
        (
            (*GOOD, ARM, LINK.format("b!", 1), JOINT.format("k", "revolute", "a", "b!", "")),
            ["link 'b!'", "'b'", "taken", "rename"],
        ),
        (('<link name="a"/>', '<link name="b"/>', ARM), ["j: no mass moves", "give it a mass"]),
        (("<unclosed>",), ["mismatched tag"]),
        ((*GOOD, ARM, "<x>" * 300 + "</x>" * 300), ["nested more than 200"]),
        (
            tuple(LINK.format(f"l{i}", 1) for i in range(1200))
            + tuple(JOINT.format(f"j{i}", "revolute", f"l{i}", f"l{i + 1}", "") for i in range(1199)),
            ["more than 1000 bodies"],
        ),
    ],
    ids=lambda value: value[0] if isinstance(value, list) else "",
)
def test_wrong_urdf(lines: tuple[str, ...], words: list[str], tmp_path: Path) -> None:
    with pytest.raises(ComponentError) as caught:
        urdf(tmp_path, *lines)
    text = str(caught.value)
    assert "\n" not in text
    assert text.startswith(str(tmp_path / "r.urdf"))
    assert len(text.removeprefix(str(tmp_path))) < 250
    for word in words:
        assert re.search(word if "|" in word else re.escape(word), text), text


def test_entities_are_refused(tmp_path: Path) -> None:
    head = '<!DOCTYPE robot [<!ENTITY e SYSTEM "file:///etc/passwd">]><robot name="&e;">'
    with pytest.raises(ComponentError, match="document type"):
        urdf(tmp_path, *GOOD, ARM, head=head)


def test_other_documents_and_files(tmp_path: Path) -> None:
    with pytest.raises(ComponentError, match=r"no\.urdf: No such file"):
        Linkage.from_urdf(tmp_path / "no.urdf")
    with pytest.raises(ComponentError, match=r"panda\.xml: <'mujoco'>: the document must be <robot>"):
        Linkage.from_urdf(ROBOTS / "panda.xml")
    with pytest.raises(ComponentError, match=r"'elbo': no joint is called so; did you mean 'elbow'"):
        imported("ur5.urdf", prescribe=["elbo"])
    with pytest.raises(ComponentError, match=r"joint 'tool': it does not move"):
        imported("ur5.urdf", prescribe=["tool"])


BODY = '<body name="b">{}<inertial mass="1" pos="0 0 1" diaginertia="1 1 1"/>{}</body>'


@pytest.mark.parametrize(
    ("text", "before", "after", "words"),
    [
        (BODY.format('<joint type="wheel"/>', ""), "", "", ["b_joint", "'wheel'"]),
        (BODY.format('<joint class="no"/>', ""), "", "", ["body 'b'", "class = 'no'"]),
        (BODY.format('<joint axis="0 0 0"/>', ""), "", "", ["b_joint", "axis of <joint>"]),
        (BODY.format("<joint/>", "").replace("diag", "d"), "", "", ["body 'b'", "diaginertia = None", "3 finite"]),
        (BODY.format("<joint/>", "").replace('mass="1"', 'mass="-1"'), "", "", ["b: mass = -1"]),
        (BODY.format("<freejoint/><joint/>", ""), "", "", ["body 'b'", "alone"]),
        (
            BODY.format('<joint type="free" damping="2"/>', ""),
            "",
            "",
            ["line 1: joint 'b_joint'", "damping = 2", "set"],
        ),
        (BODY.format('<joint type="ball" stiffness="2"/>', ""), "", "", ["b_joint", "stiffness = 2", "leave_out"]),
        (BODY.format('<joint springdamper="1 1"/>', ""), "", "", ["b_joint", "springdamper", "leave_out"]),
        (BODY.format("<joint/>", "").replace("<body", '<body gravcomp="1"'), "", "", ["body 'b'", "gravcomp"]),
        (BODY.format("<joint/>", BODY.format("<joint/>", "")), "", "", ["body 'b'", "another body"]),
        ('<body name="b" mocap="true"/>', "", "", ["body 'b'", "mocap"]),
        ('<body name="b" quat="0 0 0 0"/>', "", "", ["body 'b'", "orientation"]),
        ('<body name="b"><joint/><geom type="mesh" mesh="m"/></body>', "", "", ["body 'b'", "'mesh'", "<inertial>"]),
        ('<body name="b"><joint/><geom size="-1"/></body>', "", "", ["body 'b'", "size = '-1'", ">= 0"]),
        ('<body name="b"><frame/></body>', "", "", ["<frame>"]),
        (BODY.format("<joint/>", ""), '<compiler eulerseq="xyw"/>', "", ["eulerseq = 'xyw'", "xyzXYZ"]),
        (BODY.format("<joint/>", ""), '<compiler angle="turns"/>', "", ["angle = 'turns'"]),
        (BODY.format("<joint/>", ""), '<option gravity="down"/>', "", ["gravity = 'down'", "3 finite"]),
        (BODY.format("<joint/>", ""), "", '<equality><joint joint1="j"/></equality>', ["joint", "'j' is no joint;"]),
        (BODY.format("<joint/>", ""), "", "<equality><joint/></equality>", ["joint", "it has no joint1"]),
        (
            BODY.format('<joint type="ball" name="j"/>', ""),
            "",
            '<equality><joint joint1="j"/></equality>',
            ["line 1: joint 'joint_2'", "'j': it has no single coordinate"],
        ),
        (
            BODY.format('<joint name="j"/>', ""),
            "",
            '<equality><joint joint1="j"/><joint joint1="j" polycoef="1"/></equality>',
            ["joint 'joint_", "contradicts another coupling"],
        ),
        (
            BODY.format('<joint name="j"/>', ""),
            '<tendon><spatial name="t"/></tendon>',
            '<equality><tendon tendon1="t"/></equality>',
            ["tendon 'tendon_2'", "'t' is no fixed tendon"],
        ),
        (
            BODY.format('<joint name="j"/>', ""),
            "",
            '<tendon><fixed name="t"><joint joint="k" coef="1"/></fixed></tendon>',
            ["fixed tendon 't'", "'k' is no joint; "],
        ),
        (
            BODY.format('<joint name="j"/>', ""),
            "",
            '<tendon><fixed name="t" stiffness="3"><joint joint="j" coef="1"/></fixed></tendon>',
            ["line 1: fixed tendon 't'", "stiffness = 3", "leave_out"],
        ),
        (
            BODY.format('<joint name="j"/>', ""),
            "",
            '<tendon><fixed name="t" range="0 1"/></tendon>',
            ["line 1: fixed tendon 't'", "range", "leave_out"],
        ),
        (
            BODY.format('<joint name="j"/>', ""),
            '<default><motor damping="1"/></default>',
            "",
            ["line 1: motor 'without name'", "damping = '1'", "leave_out"],
        ),
        (
            BODY.format("<joint/>", ""),
            "",
            '<equality><connect body1="c" anchor="0 0 0"/></equality>',
            ["connect", "'c' is no body"],
        ),
    ],
    ids=lambda value: value[0] if isinstance(value, list) else "",
)
def test_wrong_mjcf(text: str, before: str, after: str, words: list[str], tmp_path: Path) -> None:
    with pytest.raises(ComponentError) as caught:
        mjcf(tmp_path, text, before, after)
    message = str(caught.value)
    assert "\n" not in message
    assert message.startswith(str(tmp_path / "m.xml"))
    for word in words:
        assert word in message, message


@pytest.mark.parametrize(
    "words",
    [
        'quat="0.5 0.5 0.5 0.5"',
        'axisangle="1 1 1 120"',
        'xyaxes="0 2 0 0 1 3"',
        'euler="0 90 90"',
        'class="turned"',
    ],
)
def test_orientations_have_several_spellings(words: str, tmp_path: Path) -> None:
    """Of the cyclic turn x to y to z to x; a geom, as orientations of bodies have no default class."""
    default = '<default><default class="turned"><geom quat="1 1 1 1" density="10"/></default></default>'
    geom = f'<geom type="box" size="1 2 3" mass="6" pos="0 0 1" {words}/>'
    tree = mjcf(tmp_path, f'<body name="b"><joint name="j"/>{geom}</body>', default)
    names = {p.name: p.start for p in tree.parameters}
    moments = [names[f"b_inertia_{axis}{axis}"] for axis in "xyz"]
    assert moments == pytest.approx([2 * (1 + 4), 2 * (4 + 9), 2 * (1 + 9)])  # along y, z and x were 1, 2 and 3


def test_zaxis_is_the_shortest_turn(tmp_path: Path) -> None:
    geom = '<geom type="capsule" size="0.1 1" mass="1" zaxis="3 0 4"/>'
    names = {p.name: p.start for p in mjcf(tmp_path, f'<body name="b"><joint/>{geom}</body>').parameters}
    other = mjcf(
        tmp_path, f'<body name="b"><joint/>{geom.replace("zaxis", "xyaxes").replace("3 0 4", "4 0 -3 0 1 0")}</body>'
    )
    assert names == pytest.approx({p.name: p.start for p in other.parameters})
    assert names["b_inertia_xz"] < 0


def test_bodies_may_be_called_as_joints(tmp_path: Path) -> None:
    """MuJoCo keeps names of bodies and of joints apart: the joint keeps its name, the body's parameters say so."""
    geom = '<geom type="box" size=".1 .2 .3" pos="0.1 0.2 0"/>'
    free = mjcf(tmp_path, f'<body name="root" pos="0 0 1"><freejoint name="root"/>{geom}</body>')
    assert {q.name for q in free.coordinates} == {"root_x", "root_y", "root_z"}
    joints = '<joint name="tail" axis="0 0 1"/><joint name="twist" axis="0 1 0"/>'
    first = mjcf(tmp_path, f'<body name="tail">{joints}{geom}</body>')
    assert [q.name for q in first.coordinates] == ["tail", "twist"]
    for tree, name in ((free, "root"), (first, "tail")):
        assert {p.name: p.start for p in tree.parameters}[f"{name}_body_mass"] == pytest.approx(48)
        assert f"name of body '{name}', which a joint or the FMU has: its variables begin with {name}_body" in (
            tree.left_out
        )
    pin = '<equality><connect name="tail" body1="tail" anchor="0 0 1"/></equality>'
    pinned = mjcf(tmp_path, f'<body name="tail">{joints}{geom}</body>', after=pin)
    assert all(c.name.startswith("tail_connect_") for c in pinned.constraints)
    work = mjcf(tmp_path, f'<body name="work"><joint name="j"/>{geom}</body>')
    assert "work_body_mass" in {p.name for p in work.parameters}


def test_what_does_not_move_needs_no_mass(tmp_path: Path) -> None:
    bob = '<body name="bob"><joint name="j"/><geom size="0.1"/></body>'
    plane = '<geom type="plane" size="1 1 .1"/><geom type="mesh" mesh="m"/><geom type="hfield" hfield="h"/>'
    tree = mjcf(tmp_path, f'<body name="floor">{plane}<body name="step">{plane}</body></body>{bob}')
    assert [name for name in (p.name for p in tree.parameters) if "mass" in name] == ["bob_mass"]
    assert {"2 <geom> of type plane", "2 <geom> of type mesh", "2 <geom> of type hfield"} < set(tree.left_out)
    with pytest.raises(ComponentError, match="line 1: geom 'without name' of body 'b': the mass of its geom of type"):
        mjcf(tmp_path, f'<body name="b"><joint name="j"/>{plane}</body>')


def inertia_of(tree: type[Linkage], body: str = "b") -> list[float]:
    names = {p.name: p.start for p in tree.parameters}
    return [names.get(f"{body}_inertia_{i}{i}", 0.0) for i in "xyz"]


@pytest.mark.parametrize(
    ("printed", "expected"),
    [
        ("0.1234 0.2345 0.3580", [0.1234 + 1e-4 / 3, 0.2345 + 1e-4 / 3, 0.358 - 1e-4 / 3]),  # a plate: Ixx + Iyy = Izz
        ("1.23e-5 2.34e-5 3.58e-5", [1.23e-5 + 1e-7 / 3, 2.34e-5 + 1e-7 / 3, 3.58e-5 - 1e-7 / 3]),
        ("0 1.000001 1.000002", [1e-6 / 3, 1.000001 + 1e-6 / 3, 1.000002 - 1e-6 / 3]),  # a rod
        ("2.4e-35 0 0", [0, 0, 0]),  # dust
        ("0.10000000149011612 0.20000000298023224 0.30000004172325134", [0.1, 0.2, 0.3]),  # of single precision
        ("1 2 2.9", [1, 2, 2.9]),
        ("0.1 0.1 0.2", [0.1, 0.1, 0.2]),  # a plate, as it is
    ],
)
def test_rounded_inertia_is_balanced_and_said(printed: str, expected: list[float], tmp_path: Path) -> None:
    inertia = " ".join(f'{key}="{x}"' for key, x in zip(("ixx", "iyy", "izz"), printed.split(), strict=True))
    link = f'<link name="b"><inertial><origin xyz="0 1 0"/><mass value="2"/><inertia {inertia}/></inertial></link>'
    text = f'<body name="b"><joint/><inertial pos="0 1 0" mass="2" diaginertia="{printed}"/></body>'
    for tree in (urdf(tmp_path, GOOD[0], link, ARM), mjcf(tmp_path, text)):
        digits = 5e-7 if len(printed) > 50 else 1e-12  # those of single precision, of the largest
        assert inertia_of(tree) == pytest.approx(expected, rel=digits, abs=1e-16 * max(expected))  # of eigenvalues
        changed = expected != [float(x) for x in printed.split()]
        assert [line for line in tree.left_out if "balanced" in line] != [] if changed else not tree.left_out


def test_other_inertia_is_balanced_if_requested(tmp_path: Path) -> None:
    link = LINK.format("b", 1).replace('izz="1"', 'izz="4"')
    tree = urdf(tmp_path, GOOD[0], link, ARM, balance_inertia=True)
    assert inertia_of(tree) == pytest.approx([2, 2, 2])
    assert tree.left_out == (
        "inertia of link 'b' as printed: its principal moments are balanced, [1.0, 1.0, 4.0] to [2.0, 2.0, 2.0]",
    )
    for printed in ("0.1 0.1 0.3", "1 1 3", "1.00 1.00 2.03"):  # not by rounding
        with pytest.raises(ComponentError, match=r"line 1: m\.b: inertia = .*exceeds the sum"):
            mjcf(tmp_path, f'<body name="b"><joint/><inertial pos="0 1 0" mass="2" diaginertia="{printed}"/></body>')


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ('<joint name="j"/><geom size="1e308"/>', "line 1: body 'b': its mass, centre of mass or inertia exceeds all"),
        ('<joint name="j"/><geom type="box" size="1e200 1 1"/>', "body 'b': its mass, centre of mass or inertia"),
        ('<joint name="j"/><geom type="capsule" size="1e110 1e100"/>', "body 'b': its mass, centre of mass or inertia"),
        ('<joint name="j"/><geom size="1" pos="1e308 0 0" mass="1"/><geom size="1"/>', "body 'b': its mass, centre of"),
        ('<joint name="j"/><geom/>', "line 1: geom 'without name' of body 'b': size = None"),
        ('<joint name="j"/><geom type="box" size="1 1"/>', "geom 'without name' of body 'b': size = '1 1'"),
        ('<joint name="j"/><geom size="1_0"/>', "geom 'without name' of body 'b': size = '1_0'"),
        ('<joint name="j"/><geom size="nan"/>', "geom 'without name' of body 'b': size = 'nan'"),
        (
            '<joint name="j"/><geom size="1" mass="-1"/>',
            "geom 'without name' of body 'b': mass = '-1': it must be >= 0",
        ),
        ('<joint name="j"/><geom size="1" density="inf"/>', "geom 'without name' of body 'b': density = 'inf'"),
        ('<joint name="j" axis="0 0 nan"/><geom size="1"/>', "joint 'j': axis = '0 0 nan'"),
        ('<joint name="j" pos="0 0"/><geom size="1"/>', "body 'b': pos = '0 0'"),
        ('<joint name="j"/><geom size="1" pos="1e200 0 0" mass="1"/>', "m: the kinetic energy is not finite at the"),
    ],
)
def test_numbers_without_bounds(text: str, words: str, tmp_path: Path) -> None:
    with pytest.raises(ComponentError, match=words) as caught:
        mjcf(tmp_path, f'<body name="b">{text}</body>')
    assert "\n" not in str(caught.value)


def test_axes_of_any_length_turn(tmp_path: Path) -> None:
    for axis in ("0 1e200 0", "0 1e-200 0", "0 1 0"):
        tree = mjcf(tmp_path, f'<body name="b"><joint name="j" axis="{axis}"/><geom pos="1 0 0" size="0.1"/></body>')
        assert_equal(poses_of(tree, {"j": 0.5})["b"][:, :3], Rotation.from_euler("y", 0.5).as_matrix())


# ---- files that a file includes ----------------------------------------------------------------------------------

BOB = '<body name="bob"><joint name="j"/><geom size="0.1" pos="1 0 0" class="light"/></body>'
LIGHT = '<default><default class="light"><geom density="500"/></default></default>'


def including(tmp_path: Path, include: str, **files: str) -> type[Linkage]:
    for name, text in files.items():
        (tmp_path / f"{name}.xml").write_text(text, encoding="utf-8")
    return mjcf(tmp_path, BOB, include)


def test_included_files_stand_in_the_place_of_their_names(tmp_path: Path) -> None:
    (tmp_path / "common").mkdir()
    (tmp_path / "common" / "light.xml").write_text(f"<mujoco>{LIGHT}</mujoco>", encoding="utf-8")
    limb = '<mujocoinclude><body name="limb"><joint name="k"/><geom size="0.2"/></body></mujocoinclude>'
    (tmp_path / "limb.xml").write_text(limb, encoding="utf-8")
    world = BOB.replace("</body>", '<include file="limb.xml"/></body>')
    tree = mjcf(tmp_path, world, '<include file="./common/light.xml"/>')
    assert [q.name for q in tree.coordinates] == ["j", "k"]
    starts = {p.name: p.start for p in tree.parameters}
    assert starts["bob_mass"] == pytest.approx(500 * 4 / 3 * np.pi * 0.001)


@pytest.mark.parametrize(
    ("include", "files", "words"),
    [
        ('<include file="no.xml"/>', {}, r"m\.xml: line 1: <include> of 'no.xml': No such file"),
        ('<include file="/etc/passwd"/>', {}, "'/etc/passwd': the file does not lie in the folder of the document"),
        ('<include file="../secret.xml"/>', {}, "'../secret.xml': the file does not lie in the folder"),
        ('<include file="link.xml"/>', {}, "'link.xml': the file does not lie in the folder"),
        ("<include/>", {}, "<include> of '': the file does not lie"),
        ('<include file="m.xml"/>', {}, "'m.xml': the file is there already; include each file once, and no file in"),
        (
            '<include file="a.xml"/>',
            {"a": '<mujoco><include file="b.xml"/></mujoco>', "b": '<mujoco>\n<include file="a.xml"/></mujoco>'},
            r"m\.xml: b\.xml: line 2: <include> of 'a\.xml': the file is there already",
        ),
        ('<include file="a.xml"/>' * 2, {"a": "<mujoco/>"}, "'a.xml': the file is there already"),
        ('<include file="a.xml"/>', {"a": "<robot/>"}, "its document is <'robot'>; it must be <mujoco>"),
        ('<include file="a.xml"/>', {"a": "<mujoco>"}, "<include> of 'a.xml': no element found"),
        ('<include file="a.xml"/>', {"a": "<!DOCTYPE x []><mujoco/>"}, "'a.xml': it declares a document type"),
        (
            '<include file="a.xml"/>',
            {"a": '<mujoco>\n<default><motor armature="1"/></default></mujoco>'},
            r"m\.xml: a\.xml: line 2: motor 'without name': armature = '1'",
        ),
    ],
)
def test_hostile_includes(include: str, files: dict[str, str], words: str, tmp_path: Path) -> None:
    inner = tmp_path / "inner"
    inner.mkdir()
    (tmp_path / "secret.xml").write_text("<mujoco/>", encoding="utf-8")
    (inner / "link.xml").symlink_to(tmp_path / "secret.xml")
    with pytest.raises(ComponentError, match=words) as caught:
        including(inner, include, **files)
    assert "\n" not in str(caught.value)


def test_includes_have_limits_of_number_and_depth(tmp_path: Path) -> None:
    chain = {f"f{i}": f'<mujoco><include file="f{i + 1}.xml"/></mujoco>' for i in range(210)}
    with pytest.raises(
        ComponentError, match=r"f9\d\.xml: line 1: <include> of 'f\d*\.xml': the document has more than 10"
    ):
        including(tmp_path, '<include file="f0.xml"/>', **chain)
    deep = {f"d{i}": f'<mujoco>{"<x>" * 150}<include file="d{i + 1}.xml"/>{"</x>" * 150}</mujoco>' for i in range(3)}
    with pytest.raises(ComponentError, match="nested more than 200"):
        including(tmp_path, '<include file="d0.xml"/>', **deep)


# ---- against the peers ---------------------------------------------------------------------------------------------

LINKS = (
    '<geom type="box" size=".1 .2 .3" pos="0.3 0.1 -0.4"/>',
    '<geom type="capsule" size="0.05 0.2" pos="0.1 -0.2 -0.3" euler="20 30 40"/>',
)
TREE = """<body name="a" pos="0 0.2 1" euler="10 20 30"><joint name="p" axis="0 1 1" {p}/>{g0}
  <body name="b" pos="0.1 0 -0.8"><joint name="s" type="slide" axis="1 0 0.2" {s}/>{g1}
    <body name="c" pos="0 0.1 -0.2"><joint name="o" type="{kind}" axis="0 1 0" {o}/>{g0}</body></body></body>"""


def tree_of(p: str = "", s: str = "", o: str = "", kind: str = "hinge") -> str:
    return TREE.format(p=p, s=s, o=o, kind=kind, g0=LINKS[0], g1=LINKS[1])


TENDONS = """<tendon><fixed name="t"><joint joint="p" coef="2"/><joint joint="s" coef="-1"/></fixed>
    <fixed name="u"><joint joint="o" coef="0.5"/></fixed></tendon>"""
FOLLOWERS = """<equality><joint name="f" joint1="s" joint2="p" polycoef="0.1 0.5 0.2 0 0.1"/>
    <joint joint1="o" joint2="p"/></equality>"""
FEATURES = {
    "reference values": (tree_of('ref="20" range="-30 50"', 'ref="0.3"', 'ref="-15" stiffness="4"'), "", ""),
    "unstressed springs": (tree_of('stiffness="3" springref="25" ref="10"', 'springref="0.2" stiffness="5"'), "", ""),
    "armature": (tree_of('armature="2"', 'armature="3"', 'armature="0.5"'), "", ""),
    "armature of a ball joint": (tree_of(o='armature="0.5" damping="0.2"', kind="ball"), "", ""),
    "total mass": (tree_of(), '<compiler settotalmass="14"/>', ""),
    "several roots": (
        f'<body name="f" pos="1 0 2" euler="30 0 10"><freejoint name="r"/>{LINKS[0]}</body>{tree_of()}',
        "",
        "",
    ),
    "defaults": (
        tree_of('class="k"'),
        '<default><joint armature="1" damping="0.3"/><default class="k"><joint ref="9"/></default></default>',
        "",
    ),
    "joints that follow": (
        tree_of('ref="20"', 'ref="0.3"'),
        "",
        FOLLOWERS,
    ),
    "a joint that stays": (tree_of(o='ref="-15"'), "", '<equality><joint joint1="o" polycoef="0.3"/></equality>'),
    "tendons that follow": (
        tree_of('ref="20"', 'ref="0.3"'),
        TENDONS,
        '<equality><tendon tendon1="t" tendon2="u" polycoef="0.2 3"/></equality>',
    ),
}


@pytest.mark.parametrize("feature", FEATURES)
def test_mjcf_moves_as_in_mujoco(feature: str, tmp_path: Path) -> None:
    pytest.importorskip("mujoco")
    tree = mjcf(tmp_path, *FEATURES[feature])
    peer = MujocoFile(tmp_path / "m.xml")
    assert max(distances(tree, peer)) <= 1e-12  # both are right to rounding
    rows = peer.data.efc_type == peer.mujoco.mjtConstraint.mjCNSTR_EQUALITY
    assert not rows.any()  # switched off
    if tree.constraints:
        check_couplings(tree, tmp_path / "m.xml")


def check_couplings(tree: type[Linkage], file: Path) -> None:
    """Residuals and gradients of joints that follow others are MuJoCo's at a random configuration."""
    mujoco: Any = pytest.importorskip("mujoco")
    model = mujoco.MjModel.from_xml_path(str(file))
    model.opt.jacobian = mujoco.mjtJacobian.mjJAC_DENSE
    data = mujoco.MjData(model)
    data.qpos[:] = np.random.default_rng(3).uniform(-1, 1, model.nq)
    mujoco.mj_forward(model, data)
    m = tree()
    names = [model.joint(i).name for i in range(model.njnt)]
    q = ca.vertcat(*(m.symbols[name] for name in names))
    residuals = ca.vertcat(*(getattr(m, c.name) for c in m.constraints))
    start = m.start_values()
    numbers = [p.start for p in m.parameters]
    function = ca.Function("c", [q, m.parameter_column], [residuals, ca.jacobian(residuals, q)])
    values, slopes = function(data.qpos, numbers)
    rows = data.efc_type == mujoco.mjtConstraint.mjCNSTR_EQUALITY
    assert_equal(np.array(values).ravel(), data.efc_pos[rows])
    assert_equal(np.array(ca.densify(slopes)), data.efc_J.reshape(-1, model.nv)[rows])
    closed, _ = function([start[name] for name in names], numbers)
    np.testing.assert_allclose(np.array(closed), 0, rtol=0, atol=1e-12)  # rounding


LIMIT = '<limit lower="-3" upper="3" effort="1" velocity="1"/>'
MIMIC = '<mimic joint="p" multiplier="-0.5" offset="0.2"/>'
FINGERS = (
    *(LINK.format(name, mass) for name, mass in (("a", 3), ("b", 1), ("c", 2), ("d", 1.5))),
    JOINT.format("p", "revolute", "a", "b", '<origin xyz="0 0.1 1" rpy="0.1 0.2 0.3"/><axis xyz="0 1 0"/>' + LIMIT),
    JOINT.format("s", "prismatic", "b", "c", '<axis xyz="1 0 0"/>' + MIMIC + LIMIT),
    JOINT.format(
        "o", "continuous", "c", "d", '<origin xyz="0.3 0 1"/><dynamics damping="0.4" friction="0"/><axis xyz="0 1 0"/>'
    ),
)


@pytest.mark.parametrize("floating", [False, True], ids=["grounded", "floating"])
def test_urdf_moves_as_in_pinocchio(floating: bool, tmp_path: Path) -> None:
    """Also a robot whose root link moves freely; where every joint of the file moves on its own."""
    pytest.importorskip("pinocchio")
    lines = [re.sub('inertia ixx="1"', 'inertia ixx="1.5" ixy="0.1" ixz="0" iyz="0.2"', line) for line in FINGERS]
    tree = urdf(tmp_path, *lines, floating_base=floating)
    assert max(distances(tree, PinocchioFile(tmp_path / "r.urdf", tree))) <= 1e-12  # both are right to rounding


def test_a_joint_that_mimics_another_follows_it(tmp_path: Path) -> None:
    """As in Pinocchio, where such joints have no coordinate; and the FMU starts and stays there."""
    pin: Any = pytest.importorskip("pinocchio")
    lines = [re.sub('inertia ixx="1"', 'inertia ixx="1" ixy="0" ixz="0" iyz="0"', line) for line in FINGERS]
    tree = urdf(tmp_path, *lines)
    model: Any = pin.buildModelFromUrdf(str(tmp_path / "r.urdf"), True)  # with mimic
    data, rng, equations = model.createData(), np.random.default_rng(2), derive(tree)
    follow = np.array([[1, 0], [-0.5, 0], [0, 1]])  # of p and o
    for _ in range(3):
        (p, o), v = rng.uniform(-1, 1, 2), rng.uniform(-1, 1, 2)
        place = np.array([p, np.cos(o), np.sin(o)])
        matrix = pin.crba(model, data, place, pin.Convention.WORLD)  # the other one reads no mimic
        matrix = np.triu(matrix) + np.triu(matrix, 1).T
        forces = -pin.nle(model, data, place, v) - np.array([0, 0.4 * v[1]])
        state = dict(zip(("p", "s", "o"), (p, 0.2 - 0.5 * p, o), strict=True))
        state |= dict(zip(("p_dot", "s_dot", "o_dot"), (follow @ v).tolist(), strict=True))
        accelerations = equations.evaluate("accelerations", **state)
        assert_equal(accelerations, follow @ np.linalg.solve(matrix, forces))
    assert {q.name: q.start for q in tree.coordinates} == {"p": 0, "s": 0.2, "o": 0}
    (coupling,) = tree.constraints
    assert coupling.name == "s_mimic"


@pytest.mark.variants(core=0)
def test_an_fmu_keeps_what_follows(tmp_path: Path) -> None:
    tree = urdf(tmp_path, *FINGERS, prescribe=["p"])
    settings: dict[str, Any] = {"stop_time": 1.0, "step_size": 0.02, "tolerance": 1e-10}
    moved = {"p": operator(Sinusoid, amplitude=0.3, angular_frequency=2.0)}
    result = simulate(build(tree, tmp_path), **moved, **settings)
    assert np.ptp(result["s"]) > 0.1
    np.testing.assert_allclose(result["s"], 0.2 - 0.5 * result["p"], rtol=0, atol=1e-9)  # the FMU's tolerance
    assert np.abs(result["energy_balance"]).max() <= 1e-6 * np.abs(result["energy"]).max()  # of first-order jumps


def test_a_robot_of_fixed_joints_moves_by_its_root(tmp_path: Path) -> None:
    lines = LINK.format("a", 1), LINK.format("b", 2), JOINT.format("j", "fixed", "a", "b", '<origin xyz="0 0 1"/>')
    tree = urdf(tmp_path, *lines, floating_base=True)
    assert [q.name for q in tree.coordinates] == [f"floating_base_{axis}" for axis in "xyz"]
    assert mass_matrix(tree, state_of(tree, 0))[0, 0] == pytest.approx(3)
    alone = urdf(tmp_path, LINK.format("a", 1), floating_base=True)
    assert len(alone.orientations) == 1


def test_joints_without_mass_are_named_together(tmp_path: Path) -> None:
    fingers = [JOINT.format(f"f{i}", "revolute", "b", f"c{i}", "") for i in range(2)]
    lines = *GOOD, ARM, *(f'<link name="c{i}"/>' for i in range(2)), *fingers
    with pytest.raises(
        ComponentError, match=r"line 7: r\.f0: no mass moves with f0_dot, f1_dot at .*; prescribe=\[...\]"
    ):
        urdf(tmp_path, *lines)
    assert [s.name for s in urdf(tmp_path, *lines, prescribe=["f0", "f1"]).actives] == ["f0", "f1"]


def test_a_capsule_is_drawn(tmp_path: Path) -> None:
    """As urdfdom 1.2 has it: the length is that between the centres of its ends."""
    capsule = '<visual><geometry><capsule radius="0.1" length="0.6"/></geometry></visual></link>'
    m = urdf(tmp_path, GOOD[0], GOOD[1].replace("</link>", capsule), ARM)()
    (rod,) = (shape for shape in m.picture() if isinstance(shape, Rod))
    ends = [[float(ca.evalf(ca.substitute(x, m.free.q, 0))) for x in end.values()] for end in (rod.start, rod.end)]
    np.testing.assert_allclose(ends, [[0, 0, -0.3], [0, 0, 0.3]], rtol=0, atol=1e-15)  # rounding of a rotation


def test_a_start_with_a_reference_value_is_that_value(tmp_path: Path) -> None:
    joints = tree_of('ref="20" range="-30 50"', 'ref="0.3" range="0.5 0.7"', 'ref="-15" range="-40 40"')
    starts = {q.name: q.start for q in mjcf(tmp_path, joints, limits=True).coordinates}
    assert starts == pytest.approx({"p": np.radians(20), "s": 0.6, "o": np.radians(-15)})
