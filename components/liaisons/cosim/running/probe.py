"""A trial of every FMU in a process of its own, since a library that crashes ends the process that calls it."""

from __future__ import annotations

import json
import os
import re
import signal
import subprocess
import sys
from collections.abc import Sequence
from hashlib import sha256
from pathlib import Path
from typing import Any
from weakref import WeakSet

from liaisons.base import cache
from liaisons.cosim.description.fmu import Fmu
from liaisons.cosim.structure.components import SystemComponent
from liaisons.errors import SimulationError

_known: WeakSet[Fmu] = WeakSet()


def try_to_start(part: SystemComponent, directory: Path, times: Sequence[float]) -> None:
    """Load, instantiate, initialize and step an FMU in a process of its own, once a file.

    Its inputs keep their start values, so a later crash is still possible.  FMUs that were built on this machine (by
    their digests, for the name of the tool can be forged) and those tried before with the same start values are not
    tried.

    :param directory: where the FMU was extracted.
    :param times: begin and first communication point of the simulation [s], at least.
    :raises SimulationError: if that process crashes; what the FMU refuses is left to its own message.
    """
    fmu = part.fmu
    if fmu in _known:
        return
    try:
        digest = cache.digest(fmu.path)
    except OSError as error:
        raise SimulationError(f"{fmu.path}: cannot be read: {error.strerror}") from None
    if cache.knows(digest):
        _known.add(fmu)
        return
    library, resources = (directory / fmu.binary).resolve(), directory.resolve() / "resources"
    resource_location = resources.as_uri() if fmu.version == 2 else f"{resources}/"
    starts = [_start(part, name) for name in part.starts]
    settings = (fmu.binary, times[0], times[1] - times[0], starts, sys.version)
    key = sha256(repr((digest, *settings)).encode()).hexdigest()
    if cache.knows(key):
        _known.add(fmu)
        return
    words = part.name, fmu.guid, resource_location
    task = os.getpid(), fmu.version, fmu.is_model_exchange, str(library), words, starts, (times[0], times[1] - times[0])
    script = (Path(__file__).parents[1] / "instances/trial.py").read_text(
        encoding="utf-8"
    )  # no file: its folder would be a path
    done = subprocess.run(
        [sys.executable, "-P", "-c", script],  # -P: what lies beside the library is no module
        cwd=library.parent,
        env={**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, sys.path))},  # FMUs in Python look there
        input=json.dumps(task).encode(),
        capture_output=True,
        check=False,
    )
    status = done.returncode
    stages = re.findall(r"^STAGE (\w+)$", done.stdout.decode(errors="replace"), re.MULTILINE)
    ended = stages[-1:] == ["released"]
    if status == 0 and ended:
        cache.remember(key)
    elif stages and not ended and (status, stages) != (1, ["loaded"]):  # 1: cannot be loaded, as the run will say
        reason = signal.Signals(-status).name if status < 0 else f"exit status {status}"
        raise SimulationError(
            f"{part.name}: {fmu.path.name} crashes when it is {stages[-1]} ({reason}); "
            "build or copy it again, or ask its maker"
        )
    _known.add(fmu)


def _start(part: SystemComponent, name: str) -> tuple[str, list[int], list[Any], bool]:
    """Type, value references and values of a start value, and whether it is structural."""
    entry, value = part.fmu.variables.entry(name), part.starts[name]
    values = list(value) if isinstance(value, tuple) else [value]
    return entry.like.base, list(entry.references), values, entry.like.structural
