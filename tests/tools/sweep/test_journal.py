"""Sweeps that are interrupted and go on."""

from __future__ import annotations

import errno
import json
import os
import re
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import Any, final

import numpy as np
import pytest

from liaisons import Result
from liaisons_tools.sweeps import JournalError, SweepError, sweep
from liaisons_tools.sweeps.journal import Journal, _checksummed_line
from liaisons_tools.sweeps.measures import measure_identity
from liaisons_tools.sweeps.study import Completed

SPAN: dict[str, Any] = {"stop_time": 0.5, "step_size": 0.05}
CASES = {"theta_0": np.linspace(0.1, 1.0, 8), "mass": [1.0, 2.0, -1.0, 1.0, 1.0, 1.0, 1.0, 1.0]}


@final
@dataclass(frozen=True)
class Counted:
    """A function of the result that writes down how often it was called, in whatever process."""

    log: Path

    def __call__(self, result: Result) -> float:
        with self.log.open("a", encoding="utf-8") as file:
            file.write("called\n")
        return result["theta"][-1]

    def calls(self) -> int:
        """Since it was asked last."""
        count = len(self.log.read_text(encoding="utf-8").splitlines()) if self.log.exists() else 0
        self.log.write_text("", encoding="utf-8")
        return count


@pytest.fixture
def counted(tmp_path) -> Counted:
    return Counted(tmp_path / "calls")


@pytest.fixture
def swept(pendulum, tmp_path) -> Callable[..., Result]:
    """A sweep of CASES with a journal."""

    def run(keep: Any = "theta", **changes: Any) -> Result:
        return sweep(pendulum, CASES, keep, **{"journal": tmp_path / "journal"} | SPAN | changes)

    return run


def test_finished_cases_are_not_done_again(tmp_path, counted, swept) -> None:
    journal = tmp_path / "journal"
    whole = swept({"theta": counted})
    assert counted.calls() == 7  # one fails
    lines = journal.read_bytes().splitlines(keepends=True)
    journal.write_bytes(b"".join([*lines[:5], lines[5][:7]]))  # in the middle of the fifth case's line
    done = {json.loads(line)["case"] for line in lines[1:5]}
    again = swept({"theta": counted})
    assert counted.calls() == len(set(range(8)) - done - {2})
    assert whole.values.tobytes() == again.values.tobytes()
    assert whole.failures == again.failures
    # nothing left to do, and the journal is whole again
    third = swept({"theta": counted})
    assert third.values.tobytes() == whole.values.tobytes()
    assert counted.calls() == 0


def test_damaged_lines_say_nothing_and_are_done_again(tmp_path, counted, swept, caplog) -> None:
    journal, other = tmp_path / "journal", tmp_path / "other"
    whole = swept({"theta": counted}, workers=1)
    swept({"theta": counted}, start_values={"gravity": 9.8}, journal=other, workers=1)
    counted.calls()
    header, *lines = journal.read_bytes().splitlines()
    text = {number: line.decode() for number, line in enumerate(lines)}
    damaged = [
        text[0].replace('"case": 0', '"case": -1'),
        text[1].replace('"case": 1', '"case": 99999'),
        text[2].replace("mass", "moss"),
        re.sub(r"\d(?=])", lambda digit: str((int(digit[0]) + 1) % 10), text[3]),
        '"abc"',
        "null",
        other.read_text(encoding="utf-8").splitlines()[7],
        text[7],
    ]
    journal.write_bytes(b"\n".join([header, *(line.encode() for line in damaged), b""]))
    again = swept({"theta": counted})
    assert counted.calls() == 6  # all but the last, and one fails
    assert again.values.tobytes() == whole.values.tobytes()
    assert again.failures == whole.failures
    (record,) = [record for record in caplog.records if record.name == "liaisons.sweeps"]  # Dask has its own
    assert "journal: damaged lines are left out, and their cases done again: 2, 3, 4, 5, 6 and 2 more" in record.message


