"""Components and scenarios that packages publish by entry points of the group ``liaisons.components``.

``InclineBlock = "my_mechanics.incline_block:InclineBlock"`` is the name of a component, and where it is defined.  The
catalogue is published like this, too, by the package ``liaisons``.
"""

from __future__ import annotations

from functools import cache, lru_cache
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any

from liaisons.base.logs import logger
from liaisons.errors import LiaisonsError, ProjectError

if TYPE_CHECKING:
    from importlib.metadata import Distribution, EntryPoint

GROUP = "liaisons.components"
_NAME = "liaisons"


@cache
def own_distribution() -> Distribution:
    """Distribution of this package: the clone that it runs from, or as it is installed."""
    # Imported here: metadata are read by the modules of e-mail, a tenth of the time of a help text.
    from liaisons.base.distributions import clone, distribution

    return clone() or distribution(_NAME)


@cache
def own_components() -> dict[str, EntryPoint]:
    """Entry points of the catalogue by name of the component; none is imported."""
    return {entry.name: entry for entry in own_distribution().entry_points.select(group=GROUP)}


@cache
def registered(group: str) -> list[Any]:
    """Objects that this package registers in a group of entry points, whose callers need not know where they are."""
    return [entry.load() for entry in own_distribution().entry_points.select(group=group)]


@lru_cache(maxsize=1)
def published_components() -> dict[str, dict[str, EntryPoint]]:
    """Entry points by name of the package, then by name of the component; no package is imported."""
    from liaisons.base.distributions import distributions

    packages: dict[str, dict[str, EntryPoint]] = {}
    found = {str(each.metadata["Name"]): each for each in [*distributions()][::-1]} | {_NAME: own_distribution()}
    for package, each in found.items():  # of several of one name the first on the path
        try:
            entries = each.entry_points.select(group=GROUP)
        except Exception as error:  # noqa: BLE001 - of whatever is wrong with another's file
            reason = f"{type(error).__name__}: {error}"
            logger.warning("package %s: left out: its entry_points.txt is broken: %s", package, reason)
            continue
        for entry in entries:
            packages.setdefault(package, {})[entry.name] = entry
    return dict(sorted(packages.items()))


def publishers(name: object) -> dict[str, EntryPoint]:
    """Entry points of a component by name of the package; ``PACKAGE:InclineBlock`` names one of them.

    Without a package the catalogue has precedence.
    """
    package, _, component = str(name).rpartition(":")
    if package in {"", _NAME} and component in own_components():
        return {_NAME: own_components()[component]}
    return {
        p: entries[component]
        for p, entries in published_components().items()
        if component in entries and package in {"", p}
    }


def load_published_component(name: str) -> tuple[str, object]:
    """Import the component that is published by a name.

    :returns: a text that describes the entry point, and the component.
    :raises ProjectError: if several packages publish it, or it cannot be imported.
    """
    (package, entry), *further = publishers(name).items()
    if further:
        choices = ", ".join(f"{package}:{name}" for package in publishers(name))
        raise ProjectError(f"several packages publish a component {name}; name one: {choices}")
    label = f"package {package}: the entry point {entry.name} = {entry.value!r}"
    try:
        return label, entry.load()
    except (Exception, SystemExit) as error:
        reason = str(error) if isinstance(error, LiaisonsError) else f"{type(error).__name__}: {error}"
        raise ProjectError(f"{label} cannot be loaded: {reason}") from error


def publishing_package(module: str) -> Distribution | None:
    """Package that publishes components under the top-level name of a module; None if there is none."""
    top = module.partition(".")[0]
    if top in {*map(_top_module, own_components().values())}:
        return own_distribution()
    entries = (entry for package in published_components().values() for entry in package.values())
    return next((entry.dist for entry in entries if _top_module(entry) == top), None)


def _top_module(entry: EntryPoint) -> str:
    """Name of the top-level module of an entry point: ``my_mechanics``."""
    return entry.value.partition(":")[0].partition(".")[0].strip()


def published_scenarios() -> dict[str, dict[str, Path]]:
    """Paths of scenarios by name of the package, then by name of the scenario; no package is imported."""
    packages: dict[str, dict[str, Path]] = {}
    for package, entries in published_components().items():
        modules = {*map(_top_module, entries.values())} - {""}
        folders = [Path(f) for s in map(find_spec, modules) if s for f in s.submodule_search_locations or ()]
        packages[package] = {path.stem: path for folder in folders for path in folder.glob("scenarios/[!_]*.py")}
    return packages
