"""What a site needs where it is put online: ``sitemap.xml``, and a ``404.html`` that is whole under any address.

Both take the site's address, ``-D html_baseurl=https://example.org/liaisons/``.  All other links are relative.
"""

from __future__ import annotations

from html import escape
from pathlib import Path
from typing import Any

from sphinx.application import Sphinx

NOT_FOUND = "404"


def setup(app: Sphinx) -> None:
    """Write them with the pages."""
    app.connect("html-page-context", resolve_from_root)
    app.connect("build-finished", write_sitemap)


def resolve_from_root(app: Sphinx, pagename: str, templatename: str, context: dict[str, Any], doctree: Any) -> None:
    """Let links of the 404 page start at the root of the site, as it is shown in place of pages in any folder."""
    if pagename == NOT_FOUND and address(app):
        context["metatags"] += f'<base href="{escape(address(app))}">'


def write_sitemap(app: Sphinx, exception: Exception | None) -> None:
    """Write the addresses of all pages; and ``.nojekyll``, without which GitHub Pages leaves out ``_static``."""
    if exception is not None or app.builder.format != "html":
        return
    (Path(app.outdir) / ".nojekyll").touch()
    if address(app):
        pages = [app.builder.get_target_uri(name) for name in sorted(app.env.found_docs) if name != NOT_FOUND]
        lines = "\n".join(f"<url><loc>{escape(address(app) + page)}</loc></url>" for page in pages)
        text = f'<urlset xmlns="http://www.sitemaps.org/schemas/sitemap/0.9">\n{lines}\n</urlset>\n'
        (Path(app.outdir) / "sitemap.xml").write_text(f'<?xml version="1.0" encoding="UTF-8"?>\n{text}', "utf-8")


def address(app: Sphinx) -> str:
    """Where the site will be, with a slash at its end; empty if that was not said."""
    return app.config.html_baseurl and app.config.html_baseurl.rstrip("/") + "/"
