"""Both texts, line by line, on the site: everything that is named exists, every number has a place of its own."""

from __future__ import annotations

import re
from pathlib import Path
from types import ModuleType

import pytest

import liaisons
from liaisons.base.project import load_module
from liaisons.library import catalogue
from liaisons.scenario_files import scenario_files
from liaisons_motion import analysis
from liaisons_pages.companion import entries


@pytest.fixture(scope="module")
def texts() -> ModuleType:
    pytest.importorskip("sphinx", reason="the documentation is built by Sphinx: pip install 'liaisons[docs]'")
    return load_module(Path(__file__).parents[2] / "docs" / "texts.py")


@pytest.fixture(scope="module")
def page(texts: ModuleType) -> str:
    return texts.page(list(scenario_files()))


def test_what_is_named_exists(texts: ModuleType) -> None:
    for entry in entries():
        for name in entry.lives:
            texts.resolve(name)
        for check in entry.by:
            texts.source(check)
    with pytest.raises(AttributeError, match="Pendulums"):
        texts.resolve("Pendulums")
    with pytest.raises(LookupError, match="has no such test"):
        texts.source("catalogue/test_hoops::test_nothing")
    with pytest.raises(KeyError, match="no_scenario"):
        texts.source("no_scenario")


@pytest.mark.variants(core=0)
def test_links_of_the_page_lead_somewhere(texts: ModuleType, page: str) -> None:
    links = {link for link in re.findall(r'href="([^"]*)"', page) if not link.startswith("#")}
    places = {f"../catalogue/{name}.html" for name in catalogue()} | {
        f"../gallery/{name}.html" for name in scenario_files()
    }
    places |= {f"api.html#liaisons.analysis.{name}" for name in analysis.__all__}
    places |= {f"api.html#liaisons.{name}" for name in vars(liaisons)["__all__"]}
    for file in {check.partition("::")[0] for entry in entries() for check in entry.by if "::" in check}:
        source = texts.source_page(file)
        places |= {f"../texts/{file.replace('/', '-')}.html#{name}" for name in re.findall(r'<a id="(\w+)">', source)}
        assert f"include}} ../../tests/{file}.py" in source
    assert links <= places
    assert "../gallery/holders_principle.html" in links
    assert "../texts/catalogue-test_hoops.html#test_hoop_has_the_lagrangian_of_equation_61_with_its_dots" in links
    assert "../gallery/" not in texts.page([])
    assert "| Pendulum | 2 | 4 | M eq. 45-47, on V*M |" in page
    assert "| Swing | 3 | 3 | M eq. 36-38, on T*M |" in page


def test_each_number_has_a_place_and_a_formula(page: str) -> None:
    rows = re.findall(r'<tr id="([^"]*)"><td><a href="#\1">([^<]*)</a></td><td>(.*?)</td>', page)
    assert [(anchor, number) for anchor, number, _ in rows] == [(entry.anchor, entry.number) for entry in entries()]
    assert len({anchor for anchor, _, _ in rows}) == len(rows)
    assert all(formula.count("<math") == len(e.formulas) for (_, _, formula), e in zip(rows, entries(), strict=True))


def test_a_range_shares_its_cells_and_notes_are_named(page: str) -> None:
    rows = dict(re.findall(r'<tr id="([^"]*)">(.*?)</tr>', page))
    assert 'rowspan="4"' in rows["K-equations-10"]
    assert rows["K-equations-11"].count("<td") == 2
    assert "Misprint: √(ω_0² - γ²/2)" in rows["K-equations-122"]
    assert "Holds if: B is uniform" in rows["K-equations-26"]
    assert "Misprint" not in rows["K-equations-26"]
    assert "Printed: <math" in rows["M-equations-61"]


def test_pages_of_components_scenarios_and_functions_lead_back(texts: ModuleType) -> None:
    link = '<a href="../reference/texts.html#{}">{}</a>'
    assert link.format("K-examples-10", "K Ex. 10") in texts.links("IsokineticOscillator")
    assert link.format("K-equations-118", "K eq. 118-119") in texts.links("resonance")
    assert texts.links("Quintic") == ""
    lines = ["Says."]
    texts._numbers_of_a_function(None, "function", "liaisons.analysis.active_energy", None, None, lines)
    assert "`M eq. 51 <texts.html#M-equations-51>`__" in lines[2]
    texts._numbers_of_a_function(None, "function", "liaisons.simulate", None, None, other := [])
    assert other == []


def test_tolerances_are_those_that_are_applied(texts: ModuleType) -> None:
    assert texts.tolerances("phase_space_cloud")
    rotations = "motion/analysis/test_symmetry::test_rotations_conserve_angular_momentum"
    assert texts.tolerances(rotations) == [1e-13]  # ROUNDING
    assert texts.tolerances("catalogue/test_newton::test_motion_and_operator_forces_are_those_of_newton") == [1e-12]
    file = "kernel/mechanics/test_constraints"
    found = texts.tolerances(f"{file}::test_dalembert_gauss_and_the_null_space_give_one_motion")
    assert found == [1e-12, 1e-11]  # times sizes


@pytest.mark.parametrize(
    ("words", "anchor"),
    [
        ("K122", "K-equations-122"),
        ("K Ex. 9", "K-examples-9"),
        ("M eq. 27", "M-equations-27"),
        ("M 8.4", "M-examples-8.4"),
        ("M prop. 7", "M-propositions-7-theorem"),
        ("KA2", "K-equations-122"),
        ("viriel", "K-equations-68"),
        ("cerceau", "M-equations-61"),
    ],
)
def test_searches_of_the_site_lead_to_a_row(words: str, anchor: str, texts: ModuleType, page: str) -> None:
    assert texts.index_entries()[words] == anchor
    assert f'<tr id="{anchor}">' in page


def test_subscripts_stand_beside_dotted_letters(texts: ModuleType) -> None:
    def markup(latex: str) -> str:
        return "".join(line.strip() for line in texts.mathml.markup(latex).splitlines())

    dotted = '<msub><mover><mi>r</mi><mo stretchy="false">¨</mo></mover><mi>α</mi></msub>'
    assert dotted in markup(r"\ddot{r}_\alpha")
    assert "<munderover>" in markup(r"\sum_{i=1}^n p_i")
    assert "x\N{NO-BREAK SPACE}y" in re.sub("<.*?>", "", markup(r"x ~ y"))
