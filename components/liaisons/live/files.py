"""Live pages as files, and in notebooks."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import final

from liaisons.base.arguments import as_path, merged
from liaisons.base.files import replacing
from liaisons.cosim import System
from liaisons.errors import SimulationError
from liaisons.live.page import live_page
from liaisons.results.notebook import sandboxed_frame

_HEIGHT = 1040
"""Height of a page in a notebook [px]."""


@final
@dataclass(frozen=True)
class LivePage:
    """A live page on disk; path-like, and displayed by a notebook.

    :param path: of the HTML file.
    """

    path: Path

    def __fspath__(self) -> str:
        return str(self.path)

    def __str__(self) -> str:
        return str(self.path)

    def _repr_html_(self) -> str:
        """HTML by which a notebook displays the page."""
        return sandboxed_frame(self.path.read_bytes(), _HEIGHT)


def default_page_path(subject: Path | System) -> Path:
    """Return the default path of the page of an FMU or a system: ``NAME.html`` in the working directory."""
    name = subject.name if isinstance(subject, System) else subject.stem
    return Path(re.sub(r"[^\w .=-]", "_", name) + ".html")


def show(
    subject: Path | str | System,
    /,
    path: Path | str | None = None,
    *,
    start_values: Mapping[str, object] | None = None,
    **keywords: object,
) -> LivePage:
    """Write a live page: the FMU's own C in a browser, with sliders, picture, plot and energy account.

    :param subject: path of an FMU with C sources of FMI 2.0; or a component by its name, file or class; or a system.
    :param path: of the page; default: ``NAME.html`` in the working directory.
    :param start_values: start values of an FMU's parameters and inputs by name, where they differ from its own;
        ``keywords`` are further ones.  A system has its own.
    :returns: the page, path-like: ``webbrowser.open(f"file://{page}")``; a notebook displays it.
    :raises ProjectError: if there is no such file or component.
    :raises SimulationError: if an FMU cannot be read or has no such sources, or the file cannot be written.
    :raises BuildError: if there is no compiler for WebAssembly: ``pip install 'liaisons[cross]'``.
    """
    starts = merged("show", start_values, keywords)
    if isinstance(subject, System) and starts:
        raise SimulationError(f"{subject.name}: start values of a system are given where its FMUs are added")
    fmu = subject if isinstance(subject, System) else Path(subject)
    target = default_page_path(fmu) if path is None else as_path("show: path", path)
    content = live_page(fmu, starts)
    with replacing(target) as whole:
        whole.write_bytes(content)
    return LivePage(target)
