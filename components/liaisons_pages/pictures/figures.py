"""Figures of signals: one diagram a unit, free coordinates first."""

from __future__ import annotations

import math
from collections.abc import Callable, Container, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from liaisons.base.arguments import name_dictionary, shown
from liaisons.base.array_names import array_and_index
from liaisons.base.arrays import Floats
from liaisons.base.files import replacement_path
from liaisons.base.port_names import PortNames, port_names
from liaisons.errors import SimulationError
from liaisons.results import Result

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

Curves = Mapping[str, Floats]
"""Name -> values, shape (points,) or (points, elements)."""
_Grid = tuple[Floats, Floats, NDArray[np.intp]]
_Subplots = Callable[[Sequence[str], int], "Sequence[Axes]"]
"""Labels of groups of signals, and the number of columns -> a diagram a group."""

DIAGRAMS = 6
"""Most diagrams in a figure."""
CURVES = 8
"""Most curves in a diagram."""
_PIXEL = 1 / 200
"""Largest difference that cannot be seen, in heights of a diagram."""
_CHANGING = 1 / 50
"""Least change of a signal, relative to its largest value, that can be seen in a diagram from 0."""
_CHANGING_MARGIN = 20
"""How far other signals that change may lie outside the range of the first ones, in heights of that range."""
_STILL_MARGIN = 1 / 2
"""The same for signals that do not change."""
_SMALL_PRINT = 8
"""Size of letters in a figure whose width is given [pt]."""
_ROUNDING = 1e-9
"""Largest rounding error, relative to the largest value of a unit, or to 1 for angles and numbers without unit."""


def default_names(signals: Curves, units: Mapping[str, str], ports: Mapping[str, PortNames]) -> list[str]:
    """Names of the signals that are drawn by default.

    At most six units and eight signals of each: free coordinates, their rates, prescribed coordinates, energies,
    forces and powers come before accelerations, momenta and loads.  Constant units are left out, and signals that look
    like 0 or like another signal, or would flatten the curves of those before them; unless there are no others.
    """
    our_names = {name: ours for value in ports for name, ours in zip(ports[value], port_names(value), strict=True)}
    ranks = {name: _default_rank(our_names.get(name, name), units[name], signals) for name in signals}
    groups: dict[str, list[str]] = {}
    for name in sorted(signals, key=ranks.__getitem__):
        groups.setdefault(units[name], []).append(name)
    visible = [
        _distinguishable_names({name: signals[name] for name in names}, unit, ranks) for unit, names in groups.items()
    ]
    chosen = [name for names in [group for group in visible if group][:DIAGRAMS] for name in names]
    return chosen or [name for name in signals if _magnitude(signals[name]) > 0][:CURVES] or list(signals)[:CURVES]


def plot(
    result: Result,
    names: Sequence[str],
    over: str | None,
    path: Path | None,
    axes: Axes | None = None,
    *,
    labels: Mapping[str, str] | None = None,
    title: str | None = None,
    width: float | None = None,
) -> Figure:
    """Draw a diagram for each unit; of a sweep on a grid of two values, a map of each signal.

    :param names: what to draw; if empty, what :func:`default_names` chooses, or the first maps.
    :param over: signal on the horizontal axis; None: as in :meth:`liaisons.Result.plot`.
    :param path: file of the figure, which pyplot does not know then.
    :param axes: where to draw the only diagram; None: in a new figure.
    :param labels: what stands for names of signals and of the horizontal axis.
    :param title: that of the result unless given.
    :param width: of the figure [m]; None: 10 inches, with legends beside the diagrams.
    :raises SimulationError: for labels of what is not there, or a width that is not positive; if ``over`` and a signal
        have different shapes, ``axes`` are no ``Axes`` or one diagram is not enough, or the file cannot be written.
    """
    if width is not None and not 0 < width < math.inf:
        raise SimulationError(f"plot: width = {shown(width)}: give metres, 0.085 for one column")
    words = dict(name_dictionary("plot: labels", labels or {}, SimulationError))
    for name in words.keys() - result.index.keys():
        result.numbers(name)  # raises if it is unknown
    subplots = partial(_subplots, result.title if title is None else title, axes, in_pyplot=path is None, width=width)
    grid = _sweep_grid(result) if over is None else None
    if grid is None:
        diagrams = _draw_diagrams(result, names, over, subplots, words, legend_outside=axes is None and width is None)
    else:
        diagrams = _draw_maps(result, names, grid, subplots, words)
    figure = diagrams[0].figure.canvas.figure
    if width is not None:
        for diagram in figure.axes:
            diagram.tick_params(labelsize=_SMALL_PRINT)
            legend = diagram.get_legend()
            inside = legend.get_texts() if legend else []
            for text in (diagram.title, diagram.xaxis.label, diagram.yaxis.label, *inside):
                text.set_fontsize(_SMALL_PRINT)
    if path is not None:
        save_figure(figure, path)
    return figure


