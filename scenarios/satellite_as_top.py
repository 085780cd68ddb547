"""In the optimal turn by three wheels, a satellite moves like a free top with the inertia JΘJ/J_w², not about one axis.

M 8.3 with M 2: without angular momentum J ω = -J_w φ', so that ½ φ'·Θφ' = ½ ω·Mω with Θ = J_w - J_w² J⁻¹ and M = J (J -
J_w)/J_w.  This is a metric on the group of rotations that is constant in the body frame.  Its geodesics are the motions
of Euler's free top; the one that reaches the goal is found by shooting with Hamilton's equations for quaternions.  If J
is that of a sphere, the top turns about one axis, and the least ∫ λ² dt from rest to rest, by a cubic, is 12 J'² θ²/T³.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import root

from liaisons import hamiltonian_flow, plan
from liaisons.scenarios import Claims, dots, panels, scenario, within

J, WHEEL, DURATION, ANGLE = np.array([10.0, 12.0, 5.0]), 0.5, 2.0, 2.5
TOP = J * (J - WHEEL) / WHEEL
AXIS = np.array([1, 2, 2]) / 3
QUATERNION, RATES = ("q_w", "q_x", "q_y", "q_z"), ("omega_x", "omega_y", "omega_z")


def momenta(w: Any, x: Any, y: Any, z: Any, *p: Any) -> Any:
    """Of the top about its own axes: half of p · (q ⊗ e_k)."""
    return [
        (-p[0] * x + p[1] * w + p[2] * z - p[3] * y) / 2,
        (-p[0] * y - p[1] * z + p[2] * w + p[3] * x) / 2,
        (-p[0] * z + p[1] * y - p[2] * x + p[3] * w) / 2,
    ]


def top(L: NDArray, times: Any) -> NDArray:
    """q and p of the free top that starts at the identity with these momenta."""
    return hamiltonian_flow(
        lambda *z: sum(p**2 / m for p, m in zip(momenta(*z), TOP, strict=True)) / 2, [1, 0, 0, 0, 0, *(2 * L)], times
    )


@scenario
def main(claim: Claims) -> None:
    rates, way = panels(("the satellite turns as a top", "t [s]", "ω [rad/s]"), ("where x points", "x", "y", "z"))
    goal: Any = np.append(np.cos(ANGLE / 2), np.sin(ANGLE / 2) * AXIS)
    moments: Any = dict(zip(("J_xx", "J_yy", "J_zz"), J, strict=True))
    motion = plan("Satellite", end={"attitude": goal}, duration=DURATION, J_wheel=WHEEL, **moments)
    shot: Any = root(lambda L: top(L, DURATION)[1:4] - goal[1:], TOP * ANGLE * AXIS / DURATION, tol=1e-14)
    least = DURATION * np.sum(shot.x**2 / TOP) / 2
    shooting = within(1e-9, because="relative error; the mesh is of tenth order, the shooting has tolerance 1e-13")
    claim("the least cost is that of the top, by shooting", motion.cost / least, 1.0, shooting)
    run = motion.replay()
    exact = top(shot.x, run.time)
    replay = within(1e-8, because="error of the mesh, and solver tolerance 1e-12")
    claim("the FMUs turn the satellite like the top", [run[name] for name in QUATERNION], exact[:4], replay)
    one_axis = ANGLE**2 * np.sum(TOP * AXIS**2) / (2 * DURATION)
    claim.below(
        "about one axis the turn costs at least a fifth more",
        1.2 * least,
        one_axis,
        within(0, "J.s", because="an inequality"),
    )
    claim.verdicts += motion.verify()

    still: Any = {f"wheel_{k}_dot": 0 for k in (1, 2, 3)}
    sphere: Any = dict.fromkeys(moments, 1.0 + WHEEL)
    effort = plan(
        "Satellite", end={"attitude": goal, **still}, duration=DURATION, minimize="effort", J_wheel=WHEEL, **sphere
    )
    cubic = 12 * ANGLE**2 / DURATION**3
    claim("least ∫ λ² of a sphere with J' = 1: 12 J'² θ²/T³", effort.cost / cubic, 1.0, shooting)

    body = np.array(momenta(*exact)) / TOP[:, None]
    for name, row in zip(RATES, body, strict=True):
        rates.plot(run.time, run[name], label=name.replace("omega_", "ω about "))
        dots(rates, run.time, row)
    w, x, y, z = (run[name] for name in QUATERNION)
    way.plot(1 - 2 * (y**2 + z**2), 2 * (x * y + w * z), 2 * (x * z - w * y), label="planned")
    angle = np.linspace(0, ANGLE, 50)
    w, (x, y, z) = np.cos(angle / 2), np.outer(AXIS, np.sin(angle / 2))
    way.plot(1 - 2 * (y**2 + z**2), 2 * (x * y + w * z), 2 * (x * z - w * y), "--", label="about one axis")
