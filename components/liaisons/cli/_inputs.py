"""Motions and forces that a command prescribes: expressions of time, and tables with a column an input."""

from __future__ import annotations

import csv
import math
from bisect import bisect_right
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING

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
    system: System, given: Iterable[str], start_time: float, stop_time: float, *, single: bool
) -> dict[str, Function]:
    """Functions of time by the names of inputs; that of an active coordinate returns its rates as well.

    :param given: ``NAME=EXPRESSION``, or the name of a file with a column of times and one an input.
    :param start_time: begin of the simulation [s], and
    :param stop_time: its end; tables have to reach from one to the other.
    :param single: the system is one FMU, whose inputs go by their own names.
    :raises LiaisonsError: if one of them cannot be understood or read, or there is no such input.
    """
    found: dict[str, Function] = {}
    for text in given:
        name, equals, right = text.partition("=")
        if Path(text).is_file() or not equals:
            times, columns = read_table(Path(text))
            _check_reach(text, times, start_time, stop_time)
            new = _of_table(times, columns, {column: _driven(system, column, single=single) for column in columns})
        else:
            new = {name.strip(): _of_expression(name.strip(), right, lambda name: _driven(system, name, single=single))}
        for name in new:
            if name in found:
                raise SimulationError(f"--input: {name} is given twice; leave one out")
        found |= new
    return found


def _of_expression(name: str, text: str, driven: Callable[[str], Port]) -> Function:
    if Path(text).suffix.lower() == ".csv":
        raise SimulationError(f"--input {text!r}: a table has its names above its columns: write --input {text}")
    from liaisons.cli._expressions import FormulaError, expression  # loads CasADi

    try:
        function = expression(text)
    except FormulaError as error:
        raise FormulaError(f"--input {name}: {error}") from None
    return function if driven(name).triple() else _value_of(function)


def _driven(system: System, name: str, *, single: bool) -> Port:
    """The input of this name.

    :raises SimulationError: with the nearest name, if there is none.
    """
    owner, _, variable = (next(iter(system.parts)), "", name) if single else name.partition(".")
    if owner not in system.parts:
        words = suggestion(owner, system.parts)
        raise SimulationError(f"--input: {system.name} has no component {owner!r}{words}; write COMPONENT.NAME")
    part = system.parts[owner]
    inputs = part.fmu.reals("input", longest=1000)
    if variable not in part.fmu.variables:
        raise SimulationError(f"--input: {part.fmu.path.name} has no input {variable!r}{suggestion(variable, inputs)}")
    causality = part.fmu.variables[variable].causality
    if causality != "input":
        words = "; set it with --set" if "arameter" in causality else suggestion(variable, inputs)
        port = f"{owner}.{variable}"
        raise SimulationError(f"--input: {port} is of causality {causality!r}, so it cannot be driven{words}")
    return part[variable]


def _check_reach(file: str, times: NDArray[np.float64], start_time: float, stop_time: float) -> None:
    allowed = _ROUNDING * (times[-1] - times[0])
    if times[0] > start_time + allowed or times[-1] < stop_time - allowed:
        raise SimulationError(
            f"{file}: from {times[0]:g} to {times[-1]:g} s, but the simulation goes from {start_time:g} to "
            f"{stop_time:g} s; give the rest, or --start and --stop"
        )


def _of_table(
    times: NDArray[np.float64], columns: Mapping[str, NDArray[np.float64]], ports: Mapping[str, Port]
) -> dict[str, Function]:
    """A curve for each column; that of an active coordinate takes the columns of its rates."""
    curves: dict[str, Function] = {}
    rates: set[str] = set()
    for name, port in ports.items():
        if triple := port.triple():
            beside = [f"{name.removesuffix(port.name)}{rate.name}" for rate in triple[1:]]
            curves[name] = curve(times, columns[name], *map(columns.get, beside))
            rates.update(beside)
    return curves | {name: _value_of(curve(times, columns[name])) for name in ports.keys() - curves.keys() - rates}


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
    from scipy.interpolate import make_interp_spline  # slow to load

    def derivative(column: NDArray[np.float64], order: int) -> NDArray[np.float64]:
        return make_interp_spline(times, column, k=min(5, len(times) - 1))(times, order)

    if accelerations is None:
        accelerations = derivative(values, 2) if rates is None else derivative(rates, 1)
    if rates is None:
        rates = derivative(values, 1)
    steps = np.diff(times)
    pieces = _hermite(steps, values, rates, accelerations).T.tolist()
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


def _hermite(steps: NDArray, values: NDArray, rates: NDArray, accelerations: NDArray) -> NDArray[np.float64]:
    """Coefficients of the quintics in the part of a step that has passed, shape (6, n - 1)."""
    v, a = rates[:-1] * steps, accelerations[:-1] * steps**2
    # What the parabola from the begin of a step lacks at its end: of the value, the rate, the acceleration.
    lacks = [np.diff(values) - v - a / 2, rates[1:] * steps - v - a, accelerations[1:] * steps**2 - a]
    return np.array([values[:-1], v, a / 2, *np.array([[10, -4, 0.5], [-15, 7, -1], [6, -3, 0.5]]) @ lacks])
