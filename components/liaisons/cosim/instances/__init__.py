"""Instances of FMUs of FMI 2.0 and 3.0, for Co-Simulation and Model Exchange."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterable
from pathlib import Path

from liaisons.base.archive import Archive
from liaisons.base.published import registered
from liaisons.cosim.instances.protocol import Instance
from liaisons.cosim.messages import logger
from liaisons.fmu_files import Fmu


def extract_fmus(fmus: Iterable[Fmu], folder: Path) -> dict[Path, Path]:
    """Extract the binaries and resources of FMUs, each file once.

    :returns: path of the FMU -> its own folder.
    :raises SimulationError: if a file is damaged or too big; see :class:`liaisons.base.archive.Archive`.
    """
    folders: dict[Path, Path] = {}
    for path in dict.fromkeys(fmu.path for fmu in fmus if fmu.function is None):
        with Archive(path) as archive:
            folders[path] = archive.extract(folder / str(len(folders)), ("sources/", "documentation/"))
    return folders


def make_instance(
    name: str,
    fmu: Fmu,
    directory: Path,
    *,
    requests_intermediate_update: bool = False,
    isolated: float = 0.0,
) -> Instance:
    """Loaded and instantiated FMU, in this process or, if ``isolated``, in its own.

    :param requests_intermediate_update: whether inputs are set inside communication steps (FMI 3.0).
    :param isolated: time limit [s] of a call to another process; 0: the instance is in this process.
    """

    def instantiate() -> Instance:
        if fmu.function is not None:
            (make_sampled,) = registered("liaisons.sampled_functions")
            return make_sampled(name, fmu)
        if fmu.is_model_exchange:
            (make_model_exchange,) = registered("liaisons.model_exchange")
            return make_model_exchange(name, fmu, directory)
        if fmu.version == 2:
            from liaisons.cosim.instances.fmi2 import CoSimulation2

            return CoSimulation2(name, fmu, directory)
        from liaisons.cosim.instances.fmi3 import CoSimulation3

        return CoSimulation3(name, fmu, directory, requests_intermediate_update=requests_intermediate_update)

    if not isolated:
        return instantiate()
    if (isolate := isolation()) is None:
        logger.warning("%s: isolation needs Linux; running in this process", name)
        return instantiate()
    return isolate(name, fmu, instantiate, isolated)


def isolation() -> Callable[[str, Fmu, Callable[[], Instance], float], Instance] | None:
    """Function that makes an instance in a process of its own; None where that is impossible.

    It takes the name of the part, the description of its FMU, the function that makes the instance there, and the
    time limit of a call [s].
    """
    return None if sys.platform != "linux" else registered("liaisons.isolation")[0]
