"""What makes a WebAssembly component of a core module, by wasm-tools (github.com/bytecodealliance/wasm-tools, 1.262).

``python tests/kernel/fmu/wasm_wrapper.py`` writes components/liaisons/fmu/wasm/wrapper.wasm anew.
"""

from __future__ import annotations

import shutil
import subprocess
import tempfile
from importlib.resources import as_file, files
from pathlib import Path

from liaisons.fmu.code import source_files
from liaisons.fmu.wasm import EMPTY, compile_core_module, section_bytes
from liaisons.mechanics import Model

OURS = files("liaisons.fmu.wasm")
TOOLS = shutil.which("wasm-tools")


def wrapper(model: Model) -> bytes:
    """The component of a model with an empty module in the place of its own: the same bytes for every model."""
    sources = {name: text for name, text in source_files(model, "", "3").items() if name.endswith((".c", ".h"))}
    module = compile_core_module(sources)
    with tempfile.TemporaryDirectory() as folder, as_file(OURS / "wit") as interfaces:
        path = Path(folder, "module.wasm")
        path.write_bytes(module)
        for task in (["component", "embed", interfaces, "--world", "fmu"], ["component", "new"], ["strip", "--all"]):
            subprocess.run([TOOLS or "wasm-tools", *task, path, "--output", path], check=True)
        return path.read_bytes().replace(section_bytes(module), section_bytes(EMPTY))


if __name__ == "__main__":
    from liaisons.mechanics import assemble
    from liaisons.models import Constant

    with as_file(OURS / "wrapper.wasm") as place:
        place.write_bytes(wrapper(assemble(Constant)))
