"""The IFToMM benchmarks A01 to A05 in Exudyn (J. Gerstmayr, Multibody System Dynamics 2023), if it is installed."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from importlib import import_module
from typing import TYPE_CHECKING, Any

import numpy as np
from iftomm_linkages import BricardMechanism, FlyballGovernor, Squeezer, joints_of
from numpy.typing import NDArray

exudyn: Any
items: Any
try:
    exudyn, items = import_module("exudyn"), import_module("exudyn.utilities")
except ImportError:
    exudyn = items = None

if TYPE_CHECKING:
    from iftomm import Case

GRAVITY = [0.0, -9.81, 0.0]
DAMPING = 0.95  # spectral radius of the generalised-alpha method; without damping it fails where A02 is singular
FINEST, TRIAL = 12, 2


@dataclass(frozen=True, slots=True)
class Attempt:
    """A solver with the setting that was found for it, ready to be timed."""

    solver: str
    setting: str  # step or tolerance
    error: float  # of the benchmark
    time: Callable[[], float]  # [s]


@dataclass(frozen=True)
class _Mechanism:
    """An assembled mechanism and the sensors of its coordinates."""

    container: Any  # keeps the system alive
    system: Any
    sensors: list[int]
    axes: tuple[int, int] = (0, 2)  # of each reading, the first and behind the last


@dataclass(frozen=True)
class _Solver:
    """A solver, and how it solves linear systems."""

    name: str  # of exudyn.DynamicSolverType
    order: int
    linear: str = ""  # of exudyn.LinearSolverType; none: an explicit one, which adapts its steps

    def setting(self, case: Case, fineness: int) -> str:
        if not self.linear:
            return f"{self.name}, tolerance {_tolerance(fineness):g}"
        return f"{self.name}, {self.linear}, step {_step(case, fineness):.3g} s"


_EXPLICIT = (_Solver("DOPRI5", 5), _Solver("ODE23", 3))
_IMPLICIT = tuple(
    _Solver(name, 2, linear)
    for name in ("GeneralizedAlpha", "TrapezoidalIndex2")
    for linear in ("EXUdense", "EigenDense", "EigenSparse")
)


def peers(case: Case, allowed: float, limit: float) -> Iterator[Attempt]:
    """Each formulation, by the best of its solvers; none where Exudyn is missing.

    :param limit: how long a run may take while its setting is refined [s].
    """
    if exudyn is None:
        print(f"{case.name} without Exudyn, which is not installed: pip install exudyn", file=sys.stderr)
        return
    exudyn.config.printToConsole = False  # a step that is too coarse is no news
    formulations: dict[str, list[tuple[str, Callable[[], _Mechanism], tuple[_Solver, ...]]]] = {
        "A01": [("one angle, adaptive", _tree, _EXPLICIT), ("constraint, fixed steps", _on_a_rod, _IMPLICIT)],
        "A02": [("joints, fixed steps", lambda: _four_bars(case.windows), _IMPLICIT)],
        "A03": [("joints, fixed steps", _squeezer, _IMPLICIT)],
        "A04": [("joints, fixed steps", _bricard, _IMPLICIT)],
        "A05": [("tree, adaptive", _governor, _EXPLICIT), ("tree, fixed steps", _governor, _IMPLICIT)],
    }
    for name, create, solvers in formulations[case.name[:3]]:
        solver = min(solvers, key=lambda it: _cost(case, create(), it))
        yield _refined(case, f"Exudyn {exudyn.__version__}, {name}", create, solver, allowed, limit)


def _cost(case: Case, mechanism: _Mechanism, solver: _Solver) -> float:
    """Time of a trial for an error of 1, as the order of the solver says; infinite if it fails."""
    seconds, error = _tried(case, mechanism, solver, TRIAL)
    return seconds * error ** (1 / solver.order)


def _tried(case: Case, mechanism: _Mechanism, solver: _Solver, fineness: int) -> tuple[float, float]:
    """Processor time and error; both infinite if it fails, as where a step is too coarse for Newton's method."""
    try:
        seconds, times, found = _run(case, mechanism, solver, fineness)
    except (exudyn.SolverError, exudyn.InternalError):
        return np.inf, np.inf
    error = case.error(found, times)
    return seconds, error if np.isfinite(error) else np.inf


