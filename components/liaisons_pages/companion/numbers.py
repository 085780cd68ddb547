"""Numbers of the texts as people write them, ``K122``, ``M eq. 27``, ``Kneller Ex. 9``; and words to search by."""

from __future__ import annotations

import difflib
import re
import unicodedata
from itertools import zip_longest

from liaisons.errors import ProjectError
from liaisons_pages.companion.table import TITLES, Entry, entries, sections

_BEGINNINGS = {
    "eq": "equations",
    "form": "equations",
    "ex": "examples",
    "fig": "figures",
    "prop": "propositions",
    "th": "propositions",
    "sec": "sections",
    "par": "sections",
    "§": "sections",
}
"""Kinds by how their names begin, in either language and without accents."""

_NUMBER = re.compile(
    rf"(?P<text>kneller|marle|k|m)[\s,.]*(?:(?P<kind>{'|'.join(_BEGINNINGS)})[^\W\d_]*[\s.]*)?"
    r"\(?(?P<first>\d+(?:\.\d+)*)\.?\)?(?:\s*[-–]\s*(?P<last>\d+(?:\.\d+)*))?(?:,\s*(?P<rest>\w.*))?"
)
_ERRATUM = re.compile(r"[km][abc]\d+")

_ONE = r"\d+(?:\.\d+)*(?:-\d+(?:\.\d+)*)?"
CITATION = re.compile(rf"\b(?P<text>[KM]) (?:(?P<kind>eq|Ex|Fig|prop)\. )?(?P<numbers>{_ONE}(?:(?:, | and ){_ONE})*)\b")
"""How the project cites the texts: ``K eq. 79``, ``M eq. 36-38``, ``K Ex. 9``, ``K Fig. 5``, sections ``M 8.1``."""


def is_text_number(name: str) -> bool:
    """Whether a word has the form of a number of the texts, ``K122``, or of the errata, ``KA2``."""
    word = _without_accents(name)
    return bool(_ERRATUM.fullmatch(word) or _NUMBER.fullmatch(word))


def entries_of(name: str) -> tuple[Entry, ...]:
    """Entries that a number, range, section or erratum stands for.

    :param name: ``"K122"``, ``"Kneller 122"``, ``"M eq. 27"``, ``"M 8.4"``, ``"K120-124"``, ``"M sec. 5"``, ``"KA2"``.
    :raises ProjectError: if there is no such number; the message has the nearest ones.
    """
    word = _without_accents(name)
    if _ERRATUM.fullmatch(word):
        chosen = [e for e in entries() if word.upper() in {*e.corrections, *e.conditions, *e.remarks}]
        if not chosen:
            raise ProjectError(f"{name}: no erratum has this number; KA1 to KC13 are of Kneller, MA1 to MC7 of Marle")
        return tuple(chosen)
    match = _NUMBER.fullmatch(word)
    if match is None:
        raise ProjectError(f"{name}: this is no number of the texts; write K122, 'M eq. 27', 'K Ex. 9', 'M 8.4' or M27")
    text, kind = match["text"][0].upper(), _BEGINNINGS.get(match["kind"], "")
    first, last, rest = match["first"], match["last"], match["rest"]
    if rest:
        chosen = [e for e in entries() if e.text == text and _without_accents(e.number).startswith(f"{first}, {rest}")]
    elif kind in {"", "sections"} and (kind or "." in first) and not last:
        exact = [e for e in entries() if (e.text, e.kind, e.number) == (text, "examples", first) and not kind]
        within = [s for s in sections() if (s.text, s.number) == (text, first)]
        chosen = exact or [e for e in entries() if within and within[0].contains(e)]
        if within and not chosen:
            raise ProjectError(f"{within[0].citation}: this section has no number")
    else:
        chosen = _entries_between(text, kind or ("examples" if "." in first else "equations"), first, last or first)
    if not chosen:
        author, nearest = TITLES[text].partition(",")[0], _nearest_citations(text, kind, first, last or first)
        raise ProjectError(f"{name}: {author} has no such number; nearest: {nearest}")
    return tuple(chosen)


def search_entries(words: str) -> tuple[Entry, ...]:
    """Entries that contain all words, in English or French; those with the words as one phrase come first.

    :param words: beginnings of words; accents and capitals do not matter; names of components and scenarios, too.
    :raises ProjectError: if there is none; the message has words that are near.
    """
    beginnings = _without_accents(words).split()
    texts = {entry: _searchable_text(entry) for entry in entries()}
    chosen = [e for e, text in texts.items() if all(re.search(rf"\b{re.escape(word)}", text) for word in beginnings)]
    if not chosen:
        vocabulary = {word for text in texts.values() for word in re.findall(r"\w{3,}", text)}
        near = [x for word in beginnings for x in difflib.get_close_matches(word, vocabulary, n=2)]
        hint = f"; did you mean {' or '.join(near)}?" if near else "; `liaisons text` lists the sections"
        raise ProjectError(f"no number of the texts has {words!r}{hint}")
    phrase = " ".join(beginnings)
    return tuple(sorted(chosen, key=lambda entry: phrase not in _without_accents(f"{entry.french} / {entry.says}")))


def completions() -> list[str]:
    """All numbers in their shortest form, for completion on the command line: K122, M8.4, KEx.9."""
    short = (entry.citation.replace("eq. ", "").replace(" ", "") for entry in entries() if "," not in entry.number)
    return list(dict.fromkeys(short))


def _without_accents(text: str) -> str:
    """Text in lower case, without accents, with single spaces."""
    apart = unicodedata.normalize("NFD", text.casefold())
    return " ".join("".join(x for x in apart if not unicodedata.combining(x)).split())


def _entries_between(text: str, kind: str, first: str, last: str) -> list[Entry]:
    """Entries of a kind from one number to another; none unless both exist."""
    span = [e for e in entries() if (e.text, e.kind) == (text, kind)]
    low, high = _sort_key(first), _sort_key(last)
    heads = [_sort_key(entry.number) for entry in span]
    whole = low in heads and high in heads
    return [entry for entry, head in zip(span, heads, strict=True) if low <= head <= high] if whole else []


def _sort_key(number: str) -> tuple[int, ...]:
    """Integers of a number, as key for sorting: (8, 4) for "8.4"."""
    return tuple(map(int, re.findall(r"\d+", number.partition(",")[0])))


def _nearest_citations(text: str, kind: str, *numbers: str) -> str:
    """Citations of the two existing numbers that are nearest to the first missing one."""
    if kind == "sections" or (not kind and "." in numbers[0]):
        near = [(section.number, section.citation) for section in sections() if section.text == text]
    else:
        near = [(e.number, e.citation) for e in entries() if (e.text, e.kind) == (text, kind or "equations")]
    target = _sort_key(next((number for number in numbers if number not in dict(near)), numbers[0]))

    def distance(item: tuple[str, str]) -> list[int]:
        return [abs(a - b) for a, b in zip_longest(_sort_key(item[0]), target, fillvalue=0)]

    return ", ".join(citation for _, citation in sorted(near, key=distance)[:2])


def _searchable_text(entry: Entry) -> str:
    """All text of an entry that a search looks through, in lower case without accents."""
    titles = [f"{section.french} {section.says}" for section in sections() if section.contains(entry)][-1:]
    notes = [*entry.corrections.values(), *entry.conditions.values(), *entry.remarks.values()]
    return _without_accents(" / ".join([entry.says, entry.french, *titles, *notes, *entry.lives, *entry.scenarios]))
