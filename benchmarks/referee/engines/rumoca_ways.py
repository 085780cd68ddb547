"""Rumoca: Modelica text with the prescribed joints as equations of time."""

import time

import numpy as np
import rumoca

from referee.task import INSTANTS, Answer
from referee.way import CannotError, Way


def prescribed(task, step, solver):
    tolerance = 1e-6 * (step / 4e-3) ** 3
    config = rumoca.SimConfig(solver=solver, rtol=tolerance, atol=tolerance, max_wall_seconds=60.0)
    try:
        text = task.path("mo").read_text(encoding="utf-8")
        found = rumoca.Session().loads(text, model="Prescribed", filename="task.mo")
        begin = time.process_time()
        result = found.simulate((0.0, task.stop), dt=task.stop / INSTANTS, config=config)
    except (rumoca.RumocaError, rumoca.CompileError, rumoca.SimulationError) as error:
        raise CannotError(f"refused: {' '.join(str(error).split())[:60]}") from None
    seconds = time.process_time() - begin
    rows = np.searchsorted(np.asarray(result.time), task.times - 1e-9)
    *motion, force, work = (np.asarray(result[name])[rows] for name in (*(task.signals or task.asked), "force", "work"))
    return Answer(np.array(motion).T, force, work), seconds


PAGE = "https://github.com/CogniPilot/rumoca/blob/main/docs/user-guide/src/tools/python.md"
WAYS = (Way("rumoca", "equation of time", PAGE, prescribed, {"solver": ("rk-like", "bdf")}),)
