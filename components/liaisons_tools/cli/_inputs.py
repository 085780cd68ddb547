"""Motions and forces that a command prescribes: expressions of time, and tables with a column an input."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from os.path import isfile
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from liaisons import Signal, tabulated
from liaisons.base.arrays import Floats
from liaisons.base.knots import Join, complete_rows, knots, piecewise_polynomial
from liaisons.base.logs import logger
from liaisons.base.tables import Table, is_estimate, read_table
from liaisons.errors import FormulaError, LiaisonsError, SimulationError, suggestion

if TYPE_CHECKING:
    from liaisons import System
    from liaisons.cosim import OperatorFmu, Port

Triple = tuple[float, float, float]
"""Value, rate, acceleration."""

_MOST_KNOTS, _KNOT_ERROR = 2000, 1e-9  # of a function that is tabulated; relative, between the knots
_ROUNDING = 1e-9  # of the span of a table: by so much it may miss start or stop


@dataclass(frozen=True)
class PrescribedInputs:
    """Values that --input prescribes: functions of time by the names of inputs, and operators by owner and port."""

    functions: dict[str, Signal] = field(default_factory=dict)
    operators: dict[str, dict[str, OperatorFmu]] = field(default_factory=dict)


def prescribed_inputs(
    system: System,
    inputs: Iterable[str],
    start_time: float,
    stop_time: float,
    *,
    single: bool,
    join: Join,
    smoothing: float | None = None,
) -> PrescribedInputs:
    """Functions of time and operators that ``--input`` prescribes.

    :param inputs: ``NAME=EXPRESSION``, or the name of a file with a column of times and one an input.
    :param start_time: start of the simulation [s].
    :param stop_time: its stop [s]; tables have to reach from one to the other.
    :param single: the system is one FMU, whose inputs have no prefix.
    :param join: of the rows of tables without rates.
    :param smoothing: distance of the knots of splines that fit such rows [s]; None: curves pass through them.
    :raises LiaisonsError: if an expression cannot be parsed, a file not read, or there is no such input.
    """
    prescribed, names = PrescribedInputs(), set[str]()
    for text in inputs:
        name, equals, right = text.partition("=")
        if isfile(text) or not equals:  # noqa: PTH113 - no error for a formula that is longer than a path can be
            table, ports = _input_table(system, Path(text), single=single)
            times, columns = _checked_columns(table, ports)
            _check_table_span(text, times, start_time, stop_time)
            try:
                new = _prescribe_table(prescribed, times, columns, ports, join=join, smoothing=smoothing)
            except LiaisonsError as error:
                raise SimulationError(f"{text}: {error}") from None
        else:
            new = {name.strip()}
            prescribed.functions[name.strip()] = _input_function(
                name.strip(), right, lambda name: input_port(system, name, single=single), (start_time, stop_time)
            )
        for name in new & names:
            raise SimulationError(f"--input: {name} is given twice; leave one out")
        names |= new
    return prescribed


def span_of_tables(inputs: Iterable[str]) -> tuple[float, float] | None:
    """Instants [s] at which the last table of ``--input`` begins and the first one ends; None without a table."""
    tables = [read_table(Path(text), SimulationError).named({}) for text in inputs if isfile(text)]  # noqa: PTH113
    times = [table.times() for table in tables if table.clock and table.rows]
    return (max(t[0] for t in times), min(t[-1] for t in times)) if times else None


def tabulated_inputs(functions: Mapping[str, Signal], start: float, stop: float) -> dict[str, OperatorFmu] | None:
    """Operators that follow functions of time by knots; None if one jumps, or is of no prescribed coordinate.

    :param functions: by the names of inputs.
    :param start: first instant [s], ``stop`` the last one.
    """
    operators: dict[str, OperatorFmu] = {}
    for name, signal in functions.items():
        if signal.breaks or np.size(signal(start)) < 3:
            return None
        count = 33
        while True:
            fine = np.linspace(start, stop, 2 * count - 1)  # knots, and what lies between them
            rows = np.array([signal(float(t)) for t in fine])
            table = np.column_stack([fine, rows])[::2].T
            missed = np.max(np.abs(piecewise_polynomial(table)(fine) - rows[:, 0]))
            if missed <= _KNOT_ERROR * np.ptp(rows[:, 0]) or count > _MOST_KNOTS:
                break
            count = 2 * count - 1
        operators[name] = tabulated(*table)
    return operators


def _input_function(name: str, text: str, port_of: Callable[[str], Port], span: tuple[float, float]) -> Signal:
    """Function of time that a formula prescribes for an input, with the instants of its pulses."""
    if Path(text).suffix.lower() == ".csv":
        raise SimulationError(f"--input {text!r}: a table has its names above its columns: write --input {text}")
    from liaisons import formula_signal  # loads CasADi

    try:
        signal = formula_signal(text, *span)
    except FormulaError as error:
        raise FormulaError(f"--input {name}: {error}") from None
    triple: Any = signal.function
    return signal if port_of(name).triple() else Signal(lambda t: triple(t)[0], signal.breaks)


def input_port(system: System, name: str, *, single: bool) -> Port:
    """Port of an input.

    :raises SimulationError: with the nearest name, if there is no such input.
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


