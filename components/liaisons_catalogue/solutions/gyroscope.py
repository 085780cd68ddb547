"""Steady precession of a gyroscope in gimbals."""

import numpy as np

from liaisons.closed_forms import Values, closed_form


@closed_form("steady precession, (I_1 + B - C) Ω² cos θ - I_3 ω_3 Ω + m g l = 0")
def steady_precession(theta: float, rate: float, at: Values) -> float:
    """Return the rate of the spin [rad/s] for a precession of Ω = ``rate`` [rad/s] at the angle θ [rad]."""
    at.require(rate != 0, f"rate = {rate} must not be 0")
    moment = at.rotor_mass * at.rotor_centre_z**2 + at.rotor_inertia_xx + at.inner_inertia_xx - at.inner_inertia_zz
    weight = at.rotor_mass * at.gravity * at.rotor_centre_z
    omega = (moment * rate**2 * np.cos(theta) + weight) / (at.rotor_inertia_zz * rate)
    return float(omega - rate * np.cos(theta))
