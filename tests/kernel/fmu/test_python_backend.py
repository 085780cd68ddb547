"""What only FMUs in Python have: pythonfmu in the archive, states as JSON, runs without liaisons, a second derivation.

What they do as native ones do is tested with these, wherever a fixture is called ``every_...``.
"""

from __future__ import annotations

import ctypes as c
import hashlib
import json
import math
import os
import shutil
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from driver import DISCARD, ERROR, Instance, Library
from handmade import breathing_inputs, libration
from numpy.typing import NDArray

from liaisons.mechanics import assemble
from liaisons.models import CartesianPendulum, Pendulum, Satellite, Swing


@pytest.fixture(scope="session")
def python_pendulum(handmade) -> Library:
    return handmade("pendulum", "python")


@pytest.fixture
def instance(python_pendulum) -> Instance:
    """After a step."""
    started = python_pendulum.start()
    started.step(0.0, 0.1)
    return started


def everything(instance: Instance) -> NDArray:
    return instance.get(*(v.name for v in instance.library.description.modelVariables if v.type == "Real"))


def test_members(python_pendulum) -> None:
    names = {str(path.relative_to(python_pendulum.folder)) for path in python_pendulum.folder.rglob("*")}
    assert {"binaries/linux64/HandPendulum.so", "binaries/win64/HandPendulum.dll"} <= names
    assert {"resources/pythonfmu/fmi2slave.py", "resources/pythonfmu/LICENSE", "documentation/index.html"} <= names
    assert f"resources/{(python_pendulum.folder / 'resources/slavemodule.txt').read_text()}.py" in names


def test_agrees_with_the_native_fmu(handmade, mode) -> None:
    """Two code generators, two solvers, two runtimes; every variable, at each of the steps and after each setting."""

    def run(library: Library) -> Iterator[NDArray]:
        start = {"theta_0": 1.0, "theta_dot_0": 0.5, "friction": 0.05, **breathing_inputs(0.0)}
        instance, t = library.start(tolerance=1e-11, input_reconstruction=mode, **start), 0.0
        yield everything(instance)
        for i in range(20):
            given = [breathing_inputs(t + 0.1 * (mode == 2)) | {"theta_force": np.cos(t)}, {"theta_force": 0.1 * i}]
            for values in [given[0], *([{"friction": 0.2}] if i == 10 else [])]:
                instance.set(values)
                yield everything(instance)
            for size in (0.1, 1e-3):  # the second step without setting anything
                instance.step(t, size)
                t += size
                yield everything(instance)
            instance.set(given[1])
            yield everything(instance)

    python, native = (np.array(list(run(handmade("pendulum", target)))) for target in ("python", "fmi2"))
    # Errors of 1e-11 a step and of 1e-12 from the accelerations at the ends of the quintic polynomials.
    assert python == pytest.approx(native, abs=1e-9)


@pytest.mark.parametrize(
    ("component", "moved"),
    [
        (Swing, {"rope": 1.7, "lean": -0.4}),
        (Pendulum, {"length": 0.7}),
        (Pendulum, {"pivot_x": 0.3}),  # moves no state
        (Pendulum, {"pivot_x": 0.3, "length": 0.7}),  # has no limit: their rates are factors of one term
        (Satellite, {"wheel_1": 2.0, "wheel_2": -1.0}),
    ],
)
def test_jumps_are_those_of_the_native_fmu(library, component, moved, mode) -> None:
    """While the rate of the pivot, which turns the momentum along with a jump of the length, is not 0."""
    names = [state.name for state in assemble(component).states]
    start = {"pivot_x_dot": 0.6, "theta_0": 0.8} if component is Pendulum else {}
    found = []
    for target in ("python", "fmi2"):
        instance = library(component, target).start(tolerance=1e-11, input_reconstruction=mode, **start)
        instance.step(0.0, 0.1)
        instance.set(moved)
        instance.step(0.1, 1e-3)
        found.append(instance.get(*names))
    assert found[0] == pytest.approx(found[1], abs=1e-8)  # errors of 2e-13 of 400 N.m in each of some steps, and growth


# ---- states from anywhere ----------------------------------------------------------------------------------------


