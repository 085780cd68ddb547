"""``liaisons sweep``: one FMU or system for many cases, as one table."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from liaisons.check import table
from liaisons.cli._command import command
from liaisons.cli.simulate import add_experiment
from liaisons.library import fmu_file
from liaisons.project import ProjectError, load_module

if TYPE_CHECKING:
    from liaisons.cli._command import Commands
    from liaisons.results import Result
    from liaisons.sweeps import Cases

_TRUST = """\
An FMU and a Python file are code that runs here with your rights, and so does a Dask scheduler run code on its workers
and send back what is loaded here: take them from people you trust, and connect to a scheduler of your own network only.

A case that the model refuses is a result.  What the machine did not finish (no memory, a full disk, a process that was
killed, the time limit) is tried again when the same command is started with the same journal."""

_MOST = 10_000_000  # values of one name
_SHOWN = 20  # rows on the screen; the file has all


def register(commands: Commands) -> None:
    """Add the command."""
    parser = command(
        commands,
        "sweep",
        _sweep,
        "simulate an FMU or a system for many cases, on all cores or on a Dask cluster",
        "liaisons sweep Pendulum --over theta_0=0.1:3:50 --over length=0.5,1,2 --keep theta,theta:max --csv table.csv\n"
        "liaisons sweep Pendulum --samples 1000 --random theta_0=0:3 --random mass=normal:1:0.1 --keep energy_balance\n"
        "liaisons sweep my_system.py:swing --over operator.amplitude=0:0.2:21 --keep swing.theta:max --stop 60\n"
        "liaisons sweep Pendulum --over theta_0=0.1:3:1000 --keep theta --dask tcp://10.0.0.1:8786",
    )
    parser.epilog = f"{_TRUST}\n\n{parser.epilog}"
    parser.add_argument(
        "subject", metavar="FMU|SSP|NAME|FILE.py[:SYSTEM]", help="a file, a component, or a System that a file defines"
    )
    over = parser.add_argument
    over(
        "--over",
        action="append",
        default=[],
        metavar="NAME=VALUES",
        type=_values,
        help="values a,b,c or evenly spaced first:last:count; several times for a grid",
    )
    over(
        "--random",
        action="append",
        default=[],
        metavar="NAME=LOW:HIGH",
        type=_distribution,
        help="uniform between two values, or normal:MEAN:DEVIATION; several times; needs --samples",
    )
    over("--samples", type=int, metavar="N", help="number of random cases")
    over("--seed", type=int, metavar="S", help="of the random cases (default: 0)")
    over("--latin-hypercube", action="store_true", help="spread random cases evenly over the quantiles of each name")
    over(
        "--keep",
        required=True,
        action="append",
        metavar="SIGNAL,...",
        help="what is kept of a case: the value at the end, or SIGNAL:max, SIGNAL:min",
    )
    add_experiment(parser, "start value in all cases")
    over("--csv", type=Path, metavar="FILE", help="write the table to a file")
    over(
        "--journal",
        type=Path,
        metavar="FILE",
        help="write finished cases down; the same command goes on from there (default with --csv: beside that file, "
        "deleted when nothing is left to do)",
    )
    over(
        "--retry", action="store_true", help="simulate again, too, what the model has refused according to the journal"
    )
    over(
        "--time-limit",
        type=float,
        metavar="SECONDS",
        help="end a case that takes longer, the loading of its FMUs included, and go on (default: none)",
    )
    over("--workers", type=int, metavar="N", help="number of processes (default: one a core)")
    over("--dask", metavar="ADDRESS", help="simulate on the workers of this Dask scheduler, e.g. tcp://10.0.0.1:8786")


def _sweep(arguments: argparse.Namespace) -> int:
    csv: Path | None = arguments.csv
    passing = None if csv is None or arguments.journal is not None else _beside(csv)
    journal = arguments.journal or passing
    if csv is not None:
        _check_csv(csv, journal)
    if arguments.retry and journal is None:
        raise ProjectError("--retry needs the journal of the sweep; give --journal FILE, or the --csv FILE beside it")
    with _interrupted(journal):
        result = _simulated(arguments, journal)
    print(table(result.summary(_SHOWN)))
    count = len(result.index["case"])
    if count > _SHOWN:
        print(f"... {count - _SHOWN} more; --csv FILE writes all")
    if csv is not None:
        result.to_csv(csv)
        print(f"table: {csv}")
    if passing is not None and not result.unfinished:
        passing.unlink(missing_ok=True)
    for case, reason in list(result.failures.items())[:_SHOWN]:
        print(f"case {case} {'not finished' if case in result.unfinished else 'failed'}: {reason}")
    if len(result.failures) > _SHOWN:
        print(f"... {len(result.failures) - _SHOWN} more that failed")
    if result.unfinished:
        cure = (
            "the same command tries them again" if journal else "give --journal, and the same command tries them again"
        )
        print(f"{len(result.unfinished)} of {count} cases not finished; {cure}")
    return 1 if result.failures else 0


def _beside(csv: Path) -> Path | None:
    """The journal that a table has by default; none for a device."""
    return csv.with_name(f"{csv.name}.journal") if csv.name and (csv.is_file() or not csv.exists()) else None


def _check_csv(csv: Path, journal: Path | None) -> None:
    if not csv.parent.is_dir():
        raise ProjectError(f"{csv}: there is no folder {csv.parent}; make it, or choose another path")
    if csv.is_dir():
        raise ProjectError(f"{csv}: is a folder; name a file in it")
    if journal is not None and csv.resolve() == journal.resolve():
        raise ProjectError(f"{csv}: cannot be the table and the journal; choose another file for one of them")


def _simulated(arguments: argparse.Namespace, journal: Path | None) -> Result:
    from liaisons.sweeps import sweep

    return sweep(
        cases=_cases(arguments),
        keep=",".join(arguments.keep).split(","),
        tolerance=arguments.tolerance,
        journal=journal,
        retry=arguments.retry,
        time_limit=arguments.time_limit,
        workers=arguments.workers,
        client=arguments.dask,
        progress=True,
        **_subject(arguments),
    )


@contextmanager
def _interrupted(journal: Path | None) -> Iterator[None]:
    """Say where an interrupted sweep goes on from."""
    try:
        yield
    except (KeyboardInterrupt, SystemExit):
        if journal is None:
            print("nothing is kept; give --csv or --journal to go on from where it is interrupted", file=sys.stderr)
        elif journal.exists():
            print(f"{journal} has what is done; the same command goes on from there", file=sys.stderr)
        raise


def _subject(arguments: argparse.Namespace) -> dict[str, Any]:
    """What is simulated, and from when to when: arguments of ``sweep()``."""
    from liaisons import ssp
    from liaisons.cosim import System

    stop_time, step_size, starts = arguments.stop, arguments.step, dict(arguments.starts)
    file, separator, name = arguments.subject.rpartition(".py:")
    found = getattr(load_module(Path(f"{file}.py")), name, None) if separator else None
    if arguments.subject.endswith(".ssp"):
        system = ssp.read(arguments.subject, System, starts)
        return {
            "subject": system,
            "start_time": system.experiment.start_time if arguments.start is None else arguments.start,
            "stop_time": system.experiment.stop_time if stop_time is None else stop_time,
            "step_size": system.experiment.step_size if step_size is None else step_size,
        }
    subject = found if isinstance(found, System) else fmu_file(arguments.subject)
    span = {"start_time": arguments.start, "stop_time": stop_time, "step_size": step_size}
    return {"subject": subject, **span, "starts": starts}


def _cases(arguments: argparse.Namespace) -> Cases:
    from liaisons.sweeps import grid, sample

    if arguments.over and arguments.random:
        raise ProjectError("--over makes a grid and --random random cases; use one of them")
    if not arguments.random and (arguments.samples, arguments.seed, arguments.latin_hypercube) != (None, None, False):
        raise ProjectError(
            "--samples, --seed and --latin-hypercube need --random NAME=LOW:HIGH, what is drawn at random"
        )
    names = [name for name, _ in (*arguments.over, *arguments.random)]
    for name in names:
        if names.count(name) > 1:
            raise ProjectError(f"{name} is varied twice; give all its values at once")
    if arguments.random:
        if arguments.samples is None:
            raise ProjectError("--random needs --samples N, the number of cases")
        over = dict(arguments.random)
        return sample(arguments.samples, over, seed=arguments.seed or 0, latin_hypercube=arguments.latin_hypercube)
    return grid(dict(arguments.over))


def _values(text: str) -> tuple[str, list[float]]:
    name, _, values = text.partition("=")
    try:
        if not name:
            raise ValueError
        if ":" in values:
            first, last, count = values.split(":")
            if not 1 <= int(count) <= _MOST:
                raise ValueError
            return name, np.linspace(float(first), float(last), int(count)).tolist()
        return name, [float(value) for value in values.split(",")]
    except ValueError:
        raise argparse.ArgumentTypeError(
            f"{text!r}: write NAME=a,b,c or NAME=first:last:count, a count of 1 at least and {_MOST} at most, "
            "e.g. --over theta_0=0.1:3:50"
        ) from None


def _distribution(text: str) -> tuple[str, object]:
    name, _, values = text.partition("=")
    kind, _, rest = values.partition(":")
    try:
        if kind == "normal":
            from scipy.stats import norm

            mean, deviation = _finite(rest)
            if not (name and deviation > 0):
                raise ValueError
            return name, norm(mean, deviation)
        low, high = _finite(values.removeprefix("uniform:"))
        if not (name and low < high):
            raise ValueError
        return name, (low, high)
    except ValueError:
        raise argparse.ArgumentTypeError(
            f"{text!r}: write NAME=low:high with low < high, or NAME=normal:mean:deviation with deviation > 0, "
            "e.g. --random mass=normal:1:0.1"
        ) from None


def _finite(text: str) -> list[float]:
    numbers = [float(number) for number in text.split(":")]
    if not np.all(np.isfinite(numbers)):
        raise ValueError
    return numbers
