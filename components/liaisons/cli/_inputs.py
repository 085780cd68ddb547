"""Motions and forces that a command prescribes: expressions of time, and tables with a column an input."""

from __future__ import annotations

import csv
import math
from bisect import bisect_right
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from liaisons.errors import SimulationError, suggestion

if TYPE_CHECKING:
    from liaisons.cosim import System
    from liaisons.cosim.drives import Function
    from liaisons.cosim.parts import Port

Triple = tuple[float, float, float]
"""Value, rate, acceleration."""

_TIMES = ("time", "t")
_ROUNDING = 1e-9  # of the span of a table: so far it may miss the begin or the end


def drives(
    system: System, given: Iterable[str], *, prefix: str, start_time: float, stop_time: float
) -> dict[str, Function]:
    """Functions of time for inputs of a system, by ``"component.variable"``.

    The function of an active coordinate returns its rates as well.

    :param given: ``NAME=EXPRESSION``, or the name of a file with a column of times and one an input.
    :param prefix: stands before each name: ``"component."`` where a system is one FMU.
    :param start_time: begin of the simulation [s], and
    :param stop_time: its end; tables have to reach from one to the other.
    :raises LiaisonsError: if one of them cannot be understood or read, or there is no such input.
    """
    found: dict[str, Function] = {}
    for text in given:
        name, equals, right = text.partition("=")
        if Path(text).is_file() or not equals:
            new = _of_table(system, Path(text), prefix, start_time, stop_time)
        else:
            new = {f"{prefix}{name.strip()}": _of_expression(system, prefix, name.strip(), right)}
        for full in new:
            if full in found:
                raise SimulationError(f"--input: {full.removeprefix(prefix)} is given twice; leave one out")
        found |= new
    return found


def _of_expression(system: System, prefix: str, name: str, text: str) -> Function:
    if Path(text).suffix.lower() == ".csv":
        raise SimulationError(f"--input {text!r}: a table has its names above its columns: write --input {text}")
    from liaisons.cli._expressions import ExpressionError, expression  # loads CasADi

    try:
        function = expression(text)
    except ExpressionError as error:
        raise ExpressionError(f"--input {name}: {error}") from None
    return function if _driven(system, f"{prefix}{name}").triple() else _value_of(function)


def _driven(system: System, full: str) -> Port:
    """The input of this name.

    :raises SimulationError: with the nearest name, if there is none.
    """
    owner, _, name = full.partition(".")
    if owner not in system.parts:
        words = suggestion(owner, system.parts)
        raise SimulationError(f"--input: {system.name} has no component {owner!r}{words}; write COMPONENT.NAME")
    component = system.parts[owner]
    inputs = component.fmu.reals("input", longest=1000)
    if name not in component.fmu.variables:
        raise SimulationError(f"--input: {component.fmu.path.name} has no input {name!r}{suggestion(name, inputs)}")
    causality = component.fmu.variables[name].causality
    if causality != "input":
        words = "; set it with --set" if "arameter" in causality else suggestion(name, inputs)
        raise SimulationError(f"--input: {full} is of causality {causality!r}, so it cannot be driven{words}")
    return component[name]


def _of_table(system: System, path: Path, prefix: str, start_time: float, stop_time: float) -> dict[str, Function]:
    times, columns = read_table(path)
    allowed = _ROUNDING * (times[-1] - times[0])
    if times[0] > start_time + allowed or times[-1] < stop_time - allowed:
        raise SimulationError(
            f"{path}: from {times[0]:g} to {times[-1]:g} s, but the simulation goes from {start_time:g} to "
            f"{stop_time:g} s; give the rest, or --start and --stop"
        )
    ends = {name: _driven(system, f"{prefix}{name}") for name in columns}
    curves: dict[str, Function] = {}
    rates: set[str] = set()
    for name, end in ends.items():
        if port := end.triple():
            beside = [f"{name.removesuffix(end.name)}{other.name}" for other in port[1:]]
            curves[name] = curve(times, columns[name], *map(columns.get, beside))
            rates.update(beside)
    curves |= {name: _value_of(curve(times, columns[name])) for name in ends.keys() - curves.keys() - rates}
    return {f"{prefix}{name}": function for name, function in curves.items()}


def _value_of(function: Callable[[float], Triple]) -> Callable[[float], float]:
    return lambda t: function(t)[0]


