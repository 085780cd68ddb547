"""Instances of FMUs of FMI 2.0 and 3.0, for Co-Simulation and Model Exchange.

Every FMU is tried in a process of its own, since a library that crashes ends the process that calls it.
"""

from __future__ import annotations

import logging
import os
import pickle
import re
import signal
import subprocess
import sys
from collections.abc import Callable, Iterable, Iterator, Sequence
from ctypes import c_double
from functools import partial
from hashlib import sha256
from pathlib import Path
from typing import Protocol
from weakref import WeakSet

from liaisons.base import cache
from liaisons.base.archive import Archive
from liaisons.base.logs import logger
from liaisons.base.processes import TIME_LIMIT, die_with_parent
from liaisons.base.published import registered
from liaisons.cosim.instances.protocol import Instance
from liaisons.errors import ProcessEndedError, SimulationError
from liaisons.fmu_files import Fmu, Starts

_LAST = "done"
"""Comes after all stages."""
_tried: WeakSet[Fmu] = WeakSet()


class _Component(Protocol):
    """An FMU of a system."""

    @property
    def name(self) -> str: ...
    @property
    def fmu(self) -> Fmu: ...
    @property
    def starts(self) -> Starts: ...


def extract_fmus(fmus: Iterable[Fmu], folder: Path) -> dict[Path, Path]:
    """Extract the binaries and resources of FMUs, each file once.

    :returns: path of the FMU -> its own folder.
    :raises SimulationError: if a file is damaged or too big; see :class:`liaisons.base.archive.Archive`.
    """
    folders: dict[Path, Path] = {}
    for fmu in fmus:
        if fmu.function is None and fmu.path not in folders:
            with Archive(fmu.path) as archive:
                folders[fmu.path] = archive.extract(folder / str(len(folders)), ("sources/", "documentation/"))
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


def try_to_start(part: _Component, directory: Path, times: Sequence[float]) -> None:
    """Load, instantiate, initialize and step an FMU in a process of its own, once per file.

    Its inputs keep their start values, so a later crash is still possible.  FMUs built on this machine (told by
    their digests, since the name of the tool can be forged) and those tried before with the same start values are not
    tried.

    :param directory: where the FMU was extracted.
    :param times: begin and first communication point of the simulation [s], at least.
    :raises SimulationError: if that process crashes; what the FMU refuses is left to its own message.
    """
    fmu = part.fmu
    if fmu in _tried:
        return
    try:
        digest = cache.digest(fmu.path)
    except OSError as error:
        raise SimulationError(f"{fmu.path}: cannot be read: {error.strerror}") from None
    begin, size = times[0], times[1] - times[0]
    settings = digest, fmu.binary, begin, size, sorted(part.starts.items()), sys.version
    key = sha256(repr(settings).encode()).hexdigest()
    if not (cache.is_trusted_fmu(digest) or cache.is_trusted_fmu(key)):
        stage, how = (_in_fork if isolation() else _in_interpreter)(part, directory, begin, size)
        if how:
            raise SimulationError(
                f"{part.name}: {fmu.path.name} crashes when it is {stage} ({how}); "
                "build or copy it again, or ask its maker"
            )
        if stage == _LAST:
            cache.add_trusted_fmu(key)
    _tried.add(fmu)


def _stages(make_instance: Callable[[], Instance], part: _Component, begin: float, size: float) -> Iterator[str]:
    """Start an FMU and step it once; yields each stage before it begins, and :data:`_LAST` after all of them."""
    yield "instantiated"
    instance = make_instance()
    try:
        yield "initialized"
        instance.initialize(part.starts, None, begin, begin + size)
        instance.exit_initialization()
        yield "stepped"
        instance.stepper(c_double(begin), c_double(size)).perform("")
        yield "released"
        instance.release()
    finally:
        instance.close()
    yield _LAST


def _in_fork(part: _Component, directory: Path, begin: float, size: float) -> tuple[str, str]:
    """Start an FMU in a forked process; returns the last stage, and how the process crashed, if it did."""

    def make_silently() -> Instance:
        logging.disable()
        nothing = os.open(os.devnull, os.O_WRONLY)
        for stream in (1, 2):
            os.dup2(nothing, stream)
        return make_instance(part.name, part.fmu, directory)

    isolate = isolation()
    assert isolate is not None
    make = partial(isolate, part.name, part.fmu, make_silently, TIME_LIMIT)
    stage, stages = "", _stages(make, part, begin, size)
    try:
        while stage != _LAST:
            stage = next(stages)
    except ProcessEndedError as error:
        return stage, error.how
    except SimulationError:
        return "", ""
    return stage, ""


def _in_interpreter(part: _Component, directory: Path, begin: float, size: float) -> tuple[str, str]:
    """Start an FMU in a new interpreter; returns the last stage, and how the process crashed, if it did."""
    task = part, directory, begin, size
    done = subprocess.run(
        [sys.executable, "-P", "-c", f"from {__name__} import _print_stages; _print_stages()"],
        env={**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, sys.path))},  # FMUs in Python look there
        input=pickle.dumps((os.getpid(), *task)),
        capture_output=True,
        check=False,
    )
    stages = re.findall(r"^STAGE (\w+)$", done.stdout.decode(errors="replace"), re.MULTILINE)
    stage, status = stages[-1] if stages else "", done.returncode
    if stage in {"", "refused", _LAST}:
        return stage, ""
    return stage, signal.Signals(-status).name if status < 0 else f"exit status {status}"


def _print_stages() -> None:
    """Start the FMU of the task that comes by stdin, and print each stage."""
    parent, part, directory, begin, size = pickle.load(sys.stdin.buffer)
    die_with_parent(parent)
    try:
        for stage in _stages(partial(make_instance, part.name, part.fmu, directory), part, begin, size):
            os.write(1, f"\nSTAGE {stage}\n".encode())
    except SimulationError:
        os.write(1, b"\nSTAGE refused\n")
    os._exit(0)  # some FMUs crash when the process ends, which it does not do in a run
