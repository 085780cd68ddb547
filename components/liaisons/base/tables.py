"""Tables of numbers from outside: CSV and Parquet files, data frames, mappings of arrays; the reader of all commands.

What a table may contain, and how it is read, is listed in ``docs/reference/tables.md``.
"""

from __future__ import annotations

import csv
import io
import re
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from liaisons.base.arrays import Floats
from liaisons.base.logs import logger
from liaisons.base.units import is_unit, size_in_si
from liaisons.errors import LiaisonsError

COUPLING_ERROR = "coupling_error"
"""Name of the column with the estimate of the coupling error."""
ERROR_OF = "error of "
"""How the name of a column with the estimated error of a signal begins."""
_CELLS = {"": np.nan, "nan": np.nan, "na": np.nan, "n/a": np.nan, "null": np.nan, "none": np.nan, "<na>": np.nan} | {
    "true": 1.0,
    "false": 0.0,
}
"""What stands for a number, in any case."""
_CLOCKS = ("time", "t", "Time", "TIME")
_BRACKETED = re.compile(r"(.*?)(\s*)[\[(]([^\[(]*[^\d, \[(][^\[(]*|)[\])]")
_POINT, _COMMA = (re.compile(rf"[+-]?(\d+{sign}\d*|{sign}\d+)([eE][+-]?\d+)?") for sign in (r"\.", ","))
_ERROR_CELL = re.compile(r"#(N/A|DIV/0!|VALUE!|NUM!|REF!|NAME\?|NULL!)")  # of a spreadsheet; no comment


