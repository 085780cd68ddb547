"""Sweeps that are interrupted and go on."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any, final

import numpy as np
import pytest

from liaisons import Result
from liaisons.sweeps import JournalError, SweepError, sweep
from liaisons.sweeps.journal import Journal

SPAN: dict[str, Any] = {"stop_time": 0.5, "step_size": 0.05}
CASES = {"theta_0": np.linspace(0.1, 1.0, 8), "mass": [1.0, 2.0, -1.0, 1.0, 1.0, 1.0, 1.0, 1.0]}


@final
class Counted:
    """A function of the result that writes down how often it was called, in whatever process."""

    def __init__(self, log: Path) -> None:
        self._log = log
        self._log.touch()

    def __call__(self, result: Result) -> float:
        with self._log.open("a", encoding="utf-8") as file:
            file.write("called\n")
        return result["theta"][-1]

    def calls(self) -> int:
        """Since it was asked last."""
        count = len(self._log.read_text(encoding="utf-8").splitlines())
        self._log.write_text("", encoding="utf-8")
        return count


@pytest.fixture
def counted(tmp_path) -> Counted:
    return Counted(tmp_path / "calls")


def test_finished_cases_are_not_done_again(pendulum, tmp_path, counted) -> None:
    journal = tmp_path / "journal"
    whole = sweep(pendulum, CASES, {"theta": counted}, journal=journal, **SPAN)
    assert counted.calls() == 7  # one fails
    lines = journal.read_bytes().splitlines(keepends=True)
    # Interrupted in the middle of the fifth case's line; a line in the middle is damaged, too.
    journal.write_bytes(b"".join([*lines[:3], b"?" + lines[3], lines[4], lines[5][:7]]))
    done = {json.loads(line)["case"] for line in (*lines[1:3], lines[4])}
    again = sweep(pendulum, CASES, {"theta": counted}, journal=journal, **SPAN)
    assert counted.calls() == len(set(range(8)) - done - {2})
    assert whole.rows.tobytes() == again.rows.tobytes()
    assert whole.failures == again.failures
    # nothing left to do, and the journal is whole again
    third = sweep(pendulum, CASES, {"theta": counted}, journal=journal, **SPAN)
    assert third.rows.tobytes() == whole.rows.tobytes()
    assert counted.calls() == 0


def test_a_header_that_is_half_written(pendulum, tmp_path, counted) -> None:
    journal = tmp_path / "journal"
    sweep(pendulum, CASES, {"theta": counted}, journal=journal, **SPAN)
    journal.write_bytes(journal.read_bytes()[:10])
    counted.calls()
    sweep(pendulum, CASES, {"theta": counted}, journal=journal, **SPAN)
    assert counted.calls() == 7


@pytest.mark.parametrize("change", ["cases", "keep", "span", "starts", "function"])
def test_the_journal_of_another_sweep_is_refused(pendulum, tmp_path, change) -> None:
    journal = tmp_path / "journal"
    scale = 1.0
    first = {"x": lambda result: scale * result["theta"][-1]}
    sweep(pendulum, CASES, first, journal=journal, **SPAN)
    before = journal.read_bytes()
    cases, keep, options = CASES, first, dict(SPAN)
    if change == "cases":
        cases = CASES | {"theta_0": np.linspace(0.1, 1.1, 8)}
    elif change == "keep":
        keep = {"x": lambda result: result["theta"][0]}
    elif change == "span":
        options["step_size"] = 0.025
    elif change == "starts":
        options["starts"] = {"gravity": 9.8}
    else:
        scale = 2.0  # which the function has closed over
    with pytest.raises(JournalError, match="another sweep"):
        sweep(pendulum, cases, keep, journal=journal, **options)
    assert journal.read_bytes() == before


def test_a_file_that_is_no_journal_stays_as_it_is(pendulum, tmp_path) -> None:
    for content in (b"important\nlines\n", b"important", b'{"a": 1}\n'):
        file = tmp_path / "notes"
        file.write_bytes(content)
        with pytest.raises(JournalError, match="no journal"):
            sweep(pendulum, CASES, ["theta"], journal=file, **SPAN)
        assert file.read_bytes() == content
    with pytest.raises(SweepError, match="cannot be used as a journal"):
        sweep(pendulum, CASES, ["theta"], journal=tmp_path / "missing" / "journal", **SPAN)


@pytest.mark.usefixtures("interruptible")
def test_interrupted_on_the_command_line(pendulum, tmp_path) -> None:
    def command(*more: str) -> list[str]:
        grid = ["--over", "theta_0=0.1:3:40", "--over", "length=0.5,1", "--keep", "theta", "--stop", "20", *more]
        return [
            sys.executable,
            "-c",
            "import sys; from liaisons.cli import main; sys.exit(main())",
            "sweep",
            str(pendulum),
            *grid,
        ]

    csv, journal = tmp_path / "table.csv", tmp_path / "table.csv.journal"
    process = subprocess.Popen(command("--csv", str(csv)), stderr=subprocess.PIPE)
    while process.poll() is None and (not journal.exists() or journal.read_bytes().count(b"\n") < 10):
        time.sleep(0.02)
    process.send_signal(signal.SIGINT)
    _, said = process.communicate(timeout=60)
    assert process.returncode == 130, said
    assert b"interrupted" in said
    assert not csv.exists()
    done = journal.read_bytes().count(b"\n") - 1
    assert 9 <= done < 80
    subprocess.run(command("--csv", str(csv)), check=True, capture_output=True)
    assert not journal.exists()
    whole = tmp_path / "whole.csv"
    subprocess.run(command("--csv", str(whole), "--workers", "1"), check=True, capture_output=True)
    assert csv.read_bytes() == whole.read_bytes()


@pytest.mark.skipif(sys.platform == "win32", reason="no limit to the size of files")
def test_a_full_disk_loses_nothing_that_was_written(tmp_path) -> None:
    import resource

    path, limits = tmp_path / "journal", resource.getrlimit(resource.RLIMIT_FSIZE)
    cases = dict.fromkeys(range(40), (1.0,))
    with Journal(path, "key", 1) as journal:
        resource.setrlimit(resource.RLIMIT_FSIZE, (500, limits[1]))
        try:
            with pytest.raises(SweepError, match="journal: cannot be written: File too large; make room"):
                journal.add(cases)
        finally:
            resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    # closing it has written the rest, now that there is room again; what a crash would have left:
    path.write_bytes(path.read_bytes()[:500])
    with Journal(path, "key", 1) as journal:
        assert 0 < len(journal.done) < len(cases)
        journal.add({case: values for case, values in cases.items() if case not in journal.done})
    with Journal(path, "key", 1) as journal:
        assert journal.done == cases
