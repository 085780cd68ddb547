"""``liaisons simulate``: an FMU or a system of them, its signals as a table, a file, a picture."""

from __future__ import annotations

import argparse
from collections.abc import Iterable
from dataclasses import dataclass, replace
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING

from liaisons import ssp
from liaisons.check import table
from liaisons.cli._command import add_unpacked_limit, command
from liaisons.cli._inputs import drives
from liaisons.cli._mismatch import mismatches, taken_out
from liaisons.cosim import System
from liaisons.errors import SimulationError
from liaisons.files import check_writable
from liaisons.library import fmu_file
from liaisons.project import ProjectError
from liaisons.results import IncompleteError, Interrupted, Result

if TYPE_CHECKING:
    from liaisons.cli._command import Commands


def register(commands: Commands) -> None:
    """Add the command."""
    parser = command(
        commands,
        "simulate",
        _simulate,
        "simulate an FMU or an SSP archive by co-simulation and show what its signals did",
        "liaisons simulate Pendulum --set theta_0=3 --stop 20 --plot\n"
        "liaisons simulate fmus/Pendulum.fmu --set length=2 --record theta,energy_balance --csv swing.csv\n"
        'liaisons simulate Pendulum --input length="1 + 0.1*sin(5*t)"\n'
        "liaisons simulate Pendulum --input motion.csv --stop 5\n"
        "liaisons simulate system.ssp --set swing.theta_0=0.1 --step 0.01\n"
        "liaisons simulate my_component.py --step 0.1 --tolerance 1e-10",
    )
    parser.add_argument("fmu", metavar="FMU|SSP|NAME|FILE.py", help="a file, or a component, which is built if need be")
    add_experiment(parser, "start value of a parameter or input (COMPONENT.NAME of a system)")
    parser.add_argument(
        "--input",
        action="append",
        default=[],
        metavar="NAME=EXPRESSION|FILE.csv",
        dest="inputs",
        help="move an input: an expression of the time t (its rates follow), or a table with a column time and one "
        "an input, rates beside it where they are known; may be given several times",
    )
    parser.add_argument("--record", metavar="NAME,...", help="show only these signals (default: outputs and inputs)")
    parser.add_argument("--csv", type=Path, metavar="FILE", help="write the signals to a file")
    parser.add_argument("--parquet", type=Path, metavar="FILE", help="write the signals to a Parquet file")
    parser.add_argument("--plot", nargs="?", const=True, metavar="FILE", help="draw the signals (default: NAME.png)")


def _simulate(arguments: argparse.Namespace) -> int:
    path = Path(arguments.fmu)
    archive = path.suffix.lower() == ".ssp"
    subject = _of_archive(path, arguments) if archive else _of_fmu(fmu_file(arguments.fmu), arguments)
    figure = f"{subject.system.name}.png" if arguments.plot is True else arguments.plot
    outputs = Outputs(arguments.csv, arguments.parquet, Path(figure) if figure else None)
    outputs.check()
    inputs = drives(
        subject.system,
        arguments.inputs,
        prefix=subject.prefix,
        start_time=subject.start_time,
        stop_time=subject.stop_time,
    )
    record = [f"{subject.prefix}{name}" for name in arguments.record.split(",")] if arguments.record else None
    parts = subject.system.parts.items()
    hidden = [n for part, c in parts for v in mismatches(c.fmu) if (n := f"{part}.{v}") not in (record or ())]
    if record is None:
        record = [f"{part}.{v}" for part, c in parts for v in c.fmu.recorded()]

    def write(result: Result, words: str = "") -> None:
        shown, contradictions = taken_out(subject.bare(result), [name.removeprefix(subject.prefix) for name in hidden])
        outputs.write(shown, contradictions, words)

    long = subject.stop_time - subject.start_time > 1e4 * subject.step_size
    try:
        result = subject.system.simulate(
            subject.stop_time,
            subject.step_size,
            start_time=subject.start_time,
            tolerance=subject.tolerance,
            record=[*record, *hidden],
            inputs=inputs,
            progress=long,
        )
    except (IncompleteError, Interrupted) as error:
        write(error.result, f", up to t = {error.result.time[-1]:.10g} s")
        raise
    write(result)
    return 0


