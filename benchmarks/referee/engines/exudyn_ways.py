"""Exudyn: a kinematic tree whose joints constraints or stiff springs prescribe, by the generalised-alpha method."""

import math
import time
from functools import partial

import exudyn
import mujoco
import numpy as np
from exudyn import utilities as items
from scipy.spatial.transform import Rotation

from referee.task import GRAVITY
from referee.way import CannotError, Model, Run, Way, answered

exudyn.config.printToConsole = False
BOUNCE = -math.log(0.8) / math.hypot(math.pi, math.log(0.8))  # damping ratio of a stop that throws back 0.8


class _Model(Model):
    """A task in Exudyn at its start: links of its file, as MuJoCo reads it; a ball joint is three hinges."""

    def __init__(self, task, step):
        self.container = exudyn.SystemContainer()  # which holds the system
        self.system = self.container.AddSystem()
        self.file = mujoco.MjModel.from_xml_string(task.mjcf())
        links = []
        last = [-1]  # link of each body
        for body in map(self.file.body, range(1, self.file.nbody)):
            joint, above = self.file.joint(body.jntadr[0]), last[body.parentid[0]]
            ball, slide = (joint.type[0] == getattr(mujoco.mjtJoint, f"mjJNT_{kind}") for kind in ("BALL", "SLIDE"))
            for letter in "XYZ" if ball else "XYZ"[abs(joint.axis).argmax()]:
                massive = not ball or letter == "Z"
                name = joint.name if not ball or letter == "X" else f"{joint.name} {letter}"
                kind = getattr(exudyn.JointType, f"{'Prismatic' if slide else 'Revolute'}{letter}")
                inertia = (np.diag(massive * body.inertia), massive * body.ipos, massive * body.mass[0])
                links.append((name, joint.axis.sum(), kind, above, body.pos, *inertia))
                above = len(links) - 1
            last.append(above)
        names, signs, kinds, parents, offsets, inertias, centres, masses = zip(*links, strict=True)
        self.signs, n = np.array(signs), len(names)
        self.q, self.v = np.zeros(n), np.zeros(n)
        super().__init__(task, step, names, range(n), range(n))
        start = {"initialCoordinates": self.q * signs, "initialCoordinates_t": self.v * signs}
        self.node = self.system.AddNode(
            items.NodeGenericODE2(referenceCoordinates=[0.0] * n, numberOfODE2Coordinates=n, **start)
        )
        self.mechanism = self.system.AddObject(
            items.ObjectKinematicTree(
                nodeNumber=self.node,
                jointTypes=list(kinds),
                linkParents=list(parents),
                jointTransformations=exudyn.Matrix3DList([np.eye(3)] * n),
                jointOffsets=exudyn.Vector3DList(list(offsets)),
                linkInertiasCOM=exudyn.Matrix3DList(list(inertias)),
                linkCOMs=exudyn.Vector3DList(list(centres)),
                linkMasses=list(masses),
                gravity=[0.0, 0.0, -GRAVITY],
            )
        )

    def state(self):
        return self.q, self.v

    def attitude(self, q):
        return Rotation.from_euler("XYZ", q[:3]).as_quat()[[3, 0, 1, 2]]

    def coordinate(self, node, row):
        return self.system.AddMarker(items.MarkerNodeCoordinate(nodeNumber=node, coordinate=row))

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
    system, ground = it.system, it.coordinate(it.system.AddNode(items.NodePointGround()), 0)

    def pair(name):
        return {"markerNumbers": [ground, it.coordinate(it.node, it.places[name])]}

    for name, constant in task.springs.items():
        system.AddObject(items.CoordinateSpringDamper(**pair(name), stiffness=constant))
    if task.constraint:
        it.constrain()
    kind = exudyn.OutputVariableType
    sensors = [items.SensorNode(nodeNumber=it.node, outputVariableType=kind.Coordinates, storeInternal=True)]
    for (name, motion), sign in zip(task.motions.items(), it.signs[it.rows], strict=True):
        if stiffness:
            spring = partial(_spring, motion, sign, stiffness / step**2)
            held = items.CoordinateSpringDamper(**pair(name), springForceUserFunction=spring)
        else:
            offset = partial(_offset, motion, sign)
            held = items.CoordinateConstraint(**pair(name), offset=offset(None, 0.0), offsetUserFunction=offset)
        number = system.AddObject(held)
        sensors.append(items.SensorObject(objectNumber=number, outputVariableType=kind.Force, storeInternal=True))
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
    samples = zip(map(it.read, found * it.signs), np.hstack(forces) * -it.signs[it.rows], strict=True)
    return Run(answered(task, step, [[*samples]]), seconds)


def _offset(motion, sign, _system, t, *_):
    return sign * motion(t)[0]


def _spring(motion, sign, stiffness, _system, t, *state):
    """Critically damped for 1 kg or 1 kg m²."""
    _, place, rate, *_ = state
    sigma, sigma_dot, _ = motion(t)
    return stiffness * (place - sign * sigma) + 2 * stiffness**0.5 * (rate - sign * sigma_dot)


PAGE = "https://exudyn.readthedocs.io/en/latest/docs/RST/items/ObjectConnectorCoordinate"
WAYS = (
    Way("exudyn", "coordinate constraint", f"{PAGE}.html", moved, {"radius": (0.6, 0.9)}),
    Way("exudyn", "stiff spring", f"{PAGE}SpringDamper.html", moved, {"radius": (0.6,), "stiffness": (0.1, 1e3)}),
)
