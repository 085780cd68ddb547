"""Drake: positions set in the context, and implicit PD control of a discrete plant."""

import logging

import numpy as np
from pydrake.math import RollPitchYaw
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import AddMultibodyPlantSceneGraph
from pydrake.multibody.tree import PdControllerGains, PrismaticSpring
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder

from referee.way import CannotError, Model, Way

logging.getLogger("drake").setLevel(logging.ERROR)  # of options in MJCF that belong to MuJoCo


class _Model(Model):
    """A task in Drake at its start; prescribed joints have motors if there are gains for them."""

    def __init__(self, task, step, gains=None):
        if task.constraint == "friction loss":
            raise CannotError("no friction between joints")
        builder = DiagramBuilder()
        plant = AddMultibodyPlantSceneGraph(builder, time_step=step)[0]
        driven = task.motions if gains else ()
        motors = "".join(f'<motor name="{name}" joint="{name}"/>' for name in driven)
        Parser(plant).AddModelsFromString(task.mjcf(f"<actuator>{motors}</actuator>"), "xml")
        if task.constraint == "equality":
            coupler, rocker = (plant.GetBodyByName(name) for name in ("coupler", "rocker"))
            plant.AddBallConstraint(coupler, [1.5, 0.0, 0.0], rocker, [1.2, 0.0, 0.0])
        for name, stiffness in task.springs.items():  # which its parser leaves out
            plant.AddForceElement(PrismaticSpring(plant.GetJointByName(name), 0.0, stiffness))
        for name in driven:
            plant.GetJointActuatorByName(name).set_controller_gains(gains)
        plant.Finalize()
        self.plant = plant
        self.simulator = Simulator(builder.Build())
        self.context = plant.GetMyMutableContextFromRoot(self.simulator.get_mutable_context())
        joints = [plant.get_joint(k) for k in plant.GetJointIndices()]
        firsts = [joint.position_start() for joint in joints], [joint.velocity_start() for joint in joints]
        super().__init__(task, step, [joint.name() for joint in joints], *firsts)

    q = property(lambda self: self.plant.GetPositions(self.context).copy())
    v = property(lambda self: self.plant.GetVelocities(self.context).copy())

    def write(self, q, v):
        self.plant.SetPositions(self.context, q)
        self.plant.SetVelocities(self.context, v)

    def advance(self, t):
        try:
            self.simulator.AdvanceTo(t + self.step)
        except RuntimeError as error:
            raise CannotError(f"solver: {str(error)[:40]}") from None

    def attitude(self, q):
        return np.array(RollPitchYaw(q[:3]).ToQuaternion().wxyz())


def controlled(task, step, stiffness, damping):
    it = _Model(task, step, PdControllerGains(p=stiffness / step**2, d=damping / step))
    model = it.plant.GetJointByName(next(iter(task.motions))).model_instance()
    port, output = it.plant.get_desired_state_input_port(model), it.plant.get_net_actuation_output_port()

    def aim(t):
        port.FixValue(it.context, task.sigma(t)[:2].ravel())

    aim(0.0)
    return it.march(lambda t: aim(t + step), lambda: np.array(output.Eval(it.context)))


PAGE = "https://drake.mit.edu/doxygen_cxx/classdrake_1_1multibody_1_1_multibody_plant.html"
WAYS = (
    Way("drake", "positions set", PAGE, _Model.overwritten),
    Way("drake", "implicit PD", f"{PAGE}#pd_controllers", controlled, {"stiffness": (1.0, 1e3), "damping": (1e3,)}),
)
