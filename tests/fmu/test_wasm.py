"""WebAssembly components in wasmtime: they do what the native binary does that lies beside them.

The tests of this folder that take an FMU as ``pendulum_library`` and so on are put to its component, too.
``python tests/fmu/test_wasm.py`` prints the table of the catalogue.
"""

from __future__ import annotations

import ctypes
import sys
import zipfile
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

if __name__ == "__main__":
    sys.path.insert(0, str(Path(__file__).parent))

from driver import CO_SIMULATION, ERROR, MODEL_EXCHANGE, OK, Instance, Library
from fmpy.validation import validate_fmu
from handmade import kick
from wasm_driver import WasmLibrary
from wasm_wrapper import OURS, TOOLS, wrapper

from liaisons import compiler
from liaisons.errors import BuildError
from liaisons.fmu import build
from liaisons.library import catalogue
from liaisons.mechanics import assemble

AGREEMENT = 1e-12  # of everything that can be read, in parts of the greatest number that it was, or of 1
FAST = ["Pendulum", "SpatialCat", "OscillatorChain"]
STEP, STEPS = 0.05, 60

needs_zig = pytest.mark.skipif(compiler.zig_compiler() is None, reason="ziglang is not installed")
pytestmark = needs_zig


# ---- the same motion ---------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Motion:
    """Where a motion led: everything that can be read, by communication points; and again, from a saved state."""

    values: NDArray
    again: NDArray

    @property
    def rolls_back(self) -> bool:
        """To the bit."""
        return self.values[-len(self.again) :].tobytes() == self.again.tobytes()


def inputs(library: Library, t: float) -> dict[str, NDArray]:
    """Coordinates that move, their rates and accelerations with them."""
    starts = {
        v.name: np.resize(np.array((v.start or "0").split(), float), library.count(v.name))
        for v in library.description.modelVariables
        if v.type == "Float64" and v.causality == "input"
    }
    waves = {"": 1 - np.cos(t), "_dot": np.sin(t), "_ddot": np.cos(t)}
    ends = {name: next((end for end in ("_ddot", "_dot") if name.endswith(end)), "") for name in starts}
    return {name: start + 0.05 * waves[ends[name]] for name, start in starts.items()}


def moved(library: Library, kind: str) -> Motion:
    """Half the steps, the others, and from the state between them the others once more."""
    seen = [v.name for v in library.description.modelVariables if v.type == "Float64"]
    instance = library.start(kind, tolerance=1e-9, **inputs(library, 0.0))
    if kind == MODEL_EXCHANGE:
        instance.go_on()
    advance = co_simulate if kind == CO_SIMULATION else exchange
    rows = []
    state = b""
    for i in [*range(STEPS), *range(STEPS // 2, STEPS)]:
        if i == STEPS // 2:
            state = state or instance.serialize()
            assert instance.deserialize(state) == OK
        advance(instance, i * STEP)
        rows.append(instance.get(*seen))
    return Motion(np.array(rows[:STEPS]), np.array(rows[STEPS:]))


def co_simulate(instance: Instance, t: float) -> None:
    assert instance.set(inputs(instance.library, t)) == OK
    assert instance.step(t, STEP) == OK, instance.messages


def exchange(instance: Instance, t: float) -> None:
    """Heun's step, and an event after it."""
    count = ctypes.c_size_t()
    assert instance.call("GetNumberOfContinuousStates", ctypes.byref(count)) == OK
    n = count.value

    def rates(t: float, y: NDArray) -> NDArray:
        assert instance.call("SetTime", t) == OK
        assert instance.set(inputs(instance.library, t)) == OK
        assert instance.call("SetContinuousStates", (ctypes.c_double * n)(*y), n) == OK
        return instance.vector("GetContinuousStateDerivatives", n)

    y = instance.vector("GetContinuousStates", n)
    first = rates(t, y)
    second = rates(t + STEP, y + STEP * first)
    rates(t + STEP, y + STEP * (first + second) / 2)
    assert instance.call("CompletedIntegratorStep", True, instance.flags(1), instance.flags(1)) == OK
    assert instance.call("EnterEventMode") == OK
    instance.go_on()


def difference(found: Motion, expected: Motion) -> float:
    scale = np.maximum(1.0, np.abs(expected.values).max(axis=0))
    return float(np.max(np.abs(found.values - expected.values) / scale))


@pytest.fixture(scope="module")
def components(tmp_path_factory) -> Callable[[str], WasmLibrary]:
    folder = tmp_path_factory.mktemp("wasm")
    return lambda name: WasmLibrary(build(assemble(catalogue()[name]), folder, fmi="3", platforms="wasm"))


@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=[] if name in FAST else [pytest.mark.slow]) for name in sorted(catalogue())]
)
def test_every_component_moves_as_the_native_binary(name: str, components) -> None:
    library = components(name)
    assert library.imports == {"fmi:fmi3/types@3.0.0", "fmi:fmi3/callbacks@3.0.0"}  # nothing of WASI
    assert library.exports == {f"fmi:fmi3/{kind}@3.0.0" for kind in ("common", "co-simulation", "model-exchange")}
    assert validate_fmu(str(library.path)) == []
    native = Library(library.path)
    for kind in (CO_SIMULATION, MODEL_EXCHANGE):
        found = moved(library, kind)
        assert difference(found, moved(native, kind)) <= AGREEMENT
        assert found.rolls_back


