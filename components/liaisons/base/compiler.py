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
from collections.abc import Collection, Iterable, Mapping
from contextlib import suppress
from dataclasses import KW_ONLY, dataclass
from importlib.util import find_spec
from pathlib import Path
from types import MappingProxyType
from typing import Literal, cast, final, get_args

from liaisons.base import cache
from liaisons.base.arguments import as_path, check_choice
from liaisons.base.folders import fmus_directory
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
# Passes of gcc that take a quarter of its time, and after which a step takes no fewer instructions.  Results are the
# same bits, so these are not among the flags on which guids depend.
_WITHOUT_PASSES = (
    *("-fno-gcse", "-fno-tree-pre", "-fno-code-hoisting", "-fno-cse-follow-jumps", "-fno-rerun-cse-after-loop"),
    *("-fno-inline-small-functions", "-fno-partial-inlining", "-fno-ipa-cp", "-fno-ipa-sra", "-fno-tree-tail-merge"),
    *("-fno-crossjumping", "-fno-caller-saves", "-fno-schedule-insns2"),
)
# For files in which a step spends little: two thirds of the time of gcc, and a step takes 0.3 % more instructions.
_SELDOM_RUN = (
    *("-O1", "-fno-ivopts", "-fno-tree-vrp", "-fno-tree-dominator-opts", "-fno-tree-loop-im", "-fno-tree-pta"),
    *("-fno-tree-dse", "-fno-tree-sink", "-fno-tree-copy-prop", "-fno-ipa-modref", "-fno-ipa-pure-const"),
    *("-fno-ipa-icf", "-fno-forward-propagate", "-fno-dse"),
)
WASM_FLAGS = (
    *("-target", "wasm32-wasi", "-mexec-model=reactor", "-std=c99", "-Oz", "-s"),
    *("-fno-math-errno", "-ffp-contract=off", "-fvisibility=hidden"),
    "-Wl,-z,stack-size=1048576",  # instead of the 16 MiB of zig
)
TIME_OUT = 900.0  # [s] for one file
INSTALLATION = "pip install 'liaisons[cross]'"
"""Command that installs zig."""


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
        """Folder of the FMUs of FMI 2.0; its folders ``fmi3/`` and ``python/`` have the others."""
        return fmus_directory() if self.output is None else as_path("output", self.output, BuildError)


@dataclass(frozen=True, slots=True)
class Target:
    """A platform: folders in ``binaries/`` (FMI 2.0.4, FMI 3.0), extension of libraries, and name for zig."""

    folders: tuple[str, str]
    extension: str
    triple: str
    flags: tuple[str, ...] = ()

    def binaries_folder(self, fmi: Fmi) -> str:
        """Name of its folder in ``binaries/``, which depends on the version of FMI."""
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

    :raises BuildError: if it is not one of :data:`TARGETS`.
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
    """Message that a C compiler is needed and how to install one.

    :param aim: ``" for WebAssembly"``; empty: any compiler would do.
    """
    return f"no C compiler{aim} is found: {INSTALLATION}"


def compile_library(
    sources: Mapping[str, bytes], target: Target, *, cross: bool = False, seldom_run: Collection[str] = ()
) -> bytes:
    """Compile and link C sources to a shared library.

    :param sources: contents of the ``.c`` and ``.h`` files by name.
    :param cross: by zig for the oldest system it supports, not for this machine by any compiler.
    :param seldom_run: files that are to be compiled sooner rather than be faster.
    :returns: the library; the same bytes for the same sources and compiler.
    :raises BuildError: if there is no compiler, or it fails or does not end; with its first words.
    """
    zig = zig_compiler()
    compiler = zig if cross else system_compiler() or zig
    if compiler is None:
        raise BuildError(no_compiler_message(" for other platforms" if cross else ""))
    command = [*compiler, "-target", target.triple, "-fno-sanitize=undefined"] if compiler is zig else compiler
    takes_passes = _takes_passes(command, target)
    compiling = [*command, *FLAGS, *(_WITHOUT_PASSES if takes_passes else ()), *target.flags]
    own_flags = dict.fromkeys(seldom_run, _SELDOM_RUN) if takes_passes else {}
    library, linker = f"library{target.extension}", [*command, "-shared"]
    return _compile_and_link(compiling, linker, sources, library, target.flags, own_flags=own_flags)


def _takes_passes(compiler: list[str], target: Target) -> bool:
    """Whether flags may leave out passes: other compilers than gcc refuse them, and a target may have its own level."""
    has_level = any(flag.startswith("-O") for flag in target.flags)
    return "gcc" in Path(compiler[0]).resolve().name and not has_level


def compile_wasm(sources: Mapping[str, bytes], *flags: str) -> bytes:
    """Compile and link C sources to a WebAssembly module with the exported functions, or take it from the cache.

    :param flags: for the compiler, beside those for small code.
    :returns: the module; the same bytes for the same sources and compiler.
    :raises BuildError: if ziglang is not installed, or the compiler fails or does not end; with its first words.
    """
    if (zig := zig_compiler()) is None:
        raise BuildError(no_compiler_message(" for WebAssembly"))
    command = [*zig, *WASM_FLAGS, *flags]
    made_from = repr((command, _compiler_identity(command), sorted(sources.items())))
    key = hashlib.sha256(made_from.encode()).hexdigest()
    if (module := cache.read_entry(key)) is None:
        module = _compile_and_link(command, command, sources, "module.wasm")
        cache.write_entry(key, module)
    return module


