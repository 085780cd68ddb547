"""``liaisons simulate``: one FMU, its signals as a table, a file, a picture."""

from __future__ import annotations

import argparse
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from liaisons.check import table
from liaisons.cli._command import command
from liaisons.library import fmu_file
from liaisons.project import ProjectError

if TYPE_CHECKING:
    from liaisons.cli._command import Commands
    from liaisons.cosim import Result


def register(commands: Commands) -> None:
    """Add the command."""
    parser = command(
        commands,
        "simulate",
        _simulate,
        "simulate one FMU by co-simulation and show what its signals did",
        "liaisons simulate Pendulum --set theta_0=3 --stop 20 --plot\n"
        "liaisons simulate fmus/Pendulum.fmu --set length=2 --record theta,energy_balance --csv swing.csv\n"
        "liaisons simulate my_component.py --step 0.1 --tolerance 1e-10",
    )
    parser.add_argument("fmu", metavar="FMU|NAME|FILE.py", help="a file, or a component, which is built if need be")
    parser.add_argument(
        "--set",
        action="append",
        default=[],
        metavar="NAME=VALUE",
        type=_assignment,
        dest="starts",
        help="start value of a parameter or input; may be given several times",
    )
    parser.add_argument("--stop", type=float, metavar="T", help="end [s] (default: the FMU's)")
    parser.add_argument("--step", type=float, metavar="H", help="communication step [s] (default: the FMU's)")
    parser.add_argument("--tolerance", type=float, metavar="R", help="relative tolerance (default: the FMU's)")
    parser.add_argument("--record", metavar="NAME,...", help="show only these signals (default: outputs and inputs)")
    parser.add_argument("--csv", type=Path, metavar="FILE", help="write the signals to a file")
    parser.add_argument("--plot", nargs="?", const=True, metavar="FILE", help="draw the signals (default: NAME.png)")


def _simulate(arguments: argparse.Namespace) -> int:
    result = _result(fmu_file(arguments.fmu), arguments)
    print(table([_row(result, name) for name in result.names]))
    if arguments.csv:
        result.to_csv(arguments.csv)
        print(f"signals: {arguments.csv}")
    if arguments.plot:
        figure = Path(f"{result.title}.png" if arguments.plot is True else arguments.plot)
        result.plot(path=figure)
        print(f"figure: {figure}")
    return 0


def _result(path: Path, arguments: argparse.Namespace) -> Result:
    """A system of one: unlike keywords of ``simulate()``, its start values may have any name (``Ramp.start_time``)."""
    from liaisons.cosim import System

    name = path.stem.replace(".", "_")
    system = System(path.stem)
    component = system.add(name, path, **dict(arguments.starts))
    experiment = component.fmu.experiment
    stop_time = experiment.stop_time if arguments.stop is None else arguments.stop
    step_size = experiment.step_size if arguments.step is None else arguments.step
    if stop_time is None or step_size is None:
        raise ProjectError(f"{path.name} has no default experiment; add --stop and --step")
    record = arguments.record and [f"{name}.{variable}" for variable in arguments.record.split(",")]
    tolerance = experiment.tolerance if arguments.tolerance is None else arguments.tolerance
    result = system.simulate(
        stop_time, step_size, tolerance=tolerance, record=record, progress=stop_time > 1e4 * step_size
    )
    units = {signal.removeprefix(f"{name}."): unit for signal, unit in result.units.items()}
    return replace(result, names=tuple(units), units=units)


def _row(result: Result, name: str) -> dict[str, str]:
    values = result[name]
    columns = {"start": values[0], "end": values[-1], "smallest": values.min(), "largest": values.max()}
    return {"signal": name, "unit": result.units[name] or "-"} | {key: f"{value:.6g}" for key, value in columns.items()}


def _assignment(text: str) -> tuple[str, float | bool | str]:
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
