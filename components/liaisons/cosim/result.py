"""What a simulation gives back: time, and named signals with units; in and out of files, and drawn."""

from __future__ import annotations

import csv
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, final

import numpy as np
from numpy.typing import NDArray

from liaisons.arguments import as_path, listed, shown
from liaisons.cosim.files import replacing
from liaisons.cosim.variables import Shape, complete, split
from liaisons.errors import SimulationError, suggestion

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@final
@dataclass(frozen=True, eq=False, repr=False)
class Result:
    """Signals at the communication points, read-only.

    ``result["swing.theta"]`` is one of them, shape (n,).  Where ``chain.theta[1]`` to ``chain.theta[10]`` are there,
    ``result["chain.theta"]`` is all of them, shape (n, 10).  As of a dictionary, ``in``, ``len``, ``keys()`` and
    iteration go by names, an array under its own: ``dict(result)`` is all signals.

    :param title: what was simulated.
    :param time: communication points [s], shape (n,).
    :param names: names of the signals, those of elements one by one.
    :param values: shape (len(names), n).
    :param units: name -> unit, of whole arrays too; empty where the FMU gives none.
    """

    title: str
    time: NDArray[np.float64]
    names: tuple[str, ...]
    values: NDArray[np.float64]
    units: Mapping[str, str]

    def __post_init__(self) -> None:
        self.time.flags.writeable = False
        self.values.flags.writeable = False
        arrays = {name: self.units.get(self.names[rows[0]], "") for name, (rows, _) in self._arrays.items()}
        object.__setattr__(self, "units", MappingProxyType({**self.units, **arrays}))

    def __getitem__(self, name: str) -> NDArray[np.float64]:
        """A signal or an array of them by its name.

        :raises SimulationError: with the nearest name, if there is none of this name.
        """
        if not isinstance(name, str):
            raise SimulationError(
                f"the result of {self.title} has signals by name, {shown(name)} is none; take one by one"
            )
        if name in self._rows:
            return self.values[self._rows[name]]
        if name not in self._arrays:
            raise SimulationError(
                f"the result of {self.title} has no signal {name!r}{suggestion(name, self.entries)}"
                "; what is not recorded by default has to be named in record=[...]"
            )
        rows, shape = self._arrays[name]
        together = rows[-1] - rows[0] + 1 == len(rows)
        values = self.values[rows[0] : rows[-1] + 1] if together else self.values[rows]
        array = values.T.reshape(-1, *shape)
        array.flags.writeable = False
        return array

    @property
    def entries(self) -> tuple[str, ...]:
        """Names, with those of whole arrays in place of their elements'."""
        elements = {row: name for name, (rows, _) in self._arrays.items() for row in rows}
        return tuple(dict.fromkeys(elements.get(row, name) for row, name in enumerate(self.names)))

    def __contains__(self, name: object) -> bool:
        return name in self._rows or name in self._arrays if isinstance(name, str) else False

    def __iter__(self) -> Iterator[str]:
        return iter(self.entries)

    def __len__(self) -> int:
        return len(self.entries)

    def keys(self) -> tuple[str, ...]:
        """Names, as :attr:`entries`."""
        return self.entries

    @cached_property
    def _rows(self) -> dict[str, int]:
        return {name: row for row, name in enumerate(self.names)}

    @cached_property
    def _arrays(self) -> dict[str, tuple[list[int], Shape]]:
        """Arrays of which every element is there, in order: rows of the values, and shape."""
        found: dict[str, tuple[list[int], list[Shape]]] = {}
        for row, name in enumerate(self.names):
            base, index = split(name)
            if index is not None and base not in self._rows:
                rows, indices = found.setdefault(base, ([], []))
                rows.append(row)
                indices.append(index)
        shapes = {base: (rows, complete(indices)) for base, (rows, indices) in found.items()}
        return {base: (rows, shape) for base, (rows, shape) in shapes.items() if shape is not None}

    def to_csv(self, path: Path | str) -> None:
        """Write a file: names in its first line, units in the second after ``#``, then a line a communication point.

        Numbers are written so that the same doubles are read again, by :meth:`from_csv`,
        ``pandas.read_csv(path, comment="#")`` or ``numpy.genfromtxt(path, delimiter=",", names=True)``.  The file
        appears when it is complete.

        :raises SimulationError: if it cannot be written.
        """
        with replacing(as_path("to_csv", path)) as part, part.open("w", encoding="utf-8", newline="") as file:
            writer = csv.writer(file, lineterminator="\n")
            writer.writerow(["time", *self.names])
            writer.writerow(["# s", *(self.units[name] for name in self.names)])
            writer.writerows(np.vstack([self.time, self.values]).T.tolist())

    @classmethod
    def from_csv(cls, path: Path | str) -> Result:
        """Read what :meth:`to_csv` has written, or another table of numbers with time first and names above.

        :raises SimulationError: if it cannot be read, or is not such a file.
        """
        path = as_path("from_csv", path)
        try:
            with path.open(encoding="utf-8", newline="") as file:
                (_, *names), *rows = csv.reader(file)
            units = rows.pop(0)[1:] if rows and rows[0][:1] and rows[0][0].startswith("#") else [""] * len(names)
            values = np.array(rows, dtype=float).reshape(len(rows), 1 + len(names))
            described = dict(zip(names, units, strict=True))
        except OSError as error:
            raise SimulationError(f"{path}: cannot be read: {error.strerror}") from None
        except (ValueError, csv.Error) as error:
            raise SimulationError(f"{path}: not a result that to_csv has written: {error}") from None
        if len(described) != len(names) or not len(values):
            what = "has a name twice" if len(values) else "has no numbers"
            raise SimulationError(f"{path}: not a result that to_csv has written: it {what}")
        return cls._of_columns(path.stem, values.T, described)

    def to_parquet(self, path: Path | str) -> None:
        """Write a Parquet file: a column of doubles a signal, ``time`` first, units in the columns' metadata.

        Needs PyArrow (``pip install 'liaisons[parquet]'``); pandas, polars and DuckDB read it.  The file appears when
        it is complete.

        :raises SimulationError: if it cannot be written, or PyArrow is missing.
        """
        path = as_path("to_parquet", path)
        arrow, parquet = _pyarrow(path)
        units = {"time": "s"} | {name: self.units[name] for name in self.names}
        fields = [arrow.field(name, arrow.float64(), metadata={"unit": unit}) for name, unit in units.items()]
        schema = arrow.schema(fields, metadata={"title": self.title})
        with replacing(path) as part:
            parquet.write_table(arrow.table([self.time, *self.values], schema=schema), part)

    @classmethod
    def from_parquet(cls, path: Path | str) -> Result:
        """Read what :meth:`to_parquet` has written, or other columns of numbers with time first.

        :raises SimulationError: if it cannot be read, or PyArrow is missing.
        """
        path = as_path("from_parquet", path)
        arrow, parquet = _pyarrow(path)
        try:
            with path.open("rb") as file:
                table = parquet.ParquetFile(file).read()
            values = np.array([column.to_numpy() for column in table.columns], dtype=float)
        except (OSError, ValueError, arrow.ArrowException) as error:
            reason = getattr(error, "strerror", None) or " ".join(str(error).split())
            raise SimulationError(f"{path}: cannot be read as Parquet: {reason}") from None
        units = {field.name: (field.metadata or {}).get(b"unit", b"").decode() for field in table.schema}
        if values.ndim != 2 or len(units) != len(values):
            raise SimulationError(f"{path}: not a result that to_parquet has written: no columns, or a name twice")
        title = (table.schema.metadata or {}).get(b"title", path.stem.encode()).decode()
        return cls._of_columns(title, values, dict(list(units.items())[1:]))

    @classmethod
    def _of_columns(cls, title: str, columns: NDArray[np.float64], units: Mapping[str, str]) -> Result:
        values = np.ascontiguousarray(columns)
        return cls(title, values[0].copy(), tuple(units), values[1:], units)

    def plot(self, *names: str | Iterable[str], path: Path | str | None = None) -> Figure:
        """Draw signals over time, those of one unit in one diagram.

        :param names: what to draw, one by one or in a list; if nothing is named, what
            :func:`liaisons.cosim.figures.essential` finds worth it.
        :param path: where to save the figure, its kind by the suffix; without it, a notebook shows what is returned,
            and elsewhere ``matplotlib.pyplot.show`` shows it.
        :raises SimulationError: if a name is unknown or the file cannot be written.
        """
        from liaisons.cosim.figures import draw, essential

        path = None if path is None else as_path("plot: path", path)
        chosen = [name for group in names for name in listed("plot", group)]
        signals = {name: self[name] for name in chosen or self.entries}
        if not chosen:
            signals = {name: signals[name] for name in essential(signals, self.units)}
        figure = _new_figure(alone=path is not None)
        draw(figure, self.title, self.time, signals, self.units)
        if path is not None:
            try:
                with replacing(path) as part:
                    figure.savefig(part, format=path.suffix[1:] or "png")
            except (ValueError, RuntimeError) as error:  # of an unknown kind, or one that needs a program
                raise SimulationError(f"{path}: {' '.join(str(error).split())}") from None
        return figure

    def __repr__(self) -> str:
        shown = [self._shown(name) for name in self.entries[:8]]
        rest = f", and {len(self.entries) - 8} more" if len(self.entries) > 8 else ""
        return (
            f"<Result of {self.title}: {len(self.time)} points, t = {self.time[0]:g} to {self.time[-1]:g} s, "
            f"{len(self.names)} signals: {', '.join(shown)}{rest}>"
        )

    def _shown(self, name: str) -> str:
        size = f" ({'×'.join(map(str, self._arrays[name][1]))})" if name in self._arrays else ""
        return f"{name}{size} [{self.units[name]}]" if self.units[name] else f"{name}{size}"


