"""The principles of d'Alembert and Gauss give the same motion as the angle; Gauss's μ_1 = -2 λ_1 is the tension / l.

K Ex. 1 and Ex. 9 in Cartesian coordinates, K Ex. 3 in θ.  CartesianPendulum enforces its constraints on positions; the
GaussPendulum of this file has them only as constraints on velocities, K eq. 110, whose derivatives are g_1 and g_2 of
the text.  K prints half of this μ_1; the closed form by elliptic functions shows that this is wrong.
"""

from __future__ import annotations

from typing import Any

import casadi as ca
import numpy as np

from liaisons import Coordinate, Mechanism, Parameter, non_holonomic, output, simulate
from liaisons.models import CartesianPendulum
from liaisons.scenarios import Claims, panels, scenario, within

THETA_0 = 2.5
SETTINGS: Any = {"stop_time": 60.0, "step_size": 0.02, "tolerance": 1e-11}


class GaussPendulum(Mechanism):
    """Pendulum whose velocity is kept across the rod and in the plane, by Gauss's principle (K Ex. 9)."""

    mass = Parameter(1.0, "kg", "mass of the bob", above=0)
    gravity = Parameter(9.81, "m/s2", "gravitational acceleration")
    length = Parameter(1.0, "m", "length of the rod", above=0)
    x = Coordinate("m", "horizontal position in the plane of the motion", start=float(np.sin(0.1)))
    y = Coordinate("m", "distance from the plane of the motion")
    z = Coordinate("m", "height", start=float(1 - np.cos(0.1)))

    @non_holonomic("m2/s", "velocity along the rod times its length")
    def along(self) -> ca.SX:
        return self.x * self.dot(self.x) + self.y * self.dot(self.y) + (self.z - self.length) * self.dot(self.z)

    @non_holonomic("m/s", "velocity out of the plane")
    def across(self) -> ca.SX:
        return self.dot(self.y)

    def kinetic_energy(self) -> ca.SX:
        return self.mass / 2 * self.speed_squared({"x": self.x, "y": self.y, "z": self.z})

    def potential_energy(self) -> ca.SX:
        return self.mass * self.gravity * self.z

    @output("N/m", "Gauss's multiplier of g_1")
    def mu_1(self) -> ca.SX:
        return -self.constraint_force("along")


@scenario
def main(claim: Claims) -> None:
    motion, force, error = panels(
        ("three routes to one motion", "t [s]", "x [m]"),
        ("the multipliers; below 0 the rod pushes", "t [s]", "tension / l [N/m]"),
        ("distance from the closed form", "t [s]", "distance [m]"),
    )
    angle = simulate("Pendulum", theta_0=THETA_0, **SETTINGS)
    exact = CartesianPendulum.exact(angle.time, theta_0=THETA_0)
    in_theta = {"x": np.sin(angle["theta"]), "z": 1 - np.cos(angle["theta"])}
    components = {"d'Alembert": CartesianPendulum, "Gauss": GaussPendulum}
    start: Any = {"x_0": np.sin(THETA_0), "z_0": 1 - np.cos(THETA_0)}
    routes = {name: simulate(component, **start, **SETTINGS) for name, component in components.items()}
    why = "errors at solver tolerance 1e-11, amplified 300-fold over 60 s of large swings"
    for name, run in routes.items():
        claim(f"{name} against θ", run, in_theta, within(1e-8, "m", because=why))
        claim(f"{name} against elliptic functions", run, exact, within(1e-8, "m", because=why), names=("x", "z"))
        distance = np.hypot(run["x"] - exact["x"], run["z"] - exact["z"])
        error.semilogy(run.time, np.maximum(distance, 1e-17), linewidth=0.7, label=name)

    dalembert, gauss, expected = routes["d'Alembert"], routes["Gauss"], exact["lambda_1"]
    multiplier = within(1e-7, "N/m", because=f"{why}; times 2m/l·|ω| = 12")
    claim("λ_1 = -m (g (l - z) + v²)/2l²", dalembert["lambda_1"], expected, multiplier)
    claim("μ_1 = -2 λ_1, twice what is printed", gauss["mu_1"] / -2, expected, multiplier)
    claim("both are the tension / 2l of the rod, computed in θ", angle["tension"] / -2, expected, multiplier)

    projected = within(1e-14, "m", because="the FMU projects onto the constraints")
    claim("d'Alembert keeps the length of the rod to rounding", dalembert["rod_residual"], 0.0, projected)
    length = np.linalg.norm([gauss["x"], gauss["y"], gauss["z"] - 1], axis=0)
    integrated = within(1e-9, "m", because="constraints are integrated: 100 times the tolerance")
    claim("Gauss keeps the length by its derivatives, up to integration errors", length, 1.0, integrated)

    t = angle.time[:401]
    motion.plot(t, dalembert["x"][:401], label="d'Alembert")
    motion.plot(t[::15], gauss["x"][:401:15], "o", markersize=4, label="Gauss")
    motion.plot(t[7::15], in_theta["x"][7:401:15], "k.", label="θ")
    force.plot(t, -2 * dalembert["lambda_1"][:401], label="-2 λ$_1$, d'Alembert")
    force.plot(t[::15], gauss["mu_1"][:401:15], "k.", label="μ$_1$, Gauss")
