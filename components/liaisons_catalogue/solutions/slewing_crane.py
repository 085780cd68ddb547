"""Steady slewing of a crane, by Euler's equations."""

from typing import Any

import numpy as np
from scipy.optimize import brentq

from liaisons.closed_forms import Values, closed_form


@closed_form("steady slewing: tan α = Ω² (R + (l + (I_t - I_a)/(m l)) sin α)/g, the load hanging outwards")
def steady_deflection(rate: float, at: Values) -> dict[str, float]:
    """Return rope_y = -α [rad], α < π/2, at the slew rate Ω [rad/s] and the trolley's radius ``travel``."""
    length = -at.load_centre_z
    arm = length + (at.load_inertia_xx - at.load_inertia_zz) / (at.load_mass * length)
    across = at.load_inertia_xx == at.load_inertia_yy
    at.require(across, "load_inertia_yy must be load_inertia_xx: a load round its rope")

    def excess(alpha: float) -> float:
        """Left side less right side, times g cos α."""
        return at.gravity * np.sin(alpha) - rate**2 * (at.travel + arm * np.sin(alpha)) * np.cos(alpha)

    root: Any = brentq(excess, 0.0, np.pi / 2, xtol=1e-15)
    return {"rope_x": 0.0, "rope_y": -float(root)}
