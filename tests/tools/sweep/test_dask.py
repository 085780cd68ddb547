"""Sweeps on a Dask cluster of two workers on this machine."""

from __future__ import annotations

import contextlib
import errno
import os
import signal
import subprocess
import sys
from contextlib import ExitStack
from threading import get_ident
from typing import Any

import numpy as np
import pytest

from liaisons_tools.sweeps import SweepError, cluster, grid, sweep

pytest.importorskip("distributed")

SPAN: dict[str, Any] = {"stop_time": 1.0, "step_size": 0.05}
CASES = grid({"theta_0": np.linspace(0.1, 3.0, 12), "length": [0.5, 1.0]})


def test_two_workers_give_the_same_table_bit_by_bit(client, pendulum) -> None:
    cases = CASES | {"mass": np.where(np.arange(24) == 5, -1.0, 1.0)}
    keep = ["theta", "energy:max"]

    def lose() -> None:
        """Leave what a sweep leaves whose client has gone."""
        pool: Any = None
        cluster._pools["lost", get_ident()] = pool, ExitStack()

    for worker in client.nthreads():
        client.submit(lose, workers=[worker], pure=False).result()
    here = sweep(pendulum, cases, keep, **SPAN)
    there = sweep(pendulum, cases, keep, client=client, **SPAN)
    by_address = sweep(pendulum, cases, keep, client=client.scheduler.address, **SPAN)
    assert here.values.tobytes() == there.values.tobytes() == by_address.values.tobytes()
    assert here.failures == there.failures == by_address.failures
    assert here.failures.keys() == {5}
    assert set(client.run(lambda: len(cluster._pools)).values()) == {0}  # all processes have ended


@pytest.mark.variants(core=0)
def test_the_command_line_by_the_address(client, pendulum, tmp_path) -> None:
    """In a process that has no client of its own, as there is one here."""
    liaisons = [sys.executable, "-c", "from liaisons_tools.cli import main; raise SystemExit(main())"]
    arguments = ["sweep", str(pendulum), "--over", "theta_0=0.1:3:12", "--keep", "theta", "--stop", "1"]
    for name, more in (("here", []), ("there", ["--dask", client.scheduler.address])):
        subprocess.run([*liaisons, *arguments, "--csv", str(tmp_path / name), *more], check=True)
    assert (tmp_path / "here").read_bytes() == (tmp_path / "there").read_bytes()


@pytest.mark.parametrize("everyone", [False, True], ids=["one", "all"])
@pytest.mark.variants(core=0)
def test_a_killed_worker_loses_no_case(client, pendulum, tmp_path, everyone) -> None:
    client.wait_for_workers(2, timeout=60)
    killed, workers = str(tmp_path / "killed"), list(client.run(os.getpid).values())

    def theta(result) -> float:  # goes to another process
        if result["theta"][0] > 1.5:
            with contextlib.suppress(FileExistsError), open(killed, "x", encoding="utf-8"):  # noqa: PTH123
                for worker in workers if everyone else [os.getppid()]:
                    os.kill(worker, signal.SIGKILL)
        return float(result["theta"][-1])

    there = sweep(pendulum, CASES, {"theta": theta}, client=client, journal=tmp_path / "journal", **SPAN)
    assert os.path.exists(killed)  # noqa: PTH110
    assert not there.failures
    assert there.values.tobytes() == sweep(pendulum, CASES, {"theta": "theta"}, **SPAN).values.tobytes()


def test_what_one_worker_cannot_begin_is_for_the_others(client, pendulum) -> None:
    """One of them has no room for the FMUs."""

    def spoil(address: str, dask_worker) -> None:
        from liaisons.base.folders import temporary_folder
        from liaisons_tools.sweeps import cluster

        def full(*_: object) -> None:
            raise OSError(errno.ENOSPC, "No space left on device")

        cluster.temporary_folder = full if address in {dask_worker.address, "all"} else temporary_folder

    here = sweep(pendulum, CASES, ["theta"], **SPAN)
    client.wait_for_workers(2, timeout=60)  # one has just been killed
    client.run(spoil, next(iter(client.nthreads())))
    assert sweep(pendulum, CASES, ["theta"], client=client, **SPAN).values.tobytes() == here.values.tobytes()
    client.run(spoil, "all")
    none = sweep(pendulum, CASES, ["theta"], client=client, **SPAN)
    assert none.unfinished == tuple(range(24))
    assert "cannot begin: OSError: [Errno 28] No space left on device" in none.failures[0]
    client.run(spoil, "none")


def test_a_scheduler_that_does_not_answer(pendulum, monkeypatch) -> None:
    monkeypatch.setattr("liaisons_tools.sweeps.cluster._PATIENCE", "1s")
    with pytest.raises(SweepError, match=r"no Dask scheduler answers at 'tcp://127\.0\.0\.1:9'"):
        sweep(pendulum, CASES, ["theta"], client="tcp://127.0.0.1:9", **SPAN)
