"""Communication steps by compiled code, and explicit ones by Python, to the same bits, where there is no compiler.

What is refused or interrupted is tested with either loop where that belongs, in test_system.py and test_fmi3.py.
"""

from __future__ import annotations

import logging
import subprocess
from collections.abc import Callable
from ctypes import byref, c_void_p
from functools import partial
from pathlib import Path
from typing import Any, Literal, get_args

import numpy as np
import pytest
from making import wired

from liaisons.base import compiler
from liaisons.cosim import Call, Coupling, Result, simulate
from liaisons.cosim.compiled import library as compiled
from liaisons.cosim.compiled.calls import COUPLED
from liaisons.cosim.coupling.elimination import Elimination
from liaisons.cosim.running import loop
from liaisons.errors import BuildError, SimulationError
from liaisons.fmu import build
from liaisons.library import catalogue
from liaisons.mechanics import assemble

pytestmark = pytest.mark.skipif(not (compiler.system_compiler() or compiler.zig_compiler()), reason="no C compiler")

Run = Callable[[], Result]
Versions = dict[tuple[str, str], Path]


@pytest.fixture(scope="session")
def versions(tmp_path_factory: pytest.TempPathFactory) -> Versions:
    """Native FMUs by component and version of FMI."""
    folder = tmp_path_factory.mktemp("versions")
    models, both = {n: assemble(catalogue()[n]) for n in ("Pendulum", "Sinusoid")}, get_args(Literal["2", "3"])
    return {(n, fmi): build(m, folder, backend="native", fmi=fmi) for n, m in models.items() for fmi in both}


@pytest.fixture
def same_by_python(monkeypatch: pytest.MonkeyPatch) -> Callable[[Run], None]:
    """Compares a run with the same by Python, and makes sure that Python has no part in the first."""

    def compare(run: Run) -> None:
        with monkeypatch.context() as only_compiled:
            only_compiled.setattr(loop.Loop, "_advance_in_python", lambda *_: pytest.fail("Python makes the steps"))
            first = run()
        with monkeypatch.context() as without:
            without.setattr(compiled, "step_library", lambda **_: None)
            second = run()
        _assert_same_bits(first, second)

    return compare


@pytest.fixture
def same_by_calls_of_python(monkeypatch: pytest.MonkeyPatch) -> Callable[[Run], None]:
    """Compares a coupled run with the same whose FMUs are called by Python, from within the compiled step."""
    recorded = Call.set_record

    def only_coupled(call: Call, kind: int, instance: int | None, **fields: Any) -> Call:
        return recorded(call, kind, instance, **fields) if kind == COUPLED else call

    def compare(run: Run) -> None:
        first = run()
        with monkeypatch.context() as without:
            without.setattr(Call, "set_record", only_coupled)
            second = run()
        _assert_same_bits(first, second)

    return compare


def _assert_same_bits(first: Result, second: Result) -> None:
    assert len(first.names) > 10
    assert first.time.tobytes() == second.time.tobytes()
    assert all(first[name].tobytes() == second[name].tobytes() for name in first.names)


@pytest.mark.parametrize("fmi", ["2", "3"])
def test_one_fmu(versions, same_by_python, fmi: str) -> None:
    same_by_python(lambda: simulate(versions["Pendulum", fmi], stop_time=3.0, step_size=0.01, theta_0=2.0))


@pytest.mark.parametrize("coupling", ["gauss-seidel", "jacobi"])
@pytest.mark.parametrize("fmi", [("2", "2"), ("2", "3"), ("3", "2")])
def test_a_system(versions, same_by_python, fmi: tuple[str, str], coupling: Coupling) -> None:
    operator = versions["Sinusoid", fmi[0]], {"offset": 1.0, "amplitude": 0.1, "angular_frequency": 6.0}
    swing = versions["Pendulum", fmi[1]], {"theta_0": 1.0}
    system = wired("operator.y -> swing.length", operator=operator, swing=swing)
    same_by_python(lambda: system.simulate(3.0, 0.01, coupling=coupling))


OURS, ASKING, OTHERS = "Pendulum", "fmi3/Pendulum", "python/Pendulum"


