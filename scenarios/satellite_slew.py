"""Wheels that start from rest turn a satellite by -J⁻¹ J_w Δφ, at any speed; the result depends on their order.

M 8.3, without angular momentum.  With one wheel and any inertia tensor, the attitude depends only on the angle of the
wheel, whether it turns smoothly, in half the time, or with jerks.  With two wheels the attitude is the product of two
rotations, which do not commute.  The motor's torque is λ = J_w (φ'' + a·ω').
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from liaisons import Result, operator, simulate
from liaisons.models import Satellite, SmoothStep
from liaisons.scenarios import Claims, panels, scenario, within

INERTIA: Any = {"J_xy": 1.0, "J_xz": -0.5, "J_yz": 0.3}
TURN, TOLERANCE = 100.0, 1e-11
PACES: Any = {"smoothly in 18 s": {"duration": 18.0}, "smoothly in 6 s": {"duration": 6.0}, "with a jerk": {}}
ORDERS = {"first 1, then 2": (1.0, 10.0), "first 2, then 1": (10.0, 1.0)}  # when wheels 1 and 2 begin [s]


def slew(**wheels: Any) -> Result:
    """The satellite with an operator at each of these wheels."""
    return simulate("Satellite", stop_time=20.0, step_size=0.02, tolerance=TOLERANCE, **INERTIA, **wheels)


def attitude(q: Mapping[str, NDArray] | Result) -> Rotation:
    return Rotation.from_quat(np.transpose([q[name] for name in ("q_w", "q_x", "q_y", "q_z")]), scalar_first=True)


@scenario
def main(claim: Claims) -> None:
    time, wheel, pointing = panels(
        ("three paces ...", "t [s]", "angle of the satellite [deg]"),
        ("... one path", "angle of the wheel [rad]", "angle of the satellite [deg]"),
        ("where (1, 1, 1) of the body points", "x", "y", "z"),
    )
    why = f"errors at solver tolerance {TOLERANCE:g}, and 1e-12 by interpolating σ over 0.02 s; not amplified"
    solver, torque = within(1e-9, because=why), within(1e-8, "N.m", because=f"{why}; times accelerations φ'' of 20 /s2")
    runs = []
    for i, (name, pace) in enumerate(PACES.items()):
        step: Any = {"end_value": TURN, "start_time": 1.0, **pace}
        jerk = operator("Ramp", rate=TURN / 19, start_time=1.0)
        run = slew(wheel_1=operator("SmoothStep", **step) if pace else jerk)
        expected = attitude(Satellite.slew(run["wheel_1"], **INERTIA))
        claim(f"one wheel {name}: attitude", attitude(run).as_matrix(), expected.as_matrix(), solver)
        if pace:
            push = SmoothStep.exact(run.time, **step)["y_ddot"]
            needed = Satellite.slew_torque(push, **INERTIA)["wheel_1_force"]
            claim(f"one wheel {name}: torque J_w (φ'' + a·ω')", run["wheel_1_force"], needed, torque)
        angle = np.degrees(attitude(run).magnitude())
        time.plot(run.time, angle, label=name)
        wheel.plot(run["wheel_1"][20 * i :: 60], angle[20 * i :: 60], ".", label=name)
        runs.append(run)

    look: Any = {"end_value": TURN, "duration": 8.0}
    turns = [attitude(Satellite.slew(*angles, **INERTIA)) for angles in ((TURN, 0.0), (0.0, TURN))]
    products = [turns[0] * turns[1], turns[1] * turns[0]]
    ends = []
    for (name, begins), expected in zip(ORDERS.items(), products, strict=True):
        wheels = (operator("SmoothStep", start_time=begin, **look) for begin in begins)
        run = slew(**dict(zip(("wheel_1", "wheel_2"), wheels, strict=True)))
        ends.append(attitude(run)[-1])
        claim(f"two wheels, {name}: product of rotations", ends[-1].as_matrix(), expected.as_matrix(), solver)
        path = attitude(run).apply([1, 1, 1]) / np.sqrt(3)
        pointing.plot(*path.T, label=name)
        pointing.plot(*path[-1:].T, "k.")
        runs.append(run)
    apart, known = ((one.inv() * other).magnitude() for one, other in (ends, products))
    text = f"the two orders end {np.degrees(apart):.1f}° apart, at equal wheel angles"
    claim(text, apart, known, within(1e-9, "rad", because=why))
    claim.energy("energy is the motors' work", *runs, tolerance=TOLERANCE)
