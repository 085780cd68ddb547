"""The catalogue: of each component the page that lies in its FMU, and from it the picture and the formula."""

from __future__ import annotations

import multiprocessing
import os
import re
from concurrent.futures import ProcessPoolExecutor
from html import escape
from pathlib import Path
from typing import NamedTuple
from zipfile import ZipFile

from sphinx.application import Sphinx

from liaisons import fmu_path
from liaisons.language import Operator
from liaisons.library import catalogue

_STYLE = ".frame { fill: none } polyline { fill: none; stroke-width: 6 } text { display: none }"
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
    """Write ``reference/catalogue.md``, a picture of each component, and the pages of the FMUs."""
    folder, live = Path(app.outdir) / "catalogue", Path(app.outdir) / "gallery" / "live"
    folder.mkdir(parents=True, exist_ok=True)
    with ProcessPoolExecutor(os.cpu_count(), multiprocessing.get_context("spawn")) as pool:
        rows = list(pool.map(write_component, catalogue(), [folder] * len(catalogue())))
    alive = {path.stem for path in live.glob("*.html")}
    text = [
        "# Catalogue",
        "Each name leads to the page in its FMU: equations, variables, ports.  `liaisons list` prints all of them.",
    ]
    for title, operators in (("Mechanisms", False), ("Operators", True)):
        lines = "\n".join(_row(row, row.name in alive) for row in rows if row.operator is operators)
        text += [f"## {title}", f'<table class="catalogue">\n{lines}\n</table>']
    page = Path(app.srcdir) / "reference" / "catalogue.md"
    page.write_text("\n\n".join(text) + "\n", encoding="utf-8")


def write_component(name: str, folder: Path) -> Row:
    """Write picture and page of a component."""
    component = catalogue()[name]
    is_operator = issubclass(component, Operator)
    with ZipFile(fmu_path(name)) as archive:
        page = archive.read("documentation/index.html").decode()
        icon = archive.read("terminalsAndIcons/icon.svg").decode()
    (folder / f"{name}.html").write_text(page, encoding="utf-8")
    drawn = re.search(r'<svg class="figure"(.*?</svg>)', page, re.DOTALL)
    picture = drawn[1].replace(">", f"><style>{_STYLE}</style>", 1) if drawn else ""
    alone = f'<svg xmlns="http://www.w3.org/2000/svg"{picture}' if picture else icon
    (folder / f"{name}.svg").write_text(alone, encoding="utf-8")
    found = re.search(r"<div class=equations>(.*?)</div>", page, re.DOTALL)
    first = found[1] if found else ""
    formula = re.sub(r"</?p[^>]*>", " ", first.partition("<p>where</p>")[0] if is_operator else first).strip()
    return Row(name, component.summary(), formula if len(formula) < LONGEST else "", is_operator)


def _row(row: Row, alive: bool) -> str:
    live = f' <a href="../gallery/live/{row.name}.html">live</a>' if alive else ""
    page = f"../catalogue/{row.name}.html"
    formula = row.formula or f'<a href="{page}">more on its page</a>'
    return (
        f'<tr><td><a href="{page}"><img src="../catalogue/{row.name}.svg" alt="" loading="lazy"></a></td>'
        f'<td><a href="{page}"><b>{row.name}</b></a>{live}<br>{escape(row.summary)}<div>{formula}</div></td></tr>'
    )
