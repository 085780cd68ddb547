"""Diagrams of signals, one for each unit, the most telling first."""

from __future__ import annotations

import math
from collections.abc import Callable, Container, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from liaisons.base.arguments import shown
from liaisons.base.array_names import split
from liaisons.base.files import replacing
from liaisons.base.port_names import PortNames, port_names
from liaisons.errors import SimulationError
from liaisons.results.signals import LabelledSignals

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

Curves = Mapping[str, NDArray[np.float64]]
"""Name -> values, shape (points,) or (points, elements)."""
_Grid = tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.intp]]
_Subplots = Callable[[Sequence[str], int], "Sequence[Axes]"]
"""Makes diagrams for groups of signals, in so many columns."""

DIAGRAMS, CURVES = 6, 8
"""Most diagrams on a screen, and most curves in one that can be distinguished."""
_PIXEL = 1 / 200
"""Part of the height of a diagram below which a difference is invisible."""
_LIVELY = 1 / 50
"""Part of its largest value by which a signal has to change to be seen beside others that start at 0."""
_SQUEEZED, _SLIGHTLY = 20, 1 / 2
"""Room above and below the first signals for others that move or do not, in heights of the first."""
_ROUNDING = 1e-9
"""Below this part of the largest value of its unit, or of 1 if the unit has no scale, a value is 0 but for rounding."""


def essential(signals: Curves, units: Mapping[str, str], ports: Mapping[str, PortNames]) -> list[str]:
    """Names of the signals that are drawn by default.

    At most six units and eight signals of each: free coordinates first, then their rates, what is prescribed, energies,
    forces, powers; the rest (accelerations, momenta, loads) where there is room.  Left out are units in which nothing
    moves, and signals that stay 0, cannot be told from 0 or from another one, or are so large or far away that nothing
    would be seen of those that tell more; unless there is nothing else.
    """
    called = {name: usual for value in ports for name, usual in zip(ports[value], port_names(value), strict=True)}
    ranks = {name: _rank(called.get(name, name), units[name], signals) for name in signals}
    groups: dict[str, list[str]] = {}
    for name in sorted(signals, key=ranks.__getitem__):
        groups.setdefault(units[name], []).append(name)
    visible = [_visible({name: signals[name] for name in names}, unit, ranks) for unit, names in groups.items()]
    chosen = [name for names in [group for group in visible if group][:DIAGRAMS] for name in names]
    return chosen or [name for name in signals if _largest(signals[name]) > 0][:CURVES] or list(signals)[:CURVES]


def plot(
    result: LabelledSignals, names: Sequence[str], over: str | None, path: Path | None, axes: Axes | None = None
) -> Figure:
    """Draw signals: those of one unit in one diagram, or of a sweep on a grid of two values a map of each.

    :param names: what to draw; if empty, :func:`essential` chooses, or the first of the maps are drawn.
    :param over: signal on the horizontal axis; None: as in :meth:`liaisons.Result.plot`.
    :param path: where to save the figure, which pyplot does not know then.
    :param axes: where to draw the only diagram; None: in a new figure.
    :raises SimulationError: if the axis has another shape than a signal, the axes are none or too few, or the file
        cannot be written.
    """
    subplots = partial(_subplots, result.title, axes, alone=path is not None)
    grid = _grid(result) if over is None else None
    if grid is None:
        diagrams = _draw_diagrams(result, names, over, subplots, beside=axes is None)
    else:
        diagrams = _draw_maps(result, names, grid, subplots)
    figure = diagrams[0].figure.canvas.figure
    if path is not None:
        save(figure, path)
    return figure


