"""Throughput of sweeps: on all cores beside one, and beside a loop over ``fmpy.simulate_fmu``; interleaved, medians.

    python benchmarks/sweeps.py [--rounds 5] [--cases 400] [--step 0.01]

The sweep: a pendulum over 10 s, by default in the 1000 communication steps of its default experiment, starts and
lengths varied, final angle and largest energy error kept.  The loop does what one writes without us: ``simulate_fmu``
with the start values and the outputs that are needed; "prepared" gives it the extracted folder and the model
description, too.

Cases a second are by the clock on the wall, so the machine has to be idle.  Processor time, which other work disturbs
less, is that of all processes; "alone" is the part of it that the first process needs before and beside the others,
while one of them waits: what bounds the gain of more cores.
"""

from __future__ import annotations

import argparse
import os
import statistics
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import fmpy
import numpy as np

from liaisons.fmu import build
from liaisons.models import Pendulum
from liaisons.sweeps import Cases, sample, sweep

STOP = 10.0


@dataclass(frozen=True)
class Cost:
    """Of a case [s]: by the clock on the wall, and processor time of this process and of its children."""

    wall: float
    own: float
    children: float

    @property
    def processor(self) -> float:
        return self.own + self.children


def main() -> None:
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("--rounds", type=int, default=5)
    options.add_argument("--cases", type=int, default=400)
    options.add_argument("--step", type=float, default=0.01)
    arguments = options.parse_args()
    cores = os.cpu_count() or 1
    with tempfile.TemporaryDirectory() as name:
        fmu = build(Pendulum.model(), Path(name), backend="native")
        cases = sample(arguments.cases, {"theta_0": (0.1, 3.0), "length": (0.5, 2.0)}, seed=0)
        few = Cases.of({key: column[:20] for key, column in cases.items()})
        folder = fmpy.extract(str(fmu), str(Path(name) / "extracted"))
        prepared = {"model_description": fmpy.read_model_description(str(fmu))}
        runs: dict[str, Callable[[], Cost]] = {
            f"sweep, {cores} cores": lambda: _sweep(fmu, cases, arguments.step, cores),
            "sweep, 1 core": lambda: _sweep(fmu, cases, arguments.step, 1),
            "simulate_fmu in a loop": lambda: _loop(str(fmu), few, arguments.step, {}),
            "... prepared": lambda: _loop(folder, few, arguments.step, prepared),
        }
        for run in runs.values():
            run()  # warm up
        _report([{title: run() for title, run in runs.items()} for _ in range(arguments.rounds)])


def _report(rounds: list[dict[str, Cost]]) -> None:
    first, *_ = rounds[0]
    for title in rounds[0]:
        costs = [r[title] for r in rounds]
        wall, processor, own = (
            statistics.median(values)
            for values in zip(*((cost.wall, cost.processor, cost.own) for cost in costs), strict=True)
        )
        by_wall = statistics.median(r[title].wall / r[first].wall for r in rounds)
        by_processor = [r[title].processor / r[first].processor for r in rounds]
        print(
            f"{title:24s} {1 / wall:8.1f} cases/s, {by_wall:6.2f} x the first;"
            f" processor {processor * 1e3:7.3f} ms a case (alone {own * 1e3:6.3f}),"
            f" {statistics.median(by_processor):6.2f} x the first"
            f" (rounds {min(by_processor):.2f} .. {max(by_processor):.2f})"
        )


def _measured(count: int, work: Callable[[], object]) -> Cost:
    wall, before = time.perf_counter(), os.times()
    work()
    wall, after = time.perf_counter() - wall, os.times()
    own = after.user + after.system - before.user - before.system
    children = after.children_user + after.children_system - before.children_user - before.children_system
    return Cost(wall / count, own / count, children / count)


def _sweep(fmu: Path, cases: Cases, step: float, workers: int) -> Cost:
    def work() -> None:
        keep = ["theta", "energy_balance:max"]
        table = sweep(fmu, cases, keep, stop_time=STOP, step_size=step, workers=workers)
        assert not table.failures

    return _measured(cases.count, work)


def _loop(fmu: str, cases: Cases, step: float, prepared: dict[str, Any]) -> Cost:
    def work() -> None:
        rows = []
        for number in range(cases.count):
            result = fmpy.simulate_fmu(
                fmu,
                stop_time=STOP,
                step_size=step,
                output_interval=step,
                start_values=cases.case(number),
                output=["theta", "energy_balance"],
                **prepared,
            )
            rows.append((result["theta"][-1], np.max(result["energy_balance"])))

    return _measured(cases.count, work)


if __name__ == "__main__":
    main()
