"""From θ(t) alone, the amplitude and the frequency with which a swing's length was moved can be identified.

M 8.1: a Sinusoid moves the length of a Pendulum, and no length is measured.  Its amplitude and angular frequency are
parameters of the operator, and unknown like θ_0.  The fit must agree with least squares over the integrated equation l
θ'' + 2 l' θ' + g sin θ = 0, including standard errors.  Because the length moves at about twice the frequency of the
swing, its amplitude shows in how fast the swing grows.  So an amplitude of 60 mm is determined to a fraction of a
millimetre by measuring only an angle.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from liaisons import identify, operator, simulate
from liaisons.models import Pendulum
from liaisons.scenarios import Claims, dots, panels, scenario, within

NOISE = 0.01  # [rad]
TRUTH = {"length.amplitude": 0.06, "length.angular_frequency": 6.2, "theta_0": 0.4}
TIMES = np.linspace(0, 10, 201)


def pumped(values: NDArray) -> NDArray:
    amplitude, omega, theta_0 = values
    return Pendulum.pumped(TIMES, amplitude=amplitude, angular_frequency=omega, theta_0=theta_0)["theta"]


@scenario
def main(claim: Claims) -> None:
    truth = np.array([*TRUTH.values()])
    measured = pumped(truth) + NOISE * np.random.default_rng(1996).normal(size=TIMES.size)
    fit = identify(
        "Pendulum",
        {"time": TIMES, "theta": measured},
        unknown=[*TRUTH],
        noise={"theta": NOISE},
        operators={"length": "Sinusoid"},
        start_values={"length.amplitude": 0.02, "length.angular_frequency": 6.0, "length.offset": 1.0, "theta_0": 0.3},
    )
    values, sigmas = np.array([fit.values[name] for name in TRUTH]), np.sqrt(np.diag(fit.covariance))
    best = least_squares(lambda p: (pumped(p) - measured) / NOISE, truth, jac="3-point", x_scale=truth)
    errors = np.sqrt(np.diag(np.linalg.inv(best.jac.T @ best.jac)))
    why = "in standard errors; both fits stop when the sum of squares changes by less than 1e-8 of itself"
    same = within(1e-3, because=why)
    claim("it agrees with a least-squares fit to solutions of the equation", values / errors, best.x / errors, same)
    differences = within(1e-5, because="relative error; the reference takes its derivatives by finite differences")
    claim("and so do their standard errors", sigmas / errors, 1.0, differences)
    why = "in standard errors; in 1 of 200 measurements one of the three values would be farther away"
    nearer = within(3.1, because=why)
    claim("the fitted values agree with the true ones, in standard errors", (values - truth) / errors, 0.0, nearer)
    claim.verdicts += fit.verify()

    moved = {"offset": 1.0} | {
        name.removeprefix("length."): value for name, value in fit.values.items() if name != "theta_0"
    }
    length = operator("Sinusoid", start_values=moved)
    run = simulate("Pendulum", stop_time=10.0, tolerance=1e-10, length=length, theta_0=fit.values["theta_0"])
    still = simulate("Pendulum", stop_time=10.0, tolerance=1e-10, theta_0=fit.values["theta_0"])

    swing, rope = panels(("measured, fitted", "t [s]", "θ [rad]"), ("not measured", "t [s]", "l [m]"))
    dots(swing, TIMES, measured, every=1, label="measured", color="0.6")
    swing.plot(run.time, run["theta"], label="FMU with the fitted operator")
    swing.plot(still.time, still["theta"], "--", linewidth=0.8, label="fixed length")
    rope.plot(run.time, run["length"], label="as it was fitted")
    true = 1 + TRUTH["length.amplitude"] * np.sin(TRUTH["length.angular_frequency"] * TIMES)
    dots(rope, TIMES, true, every=2, label="true")
    rope.set(xlim=(0, 5))
