"""WebAssembly components of the layered standard fmi-ls-wasm, a working draft: any importer with WebAssembly runs them.

An FMU's C and ``wasm.c`` are compiled to a core module. What makes a component of that, its types and how its functions
are lifted, is the same for every FMU: ``wrapper.wasm``, in which the core module takes the place of an empty one.
``docs/wasm.md`` says how the wrapper is made.
"""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from functools import cache
from importlib.resources import files

from liaisons.base.compiler import WASM_FLAGS, compile_wasm

DRAFT = "c1aac17d392bec989fe2d059db3cc57bb7a0fff5"  # the commit of github.com/modelica/fmi-ls-wasm that we follow
EMPTY = b"\0asm\1\0\0\0"  # the core module in the wrapper

_MANIFEST = f"""\
<?xml version="1.0" encoding="UTF-8"?>
<!-- Experimental: fmi-ls-wasm is a working draft, this follows its commit {DRAFT}.
     Built by {{recipe}}. -->
<fmiLayeredStandardManifest xmlns:fmi-ls="http://fmi-standard.org/fmi-ls-manifest"
  fmi-ls:fmi-ls-name="org.modelica.fmi-ls-wasm"
  fmi-ls:fmi-ls-version="0.1.0-draft+{DRAFT[:7]}"
  fmi-ls:fmi-ls-description="FMI Layered Standard for WebAssembly"/>
"""


def compile_component(sources: Mapping[str, bytes]) -> bytes:
    """Compile the WebAssembly component of an FMU of FMI 3.0.

    :param sources: contents of its ``.c`` and ``.h`` files by name.
    :returns: the same bytes for the same sources and compiler.
    :raises BuildError: if ziglang is not installed, or the compiler fails or does not end; with its first words.
    """
    return _packaged_file("wrapper.wasm").replace(section_bytes(EMPTY), section_bytes(compile_core_module(sources)))


def compile_core_module(sources: Mapping[str, bytes]) -> bytes:
    """Compile the core module of a component, which has the functions of the draft in the canonical ABI."""
    return compile_wasm({**sources, "wasm.c": _packaged_file("wasm.c")})


def section_bytes(module: bytes) -> bytes:
    """Return a core module encoded as a section of a component: kind, length (LEB128), content."""
    head, rest = b"\x01", len(module)
    while rest > 127:
        head, rest = head + bytes([rest & 127 | 128]), rest >> 7
    return head + bytes([rest]) + module


def manifest_members() -> dict[str, bytes]:
    """Return the file of the manifest by path: version of the draft, and a hash of what components are made by."""
    recipe = hashlib.sha256(
        " ".join(WASM_FLAGS).encode() + _packaged_file("wasm.c") + _packaged_file("wrapper.wasm")
    ).hexdigest()
    return {"extra/org.modelica.fmi-ls-wasm/manifest.xml": _MANIFEST.format(recipe=recipe).encode()}


@cache
def _packaged_file(name: str) -> bytes:
    """Return the content of a file of this package."""
    return (files("liaisons.fmu.wasm") / name).read_bytes()
