"""Measurements from files, results and arrays, in SI units: signals to fit, and inputs that drive the motion."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from os import PathLike
from pathlib import Path
from typing import Any, final

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import PPoly, make_lsq_spline

from liaisons.base.arguments import check_positive, float_array, name_dictionary, name_list, shown
from liaisons.base.array_names import array_and_index
from liaisons.base.files import read_csv_cells
from liaisons.base.knots import knots, piecewise_polynomial
from liaisons.base.units import size_in_si
from liaisons.errors import IdentificationError, suggestion
from liaisons.identification.determinacy import Floats
from liaisons.mechanics.model import Model
from liaisons.results import Result

_Columns = list[tuple[str, str, Sequence[Any]]]
"""Heading, unit and cells of each column."""


@final
@dataclass(frozen=True, eq=False)
class Measurements:
    """One experiment.

    :param times: [s], ascending, shape (n,).
    :param signals: names of the outputs that were measured, element by element.
    :param values: of the signals, in SI units; not-a-number where one is missing; shape (signals, n).
    :param inputs: name of an input or active coordinate -> its values over time, of degree 5 at most.
    :param title: name of the file, or title of the result.
    :param instants: ``"gap_impacts"`` -> instants [s] of the impacts of ``gap``, not-a-number where one is missing, and
        their standard deviation.
    """

    times: Floats
    signals: tuple[str, ...]
    values: Floats
    inputs: Mapping[str, PPoly]
    title: str
    instants: Mapping[str, tuple[Floats, float]] = field(default_factory=dict)

    @property
    def count(self) -> int:
        """Number of measured values."""
        return sum(int(np.isfinite(x).sum()) for x in (self.values, *(times for times, _ in self.instants.values())))


def measurements(
    data: object,
    model: Model,
    *,
    measured: str | Iterable[str] | None = None,
    unknown: Iterable[str] = (),
    ignore: str | Iterable[str] = (),
    smoothing: float | None = None,
    instants: object = (),
) -> tuple[Measurements, ...]:
    """Measurements of experiments, from files, results, or mappings of arrays.

    A column named like an output is a signal.  A column named like an input or an active coordinate drives the motion:
    a quintic spline interpolates its values, and its rates and accelerations if these have columns.

    A CSV file has names in its first line and units behind them, ``theta [deg]``, or in the next line after ``#``;
    a column without a unit is in SI units.  An empty cell is a missing value.

    :param data: a path, a :class:`liaisons.Result`, a mapping of names to arrays, ``time`` [s] among them; or a list of
        these, one an experiment.
    :param model: equations of the measured mechanism.
    :param measured: outputs that are fitted, arrays as a whole or by elements; None: all that have a column.
    :param unknown: names to be identified; a column of such a name must be constant, and is left out.
    :param ignore: columns that are not read.
    :param smoothing: distance [s] between the knots of quintic splines that fit the drives; None: the splines
        interpolate all values.
    :param instants: of impacts, see :class:`Measurements`; a list of these, one an experiment.
    :raises IdentificationError: for an unusable column or cell; the message names it and its row.
    """
    if smoothing is not None:
        check_positive("smoothing", smoothing, IdentificationError)
    flat, ignored = model.flat(), name_list("ignore", ignore, IdentificationError)
    outputs = [variable.name for variable in flat.outputs]
    chosen = outputs if measured is None else name_list("measured", measured, IdentificationError)
    for name in chosen:
        if name not in {*outputs, *(array_and_index(output)[0] for output in outputs)}:
            raise IdentificationError(f"measured: {model.name} has no output {name!r}{suggestion(name, outputs)}")
    if isinstance(data, (list, tuple)) and not data:
        raise IdentificationError("data: an empty list; give one table at least")
    tables = list(data) if isinstance(data, (list, tuple)) else [data]
    experiments = []
    for one, event in zip(tables, _by_experiment(instants, len(tables)), strict=True):
        title, columns, rows = _table(one)
        with _prefixed_errors(title):
            values = _columns_by_name(columns, flat, ignored, rows)
            times = values.pop("time", np.empty(0))
            with _prefixed_errors("column time"):
                if times.size < 2:
                    raise ValueError(f"{times.size} rows; give two at least")
                _refuse_rows(np.isnan(times), rows, "a value is missing")
                _refuse_rows(np.diff(times, prepend=-np.inf) <= 0, rows, "it must be greater than the one before")
            signals = tuple(name for name in outputs if name in values and _is_among(name, chosen))
            own = dict(_instants(event, outputs, times[0]))
            if not (signals or own):
                raise ValueError(
                    f"no column is a measured output of {model.name}; it has {', '.join(values) or 'none'}"
                )
            for name in signals:
                if np.isnan(values[name]).all():
                    raise ValueError(f"column {name}: all values are missing")
            inputs = dict(_driven_inputs(flat, times, values, unknown, smoothing, rows))
        columns_of_signals = np.array([values[name] for name in signals]).reshape(-1, len(times))
        experiments.append(Measurements(times, signals, columns_of_signals, inputs, title, own))
    return tuple(experiments)


def noise_levels(noise: object, experiment: Measurements) -> Floats:
    """Standard deviation of each signal, shape (signals,).

    :param noise: a number for all signals, or a mapping by names of signals or of whole arrays.
    :raises IdentificationError: for a number that is not > 0, a name that is no signal, or a signal without noise.
    """
    levels = noise if isinstance(noise, Mapping) else dict.fromkeys(experiment.signals, noise)
    names = {name for signal in experiment.signals for name in (signal, array_and_index(signal)[0])}
    for name, level in levels.items():
        check_positive(f"noise: {name}", level, IdentificationError)
        if name not in names:
            raise IdentificationError(f"noise: {experiment.title} has no column {name!r}{suggestion(name, names)}")
    for name in experiment.signals:
        if not _is_among(name, levels):
            raise IdentificationError(f"noise: {name} is missing; measured=[...] names what is fitted")
    return np.array(
        [levels.get(name, levels.get(array_and_index(name)[0])) for name in experiment.signals], dtype=float
    )


def _by_experiment(instants: object, count: int) -> Sequence[object]:
    """Instants of each experiment."""
    events = instants if isinstance(instants, (list, tuple)) else [instants]
    if len(events) not in {0, count}:
        raise IdentificationError(f"instants: {len(events)} dictionaries for {count} experiments; give one each")
    return events or [{}] * count


def _instants(instants: object, outputs: Sequence[str], start: float) -> Iterator[tuple[str, tuple[Floats, float]]]:
    """Yield instants of impacts, none before the start [s], and their standard deviation, by the output that counts."""
    counts = [name for name in outputs if array_and_index(name)[0].endswith("_impacts")]
    for name, pair in name_dictionary("instants", instants, IdentificationError).items():
        if name not in counts:
            raise IdentificationError(f"instants: no output {name!r} counts impacts{suggestion(name, counts)}")
        if not isinstance(pair, (list, tuple)) or len(pair) != 2:
            raise IdentificationError(f"instants: {name} = {shown(pair)}: give (instants, standard deviation)")
        times = float_array(f"instants: {name}", pair[0], IdentificationError)
        seen = times[np.isfinite(times)]
        if times.ndim != 1 or not seen.size or np.isinf(times).any() or (np.diff(seen) <= 0).any():
            raise IdentificationError(f"instants: {name} = {shown(pair[0])}: give instants [s] in ascending order")
        if seen[0] < start:
            raise IdentificationError(
                f"instants: {name} = {seen[0]:g} s: the motion begins at {start:g} s; leave it out"
            )
        check_positive(f"instants: standard deviation of {name}", pair[1], IdentificationError)
        yield name, (times, float(pair[1]))


@contextmanager
def _prefixed_errors(label: str) -> Iterator[None]:
    """Raise errors of the block with a label before their messages."""
    try:
        yield
    except ValueError as error:
        raise IdentificationError(f"{label}: {error}") from None


def _refuse_rows(wrong: NDArray[np.bool_], rows: Sequence[str], words: str) -> None:
    """Raise an error that names the first of the rows that are marked as wrong."""
    if wrong.any():
        raise ValueError(f"{rows[int(wrong.argmax())]}: {words}")


def _cell_number(cell: object, row: str) -> float:
    """Number in a cell; not-a-number for an empty one."""
    try:
        return float(str(cell) or "nan")
    except ValueError as error:
        raise ValueError(f"{row}: {error}") from None


def _is_among(name: str, chosen: Iterable[str]) -> bool:
    """Whether an element or its array is among the names."""
    return not {name, array_and_index(name)[0]}.isdisjoint(chosen)


def _columns_by_name(columns: _Columns, model: Model, ignored: Sequence[str], rows: Sequence[str]) -> dict[str, Floats]:
    """Times and columns of variables by name, in SI units."""
    units = {"time": "s"} | {variable.name: variable.unit for variable in (*model.inputs, *model.outputs)}
    values: dict[str, Floats] = {}
    for heading, below, cells in columns:
        bracketed = None if heading in units else re.fullmatch(r"(.*?)\s*[\[(]([^\[(]*)[\])]", heading)
        name, unit = bracketed.groups() if bracketed else (heading, below)
        if _is_among(name, [*ignored, "coupling_error"]) or name.startswith("error of "):  # of results in files
            continue
        name = "time" if name == "t" else name
        with _prefixed_errors(f"column {name}"):
            if name in values or name not in units:
                words = "is there twice" if name in values else f"is no variable{suggestion(name, units)}"
                raise ValueError(f"it {words}; ignore=[...] leaves columns out")
            numbers = np.array([_cell_number(cell, row) for cell, row in zip(cells, rows, strict=True)])
            _refuse_rows(np.isinf(numbers), rows, "finite numbers only")
            values[name] = numbers * (size_in_si(unit, units[name]) if unit and units[name] else 1.0)
    return values


def _driven_inputs(  # noqa: PLR0917
    model: Model,
    times: Floats,
    values: Mapping[str, Floats],
    unknown: Iterable[str],
    smoothing: float | None,
    rows: Sequence[str],
) -> Iterator[tuple[str, PPoly]]:
    """Yield each input that moves, or differs from its declared value, as a polynomial over time."""
    rates = {triple.value: (triple.rate, triple.acceleration) for triple in model.active}
    owners = {rate: name for name, pair in rates.items() for rate in pair}
    for name, start in ((v.name, v.starts[0]) for v in model.inputs if v.name in values):
        with _prefixed_errors(f"column {name}"):
            _refuse_rows(np.isnan(values[name]), rows, "a value is missing")
            if owners.get(name, name) not in values:
                raise ValueError(f"{owners[name]} has no column; add it")
            triple = [values.get(part) for part in (name, *rates.get(name, ()))]
            moves = any(column is not None and np.ptp(column) > 0 for column in triple)
            if moves and name in unknown:
                raise ValueError("it moves, and is unknown; ignore it, or give it")
            if name not in owners and (moves or (name not in unknown and values[name][0] != start)):
                table = _spline_knots(times, values[name], smoothing) if smoothing else knots(times, *triple)  # type: ignore[arg-type]
                yield name, piecewise_polynomial(table)


def _spline_knots(times: Floats, values: Floats, width: float) -> Floats:
    """Knots of the quintic spline that fits values best, shape (4, knots)."""
    edges = np.linspace(times[0], times[-1], 1 + max(1, round((times[-1] - times[0]) / width)))
    required = 6 if edges.size == 2 else 2  # a single quintic has six coefficients
    too_few = np.histogram(times, edges)[0] < required
    if too_few.any():
        begin = edges[too_few.argmax()]
        raise ValueError(f"smoothing = {width:g} s leaves less than {required} values after t = {begin:g} s; widen it")
    spline = make_lsq_spline(times, values, np.pad(edges, 5, mode="edge"), 5)
    return np.array([edges, *(spline(edges, order) for order in range(3))])


def _table(data: object) -> tuple[str, _Columns, list[str]]:
    """Title, columns and row labels of a table."""
    if isinstance(data, (str, PathLike)):
        headings, below, lines = read_csv_cells(Path(data), IdentificationError)
        if not headings:
            raise IdentificationError(f"{data}: empty; its first line has to name columns, one of them time")
        columns = zip(*lines.values(), strict=True) if lines else [[]] * len(headings)
        return str(data), list(zip(headings, below, columns, strict=True)), [f"line {number}" for number in lines]
    units: Mapping[str, str] = getattr(data, "units", {})
    try:
        recorded = isinstance(data, Result) and {"time": data.time} | {name: data.numbers(name) for name in data.names}
        arrays: dict[str, Any] = recorded or dict(data)  # type: ignore[call-overload]
        (count,) = {len(array) for array in arrays.values()}
    except (TypeError, ValueError):
        words = "give a path, a Result, a mapping of arrays of one length, or a list of these"
        raise IdentificationError(f"data = {shown(data)}: {words}") from None
    of_arrays = [(str(name), units.get(name, ""), array) for name, array in arrays.items()]
    return getattr(data, "title", "data"), of_arrays, [f"row {row}" for row in range(count)]
