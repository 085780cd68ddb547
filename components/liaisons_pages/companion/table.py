"""The table of both texts, ``texts.toml``, as entries: one for each number."""

from __future__ import annotations

import tomllib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Any

TITLES = {"K": "Kneller, Mécanique analytique", "M": "Marle, Géométrie des systèmes mécaniques à liaisons actives"}
KINDS = {"equations": "eq. ", "examples": "Ex. ", "figures": "Fig. ", "propositions": "prop. ", "statements": ""}
"""Kinds of entries, and how a citation begins after the letter of the text."""


@dataclass(frozen=True)
class TextSection:
    """A section of a text: its title in English and in French, first and last of its equations and examples."""

    text: str
    number: str
    says: str
    french: str
    equations: tuple[int, ...] = ()
    examples: tuple[int, ...] = ()

    @property
    def citation(self) -> str:
        """Citation of the section: "K 2.1"."""
        return f"{self.text} {self.number}"

    def contains(self, entry: Entry) -> bool:
        """Whether an entry stands in the section."""
        number, _, _ = entry.number.partition(",")
        if entry.text != self.text:
            return False
        if entry.kind in {"equations", "examples"} and number.isdecimal():
            span = getattr(self, entry.kind)
            return bool(span) and span[0] <= int(number) <= span[1]
        return entry.kind != "figures" and f"{number}.".startswith(f"{self.number}.")


@dataclass(frozen=True, eq=False)
class Entry:
    """A number of one of the texts.

    :ivar group: the range of numbers that share everything but the formula, or the number.
    :ivar formulas: in LaTeX, corrected.
    :ivar printed: in LaTeX, as they stand in the text, where that is wrong.
    :ivar corrections: what is wrong in the text, by numbers of the errata; ``conditions``: where it holds.
    :ivar lives: components, functions and methods; ``by``: scenarios, and tests as "directory/file::function".
    :ivar part: part of the displayed equations.
    :ivar no: why it is no formula to be run.
    """

    text: str
    kind: str
    number: str
    group: str
    says: str
    french: str
    formulas: tuple[str, ...]
    printed: tuple[str, ...] = ()
    corrections: Mapping[str, str] = field(default_factory=dict)
    conditions: Mapping[str, str] = field(default_factory=dict)
    remarks: Mapping[str, str] = field(default_factory=dict)
    lives: tuple[str, ...] = ()
    by: tuple[str, ...] = ()
    part: str = ""
    no: str = ""

    @property
    def citation(self) -> str:
        """Citation of the number: "K eq. 10", "K Ex. 9", "M 8.1"."""
        return self._citation_of(self.number)

    @property
    def group_citation(self) -> str:
        """Citation of the range that the number belongs to: "K eq. 10-13"."""
        return self._citation_of(self.group)

    @property
    def anchor(self) -> str:
        """Anchor of the entry's row on the page ``reference/texts``."""
        return f"{self.text}-{self.kind}-{self.number.replace(', ', '-').replace(' ', '-')}"

    @property
    def scenarios(self) -> tuple[str, ...]:
        """Names of the scenarios that verify the entry."""
        return tuple(check for check in self.by if "::" not in check)

    def _citation_of(self, number: str) -> str:
        """Citation of a number of this kind: "K Ex. 9"."""
        return f"{self.text} {'' if '.' in number and self.kind == 'examples' else KINDS[self.kind]}{number}"


@cache
def _parsed_table() -> dict[str, dict[str, dict[str, dict[str, Any]]]]:
    """Contents of ``texts.toml``: text -> kind -> number -> row."""
    return tomllib.loads(Path(__file__).with_name("texts.toml").read_text(encoding="utf-8"))


@cache
def entries() -> tuple[Entry, ...]:
    """All numbered entries of both texts, in the order of the table."""
    return tuple(
        entry
        for text, kinds in _parsed_table().items()
        for kind in KINDS
        for group, row in kinds.get(kind, {}).items()
        for entry in _entries_of_row(text, kind, group, row)
    )


@cache
def sections() -> tuple[TextSection, ...]:
    """All sections of both texts; subsections come after their section."""
    spans = ("equations", "examples")
    return tuple(
        TextSection(text, number, row["says"], row["french"], *(tuple(row.get(span, ())) for span in spans))
        for text, kinds in _parsed_table().items()
        for number, row in kinds["sections"].items()
    )


def _entries_of_row(text: str, kind: str, group: str, row: Mapping[str, Any]) -> Iterator[Entry]:
    """Yield the entries of a row of the table: one for each number of a range, with one formula each."""
    content: dict[str, Any] = {k: tuple(v) if isinstance(v, list) else v for k, v in row.items()}
    first, _, last = group.partition("-")
    if not (first.isdecimal() and last.isdecimal()):
        yield Entry(text, kind, group, group, **content)
        return
    numbers = range(int(first), int(last) + 1)
    for number, formula in zip(numbers, content.pop("formulas"), strict=True):
        yield Entry(text, kind, str(number), group, formulas=(formula,), **content)
