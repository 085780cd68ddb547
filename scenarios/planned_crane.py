"""A crane moves its load by D from rest to rest: for small D the plan is that of the linear theory, up to a term in D².

M 7 with M 2: the pivot of a Pendulum moves by D, and the load is at rest at both ends.  For a given duration, the least
∫ a² dt of the linearised system is D² G, with G from the controllability Gramian; the nonlinearity of the pendulum adds
a relative term in (D/l)².  The motion of least time with |a| <= A is bang-bang with three switches, whose instants in
the linear theory follow from four equations; since A is small compared with g, the nonlinear ones differ by a term in
(A/g)².
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm
from scipy.optimize import root

from liaisons import Plan, plan
from liaisons.scenarios import Claims, dots, panels, scenario, within

LENGTH, GRAVITY, DURATION = 2.0, 9.81, 3.0
# (x, x', θ, θ') of the linear crane: x'' = a, θ'' = -(g/l) θ - a/l
MATRIX = np.zeros((4, 4))
MATRIX[0, 1] = MATRIX[2, 3] = 1.0
MATRIX[3, 2] = -GRAVITY / LENGTH
INPUT = np.array([0.0, 1.0, 0.0, -1 / LENGTH])


def gramian() -> NDArray:
    """∫ exp(Mt) b bᵀ exp(Mᵀt) dt over the duration, by Van Loan's exponential."""
    block = np.block([[-MATRIX, np.outer(INPUT, INPUT)], [np.zeros((4, 4)), MATRIX.T]])
    found = expm(block * DURATION)
    return found[4:, 4:].T @ found[:4, 4:]


def switched(durations: NDArray, bound: float) -> NDArray:
    """Where four arcs of ± A lead."""
    state = np.zeros(5)
    for T, sign in zip(durations, (1, -1, 1, -1), strict=True):
        block = np.zeros((5, 5))
        block[:4, :4], block[:4, 4] = MATRIX, sign * bound * INPUT
        state = expm(block * T) @ np.append(state[:4], 1.0)
    return state[:4]


def moved(way: float, **goal: Any) -> Plan:
    end = {"theta": 0, "theta_dot": 0, "pivot_x": way, "pivot_x_dot": 0}
    return plan("Pendulum", ["pivot_x"], start={"theta": 0}, end=end, length=LENGTH, gravity=GRAVITY, **goal)


@scenario
def main(claim: Claims) -> None:
    deviation, times, swing = panels(
        ("least ∫ a²: beyond the linear theory", "D/l", "relative deviation"),
        ("least time: beyond the linear theory", "A/g", "relative deviation"),
        ("the longest way", "t [s]", "x [m]"),
        mosaic="ab;cc",
        size=(9.0, 7.0),
    )
    order = within(0.05, because="the next term is smaller by the factor (D/l)²")
    ways = LENGTH * np.array([0.1, 0.2, 0.4])
    linear = np.linalg.inv(gramian())[0, 0]
    plans = [moved(way, duration=DURATION, minimize="pivot_x_ddot**2") for way in ways]
    excess = np.array([found.cost for found in plans]) / (ways**2 * linear) - 1
    claim.order("∫ a² differs from D² G by a term in D²", ways, np.abs(excess), 2, order)

    bounds = GRAVITY * np.array([0.02, 0.04, 0.08])
    late, fast = [], []
    for bound in bounds:
        way = bound * 0.6
        found = moved(way, duration=(0.5, 6), minimize="time", bounds={"pivot_x_ddot": (-bound, bound)})
        start = np.diff([0.0, *found.switches, found.duration])
        exact: Any = root(lambda d, A=bound, D=way: switched(d, A) - [D, 0, 0, 0], start, tol=1e-14)
        late.append(found.duration / exact.x.sum() - 1)
        fast.append(found)
    claim.order("the least time differs from the linear one by a term in A²", bounds, np.abs(late), 2, order)
    for axis, size, error in ((deviation, ways / LENGTH, excess), (times, bounds / GRAVITY, np.array(late))):
        axis.loglog(size, np.abs(error), "o", label="planned")
        axis.loglog(size, np.abs(error[0]) * (size / size[0]) ** 2, "k--", linewidth=1, label="as the square")
        axis.set_xticks(size, [f"{x:g}" for x in size])
        axis.set_xticks([], minor=True)
    claim.verdicts += plans[-1].verify() + fast[-1].verify()
    run = plans[-1].replay()
    swing.plot(run.time, run["pivot_x"], label="pivot")
    swing.plot(run.time, run["pivot_x"] + LENGTH * np.sin(run["theta"]), label="load")
    dots(swing, run.time[-1:], ways[-1:], label="goal", markersize=10)
