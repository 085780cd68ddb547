"""Functions of rooms above that systems use: FMUs of components by their names, archives, one FMU of a whole system."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeAlias, final

from liaisons.base.arguments import as_path
from liaisons.errors import SimulationError

FmuTarget: TypeAlias = "Path | str | type[Any]"
"""Path of an FMU; or a component by its name, file or class, where :mod:`liaisons.interface` is imported, as by all
public functions."""


@final
@dataclass(frozen=True)
class Services:
    """Functions of rooms above.

    :param fmu_file: a component by its name, file or class, or the path of an FMU -> path of the FMU.
    :param read_ssp: path of an archive, start values -> :class:`SystemDocument`.
    :param write_ssp: what :meth:`liaisons.System.write_ssp` calls.
    :param flatten: what :meth:`liaisons.System.flatten` calls.
    """

    fmu_file: Callable[[Any], Path]
    read_ssp: Callable[..., Any]
    write_ssp: Callable[..., None]
    flatten: Callable[..., Path]


_registered: list[Services] = []


def register(services: Services) -> None:
    """Let systems use the functions of rooms above."""
    _registered[:] = [services]


def services() -> Services:
    """Functions of rooms above.

    :raises SimulationError: if none are registered, in a program that imports :mod:`liaisons.cosim` alone.
    """
    if not _registered:
        raise SimulationError("liaisons.cosim alone runs FMUs; take System from liaisons")
    return _registered[0]


def fmu_file(label: str, target: FmuTarget) -> Path:
    """Path of an FMU that is given by its path or, where names are known, by a component.

    :param label: of the argument, for messages.
    :raises SimulationError: for what is not a path; of names what :func:`liaisons.library.fmu_file` raises.
    """
    return _registered[0].fmu_file(target) if _registered else as_path(label, target)  # type: ignore[arg-type]
