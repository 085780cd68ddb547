"""The sources under other compilers, and the binaries for other platforms: what they ask for, and what they compute."""

from __future__ import annotations

import re
import shutil
import sys
import zipfile
from collections.abc import Callable
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from trial import (
    COMPONENTS,
    SOURCES,
    Version,
    compile_library,
    compile_program,
    every_component,
    every_version,
    rows,
    run,
    unpack,
)

from liaisons.base import compiler
from liaisons.fmu import build
from liaisons.mechanics import assemble

ZIG = [sys.executable, "-m", "ziglang", "cc"]
COMPILERS = {"gcc": ["gcc"], "clang": ["clang"], "zig": ZIG}
# What the emulators need, where Debian's packages put it.
ARM_LIBRARIES = Path("/usr/aarch64-linux-gnu")
FOLDERS = {
    "2": {"linux": "linux64", "aarch64": "aarch64-linux", "windows": "win64"},
    "3": {"linux": "x86_64-linux", "aarch64": "aarch64-linux", "windows": "x86_64-windows"},
}

needs_zig = pytest.mark.skipif(compiler.zig_compiler() is None, reason="ziglang is not installed")


@pytest.fixture(scope="module")
def everywhere(tmp_path_factory) -> Callable[[Version], Path]:
    """A pendulum with binaries for all platforms."""

    @cache
    def built(version: Version) -> Path:
        folder = tmp_path_factory.mktemp("everywhere")
        return build(assemble(COMPONENTS["Pendulum"]), folder, backend="native", platforms="all", fmi=version)

    return built


@pytest.fixture(scope="module")
def lived(everywhere, tmp_path_factory) -> Callable[..., NDArray]:
    """What the host prints in its life with a binary: ``lived(version, place, extension, host, *emulator)``."""

    def ran(version: Version, place: str, extension: str, host: Path, *emulator: str) -> NDArray:
        folder = tmp_path_factory.mktemp(place)
        trial = unpack(everywhere(version), folder, (FOLDERS[version][place], extension))
        command = [*emulator, host, trial.library, trial.plan]
        environment = {"PATH": "/usr/bin:/bin", "HOME": str(folder), "WINEPREFIX": str(folder), "WINEDEBUG": "-all"}
        found = run(*command, "life", "state", environment=environment, folder=folder)
        resumed = run(*command, "resume", "state", environment=environment, folder=folder)
        assert resumed.splitlines() == found.splitlines()[20:]
        return rows(found)

    return ran


# ---- compilers ---------------------------------------------------------------------------------------------------


@every_version
@pytest.mark.parametrize("name", ["Pendulum"])
@pytest.mark.parametrize("cc", COMPILERS)
@pytest.mark.variants(quick=3, core=0)
def test_sources_compile_without_a_warning(trial, name, version, cc) -> None:
    if (cc == "zig" and compiler.zig_compiler() is None) or (cc != "zig" and not shutil.which(cc)):
        pytest.skip(f"{cc} is not installed")
    compile_library(trial(name, version), cc, ["-O2"], COMPILERS[cc])


@needs_zig
@pytest.mark.slow
@every_version
@pytest.mark.parametrize("target", compiler.TARGETS, ids=lambda target: target.triple)
def test_sources_compile_without_a_warning_for_other_platforms(trial, version, target) -> None:
    compile_library(trial("Pendulum", version), target.triple, ["-O2"], [*ZIG, "-target", target.triple])


@pytest.mark.slow
@every_version
@every_component
def test_all_sources_compile_without_a_warning(trial, name, version) -> None:
    compile_library(trial(name, version), "again", ["-O2"])


# ---- binaries ----------------------------------------------------------------------------------------------------


@needs_zig
@pytest.mark.slow
@every_version
@pytest.mark.parametrize("place", ["linux", "aarch64"])
def test_binaries_ask_for_old_libraries_only(everywhere, tmp_path, version, place) -> None:
    """Of nothing but the C library, and of no version after that of the oldest systems in use, glibc 2.17."""
    if not shutil.which("readelf"):
        pytest.skip("readelf is not installed")
    with zipfile.ZipFile(everywhere(version)) as archive:
        library = archive.extract(f"binaries/{FOLDERS[version][place]}/Pendulum.so", tmp_path)
    needed = re.findall(r"\(NEEDED\).*\[(.*)\]", run("readelf", "--dynamic", library))
    assert set(needed) <= {"libc.so.6", "libm.so.6", "ld-linux-x86-64.so.2", "ld-linux-aarch64.so.1"}
    versions = re.findall(r"GLIBC_(\d+)\.(\d+)", run("readelf", "--version-info", library))
    assert versions
    assert max((int(a), int(b)) for a, b in versions) <= (2, 17)


@needs_zig
@pytest.mark.slow
@every_version
def test_arm_computes_the_same(lived, program, tmp_path, version) -> None:
    if not shutil.which("qemu-aarch64") or not ARM_LIBRARIES.exists():
        pytest.skip("qemu-user and libc6-arm64-cross are not installed")
    sources = [SOURCES / "host.c", SOURCES / "fmu.c"]
    host = compile_program(sources, tmp_path / "host", cc=[*ZIG, "-target", "aarch64-linux-gnu.2.17"])
    here = lived(version, "linux", ".so", program("host"))
    there = lived(version, "aarch64", ".so", host, "qemu-aarch64", "-L", str(ARM_LIBRARIES))
    # Nothing is contracted to fused operations, but sin and cos are another library's: one unit in the last place of
    # each, which 40 steps of 12 stages add up; forces of 10 N.
    np.testing.assert_allclose(there, here, rtol=0, atol=1e-12)


@needs_zig
@pytest.mark.slow
@every_version
def test_windows_computes_the_same(lived, program, tmp_path, version) -> None:
    if not shutil.which("wine"):
        pytest.skip("wine is not installed")
    sources = [SOURCES / "host.c", SOURCES / "fmu.c"]
    host = compile_program(sources, tmp_path / "host.exe", cc=[*ZIG, "-target", "x86_64-windows-gnu"])
    here = lived(version, "linux", ".so", program("host"))
    there = lived(version, "windows", ".dll", host, "wine")
    np.testing.assert_allclose(there, here, rtol=0, atol=1e-12)  # as above
