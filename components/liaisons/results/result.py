"""Named signals with units over time, over cases, or over both; in and out of files, and drawn."""

from __future__ import annotations

import csv
import json
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from importlib import import_module
from itertools import islice
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from liaisons.arguments import as_path, listed, shown
from liaisons.array_names import Shape, complete, split
from liaisons.errors import LiaisonsError, SimulationError, suggestion
from liaisons.files import replacing
from liaisons.pictures import Scene, animate, motion_page
from liaisons.port_names import PortNames
from liaisons.results.notebook import curve, framed, html_table

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_MOST_ROWS = 100
"""So many has a table in a notebook."""
_MOST_BYTES, _MOST_FRAMES = 300_000, 120_000
"""A motion in a notebook takes no more, and its frames no more of it; what is larger, :meth:`Result.animate` writes."""
_FRAME_HEIGHT = 420
"""Of a motion [px]."""
_FAILURE = "failure"
"""The last column of a file in which there are cases."""
_ESTIMATES = ("errors", "coupling_error")
"""What a file may have after the signals: columns ``error of NAME``, one a signal, and ``coupling_error``."""
_NOTES = ("title", "warning", "estimates")
"""What a file says of itself: in CSV lines ``# title: a swing``, in Parquet in the metadata of the schema."""


@final
@dataclass(frozen=True, eq=False, repr=False)
class Result:
    """What a simulation, a sweep or an ensemble gives back: signals by name, read-only.

    ``result["swing.theta"]`` is one of them, over time, shape (times,), after a simulation; over the cases, shape
    (cases,), after a sweep; over both, shape (times, cases), of an ensemble.  Where ``chain.theta[1]`` to
    ``chain.theta[10]`` are there, ``result["chain.theta"]`` is all of them, with one more axis of 10.  As of a
    dictionary, ``in``, ``len``, ``keys()`` and iteration go by names, an array under its own: ``dict(result)`` is all
    signals.

    :param title: what was simulated.
    :param time: communication points, or recorded times [s], shape (times,); of a sweep, which keeps one number a case,
        empty.
    :param names: names of the signals, those of elements one by one; of a sweep, what was varied, then what was kept.
    :param values: shape (len(names), times), (len(names), cases) or (len(names), times, cases).
    :param units: name -> unit, of whole arrays too; empty where there is none.
    :param failures: number of a case, from 0 -> why it has failed; its values are not-a-number from there on.
    :param unfinished: those of them that the machine did not finish, rather than the model refused: the same sweep with
        its journal tries them again.
    :param errors: of an ensemble, estimate of the largest error of each signal over the times, shape
        (len(names), cases), from runs with steps twice and four times as long; infinite where these do not converge.
        Of a simulation that was verified, differences from a run with steps half as long, shape (len(names), times).
    :param coupling_error: of a simulation, estimate of what each step has added to the error of a signal by coupling,
        relative to its size, the largest of all, shape (times,).
    :param compiled: of an ensemble, whether compiled code has done it, or NumPy.
    :param texts: name of a signal of strings -> those that its values count from 0.
    :param jumping: names of signals that change in jumps only.
    :param ports: value -> names of the variables of its port, where the FMU calls them otherwise than
        :func:`liaisons.port_names.port_names` does; nothing after reading from a file.
    :param scene: what was simulated looks like; None after reading from a file, a sweep or an ensemble.
    :param warnings: of a simulation, what was logged as a warning, each text once; of a sweep, with the number of the
        case, a hundred of them.
    """

    title: str
    time: NDArray[np.float64]
    names: tuple[str, ...]
    values: NDArray[np.float64]
    units: Mapping[str, str]
    failures: Mapping[int, str] = field(default_factory=dict)
    unfinished: tuple[int, ...] = ()
    errors: NDArray[np.float64] | None = None
    coupling_error: NDArray[np.float64] | None = None
    compiled: bool = False
    texts: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    jumping: frozenset[str] = frozenset()
    ports: Mapping[str, PortNames] = field(default_factory=dict)
    scene: Scene | None = None
    warnings: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        self.time.flags.writeable = False
        self.values.flags.writeable = False
        if self.coupling_error is not None:
            self.coupling_error.flags.writeable = False
        arrays = {name: self.units.get(self.names[rows[0]], "") for name, (rows, _) in self._arrays.items()}
        object.__setattr__(self, "units", MappingProxyType({**self.units, **arrays}))
        object.__setattr__(self, "failures", MappingProxyType(dict(sorted(self.failures.items()))))

    def __getitem__(self, name: str) -> NDArray[Any]:
        """A signal or an array of them by its name: numbers, or strings.

        :raises SimulationError: with the nearest name, if there is none of this name.
        """
        values = self._part(self.values, name)
        texts = self._texts(name)
        return values if texts is None else np.array(texts, dtype=object)[values.astype(int)]

    def _texts(self, name: str) -> tuple[str, ...] | None:
        """Those of a signal, or of an array, whose elements have the same."""
        return self.texts.get(self.names[self._arrays[name][0][0]] if name in self._arrays else name)

    @property
    def unconverged(self) -> tuple[int, ...]:
        """Cases of an ensemble, one of whose signals does not converge as the steps shrink: numbers, from 0."""
        if self.errors is None or self.scene is not None:
            return ()
        return tuple(np.flatnonzero(np.isinf(self.errors).any(axis=0)).tolist())

    def error(self, name: str) -> NDArray[np.float64]:
        """Estimated largest error of a signal of an ensemble, shape (cases,); of a verified simulation, shape (times,).

        :raises SimulationError: for an unknown name, or if there is no estimate.
        """
        if self.errors is None:
            cure = "simulate(verify=True) compares with half the step" if self.scene else "leave estimate=False out"
            raise SimulationError(f"the result of {self.title} has no error estimate; {cure}")
        return self._part(self.errors, name)

    def _part(self, of: NDArray[np.float64], name: str) -> NDArray[np.float64]:
        """Rows of one name; the axis of an array goes to the end."""
        if not isinstance(name, str):
            raise SimulationError(
                f"the result of {self.title} has signals by name, {shown(name)} is none; take one by one"
            )
        if name in self._rows:
            return of[self._rows[name]]
        if name not in self._arrays:
            raise SimulationError(
                f"the result of {self.title} has no signal {name!r}{suggestion(name, self.entries)}; what is not "
                f"recorded by default has to be named in {'record' if self.time.size else 'keep'}=[...]"
            )
        rows, shape = self._arrays[name]
        together = rows[-1] - rows[0] + 1 == len(rows)
        values = of[rows[0] : rows[-1] + 1] if together else of[rows]
        array = np.moveaxis(values, 0, -1).reshape(*values.shape[1:], *shape)
        array.flags.writeable = False
        return array

    @property
    def entries(self) -> tuple[str, ...]:
        """Names, with those of whole arrays in place of their elements'."""
        return self._grouped(0)

    def _grouped(self, size: int) -> tuple[str, ...]:
        """Names, with those of arrays of more elements than this in place of their elements'."""
        elements = {row: name for name, (rows, _) in self._arrays.items() if len(rows) > size for row in rows}
        return tuple(dict.fromkeys(elements.get(row, name) for row, name in enumerate(self.names)))

    @property
    def index(self) -> dict[str, NDArray[Any]]:
        """What the signals are over, axis by axis: ``"time"`` [s], ``"case"``, counted from 0, or both."""
        time = {"time": self.time} if self.time.size else {}
        return time if len(time) == self.values.ndim - 1 else {**time, "case": np.arange(self.values.shape[-1])}

    @property
    def rows(self) -> NDArray[Any]:
        """The signals as a structured array with a field of doubles, or strings, each."""
        columns = {name: self[name] for name in self.names}
        rows = np.empty(self.values.shape[1:], dtype=[(name, values.dtype) for name, values in columns.items()])
        for name, values in columns.items():
            rows[name] = values
        return rows

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
        """Write a file: names in its first line, units in the second after ``#``, then a line a point or case.

        Between them, ``# title: ...`` and a line ``# warning: ...`` each; error estimates are columns behind the
        signals.  Numbers are written so that the same doubles are read again, by :meth:`from_csv`,
        ``pandas.read_csv(path, comment="#")`` or ``numpy.genfromtxt(path, delimiter=",", names=True)``.  Where there
        are cases, the last column, ``failure``, says why one has failed.  The file appears when it is complete.

        :raises SimulationError: if it cannot be written.
        """
        names, (unit, *units), contents = zip(*self._columns(), strict=True)
        with replacing(as_path("to_csv", path)) as part, part.open("w", encoding="utf-8", newline="") as file:
            writer = csv.writer(file, lineterminator="\n")
            writer.writerows([names, [f"# {unit}", *units]])
            file.writelines(f"# {key}: {_escaped(text)}\n" for key, text in self._notes())
            writer.writerows(zip(*(content.tolist() for content in contents), strict=True))

    @classmethod
    def from_csv(cls, path: Path | str) -> Result:
        """Read what :meth:`to_csv` has written, or another table of numbers with time first and names above.

        :raises SimulationError: if it cannot be read, or is not such a file.
        """
        path = as_path("from_csv", path)
        try:
            notes: list[tuple[str, str]] = []
            with path.open(encoding="utf-8", newline="") as file:
                names, *rows = csv.reader(_without_notes(file, notes))
            units = rows.pop(0) if rows and "".join(rows[0][:1]).startswith("#") else [""] * len(names)
            units[:1] = [unit.removeprefix("# ") for unit in units[:1]]
            columns = zip(names, units, *rows, strict=True)
            return cls._of_columns(path.stem, notes, names, units, [content for _, _, *content in columns])
        except OSError as error:
            raise SimulationError(f"{path}: cannot be read: {error.strerror}") from None
        except (ValueError, csv.Error) as error:
            raise SimulationError(f"{path}: not a result that to_csv has written: {error}") from None

    def to_parquet(self, path: Path | str) -> None:
        """Write a Parquet file: the columns that :meth:`to_csv` writes, units in their metadata, the rest in its own.

        Needs PyArrow (``pip install 'liaisons[parquet]'``); pandas, polars and DuckDB read it.  The file appears when
        it is complete.

        :raises SimulationError: if it cannot be written, or PyArrow is missing.
        """
        path = as_path("to_parquet", path)
        arrow, parquet = _pyarrow(path)
        names, units, contents = zip(*self._columns(), strict=True)
        arrays = [arrow.array(content) for content in contents]
        columns = zip(names, arrays, units, strict=True)
        fields = [arrow.field(name, array.type, metadata={"unit": unit}) for name, array, unit in columns]
        notes = {key: text for key, text in self._notes() if key != "warning"} | {"warnings": json.dumps(self.warnings)}
        with replacing(path) as part:
            parquet.write_table(arrow.table(arrays, schema=arrow.schema(fields, metadata=notes)), part)

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
        except (OSError, ValueError, arrow.ArrowException) as error:
            reason = getattr(error, "strerror", None) or " ".join(str(error).split())
            raise SimulationError(f"{path}: cannot be read as Parquet: {reason}") from None
        found = {key.decode(errors="replace"): text for key, text in (table.schema.metadata or {}).items()}
        units = [(field.metadata or {}).get(b"unit", b"").decode() for field in table.schema]
        try:
            notes = [(key, found[key].decode()) for key in _NOTES if key in found]
            notes += [("warning", str(text)) for text in json.loads(found.get("warnings", "[]"))]
            return cls._of_columns(path.stem, notes, table.column_names, units, [c.to_numpy() for c in table.columns])
        except (TypeError, ValueError) as error:
            raise SimulationError(f"{path}: not a result that to_parquet has written: {error}") from None

    def _columns(self) -> Iterator[tuple[str, str, NDArray[Any]]]:
        """Name, unit and content of the columns of a file: a row a point, a case, or a case at a point."""
        index = self.index
        axes = dict(zip(index, map(np.ravel, np.meshgrid(*index.values(), indexing="ij")), strict=True))
        if self.time.size:  # the cases of a sweep count themselves
            yield from ((name, "s" if name == "time" else "", axis) for name, axis in axes.items())
        yield from ((name, self.units[name], self[name].ravel()) for name in self.names)
        if self.errors is not None:
            shape = self.values.shape[1:]
            for name, errors in zip(self.names, self.errors, strict=True):
                yield f"error of {name}", self.units[name], np.broadcast_to(errors, shape).ravel()
        if self.coupling_error is not None:
            yield "coupling_error", "", self.coupling_error
        if "case" in axes:
            yield _FAILURE, "", self._reasons(axes["case"])

    def _notes(self) -> list[tuple[str, str]]:
        """What a file says of the result beside its columns, by :data:`_NOTES`."""
        estimates = [name for name in _ESTIMATES if getattr(self, name) is not None]
        notes = [("title", self.title), *(("warning", text) for text in self.warnings)]
        return [*notes, *([("estimates", ", ".join(estimates))] if estimates else [])]

    def _reasons(self, cases: NDArray[Any]) -> NDArray[Any]:
        """Why each of these cases has failed, empty if it has not."""
        return np.array([self.failures.get(case, "") for case in cases.tolist()], dtype=object)

    @classmethod
    def _of_columns(
        cls,
        title: str,
        notes: Iterable[tuple[str, str]],
        names: Sequence[str],
        units: Sequence[str],
        contents: Sequence[Sequence[Any]],
    ) -> Result:
        """What :meth:`_columns` and :meth:`_notes` have made.

        :param title: unless the notes have one.
        :raises ValueError: if they have not, with the reason.
        """
        notes = list(notes)
        first = 1 if names[-1:] != [_FAILURE] else 2 if names[:2] == ["time", "case"] else int(names[0] == "time")
        end = len(names) - (first != 1)  # of results over time alone, any name may be a signal's
        last, last_error = _estimates_begin(dict(notes).get("estimates", ""), first, end)
        texts, rows = {}, [*contents[:end]]
        for place, name in enumerate(names[first:last], start=first):
            if not units[place] and len(rows[place]) and not any(map(_is_number, rows[place])):
                found, places = np.unique(np.array(rows[place], dtype=str), return_inverse=True)
                texts[name], rows[place] = tuple(found.tolist()), places.tolist()
        numbers = np.array(rows, dtype=float)
        if len(set(names[:last])) < last or not numbers.size:
            raise ValueError("it has a name twice, or no numbers")
        time, values = numbers[0].copy() if first else np.empty(0), numbers[first:]
        if first == 2:
            time = np.unique(time)
            values = values.reshape(len(values), len(time), -1)
        failures = [] if first == 1 else contents[end][: values.shape[-1]]
        values, errors, coupling_error = np.split(values, [last - first, last_error - first])
        if first == 2:
            errors = errors[:, 0]  # of a case, the same at all times
        return cls(
            dict(notes).get("title", title),
            time,
            tuple(names[first:last]),
            np.ascontiguousarray(values),
            dict(zip(names[first:last], units[first:last], strict=True)),
            failures={case: reason for case, reason in enumerate(failures) if reason},
            texts=texts,
            jumping=frozenset(texts),
            errors=np.ascontiguousarray(errors) if len(errors) else None,
            coupling_error=coupling_error[0].copy() if len(coupling_error) else None,
            warnings=tuple(text for key, text in notes if key == "warning"),
        )

    def to_pandas(self) -> Any:
        """A ``pandas.DataFrame``: a column a signal, over time, cases or both; title, units and so on in ``attrs``.

        :raises SimulationError: if pandas is missing (``pip install 'liaisons[pandas]'``).
        """
        pandas = _extra("to_pandas", "pandas", "pandas")
        levels = [pandas.Index(axis, name=name) for name, axis in self.index.items()]
        index = levels[0] if len(levels) == 1 else pandas.MultiIndex.from_product(levels)
        frame = pandas.DataFrame({name: self[name].ravel() for name in self.names}, index=index)
        about = {"title": self.title, "units": dict(self.units), "failures": dict(self.failures)}
        frame.attrs = {**about, "warnings": list(self.warnings)}
        return frame

    def to_xarray(self) -> Any:
        """An ``xarray.Dataset``: a variable a signal or array, over ``time``, ``case`` or both.

        The axes of arrays are called by place and length, ``i_10``, so that those of one length go together.  Units are
        attributes; what has failed is the coordinate ``failure`` of the cases.

        :raises SimulationError: if xarray is missing (``pip install 'liaisons[xarray]'``).
        """
        xarray = _extra("to_xarray", "xarray", "xarray")
        index = self.index
        dataset = xarray.Dataset(coords=index, attrs={"title": self.title, "warnings": list(self.warnings)})
        if "time" in index:
            dataset["time"].attrs["units"] = "s"
        for name in self.entries:
            if name not in index:  # an FMU may record the time
                lengths = self[name].shape[len(index) :]
                axes = [f"{letter}_{length}" for letter, length in zip("ijklmn", lengths, strict=False)]
                dataset[name] = ([*index, *axes], self[name], {"units": self.units[name]})
        if "case" in index:
            dataset.coords[_FAILURE] = ("case", self._reasons(index["case"]))
        return dataset

    def plot(self, *names: str | Iterable[str], over: str | None = None, path: Path | str | None = None) -> Figure:
        """Draw signals, those of one unit in one diagram.

        :param names: what to draw, one by one or in a list; if nothing is named, what
            :func:`liaisons.results.figures.essential` finds worth it.
        :param over: signal on the horizontal axis; else time, or of a sweep what was varied, if it is one ascending
            value, else the number of the case.
        :param path: where to save the figure, its kind by the suffix; without it, a notebook shows what is returned,
            and elsewhere ``matplotlib.pyplot.show`` shows it.
        :raises SimulationError: if a name is unknown or the file cannot be written.
        """
        from liaisons.results.figures import draw, essential

        path = None if path is None else as_path("plot: path", path)
        chosen = [name for group in names for name in listed("plot", group)]
        if over is None and not self.time.size and np.all(np.diff(self.values[0]) > 0):
            over = self.names[0]
        signals = {name: self._part(self.values, name) for name in chosen or self.entries if chosen or name != over}
        if not chosen:
            signals = {name: signals[name] for name in essential(signals, self.units, self.ports)}
        axis, values = next(iter(self.index.items())) if over is None else (over, self._part(self.values, over))
        unit = "s" if axis == "time" else self.units.get(axis)
        horizontal = f"{axis} [{unit}]" if unit else axis, values
        joined = bool(self.time.size) or over is not None
        steps = {name for name in signals if self.time.size and self._jumps(name)}
        texts = {name: texts for name in signals if (texts := self._texts(name)) is not None}
        return draw(self.title, horizontal, signals, self.units, joined=joined, steps=steps, texts=texts, path=path)

    def _jumps(self, name: str) -> bool:
        return (self.names[self._arrays[name][0][0]] if name in self._arrays else name) in self.jumping

    def animate(
        self,
        path: Path | str,
        *,
        speed: float | None = None,
        against: Mapping[str, ArrayLike] | None = None,
        turns: float = 0.0,
    ) -> float:
        """Write the motion as a film or a page.

        :param path: ends in ``.gif``, ``.png`` (a strip of instants), ``.mp4`` (needs the extra ``film``), ``.glb``
            (glTF, for Blender, slides and model viewers), ``.html`` (one file, to be dragged and zoomed) or
            ``NAME_visual.xml`` (for OMEdit, which opens the table ``NAME_res.csv`` that is written beside it).
        :param speed: seconds of motion a second; real time unless that takes longer than 20 s.
        :param against: signals that a ghost of the mechanism follows, e.g. ``Pendulum.exact(result.time)``; drawn in
            gif, png and mp4 only.
        :param turns: how often the camera goes round a spatial mechanism.
        :returns: the speed.
        :raises SimulationError: for another ending, a ghost where none is drawn, a missing extra, a result without a
            picture, or numbers that are not finite.
        """
        path = as_path("path", path)
        if self.scene is None:
            raise SimulationError(f"the result of {self.title} has no picture; animate that of simulate() or System")
        signals = dict(zip(self.names, self.values, strict=True))
        return animate(
            path, self.scene, self.time, signals, title=self.title, speed=speed, against=against, turns=turns
        )

    def summary(self, most: int | None = None, *, few: int = 10) -> list[dict[str, str]]:
        """Rows of a table: what each signal did, cases that failed aside; or of a sweep, its cases.

        :param most: how many rows; None: all.
        :param few: arrays of no more elements than this have a row for each.
        """
        if not self.time.size:
            names = [self._label(name) for name in self.names]
            cases = self.values.T[:most].tolist()
            return [dict(zip(names, (f"{value:.6g}" for value in case), strict=True)) for case in cases]
        return [self._did(name) for name in self._grouped(few)[:most]]

    def _did(self, name: str) -> dict[str, str]:
        values = self[name]
        if self._texts(name) is not None:
            start, end = values[[0, -1]] if values.ndim == 1 else ("", "")
            return {"signal": self._sized(name), "unit": "-", "start": start, "end": end, "smallest": "", "largest": ""}
        start, end = (f"{value:.6g}" for value in values[[0, -1]]) if values.ndim == 1 else ("", "")
        sound = np.delete(values, list(self.failures), axis=1) if self.failures else values
        smallest, largest = (f"{f(sound):.6g}" if sound.size else "" for f in (np.min, np.max))
        ends = {"start": start, "end": end, "smallest": smallest, "largest": largest}
        if self.errors is not None and self.scene is not None:
            ends["half the step"] = f"{np.max(np.abs(self.error(name))):.1e}"
        return {"signal": self._sized(name), "unit": self.units[name] or "-", **ends}

    def _sized(self, name: str) -> str:
        return f"{name} ({'×'.join(map(str, self._arrays[name][1]))})" if name in self._arrays else name

    def _label(self, name: str) -> str:
        return f"{self._sized(name)} [{self.units[name]}]" if self.units[name] else self._sized(name)

    def _headline(self) -> str:
        parts = [f"{len(self.time)} points, t = {self.time[0]:g} to {self.time[-1]:g} s"] if self.time.size else []
        if "case" in self.index:
            without = f", {len(self.unconverged)} without convergence" if self.unconverged else ""
            parts.append(f"{self.values.shape[-1]} cases, {len(self.failures)} failed{without}")
        return f"Result of {self.title}: {', '.join(parts)}, {len(self.names)} signals"

    def __repr__(self) -> str:
        rest = f", and {len(self) - 8} more" if len(self) > 8 else ""
        many, first = len(self.warnings), self.warnings[:1]
        rest += f"; {many} warning{'s, the first' if many > 1 else ''}: {first[0]}" if first else ""
        return f"<{self._headline()}: {', '.join(map(self._label, self.entries[:8]))}{rest}>"

    def _repr_html_(self) -> str:
        curves = [curve(self._part(self.values, name)) for name in self.entries[:_MOST_ROWS]] if self.time.size else []
        remarks = [f"case {case} failed: {reason}" for case, reason in islice(self.failures.items(), _MOST_ROWS)]
        motion, said = self._motion()
        remarks += [*said, *(f"Warning: {text}" for text in self.warnings)]
        return motion + html_table(self._headline(), self.summary(_MOST_ROWS, few=0), curves=curves, remarks=remarks)

    def _motion(self) -> tuple[str, list[str]]:
        """What was simulated, moving, or why it cannot be shown: a result is shown in any case."""
        if self.scene is None:
            return "", []
        signals = dict(zip(self.names, self.values, strict=True))
        try:
            page = motion_page(self.scene, self.time, signals, title=self.title, most=_MOST_FRAMES)
        except LiaisonsError as error:
            return "", [f"The motion cannot be shown: {error}"]
        shown = framed(page, _FRAME_HEIGHT) if page else ""
        if len(shown) > _MOST_BYTES:
            return "", ["The motion is too large to be shown here; result.animate(path) writes it."]
        return shown, []


