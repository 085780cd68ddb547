"""Reference results of the default experiment (FMI-LS-REF), integrated here from the functions of the model.

Nothing of the FMU takes part: SciPy's DOP853 with tolerances near rounding instead of the FMU's own solver.  The
numbers are rounded to nine digits of the greatest of their column, so that they are the same on all machines.
"""

from __future__ import annotations

import csv
import io
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Any, cast

import casadi as ca
import numpy as np
from numpy.typing import NDArray
from scipy.integrate import DOP853

from liaisons.fmu.layout import Fmi
from liaisons.fmu.markup import document, element
from liaisons.fmu.python_runtime.calls import Call
from liaisons.mechanics.model import Model, Variable

FOLDER = "extra/org.fmi-standard.fmi-ls-ref"
INTERVALS = 100
"""Intervals between rows."""

TOLERANCE = 1e-11
"""Relative tolerance; the absolute one is this much of the nominal size of each state."""

WORK = 250_000
"""Evaluations of the right-hand side, times states, at which the experiment is given up."""

WIDEST = 16
"""Numbers of an array up to which it is written."""

_DIGITS = 9
_BOOKED = ("work", "dissipated")
_GIVEN_UP = "it leads to a singularity, or there is too much to integrate while an FMU is built"
_ABOUT = """\
{name}_out.csv: results of the default experiment, every {interval:g} s, inputs and parameters at their start values.
Integrated by DOP853 with a relative tolerance of {tolerance:g} from the functions that the FMU was generated from, not
by the FMU; nine digits of the greatest number of a column.  With its default tolerance the FMU agrees to 1e-7 of that
number.
"""


@dataclass(frozen=True, eq=False)
class Trajectory:
    """The default experiment: times (n,) and all outputs of the model (n, z)."""

    model: Model
    times: NDArray
    values: NDArray

    @cached_property
    def _places(self) -> dict[str, slice]:
        ends = np.cumsum([variable.count for variable in self.model.outputs])
        return {v.name: slice(end - v.count, end) for v, end in zip(self.model.outputs, ends.tolist(), strict=True)}

    def __contains__(self, name: str) -> bool:
        return name in self._places

    def __getitem__(self, name: str) -> NDArray:
        """An output, shape (n, count)."""
        return self.values[:, self._places[name]]


class _GivenUpError(Exception):
    """The experiment is too much, or ends in a singularity."""


@lru_cache(maxsize=1)  # the FMUs of one component are built one after the other
def trajectory(model: Model) -> Trajectory | None:
    """Integrate the default experiment; None where it leads to a singularity or takes too long."""
    count = model.derivatives.numel_in(1)
    if count * INTERVALS > WORK:
        return None
    u, k = (np.concatenate([*(v.starts for v in vs), []]) for vs in (model.inputs, model.parameters))
    y, m = (np.array(x, dtype=float).ravel() for x in model.start.call([ca.DM(0), u, k]))
    times = np.linspace(0, model.experiment.stop_time, INTERVALS + 1)
    rows: list[NDArray] = []
    try:
        for t, state in zip(times, _states(model, times, y, u, k), strict=True):
            m = model.remember.call([t, state, u, k, m])[0]
            rows.append(np.array(model.outputs_function.call([t, state, u, k, m])[0]).ravel())
    except _GivenUpError:
        return None
    values = np.array(rows)
    return Trajectory(model, times, values) if np.all(np.isfinite(values)) else None


def _states(model: Model, times: NDArray, y: NDArray, u: NDArray, k: NDArray) -> Iterator[NDArray]:
    """States at the times; the integration starts anew at each event."""
    yield y
    if not y.size:
        yield from (y for _ in times[1:])
        return
    rate = _rate(model, u, k)
    nominals = np.array(model.nominals.call([ca.DM(0), y, u, k])[0]).ravel()
    events = np.array(model.events.call([k])[0]).ravel()
    corners = [*sorted(float(t) for t in events if 0 < t < times[-1]), float(times[-1])]
    t, waiting = 0.0, list(times[1:])
    for corner in corners:
        solver = DOP853(rate, t, y, corner, rtol=TOLERANCE, atol=cast(Any, TOLERANCE * nominals))
        while solver.status == "running":
            solver.step()
            if solver.status == "failed":
                raise _GivenUpError
            between = solver.dense_output() if waiting and waiting[0] < solver.t else None
            while between is not None and waiting and waiting[0] < solver.t:
                yield between(waiting.pop(0))
        t, y = corner, solver.y
    yield y


