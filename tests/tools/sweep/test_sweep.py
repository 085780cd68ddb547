"""Sweeps in processes of this machine, against one simulation after the other."""

from __future__ import annotations

import ctypes
import os
import select
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, get_args

import numpy as np
import pytest

from liaisons import Result, System, simulate
from liaisons.cosim import Coupling
from liaisons.errors import SimulationError
from liaisons.models import Pendulum
from liaisons_tools.sweeps import SweepError, grid, sweep
from liaisons_tools.sweeps.workers import _Worker

SPAN: dict[str, Any] = {"stop_time": 1.0, "step_size": 0.05}
CASES = grid({"theta_0": np.linspace(0.1, 3.0, 6), "length": [0.5, 1.0]})


def one_by_one(fmu: Path) -> list[Result]:
    cases: list[dict[str, Any]] = [
        dict(zip(CASES, values, strict=True)) for values in zip(*CASES.values(), strict=True)
    ]
    return [simulate(fmu, **SPAN, **case) for case in cases]


@pytest.mark.parametrize("workers", [1, 2])
def test_every_case_is_the_same_as_alone(pendulum, workers) -> None:
    keep = ["theta", "theta:max", "energy:min"]
    table = sweep(pendulum, CASES, keep, workers=workers, **SPAN)
    results = one_by_one(pendulum)
    assert table["theta"].tolist() == [result["theta"][-1] for result in results]
    assert table["theta:max"].tolist() == [result["theta"].max() for result in results]
    assert table["energy:min"].tolist() == [result["energy"].min() for result in results]
    assert np.array_equal(table["length"], CASES["length"])
    assert table.title == "Pendulum"
    assert dict(table.units) == {"theta_0": "rad", "length": "m", "theta": "rad", "theta:max": "rad", "energy:min": "J"}


@pytest.mark.parametrize("kind", [{"fmi": "3"}, {"backend": "python"}])
def test_other_kinds_of_fmus(fmu, kind) -> None:
    pendulum = fmu(Pendulum, **kind)
    cases = {"theta_0": [0.1, -1.0, 2.0], "mass": [1.0, -1.0, 2.0]}
    table = sweep(pendulum, cases, ["theta", "p_theta"], workers=1, **SPAN)
    for number in (0, 2):
        alone = simulate(pendulum, **SPAN, theta_0=cases["theta_0"][number], mass=cases["mass"][number])
        assert (table["theta"][number], table["p_theta"][number]) == (alone["theta"][-1], alone["p_theta"][-1])
    assert "mass" in table.failures[1]


def test_what_cases_are_warned_of_is_in_the_table(swing, where, tmp_path) -> None:
    # Jacobi's coupling holds the length over steps of 0.2 s: too long where it moves, right where it rests.
    options: dict[str, Any] = {"stop_time": 2.0, "step_size": 0.2, "coupling": "jacobi", **where}
    cases, journal = {"motor.amplitude": [0.0, 0.1, 0.05]}, tmp_path / "journal"
    table, again = (sweep(swing, cases, ["bob.theta"], journal=journal, **options) for _ in range(2))
    assert [text.partition(": coupling error")[0] for text in table.warnings] == ["case 1", "case 2"]
    assert "bob.length" in table.warnings[0]
    assert again.warnings == table.warnings


def test_functions_of_the_result_and_settings_in_common(pendulum) -> None:
    maps = Path("/proc/self/maps")

    def loaded(_: Result) -> bool:
        """Whether the FMU is in the very process of the case."""
        lines = maps.read_text().splitlines() if maps.exists() else [f"{tempfile.gettempdir()}.so"]
        return any(tempfile.gettempdir() in line and line.endswith(".so") for line in lines)

    keep = {"swing": lambda result: np.ptp(result["theta"]), "end": "theta", "loaded": loaded}
    table = sweep(
        pendulum, {"input_reconstruction": [0, 1]}, keep, start_values={"theta_0": 0.7, "length_dot": 0.1}, **SPAN
    )
    for number in range(2):
        alone = simulate(pendulum, **SPAN, theta_0=0.7, length_dot=0.1, input_reconstruction=number)
        assert (table["swing"][number], table["end"][number]) == (np.ptp(alone["theta"]), alone["theta"][-1])
    assert table["end"][0] != table["end"][1]
    assert table["loaded"].tolist() == [1, 1]


