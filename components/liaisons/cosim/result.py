"""What a simulation gives back: time, and named signals with units."""

from __future__ import annotations

import csv
import os
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, final

import numpy as np
from numpy.typing import NDArray

from liaisons.errors import SimulationError, suggestion

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@final
@dataclass(frozen=True, eq=False, repr=False)
class Result:
    """Signals at the communication points; ``result["swing.theta"]`` is one of them, shape (n,), read-only.

    :param title: what was simulated.
    :param time: communication points [s], shape (n,).
    :param names: names of the signals.
    :param values: shape (len(names), n).
    :param units: name -> unit; empty where the FMU gives none.
    """

    title: str
    time: NDArray[np.float64]
    names: tuple[str, ...]
    values: NDArray[np.float64]
    units: Mapping[str, str]

    def __post_init__(self) -> None:
        self.time.flags.writeable = False
        self.values.flags.writeable = False
        object.__setattr__(self, "units", MappingProxyType(dict(self.units)))

    def __getitem__(self, name: str) -> NDArray[np.float64]:
        """A signal by its name.

        :raises SimulationError: with the nearest name, if there is none of this name.
        """
        if name not in self.units:
            raise SimulationError(f"the result of {self.title} has no signal {name!r}{suggestion(name, self.names)}")
        return self.values[self.names.index(name)]

    def to_csv(self, path: Path | str) -> None:
        """Write a file: names in its first line, units in the second after ``#``, then a line a communication point.

        Numbers are written so that the same doubles are read again, by :meth:`from_csv`,
        ``pandas.read_csv(path, comment="#")`` or ``numpy.genfromtxt(path, delimiter=",", names=True)``.  The file
        appears when it is complete.

        :raises SimulationError: if it cannot be written.
        """
        with _replacing(Path(path)) as part, part.open("w", encoding="utf-8", newline="") as file:
            writer = csv.writer(file, lineterminator="\n")
            writer.writerow(["time", *self.names])
            writer.writerow(["# s", *(self.units[name] for name in self.names)])
            writer.writerows(np.vstack([self.time, self.values]).T.tolist())

    @classmethod
    def from_csv(cls, path: Path | str) -> Result:
        """Read what :meth:`to_csv` has written.

        :raises SimulationError: if it cannot be read, or is not such a file.
        """
        try:
            with Path(path).open(encoding="utf-8", newline="") as file:
                (_, *names), (_, *units), *rows = csv.reader(file)
            values = np.array(rows, dtype=float).reshape(len(rows), 1 + len(names))
        except (OSError, ValueError, csv.Error) as error:
            raise SimulationError(f"{path}: not a result that to_csv has written: {error}") from None
        time, *signals = np.ascontiguousarray(values.T)
        units = dict(zip(names, units, strict=True))
        return cls(Path(path).stem, time, tuple(names), np.reshape(signals, (len(names), len(rows))), units)

    def plot(self, *names: str, path: Path | str | None = None) -> Figure:
        """Draw signals over time, those of one unit in one diagram.

        :param names: what to draw; everything if nothing is named.
        :param path: where to save the figure, its kind by the suffix; without it, ``matplotlib.pyplot.show`` shows it.
        :raises SimulationError: if a name is unknown or the file cannot be written.
        """
        groups: dict[str, list[str]] = {}
        signals = {name: self[name] for name in names or self.names}
        for name in signals:
            groups.setdefault(self.units[name], []).append(name)
        size = (7.0, 1.0 + 2.0 * max(1, len(groups)))
        if path is None:
            from matplotlib.pyplot import figure as new_figure
        else:  # a figure of its own: no window, and nothing to close
            from matplotlib.figure import Figure as new_figure  # noqa: N813
        figure = new_figure(figsize=size, layout="constrained")
        diagrams = figure.subplots(max(1, len(groups)), sharex=True, squeeze=False)[:, 0]
        for diagram, (unit, members) in zip(diagrams, groups.items(), strict=False):
            for name in members:
                diagram.plot(self.time, signals[name], label=name)
            label = f"[{unit}]" if unit else ""
            diagram.set_ylabel(f"{members[0]} {label}".strip() if len(members) == 1 else label)
            if len(members) > 1:
                diagram.legend()
        diagrams[0].set_title(self.title)
        diagrams[-1].set_xlabel("time [s]")
        if path is not None:
            path = Path(path)
            try:
                with _replacing(path) as part:
                    figure.savefig(part, format=path.suffix[1:] or "png")
            except ValueError as error:
                raise SimulationError(f"{path}: {error}") from None
        return figure

    def __repr__(self) -> str:
        shown = [f"{name} [{self.units[name]}]" if self.units[name] else name for name in self.names[:8]]
        rest = f", and {len(self.names) - 8} more" if len(self.names) > 8 else ""
        return (
            f"<Result of {self.title}: {len(self.time)} points, t = {self.time[0]:g} to {self.time[-1]:g} s, "
            f"{len(self.names)} signals: {', '.join(shown)}{rest}>"
        )


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


@contextmanager
def _replacing(path: Path) -> Iterator[Path]:
    """A file to write in place of another; takes its place at the end, if nothing went wrong."""
    part = path.with_name(f".{path.name}.{os.getpid()}.part")
    try:
        yield part
        part.replace(path)
    except OSError as error:
        raise SimulationError(f"{path}: cannot be written: {error.strerror}; choose another path") from None
    finally:
        with suppress(OSError):
            part.unlink(missing_ok=True)
