"""Sources by their marks: "K eq. 61" is equation 61 of Kneller's, see ``liaisons/bibliography.md``."""

from __future__ import annotations

import re
from functools import cache
from importlib.resources import files

_ENTRY = re.compile(r"(?m)^\* \*\*(\w+)\*\* ((?:.|\n(?=  ))+)")


@cache
def bibliography() -> dict[str, str]:
    """Return the texts of the bibliography by their marks: ``"K"``, ``"M"``."""
    text = (files("liaisons") / "bibliography.md").read_text(encoding="utf-8")
    return {mark: " ".join(entry.split()) for mark, entry in _ENTRY.findall(text)}


def cited_entries(text: str) -> dict[str, str]:
    """Return the texts that a text cites, by mark; a mark of one letter needs a locator: "M 8.2", "K Ex. 3"."""
    locator = r"(?= (?:\d|eq\.|Ex\.|sec\.|fig\.|ref\.))"
    marks = {mark: rf"\b{mark}\b{locator if len(mark) == 1 else ''}" for mark in bibliography()}
    return {mark: bibliography()[mark] for mark, pattern in marks.items() if re.search(pattern, text)}
