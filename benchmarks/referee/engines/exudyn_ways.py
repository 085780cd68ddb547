"""Exudyn: a kinematic tree whose joints coordinate constraints prescribe, with the generalised-alpha method."""

from __future__ import annotations

import time
import xml.etree.ElementTree as ET
from typing import Any

import exudyn
import numpy as np
from exudyn.utilities import (
    CoordinateConstraint,
    CoordinateSpringDamper,
    MarkerNodeCoordinate,
    NodeGenericODE2,
    NodePointGround,
    ObjectKinematicTree,
    SensorNode,
    SensorObject,
)
from scipy.integrate import cumulative_simpson

from referee.task import GRAVITY, INSTANTS, Answer, Task
from referee.way import CannotError, Run, Way

exudyn.config.printToConsole = False
KINDS = {"hinge": "Revolute", "slide": "Prismatic"}


class _Tree:
    """Joints of a task in the order of its file."""

    def __init__(self, task: Task) -> None:
        if task.constraint or task.asked[0] == ("attitude",):
            raise CannotError("not written: loops, contacts and ball joints are no part of a kinematic tree")
        self.names: list[str] = []
        self.signs: list[float] = []
        self.parents: list[int] = []
        self.kinds: list[Any] = []
        self.offsets, self.masses, self.centres, self.inertias = [], [], [], []
        self._add(ET.fromstring(f"<all>{task.bodies}</all>"), -1)

    def _add(self, parent: ET.Element, index: int) -> None:
        for body in parent.iterfind("body"):
            joint, inertial = body.find("joint"), body.find("inertial")
            assert joint is not None
            assert inertial is not None
            axis = np.array(joint.get("axis", "0 0 1").split(), dtype=float)
            letter = "XYZ"[int(np.argmax(np.abs(axis)))]
            mass, centre = float(inertial.get("mass", 0)), np.array(inertial.get("pos", "").split(), dtype=float)
            self.names.append(joint.get("name", ""))
            self.signs.append(float(axis.sum()))
            self.parents.append(index)
            self.kinds.append(getattr(exudyn.JointType, KINDS[joint.get("type", "")] + letter))
            self.offsets.append(np.array(body.get("pos", "").split(), dtype=float))
            self.masses.append(mass)
            self.centres.append(centre)
            steiner = mass * (centre @ centre * np.eye(3) - np.outer(centre, centre))
            self.inertias.append(np.diag(np.array(inertial.get("diaginertia", "").split(), dtype=float)) + steiner)
            self._add(body, len(self.names) - 1)


def constrained(task: Task, step: float, radius: float) -> Run:
    tree = _Tree(task)
    container = exudyn.SystemContainer()
    system: Any = container.AddSystem()
    n = len(tree.names)
    q, v = np.zeros(n), np.zeros(n)
    starts = dict(task.start) | {name: tuple(task.sigma(0.0)[:2, k]) for k, name in enumerate(task.motions)}
    for name, (place, rate) in starts.items():
        k = tree.names.index(name)
        q[k], v[k] = tree.signs[k] * place, tree.signs[k] * rate
    node = system.AddNode(
        NodeGenericODE2(
            referenceCoordinates=[0.0] * n, initialCoordinates=q, initialCoordinates_t=v, numberOfODE2Coordinates=n
        )
    )
    system.AddObject(
        ObjectKinematicTree(
            nodeNumber=node,
            jointTypes=tree.kinds,
            linkParents=tree.parents,
            jointTransformations=exudyn.Matrix3DList([np.eye(3)] * n),
            jointOffsets=exudyn.Vector3DList(tree.offsets),
            linkInertiasCOM=exudyn.Matrix3DList(
                [
                    i - m * (c @ c * np.eye(3) - np.outer(c, c))
                    for i, m, c in zip(tree.inertias, tree.masses, tree.centres, strict=True)
                ]
            ),
            linkCOMs=exudyn.Vector3DList(tree.centres),
            linkMasses=tree.masses,
            gravity=[0.0, 0.0, -GRAVITY],
        )
    )
    ground = system.AddMarker(MarkerNodeCoordinate(nodeNumber=system.AddNode(NodePointGround()), coordinate=0))
    for name, stiffness in task.springs.items():
        marker = system.AddMarker(MarkerNodeCoordinate(nodeNumber=node, coordinate=tree.names.index(name)))
        system.AddObject(CoordinateSpringDamper(markerNumbers=[ground, marker], stiffness=stiffness))
    forces = []
    for name, motion in task.motions.items():
        k = tree.names.index(name)
        marker = system.AddMarker(MarkerNodeCoordinate(nodeNumber=node, coordinate=k))
        offset = lambda mbs, t, index, value, motion=motion, sign=tree.signs[k]: sign * motion(t)[0]  # noqa: ARG005, E731
        held = system.AddObject(
            CoordinateConstraint(markerNumbers=[ground, marker], offset=q[k], offsetUserFunction=offset)
        )
        kind = exudyn.OutputVariableType.Force
        forces.append(
            (
                -tree.signs[k],
                system.AddSensor(SensorObject(objectNumber=held, outputVariableType=kind, storeInternal=True)),
            )
        )
    kind = exudyn.OutputVariableType.Coordinates
    places = system.AddSensor(SensorNode(nodeNumber=node, outputVariableType=kind, storeInternal=True))
    system.Assemble()
    options = exudyn.SimulationSettings()
    options.timeIntegration.numberOfSteps = round(task.stop / step)
    options.timeIntegration.endTime = task.stop
    options.timeIntegration.generalizedAlpha.spectralRadius = radius
    options.timeIntegration.newton.relativeTolerance = 1e-10
    options.solutionSettings.sensorsWritePeriod = step
    options.solutionSettings.writeSolutionToFile = False
    options.timeIntegration.verboseMode = 0
    begin = time.process_time()
    try:
        system.SolveDynamic(options, exudyn.DynamicSolverType.GeneralizedAlpha)
    except Exception as error:  # noqa: BLE001 - it has no class of its own
        raise CannotError(f"solver: {str(error)[:40]}") from None
    seconds = time.process_time() - begin
    rows = round(task.stop / INSTANTS / step) * np.arange(1, INSTANTS + 1)
    found = system.GetSensorStoredData(places)[:, 1:] * tree.signs
    moved = np.array([found[rows][:, [tree.names.index(n) for n in names]].sum(axis=1) for names in task.asked]).T
    lambdas = np.array([sign * system.GetSensorStoredData(sensor)[:, 1] for sign, sensor in forces]).T
    sigma = np.array([task.sigma(k * step, -1.0) for k in range(len(lambdas))])
    lambdas[:, 0] -= task.carrier * (sigma[:, 2, 0] + task.weight)
    work = cumulative_simpson(np.sum(lambdas * sigma[:, 1], axis=1), dx=step, initial=0)
    return Run(Answer(moved, lambdas[rows, 0], work[rows]), seconds)


WAYS = (
    Way(
        "exudyn",
        "coordinate constraint",
        "exudyn.readthedocs.io: ObjectConnectorCoordinate, offsetUserFunction",
        constrained,
        [{"radius": r} for r in (0.6, 0.9)],
    ),
)
