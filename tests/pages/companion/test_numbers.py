"""Both texts, number by number: none is missing, each is found however it is written, and cited in one way."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

import pytest

from liaisons.errors import ProjectError
from liaisons_pages.companion import (
    CITATION,
    completions,
    entries,
    entries_of,
    is_text_number,
    search_entries,
    sections,
)

ROOT = Path(__file__).parents[3]
NUMBERS = {
    ("K", "equations"): [str(i) for i in range(1, 166)],
    ("K", "examples"): [str(i) for i in range(1, 12)],
    ("K", "figures"): [str(i) for i in range(1, 10)],
    ("M", "equations"): [str(i) for i in range(1, 68)],
    ("M", "examples"): ["8.1", "8.2", "8.3", "8.4"],
    ("M", "propositions"): ["5", "6", "7, theorem", "7, connection"],
}
ERRATA = {
    *(f"KA{i}" for i in range(1, 18)),
    *(f"KB{i}" for i in range(1, 19) if i != 15),  # withdrawn
    *(f"KC{i}" for i in range(1, 14)),
    *(f"MA{i}" for i in range(1, 6)),
    *(f"MB{i}" for i in range(1, 10)),
    *(f"MC{i}" for i in range(1, 8)),
}


def citations(*names: str) -> list[str]:
    return [entry.citation for name in names for entry in entries_of(name)]


def test_no_number_is_missing_and_none_is_there_twice() -> None:
    found: dict[tuple[str, str], list[str]] = {}
    for entry in entries():
        found.setdefault((entry.text, entry.kind), []).append(entry.number)
    statements = [found.pop((text, "statements")) for text in "KM"]
    assert found == NUMBERS
    assert all("," in number for numbers in statements for number in numbers)
    assert len({entry.anchor for entry in entries()}) == len(entries())


def test_each_number_has_words_in_both_languages_a_formula_and_a_verification() -> None:
    for entry in entries():
        assert entry.says, entry.citation
        assert entry.french, entry.citation
        assert entry.formulas, entry.citation
        assert entry.lives or entry.no, f"{entry.citation} lives nowhere"
        assert entry.by or entry.no, f"{entry.citation} is verified by nothing"


def test_every_erratum_is_with_its_number() -> None:
    notes = [{*e.corrections, *e.conditions, *e.remarks} for e in entries()]
    assert set.union(*notes) == ERRATA
    for entry in entries():
        assert not any(code[1] in "AB" for code in entry.remarks if code != "KB16")
        assert entry.corrections or not entry.printed, f"{entry.citation} says nothing of what is printed"


@pytest.mark.parametrize("number", ["K eq. 9", "K eq. 26", "K eq. 75", "K eq. 158", "K Ex. 10"])
def test_a_condition_is_no_misprint(number: str) -> None:
    (entry,) = entries_of(number)
    assert entry.conditions
    assert not entry.corrections


@pytest.mark.parametrize("number", ["K eq. 66", "K Fig. 7"])
def test_what_is_right_is_not_called_misprinted(number: str) -> None:
    (entry,) = entries_of(number)
    assert not entry.corrections


@pytest.mark.parametrize(
    ("written", "citation"),
    [
        ("K122", "K eq. 122"),
        ("k 122", "K eq. 122"),
        ("K eq. 122", "K eq. 122"),
        ("K (122)", "K eq. 122"),
        ("K éq. 122", "K eq. 122"),
        ("Kneller 122", "K eq. 122"),
        ("Kneller, équation 122", "K eq. 122"),
        ("M27", "M eq. 27"),
        ("Marle eq 27", "M eq. 27"),
        ("M 8.4", "M 8.4"),
        ("M exemple 8.4", "M 8.4"),
        ("M prop. 6", "M prop. 6"),
        ("K Ex. 9", "K Ex. 9"),
        ("KEx.9", "K Ex. 9"),
        ("Kneller example 9", "K Ex. 9"),
        ("K Fig. 5", "K Fig. 5"),
        ("M 5, hypothesis", "M 5, hypothesis"),
        ("K 4.2, nose", "K 4.2, Nosé-Hoover"),
        ("KA2", "K eq. 122"),
    ],
)
def test_a_number_is_found_however_it_is_written(written: str, citation: str) -> None:
    assert is_text_number(written)
    assert citations(written) == [citation]


def test_ranges_sections_and_errata_are_several_numbers() -> None:
    assert citations("K120-124") == [f"K eq. {i}" for i in range(120, 125)]
    assert citations("M 8.1–8.3") == ["M 8.1", "M 8.2", "M 8.3"]
    assert citations("K Ex. 9-10") == ["K Ex. 9", "K Ex. 10"]
    assert citations("M prop. 7") == ["M prop. 7, theorem", "M prop. 7, connection"]
    assert citations("K 2.7") == [f"K eq. {i}" for i in range(68, 76)]
    assert citations("M sec. 3.3") == ["M eq. 17", "M eq. 18"]
    assert citations("M §8.1") == ["M eq. 54", "M eq. 55", "M eq. 56", "M 8.1"]
    assert citations("K 4.2") == ["K Ex. 9", "K Ex. 10", "K 4.2, Nosé-Hoover"]
    assert citations("KB3") == ["K eq. 14", "K eq. 64"]
    assert {e.citation for e in entries() if e.text == "K" and e.kind != "figures"} == {
        *citations("K sec. 2", "K sec. 3", "K sec. 4", "K sec. 5")
    }


@pytest.mark.variants(core=7)
@pytest.mark.parametrize(
    ("written", "near"),
    [
        ("K170", "K eq. 165, K eq. 164"),
        ("K160-170", "K eq. 165, K eq. 164"),
        ("M 68", "M eq. 67, M eq. 66"),
        ("K Ex. 12", "K Ex. 11, K Ex. 10"),
        ("M 8.5", "M 8.4, M 8.3"),
        ("K 2.9", "K 2.7, K 2.6"),
        ("M sec. 9", "M 8, M 8.1"),
    ],
)
def test_an_unknown_number_is_refused_with_the_nearest(written: str, near: str) -> None:
    with pytest.raises(ProjectError, match=re.escape(f"{written}: ")) as refused:
        entries_of(written)
    author = "Kneller" if written.startswith("K") else "Marle"
    assert str(refused.value) == f"{written}: {author} has no such number; nearest: {near}"
    assert "\n" not in str(refused.value)


def test_what_is_no_number_is_refused() -> None:
    for word in ("viriel", "Kepler", "kapitza", "M foo 3", "Pendulum", "M", ""):
        assert not is_text_number(word)
        with pytest.raises(ProjectError, match="no number of the texts"):
            entries_of(word)
    with pytest.raises(ProjectError, match="M 1: this section has no number"):
        entries_of("M sec. 1")
    with pytest.raises(ProjectError, match="KA18: no erratum"):
        entries_of("KA18")


@pytest.mark.parametrize(
    ("words", "number"),
    [
        ("viriel", "K eq. 72"),
        ("Virial theorem", "K eq. 72"),
        ("escarpolette", "M eq. 56"),
        ("swing", "M 8.1"),
        ("cerceau", "M eq. 61"),
        ("hoop", "M 8.4"),
        ("pesanteur", "M eq. 54"),
        ("liaison", "M eq. 27"),
        ("moment conjugué", "K eq. 33"),
        ("moment conjugue", "K eq. 78"),
        ("conjugate momentum", "K eq. 33"),
        ("déphasage", "K eq. 123"),
        ("Liouville", "K eq. 103"),
        ("PolarOscillator", "K eq. 43"),
        ("hannay_hoop", "M eq. 64"),
    ],
)
def test_words_find_numbers_in_both_languages(words: str, number: str) -> None:
    assert number in [entry.citation for entry in search_entries(words)]


def test_a_phrase_comes_first_and_words_that_nothing_has_are_refused() -> None:
    assert search_entries("moment cinétique")[0].french.startswith("moment cinétique")
    with pytest.raises(ProjectError, match="has 'vriel'; did you mean viriel"):
        search_entries("vriel")
    with pytest.raises(ProjectError, match=r"did you mean potentiel or potential\?"):  # two, of all that are near
        search_entries("potentil")
    with pytest.raises(ProjectError, match="lists the sections"):
        search_entries("xyzzyx")


def test_completions_are_numbers() -> None:
    assert {"K1", "K165", "M67", "M8.4", "KEx.11", "KFig.9", "Mprop.6"} <= set(completions())
    assert all(citations(name) for name in completions())


# ---- citations ---------------------------------------------------------------------------------------------------

OTHERWISE = re.compile(
    r"\b(?:Kneller|Marle)(?:'s|,)? (?:eqs?|Ex|Fig|prop|sec)?\.? ?\d"
    r"|\b[KM],? (?:eqs|Eqs?|equations?|ex|examples?|fig|sec|§)\b\.? ?\d"
)
"""Citations as they are not written."""


GENERATED = {"gallery", "catalogue", "texts", "commands.md", "catalogue.md", "texts.md", "crossings.md"}
"""Pages that the site's build writes."""


