"""Icon of a component: its named points and their paths, a path in the plane or in phase space, a signal; else letters.

Drawn from the default experiment into SVG and PNG with the same strokes; the same bytes on every machine: coordinates
are rounded to a quarter of a pixel, and the PNG is stored without compression, which the archive around it supplies.
"""

from __future__ import annotations

import re
import struct
import zlib
from dataclasses import dataclass
from html import escape
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from liaisons.fmu.reference_results import Trajectory
from liaisons.mechanics.model import Model

SIZE = 96
_MARGIN = 14.0
_INK, _ACCENT = 0, 1
_COLOURS = ((0x5F, 0x6F, 0x86), (0xD9, 0x78, 0x2D))  # both can be seen on white and on black
_LEVELS = 15  # of opacity, for smooth edges
_FLAT = 1e-6  # a picture this much wider than high is a line, and shows nothing
_FRAME = [(14.0, 14.0), (82.0, 14.0), (82.0, 82.0), (14.0, 82.0), (14.0, 14.0)]

Line = list[tuple[float, float]]


@dataclass(frozen=True, slots=True)
class Stroke:
    """A line with round ends, in pixels from the upper left corner; a dot is a line of one point."""

    points: Line
    width: float
    colour: int


def icons(model: Model, results: Trajectory | None) -> tuple[bytes, bytes]:
    """The icon as SVG and PNG."""
    strokes = _fitted(_picture(results)) if results is not None else []
    strokes = strokes or _letters(model.name)
    return _svg(model.name, strokes), _png(strokes)


# ---- what to show ------------------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class _Picture:
    """Paths that something takes, and what stands at the start; (n, 2) each, the second axis upwards."""

    paths: tuple[NDArray, ...]
    start: NDArray
    rods: bool = False  # whether the points at the start hang on each other, the first on the origin
    scaled: bool = True  # whether both axes have the same scale


def _picture(results: Trajectory) -> _Picture | None:
    """Named points, else a path in the plane, else one in phase space, else a signal; None if nothing moves."""
    ports = results.model.ports
    points = _planes(results, [port.name for port in ports if port.kind == "point"])
    if points:
        paths = tuple(path for place in points for path in np.moveaxis(place, 1, 0))
        return _Picture(paths, np.array([path[0] for path in paths]), rods=True)
    places = _planes(results, [port.name for port in ports if port.kind == "free"])
    phases = [
        np.stack([results[state.name], results[f"p_{state.name}"]], axis=-1)
        for state in results.model.states
        if f"p_{state.name}" in results
    ]
    signals = [results[port.name] for port in ports if port.kind == "signal"]
    curves = [np.stack([results.times[:, None], signal], axis=-1) for signal in signals]
    for k, path in enumerate(path[:, 0] for path in (*places, *phases, *curves)):
        if np.min(np.ptp(path, axis=0)) > _FLAT * np.max(np.ptp(path, axis=0)):
            return _Picture((path,), path[:1], scaled=k < len(places))
    return None


def _planes(results: Trajectory, names: list[str]) -> list[NDArray]:
    """Paths of places with components x, y, z: in the two that vary most, in this order; (n, count, 2) each."""
    components: dict[str, list[str]] = {}
    for name in names:
        place, _, axis = name.rpartition("_")
        if axis in ("x", "y", "z"):
            components.setdefault(place, []).append(name)
    found: list[NDArray] = []
    for axes in components.values():
        varied = sorted(axes, key=lambda name: -float(np.ptp(results[name])))[:2]
        if len(varied) == 2:
            found.append(np.stack([results[name] for name in axes if name in varied], axis=-1))
    return found


def _fitted(picture: _Picture | None) -> list[Stroke]:
    """The picture in pixels: paths thin, rods and points on top of them."""
    if picture is None:
        return []
    origin = np.zeros((1, 2)) if picture.rods else np.empty((0, 2))
    everything = np.vstack([origin, picture.start, *picture.paths])
    low, extent = everything.min(axis=0), np.ptp(everything, axis=0)
    if picture.scaled:
        extent = np.full(2, extent.max())
        low -= (extent - np.ptp(everything, axis=0)) / 2
    scale = (SIZE - 2 * _MARGIN) / np.where(extent > 0, extent, 1)

    def line(points: NDArray) -> Line:
        pixels = _MARGIN + (points - low) * scale
        pixels[:, 1] = SIZE - pixels[:, 1]
        quarters = [(float(x), float(y)) for x, y in np.round(4 * pixels) / 4]
        return [p for i, p in enumerate(quarters) if i == 0 or p != quarters[i - 1]]

    strokes = [Stroke(line(path), 2.0, _ACCENT) for path in picture.paths]
    if picture.rods:
        strokes.append(Stroke(line(np.vstack([origin, picture.start])), 3.0, _INK))
        strokes.append(Stroke(line(origin), 6.0, _INK))
    return [*strokes, *(Stroke(line(point[None]), 11.0, _INK) for point in picture.start)]


# ---- letters -----------------------------------------------------------------------------------------------------