@pytest.mark.parametrize(
    "content",
    [
        {"case": -1, "values": [1.0]},
        {"case": 8, "values": [1.0]},
        {"case": 0.0, "values": [1.0]},
        {"case": 0, "values": [1.0, 2.0]},
        {"case": 0, "values": ["1.0"]},
        {"case": 0, "failure": None},
        {"case": 0},
        {},
    ],
)
def test_a_whole_line_that_cannot_be_of_the_sweep_is_refused(tmp_path, content) -> None:
    path = tmp_path / "journal"
    with Journal(path, "key", 8, 1) as journal:
        journal._write(_checksummed_line(content, journal._seed))
    with pytest.raises(JournalError, match=r"journal: line 2 is none of this sweep of 8 cases; delete the line"):
        Journal(path, "key", 8, 1)


def test_the_first_line_is_checked_too(tmp_path) -> None:
    path = tmp_path / "journal"
    Journal(path, "key", 8, 1).__exit__()
    path.write_bytes(path.read_bytes().replace(b"key", b"kez"))
    with pytest.raises(JournalError, match="line 1, which names the sweep, is damaged or of an earlier release"):
        Journal(path, "key", 8, 1)


def test_a_second_sweep_with_the_same_journal_is_refused(tmp_path, swept) -> None:
    path = tmp_path / "journal"
    swept()
    before = path.read_bytes()
    holder = "import sys, time; from pathlib import Path; from liaisons_tools.sweeps.journal import Journal; "
    holder += "journal = Journal(Path(sys.argv[1]), sys.argv[2], 8, 1); print('open', flush=True); time.sleep(60)"
    key = json.loads(before.splitlines()[0])["liaisons sweep"]
    with subprocess.Popen([sys.executable, "-c", holder, str(path), key], stdout=subprocess.PIPE) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == b"open\n"
        with pytest.raises(JournalError, match="journal is in use by another sweep; let that end"):
            swept()
        process.kill()
    assert path.read_bytes() == before
    swept()  # a lock does not outlive its process


@pytest.mark.parametrize(
    ("error", "words"),
    [
        (OSError(errno.ENOSPC, "No space left"), "No space left"),
        (MemoryError("none left"), "none left"),
        (None, "died"),
    ],
)
@pytest.mark.variants(core=0)
def test_what_the_machine_has_not_finished_is_tried_again(pendulum, tmp_path, error, words) -> None:
    journal, sign = tmp_path / "journal", tmp_path / "sign"
    sign.touch()
    cases = {"theta_0": [0.1, 0.9, 0.2], "mass": [1.0, 1.0, -1.0]}

    def broken(result: Result) -> float:
        """It fails as the machine does, as long as there is a file."""
        if sign.exists() and result["theta"][0] > 0.5:
            if error:
                raise error
            os.kill(os.getpid(), signal.SIGKILL)
        return result["theta"][-1]

    keep = {"theta": broken}
    first = sweep(pendulum, cases, keep, journal=journal, workers=1, **SPAN)
    assert (first.failures.keys(), first.unfinished) == ({1, 2}, (1,))
    assert words in first.failures[1]
    assert b'"unfinished": ' in journal.read_bytes()
    sign.unlink()
    second = sweep(pendulum, cases, keep, journal=journal, workers=1, **SPAN)
    assert (second.failures.keys(), second.unfinished) == ({2}, ())
    assert second["theta"][1] == sweep(pendulum, cases, ["theta"], **SPAN)["theta"][1]


def test_retry_does_what_has_failed_again_for_whatever_reason(swept, monkeypatch) -> None:
    swept()
    done: list[int] = []

    def simulate(_plan: object, cases: list[int], _count: int, deliver: Callable[..., None], _limit: object) -> None:
        done.extend(cases)
        deliver(dict.fromkeys(cases, Completed((7.0,))))

    monkeypatch.setattr(import_module("liaisons_tools.sweeps.sweeping"), "simulate_locally", simulate)
    assert swept().failures.keys() == {2}
    assert done == []
    again = swept(retry=True)
    assert (done, again.failures, again["theta"][2]) == ([2], {}, 7.0)
    assert swept()["theta"][2] == 7.0
    with pytest.raises(SweepError, match="retry needs the journal"):
        swept(retry=True, journal=None)


