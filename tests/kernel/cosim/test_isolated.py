"""FMUs in processes of their own: the same bits; whatever they do, the run ends in order and no process is left."""

from __future__ import annotations

import logging
import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from equations import equations
from making import FmuPaths, wait_for, wired

from liaisons import isolation
from liaisons.cosim import IncompleteError, simulate
from liaisons.errors import SimulationError
from liaisons_tools.sweeps import sweep

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="Linux")
APART: dict[str, Any] = {"isolated": True}


@pytest.fixture(autouse=True)
def _no_process_is_left(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    processes: list[int] = []
    fork = os.fork
    monkeypatch.setattr(os, "fork", lambda: processes.append(fork()) or processes[-1])
    yield
    for process in processes:
        with pytest.raises(ChildProcessError):  # neither does it run nor has nobody waited for it
            os.waitpid(process, os.WNOHANG)


# ---- crashes -------------------------------------------------------------------------------------------------------


@pytest.mark.usefixtures("either_loop")
@pytest.mark.parametrize(
    ("how", "limit", "words"),
    [
        (0, True, "crashed (SIGSEGV)"),
        (1, True, "crashed (SIGABRT)"),
        (2, True, "crashed (exit status 3)"),
        (3, True, "crashed (SIGFPE)"),
        (4, 0.3, "has not returned within 0.3 s; give isolated more seconds if it needs them"),
    ],
)
def test_crash_in_step_500(fmu: FmuPaths, how: int, limit: float, words: str) -> None:
    bad = fmu("Fragile"), {"last": 500, "how": how, "isolated": limit}
    system = wired("good.y -> bad.u", good=fmu("Cubic"), bad=bad)
    with pytest.raises(IncompleteError) as caught:
        system.simulate(10.0, 0.01)
    assert str(caught.value) == f"bad: fmi2DoStep from t = 4.99 s to t = 5 s {words}"
    result = caught.value.result
    assert len(result.time) == 500  # the begin and 499 steps
    assert result["bad.x"][-1] == pytest.approx(4.99, abs=1e-12)
    assert result["bad.u"][-1] == pytest.approx(4.99**3, abs=1e-9)


def test_crash_of_one_of_which_nothing_is_read(fmu: FmuPaths) -> None:
    system = wired("good.y -> bad.u", good=fmu("Cubic"), bad=(fmu("Fragile"), APART | {"last": 5}))
    with pytest.raises(IncompleteError, match=r"^bad: fmi2DoStep from t = 0.4 s to t = 0.5 s crashed") as caught:
        system.simulate(1.0, 0.1, record="good.y")
    assert caught.value.result.time == pytest.approx([0.0, 0.1, 0.2, 0.3, 0.4])


@pytest.mark.parametrize(
    ("name", "when", "what"),
    [
        ("Crashing", None, r"its instantiation crashed \(SIGABRT\)"),
        ("Crashing_at_once", 0, r"its instantiation crashed \(SIGSEGV\)"),
        ("Crashing_later", 1, r"fmi2ExitInitializationMode crashed \(SIGSEGV\)"),
    ],
)
def test_crash_at_the_begin(fmu: FmuPaths, name: str, when: int | None, what: str) -> None:
    starts: dict[str, Any] = {} if when is None else {"when": when}
    with pytest.raises(SimulationError, match=f"^{name}: {what}$"):
        simulate(fmu(name), stop_time=1.0, step_size=0.1, isolated=True, **starts)


def test_crash_while_steps_are_repeated(fmu: FmuPaths) -> None:
    """In implicit coupling, where states are saved, and where step sizes are adapted."""
    system = wired("mass.q -> buffer.length", mass=(fmu("Cart"), APART | {"q_0": 1.0}), buffer=(fmu("Buffer"), APART))
    fragile = system.add("bad", fmu("Fragile"), last=30, **APART)
    system.connect(system.parts["mass"]["q"], fragile["u"])
    ways: list[dict[str, Any]] = [{"coupling": "implicit"}, {"coupling": "jacobi", "error_tolerance": 1e-3}]
    for options in ways:
        with pytest.raises(IncompleteError, match=r"^bad: fmi2DoStep from t = .* crashed \(SIGSEGV\)$"):
            system.simulate(100.0, 0.1, **options)


@pytest.mark.parametrize("how", [0, 2])
def test_crash_in_a_sweep(fmu: FmuPaths, how: int) -> None:
    table = sweep(fmu("Fragile"), {"last": [0, 5, 50]}, ["x"], start_values={"how": how}, stop_time=1.0, step_size=0.1)
    reason = {0: "SIGSEGV", 2: "exit status 3"}[how]
    assert table.failures == {1: f"Fragile: fmi2DoStep from t = 0.4 s to t = 0.5 s crashed ({reason})"}
    assert table.unfinished == (1,)
    assert table["x"][[0, 2]].tolist() == [1.0, 1.0]


# ---- the same as in this process -----------------------------------------------------------------------------------


@pytest.mark.usefixtures("either_loop")
@pytest.mark.parametrize("kind", ["", "fmi3/", "python/"])
def test_same_bits(component: FmuPaths, kind: str) -> None:
    path = component(f"{kind}Pendulum")
    here, there = (simulate(path, stop_time=1.0, step_size=0.01, isolated=i, theta_0=0.3) for i in (False, True))
    assert np.array_equal(here.values, there.values)


@pytest.mark.parametrize("kind", ["", "fmi3/"])
@pytest.mark.parametrize(
    "options",
    [{"coupling": "implicit"}, {"coupling": "waveform"}, {"coupling": "jacobi"}, {"error_tolerance": 1e-6}],
    ids=str,
)
def test_same_bits_coupled(component: FmuPaths, kind: str, options: dict[str, Any]) -> None:
    path = component(f"{kind}Pendulum")

    def result(**where: Any) -> np.ndarray:
        system = wired("a.bob -> b.pivot", a=(path, {"theta_0": 0.3, **where}), b=(path, {"theta_0": 0.5, **where}))
        return system.simulate(0.3, 0.01, **options).values

    assert np.array_equal(result(), result(isolated=True))


@pytest.mark.usefixtures("either_loop")
@pytest.mark.parametrize(
    ("name", "starts"),
    [
        ("Faulty", {"time_of_failure": 0.45}),
        ("Faulty", {"limit": -1.0}),
        ("Hasty", {"longest": 0.01, "status": 3}),
        ("Mute", {}),
        ("Faulty", {"time_of_failure": 0.45, "status": 4}),
    ],
)
def test_refusals_are_told_as_ever(fmu: FmuPaths, name: str, starts: dict[str, Any]) -> None:
    def words(**where: Any) -> tuple[str, int]:
        with pytest.raises(SimulationError) as caught:
            simulate(fmu(name), stop_time=1.0, step_size=0.1, **starts, **where)
        return str(caught.value), len(caught.value.result.time) if isinstance(caught.value, IncompleteError) else 0

    assert words() == words(isolated=True)


@pytest.mark.usefixtures("either_loop")
@pytest.mark.parametrize("last", [0.6, 0.55])
def test_end_that_an_fmu_asks_for(fmu: FmuPaths, last: float) -> None:
    here, there = (simulate(fmu("Finite"), stop_time=1.0, step_size=0.1, last=last, isolated=i) for i in (False, True))
    assert here.time.tolist() == there.time.tolist()
    assert np.array_equal(here.values, there.values)


def test_steps_that_are_refused_are_made_shorter(fmu: FmuPaths) -> None:
    hasty = wired(hasty=(fmu("Hasty"), APART | {"longest": 0.1}))
    assert hasty.simulate(1.0, 0.5, error_tolerance=1.0).time[-1] == 1.0


# ---- processes -----------------------------------------------------------------------------------------------------


def _gone(process: int) -> bool:
    try:
        return Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()[0] in "ZX"
    except FileNotFoundError:
        return True


@pytest.mark.usefixtures("interruptible")
@pytest.mark.parametrize("how", [signal.SIGINT, signal.SIGKILL, signal.SIGTERM])
def test_no_process_is_left_when_its_parent_ends(fmu: FmuPaths, tmp_path: Path, how: signal.Signals) -> None:
    """In a call that never returns: a second interrupt acts at once."""
    mark = tmp_path / "mark"
    options = "stop_time=1.0, step_size=0.1, isolated=True, last=3, how=4"
    script = f"import sys; from liaisons.cosim import simulate; simulate(sys.argv[1], {options})"
    parent = subprocess.Popen(
        [sys.executable, "-c", script, str(fmu("Fragile"))],
        env={**os.environ, "FRAGILE": str(mark)},
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )
    wait_for(lambda: mark.exists() and mark.read_text())
    child = int(mark.read_text())
    os.killpg(parent.pid, how) if how == signal.SIGINT else parent.send_signal(how)
    if how == signal.SIGINT:
        time.sleep(1.0)  # two at once would be one
        os.killpg(parent.pid, how)
    _, said = parent.communicate(timeout=60)
    if how == signal.SIGINT:
        assert "interrupted at t = 0.2 of 1 s" in said
    wait_for(lambda: _gone(child))


@pytest.mark.usefixtures("interruptible")
@pytest.mark.parametrize(("how", "far"), [("end", 1), ("crash", 1), ("hang", 0), ("kill", 1)])
def test_no_process_of_its_own_is_left(fmu: FmuPaths, tmp_path: Path, how: str, far: int) -> None:
    """It forks at the begin, even one of another session and without a parent."""
    mark = tmp_path / "mark"
    starts = {"last": 0 if how == "end" else 3, "how": 0 if how == "crash" else 4, "far": far}
    more = "".join(f", {name}={value}" for name, value in starts.items())
    options = f"stop_time=1.0, step_size=0.1, isolated={60 if how == 'kill' else 0.5}{more}"
    script = f"import sys; from liaisons.cosim import simulate; simulate(sys.argv[1], {options}); print('done')"
    environment = {**os.environ, "FORKING": str(mark), "FRAGILE": str(tmp_path / "hangs")}
    command = [sys.executable, "-c", script, str(fmu("Forking"))]
    task = subprocess.Popen(command, env=environment, text=True, stdout=subprocess.PIPE, stderr=subprocess.PIPE)
    with task as parent:
        if how == "kill":
            wait_for((tmp_path / "hangs").exists)
            parent.kill()
        out, said = parent.communicate(timeout=60)
    words = {"end": "", "crash": "crashed (SIGSEGV)", "hang": "has not returned within 0.5 s", "kill": ""}[how]
    assert words in said
    assert bool(out) == (how == "end")
    forked = int(mark.read_text())
    if how == "kill":  # nobody waits for that
        wait_for(lambda: _gone(forked))
    assert _gone(forked)


def test_elsewhere_it_runs_in_this_process(
    fmu: FmuPaths, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setattr("liaisons.cosim.instances.isolation", lambda: None)
    with caplog.at_level(logging.WARNING, "liaisons.cosim"):
        simulate(fmu("Cubic"), stop_time=1.0, step_size=0.5, isolated=True)
    assert "Cubic: isolation needs Linux; running in this process" in caplog.text


@pytest.mark.parametrize("value", [-1.0, float("inf"), float("nan"), "yes", None])
def test_what_isolated_can_be(fmu: FmuPaths, value: Any) -> None:
    with pytest.raises(SimulationError, match=r"^bad: isolated = .*: give True, or the seconds that a call may take$"):
        wired(bad=(fmu("Cubic"), {"isolated": value}))


# ---- what is said there ----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("exchange", [False, True])
def test_warnings_are_those_of_an_fmu_in_this_process(fmu: FmuPaths, tmp_path: Path, exchange: bool) -> None:
    """Those that the FMU logs, and ours of what it says; each reaches the result."""
    one = equations(tmp_path, 1, nominals="nominal[0] = -1;") if exchange else fmu("Faulty")
    starts: dict[str, Any] = {} if exchange else {"status": 1, "time_of_failure": 0.15}
    runs = [simulate(one, stop_time=0.3, step_size=0.1, isolated=isolated, **starts) for isolated in (False, True)]
    assert runs[0].warnings == runs[1].warnings
    assert len(runs[0].warnings) == (1 if exchange else 2)


def test_what_it_says_before_it_crashes_is_heard(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    code = {"nominals": "nominal[0] = NAN;", "rates": "f[0] = 1; if (t > 0.5) abort();"}
    with pytest.raises(IncompleteError, match=r"crashed \(SIGABRT\)") as caught:
        simulate(equations(tmp_path, 1, 0, **code), stop_time=1.0, step_size=0.1, isolated=True)
    assert "nominal values of continuous states" in caught.value.result.warnings[0]
    assert len(caplog.records) == 1


def test_its_release_is_not_waited_for_as_long_as_a_step(fmu: FmuPaths, monkeypatch: pytest.MonkeyPatch) -> None:
    asked, limits = isolation.Isolated._ask, dict[str, float]()

    def noted(instance: isolation.Isolated, task: str, *message: Any) -> Any:
        limits[task] = instance._limit
        return asked(instance, task, *message)

    monkeypatch.setattr(isolation.Isolated, "_ask", noted)
    simulate(fmu("Cubic"), stop_time=1.0, step_size=0.5, isolated=60.0)
    assert (limits["its initialization"], limits["its release"]) == (60.0, 5.0)  # [s]
