"""The catalogue: of each component the page that lies in its FMU, as a page of the site; from it picture, formula."""

from __future__ import annotations

import multiprocessing
import os
import re
from collections.abc import Collection
from concurrent.futures import ProcessPoolExecutor
from html import escape
from pathlib import Path
from typing import NamedTuple
from zipfile import ZipFile

from sphinx.application import Sphinx

import texts
from liaisons.language import Operator
from liaisons.library import catalogue, fmu_file

_STYLE = ".frame { fill: none } polyline { fill: none; stroke-width: 6 } text { display: none }"
FENCE = "`" * 8
LONGEST = 6000
"""Characters of markup of a formula in the table; longer ones stand on their page."""


class Row(NamedTuple):
    """What the catalogue says of a component."""

    name: str
    summary: str
    formula: str
    operator: bool


def setup(app: Sphinx) -> None:
    """Write the page before it is read, after the gallery's, whose live pages it names."""
    app.connect("builder-inited", write_catalogue, priority=600)


def write_catalogue(app: Sphinx) -> None:
    """Write ``reference/catalogue.md``, and of each component a picture and a page."""
    pages, shown = Path(app.srcdir) / "catalogue", Path(app.outdir) / "catalogue"
    alive = {path.stem for path in (Path(app.outdir) / "gallery" / "live").glob("*.html")}
    for folder in (pages, shown):
        folder.mkdir(parents=True, exist_ok=True)
    for page in pages.glob("*.md"):
        page.unlink()
    names = list(catalogue())
    with ProcessPoolExecutor(os.cpu_count(), multiprocessing.get_context("spawn")) as pool:
        rows = list(pool.map(write_component, names, [pages] * len(names), [shown] * len(names), [alive] * len(names)))
    text = [
        "# Catalogue",
        "The pages are also in the FMUs: equations, variables, ports.  `liaisons list` prints all names.",
    ]
    for title, operators in (("Mechanisms", False), ("Operators", True)):
        chosen = [row for row in rows if row.operator is operators]
        lines = "\n".join(_row(row, row.name in alive) for row in chosen)
        tree = "\n".join(f"../catalogue/{row.name}" for row in chosen)
        text += [
            f"## {title}",
            f'<table class="catalogue">\n{lines}\n</table>',
            f"```{{toctree}}\n:hidden:\n\n{tree}\n```",
        ]
    page = Path(app.srcdir) / "reference" / "catalogue.md"
    page.write_text("\n\n".join(text) + "\n", encoding="utf-8")


def write_component(name: str, pages: Path, shown: Path, alive: Collection[str]) -> Row:
    """Write page and picture of a component.

    :param alive: those that have a live page.
    """
    component = catalogue()[name]
    is_operator = issubclass(component, Operator)
    with ZipFile(fmu_file(name)) as archive:
        page = archive.read("documentation/index.html").decode()
        icon = archive.read("terminalsAndIcons/icon.svg").decode()
    numbers = texts.links(name)
    text = page_of_the_site(name, component.summary(), page, live=name in alive, numbers=numbers)
    (pages / f"{name}.md").write_text(text, encoding="utf-8")
    drawn = re.search(r'<svg class="figure"(.*?</svg>)', page, re.DOTALL)
    picture = drawn[1].replace(">", f"><style>{_STYLE}</style>", 1) if drawn else ""
    alone = f'<svg xmlns="http://www.w3.org/2000/svg"{picture}' if picture else icon
    (shown / f"{name}.svg").write_text(alone, encoding="utf-8")
    found = re.search(r"<div class=equations>(.*?)</div>", page, re.DOTALL)
    first = found[1] if found else ""
    formula = re.sub(r"</?p[^>]*>", " ", first.partition("<p>where</p>")[0] if is_operator else first).strip()
    return Row(name, component.summary(), formula if len(formula) < LONGEST else "", is_operator)


def page_of_the_site(name: str, summary: str, page: str, *, live: bool, numbers: str = "") -> str:
    """The sections of an FMU's page as Markdown.

    Main entries of the index come first in a search: the name as one word and in words.

    :param numbers: links to what the component has of both texts.
    """
    entries = dict.fromkeys((name, re.sub(r"(?<=[a-z])(?=[A-Z])", " ", name)))
    link = f'\n<p><a href="../gallery/live/{name}.html">Live page</a></p>' if live else ""
    parts = [
        "\n".join(f"```{{index}} single: !{entry}\n```" for entry in entries),
        f"# {name}",
        f"<p>{escape(summary)}</p>{link}",
        *([f"<p>Has {numbers}.</p>"] if numbers else []),
    ]
    for title, body in re.findall(r"<section id=[^>]*><h2>(.*?)</h2>\n(.*?)</section>", page, re.DOTALL):
        parts.append(f'## {title}\n\n{FENCE}{{raw}} html\n<div class="component">\n{body}</div>\n{FENCE}')
    return "\n\n".join(parts) + "\n"


def _row(row: Row, alive: bool) -> str:
    live = f' <a href="../gallery/live/{row.name}.html">live</a>' if alive else ""
    page = f"../catalogue/{row.name}.html"
    formula = row.formula or f'<a href="{page}">more on its page</a>'
    return (
        f'<tr><td><a href="{page}"><img src="../catalogue/{row.name}.svg" alt="" loading="lazy"></a></td>'
        f'<td><a href="{page}"><b>{row.name}</b></a>{live}<br>{escape(row.summary)}<div>{formula}</div></td></tr>'
    )
