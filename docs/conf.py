"""The site: ``sphinx-build docs docs/_build/html``; what is doubtful is a warning, and CI takes no warning."""

from __future__ import annotations

import os
import sys
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from sphinx.application import Sphinx
from sphinx.environment import BuildEnvironment

DOCS = Path(__file__).parent
sys.path.insert(0, str(DOCS))

import catalogue  # noqa: E402
import crossing_table  # noqa: E402
import gallery  # noqa: E402
import hosting  # noqa: E402
import links  # noqa: E402
import mathml  # noqa: E402
import reference  # noqa: E402
import texts  # noqa: E402
from liaisons import __version__  # noqa: E402

project = "liaisons"
project_copyright = "the liaisons authors"
version = release = __version__
extensions = ["myst_nb", "sphinx.ext.autodoc"]
exclude_patterns = ["_build", "_ipython", "README.md"]
nitpicky = True
nitpick_ignore_regex = [("py:.*", pattern) for pattern in reference.ELSEWHERE]

# Notebooks are run anew, each in an empty folder; a cell or a command that fails fails the build.
nb_execution_mode = "force"
nb_execution_in_temp = True
nb_execution_show_tb = True
nb_execution_timeout = 120
nb_merge_streams = True
nb_code_prompt_show = nb_code_prompt_hide = "the lines that made it"
nb_execution_excludepatterns = [] if find_spec("ecospy") and find_spec("libcosimpy") else ["tutorials/other-tools.md"]
suppress_warnings = ["myst-nb.lexer"]  # of notebooks that are not run
(DOCS / "_build" / "fmus").mkdir(parents=True, exist_ok=True)
os.environ |= {
    "IPYTHONDIR": str(DOCS / "_ipython"),
    "LIAISONS_FMUS": str(DOCS / "_build" / "fmus"),
    "COLUMNS": "88",
}

myst_enable_extensions = ["colon_fence", "deflist", "dollarmath"]
myst_heading_anchors = 3
html_math_renderer = "mathml"

autodoc_member_order = "bysource"
autodoc_typehints = "none"
autodoc_default_options = {"members": True}

html_theme = "furo"
html_title = "liaisons"
html_static_path = ["_static"]
html_css_files = ["site.css"]
html_copy_source = False
html_show_sphinx = False
html_theme_options: dict[str, Any] = {"navigation_with_keys": True}
templates_path: list[str] = []


def setup(app: Sphinx) -> None:
    """Connect what this site adds to Sphinx."""
    gallery.setup(app)
    catalogue.setup(app)
    crossing_table.setup(app)
    mathml.setup(app)
    reference.setup(app)
    texts.setup(app)
    hosting.setup(app)
    links.setup(app)
    app.connect("env-before-read-docs", spread_notebooks)


def spread_notebooks(app: Sphinx, env: BuildEnvironment, names: list[str]) -> None:
    """Put long pages where they are read early, so that no core waits for the last of them.

    With ``--jobs``, Sphinx cuts the list into some nine parts.  It begins with the first two, then goes back from the
    last.
    """
    cells = {name: env.doc2path(name).read_text(encoding="utf-8").count("{code-cell}") for name in names}
    long = sorted((name for name in names if cells[name] or name == "reference/api"), key=lambda name: -cells[name])
    pages, half = [name for name in names if name not in long], len(long) // 2
    for i, name in enumerate(long):
        part = 0.2 * i / half if i < half else 0.4 + 0.6 * ((i - half) / (len(long) - half)) ** 0.5
        pages.insert(int(part * len(names)), name)
    names[:] = pages