def _draw_diagrams(
    result: LabelledSignals, names: Sequence[str], over: str | None, subplots: _Subplots, *, beside: bool
) -> Sequence[Axes]:
    """Curves, those of one unit in one diagram, with its legend beside or in it."""
    timed = result.kind != "sweep"
    if over is None and not timed and np.all(np.diff(result.values[0]) > 0):
        over = result.names[0]
    signals = {name: result.numbers(name) for name in names or result if names or name != over}
    chosen = names or essential(signals, result.units, result.ports)
    groups: dict[tuple[str, str], list[str]] = {}
    for name in dict.fromkeys(chosen):
        has_texts = result.element(name) in result.texts
        groups.setdefault((result.units[name], name if has_texts else ""), []).append(name)
    if over is None:
        label, x = next(iter(result.index.items()))
    else:
        label, x = over, result.numbers(over)
    unit = "s" if label == "time" else result.units.get(label)
    label = f"{label} [{unit}]" if unit else label
    joined = timed or over is not None
    diagrams = subplots([result.label(group[0]) for group in groups.values()], 1)
    for diagram, ((unit, text), group) in zip(diagrams, groups.items(), strict=False):
        for number, name in enumerate(group, len(diagram.get_legend_handles_labels()[0])):
            if x.ndim > 1 and x.shape != signals[name].shape:
                raise SimulationError(f"plot: {name} and {label} have different shapes; choose another over=...")
            style = {"color": f"C{number}", "linestyle": "-" if joined else "", "marker": "" if joined else "."}
            if timed and result.element(name) in result.jumping:
                style["drawstyle"] = "steps-post"
            _draw_curves(diagram, name, x, signals[name], style)
        diagram.set_ylabel(f"[{unit}]" if unit else "")
        if text:
            texts = result.texts[result.element(text)]
            diagram.set_yticks(range(len(texts)), texts)
        outside: dict[str, Any] = {"loc": "upper left", "bbox_to_anchor": (1.0, 1.05)} if beside else {}
        diagram.legend(**outside, frameon=False, fontsize="small")
        diagram.grid(visible=True, alpha=0.3)
        diagram.margins(x=0.0)
    diagrams[-1].set_xlabel(label)
    return diagrams


def _grid(result: LabelledSignals) -> _Grid | None:
    """The first two values of a sweep, ascending, and the case of each pair (second, first); None: it is on no grid."""
    if result.kind != "sweep" or len(result.names) < 3:
        return None
    (x, columns), (y, rows) = (np.unique(values, return_inverse=True) for values in result.values[:2])
    if min(x.size, y.size) < 2 or x.size * y.size != rows.size:
        return None
    cases = np.full((y.size, x.size), -1)
    cases[rows, columns] = np.arange(rows.size)
    return (x, y, cases) if cases.min() == 0 else None


def _draw_maps(result: LabelledSignals, names: Sequence[str], grid: _Grid, subplots: _Subplots) -> Sequence[Axes]:
    """A map of each signal over the first two values of a sweep; cases that have failed stay blank."""
    for name in names:
        result.numbers(name)  # or it says that there is none
    asked = [n for name in names for n in result.names if name in {n, split(n)[0]}] or result.names[2 : 2 + DIAGRAMS]
    chosen = list(dict.fromkeys(asked))
    x, y, cases = grid
    diagrams = subplots(chosen, math.ceil(math.sqrt(len(chosen))))
    for diagram, name in zip(diagrams, chosen, strict=True):
        mesh = diagram.pcolormesh(x, y, result.numbers(name)[cases], rasterized=True)
        bar = diagram.figure.colorbar(mesh, ax=diagram, label=result.label(name))
        if texts := result.texts.get(name):
            bar.set_ticks(range(len(texts)), labels=texts)
        diagram.set(xlabel=result.label(result.names[0]), ylabel=result.label(result.names[1]))
    return diagrams


def _subplots(title: str, axes: Axes | None, groups: Sequence[str], columns: int, *, alone: bool) -> Sequence[Axes]:
    """Diagrams for groups of signals, in a new figure, or the axes for the only group."""
    if axes is None:
        count = max(1, len(groups))
        rows = math.ceil(count / columns)
        figure = new_figure(alone=alone)
        figure.set_size_inches(10.0, 1.0 + max(3.0, (1.6 if columns == 1 else 3.0) * rows))
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


