"""Reference results (FMI-LS-REF) of the default experiment, integrated from the functions of the model, not by the FMU.

Where nothing would happen in it, parameters and inputs have other values (:attr:`Experiment.reference`), in a parameter
set and a table of the inputs beside the results.

The solver is SciPy's DOP853 with tolerances near rounding.  Numbers are rounded to nine digits of the greatest of their
column, so that they are the same on all machines.
"""

from __future__ import annotations

import csv
import io
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from functools import lru_cache

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from liaisons.base.compiler import Fmi
from liaisons.base.reference_integration import integrate
from liaisons.base.related_files import FOLDER, MANIFEST, NAME, NAMESPACE, VERSION
from liaisons.errors import ComponentError, suggestion
from liaisons.fmu import Call, document, element, index_ranges, start_vectors
from liaisons.language import Variable
from liaisons.mechanics import Model

INTERVALS = 100
"""Number of intervals between rows."""

TOLERANCE = 1e-11
"""Relative tolerance; the absolute one is this much of the nominal size of each state."""

WORK = 250_000
"""Number of evaluations of the right-hand side, times states, at which the experiment is given up."""

WIDEST = 16
"""Size up to which an array is written."""

_DIGITS = 9
_BOOKED = ("work", "dissipated")
_SSP = "http://ssp-standard.org/SSP1/"
_CONTACTS = "contacts have no integration that is independent of the FMU"
_SAMPLES = "at a sample the outputs depend on whether inputs are set before they are read"
_GIVEN_UP = "it leads to a singularity, or there is too much to integrate while an FMU is built"
_ABOUT = (
    f"Results of the default experiment, integrated independently of the FMU by DOP853 with a relative tolerance of "
    f"{TOLERANCE:g}; nine digits of the greatest number of each column"
)


@dataclass(frozen=True, eq=False)
class Trajectory:
    """The default experiment: times (n,), all inputs (n, u), states (n, y) and outputs (n, z) of the model."""

    model: Model
    times: NDArray
    inputs: NDArray
    states: NDArray
    values: NDArray

    def __getitem__(self, name: str) -> NDArray:
        """Values of an output, shape (n, count)."""
        return self.values[:, index_ranges(self.model.outputs)[name]]


class _GivenUpError(Exception):
    """The experiment takes too long, or ends in a singularity."""


@lru_cache(maxsize=1)  # the FMUs of one component are built one after the other
def trajectory(model: Model) -> Trajectory | None:
    """Trajectory of the default experiment; None for contacts, samples, singularities, or too much work."""
    count = model.derivatives.numel_in(1)
    if model.contacts or model.sample or count * INTERVALS > WORK:
        return None
    model = _with_reference_starts(model)
    u, k = start_vectors(model)
    motion = _input_motion(model, u)
    y, m = (np.array(x, dtype=float).ravel() for x in model.start.call([ca.DM(0), u, k]))
    times = np.linspace(0, model.experiment.stop_time, INTERVALS + 1)
    states: list[NDArray] = []
    rows: list[NDArray] = []
    try:
        for t, state in zip(times, _integrate_states(model, times, y, motion, k), strict=True):
            u = motion(t)
            states.append(np.array(state))
            m = model.remember.call([t, state, u, k, m])[0]
            rows.append(np.array(model.outputs_function.call([t, state, u, k, m])[0]).ravel())
    except _GivenUpError:
        return None
    values = np.array(rows)
    inputs = np.array([motion(t).copy() for t in times])
    return Trajectory(model, times, inputs, np.array(states), values) if np.all(np.isfinite(values)) else None


def _with_reference_starts(model: Model) -> Model:
    """Model with the start values of ``Experiment(reference=...)``."""
    reference = model.experiment.reference
    scalars = [v.name for v in (*model.parameters, *model.inputs) if v.dimension is None]
    for name in reference:
        if name not in scalars:
            raise ComponentError(
                f"{model.name}: Experiment(reference=...): {name!r} is not a scalar parameter or input"
                f"{suggestion(name, scalars)}"
            )

    def started(variables: tuple[Variable, ...]) -> tuple[Variable, ...]:
        return tuple(replace(v, start=reference[v.name]) if v.name in reference else v for v in variables)

    return replace(model, parameters=started(model.parameters), inputs=started(model.inputs))


