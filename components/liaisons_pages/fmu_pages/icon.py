"""Icon of a component: its picture, or a signal; else letters.

Drawn from the default experiment, as lines and polygons in pixels: by Pillow and as text, since an import of Matplotlib
takes longer than all other parts of a build but the compiler.  The guid does not depend on it.
"""

from __future__ import annotations

import re
from functools import lru_cache
from io import BytesIO
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from liaisons.mechanics import Model
from liaisons.reference_results import trajectory
from liaisons_pages.fmu_pages.figures import picture_faces

SIZE = 96
"""Width and height in pixels."""
KINDS = ("png", "svg")
"""Formats."""

_MARGIN = 14
_INK, _ACCENT = "#5f6f86", "#d9782d"  # both can be seen on white and on black
_OUTLINE = 3.0  # width of the outline of shapes, without which thin ones are hard to see
_FINENESS = 4  # pixels that are drawn for one of the PNG, in each direction: their mean smooths edges
_FRAME = np.array([[0, 0], [0, 1], [1, 1], [1, 0], [0, 0]])
_ROUND = np.linspace(0, 2 * np.pi, 24)
_DOT = 5.5 * np.column_stack([np.cos(_ROUND), np.sin(_ROUND)])


class _Mark(NamedTuple):
    """A line, or a polygon and its outline."""

    points: NDArray  # (n, 2), pixels to the right and down
    colour: str
    width: float = _OUTLINE
    opacity: float = 1.0
    filled: bool = False


def icon(model: Model, kind: str) -> bytes:
    """Return the file of the icon of a kind, ``"png"`` or ``"svg"``."""
    return _icons(model)[kind]


@lru_cache(maxsize=1)
def _icons(model: Model) -> dict[str, bytes]:
    """Return the files of the icon by their kinds."""
    letters = ""
    if not (marks := _experiment(model)):
        letters = "".join(_initials(model.name)).upper()
        marks = [_Mark(_in_pixels(_FRAME, equal=True), _INK)]
    return {"png": _png(marks, letters), "svg": _svg(marks, letters).encode()}


def _experiment(model: Model) -> list[_Mark]:
    """Return the mechanism at its start, else the first signal that changes; nothing if there is none."""
    results = trajectory(model)
    if faces := picture_faces(model, results):
        corners = _in_pixels(np.concatenate([face.corners for face in faces]), equal=True)
        parts = np.split(corners, np.cumsum([len(face.corners) for face in faces])[:-1])
        colours = [f"#{''.join(f'{round(255 * part):02x}' for part in face.colour[:3])}" for face in faces]
        return [
            _Mark(points, colour, opacity=[*face.colour, 1.0][3], filled=True)
            for face, points, colour in zip(faces, parts, colours, strict=True)
        ]
    signals = () if results is None else (results[p.name] for p in results.model.ports if p.kind == "signal")
    changing = next((signal[:, 0] for signal in signals if np.ptp(signal) > 0), None)
    if results is None or changing is None:
        return []
    curve = _in_pixels(np.column_stack([results.times, changing]))
    return [_Mark(curve, _ACCENT, 2.0), _Mark(curve[0] + _DOT, _INK, 0.0, filled=True)]


def _in_pixels(points: NDArray, *, equal: bool = False) -> NDArray:
    """Return points, (n, 2) to the right and up, in pixels inside the margins; ``equal``: not distorted."""
    low, high = points.min(axis=0), points.max(axis=0)
    extent = np.where(high > low, high - low, 1e-300)
    scale = (SIZE - 2 * _MARGIN) / (np.full(2, extent.max()) if equal else extent)
    return SIZE / 2 + scale * (1, -1) * (points - (low + high) / 2)


def _initials(name: str) -> list[str]:
    """Return up to three initials of a name."""
    return re.findall(r"[A-Z0-9]|(?<![a-zA-Z0-9])[a-z]", name.replace("_", " "))[:3]


def _letter_size(letters: str) -> float:
    """Return the height of letters that fit into the frame."""
    return 56.0 if len(letters) < 2 else 66.0 / len(letters)


def _svg(marks: list[_Mark], letters: str) -> str:
    """Return the text of an SVG file."""
    lines = [
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{SIZE}" height="{SIZE}" viewBox="0 0 {SIZE} {SIZE}">',
        '<g stroke-linejoin="round" stroke-linecap="round">',
    ]
    for mark in marks:
        path = "L".join(f"{x:.2f} {y:.2f}" for x, y in mark.points.tolist())
        fill, end = (mark.colour, "Z") if mark.filled else ("none", "")
        stroke = f'stroke="{mark.colour}" stroke-width="{mark.width:g}" opacity="{mark.opacity:.3g}"'
        lines.append(f'<path d="M{path}{end}" fill="{fill}" {stroke}/>')
    lines.append("</g>")
    if letters:
        style = f'fill="{_ACCENT}" font-size="{_letter_size(letters):g}" font-family="sans-serif" font-weight="bold"'
        lines.append(f'<text x="50%" y="50%" dy=".36em" text-anchor="middle" {style}>{letters}</text>')
    return "\n".join([*lines, "</svg>", ""])


def _png(marks: list[_Mark], letters: str) -> bytes:
    """Return the content of a PNG file."""
    from PIL import Image, ImageDraw, ImageFont

    canvas = Image.new("RGBA", (_FINENESS * SIZE, _FINENESS * SIZE))
    for mark in marks:
        layer = Image.new("RGBA", canvas.size)
        draw, colour = ImageDraw.Draw(layer), f"{mark.colour}{round(255 * mark.opacity):02x}"
        points = [(x, y) for x, y in (_FINENESS * mark.points).tolist()]
        if mark.filled:
            draw.polygon(points, fill=colour)
            points += points[:1]
        if mark.width:
            draw.line(points, fill=colour, width=round(_FINENESS * mark.width))
            for point in points:  # joins and ends are round
                draw.circle(point, _FINENESS * mark.width / 2, fill=colour)
        canvas.alpha_composite(layer)
    if letters:
        font = ImageFont.load_default(_FINENESS * _letter_size(letters))
        centre = _FINENESS * SIZE / 2
        ImageDraw.Draw(canvas).text(
            (centre, centre), letters, _ACCENT, font, anchor="mm", stroke_width=_FINENESS, stroke_fill=_ACCENT
        )
    file = BytesIO()
    canvas.resize((SIZE, SIZE), Image.Resampling.BOX).save(file, "png")
    return file.getvalue()
