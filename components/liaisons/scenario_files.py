"""Where scenarios are: those of liaisons, of the working directory, and of installed packages."""

from __future__ import annotations

import ast
import tomllib
from pathlib import Path
from typing import Any

from liaisons.base.published import published_scenarios
from liaisons.errors import ProjectError

_CLONE = Path(__file__).resolve().parents[2]
"""The clone that this package runs from, in an editable installation."""
_SHIPPED = Path(__file__).resolve().parent / "_scenarios"
"""The scenarios in a wheel."""
_OURS = _SHIPPED if _SHIPPED.is_dir() else _CLONE / "scenarios"


def _scenario_packages_and_paths() -> dict[str, tuple[str, Path]]:
    """Package and path of each scenario by the name of the scenario; the package is ``own`` if none publishes it."""
    files = {path.stem: ("own", path) for folder in (_OURS, Path("scenarios")) for path in folder.glob("[!_]*.py")}
    for package, scenarios in published_scenarios().items():
        files |= {f"{package}:{n}" if n in files else n: (package, path) for n, path in scenarios.items()}
    return dict(sorted(files.items()))


def scenario_files() -> dict[str, Path]:
    """Paths of all scenarios by name: in ``scenarios/`` of the working directory, of liaisons, and published ones.

    A published scenario whose name is taken is called ``PACKAGE:NAME``.
    """
    return {name: path for name, (_, path) in _scenario_packages_and_paths().items()}


def read_gallery() -> dict[str, dict[str, Any]]:
    """Content of ``gallery.toml``: titles of scenarios, and themes with their scenarios."""
    return tomllib.loads((_OURS / "gallery.toml").read_text(encoding="utf-8"))


def scenario_themes() -> dict[str, tuple[str, list[str]]]:
    """Title and names of scenarios of each theme, by its short name; then of each package, and of ``own``."""
    left = {name: package for name, (package, _) in _scenario_packages_and_paths().items()}
    themes: dict[str, tuple[str, list[str]]] = {}
    for name, theme in read_gallery()["themes"].items():
        themes[name] = theme["title"], [scenario for scenario in theme["scenarios"] if left.pop(scenario, None)]
    for package in sorted({*left.values()}, key=lambda name: (name == "own", name)):
        title = "Of this directory" if package == "own" else f"Of the package {package}"
        themes[package] = title, [name for name in left if left[name] == package]
    return themes


def scenario_claim(path: Path) -> str:
    """Claim of a scenario: the first paragraph of its docstring.

    :raises ProjectError: if it is no Python file.
    """
    return " ".join(scenario_documentation(path).partition("\n\n")[0].split())


def scenario_documentation(path: Path) -> str:
    """Docstring of a scenario, read without running the file.

    :raises ProjectError: if it is no Python file.
    """
    try:
        return ast.get_docstring(ast.parse(path.read_text(encoding="utf-8"))) or ""
    except SyntaxError as error:
        raise ProjectError(f"{path}:{error.lineno}: {error.msg}") from None


def figures_directory(scenario: Path) -> Path:
    """Directory of the figure of a scenario: ``figures/`` beside it, or in the working directory if it is installed."""
    elsewhere = _OURS == _SHIPPED or not Path.cwd().is_relative_to(_CLONE)
    installed = {path.parent for scenarios in published_scenarios().values() for path in scenarios.values()}
    installed |= {_OURS} if elsewhere else set()
    return Path("figures") if scenario.resolve().parent in installed else scenario.parent / "figures"
