"""Chaos spoils prediction but sharpens measurement: start values and lengths of a double pendulum, from 50 % off.

K 2.2, released far from small angles.  Both angles are measured with noise for six seconds; their start values and both
lengths are unknown.  Motions that are 1e-8 apart at the start are 0.001 apart at the end, so the sum of squares has
many minima.  Multiple shooting, with segments that begin at measured values, leads to the true minimum.  One
combination of the unknowns is then determined more accurately, by the factor by which deviations have grown; the others
are determined as accurately as without chaos.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from liaisons import Result, identify, simulate
from liaisons.scenarios import Claims, dots, panels, scenario, within

NOISE = 0.02  # [rad]
TRUTH = {"theta_1_0": 2.0, "theta_2_0": 2.5, "length_1": 1.0, "length_2": 0.7}
GUESS = {"theta_1_0": 3.0, "theta_2_0": 1.25, "length_1": 1.5, "length_2": 0.35}  # 50 % off
NEAR = 1e-8  # [rad]


def run(start: dict[str, float], step_size: float = 0.05) -> Result:
    return simulate("DoublePendulum", stop_time=6.0, step_size=step_size, tolerance=1e-12, start_values=start)


def angles(motion: Result) -> np.ndarray:
    return np.array([motion["theta_1"], motion["theta_2"]])


@scenario
def main(claim: Claims) -> None:
    true, random = run(TRUTH), np.random.default_rng(1963)
    measured = angles(true) + NOISE * random.normal(size=(2, true.time.size))
    data: dict[str, Any] = {"time": true.time, "theta_1": measured[0], "theta_2": measured[1]}
    fit = identify("DoublePendulum", data, unknown=[*TRUTH], noise=NOISE, start_values=GUESS)
    errors = np.array([fit.values[name] - TRUTH[name] for name in TRUTH])
    nearer = within(3.2, because="in standard errors: 1 of 200 measurements of four values would be farther away")
    claim("start values and lengths are right, in their errors", errors / [*fit.standard_errors.values()], 0.0, nearer)

    fitted = run(fit.values)
    left, noise = (np.sum((measured - angles(motion)) ** 2) / NOISE**2 for motion in (fitted, true))
    freedom = measured.size - len(TRUTH)
    spread = within(3 * np.sqrt(2 * freedom), because="three standard deviations, √(2n) each, of chi-squared")
    claim("residuals of the FMU with the fitted values are the noise: χ² = n", left, freedom, spread)
    wilks = within(14.9, because="χ² with 4 degrees of freedom: 1 of 200 measurements prefers other values by more")
    claim("the true values are nearly as likely", noise, left, wilks)

    near = run(TRUTH | {"theta_1_0": TRUTH["theta_1_0"] + NEAR})
    growth = np.linalg.norm(angles(near) - angles(true), axis=0) / NEAR
    sharpest = np.linalg.inv(fit.covariance)[0, 0] ** -0.5
    curved = within(0.2, because="relative; the fit is not the true motion, and deviations grow 1e5-fold")
    claim("if only θ_1(0) is unknown, it errs by noise/growth", sharpest * np.linalg.norm(growth) / NOISE, 1.0, curved)

    motion, chaos = panels(
        ("from the guess to the fit", "t [s]", "θ$_1$ [rad]"), ("chaos", "t [s]", "growth of 1e-8 rad")
    )
    dots(motion, true.time, measured[0], every=1, label="measured")
    for start, label, style in ((GUESS, "guess", "--"), (fit.values, "fit", "-")):
        fine = run(start, 0.01)
        motion.plot(fine.time, fine["theta_1"], style, label=label)
    chaos.semilogy(true.time, growth)
