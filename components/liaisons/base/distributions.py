"""What is installed, and the clone that this package may run from."""

from __future__ import annotations

import tomllib
from functools import cached_property
from importlib.metadata import Distribution, distribution, distributions
from os import PathLike
from pathlib import Path
from typing import Any, final

__all__ = ["clone", "distribution", "distributions"]

_COMPONENTS = Path(__file__).resolve().parents[2]
"""The folder in which this package lies: ``components`` in a clone."""


def clone() -> Distribution | None:
    """The clone that this package runs from; None if it is installed."""
    is_clone = _COMPONENTS.name == "components" and (_COMPONENTS.parent / "pyproject.toml").is_file()
    return _Clone() if is_clone else None


@final
class _Clone(Distribution):
    """The clone that this package runs from, as its pyproject.toml describes it now.

    The metadata of an installation may be older, and a clone on PYTHONPATH has none.
    """

    @cached_property
    def _project(self) -> dict[str, Any]:
        return tomllib.loads((_COMPONENTS.parent / "pyproject.toml").read_text(encoding="utf-8"))["project"]

    def read_text(self, filename: str) -> str | None:
        """Text of a file as an installation has it: author and licence, entry points, files."""
        if filename == "RECORD":
            return "LICENSE,,"
        project = self._project
        if filename == "entry_points.txt":
            groups = project["entry-points"].items()
            return "\n".join(x for group, entries in groups for x in [f"[{group}]", *map(" = ".join, entries.items())])
        author, licence = project["authors"][0]["name"], project["license"]
        about = f"Name: {project['name']}\nAuthor: {author}\nLicense-Expression: {licence}\n"
        return about if filename == "METADATA" else None

    def locate_file(self, path: str | PathLike[str]) -> Path:
        """Path of a file."""
        return _COMPONENTS.parent / path