# Strokes on a grid of 5 by 7: column and row of each corner from the upper left; "/" lifts the pen.
_GLYPHS = """
A062046/1434 B0006364544333303/333424130300 C4130100105163645 D00062644422000 E40000646/0333 F400006/0333
G41301001051636454323 H0006/4046/0343 I2026/1030/1636 J4045361605 K0006/400346 L000646 M0600234046 N06004640
O100105163645413010 P06003041423303 Q100105163645413010/2446 R06003041423303/2346 S413010010213334445361605
T0040/2026 U000516364540 V002640 W0016233640 X0046/4006 Y002340/2326 Z00400646
0100105163645413010 1112026/1636 201103041420646 301103041423323/334445361605 436300444 5400003334445361605
630100105163645443303 7004016 813020110304142331304051636454433 916364541301001021343
"""
_FONT = {glyph[0]: glyph[1:] for glyph in _GLYPHS.split()}


def _letters(name: str) -> list[Stroke]:
    """Up to three initials of a name, in a frame."""
    initials = re.findall(r"[A-Z0-9]|(?<![a-zA-Z0-9])[a-z]", name.replace("_", " "))
    glyphs = [_FONT[letter.upper()] for letter in initials][:3]
    step = min(8.0, 54.0 / (6 * len(glyphs) - 2)) if glyphs else 0.0
    left = SIZE / 2 - step * (6 * len(glyphs) - 2) / 2
    strokes = [Stroke(_FRAME, 3.0, _INK)]
    for k, glyph in enumerate(glyphs):
        for pen in glyph.split("/"):
            corners = [(int(column), int(row)) for column, row in zip(pen[::2], pen[1::2], strict=True)]
            line = [(round(left + step * (6 * k + x), 2), round(SIZE / 2 + step * (y - 3), 2)) for x, y in corners]
            strokes.append(Stroke(line, step * 0.65, _ACCENT))
    return strokes


# ---- files -------------------------------------------------------------------------------------------------------


def _svg(name: str, strokes: list[Stroke]) -> bytes:
    attributes = 'xmlns="http://www.w3.org/2000/svg" fill="none" stroke-linecap="round" stroke-linejoin="round"'
    lines = [f'<svg {attributes} viewBox="0 0 {SIZE} {SIZE}"><title>{escape(name)}</title>']
    for stroke in strokes:
        colour = "#{:02x}{:02x}{:02x}".format(*_COLOURS[stroke.colour])
        points = " ".join(f"{x:g},{y:g}" for x, y in stroke.points * (1 if len(stroke.points) > 1 else 2))
        lines.append(f'<polyline points="{points}" stroke="{colour}" stroke-width="{stroke.width:g}"/>')
    return "\n".join([*lines, "</svg>", ""]).encode()


def _png(strokes: list[Stroke]) -> bytes:
    """Palette: transparent, then the colours in levels of opacity."""
    pixels = np.zeros((SIZE, SIZE), dtype=np.uint8)
    opacity = np.zeros((SIZE, SIZE), dtype=np.uint8)
    for stroke in strokes:
        level = np.round(_LEVELS * np.clip(stroke.width / 2 + 0.5 - _distance(stroke.points), 0, 1)).astype(np.uint8)
        covered = (level > 0) & (level >= opacity)
        pixels[covered] = 1 + _LEVELS * stroke.colour + level[covered] - 1
        opacity[covered] = level[covered]
    shades = [round(255 * level / _LEVELS) for level in range(1, _LEVELS + 1)]
    palette = bytes(3) + b"".join(bytes(colour) * _LEVELS for colour in _COLOURS)
    rows = b"".join(b"\0" + row.tobytes() for row in pixels)
    # One stored block: compressors differ in what they make of the same bytes.
    stored = (
        b"\x78\x01\x01"
        + struct.pack("<HH", len(rows), len(rows) ^ 0xFFFF)
        + rows
        + struct.pack(">I", zlib.adler32(rows))
    )
    chunks = (
        (b"IHDR", struct.pack(">IIBBBBB", SIZE, SIZE, 8, 3, 0, 0, 0)),
        (b"PLTE", palette),
        (b"tRNS", bytes([0, *shades * len(_COLOURS)])),
        (b"IDAT", stored),
        (b"IEND", b""),
    )
    return b"\x89PNG\r\n\x1a\n" + b"".join(_chunk(kind, data) for kind, data in chunks)


def _distance(points: Line) -> NDArray:
    """Distance of each pixel's centre from a line."""
    x, y = np.meshgrid(np.arange(SIZE) + 0.5, np.arange(SIZE) + 0.5)
    nearest = np.full((SIZE, SIZE), np.inf)
    for (x_0, y_0), (x_1, y_1) in pairwise(points if len(points) > 1 else points * 2):
        dx, dy = x_1 - x_0, y_1 - y_0
        along = np.clip(((x - x_0) * dx + (y - y_0) * dy) / ((dx**2 + dy**2) or 1.0), 0, 1)
        nearest = np.minimum(nearest, (x - x_0 - along * dx) ** 2 + (y - y_0 - along * dy) ** 2)
    return np.sqrt(nearest)


def _chunk(kind: bytes, data: bytes) -> bytes:
    return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))
