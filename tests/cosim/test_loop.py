"""Communication steps by compiled code: the same bits as by Python, and Python where there is no compiler.

What is refused or interrupted is tested with either loop where that belongs, in test_system.py and test_fmi3.py.
"""

from __future__ import annotations

import logging
import subprocess
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import get_args

import pytest
from making import wired

from liaisons import compiler
from liaisons.cosim import Result, compiled, loop, simulate
from liaisons.cosim.schedule import Coupling
from liaisons.errors import BuildError
from liaisons.fmu import build
from liaisons.fmu.layout import Fmi
from liaisons.library import catalogue
from liaisons.mechanics import assemble

pytestmark = pytest.mark.skipif(not (compiler.system_compiler() or compiler.zig_compiler()), reason="no C compiler")

Run = Callable[[], Result]
Versions = dict[tuple[str, str], Path]


@pytest.fixture(scope="session")
def versions(tmp_path_factory: pytest.TempPathFactory) -> Versions:
    """Native FMUs by component and version of FMI."""
    folder = tmp_path_factory.mktemp("versions")
    kinds = [(name, fmi) for name in ("Pendulum", "Sinusoid") for fmi in get_args(Fmi)]
    return {(n, fmi): build(assemble(catalogue()[n]), folder, backend="native", fmi=fmi) for n, fmi in kinds}


@pytest.fixture
def same_by_python(monkeypatch: pytest.MonkeyPatch) -> Callable[[Run], None]:
    """Holds a run against the same by Python, and makes sure that Python has no part in the first."""

    def compare(run: Run) -> None:
        def refuse(*_: object) -> None:
            raise AssertionError("Python makes the steps")

        with monkeypatch.context() as only_compiled:
            only_compiled.setattr(loop.Loop, "_advance", refuse)
            first = run()
        with monkeypatch.context() as without:
            without.setattr(loop, "compiled", lambda: None)
            second = run()
        assert len(first.names) > 10
        assert first.time.tobytes() == second.time.tobytes()
        assert all(first[name].tobytes() == second[name].tobytes() for name in first.names)

    return compare


@pytest.mark.parametrize("fmi", ["2", "3"])
def test_one_fmu(versions, same_by_python, fmi: str) -> None:
    same_by_python(lambda: simulate(versions["Pendulum", fmi], stop_time=3.0, step_size=0.01, theta_0=2.0))


@pytest.mark.parametrize("coupling", ["gauss-seidel", "jacobi"])
@pytest.mark.parametrize("fmi", [("2", "2"), ("2", "3"), ("3", "2")])
def test_a_system(versions, same_by_python, fmi: tuple[str, str], coupling: Coupling) -> None:
    def run() -> Result:
        operator = versions["Sinusoid", fmi[0]], {"offset": 1.0, "amplitude": 0.1, "angular_frequency": 6.0}
        swing = versions["Pendulum", fmi[1]], {"theta_0": 1.0}
        system = wired("operator.y -> swing.length", operator=operator, swing=swing)
        return system.simulate(3.0, 0.01, coupling=coupling)

    same_by_python(run)


def test_functions_of_time_are_called_by_python(versions) -> None:
    instants = []
    simulate(
        versions["Pendulum", "2"],
        stop_time=1.0,
        step_size=0.25,
        inputs={"theta_force": lambda t: instants.append(t) or 0.0},
    )
    assert set(instants) == {0.0, 0.25, 0.5, 0.75, 1.0}


@pytest.mark.parametrize("source", ["loop.c", "instances/isolated.c"])
def test_its_source_is_clean(source: str) -> None:
    cc = compiler.system_compiler() or compiler.zig_compiler() or []
    flags = ["-std=c99", "-Wall", "-Wextra", "-pedantic", "-Wconversion", "-Werror", "-fsyntax-only"]
    subprocess.run([*cc, *flags, Path(loop.__file__).parent / source], check=True)


_loaded = partial(compiled.loaded.__wrapped__, Path(loop.__file__).with_name("loop.c"), "steps are made by Python")


def test_it_is_compiled_once_a_user(monkeypatch, tmp_path) -> None:
    monkeypatch.setattr("liaisons.cache.folder", lambda: tmp_path / "cache")
    assert _loaded() is not None
    (library,) = (tmp_path / "cache").iterdir()
    monkeypatch.setattr(compiled, "compile_library", lambda *_: pytest.fail("compiled again"))
    found = _loaded()
    assert found is not None
    assert Path(found._name) == library


def test_where_nothing_can_be_kept(monkeypatch, tmp_path) -> None:
    (tmp_path / "cache").write_text("a file, where a folder is wanted", encoding="utf-8")
    monkeypatch.setattr("liaisons.cache.folder", lambda: tmp_path / "cache")
    assert _loaded() is not None
    assert [path.name for path in tmp_path.iterdir()] == ["cache"]


def test_without_a_compiler(monkeypatch, tmp_path, caplog) -> None:
    def refuse(*_: object) -> bytes:
        raise BuildError("no C compiler is found")

    monkeypatch.setattr("liaisons.cache.folder", lambda: tmp_path)
    monkeypatch.setattr(compiled, "compile_library", refuse)
    with caplog.at_level(logging.INFO, "liaisons.cosim"):
        assert _loaded() is None
    assert "made by Python: no C compiler is found" in caplog.text
