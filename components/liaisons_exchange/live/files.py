"""Live pages as files, and in notebooks."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, final

from liaisons.base.files import replacement_path
from liaisons.cosim import System
from liaisons.errors import SimulationError
from liaisons_exchange.live.page import live_page
from liaisons_pages.pictures import sandboxed_frame

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

    __str__ = __fspath__

    def _repr_html_(self) -> str:
        """HTML of a frame with the page, for notebooks."""
        return sandboxed_frame(self.path.read_bytes(), _HEIGHT)


def default_page_path(subject: Path | System) -> Path:
    """Return the default path of the page of an FMU or a system: ``NAME.html`` in the working directory."""
    name = subject.name if isinstance(subject, System) else subject.stem
    return Path(re.sub(r"[^\w .=-]", "_", name) + ".html")


def write_live_page(
    subject: Path | System, path: Path | None, starts: Mapping[str, object], **contents: Any
) -> LivePage:
    """Write the live page of an FMU or of a system; raise the errors of :func:`liaisons.show`.

    :param path: of the page; None: :func:`default_page_path`.
    :param starts: of an FMU; a system has its own.
    :param contents: controls, plots and question of :func:`live_page`.
    """
    if isinstance(subject, System) and starts:
        raise SimulationError(f"{subject.name}: start values of a system are given where its FMUs are added")
    target = path or default_page_path(subject)
    content = live_page(subject, starts, **contents)
    with replacement_path(target) as whole:
        whole.write_bytes(content)
    return LivePage(target)
