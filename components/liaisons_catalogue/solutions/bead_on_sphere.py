"""A bead that slides from rest on a sphere, and leaves it."""

import numpy as np
from numpy.typing import NDArray

from liaisons.closed_forms import Values, closed_form
from liaisons_catalogue.solutions import elliptic


def _start_angle(at: Values) -> float:
    """Start angle from the top [rad]; raise a ValidityError unless the start lies on the sphere."""
    distance = np.hypot(at.x_0, at.z_0)
    text = f"BeadOnSphere: x_0 = {at.x_0}, z_0 = {at.z_0}: start on the sphere, at radius = {at.radius}"
    at.require(abs(distance - at.radius) <= 1e-9 * at.radius and at.x_0 != 0, f"{text}, beside its top")
    return float(np.arctan2(at.x_0, at.z_0))


@closed_form("angle from the top [rad] and instant [s] at which the bead leaves the sphere", gravity="> 0")
def leaves(at: Values) -> tuple[float, float]:
    """Return angle and instant: the force m g (3 cos θ - 2 cos θ_0) ends at cos θ = (2/3) cos θ_0."""
    start, omega = _start_angle(at), np.sqrt(at.gravity / at.radius)
    at.require(abs(start) < np.pi / 2, f"x_0 = {at.x_0}: it starts below the equator, and falls")
    angle = np.copysign(np.arccos(2 / 3 * np.cos(start)), start)
    rate = omega * np.copysign(np.sqrt(2 / 3 * np.cos(start)), start)
    # An upside-down pendulum: measured from the bottom its angle is π + θ.
    return float(angle), elliptic.duration((np.pi + start, 0.0), (np.pi + angle, rate), omega)


@closed_form(
    "the motion from rest: elliptic functions on the sphere, then a parabola",
    gravity="> 0",
    x_dot_0="== 0",
    z_dot_0="== 0",
)
def exact(t: NDArray, at: Values) -> dict[str, NDArray]:
    start, omega = _start_angle(at), np.sqrt(at.gravity / at.radius)
    _, instant = leaves(at=at)
    angle, rate = elliptic.pendulum(np.minimum(t, instant), np.pi + start, 0.0, omega)
    x, z = -at.radius * np.sin(angle), -at.radius * np.cos(angle)
    force = at.mass * at.gravity * (2 * np.cos(start) + 3 * np.cos(angle))
    since = np.maximum(t - instant, 0.0)
    x_dot, z_dot = z * rate, -x * rate
    return {
        "x": x + x_dot * since,
        "z": z + (z_dot - at.gravity / 2 * since) * since,
        "x_dot": x_dot,
        "z_dot": z_dot - at.gravity * since,
        "gap_force": np.where(t < instant, -force, 0.0),
    }
