"""``liaisons compare``: two files of signals, one table of differences."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from liaisons_tools.cli._command import Number, command, option


def _parsed_tolerance(text: str) -> float:
    """Parse a tolerance, >= 0."""
    tolerance = float(text)
    if not 0 <= tolerance < float("inf"):
        raise typer.BadParameter(f"{text!r}: give a number, 0 at least, e.g. --tolerance 1e-6")
    return tolerance


Table = Annotated[Path, typer.Argument(metavar="CSV|PARQUET", help="a table of signals, first column time")]


@command("""
    liaisons compare coarse.csv fine.csv
    liaisons compare mine.parquet theirs.csv --tolerance 1e-6
""")
def compare(
    first: Table,
    second: Table,
    tolerance: Annotated[
        Number, option("R", "allowed difference, relative to the largest value of the signal", parser=_parsed_tolerance)
    ] = None,
) -> int:
    """Compare two results, signal by signal.

    The exit status is 1 if they differ by more than the tolerance.
    """
    from liaisons import Result, compare

    readers = {".parquet": Result.from_parquet}
    comparison = compare(*(readers.get(path.suffix, Result.from_csv)(path) for path in (first, second)))
    print(comparison)
    return 0 if tolerance is None or comparison.relative <= tolerance else 1
