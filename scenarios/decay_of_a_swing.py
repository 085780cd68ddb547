"""A decaying swing determines friction and length; their errors are correlated, so knowing one sharpens the other.

K Ex. 6, far from small swings.  θ(t) is measured with noise; η, l and θ_0 are unknown.  The fit must agree with least
squares over the integrated equation θ'' + ηθ' + g/l sin θ = 0, and so must its covariance, whose 95 % ellipse is drawn;
95 % of 400 simulated measurements must lie inside.  In a large swing it is the action, not the amplitude, that decays
exponentially: ∮ p dθ falls as e^(-ηt), up to (η/Ω)², since 2T averages to Ω ∮ p dθ/2π at any amplitude.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicHermiteSpline
from scipy.optimize import least_squares
from scipy.stats import chi2

from liaisons import crossings, identify, simulate
from liaisons.models import Pendulum
from liaisons.scenarios import Claims, dots, panels, scenario, within

NOISE, GRAVITY = 0.02, 9.81  # [rad], [m/s²]
TRUTH = {"friction": 0.06, "length": 1.2, "theta_0": 2.0}
TIMES = np.linspace(0, 40, 201)


def decaying(values: NDArray) -> NDArray:
    eta, length, theta_0 = values

    def rates(_t: float, y: NDArray) -> list[float]:
        return [y[1], -eta * y[1] - GRAVITY / length * np.sin(y[0])]

    return solve_ivp(rates, (0, 40), [theta_0, 0], method="DOP853", t_eval=TIMES, rtol=1e-11, atol=1e-12).y[0]


@scenario
def main(claim: Claims) -> None:
    random, truth = np.random.default_rng(1673), np.array([*TRUTH.values()])
    measured = decaying(truth) + NOISE * random.normal(size=TIMES.size)
    fit = identify(
        "Pendulum",
        {"time": TIMES, "theta": measured},
        unknown=[*TRUTH],
        noise={"theta": NOISE},
        start_values={"friction": 0.03, "length": 1.1, "theta_0": 1.8},
    )
    values, sigmas = np.array([fit.values[name] for name in TRUTH]), np.sqrt(np.diag(fit.covariance))
    best = least_squares(lambda p: (decaying(p) - measured) / NOISE, values, jac="3-point", x_scale=truth)
    errors = np.sqrt(np.diag(np.linalg.inv(best.jac.T @ best.jac)))
    same = within(1e-3, because="in standard errors; both fits stop when the sum of squares changes by 1e-8 of itself")
    claim("the fit agrees with least squares over the integrated equation", values / errors, best.x / errors, same)
    differences = within(1e-5, because="relative error; the reference is differentiated by finite differences")
    claim("and so are their standard errors", sigmas / errors, 1.0, differences)
    nearer = within(3.1, because="in standard errors; 1 of 200 measurements of three values would be farther away")
    claim("the fitted values agree with the true ones, in standard errors", (values - truth) / errors, 0.0, nearer)
    claim.verdicts += fit.verify()

    # Made-up measurements, each fitted by one step of Gauss and Newton from the truth.
    again = random.normal(size=(400, TIMES.size)) @ np.linalg.pinv(best.jac).T
    factor = np.linalg.cholesky(fit.covariance[:2, :2])
    radius = np.sqrt(chi2.ppf(0.95, 2))
    inside = np.mean(np.linalg.norm(np.linalg.solve(factor, again[:, :2].T), axis=0) <= radius)
    binomial = within(0.033, because="three standard deviations of the share of 400, √(0.95 · 0.05/400)")
    claim("95 in 100 measurements lie in the ellipse of η and l", inside, 0.95, binomial)

    run = simulate("Pendulum", stop_time=40.0, step_size=0.02, tolerance=1e-10, start_values=fit.values)
    turned = crossings(run.time, run["theta_dot"], run["theta_ddot"], rising=False)
    turns = CubicHermiteSpline(run.time, run["theta"], run["theta_dot"])(turned)
    action = Pendulum.action(turns, 0.0, fit.values["length"])
    left = np.log(action / action[0]) + fit.values["friction"] * turned
    square = fit.values["friction"] ** 2 * fit.values["length"] / GRAVITY
    average = within(square, because="(η/Ω)², since friction does not act evenly over a swing")
    claim("at the turning points the action has fallen by e^(-ηt)", left, 0.0, average)

    motion, ellipse = panels(("measured, fitted", "t [s]", "θ [rad]"), ("what is sure", "η [1/s]", "l [m]"))
    dots(motion, TIMES, measured, every=1, label="measured", color="0.6")
    motion.plot(run.time, run["theta"], label="FMU with the fitted values")
    dots(motion, turned, turns, every=1, label="turning points")
    ellipse.plot(*(values[:2] + again[:, :2]).T, ".", color="0.7", markersize=3, label="made-up measurements")
    angle = np.linspace(0, 2 * np.pi, 200)
    circle = radius * np.array([np.cos(angle), np.sin(angle)])
    ellipse.plot(*(values[:2, None] + factor @ circle), label="95 %")
    ellipse.plot(*truth[:2], "k+", label="true")
