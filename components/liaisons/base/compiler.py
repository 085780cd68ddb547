"""C compilers: the system's, or the one in the ``ziglang`` wheel, which also compiles for other platforms."""

from __future__ import annotations

import hashlib
import os
import platform
import re
import shutil
import signal
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import KW_ONLY, dataclass
from importlib.util import find_spec
from pathlib import Path
from typing import Literal, final, get_args

from liaisons.base import cache
from liaisons.base.arguments import as_path, check_choice
from liaisons.base.project import fmus_directory
from liaisons.errors import BuildError

Backend = Literal["auto", "native", "python"]
Platforms = Literal["host", "all", "wasm"]
Fmi = Literal["2", "3"]

# The same sources give the same bytes: no contraction to fused operations, no build id, no symbols, no paths.
FLAGS = (
    *("-std=c99", "-O2", "-fno-math-errno", "-ffp-contract=off"),
    "-fno-tree-slp-vectorize",  # stores in pairs delay the next stage of the solver by a fifth
    *("-fPIC", "-shared", "-fvisibility=hidden", "-g0"),
)
WASM_FLAGS = (
    *("-target", "wasm32-wasi", "-mexec-model=reactor", "-std=c99", "-Oz", "-s"),
    *("-fno-math-errno", "-ffp-contract=off", "-fvisibility=hidden"),
    "-Wl,-z,stack-size=1048576",  # instead of the 16 MiB of zig
)
TIME_OUT = 900.0  # [s] for one file
INSTALLATION = "pip install 'liaisons[cross]'"
"""Of zig."""


@final
@dataclass(frozen=True)
class BuildSettings:
    """Folder and form of an FMU that is built; :func:`liaisons.build` says what each is."""

    output: Path | str | None = None
    _: KW_ONLY
    backend: Backend = "auto"
    platforms: Platforms = "host"
    fmi: Fmi = "2"
    arrays: bool = True

    def __post_init__(self) -> None:
        for name, choices in (("backend", Backend), ("platforms", Platforms), ("fmi", Fmi)):
            check_choice(name, getattr(self, name), get_args(choices), BuildError)

    @property
    def folder(self) -> Path:
        """Folder of the FMUs, in which ``fmi3/`` and ``python/`` lie."""
        return fmus_directory() if self.output is None else as_path("output", self.output, BuildError)


@dataclass(frozen=True, slots=True)
class Target:
    """A platform: folders in ``binaries/`` (FMI 2.0.4, FMI 3.0), extension of libraries, and name for zig."""

    folders: tuple[str, str]
    extension: str
    triple: str
    flags: tuple[str, ...] = ()

    def folder(self, fmi: Fmi) -> str:
        """Folder of a version of FMI in ``binaries/``."""
        return self.folders[("2", "3").index(fmi)]


_ELF = ("-Wl,--build-id=none", "-s", "-lm")
TARGETS = (
    Target(("linux64", "x86_64-linux"), ".so", "x86_64-linux-gnu.2.17", _ELF),
    Target(("aarch64-linux", "aarch64-linux"), ".so", "aarch64-linux-gnu.2.17", _ELF),
    Target(("win64", "x86_64-windows"), ".dll", "x86_64-windows-gnu", ("-s",)),
    Target(("darwin64", "x86_64-darwin"), ".dylib", "x86_64-macos"),
    Target(("aarch64-darwin", "aarch64-darwin"), ".dylib", "aarch64-macos"),
)


def host_target() -> Target:
    """The platform of this process.

    :raises BuildError: if it is none of :data:`TARGETS`.
    """
    machine = {"amd64": "x86_64", "arm64": "aarch64"}.get(platform.machine().lower(), platform.machine().lower())
    system = {"win32": "windows", "darwin": "macos"}.get(sys.platform, sys.platform)
    for target in TARGETS:
        if target.triple.startswith(f"{machine}-{system}"):
            return target
    raise BuildError(f"native FMUs cannot be built on {machine} {system}; use backend='python'")


def system_compiler() -> list[str] | None:
    """Command of the C compiler of this machine; None if there is none."""
    paths = (shutil.which(name) for name in ("cc", "gcc", "clang"))
    return next(([path] for path in paths if path), None)


def zig_compiler() -> list[str] | None:
    """Command of the C compiler in the ``ziglang`` wheel; None if it is not installed."""
    return [sys.executable, "-m", "ziglang", "cc"] if find_spec("ziglang") else None


def no_compiler_message(aim: str = "") -> str:
    """Message where a C compiler is needed and there is none.

    :param aim: ``" for WebAssembly"``; empty: any compiler would do.
    """
    return f"no C compiler{aim} is found: {INSTALLATION}"


def compile_library(sources: Mapping[str, bytes], target: Target, *, cross: bool = False) -> bytes:
    """Compile and link C sources to a shared library.

    :param sources: contents of the ``.c`` and ``.h`` files by name.
    :param cross: by zig for the oldest system it supports, not for this machine by any compiler.
    :returns: the library; the same bytes for the same sources and compiler.
    :raises BuildError: if there is no compiler, or it fails or does not end; with its first words.
    """
    zig = zig_compiler()
    compiler = zig if cross else system_compiler() or zig
    if compiler is None:
        raise BuildError(no_compiler_message(" for other platforms" if cross else ""))
    aim = ["-target", target.triple, "-fno-sanitize=undefined"] if compiler is zig else []
    with _source_folder(sources) as (folder, names):
        objects = _compile_files([*compiler, *aim, *FLAGS, *target.flags], names, sources, folder)
        library = folder / f"library{target.extension}"
        _run_compiler([*compiler, *aim, "-shared", *objects, "-o", library.name, *target.flags], folder)
        return library.read_bytes()


