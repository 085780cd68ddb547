"""Drake: positions set in the context, and implicit PD control of a discrete plant."""

from __future__ import annotations

import logging
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydrake.math import RollPitchYaw
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import AddMultibodyPlantSceneGraph
from pydrake.multibody.tree import PdControllerGains, PrismaticSpring
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder

from referee.task import Task
from referee.way import CannotError, Places, Run, Way, march

logging.getLogger("drake").setLevel(logging.ERROR)  # of options in MJCF that belong to MuJoCo


class _Plant:
    """A task in Drake at its start."""

    def __init__(self, task: Task, step: float, gains: tuple[float, float] | None) -> None:
        if task.constraint == "friction loss":
            raise CannotError("no friction between joints")
        builder = DiagramBuilder()
        plant: Any = AddMultibodyPlantSceneGraph(builder, time_step=step)[0]
        motors = "".join(f'<motor name="{name}" joint="{name}"/>' for name in task.motions) if gains else ""
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "task.xml"
            path.write_text(task.mjcf(f"<actuator>{motors}</actuator>"), encoding="utf-8")
            Parser(plant).AddModels(str(path))
        if task.constraint == "equality":
            coupler, rocker = (plant.GetBodyByName(name) for name in ("coupler", "rocker"))
            plant.AddBallConstraint(coupler, [1.5, 0.0, 0.0], rocker, [1.2, 0.0, 0.0])
        for name, stiffness in task.springs.items():  # which its parser leaves out
            plant.AddForceElement(PrismaticSpring(plant.GetJointByName(name), 0.0, stiffness))
        for name in task.motions if gains else ():
            plant.GetJointActuatorByName(name).set_controller_gains(PdControllerGains(p=gains[0], d=gains[1]))
        plant.Finalize()
        joints = [plant.get_joint(k) for k in plant.GetJointIndices()]
        self.plant, self.task, self.step = plant, task, step
        self.simulator: Any = Simulator(builder.Build())
        self.context = plant.GetMyMutableContextFromRoot(self.simulator.get_mutable_context())
        self.places = Places(
            task,
            {joint.name(): joint.position_start() for joint in joints},
            {joint.name(): joint.velocity_start() for joint in joints},
            lambda q: np.array(RollPitchYaw(q[:3]).ToQuaternion().wxyz()),
        )
        self.change(self.places.start)

    def change(self, change: Any, *when: float) -> None:
        q, v = self.plant.GetPositions(self.context).copy(), self.plant.GetVelocities(self.context).copy()
        change(q, v, *when)
        self.plant.SetPositions(self.context, q)
        self.plant.SetVelocities(self.context, v)

    def march(self, before: Any, forces: Any = lambda: None) -> Run:
        def advance(t: float) -> None:
            before(t)
            self.simulator.AdvanceTo(t + self.step)

        def read() -> tuple[NDArray, NDArray | None]:
            return self.places.read(self.plant.GetPositions(self.context)), forces()

        try:
            return march(self.task, self.step, advance, read)
        except RuntimeError as error:
            raise CannotError(f"solver: {str(error)[:40]}") from None


def overwritten(task: Task, step: float) -> Run:
    it = _Plant(task, step, None)
    return it.march(lambda t: it.change(it.places.move, t))


def controlled(task: Task, step: float, stiffness: float, damping: float) -> Run:
    it = _Plant(task, step, (stiffness / step**2, damping / step))
    model = it.plant.GetJointByName(next(iter(task.motions))).model_instance()
    port, output = it.plant.get_desired_state_input_port(model), it.plant.get_net_actuation_output_port()

    def aim(t: float) -> None:
        port.FixValue(it.context, task.sigma(t)[:2].ravel())

    aim(0.0)
    return it.march(lambda t: aim(t + step), lambda: np.array(output.Eval(it.context)))


PAGE = "https://drake.mit.edu/doxygen_cxx/classdrake_1_1multibody_1_1_multibody_plant.html"
WAYS = (
    Way("drake", "positions set", PAGE, overwritten),
    Way(
        "drake",
        "implicit PD",
        f"{PAGE}#pd_controllers",
        controlled,
        [{"stiffness": s, "damping": 1e3} for s in (1.0, 1e3)],
    ),
)