@final
class IncompleteError(SimulationError):
    """An FMU failed on the way; :attr:`result` has everything up to the last communication point that was reached."""

    def __init__(self, message: str, result: Result) -> None:
        super().__init__(message)
        self.result = result


@final
class Interrupted(KeyboardInterrupt):
    """The user stopped a run; :attr:`result` has everything up to the last communication point that was reached.

    A ``KeyboardInterrupt``, so that a script stops where it stands; who wants to go on with what there is catches it.
    """

    def __init__(self, message: str, result: Result) -> None:
        super().__init__(message)
        self.result = result


def _pyarrow(path: Path) -> tuple[Any, Any]:
    try:
        import pyarrow
        import pyarrow.parquet
    except ImportError:
        raise SimulationError(f"{path}: Parquet needs PyArrow; pip install 'liaisons[parquet]'") from None
    return pyarrow, pyarrow.parquet


def _new_figure(*, alone: bool) -> Figure:
    """An empty figure; if it is not to be alone, one that pyplot knows and shows.

    A notebook shows what pyplot knows, and what a cell returns: there it is alone, or it would be seen twice.
    """
    import matplotlib as mpl

    if alone or "inline" in mpl.get_backend():
        from matplotlib.figure import Figure

        return Figure(layout="constrained")
    from matplotlib.pyplot import figure

    return figure(layout="constrained")