@dataclass(frozen=True, eq=False)
class Table:
    """Columns of cells, with the names above and the units that belong to them.

    :param title: name of the file, or title of the result.
    :param units: as they are written; empty where there is none.
    :param cells: of each column.
    :param rows: labels of the rows, for messages.
    :param error: class of the errors.
    :param notes: ``(key, text)`` of each comment ``# key: text``.
    :param exact: units have a line of their own, or are known otherwise; names may have brackets.
    """

    title: str
    names: tuple[str, ...]
    units: tuple[str, ...]
    cells: tuple[Any, ...]
    rows: Sequence[str]
    error: type[LiaisonsError]
    notes: tuple[tuple[str, str], ...] = ()
    exact: bool = False

    def named(self, known: Collection[str] | None = None) -> Table:
        """The same table with units such as in ``length [mm]`` taken out of the names.

        :param known: names that are left as they are; None: of a table with a line of units, all are.
        """
        pairs = [self._name_and_unit(*pair, known) for pair in zip(self.names, self.units, strict=True)]
        for number, (name, _) in enumerate(pairs, start=1):
            if not name:
                raise self.error(f"{self.title}: column {number} has no name; name it, or leave it out")
        return replace(self, names=tuple(name for name, _ in pairs), units=tuple(unit for _, unit in pairs))

    @property
    def clock(self) -> str:
        """Name of the column of times; empty if there is none."""
        return next((name for name in _CLOCKS if name in self.names), "")

    def times(self, column: int | str = "", *, most: int = 0) -> Floats:
        """Instants [s], ascending.

        :param column: the clock by default.
        :param most: how often an instant may occur; twice is a jump; 0: as often as it does.
        """
        times = self.numbers(column or self.clock, "s", complete=True)
        name = self.clock if column == "" else self.names[column] if isinstance(column, int) else column
        words = f"it must {'be greater' if most == 1 else 'not be less'} than the one before"
        self.refuse_rows(name, np.diff(times, prepend=-np.inf) < (np.spacing(0.0) if most == 1 else 0), words)
        if most:
            again = np.append([False] * most, times[most:] == times[:-most])
            self.refuse_rows(name, again, "the same instant for the third time; twice is a jump")
        return times

    def numbers(self, column: int | str, unit: str | None, *, complete: bool = False) -> Floats:
        """Numbers in a column, not-a-number where a value is missing.

        :param column: its name, or its number from 0.
        :param unit: in which they are returned, all finite; None: as they are.
        :param complete: a missing value is refused.
        """
        column = self.names.index(column) if isinstance(column, str) else column
        name, cells = self.names[column], self.cells[column]
        numbers = _plain_numbers(cells)
        if numbers is None:
            numbers = np.array([self._number(name, *pair) for pair in zip(self.rows, cells, strict=True)])
        huge = [bool(np.isinf(x)) and "inf" not in str(cell).lower() for x, cell in zip(numbers, cells, strict=True)]
        self.refuse_rows(name, np.array(huge, dtype=bool), "more than a number can be")
        if unit is None:
            return numbers
        with np.errstate(over="ignore"):
            try:
                numbers = np.multiply(numbers, size_in_si(self.units[column], unit))
            except ValueError as problem:
                raise self._error(name, str(problem)) from None
        self.refuse_rows(name, np.isinf(numbers), "finite numbers only")
        if complete:
            self.refuse_rows(name, np.isnan(numbers), "a value is missing")
        return numbers

    def refuse_rows(self, name: str, wrong: NDArray[np.bool_], words: str) -> None:
        """Raise an error that names the column and the first wrong row, if there is one."""
        if wrong.any():
            raise self._error(name, f"{self.rows[int(wrong.argmax())]}: {words}")

    def check_curve(self, name: str, times: Floats, numbers: Floats) -> None:
        """Log what a curve through a column passes over: missing values, and whether a value is an outlier.

        :raises LiaisonsError: the class ``error``, if a value is missing at an end or at a jump.
        """
        missing, jump = np.isnan(numbers), np.diff(times, prepend=np.nan, append=np.nan) == 0
        needed = jump[1:] | jump[:-1]
        needed[[0, -1]] = True
        self.refuse_rows(name, missing & needed, "a value is missing at an end or a jump, which no curve can pass over")
        if missing.any():
            first, widest = self.rows[int(missing.argmax())], float(np.max(np.diff(times[~missing])))
            words = "%s: column %s: %d of %d values are missing, the first in %s; a curve passes over gaps of %.4g s"
            logger.warning(words, self.title, name, missing.sum(), missing.size, first, widest)
        self.warn_of_outlier(name, times, numbers)

    def warn_of_outlier(self, name: str, times: Floats, numbers: Floats) -> None:
        """Log the first value that lies far from the curve through its neighbours."""
        known = np.flatnonzero(np.isfinite(numbers))
        for row in known[_outliers(times[known], numbers[known])][:1].tolist():
            words = "%s: column %s: %s: %.6g lies far off the curve through its neighbours; if wrong, empty the cell"
            logger.warning(words, self.title, name, self.rows[row], numbers[row])

    def _error(self, name: str, words: str) -> LiaisonsError:
        """Error about a column."""
        return self.error(f"{self.title}: column {name}: {words}")

    def _name_and_unit(self, heading: str, below: str, known: Collection[str] | None) -> tuple[str, str]:
        """Name and unit of a column."""
        bracketed = None if heading in (known or ()) else _BRACKETED.fullmatch(heading)
        certain = bracketed and (bracketed[2] or (heading.endswith("]") and is_unit(bracketed[3])))
        if not bracketed or (known is None and (self.exact or not certain)):
            return heading, below  # an element x[Axis], a derivative der(x)
        if below not in {"", bracketed[3]}:
            raise self._error(bracketed[1], f"in {bracketed[3]} above, in {below} below; leave one out")
        return bracketed[1], bracketed[3]

    def _number(self, name: str, row: str, cell: Any) -> float:
        """Number in a cell."""
        text = "" if cell is None else str(cell).strip()
        try:
            if "_" in text or np.asarray(cell).dtype.kind in "mM":
                raise ValueError(f"could not convert string to float: {text!r}")
            return _CELLS[text.lower()] if text.lower() in _CELLS else float(text)
        except ValueError as problem:
            raise self._error(name, f"{row}: {problem}; give numbers, of time in one unit") from None


def _outliers(times: Floats, values: Floats) -> list[int]:
    """Indices of single values far from the cubic through two neighbours on both sides, which fit one another."""

    def deviations(x: Floats) -> Floats:
        """Value less cubic, from the third value to the last but two."""
        return x[2:-2] - sum(w * x[2 + k : x.size - 2 + k] for k, w in weights.items())

    if times.size < 12 or (np.diff(times) == 0).any():
        return []
    at = {k: times[2 + k : times.size - 2 + k] for k in (-2, -1, 0, 1, 2)}
    weights = {
        k: np.prod([(at[0] - at[j]) / (at[k] - at[j]) for j in (-2, -1, 1, 2) if j != k], axis=0)
        for k in (-2, -1, 1, 2)
    }
    deviation = deviations(values)
    outliers = []
    for i in np.flatnonzero(np.abs(deviation) > 30 * np.median(np.abs(deviation)) + 1e-6 * np.ptp(values)).tolist():
        repaired = values.copy()
        repaired[i + 2] -= deviation[i]
        if np.max(np.abs(deviations(repaired)[max(0, i - 2) : i + 3])) < 0.1 * abs(deviation[i]):
            outliers.append(i + 2)
    return outliers


