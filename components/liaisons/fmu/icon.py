"""Icon of a component: its named points and their paths, a path in the plane or in phase space, a signal; else letters.

Drawn from the default experiment.  The guid does not depend on it: another matplotlib draws another icon.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from io import BytesIO
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from liaisons.fmu.layout import Fmi
from liaisons.fmu.reference_results import Trajectory, trajectory
from liaisons.mechanics.model import Model

if TYPE_CHECKING:
    from matplotlib.axes import Axes

SIZE = 96
"""Width and height in pixels."""

_MARGIN = 14 / SIZE
_INK, _ACCENT = "#5f6f86", "#d9782d"  # both can be seen on white and on black
_FLAT = 1e-6  # a picture this much wider than high is a line, and shows nothing
_STYLE = {"path.simplify": False, "path.snap": False, "lines.solid_capstyle": "round", "lines.markeredgewidth": 0.0}
_METADATA = {"png": {"Software": None}, "svg": dict.fromkeys(("Creator", "Date", "Format", "Type"))}


def icon_members(model: Model, fmi: Fmi) -> dict[str, bytes]:
    """Return the files of the icon, PNG and SVG, by path in the archive; FMI 2.0 has a PNG at the root, too."""
    import matplotlib.style
    from matplotlib.figure import Figure

    files = {kind: BytesIO() for kind in _METADATA}
    with matplotlib.style.context(["default", _STYLE, {"svg.hashsalt": model.name}]):
        figure = Figure((SIZE / 72, SIZE / 72), dpi=72)  # a point is a pixel
        axes = figure.add_axes((_MARGIN, _MARGIN, 1 - 2 * _MARGIN, 1 - 2 * _MARGIN))
        axes.set_axis_off()
        axes.margins(0)
        if not _draw_experiment(axes, trajectory(model)):
            _write_initials(axes, model.name)
        for kind, file in files.items():
            figure.savefig(file, format=kind, transparent=True, metadata=_METADATA[kind])
    members = {f"terminalsAndIcons/icon.{kind}": file.getvalue() for kind, file in files.items()}
    return members | ({"model.png": members["terminalsAndIcons/icon.png"]} if fmi == "2" else {})


def _draw_experiment(axes: Axes, results: Trajectory | None) -> bool:
    """Draw paths of points, else a path in the plane or in phase space, else a signal; returns whether it did."""
    if results is None:
        return False
    points = _paths_in_planes(results, "point")
    if points:  # they hang on each other, the first on the origin
        paths = np.concatenate(points, axis=1)
        _draw_paths(axes, [*np.moveaxis(paths, 1, 0)], paths[0])
        axes.plot(*np.vstack([np.zeros(2), paths[0]]).T, color=_INK, linewidth=3, clip_on=False)
        axes.plot(0, 0, "o", color=_INK, markersize=6, clip_on=False)
        axes.set_aspect("equal")
        return True
    free = _paths_in_planes(results, "free")
    phases = [
        np.stack([results[state.name], results[f"p_{state.name}"]], axis=-1)
        for state in results.model.states
        if f"p_{state.name}" in results
    ]
    signals = [results[port.name] for port in results.model.ports if port.kind == "signal"]
    curves = [np.stack([results.times[:, None], signal], axis=-1) for signal in signals]
    for k, path in enumerate(path[:, 0] for path in (*free, *phases, *curves)):
        if np.min(np.ptp(path, axis=0)) > _FLAT * np.max(np.ptp(path, axis=0)):
            _draw_paths(axes, [path], path[:1])
            axes.set_aspect("equal" if k < len(free) else "auto")
            return True
    return False


def _draw_paths(axes: Axes, paths: Sequence[NDArray], start: NDArray) -> None:
    """Draw thin paths, (n, 2) each, and dots where they start."""
    for path in paths:
        axes.plot(*path.T, color=_ACCENT, linewidth=2, clip_on=False)
    axes.plot(*start.T, "o", color=_INK, markersize=11, clip_on=False)


def _paths_in_planes(results: Trajectory, kind: str) -> list[NDArray]:
    """Return paths of points whose ports are of a kind, (n, count, 2) each, in the plane in which they vary most."""
    components: dict[str, list[str]] = {}
    for port in results.model.ports:
        point, _, axis = port.name.rpartition("_")
        if port.kind == kind and axis in ("x", "y", "z"):
            components.setdefault(point, []).append(port.name)
    paths: list[NDArray] = []
    for axes in components.values():
        varied = sorted(axes, key=lambda name: -float(np.ptp(results[name])))[:2]
        if len(varied) == 2:
            paths.append(np.stack([results[name] for name in axes if name in varied], axis=-1))
    return paths


def _write_initials(axes: Axes, name: str) -> None:
    """Write up to three initials of a name into a frame."""
    initials = re.findall(r"[A-Z0-9]|(?<![a-zA-Z0-9])[a-z]", name.replace("_", " "))[:3]
    axes.plot([0, 1, 1, 0, 0], [0, 0, 1, 1, 0], color=_INK, linewidth=3, clip_on=False)
    size = 56 if len(initials) < 2 else 60 / len(initials)
    text = axes.text(0.5, 0.48, "".join(initials).upper(), color=_ACCENT, fontsize=size, fontweight="bold")
    text.set(horizontalalignment="center", verticalalignment="center_baseline")
