"""The cheapest half turn of a falling cat is a loop of constant bend; with a limited bend of the back it costs more.

M 8.2 with M 2: without twist a cat with the half axes a, b turns about a + b by ∮ A dχ, and ½ σ'·Θσ' = G χ'² + M κ'²/4
with A = J c/D, G = I J s²/D, M = I + m d² s², D = I s² + J c², s, c = sin, cos of κ/2, I and J the inertia of a half
across and about its axis, d its length to the joint.  dA is strongest at κ = 0, so Dido's circle goes round there, at
the κ of Rademaker and ter Braak and the cost 4π² G/T.  Kane and Scher's back bends less: κ cos χ >= -β is a bound.
"""

from __future__ import annotations

from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import NDArray
from scipy.integrate import quad_vec
from scipy.optimize import root

from liaisons import Plan, hamiltonian_flow, output, plan
from liaisons.models import SpatialCat
from liaisons.scenarios import Claims, dots, panels, scenario, within

FALL, BACKWARDS, ACROSS, ALONG, MASS, JOINT = 1.0, 0.7, 0.10, 0.02, 2.0, 0.2


class StiffCat(SpatialCat):
    """A falling cat whose bend towards its belly is measured; it is backwards where that is negative."""

    @output("rad", "bend towards the belly")
    def forwards(self) -> ca.SX:
        return self.bend * ca.cos(self.azimuth)


def metric(bend: Any) -> tuple[Any, Any, Any]:
    """A, G and M."""
    s, c = np.sin(bend / 2), np.cos(bend / 2)
    D = ACROSS * s**2 + ALONG * c**2
    return ALONG * c / D, ACROSS * ALONG * s**2 / D, ACROSS + MASS * JOINT**2 * s**2


def wong(*z: Any) -> Any:
    """H of (κ, χ, turn) and their momenta, that of the turn being the charge."""
    A, G, M = metric(z[0])
    return z[3] ** 2 / M + (z[4] + z[5] * A) ** 2 / (4 * G)


def along_wall(angle: float, energy: float) -> NDArray:
    """Time and turn on the wall from an azimuth to the middle of the back."""

    def paces(chi: float) -> NDArray:
        A, G, M = metric(-BACKWARDS / np.cos(chi))
        return np.array([np.sqrt((G + M * (BACKWARDS * np.sin(chi) / np.cos(chi) ** 2) ** 2 / 4) / energy), A])

    return quad_vec(paces, angle, np.pi)[0]


def shot(motion: Plan) -> float:
    """Least cost with the wall: half of the loop, from the middle of the belly, by Wong's equations."""

    def left(unknown: NDArray) -> NDArray:
        z = hamiltonian_flow(wong, [unknown[0], 0, 0, 0, *unknown[1:3]], unknown[3])
        A, G, M = metric(z[0])
        time, turn = along_wall(z[1], wong(*z))
        inwards = 2 * z[3] / M * np.cos(z[1]) - z[0] * np.sin(z[1]) * (z[4] + z[5] * A) / (2 * G)
        off = z[0] * np.cos(z[1]) + BACKWARDS
        return np.array([off, inwards, unknown[3] + time - FALL / 2, z[2] + turn - np.pi / 2])

    begin, charge = motion.sigma(0.0), motion.multipliers["q_w"] / 2
    A, G, _ = metric(begin["bend"])
    guess = [begin["bend"], 2 * G * begin["azimuth_dot"] - charge * A, charge, motion.switches[0]]
    found: Any = root(left, guess, tol=1e-13).x
    return FALL * wong(found[0], 0, 0, 0, *found[1:3])


@scenario
def main(claim: Claims) -> None:
    (shapes,) = panels(("loops of shapes", "bend towards the belly [rad]", "sideways [rad]"))
    goal: Any = {"moves": ["bend", "azimuth"], "start": {"bend": None}, "end": {"q_w": 0, "azimuth": 2 * np.pi}}
    walls = ({"bend": (0.1, 3), "forwards": (least, None)} for least in (None, -BACKWARDS))
    free, stiff = (plan(StiffCat, closed=["bend"], duration=FALL, accuracy=1e-7, bounds=wall, **goal) for wall in walls)
    circle, t = SpatialCat.bend_for(np.pi), np.linspace(0, FALL, 200)
    mesh = within(1e-9, because="relative; the mesh is of tenth order, the shooting has tolerance 1e-13")
    claim("least cost: 4π² G/T of the constant bend", free.cost * FALL / (4 * np.pi**2 * metric(circle)[1]), 1.0, mesh)
    claim("... with the bend of Rademaker and ter Braak", free.sigma(t)["bend"] / circle, 1.0, mesh)
    claim("with a limited bend: by shooting along the bound", stiff.cost / shot(stiff), 1.0, mesh)
    claim.verdicts += free.verify() + stiff.verify()
    for label, sigma in (("free", free.sigma(t)), ("stiff", stiff.sigma(t))):
        shapes.plot(*(sigma["bend"] * axis(sigma["azimuth"]) for axis in (np.cos, np.sin)), label=label)
    dots(shapes, circle * np.cos(7 * t), circle * np.sin(7 * t), label="constant bend")
    shapes.axvline(-BACKWARDS, linestyle=":", label="as far as the back gives")