_Motion = Callable[[float], NDArray]
"""The inputs at a time, shape (u,); the same array each time."""


def _input_motion(model: Model, start: NDArray) -> _Motion:
    """Inputs as a function of time: prescribed coordinates of constant acceleration, other inputs constant.

    Such a motion is exact in an FMU for any communication step size.
    """
    inputs = index_ranges(model.inputs)
    rows = (
        row for a in model.active for row in zip(inputs[a.value], inputs[a.rate], inputs[a.acceleration], strict=True)
    )
    indices = np.array([row for row in rows if start[list(row[1:])].any()], dtype=int).reshape(-1, 3).T
    u, (value, rate, acceleration) = start.copy(), start[indices]

    def motion(t: float) -> NDArray:
        if indices.size:
            u[indices[0]] = value + rate * t + acceleration * t**2 / 2
            u[indices[1]] = rate + acceleration * t
        return u

    return motion


def _integrate_states(model: Model, times: NDArray, y: NDArray, motion: _Motion, k: NDArray) -> Iterator[NDArray]:
    """Yield the states at the times; the integration restarts at each event."""
    yield y
    if not y.size:
        yield from (y for _ in times[1:])
        return
    rate = _right_hand_side(model, motion, k)
    nominals = np.array(model.nominals.call([ca.DM(0), y, motion(0.0), k])[0]).ravel()
    t, tolerances = 0.0, {"rtol": TOLERANCE, "atol": TOLERANCE * nominals}
    while t < times[-1]:
        corner = min(model.next_event(k, t), float(times[-1]))
        instants = [*times[1:][(t <= times[1:]) & (times[1:] < corner)], corner]
        *between, y = integrate(model.name, rate, y, (t, corner), times=instants, **tolerances, error=_GivenUpError).T
        yield from between
        t = corner
    yield y


def _right_hand_side(model: Model, motion: _Motion, k: NDArray) -> Callable[[float, NDArray], NDArray]:
    """Function (t, y) → dy/dt, which raises _GivenUpError after too many calls."""
    state, result = np.zeros((2, model.derivatives.numel_out(0)))
    time = np.zeros(1)
    call = Call(model.derivatives, (time, state, motion(0.0), k), (result,))
    left = WORK // state.size

    def rate(t: float, y: NDArray) -> NDArray:
        nonlocal left
        left -= 1
        if left < 0:
            raise _GivenUpError
        time[0], state[:] = t, y
        motion(t)  # in place
        call.run()
        return result.copy()

    return rate


def extras(model: Model, fmi: Fmi) -> dict[str, bytes]:
    """Reference results of an FMU, by path in the archive."""
    return reference_members(model, trajectory(model), fmi)


def reference_members(model: Model, results: Trajectory | None, fmi: Fmi) -> dict[str, bytes]:
    """Files of fmi-ls-ref by path in the archive: manifest, and tables and parameters of the results.

    :param results: of this model; None where there are none.
    :param fmi: for FMI 3.0 a cell of the table holds all elements of an array.
    """
    members: dict[str, bytes] = {}
    related: list[dict[str, str]] = []

    def add(kind: str, file: str, role: str, description: str, content: bytes) -> None:
        members[f"{FOLDER}/{file}"] = content
        related.append({"type": kind, "source": file, "role": role, "description": description})

    if results is not None:
        reference = model.experiment.reference
        starts = {v.name: reference[v.name] for v in model.parameters if v.name in reference}
        inputs = _moving_inputs(model, results)
        if starts:
            about = "Parameters of the reference results; all others at their start values"
            add("application/x-ssp-parameter-set", f"{model.name}.ssv", "parameter", about, _parameter_set(starts))
        if inputs:
            table = _csv_table(results.times, inputs, fmi)
            add("text/csv", f"{model.name}_in.csv", "testcase", "Inputs of the reference results", table)
        shown = {v: _rounded(results[v.name]) for v in table_variables(model)}
        add("text/csv", f"{model.name}_out.csv", "result", _ABOUT, _csv_table(results.times, shown, fmi))
    why = _CONTACTS if model.contacts else _SAMPLES if model.sample else _GIVEN_UP
    return {MANIFEST: _manifest(related, why), **members}


