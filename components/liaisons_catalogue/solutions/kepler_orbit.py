"""Motion in the field -μ/r: ellipse, parabola and hyperbola in one formula, without cancellation in any of them.

With Stumpff's functions c_k = c_k(β s²), β = 2μ/r - v² (μ/a on an ellipse) and the universal anomaly s, ds = dt/r,
counted like the time from the pericentre at the distance r_p, to which x points, with the angular momentum L per unit
mass::

    t = r_p s c_1 + μ s³ c_3                Kepler's equation; E - e sin E = n t with E = s √β
    r = r_p + μ e s² c_2 = dt/ds            all terms positive
    x = r_p - μ s² c_2,    y = L s c_1

Plane vectors are complex numbers.
"""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from liaisons.closed_forms import Values, closed_form
from liaisons_catalogue.solutions.stumpff import stumpff


@closed_form("ellipse, parabola or hyperbola, by Kepler's equation solved to rounding", mass="> 0", mu="> 0")
def exact(t: NDArray, at: Values) -> dict[str, NDArray]:
    at.require(at.x_0 * at.y_dot_0 != at.y_0 * at.x_dot_0, "angular momentum 0: the planet moves through r = 0")
    position, velocity = _motion(t, complex(at.x_0, at.y_0), complex(at.x_dot_0, at.y_dot_0), at.mu)
    return {"x": position.real, "y": position.imag, "x_dot": velocity.real, "y_dot": velocity.imag}


@closed_form("the time of a revolution [s], 2π √(a³/μ) (K eq. 60); infinite on a parabola or hyperbola", mu="> 0")
def period(at: Values) -> float:
    distance = float(np.hypot(at.x_0, at.y_0))
    at.require(distance > 0, f"r_0 = {distance} must be > 0")
    inverse = 2 / distance - (at.x_dot_0**2 + at.y_dot_0**2) / at.mu  # 1/a
    return float(2 * np.pi / np.sqrt(at.mu * inverse**3)) if inverse > 0 else np.inf


@closed_form("the start at the pericentre, on the x axis, of an orbit of this semi-axis [m] and eccentricity")
def pericentre(at: Values, *, semi_axis: float, eccentricity: float) -> dict[str, float]:
    speed = np.sqrt(at.mu / semi_axis * (1 + eccentricity) / (1 - eccentricity))
    return {"x_0": semi_axis * (1 - eccentricity), "y_dot_0": float(speed)}


@closed_form("the time since the pericentre [s] at the eccentric anomaly E, √(a³/μ) (E - e sin E): Kepler's equation")
def time(E: ArrayLike, at: Values, *, semi_axis: float, eccentricity: float) -> NDArray:
    return np.sqrt(semi_axis**3 / at.mu) * (np.asarray(E) - eccentricity * np.sin(E))


def _motion(
    t: NDArray[np.float64], r_0: complex, v_0: complex, mu: float
) -> tuple[NDArray[np.complex128], NDArray[np.complex128]]:
    """Complex positions and velocities at times t; the angular momentum must not be 0."""
    sigma, L = (r_0.conjugate() * v_0).real, (r_0.conjugate() * v_0).imag
    distance, parameter = abs(r_0), L**2 / mu
    beta = 2 * mu / distance - abs(v_0) ** 2
    rate = np.sqrt(abs(beta))
    if beta > 0:
        e_cosine, e_sine = 1 - distance * beta / mu, sigma * rate / mu  # e cos E and e sin E at the start
        e, s_0 = np.hypot(e_cosine, e_sine), np.arctan2(e_sine, e_cosine) / rate
    else:
        e = np.sqrt(1 - beta * parameter / mu)
        s_0 = np.arcsinh(rate * sigma / (mu * e)) / rate if beta < 0 else sigma / mu
    nearest = parameter / (1 + e)

    def position(s: NDArray) -> NDArray:
        """Position at the universal anomaly s, in the frame of the pericentre."""
        c_1, c_2, _ = stumpff(beta * s**2)
        return nearest - mu * s**2 * c_2 + 1j * L * s * c_1

    def elapsed(s: NDArray) -> NDArray:
        """Time since the pericentre."""
        c_1, _, c_3 = stumpff(beta * s**2)
        return s * (nearest * c_1 + mu * s**2 * c_3)

    since = t + elapsed(np.asarray(s_0))
    if beta > 0:
        period = 2 * np.pi * mu / (beta * rate)
        since -= period * np.round(since / period)
    s = np.sign(since) * _universal_anomaly(np.abs(since), nearest, e, beta, mu)
    c_1, c_2, _ = stumpff(beta * s**2)
    r = nearest + mu * e * s**2 * c_2
    rotation = r_0 / position(np.asarray(s_0))
    rotation /= abs(rotation)  # from the frame of the pericentre; well defined on a circle, too
    return rotation * position(s), rotation * (-mu * s * c_1 + 1j * L * (1 - beta * s**2 * c_2)) / r


def _universal_anomaly(t: NDArray, nearest: float, e: float, beta: float, mu: float) -> NDArray:
    """Universal anomaly s at times t >= 0 since the pericentre, on an ellipse up to half a period.

    By Newton's method: t(s) is convex, since r grows, so that from an upper bound s falls to the root.
    """
    rate = np.sqrt(abs(beta))
    s = np.full_like(t, np.pi / rate) if beta > 0 else np.cbrt(6 * t / mu)  # c_3 >= 1/6
    if beta < 0:  # sinh x - x >= ½ sinh x from x = 2.2 on
        s = np.minimum(s, np.maximum(2.2, np.arcsinh(2 * t * rate**3 / mu)) / rate)
    while True:
        c_1, c_2, c_3 = stumpff(beta * s**2)
        missing = t - s * (nearest * c_1 + mu * s**2 * c_3)
        lower = np.minimum(s, s + missing / (nearest + mu * e * s**2 * c_2))
        if np.all(s - lower <= 4e-16 * s):  # the last digit
            return lower
        s = lower
