"""Icon of a component: its picture, or a signal; else letters.

Drawn from the default experiment.  The guid does not depend on it: another matplotlib draws another icon.
"""

from __future__ import annotations

import re
from functools import lru_cache
from io import BytesIO
from typing import TYPE_CHECKING

import numpy as np

from liaisons.mechanics import Model
from liaisons.reference_results import trajectory
from liaisons_pages.fmu_pages.figures import picture_faces

if TYPE_CHECKING:
    from matplotlib.axes import Axes

SIZE = 96
"""Width and height in pixels."""

_MARGIN = 14 / SIZE
_INK, _ACCENT = "#5f6f86", "#d9782d"  # both can be seen on white and on black
_LINE = 3  # width of the outline of shapes, without which thin ones are hard to see
_STYLE = {"path.simplify": False, "path.snap": False, "lines.solid_capstyle": "round", "lines.markeredgewidth": 0.0}
KINDS: dict[str, dict[str, None]] = {
    "png": {"Software": None},
    "svg": dict.fromkeys(("Creator", "Date", "Format", "Type")),
}
"""Formats, and the metadata that each has without."""


def icon(model: Model, kind: str) -> bytes:
    """Return the file of the icon of a kind, ``"png"`` or ``"svg"``."""
    return _icons(model)[kind]


@lru_cache(maxsize=1)
def _icons(model: Model) -> dict[str, bytes]:
    """Return the files of the icon by their kinds."""
    import matplotlib.style
    from matplotlib.figure import Figure

    files = {kind: BytesIO() for kind in KINDS}
    with matplotlib.style.context(["default", _STYLE, {"svg.hashsalt": model.name}]):
        figure = Figure((SIZE / 72, SIZE / 72), dpi=72)  # a point is a pixel
        axes = figure.add_axes((_MARGIN, _MARGIN, 1 - 2 * _MARGIN, 1 - 2 * _MARGIN))
        axes.set_axis_off()
        axes.margins(0)
        if not _draw_experiment(axes, model):
            _write_initials(axes, model.name)
        for kind, file in files.items():
            figure.savefig(file, format=kind, transparent=True, metadata=KINDS[kind])
    return {kind: file.getvalue() for kind, file in files.items()}


def _draw_experiment(axes: Axes, model: Model) -> bool:
    """Draw the mechanism at its start, else the first signal that changes; returns whether there is one."""
    results = trajectory(model)
    for face in (faces := picture_faces(model, results)):
        axes.fill(*face.corners.T, color=face.colour, linewidth=_LINE, joinstyle="round", clip_on=False)
    if faces or results is None:
        axes.set_aspect("equal")
        return bool(faces)
    signals = (results[port.name] for port in results.model.ports if port.kind == "signal")
    changing = next((signal[:, 0] for signal in signals if np.ptp(signal) > 0), None)
    if changing is not None:
        axes.plot(results.times, changing, color=_ACCENT, linewidth=2, clip_on=False)
        axes.plot(0, changing[0], "o", color=_INK, markersize=11, clip_on=False)
    return changing is not None


def _write_initials(axes: Axes, name: str) -> None:
    """Write up to three initials of a name into a frame."""
    initials = re.findall(r"[A-Z0-9]|(?<![a-zA-Z0-9])[a-z]", name.replace("_", " "))[:3]
    axes.plot([0, 1, 1, 0, 0], [0, 0, 1, 1, 0], color=_INK, linewidth=3, clip_on=False)
    size = 56 if len(initials) < 2 else 60 / len(initials)
    text = axes.text(0.5, 0.48, "".join(initials).upper(), color=_ACCENT, fontsize=size, fontweight="bold")
    text.set(horizontalalignment="center", verticalalignment="center_baseline")
