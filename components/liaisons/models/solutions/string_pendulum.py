"""A bob on a string that goes slack, pivot and length at rest."""

import numpy as np
from numpy.typing import NDArray

from liaisons.language import Values, closed_form
from liaisons.models.solutions import elliptic


@closed_form(
    "height above the pivot [m] at which the string goes slack, with the speed at the lowest point [m/s]", gravity="> 0"
)
def slack_height(speed: float, at: Values) -> float:
    """Return the height (v_0² - 2gl)/3g, for 2gl < v_0² < 5gl: m v²/l = m g h/l where the force of the string is 0."""
    ratio = speed**2 / (at.gravity * at.length)
    at.require(2 < ratio < 5, f"speed = {speed}: the string stays taut")
    return (ratio - 2) / 3 * at.length


@closed_form(
    "the motion from a taut string: elliptic functions, parabolas while it is slack, and tugs that end them",
    gravity="> 0",
    bounce="== 0",
    length_dot="== 0",
    pivot_x_dot="== 0",
    pivot_z_dot="== 0",
)
def exact(t: NDArray, at: Values) -> dict[str, NDArray]:
    """Return motion, force of the string and loss by its tugs.

    The string goes slack at the angle ψ above the horizontal, at the speed u, u² = g l sin ψ.  From there
    |r|² - l² = -u g cos ψ t³ + g² t⁴/4, which is 0 again at t = 4 u cos ψ/g, at the angle -3ψ.  The tug takes the
    radial velocity u (3 cos ψ sin 3ψ - sin ψ cos 3ψ).
    """
    g, length, omega = at.gravity, at.length, np.sqrt(at.gravity / at.length)
    r, v = at.array("x_0", "z_0") - at.array("pivot_x", "pivot_z"), at.array("x_dot_0", "z_dot_0")
    angle, rate = np.arctan2(r[0], -r[1]), float(r[0] * v[1] - r[1] * v[0]) / length**2
    taut = abs(np.hypot(*r) - length) <= 1e-9 * length and abs(r @ v) <= 1e-9 * length * np.hypot(*v)
    at.require(taut and rate**2 + omega**2 * np.cos(angle) >= 0, f"x_0 = {at.x_0}: start where it pulls")
    motion: NDArray = np.zeros((6, *np.shape(t)))
    begin, lost = 0.0, 0.0
    while begin <= np.max(t):
        angles, rates = elliptic.pendulum(t - begin, angle, rate, omega)
        sine, cosine = length * np.sin(angles), length * np.cos(angles)
        pull = at.mass * (length * rates**2 + g * np.cos(angles))
        state = sine, -cosine, cosine * rates, sine * rates, pull, np.full_like(sine, lost)
        motion = np.where(t >= begin, state, motion)
        rising = (rate / omega) ** 2 / 3 - 2 / 3 * np.cos(angle)  # sin ψ
        if not 0 < rising < 1:
            break
        sense, psi, u = np.sign(rate), np.arcsin(rising), np.sqrt(g * length * rising)
        slack = sense * (np.pi / 2 + psi)
        begin += elliptic.duration((angle, rate), (slack, sense * u / length), omega)
        since = t - begin
        across, up = -sense * u * np.sin(psi), u * np.cos(psi)
        state = (
            sense * length * np.cos(psi) + across * since,
            length * rising + (up - g / 2 * since) * since,
            np.full_like(since, across),
            up - g * since,
            np.zeros_like(since),
            np.full_like(since, lost),
        )
        motion = np.where(since >= 0, state, motion)
        begin += 4 * up / g
        angle = sense * (np.pi / 2 - 3 * psi)
        rate = -sense * u / length * (np.sin(psi) * np.sin(3 * psi) + 3 * np.cos(psi) * np.cos(3 * psi))
        lost += at.mass / 2 * (u * (3 * np.cos(psi) * np.sin(3 * psi) - np.sin(psi) * np.cos(3 * psi))) ** 2
    names = ("x", "z", "x_dot", "z_dot", "slack_force", "impact_loss")
    motion[0] += at.pivot_x
    motion[1] += at.pivot_z
    return dict(zip(names, motion, strict=True))
