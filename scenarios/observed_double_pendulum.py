"""A double pendulum is held upside down by LQG from two measured angles; estimation adds a second term to the cost.

Every 10 ms a Kalman filter estimates both momenta from the angles, and the optimal feedback reads the estimates (LQG).
By the separation principle, the multipliers of the loop are those of the feedback and those of the filter.  The cost of
a step is tr(S W) + tr(P Kᵀ(R + BᵀSB)K): random torques with the covariance W add the first term, where S is the cost of
deviations; estimation errors with the covariance P add the second, through the gains K.  (Åström and Wittenmark,
Computer-Controlled Systems, 11.4.)
"""

from __future__ import annotations

from typing import Any

import numpy as np

from liaisons import hold
from liaisons.scenarios import Claims, panels, scenario, within

STEP, STOP, TILT = 0.01, 15.0, 0.02
NOISE, PUSH = 1e-3, 1e-3  # rad, N m √s
ANGLES = ("theta_1", "theta_2")
UPRIGHT = {"theta_1": np.pi, "theta_2": np.pi, "pivot_x": 0.0}


@scenario
def main(claim: Claims) -> None:
    regulator = hold(
        "DoublePendulum",
        UPRIGHT,
        "pivot_x",
        step_size=STEP,
        measured=ANGLES,
        noise=dict.fromkeys(ANGLES, NOISE),
        disturbance={f"{angle}_force": PUSH for angle in ANGLES},
    )
    claim.verdicts += regulator.verify()
    observer: Any = regulator.observer
    expected = observer.standard_deviations

    random, count = np.random.default_rng(3), round(STOP / STEP)
    mechanism, part = "DoublePendulum", observer.part
    inputs = [f"{part}.{angle}_noise" for angle in ANGLES] + [f"{mechanism}.{angle}_force" for angle in ANGLES]
    values = random.standard_normal((count, 4)) * np.repeat([NOISE, PUSH / np.sqrt(STEP)], 2)
    system = regulator.system(theta_1_0=np.pi + TILT)
    with system.start(step_size=STEP, coupling="jacobi", tolerance=1e-9) as run:
        step = run.stepper(inputs, [])
        for row in values:
            step(row)
    result = run.result

    late = (result.time > STOP / 3) & (result.time < STOP)  # after the tilt of the start; the last noise is none
    independent = within(0.25, because="errors last 20 samples, so 50 are independent: 2.5 times 1/√(2 · 50)")
    for name in observer.outputs:
        off = (result[f"{part}.{name}"] - result[f"{mechanism}.{name}"])[late]
        claim(f"error of {name}, divided by its standard deviation", np.std(off) / expected[name], 1.0, independent)
    seen = np.std((result[f"{mechanism}.theta_1"] + result[f"{part}.theta_1_noise"] - result[f"{part}.theta_1"])[late])
    half = within(0.0, because="an inequality")
    claim.below("estimates are twice as accurate as measured angles", expected["theta_1"] / seen, 0.5, half)
    upright = within(0.05, "rad", because="ten times what noise causes; from four times that it cannot be held")
    claim("it stays upright", result[f"{mechanism}.theta_2"][late], np.pi, upright)

    angle, momentum, moved = panels(
        ("what is measured", "t [s]", "θ$_1$ - π [rad]"),
        ("what is not", "t [s]", "p$_1$ [kg m²/s]"),
        ("what feedback moves", "t [s]", "pivot_x [m]"),
    )
    first = result.time < 4.0
    t, true = result.time[first], result[f"{mechanism}.theta_1"][first] - np.pi
    angle.plot(t, true + result[f"{part}.theta_1_noise"][first], ".", markersize=2, label="measured")
    angle.plot(t, true, label="true")
    estimate, deviation = result[f"{part}.p_theta_1"][first], 2 * expected["p_theta_1"]
    momentum.fill_between(t, estimate - deviation, estimate + deviation, alpha=0.3, label="estimate ± 2 s")
    momentum.plot(t, result[f"{mechanism}.p_theta_1"][first], label="true")
    moved.plot(result.time, result[f"{mechanism}.pivot_x"], linewidth=0.8)
