"""An FMU as most people write it, by pythonfmu3: positions in, differences inside, one Euler step."""

from __future__ import annotations

import tempfile
from functools import cache
from pathlib import Path
from typing import Any

import fmpy
import numpy as np
import pythonfmu3
from fmpy.simulation import instantiate_fmu

from referee.task import Task
from referee.way import CannotError, Run, Way, march

INPUTS = {"pumped length": "length", "sudden crouch": "length", "moving pivot": "x", "Kapitza": "z"}


@cache
def _built() -> tuple[Any, str]:
    folder = tempfile.mkdtemp()
    path = pythonfmu3.FmuBuilder.build_FMU(Path(__file__).with_name("pendulum_fmu.py"), dest=folder)
    return fmpy.read_model_description(path, validate=False), str(fmpy.extract(path))


def written_by_hand(task: Task, step: float) -> Run:
    if task.name not in INPUTS:
        raise CannotError("not written: equations are the user's, as in the pendulums")
    description, folder = _built()
    reference = {variable.name: variable.valueReference for variable in description.modelVariables}
    fmu: Any = instantiate_fmu(folder, description, fmi_type="CoSimulation")
    fmu.enterInitializationMode()
    fmu.exitInitializationMode()
    fmu.setFloat64([reference["start"]], [task.start["theta"][0]])
    moved = reference[INPUTS[task.name]]

    def advance(t: float) -> None:
        fmu.setFloat64([moved], [float(task.sigma(t)[0, 0])])
        fmu.doStep(t, step)

    try:
        return march(task, step, advance, lambda: (np.array(fmu.getFloat64([reference["theta"]])), None))
    finally:
        fmu.freeInstance()


WAYS = (Way("pythonfmu3", "FMU by hand", "github.com/StephenSmith25/PythonFMU3 (README)", written_by_hand),)
