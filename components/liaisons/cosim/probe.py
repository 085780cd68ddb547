"""A library that crashes while it is loaded would take the whole process along: another process tries first."""

from __future__ import annotations

import signal
import subprocess
import sys
from pathlib import Path
from typing import Final
from weakref import WeakSet

from liaisons.cosim.description import Fmu
from liaisons.errors import SimulationError

_LOAD: Final = "import ctypes, sys; ctypes.CDLL(sys.argv[1])"
_known: WeakSet[Fmu] = WeakSet()


def try_to_load(name: str, fmu: Fmu, directory: Path) -> None:
    """Load the library of an FMU of another make in a process of its own, once a file.

    :param name: name of the component, for the message.
    :param directory: where the FMU was extracted.
    :raises SimulationError: if that process crashes; a library that just cannot be loaded is left to its own message.
    """
    if fmu in _known or fmu.tool.startswith("liaisons"):
        return
    library = directory / fmu.binary
    status = subprocess.run(
        [sys.executable, "-I", "-S", "-c", _LOAD, str(library)], cwd=library.parent, capture_output=True, check=False
    ).returncode
    if status not in {0, 1}:  # 1: an exception of Python
        reason = signal.Signals(-status).name if status < 0 else f"status {status:#x}"
        raise SimulationError(
            f"{name}: the library of {fmu.path.name} crashes when it is loaded ({reason}); "
            "build or copy it again, or ask its maker"
        )
    _known.add(fmu)
