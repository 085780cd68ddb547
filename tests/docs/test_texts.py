"""Both texts, line by line: no number is missing, and everything that is named exists."""

from __future__ import annotations

import re
from pathlib import Path
from types import ModuleType

import pytest

from liaisons import analysis
from liaisons.base.project import load_module, scenario_files
from liaisons.library import catalogue

NUMBERS = {
    ("K", "equations"): [str(i) for i in range(1, 166)],
    ("K", "examples"): [str(i) for i in range(1, 12)],
    ("K", "figures"): [str(i) for i in range(1, 10)],
    ("M", "equations"): [str(i) for i in range(1, 68)],
    ("M", "examples"): ["8.1", "8.2", "8.3", "8.4"],
    ("M", "propositions"): ["5", "6", "7, theorem", "7, connection"],
}


@pytest.fixture(scope="module")
def texts() -> ModuleType:
    return load_module(Path(__file__).parents[2] / "docs" / "texts.py")


def test_no_number_is_missing_and_none_is_there_twice(texts: ModuleType) -> None:
    found: dict[tuple[str, str], list[str]] = {}
    for row in texts.rows():
        found.setdefault((row.text, row.kind), []).extend(row.numbers)
    assert found == NUMBERS


def test_each_number_is_verified_or_has_a_reason(texts: ModuleType) -> None:
    for row in texts.rows():
        assert row.says
        assert row.lives or row.no, f"{row.text} {row.number} lives nowhere"
        assert row.verdict != texts.NOT_YET, f"{row.text} {row.number} is verified by nothing"


def test_what_is_named_exists(texts: ModuleType) -> None:
    for row in texts.rows():
        for name in row.lives:
            texts.resolve(name)
        for check in row.by:
            texts.source(check)
    with pytest.raises(AttributeError, match="Pendulums"):
        texts.resolve("Pendulums")
    with pytest.raises(LookupError, match="has no such test"):
        texts.source("models/test_hoops::test_nothing")
    with pytest.raises(KeyError, match="no_scenario"):
        texts.source("no_scenario")


def test_links_of_the_page_lead_somewhere(texts: ModuleType) -> None:
    page = texts.page(list(scenario_files()))
    links = set(re.findall(r'href="([^"]*)"', page))
    places = {f"../catalogue/{name}.html" for name in catalogue()} | {
        f"../gallery/{name}.html" for name in scenario_files()
    }
    places |= {f"api.html#liaisons.analysis.{name}" for name in analysis.__all__}
    assert links <= places
    assert "../gallery/holders_principle.html" in links
    assert "../gallery/" not in texts.page([])
    assert "| Pendulum | 2 | 4 | M eq. 45-47, on V*M |" in page
    assert "| Swing | 3 | 3 | M eq. 36-38, on T*M |" in page


def test_tolerances_are_those_that_are_applied(texts: ModuleType) -> None:
    assert texts.tolerances("phase_space_cloud")
    assert texts.tolerances("analysis/test_symmetry::test_rotations_conserve_angular_momentum") == [1e-13]  # ROUNDING
    assert texts.tolerances("models/test_newton::test_motion_and_operator_forces_are_those_of_newton") == [1e-12]
    found = texts.tolerances("mechanics/test_constraints::test_dalembert_gauss_and_the_null_space_give_one_motion")
    assert found == [1e-12, 1e-11]  # times sizes
