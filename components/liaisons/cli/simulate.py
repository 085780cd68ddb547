"""``liaisons simulate``: an FMU or a system of them, its signals as a table, a file, a picture."""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from liaisons.check import table
from liaisons.cli._command import command
from liaisons.cli._mismatch import mismatches, taken_out
from liaisons.library import fmu_file
from liaisons.project import ProjectError

if TYPE_CHECKING:
    from liaisons.cli._command import Commands
    from liaisons.cosim import Result, System

_MOST_ROWS = 10
"""An array with more elements is one row of the table."""


def register(commands: Commands) -> None:
    """Add the command."""
    parser = command(
        commands,
        "simulate",
        _simulate,
        "simulate an FMU or an SSP archive by co-simulation and show what its signals did",
        "liaisons simulate Pendulum --set theta_0=3 --stop 20 --plot\n"
        "liaisons simulate fmus/Pendulum.fmu --set length=2 --record theta,energy_balance --csv swing.csv\n"
        "liaisons simulate system.ssp --set swing.theta_0=0.1 --step 0.01\n"
        "liaisons simulate my_component.py --step 0.1 --tolerance 1e-10",
    )
    parser.add_argument("fmu", metavar="FMU|SSP|NAME|FILE.py", help="a file, or a component, which is built if need be")
    add_experiment(parser, "start value of a parameter or input (COMPONENT.NAME of a system)")
    parser.add_argument("--record", metavar="NAME,...", help="show only these signals (default: outputs and inputs)")
    parser.add_argument("--csv", type=Path, metavar="FILE", help="write the signals to a file")
    parser.add_argument("--parquet", type=Path, metavar="FILE", help="write the signals to a Parquet file")
    parser.add_argument("--plot", nargs="?", const=True, metavar="FILE", help="draw the signals (default: NAME.png)")


def _simulate(arguments: argparse.Namespace) -> int:
    path = Path(arguments.fmu)
    run = _of_system(path, arguments) if path.suffix == ".ssp" else _of_fmu(fmu_file(arguments.fmu), arguments)
    result, contradictions = taken_out(*run)
    print(table([row for name in result.entries for row in _rows(result, name)]))
    for line in contradictions:
        print(line)
    for file, write in ((arguments.csv, result.to_csv), (arguments.parquet, result.to_parquet)):
        if file:
            write(file)
            print(f"signals: {file}")
    if arguments.plot:
        figure = Path(f"{result.title}.png" if arguments.plot is True else arguments.plot)
        result.plot(path=figure)
        print(f"figure: {figure}")
    return 0


def _of_fmu(path: Path, arguments: argparse.Namespace) -> tuple[Result, list[str]]:
    """A system of one: unlike keywords of ``simulate()``, its start values may have any name (``Ramp.start_time``)."""
    from liaisons.cosim import System

    name = path.stem.replace(".", "_")
    system = System(path.stem)
    fmu = system.add(name, path, **dict(arguments.starts)).fmu
    record = [f"{name}.{variable}" for variable in arguments.record.split(",")] if arguments.record else None
    default = {"stop": fmu.experiment.stop_time, "step": fmu.experiment.step_size}
    tolerance = fmu.experiment.tolerance if arguments.tolerance is None else arguments.tolerance
    result, hidden = _run(system, arguments, path, default, record=record, tolerance=tolerance)
    units = {signal: result.units[signal] for signal in result.names}
    bare = {signal.removeprefix(f"{name}."): unit for signal, unit in units.items()}
    return replace(result, names=tuple(bare), units=bare), [signal.removeprefix(f"{name}.") for signal in hidden]


def _of_system(path: Path, arguments: argparse.Namespace) -> tuple[Result, list[str]]:
    from liaisons.cosim import System, ssp

    archive = ssp.read(path, System, dict(arguments.starts))
    record = arguments.record.split(",") if arguments.record else None
    default = {"stop": archive.experiment.stop_time, "step": archive.experiment.step_size}
    start_time = archive.experiment.start_time
    tolerance = arguments.tolerance
    return _run(archive.system, arguments, path, default, record=record, tolerance=tolerance, start_time=start_time)


def _run(
    system: System,
    arguments: argparse.Namespace,
    path: Path,
    default: Mapping[str, float | None],
    *,
    record: list[str] | None,
    tolerance: float | None,
    start_time: float = 0.0,
) -> tuple[Result, list[str]]:
    """The result, and what it has of names that nobody asked for."""
    stop, step = (
        given if (given := getattr(arguments, name)) is not None else default[name] for name in ("stop", "step")
    )
    if stop is None or step is None:
        raise ProjectError(f"{path.name} has no default experiment; add --stop and --step")
    long = stop - start_time > 1e4 * step
    parts = system.components.items()
    hidden = [n for part, c in parts for v in mismatches(c.fmu) if (n := f"{part}.{v}") not in (record or ())]
    if hidden:
        record = [f"{part}.{v}" for part, c in parts for v in c.fmu.recorded()] if record is None else record
        record = [*record, *hidden]
    result = system.simulate(stop, step, start_time=start_time, tolerance=tolerance, record=record, progress=long)
    return result, hidden


def _rows(result: Result, name: str) -> list[dict[str, str]]:
    """A row a signal; one for all elements of a long array."""
    values = result[name]
    elements = [n for n in result.names if n == name or n.startswith(f"{name}[")]
    if values.ndim > 1 and len(elements) <= _MOST_ROWS:
        return [row for element in elements for row in _rows(result, element)]
    columns = {"smallest": f"{np.min(values):.6g}", "largest": f"{np.max(values):.6g}"}
    ends = {"start": f"{values[0]:.6g}", "end": f"{values[-1]:.6g}"} if values.ndim == 1 else {"start": "", "end": ""}
    label = name if values.ndim == 1 else f"{name} ({'×'.join(map(str, values.shape[1:]))})"
    return [{"signal": label, "unit": result.units[name] or "-"} | ends | columns]


def add_experiment(parser: argparse.ArgumentParser, start_value: str) -> None:
    """The options of every simulation.

    :param start_value: what --set sets.
    """
    parser.add_argument(
        "--set",
        action="append",
        default=[],
        metavar="NAME=VALUE",
        type=assignment,
        dest="starts",
        help=f"{start_value}; may be given several times",
    )
    parser.add_argument("--stop", type=float, metavar="T", help="end [s] (default: the FMU's)")
    parser.add_argument("--step", type=float, metavar="H", help="communication step [s] (default: the FMU's)")
    parser.add_argument("--tolerance", type=float, metavar="R", help="relative tolerance (default: the FMU's)")


def assignment(text: str) -> tuple[str, float | bool | str]:
    """``name=value`` of a command line; numbers and truth values as such."""
    name, equals, value = text.partition("=")
    if not (name and equals and value):
        raise argparse.ArgumentTypeError(f"{text!r}: write NAME=VALUE, e.g. --set theta_0=0.5")
    if value in {"true", "false"}:
        return name, value == "true"
    for number in (int, float):
        try:
            return name, number(value)
        except ValueError:
            continue
    return name, value  # a string variable's; the FMU's description decides
