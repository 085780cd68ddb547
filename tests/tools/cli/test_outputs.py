"""Where signals are written to, when that is noticed, how much they may be, and what an interrupt leaves."""

import os
import signal
import stat
import subprocess
import threading
import time
from collections.abc import Callable
from pathlib import Path
from zipfile import ZipFile

import numpy as np
import pytest

from liaisons import System
from liaisons.base import clocks
from liaisons.cosim import Result, simulate
from liaisons.errors import SimulationError
from liaisons.library import fmu_path

from .conftest import COMMAND, Cli, Runs, Simulated, begun, is_misuse

pytestmark = pytest.mark.usefixtures("shared_fmus")

RESULT = Result("ramp", np.arange(3.0), ("x",), np.arange(3.0)[None], {"x": "m"})
TEXT = "time,x\n# s,m\n# title: ramp\n0.0,0.0\n1.0,1.0\n2.0,2.0\n"

# Links to devices: without what is tested here, the link would be replaced, not the device of this machine.
needs_devices = pytest.mark.skipif(not Path("/dev/full").exists(), reason="this system has no /dev/full")


@needs_devices
def test_a_device_stays_a_device(liaisons: Cli, runs: Runs, tmp_path: Path) -> None:
    (tmp_path / "null").symlink_to("/dev/null")
    (tmp_path / "full").symlink_to("/dev/full")
    runs("simulate", "Pendulum", "--stop", "0.1", "--csv", "null", "--plot", "null")
    reply = liaisons("simulate", "Pendulum", "--stop", "0.1", "--csv", "full")
    assert is_misuse(reply, "full: cannot be written: No space left on device")
    for name in ("null", "full"):
        assert (tmp_path / name).is_symlink()
        assert stat.S_ISCHR((tmp_path / name).stat().st_mode)


def test_links_are_followed(tmp_path: Path) -> None:
    (tmp_path / "there").mkdir()
    (tmp_path / "there" / "data.csv").write_text("old")
    for target in ("there/data.csv", "there/new.csv"):
        link = tmp_path / f"link to {Path(target).name}"
        link.symlink_to(target)
        RESULT.to_csv(link)
        assert link.is_symlink()
        assert (tmp_path / target).read_text() == TEXT
    assert sorted(path.name for path in (tmp_path / "there").iterdir()) == ["data.csv", "new.csv"]


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="this system has no named pipes")
@pytest.mark.parametrize("write", [RESULT.to_csv, RESULT.to_parquet, lambda path: RESULT.plot(path=path)])
def test_a_pipe_is_written_into(tmp_path: Path, write: Callable[[Path], object]) -> None:
    pipe, plain = tmp_path / "pipe", tmp_path / "plain"
    os.mkfifo(pipe)
    read: list[bytes] = []
    reader = threading.Thread(target=lambda: read.append(pipe.read_bytes()))
    reader.start()
    write(pipe)
    reader.join(timeout=30)
    write(plain)
    assert pipe.is_fifo()
    assert read == [plain.read_bytes()]
    assert sorted(path.name for path in tmp_path.iterdir()) == ["pipe", "plain"]


@pytest.mark.skipif(not Path("/dev/stdout").exists(), reason="this system has no /dev/stdout")
@pytest.mark.variants(core=0)
def test_the_standard_output(tmp_path: Path, fmus: Path) -> None:
    """Into a file as into a pipe: after what was printed, before what comes."""
    words = [*COMMAND, "simulate", "Pendulum", "--stop", "0.02", "--record", "theta", "--csv", "/dev/stdout"]
    environment = os.environ | {"LIAISONS_FMUS": str(fmus)}
    piped = subprocess.run(words, env=environment, capture_output=True, text=True, check=True, cwd=tmp_path).stdout
    with (tmp_path / "out.txt").open("w") as file:
        subprocess.run(words, env=environment, stdout=file, check=True, cwd=tmp_path)
    assert (tmp_path / "out.txt").read_text() == piped
    lines = piped.splitlines()
    notes = ["# title: Pendulum", "# estimates: coupling_error"]
    table = ["time", "# s", *notes, "0.0", "0.01", "0.02"]
    assert [line.split(",")[0] for line in lines[3:]] == [*table, "signals: /dev/stdout"]