def edited(name: str, value: Any) -> Callable[[bytes], bytes]:
    """With another value, which may be a function of the old one, and the checksum that belongs to it."""

    def damage(content: bytes) -> bytes:
        state = json.loads(content[64:])
        return sealed(json.dumps(state | {name: value(state[name]) if callable(value) else value}).encode())

    return damage


def sealed(text: bytes) -> bytes:
    return hashlib.sha256(text).hexdigest().encode() + text


def impossible() -> Iterator[tuple[str, Any]]:
    yield from (("t", [value]) for value in (1, "0", None, True))
    for name in ("k", "given", "u", "y", "m", "size"):
        yield name, 3.0  # would be put into all places
        yield name, lambda old: old[:-1]
        yield name, lambda old: [*old[:-1], [1.0]]
    yield from (("stepping", value) for value in (0, 2, "yes", None))
    yield "unusable", 0
    yield "guid", "{00000000-0000-0000-0000-000000000000}"
    yield "more", 1


@pytest.mark.parametrize(
    "damage",
    [
        lambda text: text[:40],
        lambda text: text[:-1],
        lambda text: text.replace(b'"{', b'"{0'),
        lambda text: text.replace(b"0.", b"1.", 1),
        lambda _: b"3",
        lambda _: sealed(b"3"),
        lambda _: sealed(b"[" * 100_000),
        lambda _: sealed(b"\xff"),
        lambda _: sealed(b"{}"),
        lambda text: bytes(64) + text[64:],
        lambda text: text[64:],
        *(edited(name, value) for name, value in impossible()),
    ],
)
def test_damaged_state_is_refused(instance, damage) -> None:
    before = everything(instance)
    instance.deserialize(damage(instance.serialize()), None)
    assert len(instance.messages) == 1
    assert "damaged or belongs to another FMU" in instance.messages[0]
    np.testing.assert_array_equal(everything(instance), before)


# ---- what the wrapper cannot say ---------------------------------------------------------------------------------


def test_a_start_off_the_constraints_ends_initialization(library) -> None:
    """Two of them, one after a reset; what the wrapper releases twice is there until then."""
    instance = library(CartesianPendulum, "python").initializing(x_0=5.0)
    for _ in range(2):
        instance.exit_initialization(ERROR)  # the driver has the wrapper return Fatal
        assert instance.messages[-1].startswith("rod (distance from the pivot to the bob) must be kept to 1e-06 m")
        instance.step(0.0, 0.1, DISCARD)
        assert instance.read("lambda_1", "energy")[0] == ERROR
        instance.do("Reset")
        instance.initialize()
        instance.set(x_0=5.0)
    instance.do("Reset")
    instance.initialize()
    instance.exit_initialization()
    instance.step(0.0, 0.1)


def test_step_before_initialization(python_pendulum) -> None:
    python_pendulum.instantiate().step(0.0, 0.1, DISCARD, "initialize the instance first")


def test_integers(handmade, instance) -> None:
    """Structural sizes can be read and not set; what belongs to no variable is named."""
    ring = handmade("ring", "python").start()
    assert ring.get_integer("n") == 3
    ring.set_integer("n", 5, DISCARD, "n = 5: it is no Integer variable that can be set")
    assert (ring.get_integer("n"), ring.get_integer("input_reconstruction")) == (3, 1)
    number, real = (c.c_int * 1)(), (c.c_double * 1)()
    for reference in (1000, 0):
        one = (c.c_uint * 1)(reference)
        message = f"of the value references [{reference}] some belong to no "
        instance.refuse(message + "Integer variable", "GetInt32", one, 1, number, 1)
        instance.refuse(message + "Real variable", "GetFloat64", one, 1, real, 1)
        assert (number[0], math.isnan(real[0])) == (0, True)
        message = f"value reference {reference} = nan: it belongs to no Real variable"
        instance.refuse(message, "SetFloat64", one, 1, real, 1, status=DISCARD)


# ---- life --------------------------------------------------------------------------------------------------------


