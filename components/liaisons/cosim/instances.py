"""Running FMUs of every version that can be simulated."""

from __future__ import annotations

from pathlib import Path

import fmpy

from liaisons.cosim.description import Fmu
from liaisons.cosim.instance import Instance
from liaisons.cosim.instance3 import Instance3
from liaisons.errors import SimulationError

AnyInstance = Instance | Instance3


def extract(path: Path, folder: Path) -> Path:
    """Extract what a run of an FMU needs; returns the folder.

    :raises SimulationError: if the file is damaged.
    """
    try:
        fmpy.extract(path, folder, include=lambda name: not name.startswith(("sources/", "documentation/")))
    except Exception as error:  # fmpy raises the base class; zipfile and zlib their own
        raise SimulationError(f"{path}: cannot be extracted: {error}; build or copy it again") from error
    return folder


def make(name: str, fmu: Fmu, directory: Path, *, asks: bool = False) -> AnyInstance:
    """An instance of an FMU.

    :param name: name of the component, used as instance name and in messages.
    :param directory: where its file was extracted.
    :param asks: it is to ask for inputs inside communication steps (FMI 3.0).
    :raises SimulationError: if the library cannot be loaded or refuses to make an instance.
    """
    return Instance(name, fmu, directory) if fmu.version == 2 else Instance3(name, fmu, directory, asks=asks)
