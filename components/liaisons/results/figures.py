"""Signals, drawn: one diagram a unit, what matters first."""

from __future__ import annotations

from collections.abc import Container, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from liaisons.array_names import split
from liaisons.errors import SimulationError
from liaisons.files import replacing
from liaisons.port_names import PortNames, port_names

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

Signals = Mapping[str, NDArray[np.float64]]
"""Name -> values, shape (points,) or (points, elements)."""

DIAGRAMS, CURVES = 6, 8
"""So many fit on a screen, and so many in one diagram can be told apart."""
_PIXEL = 1 / 200
"""Part of the height of a diagram below which nothing is seen."""
_LIVELY = 1 / 50
"""Part of its largest value by which a signal has to change to be seen beside others that start at 0."""
_SQUEEZED, _SLIGHTLY = 20, 1 / 2
"""So many times the height of what tells most may be given to others, above and below, that move or do not."""
_ROUNDING = 1e-9
"""What is below this part of the largest value of its unit is 0 but for rounding; of 1 if the unit has no scale."""


def essential(signals: Signals, units: Mapping[str, str], ports: Mapping[str, PortNames]) -> list[str]:
    """The names that are worth drawing if nobody has chosen.

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


def draw(
    title: str,
    over: tuple[str, NDArray[np.float64]],
    signals: Signals,
    units: Mapping[str, str],
    *,
    joined: bool = True,
    steps: Container[str] = (),
    texts: Mapping[str, Sequence[str]] | None = None,
    path: Path | None = None,
) -> Figure:
    """Draw signals, those of one unit in one diagram, its legend beside it.

    :param over: label and values of the horizontal axis, shape (points,) or that of each signal.
    :param joined: by lines; else dots.
    :param steps: names of what stays as it is until it jumps.
    :param texts: name of a signal of strings -> what its values count.
    :param path: where to save the figure, which pyplot does not know then.
    :raises SimulationError: if the axis has another shape than a signal, or the file cannot be written.
    """
    texts = texts or {}
    groups: dict[tuple[str, str], list[str]] = {}
    for name in signals:
        groups.setdefault((units[name], name if name in texts else ""), []).append(name)
    count = max(1, len(groups))
    figure = _new_figure(alone=path is not None)
    figure.set_size_inches(10.0, 1.0 + max(3.0, 1.6 * count))
    diagrams = figure.subplots(count, sharex=True, squeeze=False)[:, 0]
    label, x = over
    for diagram, ((unit, text), names) in zip(diagrams, groups.items(), strict=False):
        for number, name in enumerate(names):
            if x.ndim > 1 and x.shape != signals[name].shape:
                raise SimulationError(f"plot: {name} and {label} have different shapes; choose another over=...")
            style = {"color": f"C{number}", "linestyle": "-" if joined else "", "marker": "" if joined else "."}
            if name in steps:
                style["drawstyle"] = "steps-post"
            _draw_curves(diagram, name, x, signals[name], style)
        diagram.set_ylabel(f"[{unit}]" if unit else "")
        if text:
            diagram.set_yticks(range(len(texts[text])), texts[text])
        diagram.legend(loc="upper left", bbox_to_anchor=(1.0, 1.05), frameon=False, fontsize="small")
        diagram.grid(visible=True, alpha=0.3)
        diagram.margins(x=0.0)
    diagrams[0].set_title(title)
    diagrams[-1].set_xlabel(label)
    figure.align_ylabels(diagrams)
    if path is not None:
        try:
            with replacing(path) as part:
                figure.savefig(part, format=path.suffix[1:] or "png")
        except (ValueError, RuntimeError) as error:  # of an unknown kind, or one that needs a program
            raise SimulationError(f"{path}: {' '.join(str(error).split())}") from None
    return figure


def _new_figure(*, alone: bool) -> Figure:
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


def _visible(signals: Signals, unit: str, ranks: Mapping[str, int]) -> list[str]:
    """Of signals of one unit, those of which something is seen in one diagram; none if nothing moves."""
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
    found: list[str] = []
    for name, values in signals.items():
        room = (_SQUEEZED if name in lively else _SLIGHTLY) * (high - low)
        near = low - room <= ends[name][0] and ends[name][1] <= high + room
        new = all(_largest(values - signals[other]) > pixel for other in found if values.shape == signals[other].shape)
        if sizes[name] > max(pixel, zero) and near and new:
            found.append(name)
    return found[:CURVES]


def _largest(values: NDArray[np.float64]) -> float:
    """The largest absolute value."""
    return max(map(abs, _ends(values)))


def _ends(values: NDArray[np.float64]) -> tuple[float, float]:
    """The smallest and the largest of the values that are finite; 0 if there is none."""
    finite = values[np.isfinite(values)]
    return (float(finite.min()), float(finite.max())) if finite.size else (0.0, 0.0)


def _rank(name: str, unit: str, names: Container[str]) -> int:
    """The smaller the more a signal tells: by the names that variables of our FMUs have."""
    owner, dot, last = split(name)[0].rpartition(".")

    def has(name: str) -> bool:
        return f"{owner}{dot}{name}" in names

    ending = port_names("")
    if last.endswith(ending.rate):
        return 1 if has(f"p_{last.removesuffix(ending.rate)}") else 7
    for ending, rank in {ending.acceleration: 8, ending.force: 5, "_power": 6, ending.load: 7}.items():
        if last.endswith(ending):
            return rank
    if has(f"p_{last}"):
        return 0
    if has(f"{last}_power"):
        return 2
    if last.startswith("p_"):
        return 7
    return 3 if unit == "J" else 4
