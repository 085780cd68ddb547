"""FMUs of C code that stands in a test, and systems of FMUs."""

from __future__ import annotations

import re
import shutil
import subprocess
import time
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import fmpy
import numpy as np
import pytest
from numpy.typing import NDArray

from liaisons import Result, System
from liaisons.cosim import SystemComponent

FmuPaths = Callable[[str], Path]
"""Path of an FMU by its name; see the fixtures."""
Trace = Callable[[], list[str]]


def packed(folder: Path, name: str, code: str, description: str, platform: str = fmpy.platform) -> Path:
    """Compile the code and put it into an FMU with this model description."""
    compiler = shutil.which("cc") or shutil.which("gcc") or shutil.which("clang")
    if compiler is None:
        pytest.skip("no C compiler")
    library = folder / f"{name}{fmpy.sharedLibraryExtension}"
    headers = Path(fmpy.__file__).parent / "c-code"
    (folder / f"{name}.c").write_text(code, encoding="utf-8")
    command = [compiler, "-shared", "-fPIC", "-O1", f"-I{headers}", f"{name}.c", "-o", str(library), "-lm"]
    subprocess.run(command, check=True, cwd=folder)
    with zipfile.ZipFile(folder / f"{name}.fmu", "w") as archive:
        archive.writestr("modelDescription.xml", description)
        archive.write(library, f"binaries/{platform}/{library.name}")
        archive.writestr("sources/all.c", code)
    return folder / f"{name}.fmu"


def wired(*links: str, **parts: Path | tuple[Path, dict[str, Any]]) -> System:
    """A system of FMUs, with start values where there are any, connected by ``"source.port -> target.port"``."""
    system = System("wired")
    for name, part in parts.items():
        path, starts = part if isinstance(part, tuple) else (part, {})
        system.add(name, path, **starts)
    for link in links:
        source, target = (system.parts[end.partition(".")[0]][end.partition(".")[2]] for end in link.split(" -> "))
        system.connect(source, target)
    return system


def read(path: Path) -> Any:
    """The description of an FMU."""
    return SystemComponent.read(path.stem, path, {}).fmu


def coupling_errors(result: Result) -> NDArray[np.float64]:
    """The error that each step of a run has added."""
    assert result.coupling_error is not None
    return result.coupling_error


def exchange_only(path: Path, folder: Path) -> Path:
    """The FMU without its Co-Simulation."""
    return copied(path, folder, rb"<CoSimulation\b([^>]*/>|.*?</CoSimulation>)")


def copied(path: Path, folder: Path, without: bytes) -> Path:
    """The FMU, its model description without what fits a pattern."""
    return described(path, folder / path.name, lambda content: re.sub(without, b"", content, flags=re.DOTALL))


def described(path: Path, target: Path, change: Callable[[bytes], bytes]) -> Path:
    """The FMU with another model description."""
    return rewritten(path, target, lambda name, data: (name, change(data) if name == "modelDescription.xml" else data))


def lying(path: Path, target: Path, name: str, instead: str) -> Path:
    """The FMU, of which a variable reads another one; and this one the first."""

    def change(content: bytes) -> bytes:
        patterns = {n: rb'(name="%s"[^>]*?valueReference=")(\d+)' % re.escape(n).encode() for n in (name, instead)}
        found = {n: re.search(pattern, content) for n, pattern in patterns.items()}
        for n, other in ((name, instead), (instead, name)):
            match = found[other]
            assert match
            content = re.sub(patterns[n], rb"\g<1>" + match[2], content, count=1)
        return content

    return described(path, target, change)


def rewritten(path: Path, target: Path, change: Callable[[str, bytes], tuple[str, bytes]]) -> Path:
    """The archive with other members."""
    contents = members(path)
    with zipfile.ZipFile(target, "w") as new:
        for name, data in contents.items():
            new.writestr(*change(name, data))
    return target


def wait_for(condition: Callable[[], object]) -> None:
    """Wait until something holds, a minute at most."""
    end = time.monotonic() + 60
    while not condition():
        assert time.monotonic() < end, "it does not come"
        time.sleep(0.02)


def members(path: Path) -> dict[str, bytes]:
    """The files of an archive."""
    with zipfile.ZipFile(path) as archive:
        return {name: archive.read(name) for name in archive.namelist()}
