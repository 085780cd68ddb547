"""Sweeps on a Dask cluster of two workers on this machine."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest

from liaisons.sweeps import SweepError, grid, sweep

distributed = pytest.importorskip("distributed")

SPAN: dict[str, Any] = {"stop_time": 1.0, "step_size": 0.05}
CASES = grid({"theta_0": np.linspace(0.1, 3.0, 12), "length": [0.5, 1.0]})


@pytest.fixture(scope="module")
def client() -> Iterator[Any]:
    options = {"n_workers": 2, "threads_per_worker": 1, "processes": True, "dashboard_address": None}
    with distributed.LocalCluster(**options) as cluster, distributed.Client(cluster) as client:
        yield client


def test_two_workers_give_the_same_table_bit_by_bit(client, pendulum) -> None:
    cases = dict(CASES) | {"mass": np.where(np.arange(CASES.count) == 5, -1.0, 1.0)}
    keep = ["theta", "energy:max"]
    here = sweep(pendulum, cases, keep, **SPAN)
    there = sweep(pendulum, cases, keep, client=client, **SPAN)
    by_address = sweep(pendulum, cases, keep, client=client.scheduler.address, **SPAN)
    assert here.rows.tobytes() == there.rows.tobytes() == by_address.rows.tobytes()
    assert here.failures == there.failures == by_address.failures
    assert here.failures.keys() == {5}


def test_the_command_line_by_the_address(client, pendulum, tmp_path) -> None:
    """In a process that has no client of its own, as there is one here."""
    liaisons = [sys.executable, "-c", "from liaisons.cli import main; raise SystemExit(main())"]
    arguments = ["sweep", str(pendulum), "--over", "theta_0=0.1:3:12", "--keep", "theta", "--stop", "1"]
    for name, more in (("here", []), ("there", ["--dask", client.scheduler.address])):
        subprocess.run([*liaisons, *arguments, "--csv", str(tmp_path / name), *more], check=True)
    assert (tmp_path / "here").read_bytes() == (tmp_path / "there").read_bytes()


def test_a_system_goes_to_the_workers(client, swing) -> None:
    cases = {"motor.amplitude": [0.0, 0.1, 0.2, 0.3]}
    here, there = (sweep(swing, cases, ["bob.theta"], client=where, **SPAN) for where in (None, client))
    assert here.rows.tobytes() == there.rows.tobytes()


def test_a_killed_worker_loses_no_case(client, pendulum, tmp_path) -> None:
    killed = str(tmp_path / "killed")

    def theta(result) -> float:
        if result["theta"][0] > 1.5 and not os.path.exists(killed):  # noqa: PTH110 - goes to another process
            with open(killed, "w", encoding="utf-8"):  # noqa: PTH123
                os.kill(os.getpid(), signal.SIGKILL)
        return float(result["theta"][-1])

    journal = tmp_path / "journal"
    there = sweep(pendulum, CASES, {"theta": theta}, client=client, journal=journal, **SPAN)
    assert os.path.exists(killed)  # noqa: PTH110
    assert not there.failures
    assert there.rows.tobytes() == sweep(pendulum, CASES, {"theta": "theta"}, **SPAN).rows.tobytes()


def test_a_scheduler_that_does_not_answer(pendulum, monkeypatch) -> None:
    monkeypatch.setattr("liaisons.sweeps.cluster._PATIENCE", "1s")
    with pytest.raises(SweepError, match=r"no Dask scheduler answers at 'tcp://127\.0\.0\.1:9'"):
        sweep(pendulum, CASES, ["theta"], client="tcp://127.0.0.1:9", **SPAN)