@dataclass(frozen=True)
class _Subject:
    """What is simulated, and its experiment with what the user has said.

    :param prefix: stands before names of the system and is left out before the user: that of a single FMU.
    """

    system: System
    prefix: str
    start_time: float
    stop_time: float
    step_size: float
    tolerance: float | None

    def bare(self, result: Result) -> Result:
        """The same with names as the user knows them."""
        units = {name.removeprefix(self.prefix): result.units[name] for name in result.names}
        return replace(result, names=tuple(units), units=units)


def _of_fmu(path: Path, arguments: argparse.Namespace) -> _Subject:
    """A system of one: unlike keywords of ``simulate()``, its start values may have any name (``Ramp.start_time``)."""
    name = path.stem.replace(".", "_")
    system = System(path.stem)
    experiment = system.add(name, path, **dict(arguments.starts)).fmu.experiment
    tolerance = experiment.tolerance if arguments.tolerance is None else arguments.tolerance
    default = (experiment.start_time or 0.0, experiment.stop_time, experiment.step_size)
    return _Subject(system, f"{name}.", *_span(path, arguments, default), tolerance)


def _of_archive(path: Path, arguments: argparse.Namespace) -> _Subject:
    """What the archive does not say of its experiment, its FMUs do: the latest end, the shortest step."""
    system = ssp.read(path, System, dict(arguments.starts))
    own = system.experiment
    found = ssp.chosen(system, own.start_time)
    default = (found.start_time or 0.0, found.stop_time, found.step_size)
    return _Subject(system, "", *_span(path, arguments, default), arguments.tolerance)


def _span(
    path: Path, arguments: argparse.Namespace, default: tuple[float, float | None, float | None]
) -> tuple[float, float, float]:
    given = (arguments.start, arguments.stop, arguments.step)
    start, stop, step = (own if value is None else value for value, own in zip(given, default, strict=True))
    if stop is None or step is None:
        raise ProjectError(f"{path.name} has no default experiment; add --stop and --step")
    return start or 0.0, stop, step


@dataclass(frozen=True)
class Outputs:
    """Files that signals go to, where they are not None."""

    csv: Path | None
    parquet: Path | None
    figure: Path | None

    def check(self) -> None:
        """Notice before the run what would keep them from being written after it.

        :raises SimulationError: if one of them cannot be written.
        """
        for path in filter(None, (self.csv, self.parquet, self.figure)):
            check_writable(path)
        if self.parquet and find_spec("pyarrow") is None:
            raise SimulationError(f"{self.parquet}: Parquet needs PyArrow; pip install 'liaisons[parquet]'")
        if self.figure:
            from matplotlib.figure import Figure

            kinds = Figure().canvas.get_supported_filetypes()
            if (self.figure.suffix[1:].lower() or "png") not in kinds:
                raise SimulationError(f"{self.figure}: no figure ends so; choose one of {', '.join(sorted(kinds))}")

    def write(self, result: Result, remarks: Iterable[str], words: str) -> None:
        """Show the signals as a table, and write them.

        :param remarks: lines below the table.
        :param words: what to say of the files besides their names.
        :raises SimulationError: if one of them cannot be written.
        """
        print(table(result.summary()))
        for remark in remarks:
            print(remark)
        for file, write in ((self.csv, result.to_csv), (self.parquet, result.to_parquet)):
            if file:
                write(file)
                print(f"signals: {file}{words}")
        if self.figure:
            result.plot(path=self.figure)
            print(f"figure: {self.figure}{words}")


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
    parser.add_argument("--start", type=float, metavar="T", help="begin [s] (default: the FMU's, else 0)")
    parser.add_argument("--stop", type=float, metavar="T", help="end [s] (default: the FMU's)")
    parser.add_argument("--step", type=float, metavar="H", help="communication step [s] (default: the FMU's)")
    parser.add_argument("--tolerance", type=float, metavar="R", help="relative tolerance (default: the FMU's)")
    add_unpacked_limit(parser)


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
