"""Motions as files."""

from __future__ import annotations

import json
import struct
from itertools import count, product
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest
from PIL import Image
from scipy.spatial.transform import Rotation

from liaisons import Result, System, operator, simulate
from liaisons.cosim import Call
from liaisons.cosim.instances.fmi2 import CoSimulation2
from liaisons.errors import SimulationError
from liaisons.models import Pendulum, Sinusoid
from liaisons.results import Picture
from liaisons_pages.pictures import Stage, motion_frames, picture_frames
from liaisons_pages.pictures.gltf import _MESHES, _material, _quaternions_of_axes
from liaisons_pages.pictures.stage import camera_facing

from .conftest import MECHANISMS, Fmu, Moved

RATE = 30  # frames a second


@pytest.fixture(scope="module")
def swing(fmu: Fmu) -> Result:
    return simulate(fmu(Pendulum), stop_time=1.0, step_size=0.01, theta_0=1.0)


def content(path: Path) -> tuple[dict, bytes]:
    """The two chunks of a .glb file."""
    data = path.read_bytes()
    magic, version, length, size = struct.unpack("<4sIII", data[:16])
    assert (magic, version, length) == (b"glTF", 2, len(data))
    return json.loads(data[20 : 20 + size]), data[28 + size :]


def test_what_an_operator_moves_has_its_own_picture(fmu: Fmu, tmp_path: Path) -> None:
    length = operator(fmu(Sinusoid), offset=1.0, amplitude=0.1, angular_frequency=6.0)
    result = simulate(fmu(Pendulum), stop_time=0.2, length=length)
    assert result.scene is not None
    assert result.scene.picture == simulate(fmu(Pendulum), stop_time=0.1).scene.picture  # pyright: ignore[reportOptionalMemberAccess]
    result.animate(tmp_path / "motion.glb")


def moving(result: Result, step: float) -> Any:
    """Its shapes at every step [s]."""
    assert result.scene is not None
    return motion_frames(result.scene, result.time, dict(zip(result.names, result.values, strict=True)), step, "it")


def numbers(document: dict[str, Any], data: bytes, index: int) -> np.ndarray:
    """What an accessor of floats stands for, (n, k)."""
    accessor = document["accessors"][index]
    width = {"SCALAR": 1, "VEC3": 3, "VEC4": 4}[accessor["type"]]
    begin = document["bufferViews"][accessor["bufferView"]]["byteOffset"]
    return np.frombuffer(data, "<f4", width * accessor["count"], begin).reshape(-1, width).astype(float)


@pytest.mark.parametrize("name", MECHANISMS)
def test_a_viewer_of_glb_sees_all_shapes_where_they_are(name: str, moved: Moved, tmp_path: Path) -> None:
    """Each mesh scaled, turned and shifted as the specification of glTF says, at every keyframe."""
    result = moved(name)
    result.animate(tmp_path / "motion.glb", speed=1.5)
    seen = moving(result, 1.5 / RATE)
    document, data = content(tmp_path / "motion.glb")
    assert document["asset"]["version"] == "2.0"
    (animation,) = document["animations"]
    assert Rotation.from_quat(document["nodes"][-1]["rotation"]).apply([0, 0, 1]) == pytest.approx([0, 1, 0])  # y is up
    keys: dict[tuple[int, str], np.ndarray] = {}
    for channel in animation["channels"]:
        sampler = animation["samplers"][channel["sampler"]]
        assert sampler["interpolation"] == "LINEAR"
        instants = numbers(document, data, sampler["input"])[:, 0]
        assert instants == pytest.approx(seen.time - seen.time[0], abs=1e-6)  # [s]
        target = channel["target"]
        keys[target["node"], target["path"]] = numbers(document, data, sampler["output"])

    def placed(node: int, points: np.ndarray) -> np.ndarray:
        """Points of its mesh in space, (n, k, 3)."""
        still = {"translation": [0, 0, 0], "rotation": [0, 0, 0, 1], "scale": [1, 1, 1]} | document["nodes"][node]
        shift, turn, scale = (
            np.broadcast_to(keys.get((node, path), np.array([still[path]])), (len(seen.time), len(still[path])))
            for path in ("translation", "rotation", "scale")
        )
        turned = Rotation.from_quat(turn).as_matrix()
        return shift[:, None] + np.einsum("nij,nkj->nki", turned, scale[:, None] * points)

    nodes = count()
    for shape in seen.shapes:
        ends = np.concatenate([shape.points, shape.points[:, :1]], axis=1)
        for piece in range(shape.points[:, 1:].shape[1] + shape.closed if shape.kind == "wire" else 1):
            node = next(nodes)
            assert document["nodes"][node]["name"] == shape.kind
            (primitive,) = document["meshes"][document["nodes"][node]["mesh"]]["primitives"]
            positions = document["accessors"][primitive["attributes"]["POSITION"]]
            low, high = np.array(positions["min"]), np.array(positions["max"])
            if shape.axes is not None:
                corners = np.array(list(product(*zip(low, high, strict=True))))
                assert placed(node, corners) == pytest.approx(shape.corners, abs=1e-6)
            elif shape.kind in ("ball", "flash"):
                assert low == pytest.approx(-high)
                assert placed(node, np.zeros((1, 3))) == pytest.approx(shape.points, abs=1e-6)
            elif shape.kind != "trail":
                axis = np.array([[0, 0, low[2]], [0, 0, high[2]]])
                if shape.kind == "spring":  # its wire is thick
                    axis = np.array([[0, 0, 0], [0, 0, 1]])
                assert placed(node, axis) == pytest.approx(ends[:, piece : piece + 2], abs=1e-6)


