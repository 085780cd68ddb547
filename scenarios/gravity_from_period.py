"""A large swing measures g as well as a small one, by g = 16 K² l/T² instead of 4 π² l/T².

K Ex. 3 as an inverse problem.  θ(t) is measured with noise at an amplitude that makes T half as long again as 2π
√(l/g); g and θ_0 are unknown.  The fit must agree with least squares over Jacobi's elliptic functions, including
standard errors, where ∂θ/∂g is ½ t θ'/g since only g t²/l enters.  With Legendre's K, the period of an FMU that has the
fitted values gives the same g; the formula for small swings is wrong by half.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares
from scipy.special import ellipk

from liaisons import crossings, identify, simulate
from liaisons.models import Pendulum
from liaisons.scenarios import Claims, dots, panels, scenario, within

NOISE, LENGTH = 0.02, 1.2  # [rad], [m]: the length is measured beforehand
TRUTH = {"gravity": 9.79, "theta_0": 2.2}
TIMES = np.linspace(0, 20, 201)


def swinging(values: NDArray) -> NDArray:
    gravity, theta_0 = values
    return Pendulum.exact(TIMES, gravity=gravity, theta_0=theta_0, length=LENGTH)["theta"]


@scenario
def main(claim: Claims) -> None:
    truth = np.array([*TRUTH.values()])
    measured = swinging(truth) + NOISE * np.random.default_rng(1656).normal(size=TIMES.size)
    guess = {"gravity": 9.0, "theta_0": 2.0, "length": LENGTH}
    fit = identify(
        "Pendulum",
        {"time": TIMES, "theta": measured},
        unknown=[*TRUTH],
        noise={"theta": NOISE},
        start_values=guess,
    )
    values, sigmas = np.array([fit.values[name] for name in TRUTH]), np.sqrt(np.diag(fit.covariance))
    best = least_squares(lambda p: (swinging(p) - measured) / NOISE, truth, jac="3-point", xtol=1e-14, ftol=1e-14)
    errors = np.sqrt(np.diag(np.linalg.inv(best.jac.T @ best.jac)))
    same = within(1e-4, because="in standard errors; both fits stop when the sum of squares changes by 1e-10 of itself")
    claim("g and θ_0 are those of least squares over the elliptic functions", values / errors, best.x / errors, same)
    differences = within(1e-6, because="relative error; the closed form is differentiated by finite differences")
    claim("and so are their standard errors", sigmas / errors, 1.0, differences)
    nearer = within(3.0, because="in standard errors; 1 of 200 measurements would be farther away")
    claim("g and θ_0 agree with the true values, in standard errors", (values - truth) / errors, 0.0, nearer)
    claim.verdicts += fit.verify()

    fitted: Any = {"length": LENGTH} | fit.values
    run = simulate("Pendulum", stop_time=40.0, step_size=0.02, tolerance=1e-10, **fitted)
    period = np.diff(crossings(run.time, run["theta"], run["theta_dot"], rising=True)).mean()
    gravity = 16 * ellipk(np.sin(fit.values["theta_0"] / 2) ** 2) ** 2 * LENGTH / period**2
    spline = within(1e-7, "m/s²", because="errors of the spline through the crossings, 0.02⁴/384, and of the solver")
    claim("16 K² l/T² with the period T of the FMU is this g", gravity, fit.values["gravity"], spline)

    motion, rest = panels(("measured, fitted", "t [s]", "θ [rad]"), ("what is left", "t [s]", "residual [rad]"))
    dots(motion, TIMES, measured, every=1, label="measured", color="0.6")
    motion.plot(run.time, run["theta"], label=f"g = {values[0]:.3f} ± {sigmas[0]:.3f} m/s²")
    small = Pendulum.small_angle(run.time, **fitted)["theta"]
    motion.plot(run.time, small, "--", linewidth=0.8, label="small swings")
    motion.set(xlim=(0, 10))
    rest.plot(TIMES, measured - swinging(values), ".", markersize=3)
    rest.axhspan(-2 * NOISE, 2 * NOISE, alpha=0.2, label="± 2 standard deviations")
