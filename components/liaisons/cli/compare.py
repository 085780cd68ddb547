"""``liaisons compare``: two files of signals, one table of differences."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from liaisons.cli._command import Number, command, option

if TYPE_CHECKING:
    from liaisons.results import Result


def _tolerance(text: str) -> float:
    tolerance = float(text)
    if not 0 <= tolerance < float("inf"):
        raise typer.BadParameter(f"{text!r}: give a number, 0 at least, e.g. --tolerance 1e-6")
    return tolerance


Table = Annotated[Path, typer.Argument(metavar="CSV|PARQUET", help="a table of signals, time first")]


@command("""
    liaisons compare coarse.csv fine.csv
    liaisons compare mine.parquet theirs.csv --tolerance 1e-6
""")
def compare(
    first: Table,
    second: Table,
    tolerance: Annotated[
        Number, option("R", "allowed difference beside the signal's largest value", parser=_tolerance)
    ] = None,
) -> int:
    """Compare two results, signal by signal.

    Exit status 1 when they differ by more than a tolerance.
    """
    from liaisons.check import compare

    comparison = compare(_read(first), _read(second))
    print(comparison)
    return 0 if tolerance is None or comparison.relative <= tolerance else 1


def _read(path: Path) -> Result:
    from liaisons.results import Result

    return (Result.from_parquet if path.suffix == ".parquet" else Result.from_csv)(path)
