"""The catalogue, ``liaisons_catalogue``, by its name under ``liaisons``: ``from liaisons.models import Pendulum``."""

from typing import Any

import liaisons_catalogue
from liaisons.base.renamed import rename

rename(__name__, liaisons_catalogue.__name__)


def __getattr__(name: str) -> Any:
    """Return what the catalogue has of this name; ``CATALOGUE`` are all components, operators last."""
    if name == "CATALOGUE":
        from liaisons.library import catalogue

        return tuple(catalogue().values())
    return getattr(liaisons_catalogue, name)


def __dir__() -> list[str]:
    return [*dir(liaisons_catalogue), "CATALOGUE"]
