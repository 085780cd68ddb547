"""A motion as a file: gif, png (a strip of instants), mp4, glb, html, or for OpenModelica's editor."""

from __future__ import annotations

import base64
from collections.abc import Callable, Mapping, Sequence
from importlib.util import find_spec
from itertools import count as counter
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from liaisons.base.arguments import check_finite
from liaisons.base.arrays import Floats
from liaisons.base.files import replacement_path
from liaisons.base.logs import progress_bar
from liaisons.errors import SimulationError
from liaisons.results import Picture, Scene
from liaisons_pages.pictures.frames import RATE, Frames, picture_frames
from liaisons_pages.pictures.gltf import glb_file
from liaisons_pages.pictures.inline import inlined_page
from liaisons_pages.pictures.openmodelica import openmodelica_files
from liaisons_pages.pictures.stage import Stage

LONGEST = 20.0
"""Longest animation [s], unless its speed is given."""

_MANY = 100  # frames, above which progress is shown
_MOST = 100_000  # frames, of almost an hour
_MOST_POINTS = 20_000_000  # of all frames: half a gigabyte

_DRAWN = (".gif", ".png", ".mp4")
_VISUAL = "_visual.xml"
_KINDS = (*_DRAWN, ".glb", ".html", _VISUAL)

_BYTES = 6  # of a number in a page: single precision in base64

Values = Mapping[str, Floats]


def animate(
    path: Path,
    scene: Scene,
    time: Floats,
    signals: Values,
    *,
    title: str,
    speed: float | None = None,
    against: Mapping[str, ArrayLike] | None = None,
    turns: float = 0.0,
) -> float:
    """Write a motion in the format of the path's suffix, and return its speed.

    :param time: of the signals [s].
    :param speed: seconds of motion a second; real time unless that takes longer than :data:`LONGEST`.
    :param against: signals that a ghost of the picture follows, e.g. those of the closed form, at the same times; not
        in glb and html.
    :param turns: how often the camera goes round a spatial mechanism; it stands still in glb, html and png.
    :returns: the speed.
    :raises SimulationError: for another ending, a ghost that is not drawn, a missing extra, nothing to draw, or a speed
        that is not positive or takes too many frames.
    """
    kind = _VISUAL if path.name.endswith(_VISUAL) else path.suffix.lower()
    if kind not in _KINDS:
        raise SimulationError(f"{path}: no animation ends so; choose one of {', '.join(_KINDS)}")
    if against is not None and kind not in _DRAWN:
        raise SimulationError(f"{path}: a ghost is drawn in {', '.join(_DRAWN)} only; choose one, or leave out against")
    if kind == ".mp4" and find_spec("imageio_ffmpeg") is None:
        raise SimulationError(f"{path}: films need imageio-ffmpeg; pip install 'liaisons[film]', or write a .gif")
    if not scene.picture.shapes:
        raise SimulationError(f"{title} has no picture and no points; define picture(self), or plot its signals")
    speed = _default_speed(time) if speed is None else _checked_speed(speed, time, scene.picture.point_count)
    check_finite("turns", turns)
    step = speed / RATE
    shown = motion_frames(scene, time, signals, step, title)
    ghost = None
    if against is not None:
        drawn = scene.picture.variables  # calculated anew for the ghost
        recorded = {name: values for name, values in signals.items() if name not in drawn}
        ghost = motion_frames(scene, time, {**recorded, **against}, step, title, shifts=shown.shifts)
    count = len(shown.time)
    many = title if count > _MANY else ""
    with replacement_path(path) as part, progress_bar(many, "frame {:g} of {:g}", 0, count) as show:
        if kind == ".glb":
            part.write_bytes(glb_file(shown, title))
        elif kind == _VISUAL:
            description, table = openmodelica_files(shown)
            part.write_bytes(description)
            with replacement_path(path.with_name(f"{path.name.removesuffix(_VISUAL)}_res.csv")) as table_part:
                table_part.write_bytes(table)
        elif kind == ".html":
            part.write_bytes(_player_page(scene.picture, shown, title=title, speed=speed, rate=RATE))
        else:
            from liaisons_pages.pictures import drawing  # matplotlib is slow to load

            done, write = (
                counter(1),
                {".gif": drawing.write_gif, ".mp4": drawing.write_film, ".png": drawing.write_strip},
            )
            write[kind](Stage(shown, ghost), part, turns=turns, progress=lambda: show(next(done)))
    return speed


