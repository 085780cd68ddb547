"""Verdicts: a claim with its error, its tolerance, and whether it holds."""

from __future__ import annotations

import math
import sys
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from itertools import zip_longest
from textwrap import wrap

from liaisons.base.arguments import float_array, shown
from liaisons.errors import ValidityError, one_line


@dataclass(frozen=True, slots=True)
class Verdict:
    """A claim, its measured error and its tolerance.

    :param claim: one sentence, for example ``"theta(t) is Jacobi's elliptic function"``.
    :param error: measured error, >= 0, or NaN, which never passes.
    :param tolerance: largest error that passes, finite and >= 0.
    :param unit: SI unit of both.
    :param reason: why this tolerance.
    """

    claim: str
    error: float
    tolerance: float
    unit: str = ""
    reason: str = ""

    def __post_init__(self) -> None:
        if not (math.isfinite(self.tolerance) and self.tolerance >= 0):
            raise ValidityError(f"{self.claim!r}: tolerance {self.tolerance} must be finite and >= 0")
        if self.error < 0:
            raise ValidityError(f"{self.claim!r}: error {self.error} must be >= 0; take its absolute value")

    @property
    def passed(self) -> bool:
        """Whether the claim holds: error <= tolerance."""
        return self.error <= self.tolerance

    def row(self) -> dict[str, str]:
        """Cells of the verdict by column of ``print_table``."""
        unit = f" {self.unit}" if self.unit else ""
        return {
            "claim": self.claim,
            "error": f"{self.error:.2g}{unit}",
            "tolerance": f"{self.tolerance:.2g}{unit}",
            "verdict": "pass" if self.passed else "FAIL",
        }

    def __str__(self) -> str:
        row = self.row()
        return f"{row['verdict']}: {row['claim']}: error {row['error']}, tolerance {row['tolerance']}"


def verdict(claim: str, *, error: float, tolerance: float, unit: str = "", reason: str = "") -> Verdict:
    """Make a verdict on a claim; see :class:`Verdict` for the arguments.

    :raises ValidityError: for a negative error or a tolerance that is not a bound.
    """
    return Verdict(
        claim, _checked_number(claim, "error", error), _checked_number(claim, "tolerance", tolerance), unit, reason
    )


def _checked_number(claim: str, name: str, value: object) -> float:
    """Number given as an argument of a verdict; raise a ValidityError for anything else."""
    array = float_array(f"{claim!r}: {name}", value, ValidityError)
    if array.size != 1:
        raise ValidityError(f"{claim!r}: {name} = {shown(value)}: give one number")
    return array.item()


def table(rows: Iterable[Verdict | Mapping[str, object]], width: int | None = None) -> str:
    """Plain-text table with aligned columns.

    :param rows: verdicts, or mappings from column to content; the first row names the columns.
    :param width: characters of a line, where cells go over several lines; None: one line per row.
    :returns: header and rows without trailing blanks or newline; empty for no rows.
    """
    records = [
        row.row() if isinstance(row, Verdict) else row for row in (rows if isinstance(rows, Iterable) else [rows])
    ]
    for record in records:
        if not isinstance(record, Mapping):
            raise ValidityError(f"table: {shown(record)} is not a row; give verdicts, or dictionaries by columns")
    if not records:
        return ""
    columns = list(records[0])
    cells = [columns, *([one_line(str(record.get(column, ""))) for column in columns] for record in records)]
    widths = _fitting_widths(cells, width or sys.maxsize)
    broken = []
    for row in cells:
        parts = [wrap(cell, wide or 1, break_on_hyphens=False) or [""] for cell, wide in zip(row, widths, strict=True)]
        broken += zip_longest(*parts, fillvalue="")
    broken.insert(1, tuple("-" * wide for wide in widths))
    return "\n".join("  ".join(map(str.ljust, line, widths)).rstrip() for line in broken)


def _fitting_widths(cells: list[list[str]], width: int) -> list[int]:
    """Widths of columns that fit into a width; each holds its longest word, and lines are as few as possible."""
    columns = list(zip(*cells, strict=True))
    widths = [max(map(len, column)) for column in columns]
    words = [max(len(word) for cell in column for word in cell.split() or [""]) for column in columns]

    def lines(widths: list[int]) -> int:
        """Number of lines of a table with these widths."""
        return sum(max(-(-len(cell) // (wide or 1)) for cell, wide in zip(row, widths, strict=True)) for row in cells)

    while sum(widths) + 2 * (len(widths) - 1) > width and widths != words:
        narrowed = [[*widths[:i], wide - 1, *widths[i + 1 :]] for i, wide in enumerate(widths) if wide > words[i]]
        widths = min(narrowed, key=lines)
    return widths
