"""From one Lagrangian with active constraints to verified FMUs.

The public names are in ``__init__.pyi``, where type checkers read them, too; each is imported at its first use, so that
simulating FMUs never loads the symbolic layers.
"""

import importlib
import warnings

import lazy_loader

_getattr, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
_MOVED = dict.fromkeys(("Claims", "dots", "panels", "scenario", "slope", "table", "within"), "scenarios")


def __getattr__(name: str) -> object:
    if name not in _MOVED:
        return _getattr(name)
    module = f"{__name__}.{_MOVED[name]}"
    warnings.warn(f"liaisons.{name} is now {module}.{name}", DeprecationWarning, stacklevel=2)
    return getattr(importlib.import_module(module), name)