def _moving_inputs(model: Model, results: Trajectory) -> dict[Variable, NDArray]:
    """Values of the inputs that leave their start values, shape (n, count) each."""
    indices = index_ranges(model.inputs)
    values = {variable: results.inputs[:, indices[variable.name]] for variable in model.inputs}
    return {variable: column for variable, column in values.items() if np.any(column != variable.starts)}


def _parameter_set(starts: Mapping[str, float]) -> bytes:
    """Start values as a parameter set of SSP."""
    attributes = {"xmlns:ssv": f"{_SSP}SystemStructureParameterValues", "version": "1.0", "name": "reference"}
    parameters = (
        line
        for name, value in starts.items()
        for line in element("ssv:Parameter", {"name": name}, element("ssv:Real", {"value": repr(float(value))}))
    )
    return document(element("ssv:ParameterSet", attributes, element("ssv:Parameters", {}, parameters)))


def table_variables(model: Model) -> list[Variable]:
    """Variables of the table of results: states, energy, operators' forces, signals; no long arrays."""
    states = [state.name for state in model.states if state.name not in _BOOKED]
    forces = [f"{active.value}_force" for active in model.active]
    signals = [member.variable for port in model.ports if port.kind == "signal" for member in port.members]
    names = [*states, "energy", *forces, *signals]
    narrow = {variable.name: variable for variable in model.outputs if variable.count <= WIDEST}
    return [narrow[name] for name in dict.fromkeys(names) if name in narrow]


def _csv_table(times: NDArray, shown: Mapping[Variable, NDArray], fmi: Fmi) -> bytes:
    """CSV file with times, shape (n,), and variables, shape (n, count)."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    heads = [[e.name for e in v.elements()] if fmi == "2" else [v.name] for v in shown]
    writer.writerow(["time", *(name for names in heads for name in names)])
    for i, t in enumerate(times):
        cells = [[f"{x:.{_DIGITS}g}" for x in column[i]] for column in shown.values()]
        row = [cell for group in cells for cell in (group if fmi == "2" else [" ".join(group)])]
        writer.writerow([f"{t:.{_DIGITS}g}", *row])
    return text.getvalue().encode()


def _rounded(column: NDArray) -> NDArray:
    """Columns rounded to nine digits of their greatest number; columns of rounding errors become 0."""
    greatest = np.max(np.abs(column), axis=0)
    with np.errstate(divide="ignore"):
        digits = np.where(greatest > TOLERANCE, _DIGITS - 1 - np.floor(np.log10(greatest)), 0)
    return np.array([[round(float(x), int(d)) + 0.0 for x, d in zip(row, digits, strict=True)] for row in column])


def _manifest(related: list[dict[str, str]], why: str) -> bytes:
    """Text of fmi-ls-manifest.xml."""
    attributes = {
        "xmlns:fmi-ls": NAMESPACE,
        "fmi-ls:fmi-ls-name": NAME,
        "fmi-ls:fmi-ls-version": VERSION,
        "fmi-ls:fmi-ls-description": "Layered Standard providing information on related files included in an FMU.",
    }
    page = {
        "type": "text/html",
        "source": "../../documentation/index.html",
        "role": "document",
        "description": "Description of the model with its equations",
    }
    label = [*element("Label", {"name": "default-experiment"})]
    lines = [line for attributes in related for line in element("Related", attributes, label)]
    nothing = [] if related else [f"<!-- No results of the default experiment: {why}. -->"]
    return document(element("fmiReferences", attributes, [*nothing, *lines, *element("Related", page)]))
