"""Directories of a project, and Python files as modules."""

from __future__ import annotations

import ast
import importlib.util
import os
import sys
import tomllib
import traceback
from pathlib import Path
from types import ModuleType
from typing import Any

from liaisons.base.published import published_scenarios
from liaisons.errors import LiaisonsError, ProjectError

_CLONE = Path(__file__).resolve().parents[3]
"""The clone that this package runs from, in an editable installation."""
_SHIPPED = Path(__file__).resolve().parents[1] / "_scenarios"
"""The scenarios in a wheel."""
_beside: list[str] = []
"""Folders of files that were loaded, the last one first."""
_OURS = _SHIPPED if _SHIPPED.is_dir() else _CLONE / "scenarios"


def fmus_directory() -> Path:
    """Directory of built FMUs: ``$LIAISONS_FMUS``, else ``fmus/`` in the working directory."""
    return Path(os.environ.get("LIAISONS_FMUS") or "fmus")


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
    """Claim of a scenario: the first paragraph of its docstring, read without running the file.

    :raises ProjectError: if it is no Python file.
    """
    try:
        documentation = ast.get_docstring(ast.parse(path.read_text(encoding="utf-8"))) or ""
    except SyntaxError as error:
        raise ProjectError(f"{path}:{error.lineno}: {error.msg}") from None
    return " ".join(documentation.partition("\n\n")[0].split())


def figures_directory(scenario: Path) -> Path:
    """Directory of the figure of a scenario: ``figures/`` beside it, or in the working directory if it is installed."""
    elsewhere = _OURS == _SHIPPED or not Path.cwd().is_relative_to(_CLONE)
    installed = {path.parent for scenarios in published_scenarios().values() for path in scenarios.values()}
    installed |= {_OURS} if elsewhere else set()
    return Path("figures") if scenario.resolve().parent in installed else scenario.parent / "figures"


def declared_components() -> list[str] | None:
    """Components that ``fmus/fmus.toml`` lists, paths relative to it; None if there is no such file.

    :raises ProjectError: if it has no such list.
    """
    declaration = Path("fmus", "fmus.toml")
    try:
        declared = tomllib.loads(declaration.read_text(encoding="utf-8"))["components"]
        return [str(declaration.parent / name) if name.endswith(".py") else name for name in declared]
    except FileNotFoundError:
        return None
    except (tomllib.TOMLDecodeError, KeyError, AttributeError, TypeError) as error:
        raise ProjectError(f'{declaration}: {error}; write components = ["Pendulum", ...]') from None


def relative_to_working_directory(path: Path) -> Path:
    """Path relative to the working directory; the path itself if it lies elsewhere."""
    return path.relative_to(Path.cwd()) if path.is_relative_to(Path.cwd()) else path


def load_module(path: Path) -> ModuleType:
    """Run a Python file and return it as a module.

    Modules beside it are found, as by ``python FILE``; those of the last file's folder go before others.

    :raises ProjectError: if it is missing, or raises while it is run; the message has file, line and reason.
    """
    if not path.is_file():
        raise ProjectError(f"{path}: no such file")
    name = f"_file_{path.stem}"
    specification = importlib.util.spec_from_file_location(name, path.resolve())
    if specification is None or specification.loader is None:
        raise ProjectError(f"{path} is not a Python file; its name must end in .py")
    module = importlib.util.module_from_spec(specification)
    _look_beside(path.resolve().parent)
    sys.modules[name] = module  # dataclasses look their module up by its name
    try:
        specification.loader.exec_module(module)
    except SyntaxError as error:
        raise ProjectError(f"{error.filename or path}:{error.lineno}: {error.msg}") from error
    except (Exception, SystemExit) as error:
        reason = str(error) if isinstance(error, LiaisonsError) else f"{type(error).__name__}: {error}"
        raise ProjectError(f"{path}:{_innermost_line(error, path)}: {reason}") from error
    return module


def _look_beside(folder: Path) -> None:
    """Let imports look into a folder, last; a module of the same name from beside another file is forgotten."""
    for name, module in list(sys.modules.items()):
        beside = Path(getattr(module, "__file__", None) or "").parent
        if str(beside) in _beside and beside != folder and (folder / f"{name}.py").is_file():
            del sys.modules[name]
    if str(folder) not in {*sys.path} - {*_beside}:
        _beside[:] = [str(folder), *(other for other in _beside if other != str(folder))]
        sys.path[:] = [*(entry for entry in sys.path if entry not in _beside), *_beside]


def _innermost_line(error: BaseException, path: Path) -> int:
    """Number of the innermost line of a file in the traceback of an error; 0 if it is not in it."""
    causes = [raised for raised in (error, error.__cause__) if raised]  # the cause was raised further in
    frames = [frame for raised in causes for frame in traceback.extract_tb(raised.__traceback__)]
    return next((frame.lineno or 0 for frame in frames[::-1] if Path(frame.filename) == path.resolve()), 0)
