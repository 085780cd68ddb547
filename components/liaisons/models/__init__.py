"""The catalogue: one file, one component; each with its equation, its source and its closed form.

What the files of this folder declare is here by its name: ``from liaisons.models import Pendulum``.  Type checkers read
the names in ``__init__.pyi``, which ``python tests/models/test_stub.py`` writes.  K and M, by which sources are named,
are the texts of Kneller and Marle: see ``liaisons/bibliography.md``.
"""

import pkgutil
from importlib import import_module
from typing import Any

from liaisons.language import Component, Operator


def _declared() -> dict[str, Any]:
    """Public classes and functions of all files, by name."""
    files = [import_module(f"{__name__}.{file.name}") for file in pkgutil.iter_modules(__path__) if not file.ispkg]
    return {
        name: value
        for file in files
        for name, value in vars(file).items()
        if not name.startswith("_") and getattr(value, "__module__", None) == file.__name__
    }


def _is_component(value: object) -> bool:
    """Whether a value is a component that is not abstract."""
    return isinstance(value, type) and issubclass(value, Component) and not value.is_abstract


_DECLARED = _declared()
globals().update(_DECLARED)
CATALOGUE: tuple[type[Component], ...] = tuple(
    sorted(filter(_is_component, _DECLARED.values()), key=lambda c: (issubclass(c, Operator), c.__name__))
)
"""All components by name, operators last."""
