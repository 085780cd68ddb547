"""Processes end with the one that started them."""

from __future__ import annotations

import os
import select
import subprocess
import sys
import time
from pathlib import Path

import pytest

from liaisons.base import processes

_CHILD = """
import ctypes, sys
from liaisons.base import processes
if "watched" in sys.argv:
    processes._process_control = lambda *_: False
processes.die_with_parent(int(sys.argv[1]))
sys.stdout.write("ready")
sys.stdout.flush()
while True:
    ctypes.CDLL(None).sleep(1000)  # foreign code that does not return
"""
_PARENT = """
import os, subprocess, sys
subprocess.run([sys.executable, "-c", sys.argv[1], str(os.getpid()), *sys.argv[2:]])
"""


@pytest.mark.skipif(sys.platform == "win32", reason="signals of POSIX")
@pytest.mark.variants(core=2)
@pytest.mark.parametrize("way", ["by the kernel", "watched"])
def test_process_ends_with_its_killed_parent(way: str) -> None:
    read, write = os.pipe()  # the child holds its end until it is gone
    with subprocess.Popen([sys.executable, "-c", _PARENT, _CHILD, way], stdout=write) as parent:
        os.close(write)
        said = os.read(read, 100)
        parent.kill()
    assert said == b"ready"
    assert select.select([read], [], [], 30.0)[0], "the child lives on"
    assert os.read(read, 100) == b""
    os.close(read)


@pytest.mark.skipif(sys.platform == "win32", reason="signals of POSIX")
def test_process_whose_parent_has_ended_before_ends_at_once() -> None:
    command = [sys.executable, "-c", _CHILD, "1" if os.getpid() != 1 else "2"]
    done = subprocess.run(command, capture_output=True, timeout=30.0, check=False)
    assert (done.returncode, done.stdout) == (1, b"")


_ENDING = """
import os, signal, sys, time
from liaisons.base.processes import orderly_end
with orderly_end():
    child = os.fork()
    if child == 0:
        time.sleep(1000)
    os.kill(child, signal.SIGTERM)
    _, status = os.waitpid(child, 0)
    time.sleep(0.5)  # it would end here
    try:
        os.kill(os.getpid(), signal.SIGTERM)
        time.sleep(1000)
    finally:
        sys.stdout.write(f"{os.waitstatus_to_exitcode(status)} released")
"""


@pytest.mark.skipif(sys.platform == "win32", reason="signals of POSIX")
def test_orderly_end_is_that_of_one_process_only() -> None:
    done = subprocess.run([sys.executable, "-c", _ENDING], capture_output=True, timeout=30.0, check=False)
    assert (done.returncode, done.stdout) == (143, b"-15 released"), done.stderr


reads_proc = pytest.mark.skipif(sys.platform != "linux", reason="reads /proc")


@reads_proc
def test_children_are_the_processes_that_this_one_has_started() -> None:
    before = processes._child_processes()
    with subprocess.Popen([sys.executable, "-c", "input()"], stdin=subprocess.PIPE) as child:
        assert {*processes._child_processes()} == {*before, child.pid}
        child.communicate(b"\n")


@reads_proc
def test_an_orderly_end_leaves_no_pipe_open() -> None:
    def count() -> int:
        return len([*Path("/proc/self/fd").iterdir()])

    before, end = count(), time.monotonic() + 5.0
    with processes.orderly_end():
        assert count() == before + 2
    while count() != before and time.monotonic() < end:  # a thread closes its end
        time.sleep(0.01)
    assert count() == before
