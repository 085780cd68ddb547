"""An oscillator in the plane moves on the same ellipse in the coordinates x, y and in r, φ; p_φ is constant.

K Ex. 5, eq. 34-43.  φ is cyclic, and r obeys r'' - p_φ²/(m² r³) + Ω² r = 0.  The centrifugal term is missing in the
printed eq. 43, with which r would oscillate through zero.  The two FMUs have no equation of motion in common.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from liaisons import Result, simulate
from liaisons.models import PlanarOscillator
from liaisons.scenarios import Claims, dots, panels, scenario, within

BODY: Any = {"mass": 0.8, "stiffness": 2.0}
OMEGA, MOMENT = np.sqrt(2.0 / 0.8), 0.8 * 0.8  # Ω, p_φ
# r_0 = 1 m and φ'_0 = 0.8 rad/s, across the radius: an ellipse with the semi-axes 1 m and φ'_0/Ω
CARTESIAN, POLAR = BODY | {"x_0": 1.0, "y_dot_0": 0.8}, BODY | {"r_0": 1.0, "phi_dot_0": 0.8}
TOLERANCE = 1e-12


def run(name: str, step_size: float, start: Any) -> Result:
    return simulate(name, stop_time=19 * np.pi / OMEGA, step_size=step_size, tolerance=TOLERANCE, **start)


@scenario
def main(claim: Claims) -> None:
    planar, polar = run("PlanarOscillator", 0.02, CARTESIAN), run("PolarOscillator", 0.02, POLAR)
    r, phi = polar["r"], polar["phi"]
    x, y = r * np.cos(phi), r * np.sin(phi)
    why = f"10 times tolerance {TOLERANCE:g}, amplified 100-fold: a phase Ωt of 60 and (r_max/r_min)² = 4"
    place = within(1e-9, "m", because=why)
    exact = PlanarOscillator.exact(planar.time, **CARTESIAN)
    claim("x, y: the closed form", planar, exact, place, names=("x", "y"))
    claim("x, y and r, φ: the same trajectory", planar, {"x": x, "y": y}, place)
    ellipse = x**2 + (y * OMEGA / 0.8) ** 2
    claim("the orbit is the ellipse x² + (Ω y/φ'_0)² = r_0²", ellipse, 1.0, within(1e-9, "m2", because=why))
    momenta = [polar["p_phi"], planar["angular_momentum"]]
    text = "p_φ of the one is the angular momentum of the other, and constant"
    claim(text, momenta, MOMENT, within(1e-9, "kg.m2/s", because=why))
    half_periods = np.diff(run("PolarOscillator", np.pi / OMEGA, POLAR)["phi"])
    claim("φ grows by π in each half period", half_periods, np.pi, within(1e-9, "rad", because=why))
    identity = within(1e-13, "m/s2", because="an identity at each instant: rounding errors of accelerations of 8 m/s2")
    missing = polar["r_ddot"] + OMEGA**2 * r
    claim("r'' - p_φ²/(m² r³) + Ω² r = 0", missing, (polar["p_phi"] / 0.8) ** 2 / r**3, identity)
    assert np.max(np.abs(missing)) > 1, "K eq. 43 as printed is far from satisfied"

    plane, radius, angle = panels(
        ("one ellipse from two FMUs", "x [m]", "y [m]"),
        ("distance from the centre", "t [s]", "r [m]"),
        ("angle, at constant p$_φ$", "t [s]", "φ [rad]"),
    )
    t = polar.time[polar.time <= 3 * np.pi / OMEGA]
    plane.plot(planar["x"][: t.size], planar["y"][: t.size], label="x, y")
    dots(plane, x[phi < 2 * np.pi], y[phi < 2 * np.pi], label="r, φ")
    plane.plot(0, 0, "k+")
    plane.set(aspect="equal")
    radius.plot(t, r[: t.size], label="FMU")
    radius.plot(t, np.cos(OMEGA * t), "--", color="tab:red", label="K eq. 43 as printed")
    radius.axhline(0, color="0.7", linewidth=0.8)
    angle.plot(t, phi[: t.size], label="FMU")
    angle.plot(np.arange(4) * np.pi / OMEGA, np.arange(4) * np.pi, "ko", label="π a half period")
