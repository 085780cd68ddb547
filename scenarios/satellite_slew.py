"""Wheels turned from rest turn a satellite by -J⁻¹ J_w Δφ, at any pace; in another order they turn it elsewhere.

M 8.3, without angular momentum.  One wheel, for any inertia tensor: the attitude depends on the angle of the wheel
alone, be it run up smoothly, in half the time, or jerked.  Two wheels: the attitude is the product of two rotations,
which do not commute.  The motor's torque is λ = J_w (φ'' + a·ω').
"""

from __future__ import annotations

from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from liaisons import Result, System, Verdict, fmu_path, max_error, run_scenario, verdict
from liaisons.models import Satellite, SmoothStep

INERTIA = {"J_xy": 1.0, "J_xz": -0.5, "J_yz": 0.3}
J, J_WHEEL = np.array([[10.0, 1.0, -0.5], [1.0, 12.0, 0.3], [-0.5, 0.3, 8.0]]), 0.1
TURN, STOP, TOLERANCE = 100.0, 20.0, 1e-11
PACES = {
    "smoothly in 18 s": ("SmoothStep", {"end_value": TURN, "start_time": 1.0, "duration": 18.0}),
    "smoothly in 6 s": ("SmoothStep", {"end_value": TURN, "start_time": 1.0, "duration": 6.0}),
    "with a jerk": ("Ramp", {"rate": TURN / 19, "start_time": 1.0}),
}
ORDERS = {"first 1, then 2": ("wheel_1", "wheel_2"), "first 2, then 1": ("wheel_2", "wheel_1")}
QUATERNION = ("q_w", "q_x", "q_y", "q_z")


def slew(wheels: dict[str, tuple[str, dict[str, float]]]) -> Result:
    """The satellite with an operator at each of these wheels."""
    system = System("slew")
    # A Ramp is followed exactly by extrapolation, jump of the rate included; smooth ones better by interpolation.
    mode = 1 if any(kind == "Ramp" for kind, _ in wheels.values()) else 2
    satellite = system.add("satellite", fmu_path("Satellite"), input_reconstruction=mode, **INERTIA)
    for wheel, (kind, values) in wheels.items():
        motor = system.add(f"motor_{wheel}", fmu_path(kind), **values)
        system.connect(motor["y"], satellite[wheel])
    return system.simulate(stop_time=STOP, step_size=0.02, tolerance=TOLERANCE)


def attitude(result: Result) -> Rotation:
    return Rotation.from_quat(np.array([result[f"satellite.{q}"] for q in QUATERNION]).T, scalar_first=True)


def matrices(q: dict[str, NDArray]) -> NDArray:
    return Rotation.from_quat(np.array([q[name] for name in QUATERNION]).T, scalar_first=True).as_matrix()


def main(figure: Path) -> list[Verdict]:
    why = f"solver tolerance {TOLERANCE:g}, σ interpolated over 0.02 s: 1e-12; nothing is amplified"
    paces = {name: slew({"wheel_1": operator}) for name, operator in PACES.items()}
    verdicts = []
    for name, result in paces.items():
        expected = matrices(Satellite.slew(result["satellite.wheel_1"], **INERTIA))
        error = max_error(attitude(result).as_matrix(), expected)
        verdicts.append(verdict(f"one wheel {name}: attitude", error=error, tolerance=1e-9, reason=why))
    for name in ("smoothly in 18 s", "smoothly in 6 s"):
        push = SmoothStep.exact(paces[name].time, **PACES[name][1])["y_ddot"]
        torque = J_WHEEL * push * (1 - J_WHEEL * np.linalg.inv(J)[0, 0])
        error = max_error(paces[name]["satellite.wheel_1_force"], torque)
        claim = f"one wheel {name}: torque J_w (φ'' + a·ω')"
        verdicts.append(verdict(claim, error=error, tolerance=1e-8, unit="N.m", reason=f"{why}; times φ'' = 20 /s2"))

    step = {"end_value": TURN, "duration": 8.0}
    turn = {
        w: Rotation.from_rotvec(-J_WHEEL * TURN * np.linalg.inv(J)[:, i]) for i, w in enumerate(("wheel_1", "wheel_2"))
    }
    orders, ends = {}, {}
    for name, sequence in ORDERS.items():
        begins = zip(sequence, (1.0, 10.0), strict=True)
        orders[name] = slew({wheel: ("SmoothStep", step | {"start_time": begin}) for wheel, begin in begins})
        ends[name] = attitude(orders[name])[-1]
        expected = turn[sequence[0]] * turn[sequence[1]]
        error = max_error(ends[name].as_matrix(), expected.as_matrix())
        verdicts.append(verdict(f"two wheels, {name}: product of rotations", error=error, tolerance=1e-9, reason=why))
    first, second = ends.values()
    apart = (first.inv() * second).magnitude()
    product = turn["wheel_1"] * turn["wheel_2"], turn["wheel_2"] * turn["wheel_1"]
    verdicts.append(
        verdict(
            f"the two orders end {np.degrees(apart):.1f}° apart, wheels alike",
            error=abs(apart - (product[0].inv() * product[1]).magnitude()),
            tolerance=1e-9,
            unit="rad",
            reason=why,
        )
    )
    worst = max(max_error(r["satellite.energy_balance"], 0.0) for r in (*paces.values(), *orders.values()))
    verdicts.append(
        verdict(
            "energy is the motors' work", error=worst, tolerance=1e-7, unit="J", reason="10 x tolerance x 40 J x 20 s"
        )
    )
    draw(figure, paces, orders)
    return verdicts


def draw(figure: Path, paces: dict[str, Result], orders: dict[str, Result]) -> None:
    plt.figure(figsize=(13, 4.2), layout="constrained")
    time, wheel, pointing = plt.subplot(1, 3, 1), plt.subplot(1, 3, 2), plt.subplot(1, 3, 3, projection="3d")
    for i, (name, result) in enumerate(paces.items()):
        angle = np.degrees(attitude(result).magnitude())
        time.plot(result.time, angle, label=name)
        every = slice(20 * i, None, 60)
        wheel.plot(result["satellite.wheel_1"][every], angle[every], ".", label=name)
    time.set(xlabel="t [s]", ylabel="angle of the satellite [deg]", title="three paces ...")
    wheel.set(xlabel="angle of the wheel [rad]", ylabel="angle of the satellite [deg]", title="... one path")
    for axes in (time, wheel):
        axes.legend(fontsize=8)
    for name, result in orders.items():
        path = attitude(result).apply([1, 1, 1]) / np.sqrt(3)
        pointing.plot(*path.T, label=name)
        pointing.plot(*path[-1:].T, "k.")
    pointing.set(xlabel="x", ylabel="y", zlabel="z", title="where (1, 1, 1) of the body points")
    pointing.legend(fontsize=8)
    plt.savefig(figure, dpi=150)


if __name__ == "__main__":
    raise SystemExit(run_scenario(main))
