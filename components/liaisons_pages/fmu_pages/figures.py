"""Figures of an FMU's page, drawn into it: the mechanism at its start, and the default experiment."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from html import escape

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from liaisons.fmu import start_vectors
from liaisons.language import Variable
from liaisons.mechanics import Model
from liaisons.reference_results import Trajectory
from liaisons.results import Picture
from liaisons_pages.pictures import Face, Stage, picture_frames

_WIDTH, _HEIGHT = 640.0, 220.0
_TALLEST = 360.0
_MOST_SHAPES = 60  # of a longer chain the page would be all picture
_COLOURS = ("#c8532b", "#2f6fa8", "#3f8f6b", "#8a5aa8")


def picture_faces(model: Model, results: Trajectory | None) -> list[Face]:
    """Return the mechanism at the start of its default experiment, with its trail; nothing without a picture.

    :param results: of the default experiment, if there are any.
    """
    if model.picture is None or not 0 < len(model.picture["shapes"]) <= _MOST_SHAPES:
        return []
    declared = Picture(tuple(model.picture["shapes"]))
    values = _picture_values(model, results)
    time = np.zeros(1) if results is None else results.times
    backwards = {name: np.broadcast_to(column, time.shape)[::-1] for name, column in values.items()}
    if not any(shape["shape"] == "trail" for shape in declared.shapes):
        time, backwards = time[:1], {name: column[-1:] for name, column in backwards.items()}
    seen = picture_frames(declared, time, backwards.__getitem__, title=model.name)  # a trail ends at the start
    return Stage(seen).faces(len(seen.time) - 1)


def _picture_values(model: Model, results: Trajectory | None) -> Mapping[str, NDArray]:
    """Return values of all variables by name, shape (n,) at the times of the results, (1,) at the start without."""
    m = model if results is None else results.model
    u, k = start_vectors(m)
    if results is None:
        y, memory = m.start.call([ca.DM(0), u, k])
        z = m.outputs_function.call([ca.DM(0), y, u, k, memory])[0]
        results = Trajectory(m, np.zeros(1), u[None], np.array(y).T, np.array(z).T)
    count = len(results.times)
    drawn = np.zeros((count, 0))
    if m.draw is not None:
        arguments = results.times, results.states.T, results.inputs.T, np.tile(k, (count, 1)).T
        drawn = np.array(m.draw.map(count)(*arguments)).T
    groups = ((m.parameters, k[None]), (m.inputs, results.inputs), (m.outputs, results.values), (m.drawn, drawn))
    return {
        name: column
        for variables, table in groups
        for name, column in zip(_element_names(variables), table.T, strict=True)
    }


def _element_names(variables: Iterable[Variable]) -> list[str]:
    """Return the names of the elements of variables."""
    return [element.name for variable in variables for element in variable.elements()]


def picture_svg(faces: list[Face], name: str) -> list[str]:
    """Return lines of SVG with faces, scaled to the width of the page; none without faces."""
    if not faces:
        return []
    corners = np.concatenate([face.corners for face in faces])
    low, high = corners.min(axis=0), corners.max(axis=0)
    scale = float(np.min(np.array([_WIDTH, _TALLEST]) / np.maximum(high - low, 1e-9)))
    width, height = scale * (high - low)
    lines = [_svg_start_tag((width - _WIDTH) / 2 - 10, -10, _WIDTH + 20, height + 20, name)]
    for face in faces:
        corners = scale * (face.corners - (low[0], high[1])) * (1, -1)
        colour = "".join(f"{round(255 * part):02x}" for part in face.colour[:3])
        faint = f' opacity="{face.colour[3]:.2f}"' if face.colour[3] < 1 else ""
        lines.append(f'<polygon points="{_point_list(corners)}" fill="#{colour}"{faint}/>')
    return [*lines, "</svg>"]


def plot_svg(results: Trajectory | None) -> list[str]:
    """Return lines of SVG: curves of free coordinates or signals of one unit over time; none without results."""
    if results is None or not (variables := _plotted_variables(results.model)):
        return []
    names = _element_names(variables)[: len(_COLOURS)]
    curves = np.concatenate([results[variable.name] for variable in variables], axis=1).T[: len(_COLOURS)]
    low, high = float(curves.min()), float(curves.max())
    scale, x = _HEIGHT / (high - low or 1.0), _WIDTH * results.times / results.times[-1]
    lines = [_svg_start_tag(-70, -14, _WIDTH + 90, _HEIGHT + 44, "the default experiment")]
    lines.append(f'<rect width="{_WIDTH:.0f}" height="{_HEIGHT:.0f}" class="frame"/>')
    if low < 0 < high:
        lines.append(f'<path d="M0 {scale * high:.1f}H{_WIDTH:.0f}" class="frame"/>')
    for colour, curve in zip(_COLOURS, curves, strict=False):
        line = np.column_stack([x, scale * (high - curve)])
        lines.append(f'<polyline points="{_point_list(line)}" stroke="{colour}"/>')
    top, bottom = (f"{edge if abs(edge) > 1e-9 * (high - low) else 0:.3g}" for edge in (high, low))
    labels = ((-6, 10, top), (-6, _HEIGHT, bottom), (_WIDTH, _HEIGHT + 18, f"{results.times[-1]:g} s"))
    lines += [f'<text x="{x:.0f}" y="{y:.0f}" text-anchor="end">{text}</text>' for x, y, text in labels]
    legend = (f'<span style="color:{c}">{escape(n)}</span>' for c, n in zip(_COLOURS, names, strict=False))
    return [*lines, "</svg>", f"<p class=note>{', '.join(legend)} [{escape(variables[0].unit)}]</p>"]


def _plotted_variables(model: Model) -> list[Variable]:
    """Return the free coordinates, or the signals, that have the unit of the first one."""
    moving = {s.name for s in model.states if not s.name.startswith("p_")} - {"work", "dissipated"}
    signals = {port.members[0].variable for port in model.ports if port.kind == "signal"}
    chosen = [variable for variable in model.outputs if variable.name in (moving or signals)]
    return [variable for variable in chosen if variable.unit == chosen[0].unit]


def _svg_start_tag(x: float, y: float, width: float, height: float, label: str) -> str:
    """Return the start tag of an SVG figure."""
    box = f"{x:.0f} {y:.0f} {width:.0f} {height:.0f}"
    return f'<svg class="figure" viewBox="{box}" role="img" aria-label="{escape(label)}">'


def _point_list(points: NDArray) -> str:
    """Return points, shape (n, 2), as the text of an SVG attribute."""
    return " ".join(f"{x:.1f},{y:.1f}" for x, y in (np.round(points, 1) + 0.0).tolist())
