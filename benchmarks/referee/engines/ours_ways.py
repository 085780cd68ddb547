"""Ours, as FMUs: through ``simulate``, and through FMPy, as any importer does it."""

import time
from functools import cache

import fmpy
import numpy as np
from fmpy.simulation import apply_start_values, instantiate_fmu

from liaisons import Signal, fmu_path, simulate
from liaisons.errors import ComponentError
from referee.task import INSTANTS, Answer
from referee.way import CannotError, Way

TOLERANCE = 1e-12


def _said(task):
    """Start values and outputs."""
    starts = {}
    for name, (place, rate) in () if task.signals else task.start.items():
        starts |= {f"{name}_0": place} | ({f"{name}_dot_0": rate} if rate else {})
    force = task.force or f"{next(iter(task.motions))}_force"
    return {**starts, **task.parameters}, [*(task.signals or task.asked), force, "work"]


def _run(rows, begin):
    seconds, values = time.process_time() - begin, np.array(rows)
    return Answer(values[:, :-2], values[:, -2], values[:, -1]), seconds


def by_simulate(task, step):
    starts, outputs = _said(task)
    inputs = {name: Signal(motion, breaks=task.jumps) for name, motion in task.motions.items()}
    options = {"stop_time": task.stop, "step_size": step, "tolerance": TOLERANCE}
    begin = time.process_time()
    try:
        result = simulate(task.component, inputs=inputs, record=outputs, **options, **starts)
    except ComponentError as error:  # of a file that it cannot read
        raise CannotError(str(error).rpartition("assets/")[2].partition(";")[0]) from None
    # At a jump the later row is that after it.
    rows = np.searchsorted(result.time, task.times - 1e-9)
    return _run(np.array([result[name][rows] for name in outputs]).T, begin)


@cache
def _unpacked(path):
    return fmpy.read_model_description(path, validate=False), str(fmpy.extract(path))


def instance(path):
    """Of an FMU, with its description and its value references by name."""
    description, folder = _unpacked(path)
    references = {variable.name: variable.valueReference for variable in description.modelVariables}
    return instantiate_fmu(folder, description, fmi_type="CoSimulation"), description, references


def by_fmpy(task, step):
    fmu, description, reference = instance(fmu_path(task.component))
    starts, outputs = _said(task)
    inputs = [reference[port + ending] for ending in ("", "_dot", "_ddot") for port in task.motions]
    asked = [reference[name] for name in outputs]

    def move(t, side):
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
