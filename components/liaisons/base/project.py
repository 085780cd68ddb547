"""Python files as modules, and paths relative to the working directory."""

from __future__ import annotations

import importlib.util
import os
import sys
import traceback
from pathlib import Path
from types import ModuleType

from liaisons.errors import LiaisonsError, ProjectError

_beside: list[str] = []
"""Folders of files that were loaded, the last one first."""


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
        beside = (getattr(module, "__file__", None) or "").rpartition(os.sep)[0]
        if beside in _beside and beside != str(folder) and (folder / f"{name}.py").is_file():
            del sys.modules[name]
    if str(folder) not in {*sys.path} - {*_beside}:
        _beside[:] = [str(folder), *(other for other in _beside if other != str(folder))]
        sys.path[:] = [*(entry for entry in sys.path if entry not in _beside), *_beside]


def _innermost_line(error: BaseException, path: Path) -> int:
    """Number of the innermost line of a file in the traceback of an error; 0 if it is not in it."""
    causes = [raised for raised in (error, error.__cause__) if raised]  # the cause was raised further in
    frames = [frame for raised in causes for frame in traceback.extract_tb(raised.__traceback__)]
    return next((frame.lineno or 0 for frame in frames[::-1] if Path(frame.filename) == path.resolve()), 0)
