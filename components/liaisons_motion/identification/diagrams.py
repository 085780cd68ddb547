"""Diagrams, films and tables of a fit: the methods of :class:`liaisons_motion.identification.Fit`."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Protocol

import numpy as np
from scipy.stats import chi2, f, norm

from liaisons import Result
from liaisons.base.arguments import as_path, name_list
from liaisons.base.array_names import array_and_index
from liaisons.errors import IdentificationError, suggestion
from liaisons_motion.identification.estimates import ParameterEstimate
from liaisons_motion.identification.measurements import Measurements
from liaisons_motion.identification.problems import Floats, MeasuredMotion
from liaisons_motion.identification.verifying import replays
from liaisons_pages.pictures import new_figure, save_figure

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_CURVE_POINTS = 500
_BAND_PROBABILITY = 0.95


class Fitted(Protocol):
    """A fit with its estimate."""

    @property
    def estimate(self) -> ParameterEstimate:
        """Estimate of the unknowns."""
        ...


def plot(fit: Fitted, *names: str | Iterable[str], path: Path | str | None = None) -> Figure:
    """Figure of measured points over the fitted motion with its 95 % band, and of residuals below.

    :param names: measured signals, arrays of them, and counts of impacts, one by one or in a list; default: all.
    :param path: where to save the figure, its kind by the suffix.
    :raises IdentificationError: for a signal that was not measured.
    """
    tables = _residual_tables(fit.estimate)
    units = {name: e.motion.units[name] for e, _ in tables for name in e.measurements.signals}
    arrays = {array_and_index(name)[0]: unit for name, unit in units.items()}
    chosen = [name for group in names for name in name_list("plot", group, IdentificationError)] or [
        *arrays,
        *dict.fromkeys(name for e, _ in tables for name in e.measurements.instants),
    ]
    units |= arrays | {name: "1" for e, _ in tables for name in e.measurements.instants}
    for name in chosen:
        if name not in units:
            raise IdentificationError(f"plot: {name!r} was not measured{suggestion(name, units)}")
    figure = new_figure(in_pyplot=path is None)
    figure.set_size_inches(10.0, 1.0 + 4.0 * len(chosen))
    diagrams = figure.subplots(2 * len(chosen), 1, sharex=True, height_ratios=[3, 1] * len(chosen))
    for name, above, below in zip(chosen, diagrams[::2], diagrams[1::2], strict=True):
        own = [
            (e, table, row)
            for e, table in tables
            for row in e.measurements.signals
            if name in {row, array_and_index(row)[0]}
        ]
        for i, (experiment, table, row) in enumerate(own):
            color, times = f"C{i}", table.time
            dense, curve, low, high = _fitted_band(fit.estimate, experiment, row)
            above.fill_between(dense, low, high, color=color, alpha=0.2)
            above.plot(dense, curve, color=color)
            label = f"{row}, {Path(experiment.measurements.title).name}"
            above.plot(times, table[row], ".", color=color, label=label)
            below.plot(times, table[f"residual of {row}"], ".", color=color)
        for (e, _), fitted in zip(tables, fit.estimate.instants, strict=True):
            if name in fitted:
                _draw_instants(above, below, e.measurements, name, fitted[name])
        below.axhline(0.0, color="black", linewidth=0.8)
        above.set_ylabel(f"{name} [{units[name]}]")
        above.legend(frameon=False, fontsize="small")
        below.set(xlabel="time [s]", ylabel=f"residual [{units[name] if own else 's'}]")
    if path is not None:
        save_figure(figure, as_path("path", path))
    return figure


def plot_ellipse(fit: Fitted, a: str, b: str, probability: float = 0.95, *, path: Path | str | None = None) -> Figure:
    """Figure of the confidence ellipse of two unknowns.

    :raises IdentificationError: for a name that is no unknown, or an unknown without a variance.
    """
    estimate, problem = fit.estimate, fit.estimate.problem
    for name in (a, b):
        if name not in problem.names:
            raise IdentificationError(f"plot_ellipse: {name!r} is not unknown{suggestion(name, problem.names)}")
    pair = [problem.names.index(name) for name in (a, b)]
    covariance = estimate.covariance[np.ix_(pair, pair)]
    if not np.isfinite(covariance).all():
        raise IdentificationError(f"plot_ellipse: {a} and {b} have no covariance; fit.sentences say why")
    size = chi2.ppf(probability, 2) if problem.noise else 2 * f.ppf(probability, 2, max(1, estimate.degrees_of_freedom))
    angles = np.linspace(0, 2 * np.pi, _CURVE_POINTS)
    circle = np.sqrt(size) * np.array([np.cos(angles), np.sin(angles)])
    x, y = estimate.values[pair]
    figure = new_figure(in_pyplot=path is None)
    diagram = figure.subplots()
    diagram.plot(*([[x], [y]] + np.linalg.cholesky(covariance) @ circle), label=f"{100 * probability:g} %")
    diagram.plot(x, y, "+", color="C0")
    labels = [f"{problem.names[i]} [{problem.units[i]}]" for i in pair]
    diagram.set(xlabel=labels[0], ylabel=labels[1])
    diagram.legend(frameon=False)
    if path is not None:
        save_figure(figure, as_path("path", path))
    return figure


def animate(fit: Fitted, path: Path | str, *, experiment: int = 1, speed: float | None = None) -> float:
    """Write a film of the fitted motion, in which a ghost has the measured coordinates and points.

    :param path: ends in ``.gif``, ``.png`` (a strip of instants) or ``.mp4`` (needs the extra ``film``).
    :param experiment: its number, from 1.
    :param speed: seconds of motion a second; real time unless that takes longer than 20 s.
    :returns: the speed.
    """
    estimate = fit.estimate
    chosen, result = estimate.objective.experiments[experiment - 1], replays(estimate)[experiment - 1]
    times = result.time - (0.0 if chosen.offset is None else estimate.values[chosen.offset])
    drawn = {*estimate.problem.starts.values(), *(result.scene.picture.variables if result.scene else ())}
    ghost = {
        name: np.interp(times, chosen.measurements.times[seen], values[seen])
        for name, values in zip(chosen.measurements.signals, chosen.measurements.values, strict=True)
        for seen in [np.isfinite(values)]
        if name in drawn
    }
    return result.animate(path, speed=speed, against=ghost or None)


def to_csv(fit: Fitted, path: Path | str) -> None:
    """Write measured and fitted signals and residuals, those of further experiments to ``NAME_2.csv`` and so on.

    Instants of impacts go to ``NAME_gap_impacts.csv``, by the times at which they were measured.

    :raises SimulationError: if a file cannot be written.
    """
    path = as_path("to_csv", path)
    for i, ((experiment, table), instants) in enumerate(
        zip(_residual_tables(fit.estimate), fit.estimate.instants, strict=True)
    ):
        own = path.with_stem(f"{path.stem}_{i + 1}") if i else path
        table.to_csv(own)
        for name, fitted in instants.items():
            measured, _ = experiment.measurements.instants[name]
            columns = np.array([np.arange(1.0, 1 + len(fitted)), fitted, measured - fitted])[:, np.isfinite(measured)]
            names, units = (name, "fitted instant", "residual"), {name: "1", "fitted instant": "s", "residual": "s"}
            times = measured[np.isfinite(measured)]
            Result(table.title, times, names, columns, units).to_csv(own.with_stem(f"{own.stem}_{name}"))


def _residual_tables(estimate: ParameterEstimate) -> list[tuple[MeasuredMotion, Result]]:
    """Experiments, each with a table of its measured values, fitted values and residuals."""
    tables = []
    for experiment, fitted in zip(estimate.objective.experiments, estimate.fitted_signals, strict=True):
        data, columns, units = experiment.measurements, {}, {}
        for name, measured, signal in zip(data.signals, data.values, fitted, strict=True):
            columns |= {name: measured, f"fitted {name}": signal, f"residual of {name}": measured - signal}
            units |= dict.fromkeys(columns.keys() - units, experiment.motion.units[name])
        table = Result(f"fit to {data.title}", data.times.copy(), (*columns,), np.array([*columns.values()]), units)
        tables.append((experiment, table))
    return tables


def _fitted_band(
    estimate: ParameterEstimate, experiment: MeasuredMotion, name: str
) -> tuple[Floats, Floats, Floats, Floats]:
    """Times, fitted values, lower and upper end of the band that holds 95 % of the measurements."""
    data = experiment.measurements
    row = data.signals.index(name)
    times = np.linspace(data.times[0], data.times[-1], _CURVE_POINTS)
    dense = replace(experiment, measurements=replace(data, times=times), motion=experiment.motion.at(times))
    branch = dense.branch(estimate.values)
    signal, slopes = branch.signals[row], branch.derivatives[row]
    variances = np.einsum("ti,ij,tj->t", slopes, np.nan_to_num(estimate.covariance), slopes)
    half = norm.ppf((1 + _BAND_PROBABILITY) / 2) * np.sqrt(variances + experiment.deviations[row] ** 2)
    return times, signal, signal - half, signal + half


def _draw_instants(above: Axes, below: Axes, data: Measurements, name: str, times: Floats) -> None:
    """Draw the fitted number of impacts over time, and points at the measured instants."""
    measured, numbers = data.instants[name][0], np.arange(1, 1 + len(times))
    (line,) = above.step(times, numbers, where="post")
    above.plot(measured, numbers, ".", color=line.get_color(), label=f"{name}, {Path(data.title).name}")
    below.plot(measured, measured - times, ".", color=line.get_color())
