"""A bob on a string that goes slack, pivot and length at rest."""

import numpy as np
from numpy.typing import NDArray

from liaisons.closed_forms import Values, closed_form
from liaisons_catalogue.solutions import elliptic


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
    pivot = complex(at.pivot_x, at.pivot_z)  # x + i z: the bob at the angle θ from below is at -i l exp(iθ)
    position, velocity = complex(at.x_0, at.z_0) - pivot, complex(at.x_dot_0, at.z_dot_0)
    angle, along = _polar_motion(position, velocity)
    taut = abs(abs(position) - length) <= 1e-9 * length and abs(along.imag) <= 1e-9 * abs(velocity)
    rate = along.real / length
    at.require(taut and rate**2 + omega**2 * np.cos(angle) >= 0, f"x_0 = {at.x_0}: start where it pulls")
    motion: NDArray[np.complex128] = np.zeros((4, *np.shape(t)), dtype=complex)
    begin, lost = 0.0, 0.0
    while begin <= np.max(t):
        angles, rates = elliptic.pendulum(t - begin, angle, rate, omega)
        pull = at.mass * (length * rates**2 + g * np.cos(angles))
        direction = np.exp(1j * angles)  # of the velocity
        state = -1j * length * direction, length * rates * direction, pull, lost
        motion = np.where(t >= begin, np.broadcast_arrays(*state), motion)
        rising = (rate / omega) ** 2 / 3 - 2 / 3 * np.cos(angle)  # sin ψ
        if not 0 < rising < 1:
            break
        slack, slack_rate = np.sign(rate) * (np.pi / 2 + np.arcsin(rising)), np.sign(rate) * omega * np.sqrt(rising)
        begin += elliptic.duration((angle, rate), (slack, slack_rate), omega)
        r, v = -1j * length * np.exp(1j * slack), length * slack_rate * np.exp(1j * slack)
        since, flight = t - begin, float(4 * v.imag / g)
        state = r + (v - 0.5j * g * since) * since, v - 1j * g * since, 0.0, lost
        motion = np.where(since >= 0, np.broadcast_arrays(*state), motion)
        begin += flight
        angle, along = _polar_motion(r + (v - 0.5j * g * flight) * flight, v - 1j * g * flight)
        rate, lost = along.real / length, lost + at.mass / 2 * along.imag**2
    (x, x_dot), (z, z_dot) = motion[:2].real, motion[:2].imag
    force, loss = motion[2:].real
    signals = {"x": x + at.pivot_x, "z": z + at.pivot_z, "x_dot": x_dot, "z_dot": z_dot}
    return signals | {"slack_force": force, "impact_loss": loss}


def _polar_motion(position: complex, velocity: complex) -> tuple[float, complex]:
    """Angle from below [rad], and velocity [m/s]: across the string, and inwards as imaginary part."""
    direction = 1j * position / abs(position)
    return float(np.angle(direction)), velocity * direction.conjugate()