@pytest.mark.parametrize("coupling", [None, "jacobi"])
def test_a_system(swing, coupling, where) -> None:
    cases = {"motor.amplitude": [0.0, 0.1, 0.2], "bob.theta_0": [0.5, 0.6, 0.7]}
    table = sweep(swing, cases, ["bob.theta", "motor.y:max"], coupling=coupling, **where, **SPAN)
    for number in range(3):
        alone, amplitude = System("alone"), cases["motor.amplitude"][number]
        moved: dict[str, Any] = {"offset": 1.0, "angular_frequency": 6.0, "amplitude": amplitude}
        bob = alone.add("bob", swing.parts["bob"].fmu.path, theta_0=cases["bob.theta_0"][number])
        alone.connect(alone.add("motor", swing.parts["motor"].fmu.path, **moved)["y"], bob["length"])
        result = alone.simulate(1.0, 0.05, coupling=coupling)
        assert table["bob.theta"][number] == result["bob.theta"][-1]
        assert table["motor.y:max"][number] == result["motor.y"].max()


@pytest.fixture
def double(pendulum) -> System:
    """Two pendulums, coupled implicitly."""
    system = System("double")
    upper = system.add("upper", pendulum, theta_0=0.3)
    lower = system.add("lower", pendulum, theta_0=-0.2)
    system.connect(upper["bob"], lower["pivot"])
    return system


@pytest.mark.parametrize("coupling", get_args(Coupling))
def test_a_coupled_system_begins_anew_with_every_case(double, coupling: Coupling) -> None:
    table = sweep(double, {"lower.mass": [0.5, 1.0, 2.0, 1.0]}, ["lower.theta"], workers=1, coupling=coupling, **SPAN)
    # mass 1 is what the FMU has by itself
    alone = double.simulate(1.0, 0.05, coupling=coupling)["lower.theta"][-1]
    assert table["lower.theta"][1] == table["lower.theta"][3] == alone


def test_cases_that_fail_are_recorded_and_the_others_go_on(pendulum, caplog) -> None:
    table = sweep(pendulum, {"mass": [1.0, -1.0, 2.0, 0.0, 3.0]}, ["theta"], workers=1, **SPAN)
    assert table.failures.keys() == {1, 3}
    assert "mass = -1" in table.failures[1]
    assert np.isnan(table["theta"][[1, 3]]).all()
    assert table["theta"][4] == simulate(pendulum, **SPAN, mass=3.0)["theta"][-1]
    assert "liaisons" not in {
        record.name.partition(".")[0] for record in caplog.records
    }  # no complaint when what failed is put away


def test_a_killed_process_loses_no_case(pendulum, tmp_path, where) -> None:
    killed = tmp_path / "killed"

    def theta(result: Result) -> float:
        if result["theta"][0] > 1.5 and not killed.exists():
            killed.touch()
            os.kill(os.getpid(), signal.SIGKILL)
        return result["theta"][-1]

    table = sweep(pendulum, CASES, {"theta": theta}, **where, **SPAN)
    assert killed.exists()
    assert not table.failures
    assert table["theta"].tolist() == [result["theta"][-1] for result in one_by_one(pendulum)]


FATES: dict[str, tuple[Callable[[], object], str]] = {
    "crash": (
        lambda: os.kill(os.getpid(), signal.SIGKILL),
        "the process that simulated it died, 2 times (exit code -9)",
    ),
    # in foreign code, which looks neither at signals nor at its parent
    "hang": (lambda: ctypes.CDLL(None).sleep(1000), "took longer than the time limit of 2 s"),
    "full disk": (
        lambda: Path("/dev/full").write_text("x"),
        "keep: the function of 'theta' fails: OSError: [Errno 28] No space left on device",
    ),
}


@pytest.mark.parametrize("fate", FATES)
def test_a_case_that_never_ends_well_is_given_up(pendulum, tmp_path, where, fate) -> None:
    end, reason = FATES[fate]
    log = tmp_path / "log"

    def theta(result: Result) -> float:
        with log.open("a") as file:
            file.write(f"{os.getpid()}\n")
        if result["theta"][0] == 0.3:
            end()
        return result["theta"][-1]

    cases = {"theta_0": np.round(np.arange(1, 31) / 10, 1), "mass": [1.0, -1.0] + 28 * [1.0]}
    table = sweep(pendulum, cases, {"theta": theta}, time_limit=2.0 if fate == "hang" else None, **where, **SPAN)
    assert (table.failures.keys(), table.unfinished) == ({1, 2}, (2,))
    assert table.failures[2] == reason
    assert np.count_nonzero(np.isnan(table["theta"])) == 2
    assert [pid for pid in {*map(int, log.read_text().split())} if _lives(pid)] == []