def test_many_instances_of_several_fmus(handmade) -> None:
    # pythonfmu's wrapper drops one reference too many to the slave's module at each instantiation.
    libraries = [handmade(name, "python") for name in ("pendulum", "fall")]
    items = [library.start() for _ in range(100) for library in libraries]
    for item in items:
        item.step(0.0, 0.1)
    for library, found in zip(libraries, (items[0::2], items[1::2]), strict=True):
        np.testing.assert_array_equal([everything(item) for item in found], [everything(found[0])] * 100)
        assert not any(path.startswith(str(library.folder)) for path in sys.path)


def test_runs_without_liaisons(python_pendulum) -> None:
    """In a fresh interpreter that cannot import liaisons, and that ends without an error afterwards."""
    code = f"""
import atexit, sys
sys.modules["liaisons"] = None
registered, register = [], atexit.register
atexit.register = lambda *arguments: registered.append(str(arguments)) or register(*arguments)
import fmpy
result = fmpy.simulate_fmu({str(python_pendulum.path)!r}, stop_time=1.0, output_interval=0.1, relative_tolerance=1e-10)
assert any("HandPendulum.so" in arguments for arguments in registered) or sys.platform != "linux"
assert not any(name.split(".")[0] == "liaisons" for name in sys.modules if sys.modules[name])
import pythonfmu
assert "resources" in pythonfmu.__file__, pythonfmu.__file__
print(repr(float(result["theta"][-1])))
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert float(done.stdout) == pytest.approx(float(libration(1.0, 0.1)[0]), abs=1e-9)  # ten tolerances


@pytest.mark.slow
@pytest.mark.skipif(not shutil.which("valgrind"), reason="valgrind is not installed")
def test_the_wrapper_lets_go_of_the_interpreter_before_its_memory_is_freed(python_pendulum) -> None:
    code = f"import fmpy; fmpy.simulate_fmu({str(python_pendulum.path)!r}, stop_time=0.1)"
    valgrind = ["valgrind", "--error-limit=no", sys.executable, "-c", code]
    done = subprocess.run(valgrind, capture_output=True, text=True, check=True)
    assert "ERROR SUMMARY" in done.stderr  # of CPython's and the loader's own, say
    assert "finalizePythonInterpreter" not in done.stderr


# ---- other importers ---------------------------------------------------------------------------------------------

_LIBCOSIM = """
from libcosimpy.CosimExecution import CosimExecution
from libcosimpy.CosimObserver import CosimObserver
from libcosimpy.CosimSlave import CosimLocalSlave
execution = CosimExecution.from_step_size(step_size=10_000_000)
index = execution.add_local_slave(CosimLocalSlave(fmu_path={path!r}, instance_name="pendulum"))
observer = CosimObserver.create_last_value()
execution.add_observer(observer)
execution.simulate_until(target_time=10_000_000_000)
print("theta", repr(observer.last_real_values(index, [{reference}])[0]))
"""

_ECOS = """
from ecospy import EcosSimulation, EcosSimulationStructure
structure = EcosSimulationStructure()
structure.add_model("pendulum", {path!r})
simulation = EcosSimulation(structure=structure, step_size=0.01)
simulation.init()
simulation.step(1000)
print("theta", repr(simulation.get_real("pendulum::theta")))
simulation.terminate()
simulation.free()
"""


@pytest.mark.parametrize(("package", "code"), [("libcosimpy", _LIBCOSIM), ("ecospy", _ECOS)])
def test_other_importers(python_pendulum, package: str, code: str) -> None:
    pytest.importorskip("libcosimpy")  # the two come together, for the same machines
    libraries = Path(sys.prefix) / ("Library/bin" if os.name == "nt" else "lib")  # where the wheel tbb puts its own
    environment = os.environ | {"LD_LIBRARY_PATH": str(libraries)}
    script = code.format(path=str(python_pendulum.path), reference=python_pendulum.references["theta"])
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=False, env=environment)
    assert done.returncode == 0, (package, done.stderr)
    # Tolerance 1e-8 by default; small amplitude, so errors hardly grow over 10 s.
    theta = next(float(line.split()[1]) for line in done.stdout.splitlines() if line.startswith("theta "))
    assert theta == pytest.approx(float(libration(10.0, 0.1)[0]), abs=1e-7)