def test_keyframes_turn_the_short_way() -> None:
    turned = Rotation.from_rotvec(np.outer(np.linspace(0, 9, 50), [0.6, 0, 0.8])).as_matrix()
    quaternions = _quaternions_of_axes(np.swapaxes(turned, 1, 2))
    assert np.sum(quaternions[1:] * quaternions[:-1], axis=1) == pytest.approx(np.cos(9 / 49 / 2))


@pytest.mark.parametrize("kind", _MESHES)
def test_triangles_go_round_their_normals_counter_clockwise(kind: str) -> None:
    places, normals, corners = _MESHES[kind]()
    assert np.linalg.norm(normals, axis=1) == pytest.approx(1)
    a, b, c = places[corners].swapaxes(0, 1)
    areas = np.cross(b - a, c - a)
    assert np.all(np.sum(areas[:, None] * normals[corners], axis=2) > 0)
    if kind != "spring":  # the others are closed and convex
        assert areas.sum(axis=0) == pytest.approx(np.zeros(3), abs=1e-12)
        assert np.all(np.sum(areas * (a + b + c - 3 * (places.min(axis=0) + places.max(axis=0)) / 2), axis=1) > 0)


def test_colours_are_linear() -> None:
    """As the specification of glTF has them: 75, 91 and 107 of 255 in sRGB."""
    assert _material("rod")["pbrMetallicRoughness"]["baseColorFactor"] == pytest.approx(
        [0.0704, 0.1046, 0.1470, 1], abs=1e-4
    )