def save(figure: Figure, path: Path) -> None:
    """Write a figure.

    :raises SimulationError: if it cannot be written.
    """
    try:
        with replacing(path) as part:
            figure.savefig(part, format=path.suffix[1:] or "png")
    except (ValueError, RuntimeError) as error:  # of an unknown kind, or one that needs a program
        raise SimulationError(f"{path}: {' '.join(str(error).split())}") from None


def new_figure(*, alone: bool) -> Figure:
    """An empty figure; if it is not to be alone, one that pyplot knows and shows.

    A notebook shows what pyplot knows, and what a cell returns: there it is alone, or it would be seen twice.
    """
    if alone:
        from matplotlib.figure import Figure

        return Figure(layout="constrained")
    import matplotlib as mpl
    from matplotlib import pyplot

    figure = pyplot.figure(layout="constrained")  # tells a notebook how figures are shown
    if "inline" in mpl.get_backend():
        pyplot.close(figure)
    return figure


def _draw_curves(
    diagram: Axes, name: str, x: NDArray[np.float64], values: NDArray[np.float64], style: Mapping[str, Any]
) -> None:
    """One curve, or those of an array from its first element, pale, to its last one."""
    columns = values.reshape(len(values), -1).T
    along = np.broadcast_to(x.reshape(len(values), -1).T, columns.shape)
    for one, column, alpha in zip(along, columns, np.linspace(0.25, 1.0, len(columns) + 1)[1:], strict=True):
        diagram.plot(one, column, **style, alpha=alpha, linewidth=1.2)
    if len(columns):
        size = "×".join(map(str, values.shape[1:]))
        diagram.lines[-1].set_label(f"{name} ({size})" if size else name)


def _visible(signals: Curves, unit: str, ranks: Mapping[str, int]) -> list[str]:
    """LabelledSignals of one unit that are visible in one diagram; none if nothing moves."""
    sizes = {name: _largest(values) for name, values in signals.items()}
    motions = {name: _largest(values - values[:1]) for name, values in signals.items()}
    zero = _ROUNDING * max(*sizes.values(), 1.0 if unit in {"", "1", "rad"} else 0.0)
    moving = [name for name in signals if motions[name] > zero]
    lively = [name for name in moving if motions[name] > _LIVELY * sizes[name]] or moving
    if not lively:
        return []
    ends = {name: _ends(values) for name, values in signals.items()}
    first = [ends[name] for name in lively if ranks[name] == ranks[lively[0]]]
    low, high = min(end[0] for end in first), max(end[1] for end in first)
    pixel = _PIXEL * (high - low)
    chosen: list[str] = []
    for name, values in signals.items():
        room = (_SQUEEZED if name in lively else _SLIGHTLY) * (high - low)
        near = low - room <= ends[name][0] and ends[name][1] <= high + room
        new = all(_largest(values - signals[other]) > pixel for other in chosen if values.shape == signals[other].shape)
        if sizes[name] > max(pixel, zero) and near and new:
            chosen.append(name)
    return chosen[:CURVES]


def _largest(values: NDArray[np.float64]) -> float:
    """The largest absolute value."""
    return max(map(abs, _ends(values)))


def _ends(values: NDArray[np.float64]) -> tuple[float, float]:
    """The smallest and the largest of the values that are finite; 0 if there is none."""
    finite = values[np.isfinite(values)]
    return (float(finite.min()), float(finite.max())) if finite.size else (0.0, 0.0)


def _rank(name: str, unit: str, names: Container[str]) -> int:
    """Rank of a signal, 0 first, by the names of the variables in our FMUs."""
    owner, dot, last = split(name)[0].rpartition(".")

    def has(name: str) -> bool:
        return f"{owner}{dot}{name}" in names

    ending = port_names("")
    if last.endswith(ending.rate):
        return 1 if has(f"p_{last.removesuffix(ending.rate)}") else 7
    for other, rank in {ending.acceleration: 8, ending.force: 5, "_power": 6, ending.load: 7}.items():
        if last.endswith(other):
            return rank
    if has(f"p_{last}"):
        return 0
    if has(f"{last}_power"):
        return 2
    if last.startswith("p_"):
        return 7
    return 3 if unit == "J" else 4
