"""Components and scenarios that installed packages publish by entry points of the group ``liaisons.components``."""

from __future__ import annotations

import re
from functools import lru_cache
from importlib.metadata import EntryPoint, entry_points
from importlib.util import find_spec
from pathlib import Path

from liaisons.errors import LiaisonsError, ProjectError

GROUP = "liaisons.components"
"""``InclineBlock = "my_mechanics.incline_block:InclineBlock"``: the name of a component, and where it is defined."""


@lru_cache(maxsize=1)
def published() -> dict[str, list[EntryPoint]]:
    """Return entry points by the name of their component, and by ``PACKAGE:NAME``; no package is imported."""
    named: dict[str, list[EntryPoint]] = {}
    for entry in sorted(entry_points(group=GROUP), key=lambda entry: (package(entry), entry.name)):
        for name in (entry.name, qualified(entry)):
            named.setdefault(name, []).append(entry)
    return named


def published_by_package() -> dict[str, list[EntryPoint]]:
    """Return entry points by the name of their package."""
    packages: dict[str, list[EntryPoint]] = {}
    for name, entries in published().items():
        if ":" in name:
            packages.setdefault(package(entries[0]), []).extend(entries)
    return packages


def package(entry: EntryPoint) -> str:
    """Return the name of the package of an entry point, as ``pip list`` shows it."""
    return entry.dist.name if entry.dist else ""


def qualified(entry: EntryPoint) -> str:
    """Return the name of a component that no other package has, ``PACKAGE:NAME``."""
    return f"{package(entry)}:{entry.name}"


def load_published(name: str) -> tuple[str, object]:
    """Import what is published by a name.

    :returns: the entry point in words, and its value.
    :raises ProjectError: if several packages publish it, or it cannot be imported.
    """
    entry, *further = published()[name]
    if further:
        choices = ", ".join(map(qualified, (entry, *further)))
        raise ProjectError(f"several packages publish a component {name}; name one: {choices}")
    label = f"package {package(entry)}: the entry point {entry.name} = {entry.value!r}"
    try:
        return label, entry.load()
    except Exception as error:
        reason = str(error) if isinstance(error, LiaisonsError) else f"{type(error).__name__}: {error}"
        raise ProjectError(f"{label} cannot be loaded: {reason}") from error


def published_scenarios() -> dict[str, dict[str, Path]]:
    """Return, by package, paths of scenarios by name: of the folder ``scenarios`` in its module; none is imported."""
    packages: dict[str, dict[str, Path]] = {}
    for name, entries in published_by_package().items():
        modules = {re.split("[.:]", entry.value)[0].strip() for entry in entries}
        specifications = filter(None, map(find_spec, filter(None, modules)))
        folders = [Path(f, "scenarios") for s in specifications for f in s.submodule_search_locations or ()]
        packages[name] = {path.stem: path for folder in folders for path in sorted(folder.glob("[!_]*.py"))}
    return packages
