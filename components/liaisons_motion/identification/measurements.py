"""Measurements from files, results and arrays, in SI units: signals to fit, and inputs that drive the motion."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from os import PathLike
from pathlib import Path
from types import MappingProxyType
from typing import Any, final

import numpy as np
from scipy.interpolate import PPoly

from liaisons import Result
from liaisons.base.arguments import check_positive, float_array, name_dictionary, name_list, shown
from liaisons.base.array_names import array_and_index
from liaisons.base.knots import complete_rows, knots, piecewise_polynomial
from liaisons.base.logs import logger
from liaisons.base.tables import Table, is_estimate, read_table
from liaisons.errors import IdentificationError, LiaisonsError, SimulationError, suggestion
from liaisons.mechanics import Model
from liaisons_motion.identification.determinacy import Floats


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
    :param start_time: time of the start values [s].
    """

    times: Floats
    signals: tuple[str, ...]
    values: Floats
    inputs: Mapping[str, PPoly]
    title: str
    instants: Mapping[str, tuple[Floats, float]] = field(default_factory=dict)
    start_time: float = 0.0

    @property
    def value_count(self) -> int:
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

    A file has units behind its names, ``theta [deg]``, or in a line of their own after ``#``; a column without a unit
    is in SI units.  An empty cell is a missing value.

    :param data: a path, a :class:`liaisons.Result`, a data frame, a mapping of names to arrays, ``time`` among them; or
        a list of these, one an experiment.
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
    for one, event in zip(tables, _instants_by_experiment(instants, len(tables)), strict=True):
        units = {variable.name: variable.unit for variable in (*flat.inputs, *flat.outputs)}
        table = _read_table(one, units)
        with _prefixed_errors(table.title):
            values = _columns_by_name(table, units, ignored)
            times = table.times(most=1) if table.clock else np.empty(0)
            if times.size < 2:
                raise ValueError(f"column time: {times.size} rows; give two at least")
            signals = tuple(name for name in outputs if name in values and _is_among(name, chosen))
            own = dict(_checked_instants(event, outputs, times[0]))
            if not (signals or own):
                raise ValueError(
                    f"no column is a measured output of {model.name}; it has {', '.join(values) or 'none'}"
                )
            for name in signals:
                if np.isnan(values[name]).all():
                    raise ValueError(f"column {name}: all values are missing")
                _ask_about_degrees(table, name, values[name], units[name])
                table.warn_of_outlier(name, times, values[name])
            inputs = dict(_driving_splines(flat, times, values, unknown, smoothing, table))
        columns_of_signals = np.array([values[name] for name in signals]).reshape(-1, len(times))
        experiments.append(Measurements(times, signals, columns_of_signals, inputs, table.title, own))
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


def _instants_by_experiment(instants: object, count: int) -> Sequence[object]:
    """Instants of each experiment."""
    events = instants if isinstance(instants, (list, tuple)) else [instants]
    if len(events) not in {0, count}:
        raise IdentificationError(f"instants: {len(events)} dictionaries for {count} experiments; give one each")
    return events or [{}] * count


def _checked_instants(
    instants: object, outputs: Sequence[str], start: float
) -> Iterator[tuple[str, tuple[Floats, float]]]:
    """Yield output that counts impacts, their instants and standard deviation [s].

    :raises IdentificationError: for instants that do not ascend, or before the start.
    """
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
    """Turn a ValueError of the context into an IdentificationError with a label before its message."""
    try:
        yield
    except (ValueError, SimulationError) as error:
        raise IdentificationError(f"{label}: {error}") from None


def _is_among(name: str, chosen: Iterable[str]) -> bool:
    """Whether the name of an element or of its array is among the chosen names."""
    return not {name, array_and_index(name)[0]}.isdisjoint(chosen)


