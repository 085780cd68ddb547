"""``liaisons compare``: two files of signals, one table of differences."""

from __future__ import annotations

import argparse
import math
from pathlib import Path
from typing import TYPE_CHECKING

from liaisons.check import compare
from liaisons.cli._command import command

if TYPE_CHECKING:
    from liaisons.cli._command import Commands
    from liaisons.cosim import Result


def register(commands: Commands) -> None:
    """Add the command."""
    parser = command(
        commands,
        "compare",
        _compare,
        "compare two results, signal by signal; exit status 1 when they differ by more than a tolerance",
        "liaisons compare coarse.csv fine.csv\nliaisons compare mine.parquet theirs.csv --tolerance 1e-6",
    )
    for name in ("first", "second"):
        parser.add_argument(name, type=Path, metavar="CSV|PARQUET", help="a table of signals, time first")
    parser.add_argument(
        "--tolerance",
        type=_tolerance,
        metavar="R",
        help="how large a difference may be beside the signal's largest value",
    )


def _compare(arguments: argparse.Namespace) -> int:
    comparison = compare(_read(arguments.first), _read(arguments.second))
    print(comparison)
    return 0 if arguments.tolerance is None or comparison.relative <= arguments.tolerance else 1


def _tolerance(text: str) -> float:
    try:
        tolerance = float(text)
    except ValueError:
        tolerance = math.nan
    if not (math.isfinite(tolerance) and tolerance >= 0):
        raise argparse.ArgumentTypeError(f"{text!r}: give a number, 0 at least, e.g. --tolerance 1e-6")
    return tolerance


def _read(path: Path) -> Result:
    from liaisons.cosim import Result

    return (Result.from_parquet if path.suffix == ".parquet" else Result.from_csv)(path)
