"""Names in the lines of docs/analysis_crossings.toml: mechanisms, their states, and motions by SciPy."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.integrate import solve_ivp
from scipy.linalg import expm

from liaisons import ActiveCoordinate, Coordinate, Gravity, Mechanism, Parameter, Size, System, analysis, non_holonomic
from liaisons.library import catalogue


class Skate(Mechanism):
    """Knife edge on a slope that falls towards +x."""

    mass = Parameter(0.7, "kg", "mass", above=0)
    inertia = Parameter(0.3, "kg.m2", "moment of inertia", above=0)
    gravity = Parameter(2.0, "m/s2", "gravity along the slope")
    x = Coordinate("m", "down the slope")
    y = Coordinate("m", "along the slope")
    angle = Coordinate("rad", "direction of the edge from x", start_rate=1.5)

    @non_holonomic("m/s", "speed across the edge")
    def edge(self) -> ca.SX:
        return -self.dot(self.x) * ca.sin(self.angle) + self.dot(self.y) * ca.cos(self.angle)

    def kinetic_energy(self) -> ca.SX:
        return (
            self.mass / 2 * self.speed_squared({"x": self.x, "y": self.y})
            + self.inertia / 2 * self.dot(self.angle) ** 2
        )

    def potential_energy(self) -> ca.SX:
        return -self.mass * self.gravity * self.x


class Masses(Mechanism):
    """Masses in a row, joined by springs without length."""

    n = Size(3, "number of masses")
    mass = Parameter((1.0, 2.0, 3.0), "kg", "masses", above=0, size="n")
    stiffness = Parameter(5.0, "N/m", "stiffness")
    x = Coordinate("m", "positions", start=(0.1, -0.2, 0.3), size="n")

    def kinetic_energy(self) -> ca.SX:
        return ca.dot(self.mass, self.dot(self.x) ** 2) / 2

    def potential_energy(self) -> ca.SX:
        return self.stiffness / 2 * ca.sumsqr(ca.diff(self.x))


class Cart(Mechanism):
    """Cart on a lift, whose height is prescribed."""

    mass = Parameter(2.0, "kg", "mass", above=0)
    gravity = Gravity()
    x = ActiveCoordinate("m", "height", start=0.5)

    def kinetic_energy(self) -> ca.SX:
        return self.mass / 2 * self.dot(self.x) ** 2

    def potential_energy(self) -> ca.SX:
        return self.mass * self.gravity * self.x


def close(a: Any, b: Any, tolerance: float = 1e-9) -> bool:
    """Equal up to rounding, and SciPy's tolerance of 1e-12 over a few seconds."""
    return bool(np.allclose(a, b, rtol=tolerance, atol=tolerance))


def ivp(rates: Callable[[float, NDArray], Any], start: Sequence[float], end: float = 1.0, **options: Any) -> NDArray:
    return solve_ivp(rates, (0, end), start, rtol=1e-12, atol=1e-12, method="DOP853", **options).y


def turned(rates: Callable[[float], Sequence[float]], start: Sequence[float], end: float) -> NDArray:
    """Quaternion at the end of q' = q (0, ω)/2, ω in the body frame."""

    def rate(t: float, q: NDArray) -> list[float]:
        (w, x, y, z), (a, b, c) = q, rates(t)
        return [
            -(x * a + y * b + z * c) / 2,
            (w * a + y * c - z * b) / 2,
            (w * b + z * a - x * c) / 2,
            (w * c + x * b - y * a) / 2,
        ]

    return ivp(rate, start, end)[:, -1]


def circle(names: Sequence[str], radius: float = 0.1) -> Callable[[Any], dict[str, Any]]:
    return lambda a: {names[0]: radius * ca.cos(a), names[1]: radius * ca.sin(a)}


def thermostat(_: float, y: NDArray) -> list[float]:
    q, p, xi, _eta = y
    return [p, -q - xi * p, p**2 - 1, xi]


def row(x: ArrayLike, p: ArrayLike) -> dict[str, float]:
    pairs = (("x", x), ("p_x", p))
    return {f"{name}[{i}]": v for name, column in pairs for i, v in enumerate(np.asarray(column).tolist(), start=1)}


T = np.linspace(0, 1, 101)
M, K3 = np.diag([1.0, 2.0, 3.0]), 5 * np.array([[1, -1, 0], [-1, 2, -1], [0, -1, 1.0]])
A3 = np.block([[np.zeros((3, 3)), np.linalg.inv(M)], [-K3, np.zeros((3, 3))]])  # d/dt (x, p) of Masses
x3, p3 = np.array([0.1, -0.2, 0.3]), np.array([0.5, 0.6, -0.7])
ROW = row(x3, p3)
MOTION = np.array([expm(A3 * t) @ [*x3, 0, 0, 0] for t in T]).T
SQUARE = {"x": 0.3, "y": -0.2, "p_x": 0.7, "p_y": 0.4}  # of PlanarOscillator
SWING = {"theta": 0.4, "length": 1.5, "mass": 0.8}  # of Pendulum
BODY = {"q_w": 1.0, "H_x": 1.0, "H_y": 2.0, "H_z": 3.0}  # of Satellite
H3, J3, W3 = np.array([1.0, 2, 3]), np.array([10.0, 12, 8]), 0.1
w3 = H3 / J3
THERMOSTAT = ivp(thermostat, [1.0, 1.0, 0, 0], t_eval=T)

NAMES: dict[str, Any] = {**catalogue(), **globals(), "analysis": analysis, "System": System}
