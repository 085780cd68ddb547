"""Two wheels turn a satellite by α about the axis of a locked third wheel: the shortest path has length √(α (4π - α)).

M 8.3 with M 2.  Without angular momentum J ω = -J_w φ', so with J_xx = J_yy the wheels along x and y move the attitude
along horizontal curves of the group of rotations, and ∫ ½ φ'·Θφ' dt over the duration T is ½ L² (J/J_w)² Θ/T with the
sub-Riemannian length L.  Half a turn has the length √3 π, instead of 2π for two opposite quarter turns about x with
half a turn about y between them.  ``plan`` uses only the equations, and FMUs replay the motion that it finds.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from liaisons import Plan, plan
from liaisons.scenarios import Claims, dots, panels, scenario, within

J, WHEEL, DURATION = 10.0, 0.1, 2.0
THETA = WHEEL - WHEEL**2 / J  # effective mass of a wheel [kg.m2]


def turned(angle: float, intervals: int = 20) -> Plan:
    end = {"attitude": (np.cos(angle / 2), 0, 0, np.sin(angle / 2))}
    mesh: Any = {"intervals": intervals, "accuracy": None}
    return plan("Satellite", ["wheel_1", "wheel_2"], end=end, duration=DURATION, J_xx=J, J_yy=J, **mesh)


def length(cost: NDArray) -> NDArray:
    """L [rad] of a motion of this cost."""
    return np.sqrt(2 * cost * DURATION / THETA) * WHEEL / J


@scenario
def main(claim: Claims) -> None:
    known, way, wheels = panels(
        ("the least length", "turn about z [rad]", "length [rad]"),
        ("half a turn: where x points", "x", "y", "z"),
        ("half a turn: the wheels", "t [s]", "rate [rad/s]"),
    )
    angles = np.linspace(0.4, np.pi, 6)
    closed = np.sqrt(angles * (4 * np.pi - angles))
    for intervals, tolerance in ((10, 1e-8), (20, 1e-11)):
        found = length(np.array([turned(angle, intervals).cost for angle in angles]))
        mesh = within(tolerance, because="the mesh is of tenth order in the interval, down to IPOPT's tolerance")
        claim(f"√(α (4π - α)) on a mesh of {intervals} intervals", found / closed, 1.0, mesh)
    alpha = np.linspace(0, np.pi, 100)
    known.plot(alpha, np.sqrt(alpha * (4 * np.pi - alpha)), label="√(α (4π - α))")
    known.plot(alpha, alpha + np.pi, "--", label="a quarter to and fro, between them α about y")
    dots(known, angles, found, label="planned")

    half = turned(np.pi)
    claim.verdicts += half.verify()
    run = half.replay()
    replay = within(1e-8, because="error of the mesh, and solver tolerance 1e-12")
    w, x, y, z = (run[name] for name in ("q_w", "q_x", "q_y", "q_z"))
    claim("the FMUs turn it by 180°", np.array([w[-1], x[-1], y[-1], abs(z[-1])]), np.array([0, 0, 0, 1.0]), replay)
    way.plot(1 - 2 * (y**2 + z**2), 2 * (x * y + w * z), 2 * (x * z - w * y))
    for name in ("wheel_1_dot", "wheel_2_dot"):
        wheels.plot(run.time, run[name], label=name.removesuffix("_dot"))
