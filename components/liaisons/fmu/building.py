"""From a model to an .fmu file."""

from __future__ import annotations

import hashlib
import logging
from collections.abc import Callable
from functools import cache, lru_cache, partial
from pathlib import Path
from uuid import UUID

from liaisons.base.archive import DESCRIPTION
from liaisons.base.compiler import (
    FLAGS,
    INSTALLATION,
    TARGETS,
    Backend,
    BuildSettings,
    Fmi,
    Platforms,
    compile_library,
    host_target,
    no_compiler_message,
    system_compiler,
    zig_compiler,
)
from liaisons.base.published import registered
from liaisons.errors import BackEndError, BuildError
from liaisons.fmu.archive import read_member, write_archive
from liaisons.fmu.code import source_files
from liaisons.fmu.description import SELDOM_RUN, model_description
from liaisons.fmu.extras import drawn_members, extra_members
from liaisons.fmu.origin import with_provenance
from liaisons.fmu.wasm import compile_component, manifest_members
from liaisons.mechanics import Model

BACK_ENDS = "liaisons.fmu_back_ends"
"""Entry points of back ends that write FMUs, beside that in C: that in Python."""

# In place of the guid, which is a hash of everything else.
_NO_GUID = "{00000000-0000-0000-0000-000000000000}"
_log = logging.getLogger(__name__)


def build(
    model: Model,
    output: Path | str | None = None,
    *,
    backend: Backend = "auto",
    platforms: Platforms = "host",
    fmi: Fmi = "2",
    arrays: bool = True,
) -> Path:
    """Build the FMU of a model, unless the file is up to date.

    :param model: e.g. ``assemble(Pendulum)``.
    :param output: folder; this and the others as in :func:`liaisons.build`.
    :returns: path of the FMU.
    :raises BuildError: if it cannot be compiled or written; then nothing is written.
    :raises BackEndError: if the back end cannot do what the model needs.
    """
    folder = BuildSettings(output, backend=backend, platforms=platforms, fmi=fmi, arrays=arrays).folder
    if fmi == "3" and backend == "python":
        raise BuildError(f"{model.name}: FMUs in Python are FMI 2.0; for FMI 3.0 take backend='native'")
    if model.sample and backend == "python":
        raise BackEndError(f"{model.name}: FMUs in Python take no samples; {_native_remedy()}")
    if platforms == "wasm" and fmi == "2":
        raise BuildError(f"{model.name}: WebAssembly components are FMI 3.0; for platforms='wasm' take fmi='3'")
    if backend == "auto" and fmi == "2" and not (system_compiler() or zig_compiler()):
        _warn_no_compiler()
        backend = "python"
    if backend == "python":
        return _build_python(model, folder)
    if fmi == "3":
        folder = folder / "fmi3" if arrays else folder / "fmi3" / "scalars"
    return _build_native(model, folder, platforms, fmi, arrays=arrays)


@cache
def _warn_no_compiler() -> None:
    """Warn, once per process, that FMUs are built in Python."""
    _log.warning("FMUs are built in Python: %s", no_compiler_message())


def _build_native(model: Model, output: Path, platforms: str, fmi: Fmi, *, arrays: bool) -> Path:
    """Build an FMU of generated C, unless the file is up to date."""
    path = output / f"{model.name}.fmu"
    sources = _sources(model, fmi, arrays)
    members = {
        DESCRIPTION: model_description(model, fmi, guid=_NO_GUID, arrays=arrays),
        **extra_members(model, fmi if arrays else "2"),  # names of numbers, as in FMI 2.0
        **{f"sources/{name}": content for name, content in sources.items()},
    }
    experimental = manifest_members() if platforms == "wasm" else {}
    members = _with_guid_and_provenance(members, model) | experimental
    code = {name: members[f"sources/{name}"] for name in sources if name.endswith((".c", ".h"))}
    paths = {target: f"binaries/{target.binaries_folder(fmi)}/{model.name}{target.extension}" for target in TARGETS}
    binaries: dict[str, Callable[[], bytes]] = {
        paths[target]: partial(compile_library, code, target, cross=platforms == "all", seldom_run=SELDOM_RUN)
        for target in (TARGETS if platforms == "all" else [host_target()])
    }
    if platforms == "wasm":
        binaries[f"binaries/wasm32-wasip2/{model.name}.wasm"] = partial(compile_component, code)
        if _is_current(path, members):  # existing binaries are kept beside the component
            members |= {name: binary for name in paths.values() if (binary := read_member(path, name))}
    if _is_current(path, members, *experimental) and all(read_member(path, name) for name in binaries):
        return path
    members |= {name: compiled() for name, compiled in binaries.items() if name not in members}
    write_archive(path, members | drawn_members(model, fmi))
    return path


@lru_cache(maxsize=128)
def _sources(model: Model, fmi: Fmi, arrays: bool) -> dict[str, bytes]:
    """Source files of an FMU with a placeholder for the guid, by name."""
    return source_files(model, _NO_GUID, fmi, arrays=arrays)


def _build_python(model: Model, output: Path) -> Path:
    """Build an FMU in Python, unless the file is up to date."""
    (python_members,) = registered(BACK_ENDS)
    model.refuse_contacts("the Python back end", _native_remedy(), BackEndError)
    path = output / "python" / f"{model.name}.fmu"
    flat = model.flat()
    members = _with_guid_and_provenance(python_members(flat, _NO_GUID), model)
    if not _is_current(path, members):
        write_archive(path, members | drawn_members(flat, "2"))
    return path


def _native_remedy() -> str:
    """What to do for a model that the Python back end does not take."""
    return "take backend='native'" if system_compiler() or zig_compiler() else f"native FMUs take them: {INSTALLATION}"


def _with_guid_and_provenance(members: dict[str, bytes], model: Model) -> dict[str, bytes]:
    """Members with the guid, a hash of them and of the compiler's flags, in place of the placeholder."""
    digest = hashlib.sha256(" ".join(FLAGS).encode())
    for name in sorted(members):
        digest.update(f"\0{name}\0{len(members[name])}\0".encode() + members[name])
    guid = f"{{{UUID(bytes=digest.digest()[:16])}}}"
    members = {name: content.replace(_NO_GUID.encode(), guid.encode()) for name, content in members.items()}
    return members | {DESCRIPTION: with_provenance(members[DESCRIPTION], model)}


def _is_current(path: Path, members: dict[str, bytes], *compared: str) -> bool:
    """Whether an archive has the same model description, and the same content of the members to be compared."""
    return all(read_member(path, name) == members[name] for name in (DESCRIPTION, *compared))