def compile_wasm(sources: Mapping[str, bytes], *flags: str) -> bytes:
    """Compile and link C sources to a WebAssembly module with the exported functions.

    :param flags: for the compiler, beside those for small code.
    :returns: the module; the same bytes for the same sources and compiler.
    :raises BuildError: if ziglang is not installed, or the compiler fails or does not end; with its first words.
    """
    zig = zig_compiler()
    if zig is None:
        raise BuildError(no_compiler_message(" for WebAssembly"))
    with _source_folder(sources) as (folder, names):
        objects = _compile_files([*zig, *WASM_FLAGS, *flags], names, sources, folder)
        _run_compiler([*zig, *WASM_FLAGS, *flags, *objects, "-o", "module.wasm"], folder)
        return (folder / "module.wasm").read_bytes()


def _compile_files(command: list[str], names: list[str], sources: Mapping[str, bytes], folder: Path) -> list[str]:
    """Compile each file, or take it from the cache: FMUs have the same runtime.

    :param command: compiler, and its flags for all that it does.
    :returns: names of the object files, in the folder of the sources.
    """
    command = [word for word in command if not _is_linker_flag(word)]
    identity = _identity(command)
    for name in names:
        # Relative to the folder: no path gets into the library.
        compiling = [*command, "-I.", "-c", name, "-o", f"{name}.o"]
        key = hashlib.sha256(repr((compiling, identity, _with_headers(name, sources))).encode()).hexdigest()
        if (stored := cache.read_entry(key)) is None:
            _run_compiler(compiling, folder)
            cache.write_entry(key, (folder / f"{name}.o").read_bytes())
        else:
            (folder / f"{name}.o").write_bytes(stored)
    return [f"{name}.o" for name in names]


def _identity(command: list[str]) -> list[object]:
    """What differs after a compiler was updated, or finds other headers."""
    module = find_spec("ziglang") if "ziglang" in command else None
    program = Path((module and module.origin) or command[0]).resolve()
    status = program.stat() if program.is_file() else None
    seen = (status.st_mtime_ns, status.st_size) if status else ()
    return [program, *seen, *map(os.environ.get, ("CPATH", "C_INCLUDE_PATH"))]


@contextmanager
def _source_folder(sources: Mapping[str, bytes]) -> Iterator[tuple[Path, list[str]]]:
    """Yield a folder with the sources, and the names of the C files."""
    with tempfile.TemporaryDirectory(prefix="liaisons-") as folder:
        for name, content in sources.items():
            Path(folder, name).write_bytes(content)
        yield Path(folder), sorted(name for name in sources if name.endswith(".c"))


def _with_headers(name: str, sources: Mapping[str, bytes]) -> list[tuple[str, bytes]]:
    """A file and the headers that it includes, with their contents."""
    files = [name]
    for file in files:
        headers = re.findall(rb'^#include "([^"]+)"', sources[file], re.MULTILINE)
        files += {header.decode() for header in headers} & sources.keys() - set(files)
    return [(file, sources[file]) for file in sorted(files)]


def _is_linker_flag(flag: str) -> bool:
    """Whether only the linker takes a flag."""
    return flag in {"-shared", "-s"} or flag.startswith(("-Wl,", "-l", "-mexec-model="))


def _run_compiler(command: list[str], folder: Path) -> None:
    """Run a compiler, and raise a BuildError with its first words if it fails."""
    try:
        process = subprocess.Popen(
            command,
            cwd=folder,
            env={**os.environ, "TMPDIR": str(folder)},  # temporary files of a killed compiler go with the folder
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            errors="replace",
            start_new_session=True,
        )
    except OSError as error:
        raise BuildError(f"the C compiler {command[0]} cannot be started: {error.strerror}") from error
    with process:
        try:
            output, _ = process.communicate(timeout=TIME_OUT)
        except BaseException as error:  # an interrupt must not leave compilers running either
            _kill_group(process)
            if isinstance(error, subprocess.TimeoutExpired):
                raise BuildError(f"the C compiler {command[0]} did not end within {TIME_OUT:g} s") from None
            raise
    if process.returncode != 0:
        lines = output.splitlines()
        errors = [line for line in lines if "error" in line.lower()] or lines or ["it said nothing"]
        raise BuildError(f"the C compiler {command[0]} failed: {' | '.join(errors[:3])}")


def _kill_group(process: subprocess.Popen[str]) -> None:
    """Kill a compiler and all processes that it has started."""
    if os.name == "posix":
        with suppress(ProcessLookupError):  # it has just ended by itself
            os.killpg(process.pid, signal.SIGKILL)
    else:
        subprocess.run(["taskkill", "/T", "/F", "/PID", str(process.pid)], capture_output=True, check=False)
