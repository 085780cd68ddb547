"""``liaisons sweep``: one FMU or system for many cases, as one table."""

from __future__ import annotations

import math
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from liaisons.base.files import check_writable
from liaisons.base.project import ProjectError
from liaisons_tools.cli._command import (
    Number,
    Start,
    Starts,
    Step,
    Stop,
    Tolerance,
    check_figure_writable,
    command,
    flag,
    option,
    print_table,
    repeated_option,
    subject_argument,
)

if TYPE_CHECKING:
    from liaisons import Result, System
    from liaisons.base.arrays import Floats

_MOST = 10_000_000  # values of one name
_SHOWN = 20  # rows on the screen; the file has all


def _parsed_values(text: str) -> tuple[str, list[float]]:
    """Name and values of ``NAME=a,b,c`` or ``NAME=first:last:count``."""
    name, _, values = text.partition("=")
    try:
        if not name:
            raise ValueError
        if ":" in values:
            first, last, count = values.split(":")
            if not 1 <= int(count) <= _MOST:
                raise ValueError
            import numpy as np  # not for the help

            return name, np.linspace(float(first), float(last), int(count)).tolist()
        return name, [float(value) for value in values.split(",")]
    except ValueError:
        raise typer.BadParameter(
            f"{text!r}: write NAME=a,b,c or NAME=first:last:count, a count of 1 at least and {_MOST} at most, "
            "e.g. --over theta_0=0.1:3:50"
        ) from None


def _parsed_distribution(text: str) -> tuple[str, object]:
    """Name and distribution of ``NAME=low:high`` or ``NAME=normal:mean:deviation``."""
    name, _, values = text.partition("=")
    kind, _, rest = values.partition(":")
    try:
        if kind == "normal":
            from scipy.stats import norm

            mean, deviation = _parsed_finite(rest)
            if not (name and deviation > 0):
                raise ValueError
            return name, norm(mean, deviation)
        low, high = _parsed_finite(values)
        if not (name and low < high):
            raise ValueError
        return name, (low, high)
    except ValueError:
        raise typer.BadParameter(
            f"{text!r}: write NAME=low:high with low < high, or NAME=normal:mean:deviation with deviation > 0, "
            "e.g. --random mass=normal:1:0.1"
        ) from None


def _parsed_finite(text: str) -> list[float]:
    """Numbers between colons; a ValueError unless they are finite."""
    numbers = [float(number) for number in text.split(":")]
    if not all(map(math.isfinite, numbers)):
        raise ValueError
    return numbers


@command("""
    liaisons sweep Pendulum --over theta_0=0.1:3:50 --over length=0.5,1,2 --keep theta,theta:max --csv table.csv
    liaisons sweep Pendulum --samples 1000 --random theta_0=0:3 --random mass=normal:1:0.1 --keep energy_balance
    liaisons sweep my_system.py:swing --over operator.amplitude=0:0.2:21 --keep swing.theta:max --stop 60
    liaisons sweep Pendulum --over theta_0=0.1:3:1000 --keep theta --dask tcp://10.0.0.1:8786
""")
def sweep(
    word: Annotated[
        str, subject_argument("FMU|SSP|NAME|FILE.py[:SYSTEM]", "a file, a component, or a System that a file defines")
    ],
    *,
    over: Annotated[
        list[Any],
        repeated_option(
            "NAME=VALUES",
            "values a,b,c or evenly spaced values first:last:count; given several times, for a grid",
            parser=_parsed_values,
        ),
    ],
    random: Annotated[
        list[Any],
        repeated_option(
            "NAME=LOW:HIGH",
            "uniform between two values, or normal:MEAN:DEVIATION; may be given several times; needs --samples",
            parser=_parsed_distribution,
        ),
    ],
    samples: Annotated[int | None, option("N", "number of random cases", parser=int)] = None,
    seed: Annotated[int | None, option("S", "seed of the random cases (default: 0)", parser=int)] = None,
    keep: Annotated[
        list[str],
        option(
            "SIGNAL,...", "signals to keep: SIGNAL for its last value, SIGNAL:max or SIGNAL:min for an extreme value"
        ),
    ],
    starts: Starts,
    start: Start = None,
    stop: Stop = None,
    step: Step = None,
    tolerance: Tolerance = None,
    csv: Annotated[Path | None, option("FILE", "write the table to a file")] = None,
    plot: Annotated[Path | None, option("FILE", "draw the table: curves if one value varies, maps if two do")] = None,
    journal: Annotated[
        Path | None,
        option(
            "FILE",
            "save finished cases in this file; the same command then continues from there (default with --csv: a file "
            "next to the table, deleted when all cases are finished)",
        ),
    ] = None,
    retry: Annotated[
        bool, flag("--retry", "also repeat cases that, according to the journal, the model has refused")
    ] = False,
    time_limit: Annotated[
        Number,
        option(
            "SECONDS",
            "end a case that takes longer, including the loading of its FMUs (default: no limit)",
            parser=float,
        ),
    ] = None,
    workers: Annotated[int | None, option("N", "number of processes (default: one for each core)", parser=int)] = None,
    dask: Annotated[
        str | None, option("ADDRESS", "simulate on the workers of this Dask scheduler, e.g. tcp://10.0.0.1:8786")
    ] = None,
) -> int:
    """Simulate an FMU or a system for many cases, on all cores or on a Dask cluster.

    FMUs and Python files contain code, which runs on this machine with your rights.  A Dask scheduler runs code on its
    workers, and what it returns is loaded here.  Take files only from people you trust, and connect only to a scheduler
    in your own network.

    A case that the model refuses counts as finished.  Cases that the machine did not finish (no memory, a full disk, a
    killed process, the time limit) are simulated again when the same command is started with the same journal.
    """
    from liaisons import sweep

    passing = None if csv is None or journal is not None else _default_journal(csv)
    journal = journal or passing
    _check_writable(csv, plot, journal)
    with _report_interrupt(journal):
        subject, arguments = _subject_arguments(word, dict(starts), start, stop, step)
        result = sweep(
            subject,
            cases=_requested_cases(over, random, samples, seed),
            keep=",".join(keep).split(","),
            tolerance=tolerance,
            journal=journal,
            retry=retry,
            time_limit=time_limit,
            workers=workers,
            client=dask,
            progress=True,
            **arguments,
        )
    print_table(result.summary(_SHOWN))
    count = len(result.index["case"])
    if count > _SHOWN:
        print(f"... {count - _SHOWN} more; --csv FILE writes all")
    for title, path, write in (("table", csv, result.to_csv), ("figure", plot, lambda path: result.plot(path=path))):
        if path is not None:
            write(path)
            print(f"{title}: {path}")
    if passing is not None and not result.unfinished:
        passing.unlink(missing_ok=True)
    _print_failures(result, has_journal=journal is not None)
    return 1 if result.failures else 0


