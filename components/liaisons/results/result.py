"""The results of simulations, sweeps and ensembles."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, final

from numpy.typing import ArrayLike

import liaisons
from liaisons.base.arguments import as_path, name_list
from liaisons.errors import SimulationError
from liaisons.results.signals import LabelledSignals

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


@final
@dataclass(frozen=True, eq=False, repr=False)
class Result(LabelledSignals):
    """Signals of a simulation, a sweep or an ensemble by name, read-only.

    ``result["swing.theta"]`` has the shape (times,) in a simulation, (cases,) in a sweep, (times, cases) in an
    ensemble; :attr:`kind` says which.  If ``chain.theta[1]`` to ``chain.theta[10]`` were recorded,
    ``result["chain.theta"]`` has all of them, with one more axis of 10.  As in a dictionary, ``in``, ``len``,
    ``get()``, ``keys()`` and iteration go by names, an array under its own: ``dict(result)`` has all signals.

    :param title: what was simulated.
    :param time: communication points, or recorded times [s], shape (times,); of a sweep, with one number per case,
        empty.
    :param names: names of the signals, those of elements one by one; of a sweep, what was varied, then what was kept.
    :param values: shape (len(names), times), (len(names), cases) or (len(names), times, cases).
    :param units: name -> unit, of whole arrays too; empty where there is none.
    :param failures: number of a case, from 0 -> why it has failed; its values are not-a-number from the failure on.
    :param unfinished: cases that the machine, not the model, has not finished: the same sweep with its journal repeats
        them.
    :param errors: of an ensemble, estimate of the largest error of each signal over the times, shape (len(names),
        cases), from runs with steps twice and four times as long; infinite where these runs do not converge.  Of a
        simulation that was verified, differences from a run with steps half as long, shape (len(names), times).
    :param coupling_error: of a simulation, estimate of the error that coupling and impacts add in each step, relative
        to the largest value of the signal's unit in the run, the largest of all signals, shape (times,); not-a-number
        where it is unknown, for instance where an impulse is lost.  Their sum is the error of the run.
    :param compiled: of an ensemble, whether compiled code simulated it, or NumPy.
    :param texts: name of a signal of strings -> its texts, which its values index from 0.
    :param jumping: names of signals that change in jumps only.
    :param ports: value -> names of its port, if an FMU names them differently from ours; none from a file.
    :param scene: picture of what was simulated; None after reading from a file, a sweep or an ensemble.
    :param warnings: warnings of the simulation, each text once, whatever the logger's level; of a sweep, a hundred at
        most, with the number of the case.
    """

    def to_csv(self, path: Path | str, *, plain: bool = False) -> None:
        """Write a CSV file: names in its first line, units in the second after ``#``, then one line per point or case.

        Between them, ``# title: ...`` and a line ``# warning: ...`` each; error estimates are columns behind the
        signals.  Numbers are written so that the same doubles are read again, by :meth:`from_csv`,
        ``pandas.read_csv(path, comment="#")`` or ``numpy.genfromtxt(path, delimiter=",", names=True)``.  If there are
        cases, the last column, ``failure``, gives the reason of each failure.  The file appears when it is complete.

        :param plain: leaves out units and notes, which FMPy's ``--input-file`` cannot read.
        :raises SimulationError: if it cannot be written.
        """
        from liaisons.results import tables

        tables.write_csv(self, as_path("to_csv", path), plain=plain)

    @classmethod
    def from_csv(cls, path: Path | str) -> Result:
        """Read a CSV file that :meth:`to_csv` has written, or another table with names above, the time first.

        :raises SimulationError: if it cannot be read, or is not such a file.
        """
        from liaisons.results import tables

        return cls(**tables.read(as_path("from_csv", path), "to_csv"))

    def to_parquet(self, path: Path | str) -> None:
        """Write a Parquet file with the columns of :meth:`to_csv`, and units, title and warnings as metadata.

        Needs PyArrow (``pip install 'liaisons[parquet]'``); pandas, polars and DuckDB read it.  The file appears when
        it is complete.

        :raises SimulationError: if it cannot be written, or PyArrow is missing.
        """
        from liaisons.results import tables

        tables.write_parquet(self, as_path("to_parquet", path))

    @classmethod
    def from_parquet(cls, path: Path | str) -> Result:
        """Read a Parquet file that :meth:`to_parquet` has written, or another one of numbers, the time first.

        :raises SimulationError: if it cannot be read, or PyArrow is missing.
        """
        from liaisons.results import tables

        return cls(**tables.read(as_path("from_parquet", path), "to_parquet"))

    def to_pandas(self) -> Any:
        """Make a ``pandas.DataFrame`` with a column for each signal, over time, cases or both; units in ``attrs``.

        :raises SimulationError: if pandas is missing (``pip install 'liaisons[pandas]'``).
        """
        from liaisons.results import tables

        return tables.data_frame(self)

    def to_xarray(self) -> Any:
        """Make an ``xarray.Dataset`` with a variable for each signal or array, over ``time``, ``case`` or both.

        The axes of arrays are called by place and length, ``i_10``, so that those of one length go together.  Units are
        attributes; what has failed is the coordinate ``failure`` of the cases.

        :raises SimulationError: if xarray is missing (``pip install 'liaisons[xarray]'``).
        """
        from liaisons.results import tables

        return tables.dataset(self)

    def plot(
        self,
        *names: str | Iterable[str],
        over: str | None = None,
        axes: Axes | None = None,
        path: Path | str | None = None,
        labels: Mapping[str, str] | None = None,
        title: str | None = None,
        width: float | None = None,
    ) -> Figure:
        """Draw signals, those of one unit in one diagram.

        A sweep on a grid of two values is drawn as a map of each signal: the first value to the right, the second one
        up, the signal as a colour; what has failed stays blank.

        :param names: names of the signals, one by one or in a list; without names, those that
            :func:`liaisons.pictures.default_names` chooses, or the first six maps.
        :param over: signal on the horizontal axis, for phase portraits; else time, or of a sweep what was varied, if it
            is one ascending value, else the number of the case.
        :param axes: Matplotlib's axes to draw into, signals of one unit or one map, beside what is there already; else
            a new figure.
        :param path: where to save the figure, its kind by the suffix; without it, a notebook shows what is returned,
            and elsewhere ``matplotlib.pyplot.show`` shows it.  ``.pdf`` and ``.svg`` are drawn as lines.
        :param labels: labels by name, ``{"theta": "θ", "time": "t"}``; for a signal that is alone in its diagram, the
            label is at the axis instead of in a legend.
        :param title: of the figure; "" for none.
        :param width: of the figure [m], 0.085 for one column of a paper: letters of 8 pt, legends inside.
        :raises SimulationError: if a name is unknown, the width is not positive, the signals need more than the axes,
            or the file cannot be written.
        """
        chosen = [name for group in names for name in name_list("plot", group)]
        file = None if path is None else as_path("plot: path", path)
        return liaisons.pictures.plot(self, chosen, over, file, axes, labels=labels, title=title, width=width)

    def animate(
        self,
        path: Path | str,
        *,
        speed: float | None = None,
        against: Mapping[str, ArrayLike] | None = None,
        turns: float = 0.0,
    ) -> float:
        """Write the motion to a file: a film, a page or a 3D file; returns its speed.

        :param path: ends in ``.gif``, ``.png`` (a strip of instants), ``.mp4`` (needs the extra ``film``), ``.glb``
            (glTF, for Blender, slides and model viewers), ``.html`` (one file, to be dragged and zoomed) or
            ``NAME_visual.xml`` (for OMEdit, which opens the table ``NAME_res.csv`` that is written beside it).
        :param speed: seconds of motion per second; real time unless that takes longer than 20 s.
        :param against: signals that a ghost of the mechanism follows, e.g. ``Pendulum.exact(result.time)``; drawn in
            gif, png and mp4 only.
        :param turns: number of turns of the camera about a spatial mechanism.
        :returns: the speed.
        :raises SimulationError: for another ending, a ghost where none is drawn, a missing extra, a result without a
            picture, or numbers that are not finite.
        """
        if self.scene is None:
            raise SimulationError(f"the result of {self.title} has no picture; animate that of simulate() or System")
        signals = dict(zip(self.names, self.values, strict=True))
        settings: dict[str, Any] = {"title": self.title, "speed": speed, "against": against, "turns": turns}
        return liaisons.pictures.animate(as_path("path", path), self.scene, self.time, signals, **settings)

    def summary(self, most: int | None = None, *, few: int = 10) -> list[dict[str, str]]:
        """Rows of a table of the signals: start, end and extrema; of a sweep, its cases.

        :param most: largest number of rows; None: all.
        :param few: arrays of more elements have one row.
        """
        from liaisons.results import tables

        return tables.summary(self, most, few)

    def _repr_html_(self) -> str:
        """HTML by which notebooks show the result."""
        return liaisons.pictures.result_html(self)
