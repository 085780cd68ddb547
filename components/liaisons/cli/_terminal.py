"""Tables as wide as the terminal."""

from __future__ import annotations

import shutil
from collections.abc import Mapping, Sequence
from itertools import zip_longest
from textwrap import wrap

from liaisons.check import table

_WIDTH = 100
"""Of what is no terminal."""
_NARROWEST = 16
"""Of the last column, beside which there may be no room."""


def fitting_table(rows: Sequence[Mapping[str, str]], narrow: Mapping[str, int]) -> str:
    """A table as wide as the terminal at most; its cells go over several lines where they have to.

    :param rows: column -> content; the last column takes the width that is left.
    :param narrow: width of other columns that may be broken, where their longest word is not longer.
    """
    width = shutil.get_terminal_size((_WIDTH, 0)).columns
    whole = table(rows)
    if not rows or max(map(len, whole.splitlines())) <= width:
        return whole
    *columns, last = rows[0]
    widths = {column: max(len(column), *(len(row[column]) for row in rows)) for column in columns}
    for column, most in narrow.items():
        words = [word for row in rows for word in row[column].split()]
        widths[column] = min(widths[column], max(most, *map(len, words)))
    widths[last] = max(width - sum(widths.values()) - 2 * len(widths), _NARROWEST)
    lines = [
        dict(zip(row, cells, strict=True))
        for row in rows
        for cells in zip_longest(*(wrap(row[column], widths[column]) for column in row), fillvalue="")
    ]
    return table(lines)
