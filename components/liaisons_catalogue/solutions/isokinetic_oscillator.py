"""Plane motion at constant speed v in a harmonic potential: turning points by Lambert's W, the rest by quadrature.

With w = r² and |r × r'| = c v exp(a w/2), which is what Gauss's friction leaves of the angular momentum::

    w'² = 4 v² f(w),    f(w) = w - c² exp(a w),    φ' = c v exp(a w/2) / w

f vanishes at w_1 < w_2.  On w = (w_1 + w_2)/2 - (w_2 - w_1)/2 cos θ both dt/dθ and dφ/dθ are even, periodic
and analytic in θ, so that their cosine series converge geometrically.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.fft import dct
from scipy.special import exprel, lambertw

from liaisons.closed_forms import Values, closed_form

_NEAREST = 0.04  # smallest r / largest r; the cosine series converge as exp(-2k) of it
_MODES = 512  # of them, exp(-2 · 512 · 0.04) = 1e-18
_CIRCLE = 1e-4  # relative width of the ring below which c does not resolve the turning points (error √ε/width)


@dataclass(frozen=True, slots=True)
class Orbit:
    """Motion between two turning points; the phase θ is 0 at the inner one and π at the outer one."""

    inner: float  # w_1
    outer: float  # w_2
    time: NDArray  # cosine series of dt/dθ
    angle: NDArray  # of dφ/dθ

    @classmethod
    def of(cls, at: Values, speed: float, a: float, c: float) -> Orbit:
        """Make the orbit of a speed, a > 0 and 0 < c <= 1/√(a e).

        :raises ValidityError: on the circle r² = 1/a or too close to it, and where it passes too close to the origin.
        """
        product = -a * c**2
        inner, outer = (float(-lambertw(product, branch).real) / a for branch in (0, -1))
        at.require(
            product > -np.exp(-1) and outer - inner > _CIRCLE * outer,
            f"the orbit is almost the circle of radius {a**-0.5:g} m; r is constant there",
        )
        ratio = np.sqrt(inner / outer)
        at.require(
            ratio >= _NEAREST,
            f"r falls to {ratio:.2g} of its largest value; the series reach {_NEAREST}",
        )
        theta = np.pi * (np.arange(_MODES) + 0.5) / _MODES
        w = _radius_squared(inner, outer, theta)
        near, far = np.where(theta < np.pi / 2, inner, outer), np.where(theta < np.pi / 2, outer, inner)
        # f(w)/((w - w_1)(w_2 - w)), from the nearer root, where f itself has no digits: c² exp(a w_i) = w_i
        root = np.sqrt((1 - near * a * exprel(a * (w - near))) / (far - w))
        rate = 2 * speed * root
        phi_rate = c * speed * np.exp(a * w / 2) / w
        return cls(inner, outer, _cosine_coefficients(1 / rate), _cosine_coefficients(phi_rate / rate))

    @property
    def half_period(self) -> float:
        """Time from one turning point to the other [s]."""
        return float(np.pi * self.time[0])

    @property
    def apsidal_angle(self) -> float:
        """Angle at the centre between them [rad]."""
        return float(np.pi * self.angle[0])

    def phase(self, w: float, *, outwards: bool) -> float:
        """Phase θ at a distance √w."""
        theta = float(np.arccos(np.clip((self.inner + self.outer - 2 * w) / (self.outer - self.inner), -1, 1)))
        return theta if outwards else -theta

    def at(self, t: NDArray, phase: float) -> tuple[NDArray, NDArray, NDArray]:
        """Radius r [m], r' [m/s] and φ - φ(0) [rad] at times after a phase."""
        target = t + _series_integral(self.time, np.array(phase))
        theta = target / self.time[0]
        for _ in range(60):  # Newton; quadratic from a start that is off by the sine series alone
            step = (_series_integral(self.time, theta) - target) / _series_sum(self.time, theta)
            theta = theta - step
            if np.max(np.abs(step)) <= 4e-16 * np.max(1 + np.abs(theta)):
                break
        w = _radius_squared(self.inner, self.outer, theta)
        w_dot = (self.outer - self.inner) / 2 * np.sin(theta) / _series_sum(self.time, theta)
        r = np.sqrt(w)
        return r, w_dot / (2 * r), _series_integral(self.angle, theta) - _series_integral(self.angle, np.array(phase))


