"""WebAssembly components in wasmtime: they do what the native binary does that lies beside them.

The tests of this folder that take an FMU as ``pendulum_library`` and so on are put to its component, too.
"""

from __future__ import annotations

import ctypes
import re
import zipfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from driver import CO_SIMULATION, ERROR, MODEL_EXCHANGE, Instance, Library, members
from fmpy.validation import validate_fmu
from handmade import kick
from numpy.typing import NDArray
from wasm_driver import WasmLibrary
from wasm_wrapper import OURS, TOOLS, wrapper

from liaisons.base import compiler
from liaisons.errors import BuildError
from liaisons.fmu import build
from liaisons.library import catalogue
from liaisons.mechanics import assemble
from liaisons.models import BallRow, OscillatorChain, Pendulum
from liaisons_tools.cli import main

AGREEMENT = 1e-12  # of everything that can be read, in parts of the greatest number that it was, or of 1
FAST = ["Pendulum", "OscillatorChain"]
STEP, STEPS = 0.05, 60
NUMBER = re.compile(r"-?\d+(?:\.\d+)?(?:e[+-]?\d+)?")

Refusal = tuple[int, list[tuple[int, str, str]]]
"""A status, and what was logged."""

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
            instance.deserialize(state)
        advance(instance, i * STEP)
        rows.append(instance.get(*seen))
    return Motion(np.array(rows[:STEPS]), np.array(rows[STEPS:]))


def co_simulate(instance: Instance, t: float) -> None:
    instance.set(inputs(instance.library, t))
    instance.step(t, STEP)


def exchange(instance: Instance, t: float) -> None:
    """Heun's step, and an event after it; so many steps that an impact is not found late by far."""
    count = ctypes.c_size_t()
    instance.do("GetNumberOfContinuousStates", ctypes.byref(count))
    n = count.value

    def rates(t: float, y: NDArray) -> NDArray:
        instance.do("SetTime", t)
        instance.set(inputs(instance.library, t))
        instance.do("SetContinuousStates", (ctypes.c_double * n)(*y), n)
        return instance.vector("GetContinuousStateDerivatives", n)

    parts = 8 if instance.library.description.numberOfEventIndicators else 1
    h = STEP / parts
    for begin in t + h * np.arange(parts):
        y = instance.vector("GetContinuousStates", n)
        first = rates(begin, y)
        second = rates(begin + h, y + h * first)
        rates(begin + h, y + h * (first + second) / 2)
        instance.do("CompletedIntegratorStep", True, instance.flags(1), instance.flags(1))
        instance.do("EnterEventMode")
        instance.go_on()


def refused(library: Library) -> list[Refusal]:
    """Statuses and logs of calls of which an FMU takes few, each to an instance that has been reset."""
    variables = [v for v in library.description.modelVariables if v.type == "Float64"]
    settable = [v.name for v in variables if v.causality in {"parameter", "input"}]
    said = []
    for kind in (CO_SIMULATION, MODEL_EXCHANGE):
        instance = library.instantiate(kind, logging=True)

        def told(status: int, instance: Instance = instance) -> int:
            said.append((status, instance.log.copy()))
            instance.log.clear()
            return status

        for name in settable:
            for value in (-1.0, 0.0, 1e300, np.inf, np.nan):
                number = np.full(library.count(name), value)
                told(instance.call("Reset"))
                told(instance.initialize(1e-20, 0.0, None, None))
                told(instance.set({name: number}, None))
                told(instance.exit_initialization(None))
                told(instance.set({name: -number}, None))
                told(instance.step(0.0, 0.1, None) if kind == CO_SIMULATION else instance.call("SetTime", -value))
                told(instance.read(*(v.name for v in variables))[0])
        for begin, size in ((0.0, 0.0), (0.0, -1.0), (1.0, 0.1), (np.nan, 0.1), (0.0, np.inf)):
            if kind == CO_SIMULATION:
                told(instance.step(begin, size, None))
        for function in ("EnterEventMode", "EnterStepMode", "EnterConfigurationMode", "Terminate", "Terminate"):
            told(instance.call(function))
        told(instance.call("GetFloat64", (ctypes.c_uint * 2)(1, 10**6), 2, (ctypes.c_double * 2)(), 2))
        told(instance.call("SetDebugLogging", True, 1, (ctypes.c_char_p * 1)(b"nothing")))
    return said


def same(found: Refusal, expected: Refusal) -> bool:
    """The same status and the same words; digits of an instant at which a solver gave up may differ in the ninth."""
    words, others = (
        [(status, category, *NUMBER.split(text)) for status, category, text in log] for _, log in (found, expected)
    )
    numbers = [[float(n) for _, _, text in log for n in NUMBER.findall(text)] for _, log in (found, expected)]
    return found[0] == expected[0] and words == others and np.allclose(*numbers, rtol=1e-8, atol=0.0)


def difference(found: Motion, expected: Motion) -> float:
    scale = np.maximum(1.0, np.abs(expected.values).max(axis=0))
    return float(np.max(np.abs(found.values - expected.values) / scale))


@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=[] if name in FAST else [pytest.mark.slow]) for name in sorted(catalogue())]
)
@pytest.mark.variants(core="Pendulum")
def test_every_component_moves_as_the_native_binary(name: str, library) -> None:
    library = library(catalogue()[name], "wasm")
    assert library.imports == {"fmi:fmi3/types@3.0.0", "fmi:fmi3/callbacks@3.0.0"}  # nothing of WASI
    assert library.exports == {f"fmi:fmi3/{kind}@3.0.0" for kind in ("common", "co-simulation", "model-exchange")}
    assert validate_fmu(str(library.path)) == []
    native = Library(library.path)
    for kind in (CO_SIMULATION, MODEL_EXCHANGE):
        found = moved(library, kind)
        assert difference(found, moved(native, kind)) <= AGREEMENT
        assert found.rolls_back
    for pair in zip(refused(library), refused(native), strict=True):
        assert same(*pair), pair


