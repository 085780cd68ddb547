"""Tables and pages in notebooks; whatever text is shown is escaped, for names and messages come from any FMUs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from html import escape

import numpy as np
from numpy.typing import NDArray

_WIDTH, _HEIGHT = 120, 24
"""Of a small picture [px]; it has a point every pixel at most."""
_ROUNDING = 1e-9
"""What moves by less than this part of its size is still."""


def html_table(
    title: str, rows: Sequence[Mapping[str, str]], *, curves: Sequence[str] = (), remarks: Sequence[str] = ()
) -> str:
    """A table.

    :param rows: the first names the columns.
    :param curves: of :func:`curve`, one beside each row, or none.
    :param remarks: lines below.
    """
    columns = [f"<th>{escape(name)}</th>" for name in (rows[0] if rows else ())]
    lines = [[f"<td>{escape(cell)}</td>" for cell in row.values()] for row in rows]
    for line, picture in zip(lines, curves, strict=False):
        line.append(f"<td>{picture}</td>")
    body = "".join(f"<tr>{''.join(line)}</tr>" for line in lines)
    below = "".join(f"<div>{escape(remark)}</div>" for remark in remarks)
    head = f"<caption>{escape(title)}</caption><thead><tr>{''.join(columns)}</tr></thead>"
    return f"<table>{head}<tbody>{body}</tbody></table>{below}"


def framed(page: bytes, height: int) -> str:
    """A page as a part of a notebook, in a sandbox: its script runs, and sees nothing of what is around it.

    :param height: of the frame [px].
    """
    return (
        f'<iframe sandbox="allow-scripts" srcdoc="{escape(page.decode())}" '
        f'style="width: 100%; height: {height}px; border: 0"></iframe>'
    )


def curve(values: NDArray[np.float64]) -> str:
    """A small picture, of many curves the band between the lowest and the highest.

    :param values: shape (points, ...); those that are not finite are left out.
    """
    parts = enumerate(np.array_split(values, min(len(values), _WIDTH)))
    bands = [(x, found.min(), found.max()) for x, part in parts if (found := part[np.isfinite(part)]).size]
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