def _ask_about_degrees(table: Table, name: str, values: Floats, unit: str) -> None:
    """Warn of an angle without a unit that swings through more than a turn, there and back."""
    known = values[np.isfinite(values)]
    swings = 2 * abs(known[-1] - known[0]) < np.ptp(known)  # what only turns does not come back
    largest = float(np.max(np.abs(known)))
    if unit == "rad" and swings and largest > 2 * np.pi and not table.units[table.names.index(name)]:
        words = "%s: column %s reaches %.4g rad and comes back: if these are degrees, call it %s [deg]; else %s [rad]"
        logger.warning(words, table.title, name, largest, name, name)


def _columns_by_name(table: Table, units: Mapping[str, str], ignored: Sequence[str]) -> dict[str, Floats]:
    """Columns but that of time by name of their variable, in SI units."""
    values: dict[str, Floats] = {}
    for name in table.names:
        if _is_among(name, ignored) or is_estimate(name, units):
            continue
        if table.names.count(name) > 1 or (name != table.clock and name not in units):
            words = "is there twice" if table.names.count(name) > 1 else f"is no variable{suggestion(name, units)}"
            raise ValueError(f"column {name}: it {words}; ignore=[...] leaves columns out")
        if name != table.clock:
            values[name] = table.numbers(name, units[name])
    return values


def _driving_splines(  # noqa: PLR0917
    model: Model,
    times: Floats,
    values: Mapping[str, Floats],
    unknown: Iterable[str],
    smoothing: float | None,
    table: Table,
) -> Iterator[tuple[str, PPoly]]:
    """Yield name and spline of each input that moves, or differs from its declared value."""
    rates = {triple.value: (triple.rate, triple.acceleration) for triple in model.active}
    owners = {rate: name for name, pair in rates.items() for rate in pair}
    for name, start in ((v.name, v.starts[0]) for v in model.inputs if v.name in values):
        table.check_curve(name, times, values[name])
        with _prefixed_errors(f"column {name}"):
            if owners.get(name, name) not in values:
                raise ValueError(f"{owners[name]} has no column; add it")
            triple = [values.get(part) for part in (name, *rates.get(name, ()))]
            moves = any(column is not None and np.nanmax(column) > np.nanmin(column) for column in triple)
            if moves and name in unknown:
                raise ValueError("it moves, and is unknown; ignore it, or give it")
            if name not in owners and (moves or (name not in unknown and values[name][0] != start)):
                rows = complete_rows(times, *triple)  # rates are left out where values are smoothed
                yield name, piecewise_polynomial(knots(*(rows[:2] if smoothing else rows), smoothing=smoothing))


def _read_table(data: object, known: Collection[str]) -> Table:
    """Table of one experiment."""
    if isinstance(data, (str, PathLike)):
        table = read_table(Path(data), IdentificationError)
        if not table.names:
            raise IdentificationError(f"{data}: empty; its first line has to name columns, one of them time")
        return table.named(known)
    try:
        if isinstance(data, Result):
            columns = {"time": data.time} | {name: data.numbers(name) for name in data.names}
            return table_of(columns, IdentificationError, data.units, data.title).named(known)
        return table_of(data, IdentificationError).named(known)
    except (TypeError, ValueError):
        words = "give a path, a Result, a mapping of arrays of one length, or a list of these"
        raise IdentificationError(f"data = {shown(data)}: {words}") from None


def table_of(
    columns: Any, error: type[LiaisonsError], units: Mapping[str, str] = MappingProxyType({}), title: str = "data"
) -> Table:
    """Table of a mapping of names to arrays of one length, or of a data frame.

    :raises TypeError: if it is none.
    :raises ValueError: if it is none.
    """
    if hasattr(columns, "iloc"):  # a data frame of pandas
        units, title = columns.attrs.get("units", {}), columns.attrs.get("title", title)
        columns = columns.reset_index() if any(columns.index.names) else columns
    arrays = {str(name): np.asarray(array) for name, array in dict(columns).items()}
    (count,) = {len(array) for array in arrays.values()}
    rows = [f"row {row}" for row in range(count)]
    return Table(title, tuple(arrays), tuple(units.get(name, "") for name in arrays), (*arrays.values(),), rows, error)