def _refined(  # noqa: PLR0917 - a row of the table above
    case: Case, name: str, create: Callable[[], _Mechanism], solver: _Solver, allowed: float, limit: float
) -> Attempt:
    """The coarsest step (or tolerance) of a sequence that is good enough, if that does not take too long."""
    fineness = 1
    while True:
        seconds, error = _tried(case, create(), solver, fineness)
        if error <= allowed or (np.isfinite(error) and 2 * seconds > limit) or fineness == FINEST:
            break
        fineness += 1
    return Attempt(name, solver.setting(case, fineness), error, lambda: _run(case, create(), solver, fineness)[0])


def _step(case: Case, fineness: int) -> float:
    return case.duration / case.steps / 2 ** (fineness + 1)


def _tolerance(fineness: int) -> float:
    return 10.0**-fineness / 100


def _run(case: Case, mechanism: _Mechanism, solver: _Solver, fineness: int) -> tuple[float, NDArray, NDArray]:
    """Processor time of a run, output times (they differ a little from what is asked for), and the coordinates."""
    settings = exudyn.SimulationSettings()
    integration = settings.timeIntegration
    integration.endTime = case.duration
    integration.verboseMode = 0
    settings.solution.file.write = False
    settings.solution.sensors.writePeriod = case.duration / case.steps
    if solver.linear:
        integration.numberOfSteps = round(case.duration / _step(case, fineness))
        integration.newton.useModifiedNewton = True
        integration.generalizedAlpha.spectralRadius = DAMPING
        settings.linearSolver.ignoreSingularJacobian = True
        settings.linearSolver.solverType = getattr(exudyn.LinearSolverType, solver.linear)
    else:
        integration.numberOfSteps = case.steps  # the largest steps
        integration.automaticStepSize = True
        integration.minimumStepSize = 1e-10
        integration.absoluteTolerance = integration.relativeTolerance = _tolerance(fineness)
    begin = time.process_time()
    mechanism.system.SolveDynamic(settings, solverType=getattr(exudyn.DynamicSolverType, solver.name))
    seconds = time.process_time() - begin
    readings = [mechanism.system.GetSensorStoredData(sensor).T for sensor in mechanism.sensors]
    return seconds, readings[0][0], np.concatenate([reading[1:][slice(*mechanism.axes)] for reading in readings])


def _sensors(system: Any, kind: type, quantities: tuple[str, ...], **what: Any) -> list[int]:
    types = (getattr(exudyn.OutputVariableType, quantity) for quantity in quantities)
    return [
        system.AddSensor(kind(outputVariableType=kept, storeInternal=True, writeToFile=False, **what)) for kept in types
    ]


def _tree() -> _Mechanism:
    """A01 with one angle, from the horizontal."""
    container = exudyn.SystemContainer()
    system = container.AddSystem()
    node = system.AddNode(
        items.NodeGenericODE2(
            referenceCoordinates=[0.0],
            initialCoordinates=[0.0],
            initialCoordinates_t=[0.0],
            numberOfODE2Coordinates=1,
        )
    )
    tree = system.AddObject(
        items.ObjectKinematicTree(
            nodeNumber=node,
            jointTypes=[exudyn.JointType.RevoluteZ],
            linkParents=[-1],
            jointTransformations=exudyn.Matrix3DList([np.eye(3)]),
            jointOffsets=exudyn.Vector3DList([[0.0, 0.0, 0.0]]),
            linkInertiasCOM=exudyn.Matrix3DList([np.zeros((3, 3))]),
            linkCOMs=exudyn.Vector3DList([[1.0, 0.0, 0.0]]),
            linkMasses=[1.0],
            gravity=GRAVITY,
        )
    )
    place = {"objectNumber": tree, "linkNumber": 0, "localPosition": [1.0, 0.0, 0.0]}
    sensors = _sensors(system, items.SensorKinematicTree, ("Position",), **place)
    system.Assemble()
    return _Mechanism(container, system, sensors)


def _on_a_rod() -> _Mechanism:
    """A01 as a point on a rod of constant length."""
    container = exudyn.SystemContainer()
    system = container.AddSystem()
    ground = system.AddObject(items.ObjectGround())
    node = system.AddNode(items.NodePoint2D(referenceCoordinates=[1.0, 0.0]))
    point = system.AddObject(items.ObjectMassPoint2D(mass=1.0, nodeNumber=node))
    pivot = system.AddMarker(items.MarkerBodyPosition(bodyNumber=ground))
    bob = system.AddMarker(items.MarkerBodyPosition(bodyNumber=point))
    system.AddLoad(items.LoadForceVector(markerNumber=bob, loadVector=GRAVITY))
    system.AddObject(items.ObjectConnectorDistance(markerNumbers=[pivot, bob], distance=1.0))
    sensors = _sensors(system, items.SensorNode, ("Position",), nodeNumber=node)
    system.Assemble()
    return _Mechanism(container, system, sensors)


