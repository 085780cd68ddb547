"""One wheel keeps the camera of an orbiting satellite on the planet; the two others point it aside.

Without angular momentum the wheels alone turn the satellite: J ω + J_w Σ a_k φ_k' = 0 at every instant (M 8.3), so ω =
-J⁻¹ J_w φ' whatever the operators do.  On a circular orbit of radius R, Kepler's third law gives the rate n = √(μ/R³).
A wheel whose axis is normal to the orbit, run at -n J_zz/J_w, turns the satellite with the direction of the planet.  A
SmoothStep moves each of the other wheels to a new angle; the satellite then goes on turning with its camera off the
planet.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from liaisons import operator, simulate
from liaisons.models import KeplerOrbit, Satellite, SmoothStep
from liaisons.scenarios import Claims, panels, scenario, within

J, J_WHEEL = np.array([10.0, 12.0, 8.0]), 0.1
BODY: Any = {"J_wheel": J_WHEEL, "J_xx": J[0], "J_yy": J[1], "J_zz": J[2]}
ORBIT: Any = KeplerOrbit.pericentre(semi_axis=2.0, eccentricity=0.0)
PERIOD = KeplerOrbit.period(**ORBIT)
RATE = 2 * np.pi / PERIOD
WHEEL_RATE = -RATE * J[2] / J_WHEEL
LOOKS = {"wheel_1": (30.0, 2.0), "wheel_2": (-40.0, 6.0)}  # angle of the wheel [rad], begin [s]; within 3 s
SETTINGS: Any = {"stop_time": PERIOD, "step_size": PERIOD / 800, "tolerance": 1e-11}


def attitude(q: Any) -> NDArray:
    return Rotation.from_quat(np.transpose([q[f"q_{c}"] for c in "wxyz"]), scalar_first=True).as_matrix()


def wheel_rates(t: float) -> list[float]:
    looks = (SmoothStep.exact(t, end_value=a, start_time=b, duration=3.0)["y_dot"] for a, b in LOOKS.values())
    return [*map(float, looks), WHEEL_RATE]


@scenario
def main(claim: Claims) -> None:
    turning: Any = {"omega_z_0": RATE, "wheel_3_dot": WHEEL_RATE, "wheel_3": operator("Ramp", rate=WHEEL_RATE), **BODY}
    looks = {
        wheel: operator("SmoothStep", end_value=angle, start_time=begin, duration=3.0)
        for wheel, (angle, begin) in LOOKS.items()
    }
    orbit = simulate("KeplerOrbit", **ORBIT, **SETTINGS)
    nadir, looking = (simulate("Satellite", **turning, **wheels, **SETTINGS) for wheels in ({}, looks))
    position = np.transpose([orbit["x"], orbit["y"], 0 * orbit.time]) / 2.0
    why = "errors at solver tolerance 1e-11 over one orbit, and of σ interpolated over 1/800 of it"
    seen = np.einsum("tji,tj->ti", attitude(nadir), position)  # direction of the planet in the axes of the satellite
    claim("the planet stays on the axis of the camera", seen, [1, 0, 0], within(1e-8, because=why))
    steered = Satellite.steered(looking.time, wheels=wheel_rates, **BODY)
    less = within(1e-7, because=f"{why}; larger where the satellite begins to look aside")
    claim("attitude with three wheels", attitude(looking), attitude(steered), less)
    spin = J * np.transpose([looking[f"omega_{c}"] for c in "xyz"])
    wheels = J_WHEEL * np.transpose([looking[f"wheel_{k}_dot"] for k in (1, 2, 3)])
    claim("J ω + J_w φ' stays 0", spin, -wheels, within(1e-10, "kg.m2/s", because="rounding errors of ω from p"))
    closed = np.hypot(orbit["x"][-1] - 2.0, orbit["y"][-1])
    claim("the orbit closes after Kepler's period", closed, 0.0, within(1e-8, "m", because=why))

    title = "two wheels look aside and stay there; the third turns with the orbit"
    (axis,) = panels((title, "t [s]", "planet off the camera's axis [deg]"), size=(7, 4))
    aside = np.einsum("tji,tj->ti", attitude(looking), position)[:, 0]
    axis.plot(looking.time, np.degrees(np.arccos(np.clip(aside, -1, 1))))
