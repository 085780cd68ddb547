"""Running FMUs of every version that can be simulated."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from liaisons.cosim.description.archive import Archive
from liaisons.cosim.description.fmu import Fmu
from liaisons.cosim.instances.fmi2 import CoSimulation2
from liaisons.cosim.instances.fmi3 import CoSimulation3
from liaisons.cosim.instances.isolated import Isolated, library
from liaisons.cosim.instances.model_exchange import ModelExchange2, ModelExchange3
from liaisons.cosim.instances.protocol import Instance
from liaisons.cosim.messages import logger


def extracted(fmus: Iterable[Fmu], folder: Path) -> dict[Path, Path]:
    """Extract what a run of FMUs needs, each file once.

    :returns: path of the FMU -> its own folder.
    :raises SimulationError: if a file is damaged or too big; see :class:`liaisons.cosim.description.archive.Archive`.
    """
    found: dict[Path, Path] = {}
    for fmu in fmus:
        if fmu.path not in found:
            with Archive(fmu.path) as archive:
                found[fmu.path] = archive.extract(folder / str(len(found)), without=("sources/", "documentation/"))
    return found


def make(
    name: str,
    fmu: Fmu,
    directory: Path,
    *,
    requests_intermediate_update: bool = False,
    isolated: float = 0.0,
    stiff: bool = False,
) -> Instance:
    """An instance of an FMU; see :class:`Instance`.

    :param asks: it is to ask for inputs inside communication steps (FMI 3.0).
    :param isolated: in a process of its own, where a call may take so long [s]; 0: in this one.
    :param stiff: its equations, in Model Exchange, are known to be so.
    """

    def here() -> Instance:
        two, there = fmu.version == 2, (name, fmu, directory)
        if fmu.is_model_exchange:
            return (ModelExchange2 if two else ModelExchange3)(*there, stiff=stiff)
        return (
            CoSimulation2(*there)
            if two
            else CoSimulation3(*there, requests_intermediate_update=requests_intermediate_update)
        )

    if not isolated:
        return here()
    code = library()
    if code is None:
        logger.warning("%s: to be isolated takes Linux and a C compiler; it runs in this process", name)
        return here()
    return Isolated(name, fmu, here, code, isolated)
