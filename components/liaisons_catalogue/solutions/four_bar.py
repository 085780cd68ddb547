"""Freudenstein's equation of the four-bar linkage."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from liaisons.closed_forms import Values, closed_form


@closed_form("Freudenstein's equation, d/a cos ψ - d/c cos φ + (a² - b² + c² + d²)/(2 a c) = cos (φ - ψ)")
def freudenstein(turn: ArrayLike, at: Values) -> dict[str, NDArray]:
    """Return the angles ``swing`` and ``elbow`` [rad] of the open loop, at angles of the crank [rad] of any shape."""
    phi = np.asarray(turn, dtype=float)
    a, b, c, d = at.elbow_at_x, at.pin_at_x, at.pin_at_child_x, at.swing_at_x
    constant = (a**2 - b**2 + c**2 + d**2) / (2 * a * c)
    M, N, P = d / a - np.cos(phi), -np.sin(phi), d / c * np.cos(phi) - constant
    cosine = P / np.hypot(M, N)
    at.require(bool(np.all(np.abs(cosine) <= 1)), f"the loop does not close at turn = {turn}")
    psi = np.arctan2(N, M) + np.arccos(cosine)
    coupler = np.arctan2(c * np.sin(psi) - a * np.sin(phi), d + c * np.cos(psi) - a * np.cos(phi))
    return {"swing": psi, "elbow": coupler - phi}