def test_a_case_that_ends_as_its_time_is_up_is_done_again(pendulum, tmp_path, monkeypatch) -> None:
    end, begun = _Worker.end, tmp_path / "begun"

    def ended(worker: _Worker, patience: float) -> int | None:
        worker.current[0] = np.inf  # no case is under way
        return end(worker, patience)

    def theta(result: Result) -> float:
        if not begun.exists():
            begun.touch()
            time.sleep(1000)
        return result["theta"][-1]

    monkeypatch.setattr(_Worker, "end", ended)
    table = sweep(pendulum, {"theta_0": [0.1, 0.3]}, {"theta": theta}, workers=1, time_limit=2.0, **SPAN)
    assert (begun.exists(), table.failures) == (True, {})


def _lives(pid: int) -> bool:
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    return True


def test_what_is_ended_leaves_no_files(double, tmp_path, monkeypatch) -> None:
    """Systems that are coupled implicitly are extracted in the process, for each case."""
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))

    def crash(result: Result) -> float:
        Path(tempfile.mkdtemp(), "left").touch()
        os.kill(os.getpid(), signal.SIGKILL)
        return result["upper.theta"][-1]

    assert sweep(double, {"upper.theta_0": [0.1]}, {"theta": crash}, workers=1, **SPAN).unfinished == (0,)
    assert list(tmp_path.iterdir()) == []


def test_one_is_told_which_case_takes_long(pendulum, monkeypatch, caplog) -> None:
    monkeypatch.setattr("liaisons_tools.sweeps.workers._LONG_CASE", 0.2)

    def nap(result: Result) -> float:
        time.sleep(1.0 if result["theta"][0] == 0.3 else 0.0)
        return result["theta"][-1]

    assert not sweep(pendulum, {"theta_0": [0.1, 0.3]}, {"theta": nap}, workers=1, **SPAN).failures
    assert "a time limit (time_limit, --time-limit) would end it" in caplog.text


@pytest.mark.skipif(sys.platform == "win32", reason="signals of POSIX")
def test_workers_end_with_a_sweep_that_is_killed(pendulum) -> None:
    script = f"""
import ctypes, os
from liaisons_tools.sweeps import sweep
def hang(result):
    os.write(1, b"x")
    ctypes.CDLL(None).sleep(1000)
sweep({str(pendulum)!r}, {{"theta_0": [1.0, 2.0]}}, {{"theta": hang}}, stop_time=0.1, workers=2)
"""
    with subprocess.Popen([sys.executable, "-c", script], stdout=subprocess.PIPE) as process:
        assert process.stdout is not None
        assert process.stdout.read(2) == b"xx"  # both hang
        process.kill()
        assert select.select([process.stdout], [], [], 30.0)[0], "a worker lives on"  # it holds the other end
        assert process.stdout.read() == b""


def test_progress(pendulum, capsys, monkeypatch) -> None:
    monkeypatch.setenv("TTY_COMPATIBLE", "1")
    monkeypatch.setenv("TERM", "xterm")
    sweep(pendulum, CASES, ["theta"], progress=True, **SPAN)
    assert "12 of 12 cases" in capsys.readouterr().err
    sweep(pendulum, {"theta_0": [1.0]}, ["theta"], **SPAN)
    assert capsys.readouterr().err == ""  # unless it is asked for


@pytest.mark.parametrize(
    ("arguments", "error", "message"),
    [
        (({"theta0": [1.0]}, ["theta"]), SimulationError, "did you mean 'theta_0'"),
        (({"theta": [1.0]}, ["theta_dot"]), SimulationError, "cannot be set"),
        (({"theta_0": [1.0]}, ["tehta"]), SimulationError, "did you mean 'theta'"),
        (({"theta_0": [1.0]}, ["theta:mx"]), SweepError, "did you mean 'max'"),
        (({"theta_0": [1.0]}, []), SweepError, "nothing is kept"),
        (({"theta_0": [1.0]}, {"x": 7}), SweepError, "x = 7"),
        (({"length": [1.0]}, ["length"]), SweepError, "'length' is varied and kept"),
        (({"input_reconstruction": [0.5]}, ["theta"]), SimulationError, "input_reconstruction"),
    ],
)
def test_misuse(pendulum, arguments, error, message) -> None:
    with pytest.raises(error, match=message):
        sweep(pendulum, *arguments, **SPAN)


def test_misuse_of_settings(swing) -> None:
    with pytest.raises(SimulationError, match="no component 'bop'; did you mean 'bob'"):
        sweep(swing, {"bop.theta_0": [1.0]}, ["bob.theta"], **SPAN)
    with pytest.raises(SimulationError, match="stop_time"):
        sweep(swing, {"bob.theta_0": [1.0]}, ["bob.theta"])