def motion_page(scene: Scene, time: Floats, signals: Values, *, title: str, most: int) -> bytes:
    """HTML page that plays a motion; empty if there is nothing to draw.

    :param most: bytes of all frames; a picture of many variables has fewer frames a second.
    :raises SimulationError: if an FMU fails to calculate a coordinate, or one is not finite.
    """
    picture = scene.picture
    if not picture.shapes or len(time) < 2:
        return b""
    speed = _default_speed(time)
    fit = most // (_BYTES * max(len(picture.variables), 1))
    rate = min(RATE, fit * speed / float(time[-1] - time[0]))
    shown = motion_frames(scene, time, signals, speed / rate, title)
    return _player_page(picture, shown, title=title, speed=speed, rate=rate)


def _player_page(picture: Picture, shown: Frames, *, title: str, speed: float, rate: float) -> bytes:
    """HTML page that plays frames.

    :param rate: frames a second.
    """
    plan = {
        "picture": picture.document,
        "signals": picture.variables,
        "shifts": shown.shifts,
        "values": base64.b64encode(shown.values.astype("<f4").tobytes()).decode(),
        "frames": len(shown.time),
        "rate": rate,
        "speed": speed,
        "start": float(shown.time[0]),
        "plane": picture.plane,
    }
    return inlined_page("recorded.html", ("picture.js", "recorded.js"), title, "", plan)


def motion_frames(
    scene: Scene,
    time: Floats,
    signals: Mapping[str, ArrayLike],
    step: float,
    title: str,
    *,
    shifts: Sequence[float] | None = None,
) -> Frames:
    """Frames of a picture at every step [s] of a motion.

    :param shifts: as in :func:`liaisons_pages.pictures.frames.picture_frames`.
    :raises SimulationError: if an FMU fails to calculate a coordinate, or one is not finite.
    """
    count = int(float(time[-1] - time[0]) / step + 1e-9) + 1
    instants = time[0] + np.arange(count) * step
    between = {name: _interpolated(time, np.asarray(values, dtype=float), instants) for name, values in signals.items()}
    return picture_frames(scene.picture, instants, scene.values(between).__getitem__, title=title, shifts=shifts)


def _default_speed(time: Floats) -> float:
    """Seconds of motion a second: 1, or more for a motion longer than :data:`LONGEST`."""
    return max(1.0, float(time[-1] - time[0]) / LONGEST)


def _checked_speed(speed: float, time: Floats, points: int) -> float:
    """Speed; a SimulationError unless it is positive and takes few enough frames."""
    check_finite("speed", speed)
    most = min(_MOST, _MOST_POINTS // points)
    least = float(time[-1] - time[0]) * RATE / most
    if speed <= 0 or speed < least:
        raise SimulationError(
            f"speed = {speed!r}: give seconds of motion a second, {least:.1g} at least: there are {most} frames at most"
        )
    return speed


def _interpolated(time: Floats, values: Floats, instants: Floats) -> Floats:
    """Values at instants between communication points, by Akima's interpolation, which does not overshoot at jumps."""
    if len(time) < 3 or not np.isfinite(values).all():  # picture_frames() names it
        return np.interp(instants, time, values)
    from scipy.interpolate import Akima1DInterpolator

    return Akima1DInterpolator(time, values, method="makima")(np.minimum(instants, time[-1]))


def last_image(picture: Picture, time: Floats, values: Callable[[str], Floats], *, title: str) -> NDArray[np.uint8]:
    """Image of the last frame, (height, width, 3) of bytes, as large as those before in the same place.

    :param values: of the variables at the times, by name.
    """
    from liaisons_pages.pictures.drawing import frame_images

    frames = picture_frames(picture, time, values, title=title)
    return next(frame_images(Stage(frames), first=len(time) - 1, ratio=1.0))
