"""The pendulum on a pivot z = amplitude · sin(angular_frequency · t): Mathieu's equation, Kapitza's potential."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from liaisons.language import Values, closed_form
from liaisons.models.solutions import mathieu


@closed_form(
    "the trace of the map of small swings over a period of the shaken pivot: bounded where it is below 2 in size"
)
def shaken_trace(at: Values, *, amplitude: float, angular_frequency: float) -> float:
    """The swings are about θ = 0; with ``gravity`` < 0, about a bob that stands on its pivot."""
    return mathieu.trace(4 * at.gravity / (at.length * angular_frequency**2), 2 * amplitude / at.length)


@closed_form("whether small swings on a shaken pivot stay bounded: between Mathieu's a_m and b_(m+1)")
def shaken_is_bounded(gravity: ArrayLike, amplitude: ArrayLike, at: Values, *, angular_frequency: float) -> NDArray:
    """Return truth values; ``gravity`` [m/s2], of either sign, and ``amplitude`` [m] broadcast."""
    delta = 4 * np.asarray(gravity) / (at.length * angular_frequency**2)
    return mathieu.is_bounded(delta, 2 * np.asarray(amplitude) / at.length)


@closed_form(
    "the gravities [m/s2] at which small swings on a shaken pivot begin to grow: those of a_0, b_1, a_1, ... a_count"
)
def shaken_edges(amplitude: ArrayLike, at: Values, *, angular_frequency: float, count: int = 4) -> NDArray:
    """Gravities of shape (2 count + 1, ...), with the shape of ``amplitude`` [m]."""
    return mathieu.edges(2 * np.asarray(amplitude) / at.length, count) * at.length * angular_frequency**2 / 4


@closed_form(
    "the angular frequency [rad/s] beyond which a shaken pivot holds the bob up, √(2gl)/amplitude", gravity="> 0"
)
def upright_from(amplitude: float, at: Values) -> float:
    """It is the leading order in a/l, from the averaged potential -mgl cos θ + ¼ m a²ν² sin² θ (Kapitza)."""
    return float(np.sqrt(2 * at.gravity * at.length) / amplitude)


@closed_form("the well about the top in the averaged potential -mgl cos θ + ¼ m a²ν² sin² θ (Kapitza)", gravity="> 0")
def upright_well(amplitude: float, angular_frequency: float, at: Values) -> tuple[float, float]:
    """Return the angular frequency of small swings in it [rad/s], and how far from the top it reaches [rad]."""
    ratio = (amplitude * angular_frequency) ** 2 / (2 * at.gravity * at.length)
    at.require(ratio > 1, f"angular_frequency = {angular_frequency}: so slow it holds nothing up")
    return float(np.sqrt(at.gravity / at.length * (ratio - 1))), float(np.arccos(1 / ratio))
