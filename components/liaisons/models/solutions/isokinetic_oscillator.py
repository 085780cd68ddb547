"""Plane motion at constant speed v in a harmonic potential: turning points by Lambert's W, the rest by quadrature.

With w = r² and |r × r'| = c v exp(a w/2), which is what Gauss's friction leaves of the angular momentum::

    w'² = 4 v² f(w),    f(w) = w - c² exp(a w),    φ' = c v exp(a w/2) / w

f vanishes at w_1 < w_2.  On w = (w_1 + w_2)/2 - (w_2 - w_1)/2 cos θ the rate of θ is positive and smooth.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.integrate import quad
from scipy.special import exprel, lambertw

from liaisons.language import Values, closed_form
from liaisons.models.solutions.integration import integrate

_NEAREST = 1e-3  # smallest r / largest r; of closer orbits the phase at the start is known to less than 1e-10
_CIRCLE = 1e-4  # relative width of the ring below which c does not resolve the turning points (error √ε/width)


@dataclass(frozen=True, slots=True)
class Orbit:
    """Motion between two turning points; the phase θ is 0 at the inner one and π at the outer one."""

    speed: float
    a: float
    c: float
    inner: float  # w_1
    outer: float  # w_2

    @classmethod
    def through(cls, at: Values, position: NDArray, velocity: NDArray) -> Orbit:
        """Make the orbit through a position [m], (3,), with a velocity [m/s], (3,).

        :raises ValidityError: on the circle r² = 1/a or too close to it, and where it passes too close to the origin.
        """
        speed, a = float(np.linalg.norm(velocity)), at.stiffness / (3 * at.thermal_energy)
        area_rate = np.linalg.norm(np.cross(position, velocity))
        c = float(area_rate * np.exp(-a * (position @ position) / 2) / speed)
        inner, outer = (float(-lambertw(-a * c**2, branch).real) / a for branch in (0, -1))
        at.require(
            a * c**2 < np.exp(-1) and outer - inner > _CIRCLE * outer,
            f"the orbit is almost the circle of radius {a**-0.5:g} m; r is constant there",
        )
        ratio = np.sqrt(inner / outer)
        at.require(ratio >= _NEAREST, f"r falls to {ratio:.2g} of its largest value, below {_NEAREST}")
        return cls(speed, a, c, inner, outer)

    def r_squared(self, theta: ArrayLike) -> NDArray:
        """Square of the radius at a phase [m2]."""
        return self.inner + (self.outer - self.inner) * np.sin(np.asarray(theta) / 2) ** 2

    def rates(self, theta: ArrayLike) -> tuple[NDArray, NDArray]:
        """Rates of θ and of φ at a phase [rad/s]."""
        w, ends = self.r_squared(theta), (self.inner, self.outer)
        near, far = (np.where(np.cos(theta) > 0, *pair) for pair in (ends, ends[::-1]))
        # f(w)/((w - w_1)(w_2 - w)), from the nearer root, where f itself has no digits: c² exp(a w_i) = w_i
        root = np.sqrt((1 - near * self.a * exprel(self.a * (w - near))) / (far - w))
        return 2 * self.speed * root, self.c * self.speed * np.exp(self.a * w / 2) / w


@closed_form("turning points by Lambert's W, time and angle between them by quadrature, for m v² = 3 k_B T", t=">= 0")
def exact(t: NDArray, at: Values) -> dict[str, NDArray]:
    """Return position, velocity and μ at the times; orbits close to circles are refused."""
    r_0, v_0 = at.array("x_0", "y_0", "z_0"), at.array("x_dot_0", "y_dot_0", "z_dot_0")
    speed, norm = np.sqrt(3 * at.thermal_energy / at.mass), np.linalg.norm(v_0)
    at.require(
        abs(norm - speed) <= 1e-6 * speed,
        f"the start velocity {norm:.9g} m/s must be {speed:.9g} m/s: m v² = 3 k_B T",
    )
    a, moment = at.stiffness / (3 * at.thermal_energy), np.cross(r_0, v_0)
    if a == 0 or not np.any(moment):
        v = np.multiply.outer(v_0, np.ones_like(t))
        r = np.multiply.outer(r_0, np.ones_like(t)) + v * t
    else:
        orbit = Orbit.through(at, r_0, v_0)
        middle, half = (orbit.inner + orbit.outer) / 2, (orbit.outer - orbit.inner) / 2
        phase = float(np.copysign(np.arccos(np.clip((middle - r_0 @ r_0) / half, -1, 1)), r_0 @ v_0))
        theta, phi = integrate(at, lambda _, y: orbit.rates(y[0]), [phase, 0.0], t)
        theta_dot, phi_dot = orbit.rates(theta)
        distance = np.sqrt(orbit.r_squared(theta))
        rate = half * np.sin(theta) * theta_dot / (2 * distance)
        turn = np.exp(1j * phi)  # in the plane of the motion, from the direction of r_0 on
        frame = np.transpose([axis / np.linalg.norm(axis) for axis in (r_0, np.cross(moment, r_0))])
        motions = distance * turn, (rate + 1j * distance * phi_dot) * turn
        r, v = (np.tensordot(frame, [z.real, z.imag], 1) for z in motions)
    names = ("x", "y", "z", "x_dot", "y_dot", "z_dot", "mu")
    return dict(zip(names, (*r, *v, -a * np.sum(r * v, axis=0)), strict=True))


@closed_form("smallest and largest r [m], time [s] and angle [rad] from one to the other", stiffness="> 0")
def turning_points(at: Values, *, position: ArrayLike, velocity: ArrayLike) -> tuple[float, float, float, float]:
    """Return smallest and largest radius, time and angle between them.

    :param position: of a point of the orbit [m], shape (3,); ``velocity`` there [m/s], shape (3,).
    """
    r, v = np.asarray(position, dtype=float), np.asarray(velocity, dtype=float)
    at.require(np.any(np.cross(r, v)), "straight through the origin r does not turn")
    orbit = Orbit.through(at, r, v)
    half_period, _ = quad(lambda theta: 1 / orbit.rates(theta)[0], 0, np.pi, epsabs=1e-13)
    apsidal_angle, _ = quad(lambda theta: orbit.rates(theta)[1] / orbit.rates(theta)[0], 0, np.pi, epsabs=1e-13)
    return float(np.sqrt(orbit.inner)), float(np.sqrt(orbit.outer)), half_period, apsidal_angle