def test_a_header_that_is_half_written(tmp_path, counted, swept) -> None:
    journal = tmp_path / "journal"
    swept({"theta": counted})
    journal.write_bytes(journal.read_bytes()[:10])
    counted.calls()
    swept({"theta": counted})
    assert counted.calls() == 7


@pytest.mark.parametrize(
    ("change", "scale"),
    [
        ({"cases": CASES | {"theta_0": np.linspace(0.1, 1.1, 8)}}, 1.0),
        ({"keep": {"x": lambda result: result["theta"][0]}}, 1.0),
        ({"step_size": 0.025}, 1.0),
        ({"start_values": {"gravity": 9.8}}, 1.0),
        ({}, 2.0),  # which the function has closed over
    ],
    ids=["cases", "keep", "span", "start_values", "function"],
)
def test_the_journal_of_another_sweep_is_refused(pendulum, tmp_path, change, scale) -> None:
    factor = 1.0
    first: dict[str, Any] = {"cases": CASES, "keep": {"x": lambda result: factor * result["theta"][-1]}, **SPAN}
    first["journal"] = journal = tmp_path / "journal"
    sweep(pendulum, **first)
    before, factor = journal.read_bytes(), scale
    with pytest.raises(JournalError, match="another sweep"):
        sweep(pendulum, **first | change)
    assert journal.read_bytes() == before


def test_a_file_that_is_no_journal_stays_as_it_is(tmp_path, swept) -> None:
    for content in (b"important\nlines\n", b"important", b'{"a": 1}\n'):
        file = tmp_path / "notes"
        file.write_bytes(content)
        with pytest.raises(JournalError, match="no journal"):
            swept(journal=file)
        assert file.read_bytes() == content
    with pytest.raises(SweepError, match="cannot be used as a journal"):
        swept(journal=tmp_path / "missing" / "journal")


@pytest.mark.usefixtures("interruptible")
@pytest.mark.variants(core=0)
def test_interrupted_on_the_command_line(pendulum, tmp_path) -> None:
    def command(*more: str) -> list[str]:
        liaisons = [sys.executable, "-c", "import sys; from liaisons_tools.cli import main; sys.exit(main())"]
        grid = ["--over", "theta_0=0.1:3:40", "--over", "length=0.5,1", "--keep", "theta", "--stop", "20", *more]
        return [*liaisons, "sweep", str(pendulum), *grid]

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
    cases = dict.fromkeys(range(40), Completed((1.0,)))
    with Journal(path, "key", len(cases), 1) as journal:
        resource.setrlimit(resource.RLIMIT_FSIZE, (500, limits[1]))
        try:
            with pytest.raises(SweepError, match="journal: cannot be written: File too large; make room"):
                journal.add(cases)
        finally:
            resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    # closing it has written the rest, now that there is room again; what a crash would have left:
    path.write_bytes(path.read_bytes()[:500])
    with Journal(path, "key", len(cases), 1) as journal:
        assert 0 < len(journal.done) < len(cases)
        journal.add({case: values for case, values in cases.items() if case not in journal.done})
    with Journal(path, "key", len(cases), 1) as journal:
        assert journal.done == cases


def test_functions_that_differ_in_defaults_or_what_they_enclose_are_others() -> None:
    def of(factor: float) -> Any:
        return lambda result: factor * result["theta"][-1]

    def by_default(result: Result, factor: float = 1.0) -> float:
        return factor * result["theta"][-1]

    first = measure_identity(by_default)
    by_default.__defaults__ = (2.0,)
    assert measure_identity(by_default) != first
    assert measure_identity(of(1.0)) == measure_identity(of(1.0))
