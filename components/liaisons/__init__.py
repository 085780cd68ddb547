"""From one Lagrangian with active constraints to verified FMUs.

The public names are in ``__init__.pyi``, where type checkers read them, too; each is imported at its first use, so that
simulating FMUs never loads the symbolic layers.
"""

import lazy_loader

_getattr, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
_RENAMED = {
    **{name: f"scenarios.{name}" for name in ("Claims", "dots", "panels", "scenario", "slope", "table", "within")},
    "Held": "holding.Controller",
    "condition": "assertion",
    "submersion": "rheonomic_constraint",
}


def __getattr__(name: str) -> object:
    if name not in _RENAMED:
        return _getattr(name)
    import pkgutil
    import warnings

    new = f"{__name__}.{_RENAMED[name]}"
    warnings.warn(f"liaisons.{name} is now {new}", DeprecationWarning, stacklevel=2)
    return pkgutil.resolve_name(new)
