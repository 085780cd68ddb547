"""The ellipse of a plane oscillator in polar coordinates."""

import numpy as np
from numpy.typing import NDArray

from liaisons.closed_forms import Values, closed_form


@closed_form("the ellipse of PlanarOscillator in polar coordinates, not through r = 0", phi_dot_0="!= 0")
def exact(t: NDArray, at: Values) -> dict[str, NDArray]:
    omega = np.sqrt(at.stiffness / at.mass)
    phase = omega * t
    half_turns = np.round(phase / np.pi)
    rest = phase - np.pi * half_turns  # in [-π/2, π/2], where the angle passed through is below π
    lag = t if omega == 0 else rest / omega
    cosine, sine = np.cos(rest), lag * np.sinc(rest / np.pi)  # sine is sin(rest)/Ω
    velocity = at.r_dot_0 + 1j * at.r_0 * at.phi_dot_0
    position = at.r_0 * cosine + velocity * sine  # x + i y, x along the radius at the start, but for its sign
    rate = -(omega**2) * at.r_0 * sine + velocity * cosine
    r = np.abs(position)
    return {
        "r": r,
        "phi": at.phi_0 + np.copysign(np.pi, at.phi_dot_0) * half_turns + np.angle(position),
        "r_dot": (position.conjugate() * rate).real / r,
        "phi_dot": at.phi_dot_0 * (at.r_0 / r) ** 2,
    }
