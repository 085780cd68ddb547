"""Ours, as FMUs: through ``simulate``, and through FMPy, as any importer does it."""

from __future__ import annotations

import time
from functools import cache
from typing import Any

import fmpy
import numpy as np
from fmpy.simulation import apply_start_values, instantiate_fmu

from liaisons import Signal, fmu_path, simulate
from referee.task import INSTANTS, Answer, Task
from referee.way import Run, Way

TOLERANCE = 1e-12


def _said(task: Task) -> tuple[dict[str, float], list[str]]:
    """Start values and outputs."""
    starts = {} if task.signals else {f"{name}_0": place for name, (place, _) in task.start.items()}
    if not task.signals:
        starts |= {f"{name}_dot_0": rate for name, (_, rate) in task.start.items() if rate}
    return {**starts, **task.parameters}, [
        *(task.signals or task.asked),
        task.force or f"{next(iter(task.motions))}_force",
        "work",
    ]


def _run(rows: Any, begin: float) -> Run:
    seconds, values = time.process_time() - begin, np.array(rows)
    return Run(Answer(values[:, :-2], values[:, -2], values[:, -1]), seconds)


def by_simulate(task: Task, step: float) -> Run:
    starts, outputs = _said(task)
    inputs = {name: Signal(motion, breaks=task.jumps) for name, motion in task.motions.items()}
    begin = time.process_time()
    result = simulate(
        task.component,
        stop_time=task.stop,
        step_size=step,
        tolerance=TOLERANCE,
        inputs=inputs,
        record=outputs,
        **starts,
    )
    # At a jump the later row is that after it.
    rows = np.searchsorted(result.time, task.times - 1e-9)
    return _run(np.array([result[name][rows] for name in outputs]).T, begin)


@cache
def _unpacked(component: str) -> tuple[Any, str]:
    path = fmu_path(component)
    return fmpy.read_model_description(path, validate=False), str(fmpy.extract(path))


def by_fmpy(task: Task, step: float) -> Run:
    description, folder = _unpacked(task.component)
    reference = {variable.name: variable.valueReference for variable in description.modelVariables}
    starts, outputs = _said(task)
    inputs = [reference[port + ending] for ending in ("", "_dot", "_ddot") for port in task.motions]
    asked = [reference[name] for name in outputs]
    fmu: Any = instantiate_fmu(folder, description, fmi_type="CoSimulation")

    def move(t: float, side: float) -> None:
        fmu.setReal(inputs, task.sigma(t, side).ravel().tolist())

    begin = time.process_time()
    fmu.setupExperiment(tolerance=TOLERANCE, startTime=0.0)
    apply_start_values(fmu, description, {**starts, "input_reconstruction": 1 if task.jumps else 2})
    move(0.0, 1.0)
    fmu.enterInitializationMode()
    fmu.exitInitializationMode()
    count = round(task.stop / INSTANTS / step)
    rows = []
    for i in range(INSTANTS * count):
        # Jumps are for who extrapolates: the values at the begin, those after a jump.
        move((i if task.jumps else i + 1) * step, 1.0 if task.jumps else -1.0)
        fmu.doStep(i * step, step)
        if (i + 1) % count == 0:
            move((i + 1) * step, -1.0)
            rows.append(fmu.getReal(asked))
    run = _run(rows, begin)
    fmu.terminate()
    fmu.freeInstance()
    return run


WAYS = (
    Way("liaisons", "simulate", "docs/tutorials/prescribe-and-read.md", by_simulate),
    Way("liaisons", "FMPy", "docs/tutorials/other-tools.md", by_fmpy),
)
