"""The part of space that is seen holds all that is drawn, from all sides."""

from __future__ import annotations

import numpy as np
import pytest

from liaisons.results import Picture
from liaisons_pages.pictures import Stage, picture_frames

RATE = 30  # frames a second
ROD = 0.011  # radius of a rod, as a fraction of the extent
TURNS = np.linspace(0, 2 * np.pi, 7)


@pytest.mark.parametrize("third", [0, "y"])
def test_everything_lies_within_what_is_seen(third: float | str) -> None:
    """A ball on a rod that goes round, in a plane and on a tilted one."""
    bob = ["x", third, "z"]
    shapes = ({"shape": "rod", "from": bob, "to": [0, 0, 0]}, {"shape": "ball", "at": bob})
    time = np.linspace(0, 2 * np.pi, 25)
    signals = {"x": 3 * np.cos(time), "y": 3 * np.cos(time), "z": np.sin(time)}
    stage = Stage(picture_frames(Picture(shapes), time, signals.__getitem__, title="it"))
    for turn in TURNS if third else TURNS[:1]:
        corners = np.concatenate([face.corners for k in range(len(time)) for face in stage.faces(k, turn)])
        assert np.all(np.abs(corners) <= stage.half)
        assert third or np.all(np.abs(corners).max(axis=0) >= 0.8 * stage.half)
    if not third:  # the rod is as thick on both sides
        rod, *_ = (face for face in stage.faces(2) if len(face.corners) == 14)
        end = stage.frames.shapes[0].points[2, 0]
        along = end[::2] / np.linalg.norm(end)
        aside = (rod.corners + stage.middle[2, ::2]) @ (-along[1], along[0])
        assert [aside.min(), aside.max()] == pytest.approx([-ROD * stage.extent, ROD * stage.extent])


@pytest.mark.parametrize("count", [40, 200])
def test_a_trail_lasts_three_seconds(count: int) -> None:
    time = np.arange(count) / RATE
    trail = {"shape": "trail", "at": ["x", 0, 0]}
    stage = Stage(picture_frames(Picture((trail,)), time, {"x": time}.__getitem__, title="it"))
    assert len(stage.faces(count - 1)) == min(count, 3 * RATE) - 1
