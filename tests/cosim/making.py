"""FMUs of C code that stands in a test, and systems of FMUs."""

from __future__ import annotations

import re
import shutil
import subprocess
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import fmpy
import pytest

from liaisons import System

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


def exchange_only(path: Path, folder: Path) -> Path:
    """The FMU without its Co-Simulation."""
    return copied(path, folder, rb"<CoSimulation\b([^>]*/>|.*?</CoSimulation>)")


def copied(path: Path, folder: Path, without: bytes) -> Path:
    """The FMU, its model description without what fits a pattern."""
    with zipfile.ZipFile(path) as source, zipfile.ZipFile(folder / path.name, "w") as target:
        for name in source.namelist():
            content = source.read(name)
            if name == "modelDescription.xml":
                content = re.sub(without, b"", content, flags=re.DOTALL)
            target.writestr(name, content)
    return folder / path.name
