"""Frames drawn by matplotlib: an animation, or a strip of instants."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from itertools import chain
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import PolyCollection
from matplotlib.figure import Figure
from numpy.typing import NDArray

from liaisons_pages.pictures.frames import RATE
from liaisons_pages.pictures.stage import COLOURS, Face, Stage


def add_empty_polygons(stage: Stage, axes: Axes) -> PolyCollection:
    """Hide the axes, add an empty collection of polygons, and return it."""
    axes.set_axis_off()
    axes.set(xlim=(-stage.half[0], stage.half[0]), ylim=(-stage.half[1], stage.half[1]), aspect="equal")
    polygons = PolyCollection([], linewidths=0.4)
    axes.add_collection(polygons, autolim=False)
    return polygons


def draw_faces(polygons: PolyCollection, faces: list[Face]) -> None:
    """Replace the polygons of a collection by faces."""
    polygons.set_verts([face.corners for face in faces])
    colours: Any = np.array([face.colour for face in faces])
    polygons.set_facecolor(colours)
    polygons.set_edgecolor(colours)


def frame_images(
    stage: Stage, *, turns: float = 0.0, width: int = 480, first: int = 0, ratio: float | None = None
) -> Iterator[NDArray]:
    """Yield the frames as images, (height, width, 3) of bytes, with even sizes as films need them.

    :param turns: how often the camera goes round a spatial mechanism.
    :param first: index of the first frame.
    :param ratio: height by width; None: that of the stage, within limits.
    """
    height = int(width * (min(max(stage.ratio, 0.4), 1.6) if ratio is None else ratio)) // 2 * 2
    figure = Figure(figsize=(width / 100, height / 100), dpi=100)
    polygons = add_empty_polygons(stage, figure.add_axes((0, 0, 1, 1)))
    canvas = FigureCanvasAgg(figure)
    count = len(stage.frames.time)
    for k in range(first, count):
        draw_faces(polygons, stage.faces(k, 2 * np.pi * turns * k / count))
        canvas.draw()
        yield np.array(canvas.buffer_rgba())[..., :3]


def write_gif(stage: Stage, path: Path, *, turns: float, progress: Callable[[], None]) -> None:
    """Write the frames as an animated GIF."""
    from PIL import Image

    images: list[Image.Image] = []
    for frame in frame_images(stage, turns=turns):
        image = Image.fromarray(frame)
        images.append(image.quantize(palette=images[0], dither=Image.Dither.NONE) if images else image.quantize(64))
        progress()
    ends = np.round(np.arange(len(images) + 1) * 100 / RATE) * 10  # [ms]; GIF counts hundredths of a second
    images[0].save(
        path, "GIF", save_all=True, append_images=images[1:], duration=np.diff(ends).astype(int).tolist(), loop=0
    )


def write_film(stage: Stage, path: Path, *, turns: float, progress: Callable[[], None]) -> None:
    """Write the frames as an MP4 film."""
    import imageio_ffmpeg

    images = frame_images(stage, turns=turns, width=720)
    first = next(images)
    film = imageio_ffmpeg.write_frames(str(path), first.shape[1::-1], fps=RATE, output_params=["-f", "mp4"])
    film.send(None)
    for image in chain([first], images):
        film.send(np.ascontiguousarray(image))
        progress()
    film.close()


def write_strip(stage: Stage, path: Path, **_: object) -> None:
    """Write evenly spaced instants side by side as a PNG."""
    time, count = stage.frames.time, 6
    figure = Figure(figsize=(2.0 * count, 2.0 * stage.ratio + 0.35), dpi=150, layout="constrained")
    instants = np.linspace(0, len(time) - 1, count).round().astype(int)
    for axes, k in zip(figure.subplots(1, count), instants.tolist(), strict=True):
        draw_faces(add_empty_polygons(stage, axes), stage.faces(k))
        axes.set_title(f"{time[k]:.3g} s", fontsize=9, color=COLOURS["rod"])
    figure.savefig(path, format="png")
