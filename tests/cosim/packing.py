"""FMUs of C code that stands in a test."""

from __future__ import annotations

import shutil
import subprocess
import zipfile
from pathlib import Path

import fmpy
import pytest


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
