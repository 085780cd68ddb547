"""Verdicts: a claim with its error, its tolerance, and whether it holds."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass

from liaisons.arguments import numbers, shown
from liaisons.errors import ValidityError


@dataclass(frozen=True, slots=True)
class Verdict:
    """A claim and what was measured.

    :param claim: one sentence, for example ``"theta(t) is Jacobi's elliptic function"``.
    :param error: what was measured, >= 0, or NaN, which never passes.
    :param tolerance: what is allowed, finite and >= 0.
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
        """The verdict as one row of :func:`table`."""
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
    """Judge a claim; see :class:`Verdict` for the arguments.

    :raises ValidityError: for a negative error or a tolerance that is no bound.
    """
    one, other = _number(claim, "error", error), _number(claim, "tolerance", tolerance)
    return Verdict(claim, one, other, unit, reason)


def _number(claim: str, name: str, value: object) -> float:
    found = numbers(f"{claim!r}: {name}", value, ValidityError)
    if found.size != 1:
        raise ValidityError(f"{claim!r}: {name} = {shown(value)}: give one number")
    return found.item()


def table(rows: Iterable[Verdict | Mapping[str, object]]) -> str:
    """A plain-text table, one line a row, columns aligned.

    :param rows: verdicts, or mappings from column to content; the first row names the columns.
    :returns: header and rows without trailing blanks or newline; empty for no rows.
    """
    given = list(rows) if isinstance(rows, Iterable) else [rows]
    records = [row.row() if isinstance(row, Verdict) else row for row in given]
    for record in records:
        if not isinstance(record, Mapping):
            raise ValidityError(f"table: {shown(record)} is no row; give verdicts, or dictionaries by columns")
    if not records:
        return ""
    columns = list(records[0])
    cells = [columns, *([str(record.get(column, "")) for column in columns] for record in records)]
    widths = [max(map(len, column)) for column in zip(*cells, strict=True)]
    cells.insert(1, ["-" * width for width in widths])
    return "\n".join("  ".join(map(str.ljust, line, widths)).rstrip() for line in cells)
