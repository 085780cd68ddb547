"""For a skate on a slope, the path of least action among those that its edge allows is not d'Alembert's motion.

M 1 and 3.2: paths k that satisfy a non-holonomic constraint have variations with C δk ≠ 0.  Hölder's principle requires
⟨δI, w⟩ = 0 for C w = 0, which is the FMU's motion.  Least action requires ⟨δI, δk⟩ = 0.  This gives the vakonomic
equations, Hamilton's equations with the maximum of p·v - L, H = (p_x cos φ + p_y sin φ)²/2m + p_φ²/2I - m g x, solved
here by shooting between the ends of the FMU's path.
"""

from __future__ import annotations

from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline
from scipy.optimize import fsolve

from liaisons import Coordinate, Mechanism, Parameter, analysis, hamiltonian_flow, non_holonomic, simulate
from liaisons.scenarios import Claims, panels, scenario, within

INERTIA, GRAVITY, SPIN, T = 0.3, 2.0, 1.5, 2.0  # kg.m2, m/s2, rad/s, s; 1 kg
NAMES = ("x", "y", "angle")


class Skate(Mechanism):
    """Knife edge on a slope, which cannot move across its own direction."""

    mass = Parameter(1.0, "kg", "mass", above=0)
    inertia = Parameter(INERTIA, "kg.m2", "moment of inertia", above=0)
    gravity = Parameter(GRAVITY, "m/s2", "gravity along the slope, towards +x")
    x, y = Coordinate("m", "down the slope"), Coordinate("m", "along the slope")
    angle = Coordinate("rad", "direction of the edge from x", start_rate=SPIN)

    @non_holonomic("m/s", "speed across the edge")
    def edge(self) -> ca.SX:
        return -self.dot(self.x) * ca.sin(self.angle) + self.dot(self.y) * ca.cos(self.angle)

    def kinetic_energy(self) -> ca.SX:
        return (
            self.mass / 2 * (self.dot(self.x) ** 2 + self.dot(self.y) ** 2)
            + self.inertia / 2 * self.dot(self.angle) ** 2
        )

    def potential_energy(self) -> ca.SX:
        return -self.mass * self.gravity * self.x


def H(x: Any, _: Any, phi: Any, p_x: Any, p_y: Any, p_phi: Any) -> Any:  # noqa: N802
    return (p_x * np.cos(phi) + p_y * np.sin(phi)) ** 2 / 2 + p_phi**2 / (2 * INERTIA) - GRAVITY * x


def slopes(t: NDArray, z: NDArray, u: NDArray, turning: NDArray) -> tuple[float, list[float], NDArray, NDArray]:
    """S of a path; ⟨δI, ·⟩ for w along the edge, w = (0, 0, s), and δk that turns by s and ends alike; s; C δk."""
    s, s_dot = np.sin(np.pi * t / T) ** 2, np.pi / T * np.sin(2 * np.pi * t / T)
    e = np.exp(1j * z[2])  # along the edge, in x + iy
    rates = np.array([e, t * e, 1j * u * s * e])
    places = CubicSpline(t, rates, axis=1).antiderivative()(t)
    a = np.append(np.linalg.solve(*np.split(-np.array([places.real, places.imag])[:, :, -1], [2], axis=1)), -1)
    parts = [(s * e, s_dot * e + 1j * s * e * turning, 0), (0 * e, 0 * e, 1), (-a @ places, -a @ rates, 1)]
    path: Any = dict(zip((*NAMES, "x_dot", "y_dot", "angle_dot"), [*z, u * e.real, u * e.imag, turning], strict=True))
    found = []
    for place, rate, turn in parts:
        w = {"x": place.real, "y": place.imag, "x_dot": rate.real, "y_dot": rate.imag}
        found.append(analysis.action(Skate, t, path, w | {"angle": turn * s, "angle_dot": turn * s_dot}))
    return found[0].action, [action.first for action in found], s, np.imag(parts[2][0] / e)


@scenario
def main(claim: Claims) -> None:
    run = simulate(Skate, stop_time=T, step_size=T / 400, tolerance=1e-12)
    t, skated = run.time, np.array([run[name] for name in NAMES])
    start: Any = fsolve(lambda p: hamiltonian_flow(H, [0, 0, 0, *p], T)[:3] - skated[:, -1], [0.5] * 3, xtol=1e-13)
    least = hamiltonian_flow(H, [0, 0, 0, *start], t)
    p, turning = (least[3] + 1j * least[4]) * np.exp(-1j * least[2]), least[5] / INERTIA  # p along and across the edge
    bound = within(1e-8, "J.s", because="cubic interpolation and quadrature, h⁴/180 = 3e-12 times derivatives of 1e3")
    u = run["x_dot"] * np.cos(run["angle"]) + run["y_dot"] * np.sin(run["angle"])
    S, first, s, off = slopes(t, skated, u, run["angle_dot"])
    work = -CubicSpline(t, run["lambda_edge"] * off).integrate(0, T)
    claim("d'Alembert: ⟨δI, w⟩ = 0 for w compatible with the edge", first[:2], 0.0, bound)
    claim(f"d'Alembert: ⟨δI, δk⟩ = -∫ λ C δk dt = {work:.3f} J.s, of paths that keep it", first[2], work, bound)
    S_least, first, *_ = slopes(t, least[:3], p.real, turning)
    defect = CubicSpline(t, p.imag * s * np.array([-turning, p.real]), axis=1).integrate(0, T)
    claim(f"least action: ⟨δI, w⟩ = {np.round(defect, 3)} J.s", first[:2], defect, bound)
    claim("least action: ⟨δI, δk⟩ = 0", first[2], 0.0, bound)
    claim.below(f"S = {S_least:.2f} J.s, not {S:.2f} J.s", S_least, S, within(0.0, "J.s", because="an inequality"))
    (path,) = panels(("a skate on a slope, in 2 s", "y [m]", "x, downwards [m]"))
    for label, z in (("d'Alembert (FMU)", skated), ("least action", least)):
        path.plot(z[1], z[0], label=label)
    path.invert_yaxis()