def _check_writable(csv: Path | None, plot: Path | None, journal: Path | None) -> None:
    """Raise an error for files that cannot be written."""
    check_figure_writable(plot)
    if csv is not None:
        check_writable(csv)
        if journal is not None and csv.resolve() == journal.resolve():
            raise ProjectError(f"{csv}: cannot be the table and the journal; choose another file for one of them")


def _print_failures(result: Result, *, has_journal: bool) -> None:
    """Print which cases have failed, why, and how to go on."""
    for case, reason in list(result.failures.items())[:_SHOWN]:
        print(f"case {case} {'not finished' if case in result.unfinished else 'failed'}: {reason}")
    if len(result.failures) > _SHOWN:
        print(f"... {len(result.failures) - _SHOWN} more that failed")
    if result.unfinished:
        cure = f"{'' if has_journal else 'give --journal, and '}the same command tries them again"
        count = len(result.index["case"])
        print(f"{len(result.unfinished)} of {count} cases not finished; {cure}")


def _default_journal(csv: Path) -> Path | None:
    """Default journal of a table, beside its file; None for a device."""
    return csv.with_name(f"{csv.name}.journal") if csv.name and (csv.is_file() or not csv.exists()) else None


@contextmanager
def _report_interrupt(journal: Path | None) -> Iterator[None]:
    """Print how to go on with a sweep that is interrupted in the context."""
    try:
        yield
    except (KeyboardInterrupt, SystemExit):
        if journal is None:
            print("nothing is kept; give --csv or --journal to go on from where it is interrupted", file=sys.stderr)
        elif journal.exists():
            print(f"{journal} has what is done; the same command goes on from there", file=sys.stderr)
        raise


def _subject_arguments(
    word: str, starts: dict[str, Any], start: float | None, stop: float | None, step: float | None
) -> tuple[Path | System, dict[str, Any]]:
    """Subject of a sweep, and arguments of ``sweep()`` for its times and its start values."""
    from liaisons import System
    from liaisons_tools.cli._subject import resolved_subject

    system, rest = resolved_subject(word, starts.items())
    span = {"start_time": start, "stop_time": stop, "step_size": step}
    if isinstance(system, System):  # an archive says from when to when
        span |= {name: getattr(system.experiment, name) for name, value in span.items() if value is None}
    return system, {**span, "start_values": rest}


def _requested_cases(over: list[Any], random: list[Any], samples: int | None, seed: int | None) -> dict[str, Floats]:
    """Cases of the grid or of the random samples that the options describe."""
    from liaisons import grid, sample

    if over and random:
        raise ProjectError("--over makes a grid and --random random cases; use one of them")
    if not random and (samples, seed) != (None, None):
        raise ProjectError("--samples and --seed need --random NAME=LOW:HIGH, what is drawn at random")
    names = [name for name, _ in (*over, *random)]
    for name in names:
        if names.count(name) > 1:
            raise ProjectError(f"{name} is varied twice; give all its values at once")
    if random:
        if samples is None:
            raise ProjectError("--random needs --samples N, the number of cases")
        return sample(samples, dict(random), seed=seed or 0)
    return grid(dict(over))
