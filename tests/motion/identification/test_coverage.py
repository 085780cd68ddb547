"""Whether ellipsoids of 95 % hold the truth so often: 1000 fixed seeds for each of five mechanisms."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import chi2

from liaisons import identify, simulate
from liaisons_motion.identification.minimising import minimise

SEEDS = 1000
CASES = {
    "Pendulum": ({"length": 0.8, "friction": 0.1, "theta_0": 1.5}, ["theta"], 0.01),
    "Oscillator": ({"stiffness": 4.0, "damping": 0.2, "x_0": 0.7, "x_dot_0": -0.5}, ["x"], 0.02),
    "KeplerOrbit": ({"mu": 1.2, "x_0": 1.0, "y_dot_0": 0.9}, ["x", "y"], 0.01),
    "DoublePendulum": ({"length_1": 0.8, "length_2": 1.2, "theta_1_0": 1.0, "theta_2_0": -0.5}, ["theta_2"], 0.01),
    "ChargedParticle": ({"B_z": 1.3, "E_x": 0.4, "x_dot_0": 0.6}, ["x", "y"], 0.02),
}


@pytest.mark.slow
@pytest.mark.parametrize("mechanism", CASES)
def test_coverage(mechanism: str) -> None:
    truth, signals, noise = CASES[mechanism]
    times = np.linspace(0, 5, 21)
    result = simulate(mechanism, times=times, tolerance=1e-12, start_values=truth)
    data = {"time": times, **{name: result[name] for name in signals}}
    exact = identify(mechanism, data, list(truth), noise, start_values=truth).estimate
    assert exact.values == pytest.approx(list(truth.values()), rel=1e-6)
    count = len(exact.linearization[0])

    def holds_truth(seed: int) -> bool:
        """The same fit, to measurements with noise."""
        added = noise * np.random.default_rng(seed).standard_normal(count)
        objective = replace(exact.objective, shift=-added / noise)
        estimate = replace(exact, objective=objective, minimum=minimise(objective, exact.values))
        error = estimate.values - list(truth.values())
        return bool(error @ np.linalg.solve(estimate.covariance, error) <= chi2.ppf(0.95, len(truth)))

    assert 0.93 <= np.mean([holds_truth(seed) for seed in range(SEEDS)]) <= 0.97