def test_the_comparison_sees_a_last_digit(library) -> None:
    library = library(Pendulum, "wasm")
    motion = moved(library, CO_SIMULATION)
    other = Motion(motion.values * (1 + 1e-11), motion.again * (1 + 1e-16 * 2))
    assert difference(other, motion) > AGREEMENT
    assert not Motion(motion.values, other.again).rolls_back


def test_a_state_that_was_saved_natively_goes_on_in_the_component(library) -> None:
    library = library(Pendulum, "wasm")
    native, other = Library(library.path).start(theta_0=1.0), library.start()
    native.step(0.0, 1.0)
    other.deserialize(native.serialize())
    assert other["theta"] == native["theta"]
    assert other.serialize() == native.serialize()


def test_what_a_host_gives_is_freed(library) -> None:
    instance = library(Pendulum, "wasm").start()
    instance.store.set_limits(memory_size=2**21)  # of which half is the stack
    references = [1, 2, 3, 4, 5] * 1000
    for _ in range(100):
        assert len(instance.ask("get-float64", references)) == len(references)


def test_a_copy_with_start_values_in_a_file_is_refused(library) -> None:
    """It would start somewhere else: there are no files."""
    library = library(Pendulum, "wasm")
    for kind in (CO_SIMULATION, MODEL_EXCHANGE):
        instance = library.instantiate(kind, token=f"{library.token}-0123456789abcdef")
        assert instance.pointer is None
        message = "this FMU has its start values in a file: take one of its native binaries"
        assert instance.log == [(ERROR, "logStatusError", message)]


# ---- the file ----------------------------------------------------------------------------------------------------


def test_the_example_of_the_documentation(tmp_path, monkeypatch) -> None:
    monkeypatch.chdir(tmp_path)
    library = Library(build(assemble(Pendulum), "fmus", fmi="3", platforms="wasm"))
    text = Path(__file__).parents[3].joinpath("docs/wasm.md").read_text()
    manifest = members(library.path)["extra/org.modelica.fmi-ls-wasm/manifest.xml"].decode()
    (commit,) = re.findall(r"\b[0-9a-f]{40}\b", manifest)  # of the draft that we follow
    assert commit in text
    (example,) = re.findall(r"```python\n(.*?)```", text, re.DOTALL)
    found: dict[str, Any] = {}
    exec(example, found)
    native = library.start(tolerance=1e-8, theta_0=2.0)
    native.follow(0.1, 100)
    assert found["theta"] == pytest.approx(native["theta"], abs=AGREEMENT)


def test_integers_and_booleans_are_arrays_too(tmp_path) -> None:
    path = build(assemble(BallRow, 4), tmp_path, fmi="3", platforms="wasm")
    for library in (WasmLibrary(path), Library(path)):
        instance = library.start()
        instance.follow(0.1, 15)
        for function, kind, name, expected in (
            ("GetInt32", ctypes.c_int32, "gap_impacts", [1, 0, 0]),
            ("GetBoolean", ctypes.c_bool, "gap_closed", [False] * 3),
        ):
            values = (kind * 3)()
            assert instance.call(function, instance.refs([name]), 1, values, 3) == 0
            assert list(values) == expected


@pytest.mark.variants(core=0)
def test_own_files_and_sizes(tmp_path, capsys) -> None:
    own = Path(tmp_path, "own.py")
    own.write_text("from liaisons.models import PendulumChain\n\n\nclass Rope(PendulumChain):\n    'A rope.'\n")
    assert (
        main(["build", str(own), "--size", "n=7", "--fmi", "3", "--platforms", "wasm", "--output", str(tmp_path)]) == 0
    )
    library = WasmLibrary(Path(capsys.readouterr().out.strip()))
    assert difference(moved(library, CO_SIMULATION), moved(Library(library.path), CO_SIMULATION)) <= AGREEMENT


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


def test_a_component_comes_beside_the_binaries_for_other_machines(tmp_path) -> None:
    fmu = build(kick(), tmp_path, fmi="3")
    others = {"binaries/x86_64-windows/HandKick.dll", "binaries/aarch64-darwin/HandKick.dylib"}
    with zipfile.ZipFile(fmu, "a") as archive:
        for name in others:
            archive.writestr(name, b"of a build for all platforms")
    before = members(fmu)
    after = members(build(kick(), tmp_path, fmi="3", platforms="wasm"))
    assert before == {name: after[name] for name in before}
    assert "binaries/wasm32-wasip2/HandKick.wasm" in after


@pytest.mark.skipif(TOOLS is None, reason="wasm-tools is not installed")
def test_the_wrapper_is_what_wasm_tools_makes() -> None:
    for model in (kick(), assemble(OscillatorChain)):
        assert wrapper(model) == (OURS / "wrapper.wasm").read_bytes()


def test_components_are_of_fmi_3(tmp_path) -> None:
    message = r"HandKick: WebAssembly components are FMI 3\.0; for platforms='wasm' take fmi='3'"
    with pytest.raises(BuildError, match=message):
        build(kick(), tmp_path, platforms="wasm")


def test_components_need_zig(tmp_path, monkeypatch) -> None:
    monkeypatch.setattr(compiler, "find_spec", lambda _: None)
    with pytest.raises(BuildError, match=r"no C compiler for WebAssembly is found: pip install 'liaisons\[cross\]'"):
        build(kick(), tmp_path, fmi="3", platforms="wasm")
    assert not [*tmp_path.iterdir()]
