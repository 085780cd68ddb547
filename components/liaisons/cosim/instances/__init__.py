"""Running FMUs of every version that can be simulated."""

from __future__ import annotations

from pathlib import Path

from liaisons.cosim.archive import Archive
from liaisons.cosim.description import Fmu
from liaisons.cosim.instances.fmi2 import Instance2
from liaisons.cosim.instances.fmi3 import Instance3

AnyInstance = Instance2 | Instance3


def extract(path: Path, folder: Path) -> Path:
    """Extract what a run of an FMU needs; returns the folder.

    :raises SimulationError: if the file is damaged or too big; see :class:`liaisons.cosim.archive.Archive`.
    """
    with Archive(path) as archive:
        return archive.extract(folder, without=("sources/", "documentation/"))


def make(name: str, fmu: Fmu, directory: Path, *, asks: bool = False) -> AnyInstance:
    """An instance of an FMU.

    :param name: name of the component, used as instance name and in messages.
    :param directory: where its file was extracted.
    :param asks: it is to ask for inputs inside communication steps (FMI 3.0).
    :raises SimulationError: if the library cannot be loaded or refuses to make an instance.
    """
    return Instance2(name, fmu, directory) if fmu.version == 2 else Instance3(name, fmu, directory, asks=asks)
