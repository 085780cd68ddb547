"""Rumoca: Modelica text with the prescribed joints as equations of time, or drawn by stiff springs."""

from __future__ import annotations

import time
from functools import partial

import numpy as np
import rumoca

from referee.task import INSTANTS, Answer, Task
from referee.way import CannotError, Run, Way


def run(task: Task, step: float, model: str, solver: str, **parameters: float) -> Run:
    if f"model {model}" not in task.text("mo"):
        raise CannotError("not written")
    tolerance = 1e-6 * (step / 4e-3) ** 3
    config = rumoca.SimConfig(solver=solver, rtol=tolerance, atol=tolerance, max_wall_seconds=60.0)
    try:
        found = rumoca.Session().loads(task.text("mo"), model=model, filename="task.mo")
        begin = time.process_time()
        result = found.simulate((0.0, task.stop), dt=task.stop / INSTANTS, config=config, params=parameters)
    except (rumoca.RumocaError, rumoca.CompileError, rumoca.SimulationError) as error:
        raise CannotError(f"refused: {' '.join(str(error).split())[:60]}") from None
    seconds = time.process_time() - begin
    rows = np.searchsorted(np.asarray(result.time), task.times - 1e-9)
    values = [np.asarray(result[name])[rows] for name in (*(task.signals or task.asked), "force", "work")]
    return Run(Answer(np.array(values[:-2]).T, values[-2], values[-1]), seconds)


PAGE = "https://github.com/CogniPilot/rumoca/blob/main/docs/user-guide/src/tools/python.md"
WAYS = (
    Way(
        "rumoca",
        "equation of time",
        PAGE,
        partial(run, model="Prescribed"),
        [{"solver": s} for s in ("rk-like", "bdf")],
    ),
    Way("rumoca", "stiff spring", PAGE, partial(run, model="Driven", solver="bdf"), [{"k": k} for k in (1e4, 1e6)]),
)