@pytest.mark.parametrize("coupling", ["implicit", "waveform"])
@pytest.mark.parametrize("names", [(OURS, OURS), (ASKING, OURS), (OTHERS, OURS)])
@pytest.mark.parametrize("H", [0.005, 0.05])
def test_coupled_pendulums(component, same_by_calls_of_python, names, coupling: Coupling, H: float) -> None:
    """Polynomials, answers inside a step, values at its end; some iterations, and many with secants."""
    upper, lower = ((component(name), {"theta_0": 0.4, "mass": 0.4 + k}) for k, name in enumerate(names))
    system = wired("upper.bob -> lower.pivot", upper=upper, lower=lower)
    same_by_calls_of_python(lambda: system.simulate(30 * H, H, coupling=coupling))


def test_a_coupled_chain(component, same_by_calls_of_python) -> None:
    """Many unknowns, several groups, a source before them, driven by a function of time."""
    parts: dict[str, Any] = {"motor": component("Sinusoid")}
    parts |= {f"m{k}": (component("Oscillator"), {"x_0": 0.1 * k, "stiffness": 10.0**k}) for k in range(6)}
    system = wired("motor.y -> m0.support", *(f"m{k}.x -> m{k + 1}.support" for k in (0, 1, 3, 4)), **parts)
    force = {"m2.x_force": lambda t: float(t > 0.72), "m3.support": lambda t: (t**3, 3 * t**2, 6 * t)}
    same_by_calls_of_python(lambda: system.simulate(2.0, 0.05, coupling="implicit", inputs=force))


def test_a_port_with_a_kink(component, same_by_calls_of_python) -> None:
    """It is announced, and the past is forgotten there."""

    def run() -> Result:
        ramp = component("Ramp"), {"start_time": 1.0}
        system = wired("ramp.y -> mass.x_force", ramp=ramp, mass=(component("Oscillator"), {"x_0": 0.0}))
        result = system.simulate(2.0, 0.1)
        assert np.max(np.abs(result["mass.x"][result.time < 1.05])) < 1e-15
        return result

    same_by_calls_of_python(run)


def test_a_coupling_of_other_makes(fmu, same_by_calls_of_python) -> None:
    """They hold their inputs, and give no derivatives."""
    spring = fmu("buffer"), {"stiffness": 0.3}
    system = wired("cart.q -> spring.length", cart=(fmu("cart"), {"q_0": 1.0}), spring=spring)
    same_by_calls_of_python(lambda: system.simulate(1.0, 0.05, coupling="implicit"))


def test_adapted_coupled_steps(component, same_by_calls_of_python) -> None:
    upper, lower = ((component("Pendulum"), {"theta_0": 0.2 + k}) for k in range(2))
    system = wired("upper.bob -> lower.pivot", upper=upper, lower=lower)
    same_by_calls_of_python(lambda: system.simulate(1.0, 0.01, error_tolerance=1e-6))


@pytest.mark.parametrize("seed", range(20))
def test_elimination_solves_what_a_dense_one_does(seed: int) -> None:
    """By pivots that were chosen for other numbers, too, where these will do, and by new ones, where they will not."""
    random = np.random.default_rng(seed)
    n = int(random.integers(1, 40))
    pattern = {(k, k) for k in range(n)} | {(int(i), int(k)) for i, k in random.integers(0, n, (3 * n, 2))}
    pattern = sorted(pattern)
    elimination, library = Elimination(n, pattern), compiled.step_library(coupled=True)
    assert library is not None
    for scale in (1.0, 1.1, 0.0, 1e3):
        numbers, right = random.normal(size=len(pattern)), random.normal(size=n)
        numbers[[i == k for i, k in pattern]] += scale
        matrix = np.zeros((n, n))
        matrix[tuple(zip(*pattern, strict=True))] = numbers
        if np.linalg.cond(matrix) > 1e10:
            continue
        elimination.values[:] = numbers
        if not (elimination.record.ordered and library.eliminate(byref(elimination.record))):
            elimination.choose_pivots()
        solution = np.empty(n)
        library.solve(byref(elimination.record), c_void_p(right.ctypes.data), c_void_p(solution.ctypes.data))
        # pivots of a thousandth let rounding grow by 1e3, times that of a random system of this size
        np.testing.assert_allclose(
            matrix @ solution, right, rtol=0, atol=1e-9 * float(np.linalg.norm(matrix) * np.linalg.norm(solution))
        )


