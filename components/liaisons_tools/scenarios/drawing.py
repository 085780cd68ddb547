"""The one figure of a scenario: panels, and dots through which its curves have to pass."""

from __future__ import annotations

from pathlib import Path
from string import ascii_letters
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from liaisons.base.arguments import shown
from liaisons.base.files import replacement_path
from liaisons.errors import ValidityError

_WIDTH = 5.2
"""Width of a panel [in]."""
_HEIGHT = 4.0
"""Height of a panel [in]."""
_SMALL = 0.55
"""Size of the panel of a thumbnail, relative to that in the figure: its words stay as large."""


def panels(
    *labels: tuple[str, ...], mosaic: str = "", size: tuple[float, float] | None = None, **options: Any
) -> list[Any]:
    """Make the scenario's figure; return the axes of its panels, from left to right.

    :param labels: for each panel its title and the labels of x, y and, if it is three-dimensional, z, with units.
    :param mosaic: arrangement of the panels if it is not one row, "ab;cc": the first is a, the second b ...
    :param size: width and height of the figure [in].
    :param options: of ``matplotlib.pyplot.subplot_mosaic``: ``width_ratios``, ``sharex`` ...
    :raises ValidityError: unless each panel has three or four labels, and the mosaic has as many panels.
    """
    import matplotlib.pyplot as plt

    for label in labels:
        if not isinstance(label, tuple) or len(label) not in (3, 4):
            raise ValidityError(f"panels: {shown(label)} names no panel; give (title, x label, y label)")
    letters = ascii_letters[: len(labels)]
    mosaic = mosaic or letters
    if set(mosaic) - set(";.") != set(letters):
        raise ValidityError(f"panels: the mosaic {mosaic!r} has to show each of the panels {letters!r}, and no other")
    rows = mosaic.split(";")
    figure = plt.figure(figsize=size or (_WIDTH * len(set(rows[0])), _HEIGHT * len(rows)), layout="constrained")
    spatial: Any = {
        letter: {"projection": "3d"} for letter, label in zip(letters, labels, strict=True) if len(label) == 4
    }
    axes = figure.subplot_mosaic(mosaic, per_subplot_kw=spatial, **options)
    for letter, label in zip(letters, labels, strict=True):
        axes[letter].set(title=label[0], **dict(zip(("xlabel", "ylabel", "zlabel"), label[1:], strict=False)))
    return [axes[letter] for letter in letters]


def dots(axis: Any, x: ArrayLike, y: ArrayLike, *, every: int = 0, **style: Any) -> None:
    """Draw points of a reference, through which a curve should pass.

    :param axis: a panel.
    :param x: along the axis, shape (n,).
    :param y: across, shape (n,).
    :param every: number of points per dot; unless given, about forty dots are drawn.
    :param style: of the dots as for ``axis.plot``, and their label; small and black unless given.
    """
    x, y = np.asarray(x), np.asarray(y)
    chosen = slice(None, None, every or max(1, x.size // 40))
    axis.plot(x[chosen], y[chosen], **{"linestyle": "", "marker": ".", "color": "k", "markersize": 4} | style)


def save(path: Path) -> None:
    """Write the figure to a file, with a legend below each panel, or one for all panels if their labels are equal.

    :raises ValidityError: if there is none.
    """
    import matplotlib.pyplot as plt
    from matplotlib.transforms import ScaledTranslation

    if not plt.get_fignums():
        raise ValidityError(f"{path.stem} draws nothing: give it panels((title, x label, y label))")
    figure = plt.gcf()
    entries = {axis: axis.get_legend_handles_labels() for axis in figure.axes if axis.get_legend() is None}
    entries = {axis: entry for axis, entry in entries.items() if entry[1]}
    if len(entries) > 1 and len({tuple(labels) for _, labels in entries.values()}) == 1:
        figure.legend(*next(iter(entries.values())), loc="outside lower center", ncols=4)
        entries = {}
    for axis, (handles, labels) in entries.items():
        depth = 0.45 if axis.get_xlabel() else 0.1  # of ticks and label [in]
        below = axis.transAxes + ScaledTranslation(0, -depth, figure.dpi_scale_trans)
        width = 1.15 * axis.get_position().width * figure.get_figwidth()  # with that of the label beside it [in]
        widths = [0.5 + 0.07 * len(label) for label in labels]
        columns = len(labels) if sum(widths) <= width else max(1, int(width / max(widths)))
        axis.legend(handles, labels, loc="upper center", bbox_to_anchor=(0.5, 0), bbox_transform=below, ncols=columns)
    _lay_out(figure)
    _write(figure, path, figure.get_tightbbox().padded(0.1))  # with legends below axes of equal aspect


def save_panel(path: Path, number: int) -> None:
    """Write one panel of the scenario's figure to a file, small, without title and legend."""
    import matplotlib.pyplot as plt

    figure = plt.gcf()
    panel: Any = figure.axes[number]
    width, height = figure.get_size_inches()
    for axis in figure.axes:
        axis.set_title("")
        is_shown = axis is panel or axis.get_subplotspec() is None  # a bar of colours has none
        axis.set_visible(is_shown)
        axis.set_in_layout(is_shown)  # Matplotlib finds no box around axes in space that are invisible
        if legend := axis.get_legend():
            legend.remove()
    figure.legends.clear()
    figure.set_size_inches(_SMALL * width, _SMALL * height)
    _lay_out(figure)
    box = panel.get_tightbbox().transformed(figure.dpi_scale_trans.inverted())
    _write(figure, path, box.padded(0.05))


def _lay_out(figure: Any) -> None:
    """Give the panels their places."""
    if engine := figure.get_layout_engine():
        engine.execute(figure)


def _write(figure: Any, path: Path, box: Any) -> None:
    """Write what lies in a box [in] of a figure that is laid out: Matplotlib would draw it once more for that."""
    engine = figure.get_layout_engine()
    figure.set_layout_engine("none")
    with replacement_path(path) as whole:
        figure.savefig(whole, format=path.suffix[1:], dpi=150, bbox_inches=box)
    if engine:
        figure.set_layout_engine(engine)
