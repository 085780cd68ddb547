"""Modules that are imported by an older name, too."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from importlib import import_module
from importlib.abc import Loader, MetaPathFinder
from importlib.machinery import ModuleSpec
from importlib.util import find_spec
from types import ModuleType
from typing import final


def rename(old: str, new: str) -> None:
    """Let imports of a module, and of those below it, find another one: the same modules, not copies of them.

    :param old: former name of the module or package, ``liaisons.models``.
    :param new: name of what it is now.
    """
    sys.meta_path.insert(0, _Renamed(old, new))


@final
class _Renamed(MetaPathFinder, Loader):
    """Finder of modules by an older name, and their loader."""

    def __init__(self, old: str, new: str) -> None:
        self._old, self._new = old, new

    def find_spec(
        self,
        fullname: str,
        path: Sequence[str] | None = None,  # noqa: ARG002 - of all finders
        target: ModuleType | None = None,  # noqa: ARG002
    ) -> ModuleSpec | None:
        """Return how a module of an older name is loaded; None for any other name."""
        known = fullname == self._old or fullname.startswith(f"{self._old}.")
        if not known or find_spec(self._name(fullname)) is None:
            return None
        return ModuleSpec(fullname, self)

    def create_module(self, spec: ModuleSpec) -> ModuleType:
        """Module by its own name; what it is stays in ``spec.loader_state``."""
        module = import_module(self._name(spec.name))
        spec.loader_state = module.__spec__
        return module

    def exec_module(self, module: ModuleType) -> None:
        """Let the module be what it was before it was asked for by its older name."""
        if module.__spec__ is not None:
            module.__spec__ = module.__spec__.loader_state

    def _name(self, old: str) -> str:
        return self._new + old.removeprefix(self._old)
