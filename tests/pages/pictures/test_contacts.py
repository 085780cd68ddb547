"""Ropes, floors, and flashes at impacts."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np
import pytest
from numpy.typing import NDArray

from liaisons import ActiveCoordinate, Ball, Coordinate, Flash, Floor, Mechanism, Parameter, Rope, Shapes
from liaisons.errors import ComponentError, SimulationError
from liaisons.language import unilateral
from liaisons.mechanics import assemble
from liaisons.results import Picture
from liaisons_pages.pictures import Stage, animate, picture_frames
from liaisons_pages.pictures.stage import camera_facing

from .test_animation import content, numbers, omedit
from .test_schema import SCHEMA, fits

ROUNDING = 1e-12
RATE = 30  # frames a second
FLASH = 6  # frames that a flash takes
THICKNESS = 0.04  # of a floor, as a fraction of its width
TEETH = 24  # that hatch a floor


class _Bouncing(Mechanism):
    """A ball on a rope above a table."""

    mass = Parameter(1.0, "kg", "mass", above=0)
    height = Coordinate("m", "height of the ball", start=1.0)
    table = ActiveCoordinate("m", "height of the table")

    def kinetic_energy(self) -> ca.SX:
        return self.mass / 2 * self.dot(self.height) ** 2

    @unilateral("m", "distance of ball and table")
    def gap(self) -> ca.SX:
        return self.height - self.table

    def picture(self) -> Shapes:
        ground = {"z": self.table}
        return [
            Floor(ground, {"z": 1}, 2.0),
            Rope({"z": 3.0}, {"z": self.height}, 2.0),
            Ball({"z": self.height}),
            Flash(ground, "gap"),
        ]


def document(component: type[Mechanism] = _Bouncing) -> dict[str, Any]:
    picture = assemble(component).picture
    assert picture is not None
    return dict(picture)


def test_the_file_names_the_count_of_impacts_and_is_of_version_1_1() -> None:
    written = document()
    assert written["version"] == "1.1"
    assert written["shapes"] == [
        {"shape": "floor", "at": [0.0, 0.0, "table"], "normal": [0.0, 0.0, 1.0], "width": 2.0},
        {"shape": "rope", "from": [0.0, 0.0, 3.0], "to": [0.0, 0.0, "height"], "length": 2.0},
        {"shape": "ball", "at": [0.0, 0.0, "height"]},
        {"shape": "flash", "at": [0.0, 0.0, "table"], "count": "gap_impacts"},
    ]
    assert fits(written, SCHEMA)
    picture = Picture.from_json(json.dumps(written).encode(), "it")
    assert picture.variables == ["table", "height", "gap_impacts"]
    assert picture.renamed("a.{}".format).variables == ["a.table", "a.height", "a.gap_impacts"]
    assert picture.plane == "xz"


def test_a_flash_names_a_unilateral_liaison() -> None:
    wrong = type("_Wrong", (_Bouncing,), {"picture": lambda _: [Flash({}, "gaps")], "__module__": __name__})
    with pytest.raises(ComponentError, match=r"^_Wrong\.picture: Flash: 'gaps' is not a unilateral liaison.*gap"):
        document(wrong)


def moving(shape: dict[str, Any], count: int = 1, **signals: NDArray) -> Any:
    """One shape at some frames."""
    picture = Picture.from_json(json.dumps({"version": "1.1", "shapes": [shape]}).encode(), "it")
    (found,) = picture_frames(picture, np.arange(count) / RATE, signals.__getitem__, title="it").shapes
    return found


@pytest.mark.parametrize("end", [[0.6, 0, 0], [0.3, 0.4, -0.5], [0, 0, -1], [0, 0, 0], [3, 0, 4], [1.9999999999, 0, 0]])
def test_a_rope_keeps_its_length_and_is_straight_where_it_is_taut(end: list[float]) -> None:
    length = 2.0
    (points,) = moving({"shape": "rope", "from": [0, 0, 0], "to": end, "length": length}).points
    apart = float(np.linalg.norm(end))
    assert points[[0, -1]] == pytest.approx(np.array([[0, 0, 0], end]), abs=ROUNDING)
    along = np.linalg.norm(np.diff(points, axis=0), axis=1).sum()
    assert along == pytest.approx(max(length, apart), abs=1e-8)  # of bisection: 2^-29 of its length
    straight = np.linspace(0, 1, len(points))[:, None] * end
    hangs = straight - points
    assert hangs[:, :2] == pytest.approx(0, abs=ROUNDING)
    assert np.all(hangs[:, 2] >= 0)
    assert hangs.max() == pytest.approx(0, abs=1e-4) if apart > length - 1e-9 else hangs.max() > 0.3


NORMALS = [[0, 0, 1], [-3, 0, 0], [0, -1, 0], [1, 2, 2]]


@pytest.mark.parametrize("normal", NORMALS)
def test_the_upper_face_of_a_floor_is_where_bodies_stand(normal: list[float]) -> None:
    seen = moving({"shape": "floor", "at": [1, 2, "z"], "normal": normal, "width": 2}, 2, z=np.array([3.0, 4.0]))
    unit = np.array(normal) / np.linalg.norm(normal)
    heights = np.sort((seen.corners - [[[1, 2, 3]], [[1, 2, 4]]]) @ unit, axis=1)
    assert heights == pytest.approx(np.tile(np.repeat([-2 * THICKNESS, 0.0], 4), (2, 1)), abs=ROUNDING)


def test_a_floor_is_hatched_behind_in_the_plane() -> None:
    floor = {"shape": "floor", "at": [0, 0, 0.5], "normal": [0.6, 0, 0.8], "width": 2}
    stage = Stage(picture_frames(Picture((floor,)), np.zeros(1), lambda _: np.zeros(1), title="it"))
    edge, *teeth = stage.faces(0)
    assert len(teeth) == TEETH
    middle = camera_facing("xz").project(np.array([0, 0, 0.5]) - stage.middle[0])[:2]
    heights = [(face.corners - middle) @ (0.6, 0.8) for face in (edge, *teeth)]
    thick = np.ptp(heights[0]) / 2
    assert [heights[0].min(), heights[0].max()] == pytest.approx([-thick, thick], abs=ROUNDING)
    for of_tooth in heights[1:]:
        assert -2 * THICKNESS - thick < of_tooth.min() < -2 * THICKNESS + thick
        assert of_tooth.max() <= thick


def test_a_floor_in_space_hides_nothing_from_above_and_all_from_below() -> None:
    floor = {"shape": "floor", "at": [0, 0, 0], "normal": [0, 0, "up"], "width": 2}
    ball = {"shape": "ball", "at": [0.9, 0.9, "up"], "radius": 0.01}  # farther away than the middle of the floor
    for up in (1.0, -1.0):
        picture, height = Picture((ball, floor)), np.array([0.02 * up])
        seen = picture_frames(picture, np.zeros(1), {"up": height}.__getitem__, title="it")
        faces = Stage(seen).faces(0)
        of_floor = [face.colour[2] / face.colour[0] == pytest.approx(0xA0 / 0x85) for face in faces]
        assert of_floor == ([*[True] * 3, False, False] if up > 0 else [False, False, *[True] * 3])  # the last is seen


def test_a_flash_begins_at_an_impact_and_fades() -> None:
    count = np.array([0, 0, 0.2, 0.9, *[1] * 7, 2, 2])
    (strength,) = moving({"shape": "flash", "at": [0, 0, 0], "count": "n"}, len(count), n=count).size.T  # pyright: ignore[reportOptionalMemberAccess]
    fading = (1 - np.arange(FLASH) / FLASH).tolist()
    assert strength == pytest.approx([0, 0, 0, *fading, 0, 0, *fading[:2]])
    ball = {"shape": "ball", "at": [1, 0, 0]}
    flash = {"shape": "flash", "at": [0, 0, 0], "count": "n"}
    seen = picture_frames(Picture((ball, flash)), count, {"n": count}.__getitem__, title="it")
    assert [len(Stage(seen).faces(k)) for k in (2, 3, 9)] == [2, 3, 2]


@pytest.mark.parametrize(
    ("shape", "message"),
    [
        ({"shape": "floor", "at": [0, 0, 0], "normal": [0, 1], "width": 1}, "is not a triple"),
        ({"shape": "floor", "at": [0, 0, 0], "normal": [0, 0, 0], "width": 1}, "three unit vectors"),
        ({"shape": "rope", "from": [0, 0, 0], "to": [0, 0, 1]}, "'length'"),
        ({"shape": "rope", "from": [0, 0, 0], "to": [0, 0, 1], "length": None}, "neither a number nor a name"),
        ({"shape": "flash", "at": [0, 0, 0]}, "'count'"),
    ],
)
def test_damaged_shapes(shape: dict[str, Any], message: str) -> None:
    with pytest.raises(SimulationError, match=message):
        moving(shape)


class _Scene:
    picture = Picture.from_json(json.dumps(document()).encode(), "it")

    def values(self, signals: Mapping[str, NDArray]) -> Mapping[str, NDArray]:
        return signals


def test_all_viewers_show_them(tmp_path: Path) -> None:
    """A ball that falls on a table, which rises."""
    time = np.linspace(0, 1, 61)
    signals = {"height": np.abs(1 - 2 * time) + 0.1 * time, "table": 0.1 * time, "gap_impacts": (time > 0.5) * 1.0}
    for name in ("motion.glb", "motion_visual.xml", "motion.gif", "motion.html"):
        animate(tmp_path / name, _Scene(), time, signals, title="it")
    glb, data = content(tmp_path / "motion.glb")
    nodes = [node["name"] for node in glb["nodes"][:-1]]
    assert nodes == ["floor", *["wire"] * 16, "ball", "flash"]
    scales = {
        glb["nodes"][channel["target"]["node"]]["name"]: numbers(glb, data, sampler["output"])
        for channel in glb["animations"][0]["channels"]
        for sampler in [glb["animations"][0]["samplers"][channel["sampler"]]]
        if channel["target"]["path"] == "scale" and channel["target"]["node"] in (0, 18)
    }
    assert list(scales) == ["flash"]
    assert [scales["flash"][k].any() for k in (15, 16, 21, 22)] == [False, True, True, False]
    shapes = omedit(tmp_path)
    assert [kind for kind, _ in shapes] == ["box", *["cylinder"] * 16, "sphere", "sphere"]
    taut = np.sum([shape["length"] for kind, shape in shapes if kind == "cylinder"], axis=0)
    apart = 3.0 - np.interp(np.arange(31) / RATE, time, signals["height"])
    assert taut[:, 0] == pytest.approx(np.maximum(2.0, apart), abs=0.02)  # cubics between samples, across a kink
    plan = re.search(r'id="plan">(.*?)</script>', (tmp_path / "motion.html").read_text(encoding="utf-8"))
    assert plan is not None
    assert json.loads(plan[1])["signals"] == ["table", "height", "gap_impacts"]