@closed_form("turning points by Lambert's W, time and angle between them by quadrature, for m v² = 3 k_B T")
def exact(t: NDArray, at: Values) -> dict[str, NDArray]:
    """Return position, velocity and μ at the times; orbits close to circles are refused."""
    position, velocity = at.array("x_0", "y_0", "z_0"), at.array("x_dot_0", "y_dot_0", "z_dot_0")
    speed, norm = np.sqrt(3 * at.thermal_energy / at.mass), np.linalg.norm(velocity)
    at.require(
        abs(norm - speed) <= 1e-6 * speed,
        f"the start velocity {norm:.9g} m/s must be {speed:.9g} m/s: m v² = 3 k_B T",
    )
    a, r_0, moment = (
        at.stiffness / (3 * at.thermal_energy),
        float(np.linalg.norm(position)),
        np.cross(position, velocity),
    )
    area_rate = float(np.linalg.norm(moment))
    if a == 0 or area_rate == 0:
        v = np.multiply.outer(velocity, np.ones_like(t))
        r = np.multiply.outer(position, np.ones_like(t)) + v * t
    else:
        orbit = Orbit.of(at, speed, a, area_rate * np.exp(-a * r_0**2 / 2) / speed)
        distance, rate, phi = orbit.at(t, orbit.phase(r_0**2, outwards=bool(position @ velocity >= 0)))
        phi_dot = area_rate * np.exp(a * (distance**2 - r_0**2) / 2) / distance**2
        radial = position / r_0
        across = np.cross(moment / area_rate, radial)
        e_r = np.multiply.outer(radial, np.cos(phi)) + np.multiply.outer(across, np.sin(phi))
        e_phi = np.multiply.outer(across, np.cos(phi)) - np.multiply.outer(radial, np.sin(phi))
        r, v = distance * e_r, rate * e_r + distance * phi_dot * e_phi
    names = ("x", "y", "z", "x_dot", "y_dot", "z_dot", "mu")
    return dict(zip(names, (*r, *v, -a * np.sum(r * v, axis=0)), strict=True))


@closed_form("smallest and largest r [m], time [s] and angle [rad] from one to the other", stiffness="> 0")
def turning_points(at: Values, *, position: ArrayLike, velocity: ArrayLike) -> tuple[float, float, float, float]:
    """Return smallest and largest radius, time and angle between them.

    :param position: of a point of the orbit [m], shape (3,); ``velocity`` there [m/s], shape (3,).
    """
    r, v = np.asarray(position, dtype=float), np.asarray(velocity, dtype=float)
    area_rate, a = float(np.linalg.norm(np.cross(r, v))), at.stiffness / (3 * at.thermal_energy)
    at.require(area_rate > 0, "straight through the origin r does not turn")
    speed = float(np.linalg.norm(v))
    orbit = Orbit.of(at, speed, a, area_rate * float(np.exp(-a * (r @ r) / 2)) / speed)
    return float(np.sqrt(orbit.inner)), float(np.sqrt(orbit.outer)), orbit.half_period, orbit.apsidal_angle


def _radius_squared(inner: float, outer: float, theta: NDArray) -> NDArray:
    """Square of the radius at a phase."""
    return inner + (outer - inner) * np.sin(theta / 2) ** 2


def _cosine_coefficients(values: NDArray) -> NDArray:
    """Coefficients of Σ a_k cos kθ from the values at (j + ½) π/n."""
    coefficients = np.asarray(dct(values, type=2)) / values.size
    coefficients[0] /= 2
    return coefficients


def _series_sum(series: NDArray, theta: NDArray) -> NDArray:
    """Sum of a cosine series."""
    return np.cos(np.multiply.outer(theta, np.arange(series.size))) @ series


def _series_integral(series: NDArray, theta: NDArray) -> NDArray:
    """Integral of a cosine series from 0."""
    k = np.arange(1, series.size)
    return series[0] * theta + np.sin(np.multiply.outer(theta, k)) @ (series[1:] / k)
