"""The pendulum on a pivot z = amplitude · sin(angular_frequency · t): Mathieu's equation, Kapitza's potential.

Small swings obey Mathieu's equation θ'' + (δ - 2ε cos 2τ) θ = 0 in the time τ = angular_frequency · t/2, but for a
shift of τ, with δ = 4g/(l · angular_frequency²) of either sign and ε = 2 amplitude/l.
"""

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.special import mathieu_a, mathieu_b

from liaisons.closed_forms import Values, closed_form
from liaisons_catalogue.solutions.integration import integrate


def _characteristic_values(epsilon: ArrayLike, count: int) -> NDArray:
    """Values a_0, b_1, a_1, ... b_count, a_count of δ at ε: solutions are bounded from a_m to b_(m+1)."""
    a, b = ([value(m, epsilon) for m in range(count + 1)] for value in (mathieu_a, mathieu_b))
    return np.array([a[0], *(edge for m in range(1, count + 1) for edge in (b[m], a[m]))])


@closed_form(
    "the trace of the map of small swings over a period of the shaken pivot: bounded where it is below 2 in size"
)
def shaken_trace(at: Values, *, amplitude: float, angular_frequency: float) -> float:
    """Return the trace for swings about θ = 0; with ``gravity`` < 0, about a bob that stands on its pivot."""
    delta, epsilon = 4 * at.gravity / (at.length * angular_frequency**2), 2 * amplitude / at.length

    def rates(tau: float, y: NDArray) -> NDArray:
        """Rates of two solutions, each with its rate."""
        pull = 2 * epsilon * np.cos(2 * tau) - delta
        return np.array([y[1], pull * y[0], y[3], pull * y[2]])

    end = integrate(at, rates, [1, 0, 0, 1], np.pi)
    return float(end[0] + end[3])


@closed_form("whether small swings on a shaken pivot stay bounded: between Mathieu's a_m and b_(m+1)")
def shaken_is_bounded(gravity: ArrayLike, amplitude: ArrayLike, at: Values, *, angular_frequency: float) -> NDArray:
    """Return truth values; ``gravity`` [m/s2], of either sign, and ``amplitude`` [m] broadcast."""
    delta, epsilon = np.broadcast_arrays(
        4 * np.asarray(gravity) / (at.length * angular_frequency**2), 2 * np.asarray(amplitude) / at.length
    )
    furthest = float(np.max(delta + 2 * np.abs(epsilon), initial=0.0))  # a_m and b_m are beyond m² - 2ε
    return np.sum(_characteristic_values(epsilon, int(np.sqrt(furthest)) + 2) < delta, axis=0) % 2 == 1


@closed_form(
    "the gravities [m/s2] at which small swings on a shaken pivot begin to grow: those of a_0, b_1, a_1, ... a_count"
)
def shaken_edges(amplitude: ArrayLike, at: Values, *, angular_frequency: float, count: int = 4) -> NDArray:
    """Return gravities of shape (2 count + 1, ...), with the shape of ``amplitude`` [m]."""
    edges = _characteristic_values(2 * np.asarray(amplitude) / at.length, count)
    return edges * at.length * angular_frequency**2 / 4


@closed_form(
    "the angular frequency [rad/s] beyond which a shaken pivot holds the bob up, √(2gl)/amplitude", gravity="> 0"
)
def upright_from(amplitude: float, at: Values) -> float:
    """Return the angular frequency to leading order in a/l, for the averaged potential of :func:`upright_well`."""
    return float(np.sqrt(2 * at.gravity * at.length) / amplitude)


@closed_form("the well about the top in the averaged potential -mgl cos θ + ¼ m a²ν² sin² θ (Kapitza)", gravity="> 0")
def upright_well(amplitude: float, angular_frequency: float, at: Values) -> tuple[float, float]:
    """Return the angular frequency of small swings in the well [rad/s], and its half width, from the top [rad]."""
    ratio = (amplitude * angular_frequency) ** 2 / (2 * at.gravity * at.length)
    at.require(ratio > 1, f"angular_frequency = {angular_frequency}: so slow it holds nothing up")
    return float(np.sqrt(at.gravity / at.length * (ratio - 1))), float(np.arccos(1 / ratio))
