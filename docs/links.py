"""After the build: links inside the site end somewhere, no page fetches anything or shows where it was built."""

from __future__ import annotations

from functools import cache
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urlsplit

from sphinx.application import Sphinx
from sphinx.errors import ExtensionError
from sphinx.util import logging

_FETCHED = {"script": "src", "img": "src", "iframe": "src", "source": "src", "video": "src", "link": "href"}


class _Page(HTMLParser):
    """What a page links to, what it fetches, and the places in it that can be linked to."""

    def __init__(self, path: Path) -> None:
        super().__init__()
        self.targets: set[str] = set()
        self.fetched: set[str] = set()
        self.places: set[str] = set()
        self.feed(path.read_text(encoding="utf-8"))

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        given = {name: value for name, value in attrs if value}
        self.places |= {given[name] for name in ("id", "name") if name in given}
        if tag == "a" and "href" in given:
            self.targets.add(given["href"])
        if tag in _FETCHED and _FETCHED[tag] in given and given.get("rel") != "canonical":
            self.fetched.add(given[_FETCHED[tag]])


def setup(app: Sphinx) -> None:
    """Look at the pages when they are written."""
    app.connect("build-finished", _check, priority=900)


def _check(app: Sphinx, exception: Exception | None) -> None:
    if exception is not None or app.builder.format != "html":
        return
    root = Path(app.outdir).resolve()
    pages = {path: _Page(path) for path in sorted(root.rglob("*.html"))}

    @cache
    def found(path: Path, place: str) -> bool:
        return path.exists() and (not place or path not in pages or place in pages[path].places)

    wrong, count = [], 0
    for path, page in pages.items():
        if str(Path(app.srcdir).parent) in path.read_text(encoding="utf-8"):
            wrong.append(f"{path.relative_to(root)}: shows where it was built")
        for target in page.targets | page.fetched:
            link = urlsplit(target)
            if link.scheme or link.netloc:
                if target in page.fetched and link.scheme != "data":
                    wrong.append(f"{path.relative_to(root)}: fetches {target}")
                continue
            count += 1
            end = (path.parent / unquote(link.path)).resolve() if link.path else path
            if not found(end, unquote(link.fragment)):
                wrong.append(f"{path.relative_to(root)}: {target} leads nowhere")
    if wrong:
        raise ExtensionError("\n".join(wrong))
    logging.getLogger(__name__).info("%d pages, %d links inside the site, none broken", len(pages), count)
