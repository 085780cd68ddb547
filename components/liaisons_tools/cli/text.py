"""``liaisons text``: from a number of the two texts to what verifies it."""

from __future__ import annotations

import textwrap
from collections.abc import Iterator, Mapping
from typing import Annotated

import typer

from liaisons_pages.companion import (
    TITLES,
    Entry,
    completions,
    entries_of,
    is_text_number,
    search_entries,
    sections,
    unicode_text,
)
from liaisons_tools.cli._command import command, flag, print_table, terminal_width
from liaisons_tools.cli._texts import entry_components, verification_command

_MARGIN = 12


@command("""
    liaisons text K122                                  Kneller, equation 122
    liaisons text K Ex. 9
    liaisons text M50-53 --latex
    liaisons text "M 8.4"                               Marle, example 8.4
    liaisons text M 3.5                                 all numbers of a section
    liaisons text KA2                                   a number of the errata
    liaisons text viriel                                in French or English
    liaisons text Pendulum                              all numbers that a component implements
    liaisons text                                       the sections of both texts
""")
def text(
    words: Annotated[
        list[str] | None,
        typer.Argument(
            metavar="NUMBER|WORDS",
            autocompletion=completions,
            help="a number of Kneller (K) or Marle (M), a range, or words to search for (default: list the sections)",
        ),
    ] = None,
    *,
    latex: Annotated[bool, flag("--latex", "print formulas as LaTeX, for a document")] = False,
) -> int:
    """Look up a number of the two texts: its corrected formula, where it is implemented, and what verifies it."""
    name = " ".join(words or ())
    if not name:
        print_table({"section": s.citation, "is about": s.says, "in the text": s.french} for s in sections())
        return 0
    if not is_text_number(name):
        rows = {entry.group_citation: entry for entry in search_entries(name)}
        print_table({"number": number, "says": e.says, "in the text": e.french} for number, e in rows.items())
        return 0
    print("\n\n".join("\n".join(_entry_lines(entry, latex=latex)) for entry in entries_of(name)))
    return 0


def _entry_lines(entry: Entry, *, latex: bool) -> Iterator[str]:
    """Yield lines with all that the table of the texts has on a number."""
    section = [s for s in sections() if s.contains(entry)][-1:]
    head = "; ".join([TITLES[entry.text], *(f"section {s.number}, {s.french}" for s in section)])
    yield from textwrap.wrap(f"{entry.citation}   {head}", terminal_width(), subsequent_indent=" " * _MARGIN)
    yield ""
    written = (lambda formula: formula) if latex else unicode_text
    for formula in entry.formulas:
        yield f"    {written(formula)}"
    yield ""
    yield from _labelled_lines("says", f"{entry.says} ({entry.french})")
    yield from _note_lines("misprint", entry.corrections)
    for formula in entry.printed:
        yield from _labelled_lines("printed", written(formula))
    yield from _note_lines("holds if", entry.conditions)
    yield from _note_lines("remark", entry.remarks)
    if entry.no:
        yield from _labelled_lines("not run", entry.no)
    yield from _labelled_lines("lives in", ", ".join(entry.lives) or "nothing of ours")
    part = f" --part {entry.part}" if entry.part else ""
    for i, component in enumerate(entry_components(entry)):
        yield f"{'' if i else 'equations':{_MARGIN}}liaisons equations {component}{part}"
    for i, check in enumerate(entry.by):
        yield f"{'' if i else 'verified by':{_MARGIN}}{verification_command(check)}"
    yield from _labelled_lines("page", f"reference/texts.html#{entry.anchor}")


def _note_lines(head: str, notes: Mapping[str, str]) -> Iterator[str]:
    """Yield lines of notes with the numbers of their errata, the first behind a head."""
    for i, (erratum, note) in enumerate(notes.items()):
        yield from _labelled_lines("" if i else head, f"{note} [{erratum}]")


def _labelled_lines(head: str, content: str) -> Iterator[str]:
    """Yield lines of a content behind a head, wrapped to the width of the terminal."""
    yield from textwrap.wrap(
        content,
        terminal_width(),
        initial_indent=head.ljust(_MARGIN),
        subsequent_indent=" " * _MARGIN,
        break_long_words=False,
        break_on_hyphens=False,
    )