def _rate(model: Model, u: NDArray, k: NDArray) -> Callable[[float, NDArray], NDArray]:
    """The right-hand side, called in place: by far the most of the work is here."""
    time, state, result = (
        np.zeros(size) for size in (1, model.derivatives.numel_in(1), model.derivatives.numel_out(0))
    )
    call = Call(model.derivatives, (time, state, u, k), (result,))
    left = WORK // state.size

    def rate(t: float, y: NDArray) -> NDArray:
        nonlocal left
        left -= 1
        if left < 0:
            raise _GivenUpError
        time[0], state[:] = t, y
        call.run()
        return result.copy()

    return rate


def reference_members(model: Model, results: Trajectory | None, fmi: Fmi) -> dict[str, bytes]:
    """The manifest and, unless there are no results, the table; by path in the archive.

    :param results: of this model; None where there are none.
    :param fmi: for FMI 3.0 a cell of the table holds all elements of an array.
    """
    members = {f"{FOLDER}/fmi-ls-manifest.xml": _manifest(model, results is not None)}
    if results is not None:
        members[f"{FOLDER}/{model.name}_out.csv"] = _table(results, fmi)
        interval = model.experiment.stop_time / INTERVALS
        about = _ABOUT.format(name=model.name, interval=interval, tolerance=TOLERANCE)
        members["documentation/fmi-ls-ref.txt"] = about.encode()
    return members


def columns(model: Model) -> list[Variable]:
    """What the table shows: the states, energy, a signal; no long arrays."""
    states = [state.name for state in model.states if state.name not in _BOOKED]
    signals = [member.variable for port in model.ports if port.kind == "signal" for member in port.members]
    names = [*states, "energy", *signals]
    known = {variable.name: variable for variable in model.outputs}
    return [known[name] for name in dict.fromkeys(names) if name in known and known[name].count <= WIDEST]


def _table(results: Trajectory, fmi: Fmi) -> bytes:
    shown = columns(results.model)
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    heads = [[e.name for e in v.elements()] if fmi == "2" else [v.name] for v in shown]
    writer.writerow(["time", *(name for names in heads for name in names)])
    rounded = [_rounded(results[variable.name]) for variable in shown]
    for i, t in enumerate(results.times):
        cells = [[f"{x:.{_DIGITS}g}" for x in column[i]] for column in rounded]
        row = [cell for group in cells for cell in (group if fmi == "2" else [" ".join(group)])]
        writer.writerow([f"{t:.{_DIGITS}g}", *row])
    return text.getvalue().encode()


def _rounded(column: NDArray) -> NDArray:
    """To nine digits of the greatest number of each column; what is nothing but rounding errors is 0."""
    greatest = np.max(np.abs(column), axis=0)
    with np.errstate(divide="ignore"):
        digits = np.where(greatest > TOLERANCE, _DIGITS - 1 - np.floor(np.log10(greatest)), 0)
    rounded = [[round(float(x), int(d)) + 0.0 for x, d in zip(row, digits, strict=True)] for row in column]
    return np.array(rounded)


def _manifest(model: Model, known: bool) -> bytes:
    attributes = {
        "xmlns:fmi-ls": "http://fmi-standard.org/fmi-ls-manifest",
        "fmi-ls:fmi-ls-name": "org.fmi-standard.fmi-ls-ref",
        "fmi-ls:fmi-ls-version": "1.0.0-alpha.1",
        "fmi-ls:fmi-ls-description": "Layered Standard providing information on related files included in an FMU.",
    }
    page = {
        "type": "text/html",
        "source": "../../documentation/index.html",
        "role": "document",
        "description": "Description of the model with its equations",
    }
    table = {
        "type": "text/csv",
        "source": f"{model.name}_out.csv",
        "role": "result",
        "description": "Results of the default experiment, integrated independently of the FMU",
    }
    results = element("Related", table) if known else [f"<!-- No results of the default experiment: {_GIVEN_UP}. -->"]
    return document(element("fmiReferences", attributes, [*results, *element("Related", page)]))
