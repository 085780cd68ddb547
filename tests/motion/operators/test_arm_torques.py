"""An arm of six axes follows a line by torques, which are those of Pinocchio's inverse dynamics."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.interpolate import BSpline, make_interp_spline
from scipy.spatial.transform import Rotation

from liaisons import Result, simulate
from liaisons.linkages import Body, BodyPoint, Linkage, Revolute, ground

Floats = Any


class Link(NamedTuple):
    """Axis and place of a joint in the frame of the link before; mass, centre, and inertia about it (xx, yy, ...)."""

    axis: str
    at: tuple[float, float, float]
    mass: float
    centre: tuple[float, float, float]
    inertia: tuple[float, float, float, float, float, float]


LINKS = (
    Link("z", (0, 0, 0), 4.0, (0, -0.02, 0.07), (0.012, 0.012, 0.009, 0.0, 0.0, 1e-3)),
    Link("y", (0, 0.13, 0.09), 8.0, (0.21, 0, 0.01), (0.02, 0.25, 0.25, 2e-3, 1e-3, 0.0)),
    Link("y", (0.42, -0.12, 0), 2.5, (0.17, 0, 0.02), (0.004, 0.05, 0.05, 0.0, -1e-3, 0.0)),
    Link("y", (0.39, 0, 0), 1.3, (0, 0.08, 0.01), (0.002, 0.001, 0.002, 0.0, 0.0, 2e-4)),
    Link("z", (0, 0.11, 0), 1.3, (0, 0.01, -0.07), (0.002, 0.002, 0.001, 1e-4, 0.0, 0.0)),
    Link("y", (0, 0, -0.095), 0.4, (0.005, 0.05, 0), (3e-4, 2e-4, 3e-4, 0.0, 2e-5, 0.0)),
)
TIP = (0.0, 0.08, 0.0)
AXES = tuple(f"axis_{k}" for k in range(1, 7))
START = np.array([0.3, -1.2, 1.6, -0.5, 0.4, 0.2])
WAY, DURATION = np.array([0.05, 0.30, -0.20]), 1.5


def link(k: int) -> Body:
    return Body(mass=LINKS[k].mass, centre=LINKS[k].centre, inertia=LINKS[k].inertia)


def arm(*, prescribed: bool) -> type[Linkage]:
    """An arm of about a metre and 18 kg, whose axes are turned by operators, or freely by what torques act."""

    def axis(k: int, parent: Body, child: Body) -> Revolute:
        return Revolute(parent, child, axis=LINKS[k].axis, at=LINKS[k].at, prescribed=prescribed, start=START[k])

    class SixAxes(Linkage):
        """Six links in a row."""

        base, upper, fore, wrist_1, wrist_2, flange = (link(k) for k in range(6))
        axis_1 = axis(0, ground, base)
        axis_2 = axis(1, base, upper)
        axis_3 = axis(2, upper, fore)
        axis_4 = axis(3, fore, wrist_1)
        axis_5 = axis(4, wrist_1, wrist_2)
        axis_6 = axis(5, wrist_2, flange)
        tip = BodyPoint(flange, at=TIP)

    return SixAxes


def tip_pose(q: Floats) -> tuple[Floats, Rotation, Floats]:
    """Position and attitude of the tip, and its Jacobian (velocity above angular velocity)."""
    place, turn, axes = np.zeros(3), Rotation.identity(), []
    for one, angle in zip(LINKS, q, strict=True):
        place = place + turn.apply(one.at)
        along = np.eye(3)["xyz".index(one.axis)]
        axes.append((turn.apply(along), place))
        turn *= Rotation.from_rotvec(angle * along)
    tip = place + turn.apply(TIP)
    return tip, turn, np.array([[*np.cross(a, tip - o), *a] for a, o in axes]).T


def program() -> tuple[BSpline, Floats]:
    """Angles by time whose tip goes along the line from rest to rest without turning, and where it begins."""
    t = np.linspace(0, DURATION, 201)
    s = t / DURATION
    share = s**3 * (10 - 15 * s + 6 * s**2)
    begin, attitude, _ = tip_pose(START)
    q, rows = START, []
    for part in share:
        for _ in range(20):  # Newton's steps, of which four are enough
            tip, turn, jacobian = tip_pose(q)
            miss = np.append(begin + part * WAY - tip, (attitude * turn.inv()).as_rotvec())
            q = q + np.linalg.solve(jacobian, miss)
            if np.abs(miss).max() < 1e-14:
                break
        rows.append(q)
    return make_interp_spline(t, rows, k=9), begin


def distance_from_the_line(run: Result, begin: Floats) -> float:
    """Greatest distance of the tip from the line [m]."""
    tip = np.array([run[f"tip_{x}"] for x in "xyz"]).T - begin
    along = WAY / np.linalg.norm(WAY)
    return float(np.linalg.norm(tip - np.outer(tip @ along, along), axis=1).max())


@pytest.fixture(scope="module")
def line() -> tuple[BSpline, Floats]:
    return program()


@pytest.fixture(scope="module")
def driven(line: tuple[BSpline, Floats]) -> Result:
    motion = line[0]
    inputs = {name: lambda t, k=k: [motion(t, n)[k] for n in range(3)] for k, name in enumerate(AXES)}
    return simulate(arm(prescribed=True), inputs=inputs, stop_time=DURATION, step_size=0.005)


def test_torques_along_a_line_are_those_of_pinocchio(driven: Result, line: tuple[BSpline, Floats]) -> None:
    pin: Any = pytest.importorskip("pinocchio")
    model, parent = pin.Model(), 0
    for k, one in enumerate(LINKS):
        joint = {"y": pin.JointModelRY, "z": pin.JointModelRZ}[one.axis]()
        parent = model.addJoint(parent, joint, pin.SE3(np.eye(3), np.array(one.at, float)), AXES[k])
        xx, yy, zz, xy, xz, yz = one.inertia
        tensor = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
        model.appendBodyToJoint(parent, pin.Inertia(one.mass, np.array(one.centre, float), tensor), pin.SE3.Identity())
    model.gravity.linear = np.array([0, 0, -9.81])
    data = model.createData()
    q, v, a = (np.array([driven[f"{name}{end}"] for name in AXES]).T for end in ("", "_dot", "_ddot"))
    torques = np.array([driven[f"{name}_force"] for name in AXES]).T
    expected = np.array([pin.rnea(model, data, *row) for row in zip(q, v, a, strict=True)])
    sizes = np.abs(expected).max(axis=0)
    assert sizes.min() > 0.01 < np.ptp(expected, axis=0)[:5].min(), "each bears something, and all but the last move it"
    assert_allclose(torques / sizes, expected / sizes, rtol=0, atol=1e-9)  # roundings of six links
    assert distance_from_the_line(driven, line[1]) < 1e-9


def test_the_torques_alone_take_an_arm_along_the_line(driven: Result, line: tuple[BSpline, Floats]) -> None:
    torques = make_interp_spline(driven.time, np.array([driven[f"{name}_force"] for name in AXES]).T, k=7)
    inputs = {f"{name}_force": lambda t, k=k: torques(t)[k] for k, name in enumerate(AXES)}
    run = simulate(arm(prescribed=False), inputs=inputs, stop_time=DURATION, step_size=0.005, tolerance=1e-10)
    assert distance_from_the_line(run, line[1]) < 1e-8  # tolerance 1e-10, times what a posture that falls amplifies
    end = np.array([run[f"tip_{x}"][-1] for x in "xyz"])
    assert_allclose(end, line[1] + WAY, rtol=0, atol=1e-8)
