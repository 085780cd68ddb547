"""Many instances in one process, in parallel threads, one after another."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from driver import DISCARD, OK, Instance


def run(instance: Instance, steps: int = 20) -> np.ndarray:
    for i in range(steps):
        assert instance.set(theta_force=0.1 * i) == OK
        assert instance.step(i * 0.1, 0.1) == OK
    return instance.get("theta", "p_theta", "work")


def test_two_thousand_instances_do_not_know_of_each_other(pendulum_library) -> None:
    angles = np.linspace(0.1, 3.0, 2000)
    instances = [pendulum_library.start(theta_0=angle) for angle in angles]
    for i in range(3):
        for instance in instances:
            assert instance.step(i * 0.1, 0.1) == OK
    for place in (0, 999, 1999):
        alone = pendulum_library.start(theta_0=angles[place])
        for i in range(3):
            assert alone.step(i * 0.1, 0.1) == OK
        assert instances[place]["theta"] == alone["theta"]


def test_instances_run_in_parallel_threads(pendulum_library) -> None:
    """ctypes releases the interpreter's lock: the calls really overlap."""
    angles = np.linspace(0.1, 3.0, 64)
    expected = [run(pendulum_library.start(theta_0=angle)) for angle in angles]
    instances = [pendulum_library.start(theta_0=angle) for angle in angles]
    with ThreadPoolExecutor(8) as pool:
        found = list(pool.map(run, instances))
    np.testing.assert_array_equal(found, expected)


def test_nothing_is_left_behind(pendulum_library) -> None:
    """Lives of an instance with a failing step and a saved state; the first hundred fill the allocator's pools."""
    resource = pytest.importorskip("resource")  # not on Windows

    def live() -> None:
        instance = pendulum_library.start()
        instance.serialize()
        assert instance.set(length=-1.0) == OK
        assert instance.step(0.0, 0.1) == DISCARD
        assert instance.call("Reset") == OK

    for _ in range(100):
        live()
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    for _ in range(5000):
        live()
    # An instance takes 8 kB: if a hundredth of them stayed, it would be 400 kB.
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < 400  # kB
