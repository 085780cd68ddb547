"""Exudyn: a kinematic tree whose joints constraints or stiff springs prescribe, by the generalised-alpha method."""

from __future__ import annotations

import math
import time
from functools import partial
from typing import Any
from xml.etree import ElementTree as ET

import exudyn
import numpy as np
from exudyn import utilities as items
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from referee.task import GRAVITY, Task
from referee.way import CannotError, Places, Run, Way, answered

exudyn.config.printToConsole = False
BOUNCE = -math.log(0.8) / math.hypot(math.pi, math.log(0.8))  # damping ratio of a stop that throws back 0.8
KIND = exudyn.OutputVariableType


class _Tree:
    """Links of a task in the order of its file; a ball joint is three hinges."""

    def __init__(self, task: Task) -> None:
        self.names: list[str] = []
        self.signs: list[float] = []
        self.links: list[tuple[Any, int, NDArray, NDArray, NDArray, float]] = []
        world = ET.fromstring(task.mjcf()).find("worldbody")
        assert world is not None
        self._add(world, -1)

    def _add(self, parent: ET.Element, index: int) -> None:
        def numbers(element: Any, name: str, default: str = "0 0 0") -> NDArray:
            return np.array(element.get(name, default).split(), dtype=float)

        def link(name: str, kind: str, above: int, mass: float = 0.0, more: Any = ((0.0,) * 3,) * 2) -> None:
            self.names.append(name)
            joint = getattr(exudyn.JointType, kind)
            self.links.append((joint, above, numbers(body, "pos"), np.diag(more[1]), np.array(more[0]), mass))

        for body in parent.iterfind("body"):
            joint, inertial, above = body.find("joint"), body.find("inertial"), index
            assert joint is not None
            axis, name = numbers(joint, "axis", "0 0 1"), str(joint.get("name"))
            kind = f"{'Prismatic' if joint.get('type') == 'slide' else 'Revolute'}{'XYZ'[np.abs(axis).argmax()]}"
            if joint.get("type") == "ball":
                for letter in "XY":
                    link(name, f"Revolute{letter}", above)
                    above, name = len(self.names) - 1, f"{name}_"
                    self.signs.append(1.0)
            self.signs.append(float(axis.sum()))
            mass = float(numbers(inertial, "mass")[0])
            link(name, kind, above, mass, [numbers(inertial, end) for end in ("pos", "diaginertia")])
            self._add(body, len(self.names) - 1)


def moved(task: Task, step: float, radius: float, stiffness: float = 0.0) -> Run:
    tree = _Tree(task)
    container = exudyn.SystemContainer()
    system: Any = container.AddSystem()
    n = len(tree.names)
    where = {name: k for k, name in enumerate(tree.names)}
    places = Places(task, where, where, lambda q: Rotation.from_euler("XYZ", q[:3]).as_quat()[[3, 0, 1, 2]])
    q, v = np.zeros(n), np.zeros(n)
    places.start(q, v)
    node = system.AddNode(
        items.NodeGenericODE2(
            referenceCoordinates=[0.0] * n,
            initialCoordinates=q * tree.signs,
            initialCoordinates_t=v * tree.signs,
            numberOfODE2Coordinates=n,
        )
    )
    kinds, parents, offsets, inertias, centres, masses = zip(*tree.links, strict=True)
    mechanism = system.AddObject(
        items.ObjectKinematicTree(
            nodeNumber=node,
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
    ground = system.AddMarker(
        items.MarkerNodeCoordinate(nodeNumber=system.AddNode(items.NodePointGround()), coordinate=0)
    )
    markers = {
        name: system.AddMarker(items.MarkerNodeCoordinate(nodeNumber=node, coordinate=k)) for name, k in where.items()
    }
    for name, constant in task.springs.items():
        system.AddObject(items.CoordinateSpringDamper(markerNumbers=[ground, markers[name]], stiffness=constant))
    if task.constraint:
        _constrain(system, task, step, mechanism, [markers[name] for name in (*task.motions, *task.asked)])
    sensors = [
        system.AddSensor(items.SensorNode(nodeNumber=node, outputVariableType=KIND.Coordinates, storeInternal=True))
    ]
    for name, motion in task.motions.items():
        sign, pair = tree.signs[where[name]], [ground, markers[name]]
        if stiffness:
            spring = partial(_spring, motion, sign, stiffness / step**2)
            held = items.CoordinateSpringDamper(markerNumbers=pair, springForceUserFunction=spring)
        else:
            held = items.CoordinateConstraint(
                markerNumbers=pair, offset=sign * motion(0.0)[0], offsetUserFunction=partial(_offset, motion, sign)
            )
        number = system.AddObject(held)
        sensors.append(
            system.AddSensor(items.SensorObject(objectNumber=number, outputVariableType=KIND.Force, storeInternal=True))
        )
    system.Assemble()
    options: Any = exudyn.SimulationSettings()
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
    found, *forces = (system.GetSensorStoredData(sensor)[:, 1:] for sensor in sensors)
    signs = [-tree.signs[row] for row in places.rows]
    read = np.array([places.read(row) for row in found * tree.signs])
    return answered(task, step, seconds, (read, [*(np.hstack(forces) * signs)]))


def _offset(motion: Any, sign: float, _system: Any, t: float, *_: Any) -> float:
    return sign * motion(t)[0]


def _spring(motion: Any, sign: float, stiffness: float, _system: Any, t: float, _item: int, *state: Any) -> float:
    """Critically damped for 1 kg or 1 kg m²."""
    sigma, sigma_dot, _ = motion(t)
    return stiffness * (state[0] - sign * sigma) + 2 * stiffness**0.5 * (state[1] - sign * sigma_dot)


def _constrain(system: Any, task: Task, step: float, mechanism: int, pair: list[int]) -> None:
    if task.constraint == "equality":
        ends = [
            system.AddMarker(
                items.MarkerKinematicTreeRigid(objectNumber=mechanism, linkNumber=k, localPosition=[length, 0, 0])
            )
            for k, length in ((1, 1.5), (2, 1.2))
        ]
        system.AddObject(items.SphericalJoint(markerNumbers=ends, constrainedAxes=[1, 0, 1]))
        return
    if task.constraint == "contact":
        stiffness = (math.pi / 4 / step) ** 2  # a contact lasts four steps
        law: dict[str, Any] = {
            "nodeNumber": system.AddNode(
                items.NodeGenericData(initialCoordinates=[0.0] * 3, numberOfDataCoordinates=3)
            ),
            "useLimitStops": True,
            "limitStopsUpper": 1e3,
            "limitStopsStiffness": stiffness,
            "limitStopsDamping": 2 * BOUNCE * stiffness**0.5,
        }
    else:
        grip = ET.fromstring(task.mjcf()).find("tendon/fixed")
        assert grip is not None
        law = {"fDynamicFriction": float(grip.get("frictionloss", 0)), "frictionProportionalZone": step}
    system.AddObject(items.CoordinateSpringDamperExt(markerNumbers=pair, **law))


PAGE = "https://exudyn.readthedocs.io/en/latest/docs/RST/items/ObjectConnectorCoordinate"
WAYS = (
    Way("exudyn", "coordinate constraint", f"{PAGE}.html", moved, [{"radius": r} for r in (0.6, 0.9)]),
    Way(
        "exudyn",
        "stiff spring",
        f"{PAGE}SpringDamper.html",
        moved,
        [{"radius": 0.6, "stiffness": k} for k in (0.1, 1e3)],
    ),
)
