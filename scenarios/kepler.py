"""Planets obey Kepler's equation E - e sin E = n t and T² = 4π² a³/μ for every shape, and 2T̄ + V̄ = [p·r]/τ.

K 2.5 (eq. 60 with the potential -μ m/r; with the printed sign it repels) and K 2.7.  Eq. 60 compares orbits of one
shape; the third law holds for all shapes, and is tested for nine orbits.  The virial theorem (eq. 74, 2T̄ = -V̄) is a
limit that is approached only as 1/τ; the identity holds for any τ, with p·r, which is printed as p·r'.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.integrate import cumulative_simpson
from scipy.interpolate import CubicHermiteSpline

from liaisons import Result, crossings, simulate
from liaisons.models import KeplerOrbit
from liaisons.scenarios import Claims, dots, panels, scenario, within

ECCENTRICITIES, SEMI_AXES = (0.0, 0.4, 0.8), (0.5, 1.0, 4.0)
STEP = 2 * np.pi / 400  # of the eccentric anomaly: equal steps of it are short where the planet is fast


def orbit(a: float, e: float, revolutions: float) -> Result:
    """Start at the pericentre on the x axis, with μ = 1."""
    E = STEP * np.arange(round(revolutions * 400) + 1)
    shape = {"semi_axis": a, "eccentricity": e}
    start: Any = KeplerOrbit.pericentre(**shape)
    return simulate("KeplerOrbit", times=KeplerOrbit.time(E, **shape), tolerance=1e-11, **start)


def virial(run: Result, a: float, e: float) -> tuple[np.ndarray, np.ndarray]:
    """∫ (2T + V) dt from 0 to τ and [p·r] there, at all τ > 0."""
    rate = a**1.5 * (1 - e * np.cos(STEP * np.arange(run.time.size)))  # dt/dE
    integral = cumulative_simpson((2 * run["kinetic_energy"] + run["potential_energy"]) * rate, dx=STEP)
    p_r = run["p_x"] * run["x"] + run["p_y"] * run["y"]
    return integral, p_r[1:] - p_r[0]


@scenario
def main(claim: Claims) -> None:
    plane, law, mean = panels(
        ("a = 1 m: dots at equal times", "x [m]", "y [m]"),
        ("third law", "a [m]", "T [s]"),
        ("virial, e = 0.6: as 1/τ (dashed)", "revolutions", "2T̄ + V̄ [J]"),
    )
    fine, instants = np.geomspace(0.25, 10, 50), np.linspace(0, 2 * np.pi, 24, endpoint=False)
    law.loglog(fine, 2 * np.pi * fine**1.5, color="0.6", label="2π √(a³/μ)")
    anomaly, thirds, vector, identity = [], [], [], []
    for e, marker in zip(ECCENTRICITIES, "+ox", strict=True):
        periods = []
        for a in SEMI_AXES:
            run = orbit(a, e, 3.25)
            # x = a (cos E - e), y = a √(1 - e²) sin E
            E = np.unwrap(np.arctan2(run["y"] / np.sqrt(1 - e**2), run["x"] + a * e))
            anomaly.append(E - e * np.sin(E) - run.time / a**1.5)
            periods.append(np.diff(crossings(run.time, run["y"], run["y_dot"], rising=True)).mean())
            vector.append([run["eccentricity_x"] - e, run["eccentricity_y"]])
            identity.append(np.subtract(*virial(run, a, e)))
            if a == 1.0:
                (line,) = plane.plot(run["x"][:401], run["y"][:401], linewidth=0.8, label=f"e = {e:g}")
                places = (CubicHermiteSpline(run.time, run[q], run[f"{q}_dot"])(instants) for q in "xy")
                dots(plane, *places, every=1, color=line.get_color())
        thirds.append(np.square(periods) / (4 * np.pi**2 * np.power(SEMI_AXES, 3)))
        law.loglog(SEMI_AXES, periods, marker, markersize=9, markerfacecolor="none", label=f"e = {e:g}")
    plane.plot(0, 0, "k+")
    plane.set(aspect="equal")
    why = "10 times tolerance 1e-11, amplified 100-fold: a phase of 20, three times as fast at the pericentre"
    simpson = "errors of Simpson's rule over E, (2π/400)⁴/180 times derivatives of about 1, and of the solver"
    spline = "relative; the spline's error at the passages, (2π/400)⁴/384, is smaller, since y'''' vanishes with y"
    claim("Kepler's equation, 9 orbits", anomaly, 0.0, within(1e-8, "rad", because=why))
    claim("T² = 4π² a³/μ for a = 0.5, 1, 4 m and e = 0, 0.4, 0.8", thirds, 1.0, within(1e-8, because=spline))
    claim("the eccentricity vector (Laplace, Runge, Lenz) is constant", vector, 0.0, within(1e-8, because=why))
    claim("∫ (2T + V) dt = [p·r] at every τ, 9 orbits", identity, 0.0, within(1e-8, "J.s", because=simpson))
    limit = orbit(1.0, 0.6, 50.5)
    integral, _ = virial(limit, 1.0, 0.6)
    near = "V̄ = -2T̄ in the limit: |2T̄ + V̄| τ stays below max |p·r| = m e √(μ a)"
    claim.below(near, np.abs(integral), 0.6, within(1e-8, "J.s", because=simpson))
    turns, tau = limit.time[1:] / (2 * np.pi), limit.time[1:]
    mean.plot(turns, integral / tau, linewidth=0.8)
    mean.plot(turns, 0.6 / tau, "k--", turns, -0.6 / tau, "k--", linewidth=0.8)
    mean.set(ylim=(-0.1, 0.1))