def _four_bars(windows: int) -> _Mechanism:
    """A02 as rigid bodies with revolute joints."""
    container = exudyn.SystemContainer()
    system = container.AddSystem()
    ground = system.AddObject(items.ObjectGround())

    def at(body: int, x: float) -> int:
        return system.AddMarker(items.MarkerBodyPosition(bodyNumber=body, localPosition=[x, 0.0, 0.0]))

    def rod(place: list[float], velocity: list[float]) -> int:
        node = system.AddNode(items.NodeRigidBody2D(referenceCoordinates=place, initialVelocities=velocity))
        body = system.AddObject(items.ObjectRigidBody2D(nodeNumber=node, mass=1.0, inertia=1 / 12))
        mass = system.AddMarker(items.MarkerBodyMass(bodyNumber=body))
        system.AddLoad(items.LoadMassProportional(markerNumber=mass, loadVector=GRAVITY))
        return body

    def join(one: int, other: int) -> None:
        system.AddObject(items.ObjectJointRevolute2D(markerNumbers=[one, other]))

    standing = [rod([i, 0.5, np.pi / 2], [0.5, 0.0, -1.0]) for i in range(windows + 1)]
    lying = [rod([i + 0.5, 1.0, 0.0], [1.0, 0.0, 0.0]) for i in range(windows)]
    for i, body in enumerate(standing):
        join(at(ground, i), at(body, -0.5))
    for one, between, other in zip(standing, lying, standing[1:], strict=False):
        join(at(one, 0.5), at(between, -0.5))
        join(at(other, 0.5), at(between, 0.5))
    place = {"bodyNumber": standing[0], "localPosition": [0.5, 0.0, 0.0]}
    sensors = _sensors(system, items.SensorBody, ("Position", "Velocity"), **place)
    system.Assemble()
    return _Mechanism(container, system, sensors)


def _squeezer() -> _Mechanism:
    """A03 as rigid bodies in a plane with revolute joints: those of our linkage, which turn about -y."""
    container = exudyn.SystemContainer()
    system = container.AddSystem()
    frames = {"ground": (0.0, 0.0, 0.0)}  # place of the first joint, angle
    bodies, centres = {"ground": system.AddObject(items.ObjectGround())}, {"ground": np.zeros(3)}

    def at(body: Any, place: Sequence[float]) -> int:
        local = [place[0] - centres[body.name][0], place[2] - centres[body.name][2], 0.0]
        return system.AddMarker(items.MarkerBodyPosition(bodyNumber=bodies[body.name], localPosition=local))

    def moved(frame: tuple[float, float, float], place: Sequence[float]) -> tuple[float, float]:
        x, z, angle = frame
        c, s = np.cos(angle), np.sin(angle)
        return x + c * place[0] - s * place[2], z + s * place[0] + c * place[2]

    joints = joints_of(Squeezer)
    for joint in joints:
        if joint.child.name in frames:
            continue  # closes a loop
        parent, body = frames[joint.parent.name], joint.child
        frames[body.name] = frame = (*moved(parent, joint.at), parent[2] + joint.start)
        centres[body.name] = np.array(body.centre)
        node = system.AddNode(items.NodeRigidBody2D(referenceCoordinates=[*moved(frame, body.centre), frame[2]]))
        inertia = {"physicsMass": body.mass, "physicsInertia": body.inertia[1]}
        bodies[body.name] = system.AddObject(items.ObjectRigidBody2D(nodeNumber=node, **inertia))
    for joint in joints:
        ends = [at(joint.parent, joint.at), at(joint.child, joint.at_child)]
        system.AddObject(items.ObjectJointRevolute2D(markerNumbers=ends))
    spring: Any = Squeezer.spring
    laws = {"stiffness": spring.laws["stiffness"], "referenceLength": spring.laws["length"]}
    system.AddObject(items.ObjectConnectorSpringDamper(markerNumbers=[at(*end) for end in spring.ends], **laws))
    motor = system.AddMarker(items.MarkerBodyRigid(bodyNumber=bodies["crank"]))
    system.AddLoad(items.LoadTorqueVector(markerNumber=motor, loadVector=[0.0, 0.0, 0.033]))
    place = {"bodyNumber": bodies["crank"], "localPosition": [0.007 - centres["crank"][0], 0.0, 0.0]}
    sensors = _sensors(system, items.SensorBody, ("Position",), **place)
    system.Assemble()
    return _Mechanism(container, system, sensors)


