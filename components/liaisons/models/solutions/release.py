"""Bodies that leave what carries them: a bead on a sphere, and a bob on a string."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from liaisons.language import Values, closed_form
from liaisons.models.solutions import elliptic
from liaisons.models.solutions.validity import require

# ---- a bead that slides off a sphere, from rest --------------------------------------------------------------------


def _top(at: Values) -> float:
    """Angle of the start from the top [rad]."""
    distance = np.hypot(at.x_0, at.z_0)
    text = f"BeadOnSphere: x_0 = {at.x_0}, z_0 = {at.z_0}: start on the sphere, at radius = {at.radius}"
    require(abs(distance - at.radius) <= 1e-9 * at.radius and at.x_0 != 0, f"{text}, beside its top")
    return float(np.arctan2(at.x_0, at.z_0))


@closed_form("angle from the top [rad] and instant [s] at which the bead leaves the sphere", gravity="> 0")
def leaves(at: Values) -> tuple[float, float]:
    """The force m g cos θ - m r θ'² = m g (3 cos θ - 2 cos θ_0) ends at cos θ = (2/3) cos θ_0."""
    start, omega = _top(at), np.sqrt(at.gravity / at.radius)
    require(abs(start) < np.pi / 2, f"BeadOnSphere.leaves: x_0 = {at.x_0}: it starts below the equator, and falls")
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
def slide(t: NDArray, at: Values) -> dict[str, NDArray]:
    start, omega = _top(at), np.sqrt(at.gravity / at.radius)
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


# ---- a bob on a string that goes slack, pivot and length at rest ---------------------------------------------------


@closed_form(
    "height above the pivot [m] at which the string goes slack, with the speed at the lowest point [m/s]", gravity="> 0"
)
def slack_height(speed: float, at: Values) -> float:
    """(v_0² - 2gl)/3g for 2gl < v_0² < 5gl: m v²/l = m g h/l where the string carries nothing."""
    ratio = speed**2 / (at.gravity * at.length)
    require(2 < ratio < 5, f"StringPendulum.slack_height: speed = {speed}: the string stays taut")
    return (ratio - 2) / 3 * at.length


@closed_form(
    "the motion from a taut string: elliptic functions, parabolas while it is slack, and tugs that end them",
    gravity="> 0",
    bounce="== 0",
    length_dot="== 0",
    pivot_x_dot="== 0",
    pivot_z_dot="== 0",
)
def swing(t: NDArray, at: Values) -> dict[str, NDArray]:
    """The string goes slack at the angle ψ above the horizontal, at the speed u, u² = g l sin ψ.

    From there |r|² - l² = -u g cos ψ t³ + g² t⁴/4, which is 0 again at t = 4 u cos ψ/g, at the angle -3ψ.  The tug
    takes the radial velocity u (3 cos ψ sin 3ψ - sin ψ cos 3ψ).
    """
    g, length, omega = at.gravity, at.length, np.sqrt(at.gravity / at.length)
    r, v = at.array("x_0", "z_0") - at.array("pivot_x", "pivot_z"), at.array("x_dot_0", "z_dot_0")
    angle, rate = np.arctan2(r[0], -r[1]), float(r[0] * v[1] - r[1] * v[0]) / length**2
    taut = abs(np.hypot(*r) - length) <= 1e-9 * length and abs(r @ v) <= 1e-9 * length * np.hypot(*v)
    require(
        taut and rate**2 + omega**2 * np.cos(angle) >= 0, f"StringPendulum.exact: x_0 = {at.x_0}: start where it pulls"
    )
    motion: NDArray = np.zeros((6, *np.shape(t)))
    begin, lost = 0.0, 0.0
    while begin <= np.max(t):
        angles, rates = elliptic.pendulum(t - begin, angle, rate, omega)
        sine, cosine = length * np.sin(angles), length * np.cos(angles)
        pull = at.mass * (length * rates**2 + g * np.cos(angles))
        now = sine, -cosine, cosine * rates, sine * rates, pull, np.full_like(sine, lost)
        motion = np.where(t >= begin, now, motion)
        rising = (rate / omega) ** 2 / 3 - 2 / 3 * np.cos(angle)  # sin ψ
        if not 0 < rising < 1:
            break
        sense, psi, u = np.sign(rate), np.arcsin(rising), np.sqrt(g * length * rising)
        slack = sense * (np.pi / 2 + psi)
        begin += elliptic.duration((angle, rate), (slack, sense * u / length), omega)
        since = t - begin
        across, up = -sense * u * np.sin(psi), u * np.cos(psi)
        now = (
            sense * length * np.cos(psi) + across * since,
            length * rising + (up - g / 2 * since) * since,
            np.full_like(since, across),
            up - g * since,
            np.zeros_like(since),
            np.full_like(since, lost),
        )
        motion = np.where(since >= 0, now, motion)
        begin += 4 * up / g
        angle = sense * (np.pi / 2 - 3 * psi)
        rate = -sense * u / length * (np.sin(psi) * np.sin(3 * psi) + 3 * np.cos(psi) * np.cos(3 * psi))
        lost += at.mass / 2 * (u * (3 * np.cos(psi) * np.sin(3 * psi) - np.sin(psi) * np.cos(3 * psi))) ** 2
    names = ("x", "z", "x_dot", "z_dot", "slack_force", "impact_loss")
    motion[0] += at.pivot_x
    motion[1] += at.pivot_z
    return dict(zip(names, motion, strict=True))
