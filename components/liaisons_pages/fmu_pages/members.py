"""The members of an FMU that people look at."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

from liaisons.base.compiler import Fmi
from liaisons.mechanics import Model
from liaisons_pages.fmu_pages.icon import KINDS, icon
from liaisons_pages.fmu_pages.page import index_page


def extras(model: Model, _fmi: Fmi) -> dict[str, bytes | Callable[[], bytes]]:
    """Return the page, and functions that draw the icon, by path in the archive."""
    icons = {f"terminalsAndIcons/icon.{kind}": partial(icon, model, kind) for kind in KINDS}
    return {"documentation/index.html": index_page(model), **icons}