def _draw_diagrams(
    result: Result,
    names: Sequence[str],
    over: str | None,
    subplots: _Subplots,
    words: Mapping[str, str],
    *,
    legend_outside: bool,
) -> Sequence[Axes]:
    """Draw a diagram for each unit; returns its axes.

    :param words: what stands for a name.
    """
    timed = result.kind != "sweep"
    if over is None and not timed and np.all(np.diff(result.values[0]) > 0):
        over = result.names[0]
    signals = {name: result.numbers(name) for name in names or result if names or name != over}
    chosen = names or default_names(signals, result.units, result.ports)
    groups: dict[tuple[str, str], list[str]] = {}
    for name in dict.fromkeys(chosen):
        has_texts = result.element(name) in result.texts
        groups.setdefault((result.units[name], name if has_texts else ""), []).append(name)
    if over is None:
        label, x = next(iter(result.index.items()))
    else:
        label, x = over, result.numbers(over)
    unit = "s" if label == "time" else result.units.get(label)
    label = f"{words.get(label, label)} [{unit}]" if unit else words.get(label, label)
    joined = timed or over is not None
    diagrams = subplots([result.label(group[0]) for group in groups.values()], 1)
    for diagram, ((unit, text), group) in zip(diagrams, groups.items(), strict=False):
        for number, name in enumerate(group, len(diagram.get_legend_handles_labels()[0])):
            if x.ndim > 1 and x.shape != signals[name].shape:
                raise SimulationError(f"plot: {name} and {label} have different shapes; choose another over=...")
            style = {"color": f"C{number}", "linestyle": "-" if joined else "", "marker": "" if joined else "."}
            if timed and result.element(name) in result.jumping:
                style["drawstyle"] = "steps-post"
            _draw_curves(diagram, words.get(name, name), x, signals[name], style)
        alone = words.get(group[0], "") if len(group) == 1 else ""
        diagram.set_ylabel(f"{alone} [{unit}]".lstrip() if unit else alone)
        if text:
            texts = result.texts[result.element(text)]
            diagram.set_yticks(range(len(texts)), texts)
        outside: dict[str, Any] = {"loc": "upper left", "bbox_to_anchor": (1.0, 1.05)} if legend_outside else {}
        if not alone:
            diagram.legend(**outside, frameon=False, fontsize="small")
        diagram.grid(visible=True, alpha=0.3)
        diagram.margins(x=0.0)
    diagrams[-1].set_xlabel(label)
    return diagrams


def _sweep_grid(result: Result) -> _Grid | None:
    """Axes of the grid of a sweep, and the number of the case at [second, first]; None if it is no sweep on a grid."""
    if result.kind != "sweep" or len(result.names) < 3:
        return None
    (x, columns), (y, rows) = (np.unique(values, return_inverse=True) for values in result.values[:2])
    if min(x.size, y.size) < 2 or x.size * y.size != rows.size:
        return None
    cases = np.full((y.size, x.size), -1)
    cases[rows, columns] = np.arange(rows.size)
    return (x, y, cases) if cases.min() == 0 else None


def _draw_maps(
    result: Result, names: Sequence[str], grid: _Grid, subplots: _Subplots, words: Mapping[str, str]
) -> Sequence[Axes]:
    """Draw a map of each signal over the grid of a sweep, blank in failed cases; returns its axes."""
    for name in names:
        result.numbers(name)  # raises if it is unknown
    asked = [n for name in names for n in result.names if name in {n, array_and_index(n)[0]}] or result.names[
        2 : 2 + DIAGRAMS
    ]
    chosen = list(dict.fromkeys(asked))
    x, y, cases = grid
    diagrams = subplots(chosen, math.ceil(math.sqrt(len(chosen))))
    for diagram, name in zip(diagrams, chosen, strict=True):
        mesh = diagram.pcolormesh(x, y, result.numbers(name)[cases], rasterized=True)
        bar = diagram.figure.colorbar(mesh, ax=diagram, label=words.get(name, result.label(name)))
        if texts := result.texts.get(name):
            bar.set_ticks(range(len(texts)), labels=texts)
        xlabel, ylabel = (words.get(name, result.label(name)) for name in result.names[:2])
        diagram.set(xlabel=xlabel, ylabel=ylabel)
    return diagrams


def _subplots(
    title: str, axes: Axes | None, groups: Sequence[str], columns: int, *, in_pyplot: bool, width: float | None
) -> Sequence[Axes]:
    """Axes for each group of signals: of a new figure, or those that are given for a single group."""
    if axes is None:
        count = max(1, len(groups))
        rows = math.ceil(count / columns)
        figure = new_figure(in_pyplot=in_pyplot)
        if width is None:
            figure.set_size_inches(10.0, 1.0 + max(3.0, (1.6 if columns == 1 else 3.0) * rows))
        else:
            inches = width / 0.0254
            figure.set_size_inches(inches, inches * max(0.62, 0.4 * rows))
        diagrams = figure.subplots(rows, columns, sharex=columns == 1, squeeze=False).ravel().tolist()
        if columns == 1:
            diagrams[0].set_title(title)
        else:
            figure.suptitle(title)
        for diagram in diagrams[count:]:
            diagram.remove()
        figure.align_ylabels(diagrams[:count])
        return diagrams[:count]
    from matplotlib.axes import Axes as MatplotlibAxes

    if not isinstance(axes, MatplotlibAxes):
        raise SimulationError(f"plot: axes = {shown(axes)}: give one Axes, as matplotlib.pyplot.subplots() returns")
    if len(groups) > 1:
        raise SimulationError(
            f"plot: axes: {', '.join(groups)} of {title} need a diagram each; name signals of one, or leave axes out"
        )
    return [axes]


