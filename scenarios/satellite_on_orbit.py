"""A satellite on its orbit keeps an eye on the planet by one wheel, and looks aside and back by the two others.

Without angular momentum the wheels alone turn the satellite: J ω + J_w Σ a_k φ_k' = 0 in every instant (M 8.3), so
ω = -J⁻¹ J_w φ' whatever the operators do.  On a circular orbit of radius R, Kepler's third law gives the rate
n = √(μ/R³); a wheel across the orbit run at -n J_zz/J_w turns the satellite with the planet's direction.
"""

from __future__ import annotations

from functools import cache
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

from liaisons import Result, System, Verdict, fmu_path, run_scenario, verdict
from liaisons.models import SmoothStep

J, J_WHEEL, RADIUS, MU = np.array([10.0, 12.0, 8.0]), 0.1, 2.0, 1.0
RATE = np.sqrt(MU / RADIUS**3)
PERIOD = 2 * np.pi / RATE
WHEEL_RATE = -RATE * J[2] / J_WHEEL
LOOKS = {"wheel_1": (30.0, 2.0), "wheel_2": (-40.0, 6.0)}  # angle of the wheel [rad], begin [s]; 3 s there, 3 s back
TOLERANCE = 1e-11

fmu = cache(fmu_path)  # asking for the path checks that the FMU is up to date


def mission(*, look: bool) -> Result:
    system = System("satellite on orbit")
    inertia = dict(zip(("J_xx", "J_yy", "J_zz"), J, strict=True))
    start = {"omega_z_0": RATE, "wheel_3_dot": WHEEL_RATE}
    satellite = system.add("satellite", fmu("Satellite"), J_wheel=J_WHEEL, **inertia, **start)
    system.add("orbit", fmu("KeplerOrbit"), mu=MU, x_0=RADIUS, y_0=0.0, x_dot_0=0.0, y_dot_0=RADIUS * RATE)
    system.connect(system.add("motor_3", fmu("Ramp"), rate=WHEEL_RATE)["y"], satellite["wheel_3"])
    for wheel, (angle, begin) in LOOKS.items() if look else ():
        turn = system.add(f"motor_{wheel[-1]}", fmu("SmoothStep"), end_value=angle, start_time=begin, duration=3.0)
        system.connect(turn["y"], satellite[wheel])
    return system.simulate(PERIOD, PERIOD / 800, tolerance=TOLERANCE, coupling="implicit")


def attitude(result: Result) -> NDArray:
    q = np.array([result[f"satellite.q_{c}"] for c in "wxyz"]).T
    return Rotation.from_quat(q, scalar_first=True).as_matrix()


def integrated(times: NDArray) -> NDArray:
    """Attitude matrices from R' = R ω×, ω = -J⁻¹ J_w φ' with the operators' closed forms."""

    def rates(t: float, y: NDArray) -> NDArray:
        wheels = [SmoothStep.exact(t, end_value=a, start_time=b, duration=3.0)["y_dot"] for a, b in LOOKS.values()]
        omega = -J_WHEEL * np.array([*wheels, WHEEL_RATE], dtype=float) / J
        return np.cross(y.reshape(3, 3), omega).reshape(-1)

    start, span = np.eye(3).reshape(-1), (0, times[-1])
    solution = solve_ivp(rates, span, start, "DOP853", times, rtol=1e-12, atol=1e-13, max_step=0.05)
    return solution.y.T.reshape(-1, 3, 3)


def main(figure: Path) -> list[Verdict]:
    nadir, looking = mission(look=False), mission(look=True)
    position = np.array([nadir["orbit.x"], nadir["orbit.y"], 0 * nadir.time]).T / RADIUS
    seen = np.einsum("tji,tj->ti", attitude(nadir), position)  # direction of the planet in the axes of the satellite
    spin = np.array([looking[f"satellite.omega_{c}"] for c in "xyz"]).T
    wheels = np.array([looking[f"satellite.wheel_{k}_dot"] for k in (1, 2, 3)]).T
    difference = np.abs(attitude(looking) - integrated(looking.time))
    closed = np.hypot(nadir["orbit.x"][-1] - RADIUS, nadir["orbit.y"][-1])
    why = f"solver tolerance {TOLERANCE:g} over one orbit, σ interpolated over a 800th of it"
    aside = np.degrees(np.arccos(np.clip(np.einsum("tji,tj->ti", attitude(looking), position)[:, 0], -1, 1)))
    plt.figure(figsize=(7, 4), layout="constrained")
    plt.plot(looking.time, aside)
    plt.title("two wheels look aside twice and come back; the third turns with the orbit")
    plt.xlabel("t [s]")
    plt.ylabel("planet off the camera's axis [deg]")
    plt.savefig(figure, dpi=150)
    rows = (
        ("the planet stays on the camera's axis", np.max(np.abs(seen - [1, 0, 0])), 1e-8, "", why),
        ("attitude with three wheels", np.max(difference), 1e-7, "", f"{why}, where a look begins less well"),
        ("J ω + J_w φ' stays 0", np.max(np.abs(spin * J + J_WHEEL * wheels)), 1e-10, "kg.m2/s", "rounding, ω from p"),
        ("the orbit closes after Kepler's period", closed, 1e-8, "m", why),
    )
    return [verdict(c, error=e, tolerance=bound, unit=u, reason=reason) for c, e, bound, u, reason in rows]


if __name__ == "__main__":
    raise SystemExit(run_scenario(main))