def cited(text: str) -> Iterator[str]:
    for match in CITATION.finditer(text):
        for number in re.findall(r"[\d.]*\d", match["numbers"]):
            yield f"{match['text']} {match['kind'] or 'sec'}. {number}"


def files() -> Iterator[Path]:
    places = [ROOT / name for name in ("components", "scenarios", "docs", "tests")]
    for path in [
        *(path for place in places for path in place.rglob("*")),
        ROOT / "README.md",
        ROOT / "CONTRIBUTING.md",
    ]:
        own = {"companion", "_build", "figures", *GENERATED} & {*path.relative_to(ROOT).parts}
        if path.suffix in {".py", ".pyi", ".md", ".toml", ".c", ".h"} and not own:
            yield path


def test_every_citation_is_of_a_number_that_there_is() -> None:
    known = {f"{section.text} sec. {section.number}" for section in sections()}
    count = 0
    for path in files():
        text = path.read_text(encoding="utf-8")
        for citation in cited(text):
            count += 1
            if citation not in known:
                try:
                    entries_of(citation)
                except ProjectError as error:
                    pytest.fail(f"{path.relative_to(ROOT)}: {error}")
    assert count > 500


def test_citations_are_written_in_one_way() -> None:
    found = [
        f"{path.relative_to(ROOT)}: {match[0]}"
        for path in files()
        if path.name != "test_text.py"
        for match in OTHERWISE.finditer(path.read_text(encoding="utf-8"))
    ]
    assert found == []


def test_citations_that_are_wrong_would_be_seen() -> None:
    assert list(cited("as K eq. 79-80, 85 and M 8.1 say")) == ["K eq. 79", "K eq. 80", "K eq. 85", "M sec. 8.1"]
    assert OTHERWISE.search("Marle 8.4")
    assert OTHERWISE.search("Kneller's eq. 122")
    assert not OTHERWISE.search("Kneller, Mécanique analytique")