def _compile_and_link(
    compiler: list[str],
    linker: list[str],
    sources: Mapping[str, bytes],
    output: str,
    libraries: Iterable[str] = (),
    *,
    own_flags: Mapping[str, Iterable[str]] = MappingProxyType({}),
) -> bytes:
    """Compile C files, or take their object files from the cache, and link them.

    :param compiler: command with its flags, some of which may be for the linker.
    :param linker: command with its flags, but for the libraries.
    :param output: name of the file that is linked.
    :param own_flags: of C files, by name.
    :returns: its content.
    """
    compiler = [word for word in compiler if not _is_linker_flag(word)]
    identity = _compiler_identity(compiler)
    with tempfile.TemporaryDirectory(prefix="liaisons-") as path:
        folder = Path(path)
        for name, content in sources.items():
            (folder / name).write_bytes(content)
        missing: dict[str, tuple[str, list[str]]] = {}
        objects = [f"{name}.o" for name in sorted(sources) if name.endswith(".c")]
        for file in objects:
            name = file.removesuffix(".o")
            # Relative to the folder: no path gets into the library.
            command = [*compiler, *own_flags.get(name, ()), "-I.", "-c", name, "-o", file]
            key = hashlib.sha256(repr((command, identity, _file_and_headers(name, sources))).encode()).hexdigest()
            if (stored := cache.read_entry(key)) is None:
                missing[file] = key, command
            else:
                (folder / file).write_bytes(stored)
        # Long files first: none of them is left to one core at the end.
        longest = sorted(missing, key=lambda file: len(sources[file.removesuffix(".o")]), reverse=True)
        _run_compilers([missing[file][1] for file in longest], folder)
        for file, (key, _) in missing.items():
            cache.write_entry(key, (folder / file).read_bytes())
        _run_compilers([[*linker, *objects, "-o", output, *libraries]], folder)
        return (folder / output).read_bytes()


def _compiler_identity(command: list[str]) -> list[object]:
    """Path, time and size of a compiler, and the folders of its headers: what differs after an update."""
    module = find_spec("ziglang") if "ziglang" in command else None
    program = Path((module and module.origin) or command[0]).resolve()
    status = program.stat() if program.is_file() else None
    seen = (status.st_mtime_ns, status.st_size) if status else ()
    return [program, *seen, *map(os.environ.get, ("CPATH", "C_INCLUDE_PATH"))]


def _file_and_headers(name: str, sources: Mapping[str, bytes]) -> list[tuple[str, bytes]]:
    """Names and contents of a file and of the headers that it includes."""
    files = [name]
    for file in files:
        headers = re.findall(rb'^#include "([^"]+)"', sources[file], re.MULTILINE)
        files += {header.decode() for header in headers} & sources.keys() - set(files)
    return [(file, sources[file]) for file in sorted(files)]


def _is_linker_flag(flag: str) -> bool:
    """Whether only the linker takes a flag."""
    return flag in {"-shared", "-s"} or flag.startswith(("-Wl,", "-l", "-mexec-model="))


def _run_compilers(commands: Iterable[list[str]], folder: Path) -> None:
    """Run compilers in a folder, as many at once as there are cores.

    :raises BuildError: with the first words of one that fails, or if one does not end in time; then none goes on.
    """
    running: list[subprocess.Popen[str]] = []
    try:
        for command in commands:
            if len(running) == (os.cpu_count() or 1):
                _await_compiler(running[0])
                del running[0]
            running.append(_started_compiler(command, folder))
        while running:
            _await_compiler(running[0])
            del running[0]
    finally:  # an interrupt must not leave compilers running either
        for process in running:
            with process:
                if process.poll() is None:
                    _kill_group(process)


def _started_compiler(command: list[str], folder: Path) -> subprocess.Popen[str]:
    try:
        return subprocess.Popen(
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


def _await_compiler(process: subprocess.Popen[str]) -> None:
    name = cast("list[str]", process.args)[0]
    try:
        output, _ = process.communicate(timeout=TIME_OUT)
    except subprocess.TimeoutExpired:
        raise BuildError(f"the C compiler {name} did not end within {TIME_OUT:g} s") from None
    if process.returncode != 0:
        lines = output.splitlines()
        errors = [line for line in lines if "error" in line.lower()] or lines or ["it said nothing"]
        raise BuildError(f"the C compiler {name} failed: {' | '.join(errors[:3])}")


def _kill_group(process: subprocess.Popen[str]) -> None:
    """Kill a compiler and all processes that it has started."""
    if os.name == "posix":
        with suppress(ProcessLookupError):  # it has just ended by itself
            os.killpg(process.pid, signal.SIGKILL)
    else:
        subprocess.run(["taskkill", "/T", "/F", "/PID", str(process.pid)], capture_output=True, check=False)
