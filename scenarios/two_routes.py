"""A pendulum by d'Alembert's principle and by Gauss's moves as by its angle; Gauss's μ_1 is -2 λ_1, the tension / l.

K Ex. 1 and Ex. 9 in Cartesian coordinates, K Ex. 3 in θ.  CartesianPendulum upholds its constraints in positions; the
GaussPendulum of this file knows them as conditions on the velocity alone, K eq. 110, whose derivatives are the text's
own g_1 and g_2.  K prints half of this μ_1; the closed form by elliptic functions refutes that.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import casadi as ca
import matplotlib.pyplot as plt
import numpy as np

from liaisons import (
    Coordinate,
    Mechanism,
    Parameter,
    Verdict,
    analysis,
    fmu_path,
    max_error,
    non_holonomic,
    output,
    run_scenario,
    simulate,
    verdict,
)
from liaisons.models import CartesianPendulum

THETA_0, STOP, TOLERANCE = 2.5, 60.0, 1e-11


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


def main(figure: Path) -> list[Verdict]:
    start: Any = {"x_0": np.sin(THETA_0), "z_0": 1 - np.cos(THETA_0)}
    gauss_fmu = fmu_path(f"{__file__}:GaussPendulum")
    routes = {
        "d'Alembert": simulate(
            fmu_path("CartesianPendulum"), stop_time=STOP, step_size=0.02, tolerance=TOLERANCE, **start
        ),
        "Gauss": simulate(gauss_fmu, stop_time=STOP, step_size=0.02, tolerance=TOLERANCE, **start),
    }
    angle = simulate(fmu_path("Pendulum"), stop_time=STOP, step_size=0.02, tolerance=TOLERANCE, theta_0=THETA_0)
    exact = CartesianPendulum.exact(angle.time, theta_0=THETA_0)
    in_theta = {"x": np.sin(angle["theta"]), "z": 1 - np.cos(angle["theta"])}
    why = f"solver tolerance {TOLERANCE:g}; errors grow 300-fold over {STOP:g} s of large swings"
    verdicts = []
    for name, result in routes.items():
        for other, values in (("θ", in_theta), ("elliptic functions", exact)):
            error = max(max_error(result[q], values[q]) for q in ("x", "z"))
            verdicts.append(verdict(f"{name} against {other}", error=error, tolerance=1e-8, unit="m", reason=why))
    by_dalembert, by_gauss = routes["d'Alembert"], routes["Gauss"]
    forces = {
        "λ_1 = -m (g (l - z) + v²)/2l²": by_dalembert["lambda_1"],
        "μ_1 = -2 λ_1, twice what is printed": by_gauss["mu_1"] / -2,
        "both: the tension / 2l of the rod in θ": angle["tension"] / -2,
    }
    for claim, values in forces.items():
        error = max_error(values, exact["lambda_1"])
        verdicts.append(verdict(claim, error=error, tolerance=1e-7, unit="N/m", reason=f"{why}; times 2m/l·|ω| = 12"))
    # Along the circle Gauss's function grows by m δ²/2, to both sides: the motion has the least of all that may be.
    gauss = analysis.gauss_function(CartesianPendulum)
    motion = {f"{q}_ddot": by_dalembert[f"{q}_ddot"] for q in ("x", "z")}
    aside = {"x_ddot": motion["x_ddot"] + 1 - by_dalembert["z"], "z_ddot": motion["z_ddot"] + by_dalembert["x"]}
    growth = gauss.evaluate(**aside) - gauss.evaluate(**motion)
    least = "Gauss's function is least on the motion: m δ²/2 more for another acceleration along the circle"
    why = "roundings of forces of 60 N, squared"
    verdicts.append(verdict(least, error=max_error(growth, 0.5), tolerance=1e-11, unit="N2/kg", reason=why))
    length = np.sqrt(by_gauss["x"] ** 2 + by_gauss["y"] ** 2 + (by_gauss["z"] - 1) ** 2)
    lengths = {
        "d'Alembert keeps the rod's length to rounding": (by_dalembert["rod_residual"] + 1, 1e-14, "projected"),
        "Gauss keeps its derivative, the length follows": (length, 1e-9, "length: integrated, 100 tolerances"),
    }
    for claim, (values, tolerance, reason) in lengths.items():
        error = max_error(values, 1.0)
        verdicts.append(verdict(claim, error=error, tolerance=tolerance, unit="m", reason=reason))

    shown = angle.time <= 8
    t = angle.time[shown]
    _, (motion, force, error) = plt.subplots(1, 3, figsize=(13, 4), layout="constrained")
    for q, colour in (("x", "tab:blue"), ("z", "tab:orange")):
        motion.plot(t, by_dalembert[q][shown], color=colour, label=f"{q}, d'Alembert")
        motion.plot(t[::15], by_gauss[q][shown][::15], "o", color=colour, markersize=4, label=f"{q}, Gauss")
        motion.plot(t[7::15], in_theta[q][shown][7::15], "k.", markersize=4)
    motion.set(xlabel="t [s]", ylabel="[m]", title="three routes to one motion (black: θ)")
    force.plot(t, -2 * by_dalembert["lambda_1"][shown], label="-2 λ_1, d'Alembert")
    force.plot(t[::15], by_gauss["mu_1"][shown][::15], "k.", label="μ_1, Gauss")
    force.axhline(0, color="grey", linewidth=0.5)
    force.set(xlabel="t [s]", ylabel="tension / l [N/m]", title="the multipliers; below 0 the rod pushes")
    for name, result in routes.items():
        distance = np.hypot(result["x"] - exact["x"], result["z"] - exact["z"])
        error.semilogy(angle.time, np.maximum(distance, 1e-17), linewidth=0.7, label=name)
    error.set(xlabel="t [s]", ylabel="distance [m]", title="distance from the closed form")
    for axes in (motion, force, error):
        axes.legend(fontsize=8)
    plt.savefig(figure, dpi=150)
    return verdicts


if __name__ == "__main__":
    raise SystemExit(run_scenario(main))
