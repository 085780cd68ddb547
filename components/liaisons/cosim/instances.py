"""Running FMUs of every version that can be simulated."""

from __future__ import annotations

from pathlib import Path

from liaisons.cosim.description import Fmu
from liaisons.cosim.instance import Instance
from liaisons.cosim.instance3 import Instance3

AnyInstance = Instance | Instance3


def make(name: str, fmu: Fmu, directory: Path) -> AnyInstance:
    """An instance of an FMU.

    :param name: name of the component, used as instance name and in messages.
    :param directory: where its file was extracted.
    :raises SimulationError: if the library cannot be loaded or refuses to make an instance.
    """
    return (Instance if fmu.version == 2 else Instance3)(name, fmu, directory)
