"""The built site can be put under any address: a sitemap, and a 404 page whose links start at the root."""

from __future__ import annotations

import re
from pathlib import Path
from types import ModuleType
from xml.etree import ElementTree

import pytest

from liaisons.base.project import load_module

DOCS = Path(__file__).parents[2] / "docs"
PAGES = {
    "index": "First\n=====\n\n:doc:`a/b`\n",
    "a/b": "Second\n======\n",
    "404": "No such page\n============\n\n:doc:`index`\n",
}


@pytest.fixture(scope="module")
def hosting() -> ModuleType:
    pytest.importorskip("sphinx", reason="the documentation is built by Sphinx: pip install 'liaisons[docs]'")
    return load_module(DOCS / "hosting.py")


def built(hosting: ModuleType, folder: Path, base: str) -> Path:
    """A site of three pages."""
    from sphinx.application import Sphinx

    for name, text in PAGES.items():
        path = folder / f"{name}.rst"
        path.parent.mkdir(exist_ok=True)
        path.write_text(f":orphan:\n\n{text}", encoding="utf-8")
    options = {"html_theme": "furo", "html_baseurl": base}
    app = Sphinx(folder, None, folder / "out", folder / "trees", "html", options, status=None, warning=None)
    hosting.setup(app)
    app.build()
    return folder / "out"


@pytest.mark.parametrize("base", ["https://example.org/liaisons/", "https://example.org/liaisons"])
def test_sitemap_and_404_take_the_address(hosting: ModuleType, tmp_path: Path, base: str) -> None:
    site = built(hosting, tmp_path, base)
    found = ElementTree.parse(site / "sitemap.xml").findall("{*}url/{*}loc")
    assert {place.text for place in found} == {f"https://example.org/liaisons/{page}.html" for page in ("index", "a/b")}
    head = re.findall(r'(?:href|src)="[^"]*"', (site / "404.html").read_text(encoding="utf-8"))
    assert head[0] == 'href="https://example.org/liaisons/"'  # before all that it is the base of
    assert "<base" not in (site / "a" / "b.html").read_text(encoding="utf-8")
    assert (site / ".nojekyll").exists()


def test_without_an_address_there_is_no_sitemap(hosting: ModuleType, tmp_path: Path) -> None:
    site = built(hosting, tmp_path, "")
    assert not (site / "sitemap.xml").exists()
    for page in ("404", "index", "a/b"):
        assert not re.search(r'(?:href|src)="/|<base', (site / f"{page}.html").read_text(encoding="utf-8"))