@final
class IncompleteError(SimulationError):
    """An FMU failed on the way; ``result`` has everything up to the last communication point that was reached."""

    def __init__(self, message: str, result: Result) -> None:
        super().__init__(message)
        self.result = result


@final
class Interrupted(KeyboardInterrupt):
    """The user stopped a run; ``result`` has everything up to the last communication point that was reached.

    A ``KeyboardInterrupt``, so that a script stops where it stands; who wants to go on with what there is catches it.
    """

    def __init__(self, message: str, result: Result) -> None:
        super().__init__(message)
        self.result = result


def _estimates_begin(named: str, first: int, end: int) -> tuple[int, int]:
    """Columns at which signals end and at which their errors end, in a file with these estimates.

    :param first: column of the first signal.
    :param end: column after the last number.
    :raises ValueError: if it has not so many.
    """
    estimates = [name for name in _ESTIMATES if name in named.split(", ")]
    last_error = end - ("coupling_error" in estimates)
    count, odd = divmod(last_error - first, 2 if "errors" in estimates else 1)
    if odd or count < 0:
        raise ValueError(f"it has no column for each of its estimates ({named})")
    return first + count, last_error


def _escaped(text: str) -> str:
    """A text on one line, without quotes, which other readers of CSV would take for the begin of a cell."""
    return json.dumps(text, ensure_ascii=False)[1:-1].replace('\\"', "\\u0022")


def _without_notes(lines: Iterable[str], notes: list[tuple[str, str]]) -> Iterator[str]:
    """The lines of a CSV file but those that say something of the whole, which are added to the notes."""
    for line in lines:
        key, colon, text = line.rstrip("\r\n").partition(": ")
        if not (colon and key.removeprefix("# ") in _NOTES and key.startswith("# ")):
            yield line
            continue
        try:
            notes.append((key[2:], json.loads(f'"{text}"')))
        except ValueError:  # somebody has written it by hand
            notes.append((key[2:], text))


def _is_number(content: Any) -> bool:
    try:
        float(content)
    except (TypeError, ValueError):
        return False
    return True


def _extra(what: str, package: str, extra: str, part: str = "") -> Any:
    """A package that not everybody has, or a part of it."""
    try:
        return import_module(f"{package.lower()}{part}")
    except ImportError:
        raise SimulationError(f"{what} needs {package}; pip install 'liaisons[{extra}]'") from None


def _pyarrow(path: Path) -> tuple[Any, Any]:
    what = f"{path}: Parquet", "PyArrow", "parquet"
    return _extra(*what), _extra(*what, ".parquet")
