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
from pydrake.multibody.plant import AddMultibodyPlantSceneGraph, DiscreteContactApproximation
from pydrake.multibody.tree import PdControllerGains
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder

from referee.task import Task
from referee.way import CannotError, Run, Way, march

logging.getLogger("drake").setLevel(logging.ERROR)  # of options in MJCF that belong to MuJoCo


class _Plant:
    """A task in Drake at its start."""

    def __init__(self, task: Task, step: float, gains: tuple[float, float] | None) -> None:
        if task.constraint:
            raise CannotError(f"MJCF: no {task.constraint} here")
        builder = DiagramBuilder()
        self.plant, _ = AddMultibodyPlantSceneGraph(builder, time_step=step)
        motors = "".join(f'<motor name="{name}" joint="{name}"/>' for name in task.motions) if gains else ""
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "task.xml"
            path.write_text(task.mjcf(step, more=f"<actuator>{motors}</actuator>" * bool(gains)), encoding="utf-8")
            Parser(self.plant).AddModels(str(path))
        self.plant.set_discrete_contact_approximation(DiscreteContactApproximation.kSap)
        if gains:
            for name in task.motions:
                self.plant.GetJointActuatorByName(name).set_controller_gains(PdControllerGains(p=gains[0], d=gains[1]))
        self.plant.Finalize()
        self.task = task
        simulator = Simulator(builder.Build())
        simulator.set_publish_every_time_step(False)
        self.simulator: Any = simulator
        self.context = self.plant.GetMyMutableContextFromRoot(simulator.get_mutable_context())
        self.joints = [self.plant.GetJointByName(name) for name in task.motions]
        self.set(0.0)
        for name, (place, rate) in task.start.items():
            joint = self.plant.GetJointByName(name)
            if name == "attitude":
                joint.set_angular_velocity(self.context, [task.start_values[f"omega_{a}_0"] for a in "xyz"])
            else:
                self.plant.SetPositions(
                    self.context, self._with(self.plant.GetPositions(self.context), joint.position_start(), place)
                )
                self.plant.SetVelocities(
                    self.context, self._with(self.plant.GetVelocities(self.context), joint.velocity_start(), rate)
                )

    @staticmethod
    def _with(values: NDArray, place: int, value: float) -> NDArray:
        values = values.copy()
        values[place] = value
        return values

    def set(self, t: float) -> None:
        q, v = self.plant.GetPositions(self.context).copy(), self.plant.GetVelocities(self.context).copy()
        for joint, sigma, sigma_dot in zip(self.joints, *self.task.sigma(t)[:2], strict=True):
            q[joint.position_start()], v[joint.velocity_start()] = sigma, sigma_dot
        self.plant.SetPositions(self.context, q)
        self.plant.SetVelocities(self.context, v)

    def asked(self) -> NDArray:
        q = self.plant.GetPositions(self.context)
        if self.task.asked[0] == ("attitude",):
            joint = self.plant.GetJointByName("attitude")
            return np.array(RollPitchYaw(q[joint.position_start() :][:3]).ToQuaternion().wxyz())
        return np.array(
            [sum(q[self.plant.GetJointByName(n).position_start()] for n in names) for names in self.task.asked]
        )


def overwritten(task: Task, step: float) -> Run:
    it = _Plant(task, step, None)

    def advance(t: float) -> None:
        it.set(t)
        it.simulator.AdvanceTo(t + step)

    return march(task, step, advance, lambda: (it.asked(), None))


def controlled(task: Task, step: float, stiffness: float, damping: float) -> Run:
    it = _Plant(task, step, (stiffness / step**2, damping / step))
    port = it.plant.get_desired_state_input_port(it.joints[0].model_instance())
    output = it.plant.get_net_actuation_output_port()

    def advance(t: float) -> None:
        sigma, sigma_dot, _ = task.sigma(t + step)
        port.FixValue(it.context, [*sigma, *sigma_dot])
        it.simulator.AdvanceTo(t + step)

    port.FixValue(it.context, task.sigma(0.0)[:2].ravel())
    return march(task, step, advance, lambda: (it.asked(), np.array(output.Eval(it.context))))


PAGE = "drake.mit.edu/doxygen_cxx: MultibodyPlant, "
WAYS = (
    Way("drake", "positions set", PAGE + "SetPositions", overwritten),
    Way(
        "drake",
        "implicit PD",
        PAGE + "Using PD controlled actuators",
        controlled,
        [{"stiffness": s, "damping": d} for s in (1.0, 1e3) for d in (1.0, 1e3)],
    ),
)
