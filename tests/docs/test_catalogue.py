"""A component's page of the site has every section of the page in its FMU, and comes first in a search."""

from __future__ import annotations

import re
from pathlib import Path
from types import ModuleType
from zipfile import ZipFile

import pytest

from liaisons import fmu_path
from liaisons.base.project import load_module


@pytest.fixture(scope="module")
def catalogue() -> ModuleType:
    pytest.importorskip("sphinx", reason="the documentation is built by Sphinx: pip install 'liaisons[docs]'")
    return load_module(Path(__file__).parents[2] / "docs" / "catalogue.py")


@pytest.mark.parametrize("name", ["EllipticHoop", "SmoothStep"])
def test_a_page_of_the_site_has_all_sections_of_the_fmu(catalogue: ModuleType, tmp_path: Path, name: str) -> None:
    row = catalogue.write_component(name, tmp_path, tmp_path, [name])
    with ZipFile(fmu_path(name)) as archive:
        page = archive.read("documentation/index.html").decode()
    text = (tmp_path / f"{name}.md").read_text(encoding="utf-8")
    titles = re.findall(r"<h2>(.*?)</h2>", page)
    assert "Equations" in titles
    assert re.findall(r"^## (.*)", text, re.MULTILINE) == titles
    for tag in ("<math", "<table", "<svg", "<polyline", "</p>"):
        assert text.count(tag) >= page[page.index("<section") : page.index("<footer>")].count(tag), tag
    assert f'<a href="../gallery/live/{name}.html">' in text
    assert row.summary in text
    assert (tmp_path / f"{name}.svg").read_text(encoding="utf-8").startswith("<svg")


def test_main_entries_of_the_index_are_the_name_and_its_words(catalogue: ModuleType) -> None:
    text = catalogue.page_of_the_site("SpatialCat", "", "", live=False)
    assert re.findall(r"^```\{index\} single: !(.*)", text, re.MULTILINE) == ["SpatialCat", "Spatial Cat"]
    assert "live" not in text
