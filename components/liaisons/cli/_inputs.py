"""Motions and forces that a command prescribes: expressions of time, and tables with a column an input."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from liaisons.base.arrays import Floats
from liaisons.base.files import read_csv_cells
from liaisons.base.knots import Join, knots, piecewise_polynomial
from liaisons.cosim.structure.sources import Signal
from liaisons.errors import LiaisonsError, SimulationError, suggestion

if TYPE_CHECKING:
    from liaisons.cosim import OperatorFmu, System
    from liaisons.cosim.structure.components import Port
    from liaisons.cosim.structure.sources import Function

Triple = tuple[float, float, float]
"""Value, rate, acceleration."""

_TIMES = ("time", "t")
_ROUNDING = 1e-9  # of the span of a table: by so much it may miss start or stop


@dataclass(frozen=True)
class PrescribedInputs:
    """Values that --input prescribes: functions of time by the names of inputs, and operators by owner and port."""

    functions: dict[str, Function] = field(default_factory=dict)
    operators: dict[str, dict[str, OperatorFmu]] = field(default_factory=dict)


def prescribed_inputs(
    system: System, inputs: Iterable[str], start_time: float, stop_time: float, *, single: bool, join: Join
) -> PrescribedInputs:
    """Functions of time and operators that ``--input`` prescribes.

    :param inputs: ``NAME=EXPRESSION``, or the name of a file with a column of times and one an input.
    :param start_time: start of the simulation [s].
    :param stop_time: its stop [s]; tables have to reach from one to the other.
    :param single: the system is one FMU, whose inputs have no prefix.
    :param join: of the rows of tables without rates.
    :raises LiaisonsError: if an expression cannot be parsed, a file not read, or there is no such input.
    """
    prescribed, names = PrescribedInputs(), set[str]()
    for text in inputs:
        name, equals, right = text.partition("=")
        if _is_file(text) or not equals:
            times, columns = read_table(Path(text))
            _require_reach(text, times, start_time, stop_time)
            ports = {column: _input_port(system, column, single=single) for column in columns}
            try:
                new = _prescribe_table(prescribed, times, columns, ports, join)
            except LiaisonsError as error:
                raise SimulationError(f"{text}: {error}") from None
        else:
            new = {name.strip()}
            prescribed.functions[name.strip()] = _parsed_input(
                name.strip(), right, lambda name: _input_port(system, name, single=single), (start_time, stop_time)
            )
        for name in new & names:
            raise SimulationError(f"--input: {name} is given twice; leave one out")
        names |= new
    return prescribed


def _is_file(text: str) -> bool:
    """Whether a text is the path of a file."""
    try:
        return Path(text).is_file()
    except OSError:  # a formula longer than a name can be
        return False


def _parsed_input(name: str, text: str, driven: Callable[[str], Port], span: tuple[float, float]) -> Function:
    """Function of time for an input, with the instants of its pulses."""
    if Path(text).suffix.lower() == ".csv":
        raise SimulationError(f"--input {text!r}: a table has its names above its columns: write --input {text}")
    from liaisons.cli._expressions import FormulaError, expression, pulses  # loads CasADi

    try:
        function, breaks = expression(text), pulses(text, *span)
    except FormulaError as error:
        raise FormulaError(f"--input {name}: {error}") from None
    return Signal(function if driven(name).triple() else lambda t: function(t)[0], breaks)


def _input_port(system: System, name: str, *, single: bool) -> Port:
    """Port of an input by its name, checked.

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


def _require_reach(file: str, times: Floats, start_time: float, stop_time: float) -> None:
    """Raise a SimulationError unless a table reaches from start to stop."""
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
    join: Join,
) -> set[str]:
    """Add an operator for each coordinate, with its rates if they have columns, and a function for each other input.

    :returns: the names of these inputs.
    """
    from liaisons.interface import tabulated

    triples = {name: triple for name, port in ports.items() if (triple := port.triple())}
    rates = {f"{name.removesuffix(ports[name].name)}{rate.name}" for name in triples for rate in triples[name][1:]}
    for name in ports.keys() - triples.keys() - rates:
        table = knots(times, columns[name], join=join)
        through, breaks = piecewise_polynomial(table), table[0, 1:][np.diff(table[0]) == 0]
        prescribed.functions[name] = Signal(lambda t, through=through: float(through(t)), breaks.tolist())
    for name, triple in triples.items():
        owner, port = ports[name].part.name, ports[name].name
        beside = [columns.get(f"{name.removesuffix(port)}{rate.name}") for rate in triple[1:]]
        prescribed.operators.setdefault(owner, {})[port] = tabulated(times, columns[name], *beside, join=join)
    return set(ports) - rates | triples.keys()


def read_table(path: Path) -> tuple[Floats, dict[str, Floats]]:
    """Read a CSV file: times and columns; its first line names them, one of them ``time`` or ``t``.

    Lines that begin with ``#`` are left out.

    :raises SimulationError: if it cannot be read, or is no such file; names the line.
    """
    names, _, lines = read_csv_cells(path, SimulationError)
    time = next((name for name in _TIMES if name in names), "")
    if not time or len(set(names)) < len(names) or len(names) < 2:
        raise SimulationError(
            f"{path}: its first line has to name columns, each once, one of them 'time' or 't' and the others inputs; "
            f"it has {', '.join(map(repr, names)) or 'nothing'}"
        )
    rows: list[dict[str, float]] = []
    for number, row in lines.items():
        try:
            rows.append(dict(zip(names, map(float, row), strict=True)))
            if not all(map(math.isfinite, rows[-1].values())):
                raise ValueError(f"{', '.join(row)}: finite numbers only")
            if len(rows) > 1 and rows[-1][time] < rows[-2][time]:
                later, before = rows[-1][time], rows[-2][time]
                raise ValueError(f"{time} = {later:g} must not be less than {before:g}, the one before")
        except ValueError as error:
            raise SimulationError(f"{path}, line {number}: {error}") from None
    if len(rows) < 2:
        raise SimulationError(f"{path}: {len(rows)} lines of numbers; give two at least")
    columns = {name: np.array([row[name] for row in rows]) for name in names}
    return columns.pop(time), columns
