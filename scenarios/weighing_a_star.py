"""The orbit of a planet determines the mass of its star but not its own: μ = 4π² a³/T², identified from positions.

K 2.5.  x and y are measured with noise at 60 instants of two revolutions; μ and the four start values are unknown.  The
fit must agree with least squares over Kepler's equation, including standard errors; a and T of the fitted orbit satisfy
the third law.  The planet's mass is a factor of the Lagrangian, and the fit reports that it is not determined.  From a
third of a revolution on, the information on μ grows with time as the closed form predicts.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from liaisons import crossings, identify, simulate
from liaisons.models import KeplerOrbit
from liaisons.scenarios import Claims, dots, panels, scenario, within

NOISE = 0.01  # [m]
MU = 1.3
START = KeplerOrbit.pericentre(semi_axis=1.0, eccentricity=0.5, mu=MU)
TRUTH = {"mu": MU, "x_0": START["x_0"], "y_0": 0.0, "x_dot_0": 0.0, "y_dot_0": START["y_dot_0"]}
PERIOD = 2 * np.pi / np.sqrt(MU)
SHARES = 0.3, 0.4, 0.6, 0.8, 1.0, 1.3, 1.6, 2.0  # of a revolution


def seen(times: NDArray, values: NDArray) -> NDArray:
    """x, then y."""
    start: Any = dict(zip(TRUTH, values, strict=True))
    orbit = KeplerOrbit.exact(times, **start)
    return np.concatenate([orbit["x"], orbit["y"]])


@scenario
def main(claim: Claims) -> None:
    random, truth = np.random.default_rng(1609), np.array([*TRUTH.values()])
    times = np.sort(random.uniform(0, 2 * PERIOD, 60))
    measured = seen(times, truth) + NOISE * random.normal(size=2 * times.size)
    x, y = np.split(measured, 2)

    def fitted(unknown: list[str], guess: dict[str, float], last: float) -> Any:
        now = times <= last
        data = {"time": times[now], "x": x[now], "y": y[now]}
        return identify(
            "KeplerOrbit", data, unknown=unknown, noise={"x": NOISE, "y": NOISE}, start_values=guess, start_time=0.0
        )

    fits, guess = [], {name: 1.05 * value for name, value in TRUTH.items()}
    for share in SHARES:  # each starts where the last one ended
        fits.append(fitted([*TRUTH], guess, share * PERIOD))
        guess = fits[-1].values
    fit = fits[-1]
    values, sigmas = np.array([fit.values[name] for name in TRUTH]), np.sqrt(np.diag(fit.covariance))
    best = least_squares(lambda p: (seen(times, p) - measured) / NOISE, truth, jac="3-point", xtol=1e-14, ftol=1e-14)
    errors = np.sqrt(np.diag(np.linalg.inv(best.jac.T @ best.jac)))
    same = within(1e-4, because="in standard errors; both fits stop when the sum of squares changes by 1e-10 of itself")
    claim("μ and the start are those of least squares over Kepler's equation", values / errors, best.x / errors, same)
    differences = within(1e-4, because="relative error; the information changes as slowly as the values do")
    claim("and so are their standard errors", sigmas / errors, 1.0, differences)
    nearer = within(3.3, because="in standard errors; 1 of 200 measurements of five values would be farther away")
    claim("the fitted values agree with the true ones, in standard errors", (values - truth) / errors, 0.0, nearer)
    claim.verdicts += fit.verify()

    start: Any = fit.values
    period = KeplerOrbit.period(**start)
    run = simulate("KeplerOrbit", stop_time=2.5 * period, step_size=period / 1000, tolerance=1e-11, **start)
    distance = np.hypot(run["x"], run["y"])
    semi_axis = (distance.max() + distance.min()) / 2
    turn = np.diff(crossings(run.time, run["x"], run["x_dot"], rising=True)).mean()
    points = within(5e-5, because="relative; nearest and farthest of 1000 points of a revolution: 3/2 (π/1000)²")
    claim("4π² a³/T² of the FMU is this μ", 4 * np.pi**2 * semi_axis**3 / turn**2 / values[0], 1.0, points)
    sentences = fitted([*TRUTH, "mass"], fit.values, 2 * PERIOD).sentences
    silent = [sentence for sentence in sentences if "mass: not determined at all" in sentence]
    claim("one sentence says that the mass is not determined", len(silent), 1, within(0, because="a whole number"))

    rows = [best.jac[np.tile(times <= share * PERIOD, 2)] for share in SHARES]
    promised = [np.sqrt(np.linalg.inv(J.T @ J)[0, 0]) for J in rows]
    got = [np.sqrt(part.covariance[0, 0]) for part in fits]
    linear = within(0.3, because="relative; each fit ends at slightly different values, hence on another orbit")
    claim("the information on μ after a part is as predicted", np.divide(got, promised), 1.0, linear)

    plane, known = panels(("seen, fitted", "x [m]", "y [m]"), ("what is known of μ", "revolutions", "σ$_μ$ [m³/s²]"))
    plane.plot(run["x"], run["y"], linewidth=0.8, label="FMU with the fitted values")
    dots(plane, x, y, every=1, label="seen")
    plane.plot(0, 0, "k+")
    plane.set(aspect="equal")
    known.loglog(SHARES, got, "o", markerfacecolor="none", label="fits")
    known.loglog(SHARES, promised, "k-", linewidth=0.8, label="promised by the closed form")
