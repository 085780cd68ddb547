"""The double pendulum, from its FMU, by FMPy and SciPy."""

from typing import Any

import numpy as np
from fmpy import simulate_fmu
from numpy.typing import NDArray
from scipy.optimize import least_squares


def solve(
    times: NDArray, angles: NDArray, start: dict[str, float], noise: float, fmu: str, **prepared: Any
) -> dict[str, float]:
    """Lengths, second mass, first angles."""

    def residuals(values: NDArray) -> NDArray:
        result = simulate_fmu(
            fmu,
            stop_time=times[-1],
            step_size=times[1],
            output_interval=times[1],
            start_values=dict(zip(start, values, strict=True)),
            output=["theta_1", "theta_2"],
            **prepared,
        )
        return np.ravel([result["theta_1"] - angles[0], result["theta_2"] - angles[1]]) / noise

    bounds = [1e-3, 1e-3, 1e-3, -np.inf, -np.inf], np.inf
    fit = least_squares(residuals, list(start.values()), bounds=bounds, diff_step=1e-5)
    return dict(zip(start, fit.x, strict=True))
