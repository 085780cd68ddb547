"""A motion as a file: gif, png (a strip of instants), mp4, glb, html, or for OpenModelica's editor."""

from __future__ import annotations

import base64
from collections.abc import Mapping
from importlib.util import find_spec
from itertools import count
from pathlib import Path
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from liaisons.arguments import finite
from liaisons.errors import SimulationError
from liaisons.files import replacing
from liaisons.pictures.declared import Picture
from liaisons.pictures.frames import RATE, Frames, frames
from liaisons.pictures.gltf import glb
from liaisons.pictures.inline import page
from liaisons.pictures.openmodelica import visual
from liaisons.pictures.stage import Stage
from liaisons.progress import progress_bar

LONGEST = 20.0
"""[s] that an animation takes at most, unless its speed is given."""

_MANY = 100  # frames: from here on their progress is shown
_MOST = 100_000  # frames, of almost an hour
_MOST_POINTS = 20_000_000  # in all frames; they take half a gigabyte

_DRAWN = (".gif", ".png", ".mp4")
_VISUAL = "_visual.xml"
_KINDS = (*_DRAWN, ".glb", ".html", _VISUAL)

_BYTES = 6  # of a number in a page: four in base64, rounded up

Values = Mapping[str, NDArray[np.float64]]


class Scene(Protocol):
    """Where the picture comes from, and what it needs beside what was recorded."""

    @property
    def picture(self) -> Picture:
        """Shapes whose coordinates are numbers or names of signals."""
        ...

    def values(self, known: Values) -> Values:
        """All variables of the picture at some frames, from what is known of the motion there."""
        ...


def animate(
    path: Path,
    scene: Scene,
    time: NDArray[np.float64],
    signals: Values,
    *,
    title: str,
    speed: float | None = None,
    against: Mapping[str, ArrayLike] | None = None,
    turns: float = 0.0,
) -> float:
    """Write a motion; the ending of the path says as what.

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
    speed = _pace(time) if speed is None else _checked_speed(speed, time, scene.picture.count)
    finite("turns", turns)
    at = _instants(time, speed / RATE)
    known = {name: _between(time, values, at) for name, values in signals.items()}
    shown = _frames(scene, at, known, title)
    ghost = None
    if against is not None:
        followed = {name: _between(time, np.asarray(values, dtype=float), at) for name, values in against.items()}
        drawn = scene.picture.variables  # these are to be calculated anew
        kept = {name: values for name, values in known.items() if name in followed or name not in drawn}
        ghost = _frames(scene, at, kept | followed, title)
    many = title if len(at) > _MANY else ""
    with replacing(path) as whole, progress_bar(many, "frame {:g} of {:g}", 0, len(at)) as show:
        if kind == ".glb":
            whole.write_bytes(glb(shown, title))
        elif kind == _VISUAL:
            table = path.with_name(f"{path.name.removesuffix(_VISUAL)}_res.csv")
            with replacing(table) as beside:
                for file, content in zip((whole, beside), visual(shown), strict=True):
                    file.write_bytes(content)
        elif kind == ".html":
            whole.write_bytes(_recorded(scene.picture, shown, title=title, speed=speed, rate=RATE))
        else:
            from liaisons.pictures import drawing  # matplotlib is slow to load

            done, write = count(1), {".gif": drawing.write_gif, ".mp4": drawing.write_film, ".png": drawing.write_strip}
            write[kind](Stage(shown, ghost), whole, turns=turns, progress=lambda: show(next(done)))
    return speed


def motion_page(scene: Scene, time: NDArray[np.float64], signals: Values, *, title: str, most: int) -> bytes:
    """The motion as a page; nothing where there is nothing to draw.

    :param most: bytes of the frames: where the picture needs many variables, fewer frames a second are shown.
    :raises SimulationError: if the FMU cannot be asked, or a coordinate is not finite.
    """
    picture = scene.picture
    if not picture.shapes or len(time) < 2:
        return b""
    speed = _pace(time)
    fit = most // (_BYTES * max(len(picture.variables), 1))
    rate = min(RATE, fit * speed / float(time[-1] - time[0]))
    shown = motion_frames(scene, time, signals, speed / rate, title)
    return _recorded(picture, shown, title=title, speed=speed, rate=rate)


def _recorded(picture: Picture, shown: Frames, *, title: str, speed: float, rate: float) -> bytes:
    plan = {
        "picture": picture.document,
        "signals": picture.variables,
        "values": base64.b64encode(shown.values.astype("<f4").tobytes()).decode(),
        "frames": len(shown.time),
        "rate": rate,
        "speed": speed,
        "start": float(shown.time[0]),
        "plane": picture.plane,
    }
    return page("recorded.html", ("picture.js", "recorded.js"), title, "", plan)


def motion_frames(scene: Scene, time: NDArray[np.float64], signals: Values, step: float, title: str) -> Frames:
    """The shapes of the picture at every step [s].

    :raises SimulationError: if the FMU cannot be asked, or a coordinate is not finite.
    """
    at = _instants(time, step)
    return _frames(scene, at, {name: _between(time, values, at) for name, values in signals.items()}, title)


def _pace(time: NDArray[np.float64]) -> float:
    """Seconds of motion a second: real time, unless that takes longer than :data:`LONGEST`."""
    return max(1.0, float(time[-1] - time[0]) / LONGEST)


def _checked_speed(speed: float, time: NDArray[np.float64], points: int) -> float:
    finite("speed", speed)
    most = min(_MOST, _MOST_POINTS // points)
    least = float(time[-1] - time[0]) * RATE / most
    if speed <= 0 or speed < least:
        raise SimulationError(
            f"speed = {speed!r}: give seconds of motion a second, {least:.1g} at least: there are {most} frames at most"
        )
    return speed


def _instants(time: NDArray[np.float64], step: float) -> NDArray[np.float64]:
    return time[0] + np.arange(int(float(time[-1] - time[0]) / step + 1e-9) + 1) * step


def _frames(scene: Scene, at: NDArray[np.float64], known: Values, title: str) -> Frames:
    return frames(scene.picture, at, scene.values(known).__getitem__, title=title)


def _between(time: NDArray[np.float64], values: NDArray[np.float64], at: NDArray[np.float64]) -> NDArray[np.float64]:
    """Values between communication points; curves without overshoot where a coordinate jumps (Akima)."""
    if len(time) < 3 or not np.isfinite(values).all():  # what is not finite is said of the frames
        return np.interp(at, time, values)
    from scipy.interpolate import Akima1DInterpolator

    return Akima1DInterpolator(time, values, method="makima")(np.minimum(at, time[-1]))
