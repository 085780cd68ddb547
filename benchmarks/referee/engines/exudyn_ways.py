"""Exudyn: a kinematic tree whose joints constraints or stiff springs prescribe, by the generalised-alpha method."""

import math
import time

import exudyn
import mujoco
import numpy as np
from exudyn import utilities as items
from scipy.spatial.transform import Rotation

from referee.task import GRAVITY
from referee.way import CannotError, Model, Way, answered

exudyn.config.printToConsole = False
BOUNCE = -math.log(0.8) / math.hypot(math.pi, math.log(0.8))  # damping ratio of a stop that throws back 0.8


class _Model(Model):
    """A task in Exudyn at its start: links of its file, as MuJoCo reads it; a ball joint is three hinges."""

    def __init__(self, task, step):
        self.container = exudyn.SystemContainer()  # which holds the system
        self.system = self.container.AddSystem()
        self.file = mujoco.MjModel.from_xml_string(task.mjcf())
        names, links, signs, last = [], [], [], [-1]  # the link of each body
        for body in map(self.file.body, range(1, self.file.nbody)):
            joint, above = self.file.joint(body.jntadr[0]), last[body.parentid[0]]
            ball, slide = (joint.type[0] == getattr(mujoco.mjtJoint, f"mjJNT_{kind}") for kind in ("BALL", "SLIDE"))
            mass = items.RigidBodyInertia(body.mass[0], np.diag(body.inertia), body.ipos, inertiaTensorAtCOM=True)
            spring = (task.springs.get(joint.name, 0.0), 0.0)
            letters = "XYZ" if ball else "XYZ"[abs(joint.axis).argmax()]
            names += [joint.name, *letters[1:]]
            for letter in letters:
                signs.append(joint.axis.sum())
                inertia = mass if letter == letters[-1] else items.RigidBodyInertia()
                kind = getattr(exudyn.JointType, f"{'Prismatic' if slide else 'Revolute'}{letter}")
                links.append(items.TreeLink(inertia, kind, exudyn.HT(translation=body.pos), above, spring, []))
                above = len(links) - 1
            last.append(above)
        self.signs, n = np.array(signs), len(names)
        self.q, self.v = np.zeros(n), np.zeros(n)
        super().__init__(task, step, names, range(n), range(n))
        start = {"initialCoordinates": self.q * signs, "initialCoordinates_t": self.v * signs}
        self.mechanism = self.system.CreateKinematicTree("", links, gravity=[0.0, 0.0, -GRAVITY], **start)
        self.node = self.system.GetObject(self.mechanism)["nodeNumber"]

    def attitude(self, q):
        return Rotation.from_euler("XYZ", q[:3]).as_quat()[[3, 0, 1, 2]]

    def coordinate(self, node, row):
        return self.system.AddMarker(items.MarkerNodeCoordinate(nodeNumber=node, coordinate=row))

    def held(self, name, sign, stiffness):
        """A prescribed joint by a stiff spring, critically damped for 1 kg or 1 kg m²; by a constraint without it."""
        ground, motion = self.system.AddNode(items.NodePointGround()), self.task.motions[name]
        pair = {"markerNumbers": [self.coordinate(ground, 0), self.coordinate(self.node, self.places[name])]}

        def offset(_system, t, *_):
            return sign * motion(t)[0]

        def spring(_system, t, _item, place, rate, *_):
            sigma, sigma_dot, _ = motion(t)
            return stiffness * (place - sign * sigma) + 2 * stiffness**0.5 * (rate - sign * sigma_dot)

        if stiffness:
            return items.CoordinateSpringDamper(**pair, springForceUserFunction=spring)
        return items.CoordinateConstraint(**pair, offset=offset(None, 0.0), offsetUserFunction=offset)

    def constrain(self):
        """What acts besides joints."""
        if self.task.constraint == "equality":
            ends = (
                items.MarkerKinematicTreeRigid(objectNumber=self.mechanism, linkNumber=k, localPosition=[length, 0, 0])
                for k, length in ((1, 1.5), (2, 1.2))
            )
            markers = [self.system.AddMarker(end) for end in ends]
            self.system.AddObject(items.SphericalJoint(markerNumbers=markers, constrainedAxes=[1, 0, 1]))
            return
        law = {"frictionProportionalZone": self.step}
        if self.task.constraint == "contact":
            stiffness = (math.pi / 4 / self.step) ** 2  # a contact lasts four steps
            memory = items.NodeGenericData(initialCoordinates=[0.0] * 3, numberOfDataCoordinates=3)
            law |= {"nodeNumber": self.system.AddNode(memory), "useLimitStops": True, "limitStopsUpper": 1e3}
            law |= {"limitStopsStiffness": stiffness, "limitStopsDamping": 2 * BOUNCE * stiffness**0.5}
        else:
            law["fDynamicFriction"] = self.file.tendon_frictionloss[0]
        pair = [self.coordinate(self.node, row) for row in (*self.moved, *self.asked)]
        self.system.AddObject(items.CoordinateSpringDamperExt(markerNumbers=pair, **law))


def moved(task, step, radius, stiffness=0.0):
    it = _Model(task, step)
    system, signs = it.system, it.signs[it.rows]
    if task.constraint:
        it.constrain()
    kind = exudyn.OutputVariableType
    sensors = [items.SensorNode(nodeNumber=it.node, outputVariableType=kind.Coordinates, storeInternal=True)]
    for name, sign in zip(task.motions, signs, strict=True):
        held = system.AddObject(it.held(name, sign, stiffness / step**2))
        sensors.append(items.SensorObject(objectNumber=held, outputVariableType=kind.Force, storeInternal=True))
    numbers = [system.AddSensor(sensor) for sensor in sensors]
    system.Assemble()
    options = exudyn.SimulationSettings()
    integration = options.timeIntegration
    integration.numberOfSteps, integration.endTime = round(task.stop / step), task.stop
    integration.generalizedAlpha.spectralRadius = radius
    integration.newton.relativeTolerance = 1e-10
    options.solutionSettings.sensorsWritePeriod = step
    options.solutionSettings.writeSolutionToFile = False
    begin = time.process_time()
    try:
        system.SolveDynamic(options, exudyn.DynamicSolverType.GeneralizedAlpha)
    except Exception as error:  # noqa: BLE001 - it has no class of its own
        raise CannotError(f"solver: {str(error)[:40]}") from None
    seconds = time.process_time() - begin
    found, *forces = (system.GetSensorStoredData(number)[:, 1:] for number in numbers)
    samples = zip(map(it.read, found * it.signs), np.hstack(forces) * -signs, strict=True)
    return answered(task, step, [[*samples]]), seconds


PAGE = "https://exudyn.readthedocs.io/en/latest/docs/RST/items/ObjectConnectorCoordinate"
WAYS = (
    Way("exudyn", "coordinate constraint", f"{PAGE}.html", moved, {"radius": (0.6, 0.9)}),
    Way("exudyn", "stiff spring", f"{PAGE}SpringDamper.html", moved, {"radius": (0.6,), "stiffness": (0.1, 1e3)}),
)
