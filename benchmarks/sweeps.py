"""Throughput of sweeps: all cores beside one, and beside a loop over ``fmpy.simulate_fmu``.

    python benchmarks/sweeps.py [--quick]

The sweep: a pendulum over 10 s, in the 1000 communication steps of its default experiment and in 100, and as many cases
as keep one core busy for a second; start and length varied, final angle and largest energy error kept.  The loop does
what one writes without us: ``simulate_fmu`` with the start values and the outputs that are needed; "prepared" gives it
the extracted folder and the model description, too.

Cases a second are by the clock on the wall, so the machine has to be idle.  Processor time, which other work disturbs
less, is that of all processes; the part of it that the first process needs beside the others bounds what more cores can
gain.  What does not depend on the number of cases (the FMU is extracted, processes start and end) is measured by sweeps
of one case a core.
"""

from __future__ import annotations

import os
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from resource import RUSAGE_CHILDREN, RUSAGE_SELF, getrusage
from typing import Any

import fmpy
import numpy as np
from _measure import Row, command, interleaved

from liaisons.base.arrays import Floats
from liaisons.fmu import build
from liaisons.mechanics import assemble
from liaisons.models import Pendulum
from liaisons_tools.sweeps import sample, sweep

STOP = 10.0
CORES = os.cpu_count() or 1
ALL, ONE, LOOP, PREPARED = f"{CORES} cores", "one core", "simulate_fmu in a loop", "simulate_fmu prepared"


@dataclass(frozen=True)
class Cost:
    """Of a case [s]: by the clock on the wall, and processor time of this process and of its children."""

    wall: float
    own: float
    children: float

    @property
    def processor(self) -> float:
        return self.own + self.children


def measure(quick: bool, plots: Path) -> list[Row]:  # noqa: ARG001 - no diagram
    rounds, few = (3, 5) if quick else (9, 20)
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as name:
        fmu = build(assemble(Pendulum), Path(name), backend="native")
        folder = fmpy.extract(str(fmu), str(Path(name) / "extracted"))
        prepared = {"model_description": fmpy.read_model_description(str(fmu))}
        rows = []
        for points, count in ((1000, 2000), (100, 10_000)):
            cases = _cases(count // 10 if quick else count)
            step = STOP / points
            runs: dict[str, Callable[[], Cost]] = {
                ALL: lambda step=step, cases=cases: _sweep(fmu, cases, step, CORES),
                ONE: lambda step=step, cases=cases: _sweep(fmu, cases, step, 1),
                LOOP: lambda step=step: _loop(str(fmu), _cases(few), step, {}),
                PREPARED: lambda step=step: _loop(str(folder), _cases(few), step, prepared),
            }
            topic = f"Sweep of {len(cases['theta_0'])} pendulums, {points} communication points each"
            rows += _rows(topic, interleaved(runs, rounds))
        rows += _fixed(fmu, rounds)
    return rows


def _cases(count: int) -> dict[str, Floats]:
    return sample(count, {"theta_0": (0.1, 3.0), "length": (0.5, 2.0)}, seed=0)


def _fixed(fmu: Path, rounds: int) -> list[Row]:
    """What a sweep costs beside its cases."""
    times = [[1e3 * n * _sweep(fmu, _cases(n), STOP, n).wall for n in (CORES, 1)] for _ in range(rounds)]
    both = zip((f"one case on each of {CORES} cores", "one case on one core"), zip(*times, strict=True), strict=True)
    return [Row.of("What does not depend on the number of cases", title, of, "ms") for title, of in both]


def _rows(topic: str, costs: dict[str, list[Cost]]) -> list[Row]:
    rates = {title: [1 / cost.wall for cost in of] for title, of in costs.items()}
    spent = {title: [cost.processor * 1e6 for cost in of] for title, of in costs.items()}
    alone = [cost.own * 1e6 for cost in costs[ALL]]
    return [
        Row.of(topic, ALL, rates[ALL], "cases/s", yardstick=ONE, beside=rates[ONE], asked=">= 1.8"),
        Row.of(topic, ALL, rates[ALL], "cases/s", yardstick=LOOP, beside=rates[LOOP], asked=">= 20"),
        Row.of(topic, ONE, rates[ONE], "cases/s", yardstick=PREPARED, beside=rates[PREPARED]),
        *(
            Row.of(topic, f"processor time, {title}", spent[title], "µs/case", yardstick=ONE, beside=spent[ONE])
            for title in (ALL, LOOP, PREPARED)
        ),
        Row.of(topic, "of it, by the first process", alone, "µs/case", yardstick=ALL, beside=spent[ALL]),
    ]


def _measured(count: int, work: Callable[[], object]) -> Cost:
    wall, before = time.perf_counter(), _processor_times()
    work()
    own, children = (after - then for after, then in zip(_processor_times(), before, strict=True))
    return Cost((time.perf_counter() - wall) / count, own / count, children / count)


def _processor_times() -> tuple[float, float]:
    """Of this process, and of its children that have ended [s]."""
    own, children = getrusage(RUSAGE_SELF), getrusage(RUSAGE_CHILDREN)
    return own.ru_utime + own.ru_stime, children.ru_utime + children.ru_stime


def _sweep(fmu: Path, cases: dict[str, Floats], step: float, workers: int) -> Cost:
    def work() -> None:
        keep = ["theta", "energy_balance:max"]
        table = sweep(fmu, cases, keep, stop_time=STOP, step_size=step, workers=workers)
        assert not table.failures

    return _measured(len(cases["theta_0"]), work)


def _loop(fmu: str, cases: dict[str, Floats], step: float, prepared: dict[str, Any]) -> Cost:
    def work() -> None:
        rows = []
        for theta_0, length in zip(cases["theta_0"], cases["length"], strict=True):
            result = fmpy.simulate_fmu(
                fmu,
                stop_time=STOP,
                step_size=step,
                output_interval=step,
                start_values={"theta_0": theta_0, "length": length},
                output=["theta", "energy_balance"],
                **prepared,
            )
            rows.append((result["theta"][-1], np.max(result["energy_balance"])))

    return _measured(len(cases["theta_0"]), work)


if __name__ == "__main__":
    command(measure)
