"""What the pictures of the catalogue show is what the mechanisms do."""

from __future__ import annotations

import json
import zipfile
from collections.abc import Callable
from typing import Any

import casadi as ca
import fmpy
import numpy as np
import pytest

import liaisons.models
from liaisons import Ball, Box, Coordinate, Mechanism, Parameter, Result, Rod, Wire, circle, point, turned
from liaisons.errors import ComponentError
from liaisons.mechanics import assemble
from liaisons.models import PendulumChain
from liaisons_pages.pictures import picture_frames

from .conftest import MECHANISMS, Fmu, Moved

# Rods that are as long as a variable says, or as a number of metres; by component.
LENGTHS: dict[str, list[str | float]] = {
    "CartesianPendulum": ["rod"],
    "DoublePendulum": ["length_1", "length_2"],
    "Pendulum": ["length"],
    "PendulumChain": ["length"] * 10,
    "Scara": [0.5, 0.4, 0.3, 0.2, 0.15, "shift"],
    "SlewingCrane": [24.0, 12.0, 20.0, "travel"],
    "Swing": ["rope", "torso_length", 0.4, 0.4],
}
ROUNDING = 1e-12


def shown(result: Result) -> Any:
    scene = result.scene
    assert scene is not None
    signals = {name: result[name] for name in result.names}
    return picture_frames(scene.picture, result.time, scene.values(signals).__getitem__, title="it")


@pytest.mark.parametrize("name", MECHANISMS)
def test_every_mechanism_has_a_picture_that_moves(name: str, moved: Moved) -> None:
    seen = shown(moved(name))
    assert len(seen.shapes) >= 2
    size = np.linalg.norm(np.ptp(seen.points[0], axis=0))
    assert np.ptp(seen.points, axis=0).max() > 1e-4 * size


@pytest.mark.parametrize("name", MECHANISMS)
def test_rods_keep_their_length_and_boxes_their_shape(name: str, moved: Moved) -> None:
    result = moved(name)
    seen = shown(result)
    rods = [np.linalg.norm(s.points[:, 1] - s.points[:, 0], axis=1) for s in seen.shapes if s.kind == "rod"]
    expected = LENGTHS.get(name, [float(rod[0]) for rod in rods])
    for rod, length in zip(rods, expected, strict=True):
        if isinstance(length, str):
            declared = getattr(liaisons.models, name)
            known = result[length] if length in result else getattr(declared, length).start
            assert rod == pytest.approx(known, abs=1e-9), length  # the pendulum in x, y, z keeps it to the projection
        else:
            assert rod == pytest.approx(length, abs=ROUNDING)
    for box in (s for s in seen.shapes if s.axes is not None):
        assert box.axes is not None
        turn = box.axes @ np.swapaxes(box.axes, 1, 2)
        assert turn == pytest.approx(np.broadcast_to(np.eye(3), turn.shape), abs=1e-9)
        assert np.linalg.det(box.axes) == pytest.approx(1, abs=1e-9)


def test_what_is_seen_has_room_for_the_corners_of_boxes(moved: Moved) -> None:
    seen = shown(moved("Satellite"))
    panel = seen.shapes[1]
    assert panel.axes is not None
    assert panel.size is not None
    far = panel.points[:, 0] + np.einsum("ni,nij->nj", panel.size / 2, panel.axes)
    assert np.min(np.linalg.norm(seen.points - far[:, None], axis=2), axis=1) == pytest.approx(0, abs=ROUNDING)


@pytest.mark.parametrize("name", MECHANISMS)
@pytest.mark.variants(core="Pendulum")
def test_what_only_the_picture_needs_is_the_same_in_all_fmus(name: str, fmu: Fmu) -> None:
    model = assemble(getattr(liaisons.models, name))
    if model.draw is None:
        assert not model.drawn
        return
    u, k = (ca.DM([x for v in group for x in v.starts]) for group in (model.inputs, model.parameters))
    y, _ = model.start.call([ca.DM(0), u, k])
    expected = np.asarray(model.draw.call([ca.DM(0), y, u, k])[0]).ravel()
    names = [f"picture[{i}]" for i in range(1, expected.size + 1)]
    for form in ({}, {"fmi": "3"}, *([] if model.contacts else [{"backend": "python"}])):  # contacts are native only
        path = fmu(getattr(liaisons.models, name), **form)
        found = fmpy.simulate_fmu(str(path), stop_time=1e-6, step_size=1e-6, output=names, fmi_type="CoSimulation")
        first: Any = found[0]
        assert np.array([first[name] for name in names]) == pytest.approx(expected, abs=ROUNDING), form


