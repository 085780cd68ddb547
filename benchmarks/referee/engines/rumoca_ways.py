"""Rumoca: Modelica text with the prescribed length or pivot as an equation of time."""

from __future__ import annotations

import time

import numpy as np
import rumoca

from referee.task import GRAVITY, INSTANTS, Answer, Task
from referee.way import CannotError, Run, Way

MOVED = {
    "pumped length": ("l", "1 + 0.15*sin(6.2642*time)"),
    "moving pivot": ("x", "0.1*sin(3*time)"),
    "Kapitza": ("z", "0.1*sin(50*time)"),
}
TEXT = """model Task
  Real l, x, z, u, v, w;
  Real theta(start = {start}, fixed = true);
  Real omega(start = 0, fixed = true);
  Real work(start = 0, fixed = true);
  Real force;
equation
  l = {l};
  x = {x};
  z = {z};
  u = der(l);
  v = der(x);
  w = der(z);
  der(theta) = omega;
  l*der(omega) = -(({gravity} + der(w))*sin(theta) + der(v)*cos(theta) + 2*u*omega);
  force = {force};
  der(work) = force*{rate};
end Task;
"""
FORCES = {
    "l": "der(u) - l*omega^2 + der(v)*sin(theta) - ({gravity} + der(w))*cos(theta)",
    "x": "der(v) + l*(der(omega)*cos(theta) - omega^2*sin(theta))",
    "z": "{gravity} + der(w) + l*(der(omega)*sin(theta) + omega^2*cos(theta))",
}


def by_equations(task: Task, step: float, solver: str) -> Run:
    if task.name not in MOVED:
        raise CannotError("not written: equations are the user's, as in the pendulums")
    name, formula = MOVED[task.name]
    values = {"l": "1", "x": "0", "z": "0"} | {name: formula}
    text = TEXT.format(
        start=task.start["theta"][0],
        gravity=GRAVITY,
        force=FORCES[name].format(gravity=GRAVITY),
        rate={"l": "u", "x": "v", "z": "w"}[name],
        **values,
    )
    try:
        model = rumoca.Session().loads(text, model="Task", filename="task.mo")
        begin = time.process_time()
        config = rumoca.SimConfig(solver=solver, rtol=1e-6 * (step / 4e-3) ** 3, atol=1e-6 * (step / 4e-3) ** 3)
        result = model.simulate((0.0, task.stop), dt=task.stop / INSTANTS, config=config)
        seconds = time.process_time() - begin
    except (rumoca.RumocaError, rumoca.CompileError, rumoca.SimulationError) as error:
        raise CannotError(f"refused: {str(error)[:60]}") from None
    rows = np.searchsorted(np.asarray(result.time), task.times - 1e-9)
    values = {key: np.asarray(result[key])[rows] for key in ("theta", "force", "work")}
    return Run(Answer(values["theta"][:, None], values["force"], values["work"]), seconds)


WAYS = (
    Way(
        "rumoca",
        "equation of time",
        "specification.modelica.org: Equations; rumoca README (SimConfig)",
        by_equations,
        [{"solver": "rk-like"}, {"solver": "bdf"}],
    ),
)