def read_table(path: Path, error: type[LiaisonsError], title: str = "") -> Table:
    """Read a CSV or Parquet file.

    :param title: for messages; the path if empty.
    :raises LiaisonsError: the class ``error``, with the line, for what is not a table.
    """
    return (_read_parquet if path.suffix.lower() == ".parquet" else _read_csv)(path, error, title or str(path))


def is_estimate(name: str, known: Collection[str]) -> bool:
    """Whether a column is an estimate of errors that stands in a result, and no variable."""
    return name not in known and (name == COUPLING_ERROR or name.startswith(ERROR_OF))


def import_optional(purpose: str, package: str, extra: str, error: type[LiaisonsError], *modules: str) -> list[Any]:
    """Import an optional package, and modules of it; raises an error that names its extra."""
    try:
        return [import_module(f"{package.lower()}{module}") for module in ("", *modules)]
    except ImportError:
        raise error(f"{purpose} needs {package}; pip install 'liaisons[{extra}]'") from None


def import_pyarrow(path: Path, error: type[LiaisonsError]) -> list[Any]:
    """Import PyArrow and its module for Parquet."""
    return import_optional(f"{path}: Parquet", "PyArrow", "parquet", error, ".parquet")


def _read_parquet(path: Path, error: type[LiaisonsError], title: str) -> Table:
    """Read a Parquet file; units are metadata of its fields, notes of its schema."""
    arrow, parquet = import_pyarrow(path, error)
    try:
        with path.open("rb") as file:
            table = parquet.ParquetFile(file).read()
    except (OSError, ValueError, arrow.ArrowException) as problem:
        reason = getattr(problem, "strerror", None) or " ".join(str(problem).split())
        raise error(f"{path}: cannot be read as Parquet: {reason}") from None
    metadata = table.schema.metadata or {}
    fields = [field.metadata or {} for field in table.schema]
    notes = [(key.decode(errors="replace"), text.decode(errors="replace")) for key, text in metadata.items()]
    units = tuple(field.get(b"unit", b"").decode(errors="replace") for field in fields)
    cells = tuple(column.to_numpy() for column in table.columns)
    rows = [f"row {row}" for row in range(table.num_rows)]
    exact = any(b"unit" in field for field in fields)
    return Table(title, tuple(table.column_names), units, cells, rows, error, tuple(notes), exact)


def _read_csv(path: Path, error: type[LiaisonsError], title: str) -> Table:
    """Read a CSV file with commas, semicolons or tabulators."""
    try:
        raw = path.read_bytes()
        text = raw.decode("utf-16" if raw[:2] in {b"\xff\xfe", b"\xfe\xff"} else "utf-8-sig")
    except OSError as problem:
        raise error(f"{path}: cannot be read: {problem.strerror}") from None
    except UnicodeDecodeError as problem:
        raise error(f"{title}: no table of numbers: {problem}; save it as UTF-8") from None
    comments: dict[int, str] = {}
    sign = _delimiter(text)
    try:
        rows = dict(_records(text, sign, comments))
        top = min(rows, default=0)
        before = [number for number in comments if number < top]
        if before and all(map(_is_number, rows[top])):  # as numpy.savetxt writes names
            top = before[-1]
            rows = {top: comments.pop(top).split(sign)} | rows
        names = [name.strip().strip('"') for name in rows.pop(top, ())]
        if len(names) > 1 and not any("".join(row[len(names) - 1 :]).strip() for row in [names, *rows.values()]):
            names, rows = names[:-1], {number: row[: len(names) - 1] for number, row in rows.items()}
        for number, row in rows.items():
            if len(row) != len(names):
                raise error(f"{title}, line {number}: {len(row)} numbers for {len(names)} columns")
        units = _units(rows, {n: text for n, text in comments.items() if n < min(rows, default=n + 1)}, top, len(names))
        _use_points(rows, quoted=sign == ",") if sign != "," or '"' in text else None
    except (csv.Error, ValueError) as problem:
        raise error(f"{title}: no table of numbers: {problem}") from None
    pairs = (comment.partition(": ") for comment in comments.values())
    notes = [(key, text) for key, colon, text in pairs if colon]
    cells = tuple(zip(*rows.values(), strict=True)) if rows else ((),) * len(names)
    labels = [f"line {number}" for number in rows]
    exact, units = bool(units), units or [""] * len(names)
    return Table(title, tuple(names), tuple(units), cells, labels, error, tuple(notes), exact)


