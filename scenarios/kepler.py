"""Planets obey Kepler's equation E - e sin E = n t and T² = 4π² a³/μ for every shape, and 2T̄ + V̄ = [p·r]/τ.

K 2.5 (eq. 60, the potential being -μ m/r; the printed sign repels) and K 2.7.  Eq. 60 compares orbits of one shape;
the third law holds for all, here for nine of them.  The virial theorem (eq. 74, 2T̄ = -V̄) is a limit that is
approached like 1/τ only; before it the identity holds at any instant, with the p·r that is printed as p·r'.
"""

from __future__ import annotations

from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from numpy.typing import NDArray
from scipy.integrate import cumulative_simpson
from scipy.interpolate import CubicHermiteSpline

from liaisons import Result, Verdict, fmu_path, max_error, run_scenario, simulate, verdict

ECCENTRICITIES = (0.0, 0.4, 0.8)
SEMI_AXES = (0.5, 1.0, 4.0)
STEP = 2 * np.pi / 400  # of the eccentric anomaly: equal steps of it are short where the planet is fast


def orbit(a: float, e: float, revolutions: float) -> Result:
    """Start at the pericentre on the x axis, with μ = 1; speed by the vis-viva equation."""
    E = STEP * np.arange(round(revolutions * 400) + 1)
    return simulate(
        fmu_path("KeplerOrbit"),
        times=a**1.5 * (E - e * np.sin(E)),
        tolerance=1e-11,
        x_0=a * (1 - e),
        y_dot_0=np.sqrt((1 + e) / (1 - e) / a),
    )


def eccentric_anomaly(result: Result, a: float, e: float) -> NDArray:
    """E from the position, x = a (cos E - e), y = a √(1 - e²) sin E."""
    return np.unwrap(np.arctan2(result["y"] / np.sqrt(1 - e**2), result["x"] + a * e))


def measured_period(result: Result) -> float:
    """Mean distance of the upward passages of y = 0, the pericentre; located by a cubic spline through y and y_dot."""
    path = CubicHermiteSpline(result.time, result["y"], result["y_dot"])
    passages = [t for t in path.roots(extrapolate=False) if path.derivative()(t) > 0]
    return float(np.mean(np.diff(passages)))


def virial(result: Result, a: float, e: float) -> tuple[NDArray, NDArray]:
    """∫ (2T + V) dt from 0 to τ and [p·r] there, at all τ > 0."""
    rate = a**1.5 * (1 - e * np.cos(STEP * np.arange(result.time.size)))  # dt/dE
    integral = cumulative_simpson((2 * result["kinetic_energy"] + result["potential_energy"]) * rate, dx=STEP)
    p_r = result["p_x"] * result["x"] + result["p_y"] * result["y"]
    return integral, p_r[1:] - p_r[0]


def main(figure: Path) -> list[Verdict]:
    orbits = {(a, e): orbit(a, e, 3.25) for a in SEMI_AXES for e in ECCENTRICITIES}
    kepler, law, integrals, identity = [], [], [], []
    for (a, e), result in orbits.items():
        E = eccentric_anomaly(result, a, e)
        kepler.append(max_error(E - e * np.sin(E), result.time / a**1.5))
        law.append(abs(measured_period(result) ** 2 / (4 * np.pi**2 * a**3) - 1))
        integrals += [max_error(result["eccentricity_x"], e), max_error(result["eccentricity_y"], 0.0)]
        identity.append(max_error(*virial(result, a, e)))
    limit = orbit(1.0, 0.6, 50.5)
    integral, _ = virial(limit, 1.0, 0.6)
    reason = "10 x tolerance 1e-11 x κ of 100: a phase of 20, three times as fast at the pericentre"
    verdicts = [
        verdict("Kepler's equation, 9 orbits", error=max(kepler), tolerance=1e-8, unit="rad", reason=reason),
        verdict(
            "T² = 4π² a³/μ for a = 0.5, 1, 4 m and e = 0, 0.4, 0.8",
            error=max(law),
            tolerance=1e-8,
            reason="relative; spline error of the passages, (2π/400)⁴/384, is smaller: y'''' vanishes with y",
        ),
        verdict(
            "the eccentricity vector (Laplace, Runge, Lenz) stays", error=max(integrals), tolerance=1e-8, reason=reason
        ),
        verdict(
            "∫ (2T + V) dt = [p·r] at every τ, 9 orbits",
            error=max(identity),
            tolerance=1e-8,
            unit="J.s",
            reason="Simpson's rule over E, (2π/400)⁴/180 times derivatives of order 1, and the solver's as above",
        ),
        verdict(
            "V̄ = -2T̄ in the limit: |2T̄ + V̄| τ stays below max |p·r| = m e √(μ a)",
            error=max(0.0, float(np.max(np.abs(integral))) - 0.6),
            tolerance=1e-8,
            unit="J.s",
            reason="as above",
        ),
    ]
    draw(figure, orbits, limit.time[1:], integral)
    return verdicts


def draw(figure: Path, orbits: dict[tuple[float, float], Result], tau: NDArray, integral: NDArray) -> None:
    _, (plane, law, mean) = plt.subplots(1, 3, figsize=(13, 4), layout="constrained")
    days = np.linspace(0, 2 * np.pi, 24, endpoint=False)
    for e in ECCENTRICITIES:
        result = orbits[1.0, e]
        (line,) = plane.plot(result["x"][:401], result["y"][:401], linewidth=0.8, label=f"e = {e:g}")
        at_equal_times = [CubicHermiteSpline(result.time, result[q], result[f"{q}_dot"])(days) for q in "xy"]
        plane.plot(*at_equal_times, ".", color=line.get_color())
    plane.plot(0, 0, "k+")
    plane.set(aspect="equal", xlabel="x [m]", ylabel="y [m]", title="a = 1 m: dots at equal times")
    plane.set_ylim(top=1.9)  # room for the legend
    plane.legend(loc="upper center", ncols=3, handlelength=1)
    axes = np.geomspace(0.25, 10, 50)
    law.loglog(axes, 2 * np.pi * axes**1.5, color="0.6", label="2π √(a³/μ)")
    for e, marker in zip(ECCENTRICITIES, "+ox", strict=True):
        periods = [measured_period(orbits[a, e]) for a in SEMI_AXES]
        law.loglog(SEMI_AXES, periods, marker, markersize=9, markerfacecolor="none", label=f"e = {e:g}")
    law.set(xlabel="a [m]", ylabel="T [s]", title="third law")
    law.legend()
    turns = tau / (2 * np.pi)
    mean.plot(turns, integral / tau, linewidth=0.8)
    mean.plot(turns, 0.6 / tau, "k--", turns, -0.6 / tau, "k--", linewidth=0.8)
    mean.set(xlabel="revolutions", ylabel="2T̄ + V̄ [J]", ylim=(-0.1, 0.1), title="virial, e = 0.6: as 1/τ (dashed)")
    plt.savefig(figure, dpi=150)


if __name__ == "__main__":
    raise SystemExit(run_scenario(main))
