"""Liouville's theorem: a cloud of pendulums winds up into a spiral in phase space, and its area stays the same.

K 3.4, eq. 95-103, without friction; with friction the area shrinks as e^(-ηt).  Large swings are slower than small
ones, so the disc is sheared more and more.  Its area is measured in two ways: from the polygon that the rim has become,
and from the Jacobian determinant of the flow at every member, computed from four neighbours.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from liaisons import ensemble
from liaisons.models import Pendulum
from liaisons.scenarios import Claims, panels, scenario, within

CENTRE, RADIUS = (1.0, 0.5), 0.8  # θ, p_θ/(m l² Ω), Ω = 1
STOP, SAMPLES, MEMBERS, NEIGHBOUR = 60.0, 4, 20_000, 1e-5


def disc(angle: NDArray, radius: NDArray | float) -> NDArray:
    """Points of the cloud, (2, members)."""
    return np.array([CENTRE[0] + radius * np.cos(angle), CENTRE[1] + radius * np.sin(angle)])


def carried(points: NDArray, friction: float) -> NDArray:
    """Where the flow has carried the points, (2, times, members)."""
    start = {"theta_0": points[0], "theta_dot_0": points[1], "gravity": 1.0, "friction": friction}
    return ensemble(Pendulum, start, stop_time=STOP, step_size=0.05, samples=SAMPLES, estimate=False).values


def determinant(points: NDArray, friction: float) -> NDArray:
    """det ∂(end)/∂(start) at each point, by central differences."""

    def slope(shift: NDArray) -> NDArray:
        ahead, behind = (carried(points + sign * shift, friction)[:, -1] for sign in (1, -1))
        return (ahead - behind) / (2 * NEIGHBOUR)

    (a, c), (b, d) = (slope(NEIGHBOUR * axis[:, None]) for axis in np.eye(2))
    return a * d - b * c


@scenario
def main(claim: Claims) -> None:
    why = "error of the polygon: (2π/20000)²/6 = 2e-8 times the stretching (up to 25), and its square at bends"
    polygon = within(1e-5, because=why)
    why = "finite differences: (1e-5)² times third derivatives and stretching, up to 1e5; rounding 1e-13/1e-5"
    differences = within(1e-4, because=why)
    frictions = (0.0, 0.02)
    axes = panels(*((f"η = {eta} /s", "θ [rad]", "p$_θ$/(m l² Ω)") for eta in frictions), size=(13, 4.5), sharey=True)
    for axis, eta in zip(axes, frictions, strict=True):
        x, y = rim = carried(disc(2 * np.pi * np.arange(MEMBERS) / MEMBERS, RADIUS), eta)
        # ½ ∮ (x_1 dx_2 - x_2 dx_1) of closed polygons, one a time
        area = np.sum(x * np.roll(y, -1, axis=-1) - np.roll(x, -1, axis=-1) * y, axis=-1) / 2
        lengths = np.sum(np.abs(np.diff(rim, axis=-1, append=rim[..., :1])), axis=(0, 2))
        expected = np.exp(-eta * np.linspace(0, STOP, SAMPLES + 1))
        text = f"η = {eta}: the rim, {lengths[-1] / lengths[0]:.0f} times as long, encloses e^(-ηt) of its area"
        claim(text, area / (np.pi * RADIUS**2), expected, polygon)
        random = np.random.default_rng(1)
        members = disc(random.uniform(0, 2 * np.pi, MEMBERS), RADIUS * np.sqrt(random.random(MEMBERS)))
        determinants = determinant(members[:, :2000], eta)
        claim(f"η = {eta}: the Jacobi determinant of every member is e^(-ηt)", determinants, expected[-1], differences)
        theta, momentum = carried(members, eta)
        for k in range(0, SAMPLES + 1, 2):
            axis.plot(theta[k], momentum[k], ".", markersize=0.5, label=f"{k * STOP / SAMPLES:g} s")
        axis.legend(loc="upper right", markerscale=20)