def _input_table(system: System, path: Path, *, single: bool) -> tuple[Table, dict[str, Port]]:
    """Table in a file, and the ports of those of its columns that are inputs.

    Estimates of errors, and what an FMU gives by itself, are left out; this is said.

    :raises SimulationError: for a file without a clock, or without inputs, and for unknown names.
    """
    causalities = {
        name if single else f"{owner}.{name}": variable.causality
        for owner, part in system.parts.items()
        for name, variable in part.fmu.variables.items()
    }
    table = read_table(path, SimulationError).named(causalities)
    if not table.clock or len(set(table.names)) < len(table.names) or len(table.names) < 2:
        raise SimulationError(
            f"{path}: its first line has to name columns, each once, one of them 'time' or 't' and the others inputs; "
            f"it has {', '.join(map(repr, table.names)) or 'nothing'}"
        )
    columns = [name for name in table.names if name != table.clock and not is_estimate(name, causalities)]
    driving = [name for name in columns if causalities.get(name) not in {"output", "local", "independent"}] or columns
    left_out = [name for name in table.names if name not in {table.clock, *driving}]
    if left_out:
        logger.warning("%s: left out, as they are no inputs: %s", path, ", ".join(left_out))
    try:
        return table, {name: input_port(system, name, single=single) for name in driving}
    except SimulationError as error:
        raise SimulationError(f"{path}: {str(error).removeprefix('--input: ')}") from None


def _checked_columns(table: Table, ports: Mapping[str, Port]) -> tuple[Floats, dict[str, Floats]]:
    """Instants [s], and columns in the units of their ports."""
    times = table.times(most=2)
    if times.size < 2:
        raise SimulationError(f"{table.title}: {times.size} lines of numbers; give two at least")
    columns = {name: table.numbers(name, port.variable.unit) for name, port in ports.items()}
    ends = np.arange(times.size) == times.size - 1
    for name, column in columns.items():
        table.check_curve(name, times, column)
        jumps = times[-1] == times[-2] and column[-1] != column[-2]
        table.refuse_rows(name, ends & jumps, "a jump after which nothing follows; leave it out, or add a later line")
    return times, columns


def _check_table_span(file: str, times: Floats, start_time: float, stop_time: float) -> None:
    """Raise a SimulationError unless the times of a table reach from start to stop."""
    allowed = _ROUNDING * (times[-1] - times[0])
    if times[0] > start_time + allowed or times[-1] < stop_time - allowed:
        raise SimulationError(
            f"{file}: from {times[0]:g} to {times[-1]:g} s, but the simulation goes from {start_time:g} to "
            f"{stop_time:g} s; give the rest, or --start and --stop"
        )


def _prescribe_table(
    prescribed: PrescribedInputs,
    times: Floats,
    columns: Mapping[str, Floats],
    ports: Mapping[str, Port],
    *,
    join: Join,
    smoothing: float | None,
) -> set[str]:
    """Add an operator for each coordinate in a table, and a function for each other input; return their names.

    Columns of rates belong to the operator of their coordinate.
    """
    triples = {name: triple for name, port in ports.items() if (triple := port.triple())}
    rates = {f"{name.removesuffix(ports[name].name)}{rate.name}" for name in triples for rate in triples[name][1:]}
    for name in ports.keys() - triples.keys() - rates:
        table = knots(*complete_rows(times, columns[name]), join=join, smoothing=smoothing)
        through, breaks = piecewise_polynomial(table), table[0, 1:][np.diff(table[0]) == 0]
        prescribed.functions[name] = Signal(lambda t, through=through: float(through(t)), breaks.tolist())
    for name, triple in triples.items():
        owner, port = ports[name].part.name, ports[name].name
        beside = [columns.get(f"{name.removesuffix(port)}{rate.name}") for rate in triple[1:]]
        rows = complete_rows(times, columns[name], *beside)
        prescribed.operators.setdefault(owner, {})[port] = tabulated(*rows, join=join, smoothing=smoothing)
    return set(ports) - rates | triples.keys()