@pytest.mark.parametrize("form", [{}, {"fmi": "3"}, {"backend": "python"}])
def test_the_picture_travels_inside(form: dict[str, str], fmu: Fmu) -> None:
    with zipfile.ZipFile(fmu(liaisons.models.Pendulum, **form)) as archive:
        document = json.loads(archive.read("resources/picture.json"))
    assert document["version"] == "1.0"
    rod = {"shape": "rod", "from": ["pivot_x", 0.0, "pivot_z"], "to": ["bob_x", 0.0, "bob_z"]}
    assert rod in document["shapes"]


def test_a_chain_is_drawn_link_by_link_and_not_beyond_two_hundred() -> None:
    short, long = assemble(PendulumChain, 3).picture, assemble(PendulumChain, 1000).picture
    assert short is not None
    assert long is not None
    rods = [shape for shape in short["shapes"] if shape["shape"] == "rod"]
    assert rods[0]["from"] == ["pivot_x", 0.0, "pivot_z"]
    assert rods[2] == {"shape": "rod", "from": ["bob_x[2]", 0.0, "bob_z[2]"], "to": ["bob_x[3]", 0.0, "bob_z[3]"]}
    assert sum(shape["shape"] == "rod" for shape in long["shapes"]) == 200


class _Toy(Mechanism):
    """A mass on a line."""

    mass = Parameter(1.0, "kg", "mass", above=0)
    x = Coordinate("m", "position", start=1.0)

    @point("m", "the mass")
    def place(self) -> dict[str, ca.SX]:
        return {"x": self.x}

    def kinetic_energy(self) -> ca.SX:
        return self.mass / 2 * self.dot(self.x) ** 2


def test_without_a_picture_points_are_shown() -> None:
    model = assemble(_Toy)
    assert model.picture == {"version": "1.0", "shapes": [{"shape": "ball", "at": ["place_x", 0.0, 0.0]}]}
    assert model.drawn == ()


@pytest.mark.parametrize(
    ("returned", "message"),
    [
        (lambda _: "rod", "return a list of Rod, Ball, Box"),
        (lambda _: [1], "return a list of Rod, Ball, Box"),
        (lambda m: [Ball(m.x)], "Ball: .*a point is given by its components"),
        (lambda m: [Rod({"x": m.y}, {})], "unknown symbol self.y"),
        (lambda _: [Ball({"x": ca.SX([1, 2])})], "a point is given by its components"),
    ],
)
def test_what_is_no_picture_is_refused_by_name(returned: Callable[[Any], Any], message: str) -> None:
    with pytest.raises(ComponentError, match=message):
        assemble(type("_Wrong", (_Toy,), {"picture": returned, "__module__": __name__}))


def test_turned_and_circle_are_right_handed() -> None:
    quarter = np.asarray(ca.DM(ca.evalf(turned("z", np.pi / 2))))
    assert quarter @ [1, 0, 0] == pytest.approx([0, 1, 0], abs=ROUNDING)
    ring = circle({"x": 1.0}, 2.0, (ca.SX([1, 0, 0]), ca.SX([0, 0, 1])), 4)
    assert isinstance(ring, Wire)
    assert [float(p["x"]) for p in ring.points] == pytest.approx([3, 1, -1, 1], abs=ROUNDING)
    assert Box({}, turned("x", 0), (1, 1, 1)).document(float)["axes"] == [[1, 0, 0], [0, 1, 0], [0, 0, 1]]


@pytest.mark.parametrize("name", ["Bricard", "FourBar"])
@pytest.mark.variants(core=0)
def test_rods_of_a_loop_meet_where_its_last_joint_closes_it(name: str, moved: Moved) -> None:
    seen = shown(moved(name))
    ends, balls = (
        np.concatenate([s.points for s in seen.shapes if s.kind == kind], axis=1) for kind in ("rod", "ball")
    )
    meetings = np.concatenate([ends, balls], axis=1)
    near = np.linalg.norm(ends[:, :, None] - meetings[:, None], axis=-1) < 1e-6  # the projection keeps loops to 1e-9
    assert np.all(np.sum(near, axis=2) >= 2)  # no end is alone
