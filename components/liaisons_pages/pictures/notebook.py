"""Tables and pages in notebooks; all text is escaped, since names and messages come from any FMU."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from html import escape
from itertools import islice

import numpy as np

from liaisons.base.arrays import Floats
from liaisons.errors import LiaisonsError
from liaisons.results import Result
from liaisons_pages.pictures.animation import motion_page

_MOST_ROWS = 100
"""Rows of a table."""
_MOST_BYTES = 300_000
"""Largest page of a motion [bytes]; :meth:`Result.animate` writes larger ones."""
_MOST_FRAMES = 120_000
"""Largest size of the frames in such a page [bytes]."""
_FRAME_HEIGHT = 420
"""Height of the page of a motion [px]."""
_WIDTH = 120
"""Width of a small diagram [px], at most one point a pixel."""
_HEIGHT = 24
"""Height of a small diagram [px]."""
_ROUNDING = 1e-9
"""Largest rounding error of a signal, relative to its size; a smaller change is drawn as none."""


def result_html(signals: Result) -> str:
    """HTML by which a notebook shows signals: their motion, if there is one, and a table with small diagrams."""
    remarks = [f"case {case} failed: {reason}" for case, reason in islice(signals.failures.items(), _MOST_ROWS)]
    motion, problems = _motion_frame(signals)
    remarks += [*problems, *(f"Warning: {text}" for text in signals.warnings)]
    names = [] if signals.kind == "sweep" else signals.entries[:_MOST_ROWS]
    curves = [_small_diagram(signals.numbers(name)) for name in names]
    return motion + _table(signals.headline, signals.summary(_MOST_ROWS, few=0), curves, remarks)


def _motion_frame(signals: Result) -> tuple[str, list[str]]:
    """HTML frame of the motion, empty if there is none; and reasons why it cannot be shown."""
    if signals.scene is None:
        return "", []
    numbers = dict(zip(signals.names, signals.values, strict=True))
    try:
        page = motion_page(signals.scene, signals.time, numbers, title=signals.title, most=_MOST_FRAMES)
    except LiaisonsError as error:
        return "", [f"The motion cannot be shown: {error}"]
    frame = sandboxed_frame(page, _FRAME_HEIGHT) if page else ""
    if len(frame) > _MOST_BYTES:
        return "", ["The motion is too large to be shown here; result.animate(path) writes it."]
    return frame, []


def _table(title: str, rows: Sequence[Mapping[str, str]], curves: Sequence[str], remarks: Sequence[str]) -> str:
    """HTML table of rows by name of the column, with a diagram beside each of them, and remarks below."""
    columns = [f"<th>{escape(name)}</th>" for name in (rows[0] if rows else ())]
    lines = [[f"<td>{escape(cell)}</td>" for cell in row.values()] for row in rows]
    for line, curve in zip(lines, curves, strict=False):
        line.append(f"<td>{curve}</td>")
    body = "".join(f"<tr>{''.join(line)}</tr>" for line in lines)
    below = "".join(f"<div>{escape(remark)}</div>" for remark in remarks)
    head = f"<caption>{escape(title)}</caption><thead><tr>{''.join(columns)}</tr></thead>"
    return f"<table>{head}<tbody>{body}</tbody></table>{below}"


def sandboxed_frame(page: bytes, height: int) -> str:
    """HTML frame of a page whose script cannot read the notebook.

    :param height: of the frame [px].
    """
    return (
        f'<iframe sandbox="allow-scripts" srcdoc="{escape(page.decode())}" '
        f'style="width: 100%; height: {height}px; border: 0"></iframe>'
    )


def _small_diagram(values: Floats) -> str:
    """SVG diagram of values, shape (points, ...): the band between the smallest and the largest finite ones."""
    parts = enumerate(np.array_split(values, min(len(values), _WIDTH)))
    bands = [(x, finite.min(), finite.max()) for x, part in parts if (finite := part[np.isfinite(part)]).size]
    if not bands:
        return ""
    x, low, high = np.array(bands).T
    border = np.array([[*x, *x[::-1]], [*high, *low[::-1]]])
    span = max(high.max() - low.min(), _ROUNDING * abs(border[1]).max()) or 1.0
    x_scale, y_scale = _WIDTH / max(x[-1], 1), (_HEIGHT - 2) / span
    points = " ".join(f"{a * x_scale:.1f},{1 + (high.max() - b) * y_scale:.1f}" for a, b in border.T)
    return (
        f'<svg width="{_WIDTH}" height="{_HEIGHT}"><polygon points="{points}" '
        'fill="currentColor" fill-opacity="0.3" stroke="currentColor"/></svg>'
    )