def save_figure(figure: Figure, path: Path) -> None:
    """Write a figure to a file, whose kind is that of its suffix.

    :raises SimulationError: if it cannot be written.
    """
    try:
        with replacement_path(path) as part:
            figure.savefig(part, format=path.suffix[1:] or "png")
    except (ValueError, RuntimeError) as error:  # of an unknown format, or of one that needs another program
        raise SimulationError(f"{path}: {' '.join(str(error).split())}") from None


def new_figure(*, in_pyplot: bool) -> Figure:
    """Make an empty figure, which pyplot manages and shows if ``in_pyplot``.

    In a notebook pyplot does not manage it: it would be shown there, and again as what the cell returns.
    """
    if not in_pyplot:
        from matplotlib.figure import Figure

        return Figure(layout="constrained")
    import matplotlib as mpl
    from matplotlib import pyplot

    figure = pyplot.figure(layout="constrained")  # tells a notebook how figures are shown
    if "inline" in mpl.get_backend():
        pyplot.close(figure)
    return figure


def _draw_curves(diagram: Axes, name: str, x: Floats, values: Floats, style: Mapping[str, Any]) -> None:
    """Draw the curve of a signal, or a curve of each element of an array, the first ones pale."""
    columns = values.reshape(len(values), -1).T
    along = np.broadcast_to(x.reshape(len(values), -1).T, columns.shape)
    for abscissa, column, alpha in zip(along, columns, np.linspace(0.25, 1.0, len(columns) + 1)[1:], strict=True):
        diagram.plot(abscissa, column, **style, alpha=alpha, linewidth=1.2)
    if len(columns):
        size = "×".join(map(str, values.shape[1:]))
        diagram.lines[-1].set_label(f"{name} ({size})" if size else name)


def _distinguishable_names(signals: Curves, unit: str, ranks: Mapping[str, int]) -> list[str]:
    """Names of the signals whose curves differ visibly in one diagram; none if all are constant."""
    sizes = {name: _magnitude(values) for name, values in signals.items()}
    motions = {name: _magnitude(values - values[:1]) for name, values in signals.items()}
    zero = _ROUNDING * max(*sizes.values(), 1.0 if unit in {"", "1", "rad"} else 0.0)
    moving = [name for name in signals if motions[name] > zero]
    changing = [name for name in moving if motions[name] > _CHANGING * sizes[name]] or moving
    if not changing:
        return []
    ends = {name: _extrema(values) for name, values in signals.items()}
    first = [ends[name] for name in changing if ranks[name] == ranks[changing[0]]]
    low, high = min(end[0] for end in first), max(end[1] for end in first)
    pixel = _PIXEL * (high - low)
    chosen: list[str] = []
    for name, values in signals.items():
        margin = (_CHANGING_MARGIN if name in changing else _STILL_MARGIN) * (high - low)
        near = low - margin <= ends[name][0] and ends[name][1] <= high + margin
        new = all(
            _magnitude(values - signals[other]) > pixel for other in chosen if values.shape == signals[other].shape
        )
        if sizes[name] > max(pixel, zero) and near and new:
            chosen.append(name)
    return chosen[:CURVES]


def _magnitude(values: Floats) -> float:
    """Largest absolute value that is finite."""
    return max(map(abs, _extrema(values)))


def _extrema(values: Floats) -> tuple[float, float]:
    """Smallest and largest finite value; 0 if there is none."""
    finite = values[np.isfinite(values)]
    return (float(finite.min()), float(finite.max())) if finite.size else (0.0, 0.0)


def _default_rank(name: str, unit: str, names: Container[str]) -> int:
    """Rank of a signal in the order of drawing by default, 0 first, by its name."""
    owner, dot, last = array_and_index(name)[0].rpartition(".")

    def has(name: str) -> bool:
        """Whether the component of the signal has a variable of this name."""
        return f"{owner}{dot}{name}" in names

    ending = port_names("")
    if last.endswith(ending.rate):
        return 1 if has(f"p_{last.removesuffix(ending.rate)}") else 7
    for suffix, rank in {ending.acceleration: 8, ending.force: 5, "_power": 6, ending.load: 7}.items():
        if last.endswith(suffix):
            return rank
    if has(f"p_{last}"):
        return 0
    if has(f"{last}_power"):
        return 2
    if last.startswith("p_"):
        return 7
    return 3 if unit == "J" else 4