def test_the_comparison_sees_a_last_digit(components) -> None:
    library = components("Pendulum")
    motion = moved(library, CO_SIMULATION)
    other = Motion(motion.values * (1 + 1e-11), motion.again * (1 + 1e-16 * 2))
    assert difference(other, motion) > AGREEMENT
    assert not Motion(motion.values, other.again).rolls_back


def test_a_state_that_was_saved_natively_goes_on_in_the_component(components) -> None:
    library = components("Pendulum")
    native, other = Library(library.path).start(theta_0=1.0), library.start()
    assert native.step(0.0, 1.0) == OK
    assert other.deserialize(native.serialize()) == OK
    assert other["theta"] == native["theta"]
    assert other.serialize() == native.serialize()


def test_what_a_host_gives_is_freed(components) -> None:
    instance = components("Pendulum").start()
    instance.store.set_limits(memory_size=2**21)  # of which half is the stack
    references = [1, 2, 3, 4, 5] * 1000
    for _ in range(100):
        assert len(instance.ask("get-float64", references)) == len(references)


def test_a_copy_with_start_values_in_a_file_is_refused(components) -> None:
    """It would start somewhere else: there are no files."""
    library = components("Pendulum")
    for kind in (CO_SIMULATION, MODEL_EXCHANGE):
        instance = library.instantiate(kind, token=f"{library.token}-0123456789abcdef")
        assert instance.pointer is None
        message = "this FMU has its start values in a file: take one of its native binaries"
        assert instance.log == [(ERROR, "logStatusError", message)]


# ---- the file ----------------------------------------------------------------------------------------------------


def test_the_same_bytes_beside_the_same_native_binary(tmp_path) -> None:
    """What is there and up to date is left as it is; a component is added, and nothing else changes."""
    plain = build(kick(), tmp_path, fmi="3")
    before = members(plain)
    both = members(build(kick(), tmp_path, fmi="3", platforms="wasm"))
    name = "binaries/wasm32-wasip2/HandKick.wasm"
    assert both.keys() - before.keys() == {name, "extra/org.modelica.fmi-ls-wasm/manifest.xml"}
    assert before == {member: both[member] for member in before}
    written = plain.stat().st_mtime_ns
    for platforms in ("wasm", "host"):
        assert build(kick(), tmp_path, fmi="3", platforms=platforms).stat().st_mtime_ns == written
    assert members(build(kick(), tmp_path / "other", fmi="3", platforms="wasm")) == both
    assert str(tmp_path).encode() not in both[name]


def members(fmu: Path) -> dict[str, bytes]:
    with zipfile.ZipFile(fmu) as archive:
        return {name: archive.read(name) for name in archive.namelist()}


@pytest.mark.skipif(TOOLS is None, reason="wasm-tools is not installed")
def test_the_wrapper_is_what_wasm_tools_makes() -> None:
    for model in (kick(), assemble(catalogue()["OscillatorChain"])):
        assert wrapper(model) == (OURS / "wrapper.wasm").read_bytes()


def test_components_are_of_fmi_3(tmp_path) -> None:
    message = r"HandKick: WebAssembly components are FMI 3\.0; for platforms='wasm' take fmi='3'"
    with pytest.raises(BuildError, match=message):
        build(kick(), tmp_path, platforms="wasm")


def test_components_need_zig(tmp_path, monkeypatch) -> None:
    monkeypatch.setattr(compiler, "find_spec", lambda _: None)
    with pytest.raises(BuildError, match="WebAssembly needs the compiler in the ziglang package: pip install ziglang"):
        build(kick(), tmp_path, fmi="3", platforms="wasm")
    assert not [*tmp_path.iterdir()]
