"""Components by name or file, and the FMUs that are built from them: where symbols meet files."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Literal

from liaisons.errors import suggestion
from liaisons.project import ProjectError, fmus_directory, load_module

if TYPE_CHECKING:
    from types import ModuleType

    from liaisons.mechanics import Component, Model

Backend = Literal["auto", "native", "python"]

_built: dict[tuple[type[Component], Backend, Path], tuple[Path, tuple[int, ...]]] = {}
"""FMUs that this process has seen to be up to date, and the files that these were."""


def catalogue() -> dict[str, type[Component]]:
    """The components of :mod:`liaisons.models`, by name."""
    from liaisons.models import CATALOGUE

    return {component.__name__: component for component in CATALOGUE}


def components(target: str) -> list[type[Component]]:
    """What a name on the command line stands for.

    :param target: a component of the catalogue (``Pendulum``), a Python file with components (``my_component.py``)
        or one component of such a file (``my_component.py:Name``).
    :raises ProjectError: for an unknown name, a file that cannot be loaded or has no component in it.
    """
    file, separator, name = target.rpartition(".py:")
    if not separator and not target.endswith(".py"):
        known = catalogue()
        if target not in known:
            raise ProjectError(f"no component is called {target!r}{suggestion(target, known)}")
        return [known[target]]
    path = Path(f"{file}.py" if separator else target)
    found = _defined_in(load_module(path))
    if not found:
        raise ProjectError(f"{path} defines no component; derive a class from liaisons.Mechanism or liaisons.Operator")
    if separator and name not in found:
        raise ProjectError(f"{path} defines no component called {name!r}{suggestion(name, found)}")
    return [found[name]] if separator else list(found.values())


def model(component: type[Component], **sizes: object) -> Model:
    """The model of a component, with other structural sizes than it declares where they are given.

    :param sizes: by name, for example ``n=100`` for a chain.
    :raises ProjectError: if the component has no size of that name.
    :raises ComponentError: if it cannot be derived, or a size is no whole number or too small.
    """
    from liaisons.mechanics import Chain

    if not sizes:
        return component.model()
    if not issubclass(component, Chain) or set(sizes) != {"n"}:
        given = ", ".join(f"{name} = {size!r}" for name, size in sizes.items())
        raise ProjectError(f"{component.__name__}: {given}: only chains have a size, and it is called n")
    return component.model(sizes["n"])


def fmu_path(target: str, backend: Backend = "auto", **sizes: object) -> Path:
    """The FMU of one component, built before the path is returned if it is missing or out of date.

    :param target: a name of the catalogue, or a file as in :func:`components` with one component in it.
    :param backend: ``"native"``, ``"python"``, or ``"auto"``: native where a C compiler is found.
    :param sizes: structural sizes, for example ``n=100``; such FMUs go to a folder of their own, ``fmus/n=100/``.
    :raises ProjectError: if the target names no component or several, or the component has no such size.
    :raises BuildError: if the FMU cannot be built.
    """
    from liaisons.fmu import build

    found = components(target)
    if len(found) > 1:
        choices = ", ".join(f"{target}:{component.__name__}" for component in found)
        raise ProjectError(f"{target} defines several components; name one: {choices}")
    folder = fmus_directory() / "-".join(f"{name}={size}" for name, size in sizes.items())
    key = (found[0], backend, folder)
    path, seen = _built.get(key, (None, None))
    if path is None or seen != _identity(path):
        path = build(model(found[0], **sizes), folder, backend=backend)
        _built[key] = (path, _identity(path))
    return path


def _identity(path: Path) -> tuple[int, ...]:
    """What changes with a file's content; nothing if there is none."""
    if not path.is_file():
        return ()
    status = path.stat()
    return status.st_mtime_ns, status.st_size, status.st_ino


def fmu_file(target: str) -> Path:
    """The FMU that a word on the command line stands for: an FMU file, else a component as in :func:`fmu_path`."""
    path = Path(target)
    if path.suffix == ".fmu" or (path.is_file() and path.suffix != ".py"):
        return path
    return fmu_path(target)


def _defined_in(module: ModuleType) -> dict[str, type[Component]]:
    """The components that a file defines; what it imports, and abstract bases, are left out."""
    from liaisons.mechanics import Component

    return {
        name: value
        for name, value in vars(module).items()
        if isinstance(value, type)
        and issubclass(value, Component)
        and value.__module__ == module.__name__
        and not value.is_abstract
    }