def read_table(path: Path) -> tuple[NDArray[np.float64], dict[str, NDArray[np.float64]]]:
    """Times and columns of a CSV file: names in its first line, one of them ``time`` or ``t``, numbers below.

    Lines that begin with ``#`` are left out.

    :raises SimulationError: if it cannot be read, or is no such file; names the line.
    """
    try:
        with path.open(encoding="utf-8-sig", newline="") as file:
            first = file.readline()
            separator = next((sign for sign in (",", ";", "\t") if sign in first), ",")
            names = [name.strip() for name in next(csv.reader([first], delimiter=separator), [])]
            lines = list(enumerate(csv.reader(file, delimiter=separator), start=2))
    except OSError as error:
        raise SimulationError(f"{path}: cannot be read: {error.strerror}") from None
    except (UnicodeDecodeError, csv.Error) as error:
        raise SimulationError(f"{path}: no table of numbers: {error}") from None
    time = next((name for name in _TIMES if name in names), "")
    if not time or len(set(names)) < len(names) or len(names) < 2:
        raise SimulationError(
            f"{path}: its first line has to name columns, each once, one of them 'time' or 't' and the others inputs; "
            f"it has {', '.join(map(repr, names)) or 'nothing'}"
        )
    rows: list[dict[str, float]] = []
    for number, row in lines:
        if row and not row[0].lstrip().startswith("#"):
            try:
                rows.append(_numbers(row, names))
                if len(rows) > 1 and rows[-1][time] <= rows[-2][time]:
                    here, before = rows[-1][time], rows[-2][time]
                    raise ValueError(f"{time} = {here:g} must be greater than {before:g}, the one before")
            except ValueError as error:
                raise SimulationError(f"{path}, line {number}: {error}") from None
    if len(rows) < 2:
        raise SimulationError(f"{path}: {len(rows)} lines of numbers; give two at least")
    columns = {name: np.array([row[name] for row in rows]) for name in names}
    return columns.pop(time), columns


def _numbers(row: list[str], names: list[str]) -> dict[str, float]:
    if len(row) != len(names):
        raise ValueError(f"{len(row)} numbers for {len(names)} columns")
    numbers = dict(zip(names, map(float, row), strict=True))
    if not all(map(math.isfinite, numbers.values())):
        raise ValueError(f"{', '.join(row)}: finite numbers only")
    return numbers


def curve(
    times: NDArray[np.float64],
    values: NDArray[np.float64],
    rates: NDArray[np.float64] | None = None,
    accelerations: NDArray[np.float64] | None = None,
) -> Callable[[float], Triple]:
    """A smooth function of time through a table, with its two derivatives: a quintic between any two times.

    What is not given of rates and accelerations at the times is that of the quintic spline through what is.

    :param times: [s], increasing, shape (n,), n >= 2.
    """
    v = _spline(times, values)(times, 1) if rates is None else rates
    if accelerations is not None:
        a = accelerations
    else:
        a = _spline(times, values)(times, 2) if rates is None else _spline(times, rates)(times, 1)
    steps = np.diff(times)
    pieces = _hermite(steps, values, v, a).T.tolist()
    begins, sizes, last = times.tolist(), steps.tolist(), len(steps) - 1

    def function(t: float) -> Triple:
        place = min(max(bisect_right(begins, t) - 1, 0), last)
        p, q, r, s, u, w = pieces[place]
        h = sizes[place]
        x = (t - begins[place]) / h
        return (
            p + x * (q + x * (r + x * (s + x * (u + x * w)))),
            (q + x * (2 * r + x * (3 * s + x * (4 * u + x * 5 * w)))) / h,
            (2 * r + x * (6 * s + x * (12 * u + x * 20 * w))) / h**2,
        )

    return function


def _spline(times: NDArray[np.float64], values: NDArray[np.float64]) -> Any:
    from scipy.interpolate import make_interp_spline  # slow to load

    return make_interp_spline(times, values, k=min(5, len(times) - 1))


def _hermite(steps: NDArray, values: NDArray, rates: NDArray, accelerations: NDArray) -> NDArray[np.float64]:
    """Coefficients of the quintics in the part of a step that has passed, shape (6, n - 1)."""
    v, a = rates[:-1] * steps, accelerations[:-1] * steps**2
    # What the parabola from the begin of a step lacks at its end: of the value, the rate, the acceleration.
    lacks = [np.diff(values) - v - a / 2, rates[1:] * steps - v - a, accelerations[1:] * steps**2 - a]
    return np.array([values[:-1], v, a / 2, *np.array([[10, -4, 0.5], [-15, 7, -1], [6, -3, 0.5]]) @ lacks])