def _delimiter(text: str) -> str:
    """What separates the cells: said by the first line, ``sep=;``, or found in the first that is not a comment."""
    lines = (line for line in io.StringIO(text) if line.strip() and not line.startswith("#"))
    top = next(lines, "").strip()
    return top[4:] if re.fullmatch("sep=.", top) else next((sign for sign in "\t;" if sign in top), ",")


def _records(text: str, sign: str, comments: dict[int, str]) -> Iterator[tuple[int, list[str]]]:
    """Yield line and cells of each row; comments are collected by their lines."""
    number, begins = 0, True

    def lines() -> Iterator[str]:
        """Yield what is not a comment; a quoted cell may have several lines, and none of them is."""
        nonlocal number, begins
        for line_number, line in enumerate(io.StringIO(text, newline=""), start=1):
            start = line.lstrip(' "')
            if begins and start.startswith("#") and not _ERROR_CELL.match(start):
                comments[line_number] = start[1:].strip()
            elif not (begins and line.strip() == f"sep={sign}"):
                number, begins = line_number if begins else number, False
                yield line

    for row in csv.reader(lines(), delimiter=sign, strict=True):
        begins = True
        if any(map(str.strip, row)):
            yield number, row


def _units(rows: dict[int, list[str]], comments: Mapping[int, str], top: int, count: int) -> list[str]:
    """Units of the columns from a line of their own, which is taken out; empty if there is none.

    :param comments: those above the numbers.
    :param top: line of the names.
    :raises ValueError: for a line with other than so many units.
    """
    first = next(iter(rows), 0)
    if first and not any(map(_is_number, rows[first])):  # not a comment: a row below the names
        units = [_without_brackets(cell) for cell in rows[first]]
        if any(units) and all(map(is_unit, filter(None, units))):
            del rows[first]
            return units
    for number, comment in comments.items():
        for pattern in (r"[,;\t]", r"[,;\t\s]+"):
            units = [_without_brackets(unit) for unit in re.split(pattern, comment)]
            if len(units) == count and number == top + 1 and not any(" " in unit for unit in units):
                return units
            if any(units) and all(map(is_unit, filter(None, units))):
                if len(units) != count:
                    raise ValueError(f"line {number}: {len(units)} units for {count} columns")
                return units
    return []


def _without_brackets(cell: str) -> str:
    """Unit in a cell, which may stand in brackets."""
    return re.sub(r"^[\[(](.*)[\])]$", r"\1", cell.strip())


def _use_points(rows: dict[int, list[str]], *, quoted: bool) -> None:
    """Replace decimal commas by points.

    :param quoted: the cells are separated by commas, so that a comma in a cell may separate thousands.
    :raises ValueError: where a comma or a point may be either.
    """
    cells = [(number, column, cell.strip()) for number, row in rows.items() for column, cell in enumerate(row)]
    commas = [place for place in cells if _COMMA.fullmatch(place[2])]
    unclear = [place for place in commas if quoted and re.fullmatch(r"[+-]?\d{1,3},\d{3}", place[2])]
    unclear += [place for place in cells if commas and _POINT.fullmatch(place[2])]
    for number, column, cell in unclear[:1]:
        words = "a decimal sign, or a separator of thousands? write one decimal sign and no separators"
        raise ValueError(f"line {number}, column {column + 1}: {cell!r}: {words}")
    for number, column, cell in commas:
        rows[number][column] = cell.replace(",", ".")


def _plain_numbers(cells: Any) -> Floats | None:
    """Numbers in cells that all have one; None if one has to be looked at."""
    try:
        numbers = np.array([*map(float, cells)])
    except (TypeError, ValueError):
        return None
    dates = np.asarray(cells[:1]).dtype.kind in "mM"
    return None if dates or any(type(cell) is str and "_" in cell for cell in cells) else numbers


def _is_number(cell: str) -> bool:
    """Whether a cell holds a number."""
    try:
        float(cell)
    except ValueError:
        return False
    return True
