"""From one Lagrangian with active constraints to verified FMUs.

``__init__.pyi`` lists the public names for type checkers, too; each is imported when it is first used, so that
simulating FMUs never loads the symbolic layers.
"""

import warnings
from typing import Any

import lazy_loader

_public_name, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
_RENAMED = {"condition": "assertion", "submersion": "rheonomic_constraint"}


def __getattr__(name: str) -> Any:
    """Public name, imported when it is first used; an old one with a warning, for one version."""
    if name in _RENAMED:
        warnings.warn(f"{name} is now called {_RENAMED[name]}", DeprecationWarning, stacklevel=2)
    return _public_name(_RENAMED.get(name, name))