def _bricard() -> _Mechanism:
    """A04 as rigid bodies in space with revolute joints."""
    container = exudyn.SystemContainer()
    system = container.AddSystem()
    numbers = {"ground": system.AddObject(items.ObjectGround())}
    places = {"ground": np.zeros(3)}
    directions = dict(zip("xyz", np.eye(3), strict=True))
    for joint in joints_of(BricardMechanism):
        place = places[joint.parent.name] + np.array(joint.at)
        body = joint.child
        if body.name not in numbers:
            places[body.name] = place
            inertia = items.RigidBodyInertia(body.mass, np.diag(body.inertia), [0, 0, 0]).Translated(body.centre)
            numbers[body.name] = system.CreateRigidBody(inertia=inertia, referencePosition=place, gravity=GRAVITY)
        pair = [numbers[joint.parent.name], numbers[body.name]]
        system.CreateRevoluteJoint(bodyNumbers=pair, position=place, axis=directions[joint.axis])
    sensors = _sensors(system, items.SensorBody, ("Position",), bodyNumber=numbers["rod_3"])
    system.Assemble()
    return _Mechanism(container, system, sensors, (0, 3))


def _governor() -> _Mechanism:
    """A05 as a tree of four bodies, with springs and dampers between them."""
    container = exudyn.SystemContainer()
    system = container.AddSystem()
    joints = joints_of(FlyballGovernor)
    kinds = {"z": exudyn.JointType.RevoluteZ, "y": exudyn.JointType.RevoluteY}
    parents = {"ground": -1, **{joint.child.name: i for i, joint in enumerate(joints)}}
    turns = [items.RotationMatrixY(joint.start) if joint.axis == "y" else np.eye(3) for joint in joints]
    offsets = [[*joint.at[:2], joint.at[2] + (joint.start if joint.name == "s" else 0.0)] for joint in joints]
    bodies = [joint.child for joint in joints]
    moments = [np.diag(np.broadcast_to(body.inertia, 3)) for body in bodies]
    node = system.AddNode(
        items.NodeGenericODE2(
            referenceCoordinates=[0.0] * 4,
            initialCoordinates=[0.0] * 4,
            initialCoordinates_t=[joint.start_rate for joint in joints],
            numberOfODE2Coordinates=4,
        )
    )
    tree = system.AddObject(
        items.ObjectKinematicTree(
            nodeNumber=node,
            jointTypes=[exudyn.JointType.PrismaticZ if joint.name == "s" else kinds[joint.axis] for joint in joints],
            linkParents=[parents[joint.parent.name] for joint in joints],
            jointTransformations=exudyn.Matrix3DList(turns),
            jointOffsets=exudyn.Vector3DList(offsets),
            linkInertiasCOM=exudyn.Matrix3DList(moments),
            linkCOMs=exudyn.Vector3DList([list(map(float, body.centre)) for body in bodies]),
            linkMasses=[body.mass for body in bodies],
            gravity=[0.0, 0.0, -9.81],
        )
    )

    def at(body: Any, place: Sequence[float]) -> int:
        link = {"objectNumber": tree, "linkNumber": parents[body.name], "localPosition": list(place)}
        return system.AddMarker(items.MarkerKinematicTreeRigid(**link))

    couplers: list[Any] = [FlyballGovernor.coupler_1, FlyballGovernor.coupler_2]
    for spring in couplers:
        laws = {"stiffness": spring.laws["stiffness"], "damping": spring.laws["damping"]}
        ends = [at(*end) for end in spring.ends]
        law = items.ObjectConnectorSpringDamper(markerNumbers=ends, referenceLength=spring.laws["length"], **laws)
        system.AddObject(law)
    slider = {"objectNumber": tree, "linkNumber": parents["slider"], "localPosition": [0.0, 0.0, 0.0]}
    sensors = _sensors(system, items.SensorKinematicTree, ("Position",), **slider)
    system.Assemble()
    return _Mechanism(container, system, sensors, (2, 3))