def test_a_gif_lasts_as_long_as_the_motion(swing: Result, tmp_path: Path) -> None:
    assert swing.animate(tmp_path / "swing.gif") == 1
    with Image.open(tmp_path / "swing.gif") as opened:
        image: Any = opened  # of several frames
        durations = []
        for k in range(image.n_frames):
            image.seek(k)
            durations.append(image.info["duration"])
        assert sum(durations) == pytest.approx(1000, abs=50)  # [ms], one frame more or less
        image.seek(0)
        first = np.asarray(image.convert("RGB"), dtype=int)
        image.seek(image.n_frames // 2)
        assert np.abs(np.asarray(image.convert("RGB"), dtype=int) - first).max() > 50  # it moves


def test_the_other_kinds(swing: Result, tmp_path: Path) -> None:
    pytest.importorskip("imageio_ffmpeg")
    ghost = {"theta": 0.5 * swing["theta"]}
    for name, against in (("strip.png", ghost), ("film.mp4", ghost), ("page.html", None)):
        swing.animate(tmp_path / name, against=against)
        assert (tmp_path / name).stat().st_size > 2000
    with Image.open(tmp_path / "strip.png") as image:
        assert image.width > 3 * image.height
    assert (tmp_path / "film.mp4").read_bytes()[4:8] == b"ftyp"


def test_long_motions_are_shown_faster(swing: Result, tmp_path: Path) -> None:
    stretched = Result("slow", swing.time * 1000, swing.names, swing.values.copy(), {}, scene=swing.scene)
    assert stretched.animate(tmp_path / "slow.html") == pytest.approx(50)


def test_what_is_not_connected_does_not_pile_up(fmu: Fmu, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """What is connected stays together, and a ghost where its own mechanism is."""
    system = System("two of them")
    first = system.add("first", fmu(Pendulum), theta_0=0.3)
    system.add("second", fmu(Pendulum), theta_0=3.0, length=0.5)
    system.connect(first["bob_x"], system.add("follower", fmu(Pendulum))["pivot_x"])
    result = system.simulate(2.0, step_size=0.02)
    assert result.scene is not None
    seen: list[Any] = []
    monkeypatch.setattr("liaisons_pages.pictures.animation.Stage", lambda *them: [seen.extend(them), Stage(*them)][1])
    result.animate(tmp_path / "two.png", against={"second.theta": result["second.theta"] - 1.0})
    shown, ghost = seen
    assert ghost.shifts == shown.shifts
    x: dict[str, list[float]] = {}
    for shape, moving, shift in zip(result.scene.picture.shapes, shown.shapes, shown.shifts, strict=True):
        owner = shape.get("to", shape.get("at"))[0].partition(".")[0]
        assert (shift > 0) == (owner == "second")
        x.setdefault(owner, []).extend(moving.points[..., 0].ravel())
    assert max(*x["first"], *x["follower"]) < min(x["second"])
    bob = shown.values[:, result.scene.picture.variables.index("second.bob_x")]
    assert min(x["second"]) == pytest.approx(bob.min() + max(shown.shifts))


def test_a_ghost_follows_what_it_is_told(swing: Result) -> None:
    assert swing.scene is not None
    angle = np.array([0.3, -0.2])
    known = swing.scene.values({"theta": angle, "length": np.ones(2)})
    assert known["bob_x"] == pytest.approx(np.sin(angle), abs=1e-12)
    assert known["bob_z"] == pytest.approx(-np.cos(angle), abs=1e-12)


def test_an_fmu_that_warns_is_drawn_and_one_that_refuses_is_named(
    swing: Result, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert swing.scene is not None
    signals, getter = {"theta": np.array([0.3]), "length": np.ones(1)}, CoSimulation2.getter

    def returning(status: int) -> None:
        def prepare(self: CoSimulation2, variables: Any, values: Any) -> Call:
            read = getter(self, variables, values)
            return self.prepare_call("get", lambda: max(read(), status))

        monkeypatch.setattr(CoSimulation2, "getter", prepare)

    returning(1)  # Warning
    assert swing.scene.values(signals)["bob_x"] == pytest.approx(np.sin([0.3]), abs=1e-12)
    returning(3)  # Error
    with pytest.raises(SimulationError, match=r"fmi2GetReal in frame 0 returned Error"):
        swing.scene.values(signals)


def test_refusals(swing: Result, tmp_path: Path) -> None:
    with pytest.raises(SimulationError, match=r"swing.mov: no animation ends so; choose one of .gif, .png"):
        swing.animate(tmp_path / "swing.mov")
    for name in ("swing.glb", "swing.html"):
        with pytest.raises(SimulationError, match=rf"{name}: a ghost is drawn in .gif, .png, .mp4 only"):
            swing.animate(tmp_path / name, against={"theta": swing["theta"]})
    assert not list(tmp_path.iterdir())
    with pytest.raises(SimulationError, match="has no picture; animate that of"):
        Result("table", swing.time, swing.names, swing.values.copy(), {}).animate(tmp_path / "a.gif")
    picture = Picture(({"shape": "ball", "at": ["a", 0.0, 0.0]},))
    with pytest.raises(SimulationError, match=r"^swing: a in its picture is not finite at t = 2 s"):
        picture_frames(picture, np.array([1.0, 2.0]), lambda _: np.array([0.0, np.nan]), title="swing")


BOX = b'{"version": "1.0", "shapes": [{"shape": "box", "at": ["x", 0, 0], "axes": %s, "size": [0, 1, 2]}]}'


def test_what_cannot_be_drawn_is_said_in_one_line() -> None:
    def refused(axes: bytes, x: float) -> str:
        with pytest.raises(SimulationError) as caught:
            picture_frames(
                Picture.from_json(BOX % axes, "it"), np.array([1.0, 2.0]), lambda _: np.array([0.0, x]), title="box"
            )
        return str(caught.value)

    straight = b"[[1, 0, 0], [0, 1, 0], [0, 0, 1]]"
    assert refused(straight, 1e200) == "box: x in its picture is 1e+200 at t = 2 s: nothing to draw there"
    for row in (b"[0, 0, 0]", b"[0, 0, -1]", b'[0, "x", 1]'):
        words = refused(straight.replace(b"[0, 0, 1]", row), 1.0)
        assert words.endswith("give three unit vectors at right angles, right-handed")


@pytest.mark.parametrize("speed", [0, -1.0, np.nan, np.inf, 1e-9, "fast"])
def test_a_speed_that_is_none(swing: Result, tmp_path: Path, speed: Any) -> None:
    with pytest.raises(SimulationError, match=r"^speed = "):
        swing.animate(tmp_path / "swing.html", speed=speed)
    with pytest.raises(SimulationError, match=r"^turns = nan"):
        swing.animate(tmp_path / "swing.gif", turns=np.nan)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (b"{", "cannot be read"),
        (b'{"version": "2.0", "shapes": []}', "of version 2.0; this liaisons reads 1.x"),
        (b'{"version": "1.0", "shapes": [{"shape": "cone"}]}', "KeyError: 'cone'"),
        (b'{"version": "1.0", "shapes": [{"shape": "ball"}]}', "KeyError: 'at'"),
        (b'{"version": "1.0", "shapes": [{"shape": "ball", "at": [{}, 0, 0]}]}', "neither a number nor a name"),
        (
            b'{"version": "1.0", "shapes": [{"shape": "ball", "at": [1e308, 0, 0]}]}',
            r"1e\+308: finite numbers up to 1e\+18",
        ),
        (b'{"version": "1.0", "shapes": [{"shape": "wire", "points": [[0, 0, 0]]}]}', "2 triples are needed"),
        (BOX % b"[[1, 0, 0]]", "axes of a box are .*: 3 triples are needed"),
        (
            b'{"version": "1.0", "shapes": [%s]}' % b",".join([b'{"shape": "ball", "at": [0, 0, 0]}'] * 10001),
            "10001 points",
        ),
        (b'{"version": "1.0", "shapes": [{"shape": "ball", "at": [NaN, 0, 0]}]}', "a coordinate is nan"),
        (b'{"version": "1.0", "shapes": [{"shape": "ball", "at": [0, 0]}]}', "cannot be read"),
        (b"[" * 100000, "cannot be read"),
    ],
)
def test_damaged_pictures(text: bytes, message: str) -> None:
    with pytest.raises(SimulationError, match=message):
        Picture.from_json(text, "x.fmu")


@pytest.mark.parametrize("plane", ["xz", "xy", "yz", None])
def test_the_camera_faces_the_plane(plane: str | None) -> None:
    axes = camera_facing(plane).axes
    assert axes @ axes.T == pytest.approx(np.eye(3), abs=1e-12)
    assert np.linalg.det(axes) == pytest.approx(1)  # right, up, towards the eye
    if plane is not None:
        right, up = (np.eye(3)["xyz".index(axis)] for axis in plane)
        assert axes[:2] == pytest.approx(np.array([right, up]), abs=1e-12)


@pytest.mark.parametrize("turn", [0.0, 2.0])
def test_what_is_in_front_is_painted_last_and_backs_of_boxes_are_not(turn: float) -> None:
    half = np.array([0.5, 1.0, 1.5])
    box = {"shape": "box", "at": [0, 0, 0], "axes": np.eye(3).tolist(), "size": (2 * half).tolist()}
    eye = camera_facing(None, turn).axes[2]
    balls = [{"shape": "ball", "at": (3 * side * eye).tolist(), "radius": 0.1} for side in (1, -1)]
    stage = Stage(picture_frames(Picture((balls[0], box, balls[1])), np.zeros(1), lambda _: np.zeros(1), title="it"))
    behind, _, *sides, front, _ = stage.faces(0, turn)  # a ball is a disk and its light
    assert (behind.depth, front.depth) == pytest.approx((-3, 3))
    centres = [side * h * e for h, e in zip(half, np.eye(3), strict=True) for side in (1, -1)]
    expected = sorted(camera_facing(None, turn).project(centre)[:2].tolist() for centre in centres if centre @ eye > 0)
    assert sorted(face.corners.mean(axis=0).tolist() for face in sides) == [pytest.approx(e) for e in expected]
    lit = [face.corners.mean(axis=0).tolist() for face in sides if max(face.colour[:3]) > 0.56 * 0xB5 / 255]  # or 0.55
    towards = [
        camera_facing(None, turn).project(centre)[:2].tolist()
        for centre in centres
        if min(centre @ eye, centre @ (-0.35, -0.6, 0.72)) > 0  # the light comes from the left, in front and above
    ]
    assert sorted(lit) == [pytest.approx(e) for e in sorted(towards)]


def test_frames_are_those_of_their_instants(swing: Result) -> None:
    (bob,) = (shape for shape in moving(swing, 0.01).shapes if shape.kind == "ball")
    expected = np.column_stack([swing["bob_x"], 0 * swing.time, swing["bob_z"]])
    assert bob.points[:, 0] == pytest.approx(expected, abs=1e-12)
    between = moving(swing, 0.025)
    exact = Pendulum.exact(between.time, theta_0=1.0)["theta"]
    (bob,) = (shape for shape in between.shapes if shape.kind == "ball")
    # makima is of third order: its error is about h³ times a third derivative of 30 m/s³
    assert bob.points[:, 0, 0] == pytest.approx(np.sin(exact), abs=1e-4)


# ---- what OMEdit makes of both files, by the formulas of its Animation/Visualization.cpp -----------------------------


def omedit(folder: Path) -> list[tuple[str, dict[str, np.ndarray]]]:
    """Type of each shape, and its attributes at all times, (n, k)."""
    table = np.genfromtxt(folder / "motion_res.csv", delimiter=",", names=True, deletechars="")
    root = ElementTree.parse(folder / "motion_visual.xml").getroot()

    def column(given: ElementTree.Element) -> np.ndarray:
        assert given.text is not None
        return table[given.text] if given.tag == "cref" else np.full(len(table), float(given.text))

    texts = ("ident", "type")
    return [
        (
            shape.findtext("type", ""),
            {a.tag: np.stack([column(x) for x in a], axis=1) for a in shape if a.tag not in texts},
        )
        for shape in root.iter("shape")
    ]


@pytest.mark.parametrize("name", ["Oscillator", "PlanarCat", "Satellite", "Swing"])
def test_omedit_reads_the_places_of_all_shapes(name: str, moved: Moved, tmp_path: Path) -> None:
    result = moved(name)
    result.animate(tmp_path / "motion_visual.xml", speed=1.5)
    seen = moving(result, 1.5 / RATE)
    expected = []
    for shape in seen.shapes:
        places = shape.points[..., [0, 2, 1]] * (1, 1, -1)  # y is up
        if shape.axes is not None:
            assert shape.size is not None
            first = shape.axes[:, 0, [0, 2, 1]] * (1, 1, -1) * shape.size[:, :1] / 2
            expected.append(("box", places[:, 0] - first, places[:, 0] + first))
        elif shape.kind in ("ball", "flash"):
            expected.append(("sphere", places[:, 0], places[:, 0]))
        elif shape.kind == "wire":
            ends = np.concatenate([places, places[:, :1]], axis=1) if shape.closed else places
            expected += [("cylinder", ends[:, i], ends[:, i + 1]) for i in range(ends.shape[1] - 1)]
        elif shape.kind != "trail":
            expected.append(({"rod": "cylinder"}.get(shape.kind, shape.kind), places[:, 0], places[:, 1]))
    for (kind, shape), (expected_kind, start, end) in zip(omedit(tmp_path), expected, strict=True):
        assert kind == expected_kind
        direction = shape["lengthDir"] / np.linalg.norm(shape["lengthDir"], axis=1, keepdims=True)
        rotation = shape["T"].reshape(-1, 3, 3)
        first = shape["r"] + np.einsum("nij,ni->nj", rotation, shape["r_shape"])  # V3mulMat3
        along = np.einsum("nij,ni->nj", rotation, direction * shape["length"])
        if kind == "sphere":
            first, along = first + along / 2, 0 * along
        assert first == pytest.approx(start, abs=1e-7)
        assert first + along == pytest.approx(end, abs=1e-7)
        assert shape["color"].shape[1] == 3
        assert shape["specCoeff"].shape[1] == shape["extra"].shape[1] == shape["width"].shape[1] == 1
