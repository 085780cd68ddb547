"""The catalogue: one file, one component; each with its equation, its source and its closed form.

What the files of this folder declare is here by its name: ``from liaisons.models import Pendulum`` loads the file of
the pendulum.  Type checkers read the names in ``__init__.pyi``, which ``python tests/models/test_stub.py`` writes.  K
and M, by which sources are named, are the texts of Kneller and Marle: see ``liaisons/bibliography.md``.
"""

import pkgutil
import re
from importlib import import_module
from typing import Any

from liaisons.language import Component, Operator

_FILES = [file.name for file in pkgutil.iter_modules(__path__) if not file.ispkg]


def __getattr__(name: str) -> Any:
    """Load the file of a component, or all files for another name or ``CATALOGUE``: all components, operators last."""
    if name.startswith("_"):
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    if name in _FILES:  # the file itself
        return import_module(f"{__name__}.{name}")
    file = re.sub(r"(?<=[a-z])(?=[A-Z])", "_", name).lower()
    declared = _loaded_definitions(file) if file in _FILES else {}
    if name not in declared:
        declared = {key: value for each in _FILES for key, value in _loaded_definitions(each).items()}
        components = filter(_is_component, declared.values())
        declared["CATALOGUE"] = tuple(sorted(components, key=lambda c: (issubclass(c, Operator), c.__name__)))
    globals().update(declared)
    if name not in declared:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return declared[name]


def _loaded_definitions(name: str) -> dict[str, Any]:
    """Load a file of this folder; return the public classes and functions that it defines, by name."""
    file = import_module(f"{__name__}.{name}")
    return {
        key: value
        for key, value in vars(file).items()
        if not key.startswith("_") and getattr(value, "__module__", None) == file.__name__
    }


def _is_component(value: object) -> bool:
    """Whether a value is the class of a component, and not abstract."""
    return isinstance(value, type) and issubclass(value, Component) and not value.is_abstract
