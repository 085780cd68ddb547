"""Quick measurements beside the figures of the page, or those of another checkout."""

from __future__ import annotations

import statistics
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

from _measure import QUIET, Row, Section, number

SLACK = 0.15  # so much worse than on the page is named


@dataclass(frozen=True, slots=True)
class Comparison:
    """A ratio of the page, or of another checkout, and those that were measured now, one a try.

    ``clear`` says whether no quartile of now reaches what is allowed.
    """

    row: Row
    now: tuple[float, ...]
    clear: bool

    @property
    def ratio(self) -> float:
        """The median of the tries."""
        return statistics.median(self.now)

    @property
    def worse(self) -> bool:
        """Whether it is worse by more than the slack."""
        return _factor(self.row, self.ratio) > 1 + SLACK


def compared(written: Iterable[Row], tries: Sequence[Sequence[Row]], *, figures: bool = False) -> list[Comparison]:
    """What the page has and each try has measured, in the order of the page; a quick try leaves sizes out.

    :param figures: compare those without a yardstick, too, if they have a unit: both were measured on this machine.
    """
    found = []
    for row in written:
        same = [other for rows in tries for other in rows if _key(other) == _key(row) and is_checked(other, figures)]
        if not is_checked(row, figures) or len(same) < len(tries):
            continue
        quartiles = [value for other in same for value in other.spread or (other.bounded,)]
        clear = all(_factor(row, value) > 1 + SLACK for value in quartiles)
        found.append(Comparison(row, tuple(other.bounded for other in same), clear))
    return found


def is_checked(row: Row, figures: bool = False) -> bool:
    """Whether a row has a ratio, or a figure with a unit, of which it is known which is better.

    What has no unit, an error or a slope, may be many times another one and as good; its bound says what it may be.
    """
    return bool(row.best) and (row.ratio is not None or (figures and bool(row.unit)))


def medians(tries: Sequence[Section]) -> Section:
    """The last of several measurements of a section, with the medians of all as its ratios and figures."""
    values: dict[tuple[str, ...], list[float]] = {}
    for row in (row for section in tries for row in section.rows):
        values.setdefault(_key(row), []).append(row.bounded)
    rows = []
    for row in tries[-1].rows:
        middle = statistics.median(values[_key(row)])
        rows.append(replace(row, figure=middle) if row.ratio is None else replace(row, ratio=middle))
    return replace(tries[-1], rows=tuple(rows))


def report(name: str, written: Section, found: Sequence[Comparison], tries: Sequence[Section]) -> str:
    """A line, one for each ratio that is worse, and what else than the code may be the reason."""
    worse = [it for it in found if it.worse]
    commit, count = written.commit, len(tries)
    lines = [f"{name}: {len(found)} ratios, measured {count} times, {len(worse)} worse than at commit {commit}"]
    for it in worse:
        unit = it.row.unit if it.row.ratio is None else f"× {it.row.yardstick}"
        other, overlap = number(it.row.bounded), "" if it.clear else " (quartiles overlap what is allowed)"
        lines.append(f"  {it.row.topic}: {it.row.case}: {number(it.ratio)} {unit}, there {other}{overlap}")
    # Older pages have no number of the processor's model.
    if worse and not {*written.processor.split()} <= {*tries[-1].processor.split()}:
        lines.append(f"  the page is of another processor, {written.processor}; this one is {tries[-1].processor}")
    if worse and (busy := max(section.busy for section in tries)) > QUIET:
        lines.append(f"  other work kept up to {busy:g} cores busy")
    return "\n".join(lines)


def _factor(row: Row, ratio: float) -> float:
    """How many times worse than the row's a ratio is."""
    return ratio / row.bounded if row.best == "less" else row.bounded / ratio


def _key(row: Row) -> tuple[str, ...]:
    return row.topic, row.case, row.yardstick
