"""The IFToMM benchmarks A01 and A02 in Exudyn (J. Gerstmayr, Multibody System Dynamics 2023), if it is installed."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from importlib import import_module
from typing import TYPE_CHECKING, Any

import numpy as np
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
FINEST = 12


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
    explicit: bool = False


def peers(case: Case, allowed: float, limit: float) -> Iterator[Attempt]:
    """Each formulation; none where Exudyn is missing.

    :param limit: how long a run may take while its setting is refined [s].
    """
    if exudyn is None:
        print(f"{case.name} without Exudyn, which is not installed: pip install exudyn", file=sys.stderr)
        return
    if case.windows:
        yield _refined(case, "joints, generalised alpha", lambda: _four_bars(case.windows), allowed, limit)
        return
    yield _refined(case, "one angle, DOPRI5", _tree, allowed, limit)
    yield _refined(case, "constraint, generalised alpha", _on_a_rod, allowed, limit)


def _refined(case: Case, name: str, create: Callable[[], _Mechanism], allowed: float, limit: float) -> Attempt:
    """The coarsest step (or tolerance) of a sequence that is good enough, if that does not take too long."""
    fineness = 1
    while True:
        try:
            seconds, times, found = _run(case, create(), fineness)
            error = case.error(found, times)
        except exudyn.SolverError:  # a step too coarse for Newton's method
            seconds, error = 0.0, np.inf
        if error <= allowed or 2 * seconds > limit or fineness == FINEST:
            break
        fineness += 1
    solver = f"Exudyn {exudyn.__version__}, {name}"
    explicit = create().explicit
    setting = f"tolerance {10.0**-fineness / 100:g}" if explicit else f"step {_step(case, fineness):.3g} s"
    return Attempt(solver, setting, error, lambda: _run(case, create(), fineness)[0])


def _step(case: Case, fineness: int) -> float:
    return case.duration / case.steps / 2 ** (fineness + 1)


def _run(case: Case, mechanism: _Mechanism, fineness: int) -> tuple[float, NDArray, NDArray]:
    """Processor time of a run, output times (they differ a little from what is asked for), and the coordinates."""
    settings = exudyn.SimulationSettings()
    integration = settings.timeIntegration
    integration.endTime = case.duration
    integration.verboseMode = 0
    settings.solution.file.write = False
    settings.solution.sensors.writePeriod = case.duration / case.steps
    solver = exudyn.DynamicSolverType.GeneralizedAlpha
    if mechanism.explicit:
        solver = exudyn.DynamicSolverType.DOPRI5
        integration.numberOfSteps = case.steps  # the largest steps
        integration.automaticStepSize = True
        integration.minimumStepSize = 1e-10
        integration.absoluteTolerance = integration.relativeTolerance = 10.0**-fineness / 100
    else:
        integration.numberOfSteps = round(case.duration / _step(case, fineness))
        integration.newton.useModifiedNewton = True
        integration.generalizedAlpha.spectralRadius = DAMPING
        settings.linearSolver.ignoreSingularJacobian = True
        if case.windows > 5:
            settings.linearSolver.solverType = exudyn.LinearSolverType.EigenSparse
    begin = time.process_time()
    mechanism.system.SolveDynamic(settings, solverType=solver)
    seconds = time.process_time() - begin
    readings = [mechanism.system.GetSensorStoredData(sensor).T for sensor in mechanism.sensors]
    return seconds, readings[0][0], np.concatenate([reading[1:3] for reading in readings])


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
    return _Mechanism(container, system, sensors, explicit=True)


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
