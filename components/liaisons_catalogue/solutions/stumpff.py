"""Stumpff's functions c_k(z) = Σ_j (-z)^j / (k + 2j)!, which have no regimes: circular, straight and hyperbolic motion.

c_1(θ²) = sin θ / θ,   c_2(θ²) = (1 - cos θ) / θ²,   c_3(θ²) = (θ - sin θ) / θ³, and their hyperbolic counterparts for
negative arguments; 1, 1/2, 1/6 at 0.
"""

from math import factorial

import numpy as np
from numpy.typing import ArrayLike, NDArray

# of c_3, highest power first; for |z| < 1 the next term is below 1e-19
_SERIES = [(-1) ** j / factorial(3 + 2 * j) for j in reversed(range(9))]


def stumpff(z: ArrayLike) -> tuple[NDArray, NDArray, NDArray]:
    """Functions c_1, c_2 and c_3, each of the shape of z; infinite where they overflow (z below -5e5)."""
    z = np.asarray(z, dtype=float)
    c_1 = _c_1(z)
    near = np.abs(z) < 1
    c_3 = np.where(near, np.polyval(_SERIES, np.where(near, z, 0.0)), (1 - c_1) / np.where(near, 1.0, z))
    return c_1, _c_1(z / 4) ** 2 / 2, c_3


def _c_1(z: NDArray) -> NDArray:
    """Function c_1, sin θ/θ or sinh θ/θ."""
    theta = np.sqrt(np.abs(z))
    sine = np.where(z < 0, np.sinh(np.where(z < 0, theta, 0.0)), np.sin(theta))
    return np.divide(sine, theta, out=np.ones_like(theta), where=theta > 0)
