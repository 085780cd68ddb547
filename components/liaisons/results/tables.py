"""Results as tables: CSV and Parquet files, data frames, labelled arrays, and summaries on a screen."""

from __future__ import annotations

import csv
import json
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from liaisons.base.arguments import check_integer, shown
from liaisons.base.files import replacement_path
from liaisons.base.tables import Table, import_optional, import_pyarrow, read_table
from liaisons.errors import InvalidValueError, SimulationError
from liaisons.results.signals import LabelledSignals

_FAILURE = "failure"
"""The last column of a file in which there are cases."""
_ESTIMATES = ("errors", "coupling_error")
"""Optional columns after the signals: ``error of NAME``, one per signal, and ``coupling_error``."""
_NOTES = ("title", "warning", "estimates")
"""Metadata of a file: in CSV lines ``# title: a swing``, in Parquet in the metadata of the schema."""


def write_csv(signals: LabelledSignals, path: Path, *, plain: bool) -> None:
    """Write signals to a CSV file.

    :param plain: without units and notes.
    :raises SimulationError: if it cannot be written.
    """
    if not isinstance(plain, bool):
        raise InvalidValueError(f"plain = {shown(plain)}: give True or False")
    names, (unit, *units), contents = zip(*_file_columns(signals), strict=True)
    with replacement_path(path) as part, part.open("w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerows([names] if plain else [names, [f"# {unit}", *units]])
        file.writelines(f"# {key}: {_escaped(text)}\n" for key, text in _metadata(signals) if not plain)
        writer.writerows(zip(*(content.tolist() for content in contents), strict=True))


def read(path: Path, writer: str) -> dict[str, Any]:
    """Read a CSV or Parquet file; returns the fields of :class:`LabelledSignals`.

    :param writer: method that writes such files.
    :raises SimulationError: if it cannot be read, or is not such a file.
    """
    label = f"{path}: not a result that {writer} has written"
    table = read_table(path, SimulationError, label).named()
    if table.names[-1:] != (_FAILURE,) and table.clock in table.names[1:]:  # of another tool
        order = sorted(range(len(table.names)), key=lambda column: table.names[column] != table.clock)
        moved = {part: tuple(getattr(table, part)[i] for i in order) for part in ("names", "units", "cells")}
        table = replace(table, **moved)
    try:
        notes = [
            (key, text if writer == "to_parquet" else _unescaped(text)) for key, text in table.notes if key in _NOTES
        ]
        notes += [("warning", one) for key, text in table.notes if key == "warnings" for one in json.loads(text)]
        return _signal_fields(path.stem, notes, table)
    except (TypeError, ValueError) as error:
        raise SimulationError(f"{label}: {error}") from None


def write_parquet(signals: LabelledSignals, path: Path) -> None:
    """Write signals to a Parquet file.

    :raises SimulationError: if it cannot be written, or PyArrow is missing.
    """
    arrow, parquet = import_pyarrow(path, SimulationError)
    names, units, contents = zip(*_file_columns(signals), strict=True)
    arrays = [arrow.array(content) for content in contents]
    columns = zip(names, arrays, units, strict=True)
    fields = [arrow.field(name, array.type, metadata={"unit": unit}) for name, array, unit in columns]
    notes = {key: text for key, text in _metadata(signals) if key != "warning"}
    notes["warnings"] = json.dumps(signals.warnings)
    with replacement_path(path) as part:
        parquet.write_table(arrow.table(arrays, schema=arrow.schema(fields, metadata=notes)), part)


def data_frame(signals: LabelledSignals) -> Any:
    """Make a ``pandas.DataFrame`` with a column for each signal."""
    (pandas,) = import_optional("to_pandas", "pandas", "pandas", SimulationError)
    levels = [pandas.Index(axis, name=name) for name, axis in signals.index.items()]
    index = levels[0] if len(levels) == 1 else pandas.MultiIndex.from_product(levels)
    frame = pandas.DataFrame({name: signals[name].ravel() for name in signals.names}, index=index)
    frame.attrs = {
        "title": signals.title,
        "units": dict(signals.units),
        "failures": dict(signals.failures),
        "warnings": list(signals.warnings),
    }
    return frame


def dataset(signals: LabelledSignals) -> Any:
    """Make an ``xarray.Dataset`` with a variable for each signal or array."""
    (xarray,) = import_optional("to_xarray", "xarray", "xarray", SimulationError)
    index = signals.index
    data = xarray.Dataset(coords=index, attrs={"title": signals.title, "warnings": list(signals.warnings)})
    if "time" in index:
        data["time"].attrs["units"] = "s"
    for name in signals:
        if name not in index:  # an FMU may record the time
            lengths = signals[name].shape[len(index) :]
            axes = [f"{letter}_{length}" for letter, length in zip("ijklmn", lengths, strict=False)]
            data[name] = ([*index, *axes], signals[name], {"units": signals.units[name]})
    if "case" in index:
        data.coords[_FAILURE] = ("case", _failure_reasons(signals, index["case"]))
    return data


def summary(signals: LabelledSignals, most: int | None, few: int) -> list[dict[str, str]]:
    """Rows of a table of the signals: start, end and extrema; of a sweep, its cases.

    :param most: largest number of rows; None: all.
    :param few: arrays of more elements have one row.
    """
    if most is not None:
        check_integer("most", most, minimum=0)
    if signals.kind != "sweep":
        return [_extent_row(signals, name) for name in signals.grouped(few)[:most]]
    names = [signals.label(name) for name in signals.names]
    cases = signals.values.T[:most].tolist()
    return [dict(zip(names, (f"{value:.6g}" for value in case), strict=True)) for case in cases]


def _extent_row(signals: LabelledSignals, name: str) -> dict[str, str]:
    """Row of a signal or array, by column: name, unit, start, end and extrema without failed cases."""
    values = signals[name]
    numeric = values.dtype != object

    def texts(numbers: Iterable[Any]) -> list[str]:
        """Texts of numbers with six digits; strings as they are."""
        return [f"{number:.6g}" if numeric else number for number in numbers]

    start, end = texts(values[[0, -1]]) if values.ndim == 1 else ("", "")
    unit = (signals.units[name] if numeric else "") or "-"
    row = {"signal": signals.sized(name), "unit": unit, "start": start, "end": end}
    valid = np.delete(values, list(signals.failures), axis=1) if signals.failures else values
    smallest, largest = texts([np.min(valid), np.max(valid)]) if numeric and valid.size else ("", "")
    row |= {"smallest": smallest, "largest": largest}
    if numeric and signals.errors is not None and signals.kind == "simulation":
        row["half the step"] = f"{np.max(np.abs(signals.error(name))):.1e}"
    return row


def _file_columns(signals: LabelledSignals) -> Iterator[tuple[str, str, NDArray[Any]]]:
    """Yield name, unit and content of each column of a file, whose rows are points, cases, or cases at points."""
    index = signals.index
    axes = dict(zip(index, map(np.ravel, np.meshgrid(*index.values(), indexing="ij")), strict=True))
    if signals.kind != "sweep":  # whose cases are numbered by their rows
        yield from ((name, "s" if name == "time" else "", axis) for name, axis in axes.items())
    yield from ((name, signals.units[name], signals[name].ravel()) for name in signals.names)
    if signals.errors is not None:
        for name in signals.names:
            errors = np.broadcast_to(signals.error(name), signals.values.shape[1:])
            yield f"error of {name}", signals.units[name], errors.ravel()
    if signals.coupling_error is not None:
        yield "coupling_error", "", signals.coupling_error
    if "case" in axes:
        yield _FAILURE, "", _failure_reasons(signals, axes["case"])


def _metadata(signals: LabelledSignals) -> list[tuple[str, str]]:
    """Metadata of a file: keys of :data:`_NOTES` with their texts."""
    estimates = ", ".join(name for name in _ESTIMATES if getattr(signals, name) is not None)
    notes = [("title", signals.title), *(("warning", text) for text in signals.warnings), ("estimates", estimates)]
    return notes if estimates else notes[:-1]


def _failure_reasons(signals: LabelledSignals, cases: NDArray[Any]) -> NDArray[Any]:
    """Why each case has failed; empty text if it has not."""
    return np.array([signals.failures.get(case, "") for case in cases.tolist()], dtype=object)


def _signal_fields(title: str, notes: Sequence[tuple[str, str]], table: Table) -> dict[str, Any]:
    """Fields of :class:`LabelledSignals` from the columns and notes of a file.

    :param title: unless the notes have one.
    :raises ValueError: with the reason, if these are not signals.
    """
    noted, names, units = dict(notes), table.names, table.units
    if not (names and table.rows):
        raise ValueError("it has no numbers")
    first = 1 if names[-1:] != (_FAILURE,) else 2 if names[:2] == ("time", "case") else int(names[0] == "time")
    end = len(names) - (first != 1)  # of results over time alone, any name may be a signal's
    last, last_error = _column_ends(noted.get("estimates", ""), first, end)
    if len(set(names[:last])) < last:
        raise ValueError("it has a name twice")
    texts, rows = {}, []
    for column, name in enumerate(names[:end]):
        cells = table.cells[column]
        if first <= column < last and not units[column] and not any(map(_is_number, cells)):
            strings, indices = np.unique(np.array(cells, dtype=str), return_inverse=True)
            texts[name] = tuple(strings.tolist())
            rows.append(indices)
        else:
            rows.append(table.numbers(column, None) if column or not first else table.times(0))
    numbers = np.array(rows, dtype=float)
    time, values = numbers[0].copy() if first else np.empty(0), numbers[first:]
    if first == 2:
        time = np.unique(time)
        values = values.reshape(len(values), len(time), -1)
    failures = [] if first == 1 else table.cells[end][: values.shape[-1]]
    values, errors, coupling_error = np.split(values, [last - first, last_error - first])
    if first == 2:
        errors = errors[:, 0]  # of a case, the same at all times
    return {
        "title": noted.get("title", title),
        "time": time,
        "names": tuple(names[first:last]),
        "values": np.ascontiguousarray(values),
        "units": dict(zip(names[first:last], units[first:last], strict=True)),
        "failures": {case: reason for case, reason in enumerate(failures) if reason},
        "texts": texts,
        "jumping": frozenset(texts),
        "errors": np.ascontiguousarray(errors) if len(errors) else None,
        "coupling_error": coupling_error[0].copy() if len(coupling_error) else None,
        "warnings": tuple(text for key, text in notes if key == "warning"),
    }


def _column_ends(estimates: str, first: int, end: int) -> tuple[int, int]:
    """Ends of the columns of signals and of their errors in a file with these estimates.

    :param first: column of the first signal.
    :param end: column after the last number.
    :raises ValueError: if there are not that many columns.
    """
    named = estimates.split(", ")
    last_error = end - ("coupling_error" in named)
    count, odd = divmod(last_error - first, 2 if "errors" in named else 1)
    if odd or count < 0:
        raise ValueError(f"it has no column for each of its estimates ({estimates})")
    return first + count, last_error


def _escaped(text: str) -> str:
    """Text on one line without quotes, by which other readers of CSV begin a cell."""
    return json.dumps(text, ensure_ascii=False)[1:-1].replace('\\"', "\\u0022")


def _unescaped(text: str) -> str:
    """Text of a note; as it stands if it was written by hand."""
    try:
        return json.loads(f'"{text}"')
    except ValueError:
        return text


def _is_number(content: Any) -> bool:
    """Whether a cell holds a number."""
    try:
        float(content)
    except (TypeError, ValueError):
        return False
    return True
