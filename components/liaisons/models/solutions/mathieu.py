"""Mathieu's equation θ'' + (δ - 2ε cos 2t) θ = 0: where its solutions stay bounded (Floquet; δ of either sign)."""

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.special import mathieu_a, mathieu_b

from liaisons.models.solutions.integration import integrate


def edges(epsilon: ArrayLike, count: int) -> NDArray:
    """Characteristic values a_0, b_1, a_1, ... b_count, a_count at ε: solutions are bounded from a_m to b_(m+1)."""
    a, b = ([value(m, epsilon) for m in range(count + 1)] for value in (mathieu_a, mathieu_b))
    return np.array([a[0], *(edge for m in range(1, count + 1) for edge in (b[m], a[m]))])


def is_bounded(delta: ArrayLike, epsilon: ArrayLike) -> NDArray:
    """Whether all solutions are bounded, at δ and ε of shapes that broadcast."""
    delta, epsilon = np.broadcast_arrays(np.asarray(delta, dtype=float), np.asarray(epsilon, dtype=float))
    furthest = float(np.max(delta + 2 * np.abs(epsilon), initial=0.0))  # a_m and b_m are beyond m² - 2ε
    return np.sum(edges(epsilon, int(np.sqrt(furthest)) + 2) < delta, axis=0) % 2 == 1


def trace(delta: float, epsilon: float) -> float:
    """Trace of the matrix that maps (θ, θ') over the period π: solutions are bounded where it is below 2 in size."""

    def rates(t: float, y: NDArray) -> NDArray:
        """Rates of two solutions, each with its rate."""
        pull = 2 * epsilon * np.cos(2 * t) - delta
        return np.array([y[1], pull * y[0], y[3], pull * y[2]])

    end = integrate("mathieu.trace", rates, [1, 0, 0, 1], np.pi)
    return float(end[0] + end[3])