@pytest.mark.parametrize("inputs", [{}, {"upper.theta_force": lambda t: t}], ids=["a port", "a function of time"])
def test_coupling_without_a_compiler_is_explicit(component, monkeypatch, caplog, inputs) -> None:
    parts = {name: (component("Pendulum"), {"theta_0": 0.1}) for name in ("upper", "lower")}
    system = wired("upper.bob -> lower.pivot", **parts) if not inputs else wired(upper=parts["upper"])
    monkeypatch.setattr(compiled, "step_library", lambda **_: None)
    first = system.simulate(0.02, 0.01, inputs=inputs)
    assert (
        "would be coupled implicitly, but no C compiler is found: pip install 'liaisons[cross]': coupled by"
        in caplog.text
    )
    _assert_same_bits(first, system.simulate(0.02, 0.01, inputs=inputs, coupling="gauss-seidel"))
    with pytest.raises(
        SimulationError, match="coupling = 'implicit' repeats steps by compiled code, but no C compiler"
    ):
        system.simulate(0.02, 0.01, inputs=inputs, coupling="implicit")


def test_functions_of_time_are_called_by_python(versions) -> None:
    instants = []
    simulate(
        versions["Pendulum", "2"],
        stop_time=1.0,
        step_size=0.25,
        inputs={"theta_force": lambda t: instants.append(t) or 0.0},
    )
    assert {round(instant, 12) for instant in instants} >= {0.0, 0.25, 0.5, 0.75, 1.0}
    assert {type(instant) for instant in instants} == {float}


@pytest.mark.parametrize("source", ["compiled/loop.c", "compiled/coupling.c", "../model_exchange/dop853.c"])
def test_its_source_is_clean(source: str) -> None:
    cc = compiler.system_compiler() or compiler.zig_compiler() or []
    flags = ["-std=c99", "-Wall", "-Wextra", "-pedantic", "-Wconversion", "-Werror", "-fsyntax-only"]
    cosim = Path(compiled.__file__).parents[1]
    headers = cosim / "compiled", cosim.parent / "fmu/runtime"
    subprocess.run([*cc, *flags, *(f"-I{header}" for header in headers), cosim / source], check=True)


_loaded = partial(compiled.cached_library.__wrapped__, compiled.STEPS, "steps are made by Python")


def test_it_is_compiled_once_a_user(monkeypatch, tmp_path) -> None:
    monkeypatch.setattr("liaisons.base.cache.folder", lambda: tmp_path / "cache")
    monkeypatch.setattr("liaisons.base.cache._entries", {})
    assert _loaded() is not None
    (library,) = (path for path in (tmp_path / "cache").iterdir() if path.is_file())
    monkeypatch.setattr("liaisons.cosim.compiled.library.compile_library", lambda *_: pytest.fail("compiled again"))
    monkeypatch.setattr("liaisons.base.cache._entries", {})  # as in another process
    found = _loaded()
    assert found is not None
    assert Path(found._name) == library


def test_where_nothing_can_be_kept(monkeypatch, tmp_path) -> None:
    (tmp_path / "cache").write_text("a file, where a folder is wanted", encoding="utf-8")
    monkeypatch.setattr("liaisons.base.cache.folder", lambda: tmp_path / "cache")
    assert _loaded() is not None
    assert [path.name for path in tmp_path.iterdir()] == ["cache"]


def test_without_a_compiler(monkeypatch, tmp_path, caplog) -> None:
    def refuse(*_: object) -> bytes:
        raise BuildError("no C compiler is found")

    monkeypatch.setattr("liaisons.base.cache.folder", lambda: tmp_path)
    monkeypatch.setattr("liaisons.base.cache._entries", {})
    monkeypatch.setattr("liaisons.cosim.compiled.library.compile_library", refuse)
    with caplog.at_level(logging.INFO, "liaisons.cosim"):
        assert _loaded() is None
    assert "made by Python: no C compiler is found" in caplog.text


@pytest.mark.parametrize("content", [b"", b"\x7fELF", None, b"no library"], ids=["empty", "head", "half", "text"])
def test_damaged_library_in_the_cache_is_made_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, content: bytes | None
) -> None:
    """Half a library is loaded, and ends the process when its missing pages are touched."""
    monkeypatch.setattr("liaisons.base.cache.folder", lambda: tmp_path)
    assert _loaded() is not None
    (library,) = (path for path in tmp_path.iterdir() if path.is_file())
    whole = library.read_bytes()
    library.unlink()  # what is loaded stays whole
    library.write_bytes(whole[: len(whole) // 2] if content is None else content)
    assert _loaded() is not None
    assert library.read_bytes() == whole
