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


def by_simulate(task: Task, step: float, tolerance: float = TOLERANCE) -> Run:
    inputs = {
        port: Signal(motion, breaks=task.jumps)
        for port, motion in zip(task.ports.values(), task.motions.values(), strict=True)
    }
    force = task.force or f"{next(iter(task.ports.values()))}_force"
    begin = time.process_time()
    result = simulate(
        task.component,
        stop_time=task.stop,
        step_size=step,
        tolerance=tolerance,
        inputs=inputs,
        record=[*task.signals, force, "work"],
        **task.start_values,
    )
    seconds = time.process_time() - begin
    # At a jump the later row is that after it.
    rows = np.searchsorted(result.time, task.times - 1e-9)
    return Run(
        Answer(np.array([result[s][rows] for s in task.signals]).T, result[force][rows], result["work"][rows]), seconds
    )


@cache
def _unpacked(component: str) -> tuple[Any, str]:
    path = fmu_path(component)
    return fmpy.read_model_description(path, validate=False), str(fmpy.extract(path))


def by_fmpy(task: Task, step: float, tolerance: float = TOLERANCE) -> Run:
    description, folder = _unpacked(task.component)
    reference = {variable.name: variable.valueReference for variable in description.modelVariables}
    force = task.force or f"{next(iter(task.ports.values()))}_force"
    fmu: Any = instantiate_fmu(folder, description, fmi_type="CoSimulation")
    begin = time.process_time()
    fmu.setupExperiment(tolerance=tolerance, startTime=0.0)
    starts = dict(task.start_values) | {"input_reconstruction": 1 if task.jumps else 2}
    inputs = [reference[port + ending] for ending in ("", "_dot", "_ddot") for port in task.ports.values()]
    apply_start_values(fmu, description, starts)
    fmu.setReal(inputs, task.sigma(0.0).ravel().tolist())
    fmu.enterInitializationMode()
    fmu.exitInitializationMode()
    asked = [reference[name] for name in (*task.signals, force, "work")]
    count = round(task.stop / INSTANTS / step)
    rows = []
    for i in range(INSTANTS * count):
        t, end = i * step, (i + 1) * step
        # Jumps are for who extrapolates: the values at t, those after a jump.
        fmu.setReal(inputs, task.sigma(t if task.jumps else end, 1.0 if task.jumps else -1.0).ravel().tolist())
        fmu.doStep(t, step)
        if (i + 1) % count == 0:
            fmu.setReal(inputs, task.sigma(end, -1.0).ravel().tolist())
            rows.append(fmu.getReal(asked))
    seconds = time.process_time() - begin
    fmu.terminate()
    fmu.freeInstance()
    values = np.array(rows)
    return Run(Answer(values[:, :-2], values[:, -2], values[:, -1]), seconds)


PAGE = "docs/tutorials/prescribe-and-read.md"
WAYS = (
    Way("liaisons", "simulate", PAGE, by_simulate),
    Way("liaisons", "FMPy", "docs/tutorials/other-tools.md", by_fmpy),
)