def test_a_file_in_a_locked_folder_is_written_into(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "data.csv"
    path.write_text("old")
    same = path.stat().st_ino
    monkeypatch.setattr(os, "access", lambda _, mode: mode != os.W_OK)  # as root, no folder is locked
    RESULT.to_csv(path)
    assert (path.read_text(), path.stat().st_ino) == (TEXT, same)


def test_memory_is_estimated_from_what_is_recorded(monkeypatch: pytest.MonkeyPatch, fmus: Path) -> None:
    monkeypatch.setenv("LIAISONS_FMUS", str(fmus))
    monkeypatch.setattr(clocks, "_free_memory", lambda: 2e8)
    pendulum = fmu_path("Pendulum")
    with monkeypatch.context() as patch:
        patch.setattr("liaisons.cosim.system.run_to_end", lambda simulation, **_: len(simulation.times))
        assert simulate(pendulum, stop_time=1e6, step_size=1.0, record=["theta"]) == 1_000_001
    with pytest.raises(SimulationError, match=r"1e\+06 points, and 39 signals at each of them 0\.664 GB where 0\.2 GB"):
        simulate(pendulum, stop_time=1e6, step_size=1.0)
    system = System("one")
    system.add("a", pendulum)
    with pytest.raises(SimulationError, match="39 signals"):
        system.simulate(1e6, 1.0)
    # the size of a first attempt is no number of points
    assert len(system.simulate(10.0, 1e-8, error_tolerance=1e-6).time) < 1e4


def test_a_step_smaller_than_the_rounding_of_time() -> None:
    with pytest.raises(SimulationError, match=r"step_size = 0\.1: smaller than the rounding of times up to 1e\+17"):
        simulate("Pendulum", start_time=1e17 - 1e3, stop_time=1e17, step_size=0.1)


def test_the_default_experiment_says_when_to_begin(simulated: Simulated, tmp_path: Path) -> None:
    with ZipFile(fmu_path("Pendulum")) as old, ZipFile(tmp_path / "late.fmu", "w") as new:
        for name in old.namelist():
            content = old.read(name)
            if name == "modelDescription.xml":
                content = content.replace(b"<DefaultExperiment ", b'<DefaultExperiment startTime="0.5" ')
                content = content.replace(b'startTime="0.0"', b"").replace(b'startTime="0"', b"")
            new.writestr(old.getinfo(name), content)
    for given, first in (([], 0.5), (["--start", "0.25"], 0.25)):
        assert simulated("late.fmu", "--stop", "1", *given).time[0] == first
    assert simulate(tmp_path / "late.fmu", stop_time=1.0).time[0] == 0.5


def test_an_archive_that_says_nothing_of_its_experiment(simulated: Simulated, tmp_path: Path) -> None:
    """What its FMUs say: the latest end, the shortest step."""
    system = System("pair")
    components = [system.add("swing", fmu_path("Pendulum")), system.add("drive", fmu_path("Sinusoid"), offset=2.0)]
    system.connect(components[1]["y"], components[0]["length"])
    system.write_ssp(tmp_path / "pair.ssp")
    time = simulated("pair.ssp").time
    own = [component.fmu.experiment for component in components]
    assert time[-1] == max(e.stop_time or 0 for e in own)
    assert time[1] == min(e.step_size or 1 for e in own)


@pytest.mark.skipif(os.name != "posix", reason="interrupts of other processes are POSIX's")
@pytest.mark.usefixtures("interruptible")
@pytest.mark.variants(core=0)
def test_an_interrupt_keeps_what_there_is(tmp_path: Path, fmus: Path) -> None:
    words = ["simulate", "Pendulum", "--stop", "1e4", "--step", "1e-3", "--tolerance", "1e-10", "--record", "theta"]
    terminal = {"LIAISONS_FMUS": str(fmus), "TTY_COMPATIBLE": "1", "TERM": "xterm"}  # with a progress bar
    process = begun(*words, "--csv", "out.csv", folder=tmp_path, **terminal)
    assert process.stderr is not None
    while b"t = " not in os.read(process.stderr.fileno(), 4096):  # the run has begun
        assert process.poll() is None
    time.sleep(0.2)
    process.send_signal(signal.SIGINT)
    out, err = process.communicate(timeout=60)
    assert process.returncode == 130
    assert err.splitlines()[-1].endswith(b"liaisons: interrupted")
    assert b"signals: out.csv, up to t = " in out
    result = Result.from_csv(tmp_path / "out.csv")
    assert 0 < result.time[-1] < 1e4
    assert np.isfinite(result["theta"]).all()
    assert sorted(path.name for path in tmp_path.iterdir()) == ["out.csv"]


def test_a_run_that_fails_on_the_way_keeps_what_there_is(liaisons: Cli, tmp_path: Path) -> None:
    words = ("--input", "length=1 - t", "--stop", "3", "--step", "0.125", "--csv", "out.csv", "--plot", "out.png")
    reply = liaisons("simulate", "Pendulum", *words)
    assert is_misuse(reply, "length")
    end = Result.from_csv(tmp_path / "out.csv").time[-1]
    assert 0.5 < end < 1.0
    assert f"signals: out.csv, up to t = {end} s\n" in reply.out
    assert (tmp_path / "out.png").is_file()


def test_a_sweep_begins_there_too(runs: Runs, tmp_path: Path) -> None:
    """A free mass moves for the half second that is left, 0.75 s to 1.25 s."""
    words = ("--over", "x_dot_0=1,2", "--set", "x_0=0", "--set", "stiffness=0", "--set", "damping=0", "--keep", "x")
    span = ("--start", "0.75", "--stop", "1.25", "--step", "0.25")
    runs("sweep", "Oscillator", *words, *span, "--csv", "table.csv")
    assert Result.from_csv(tmp_path / "table.csv")["x"] == pytest.approx([0.5, 1.0], rel=1e-13)
