"""Names in the lines of docs/crossing_lines.toml: mechanisms, their states, and motions by SciPy."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import casadi as ca
import numpy as np
import pytest
from bodies import Skate  # noqa: F401 - in lines
from numpy.typing import ArrayLike, NDArray
from scipy.integrate import solve_ivp
from scipy.linalg import expm, solve_continuous_are
from subjects import Buffered, Rods  # noqa: F401 - in lines

from liaisons import (
    ActiveCoordinate,
    Body,
    Controller,
    Coordinate,
    Gravity,
    InternalState,
    Linkage,
    Mechanism,
    Parameter,
    Plan,
    Prismatic,
    Size,
    System,  # noqa: F401 - in lines, as are the functions
    analysis,  # noqa: F401
    constraint,
    ground,
    hold,  # noqa: F401
    non_holonomic,
    observe,  # noqa: F401
    plan,  # noqa: F401
)
from liaisons.library import catalogue


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


class Slides(Linkage):
    """A mass on two slides at right angles, each with a spring: a PlanarOscillator by joints."""

    slide, bob = Body(), Body(mass=1.0)
    x = Prismatic(ground, slide, axis="x", stiffness=1.0, start=1.0)
    y = Prismatic(slide, bob, axis="y", stiffness=1.0, start_rate=0.5)


class Trolley(Linkage):
    """A load that a spring binds to a trolley, which an operator moves: u'' = -4 u - s''."""

    trolley, load = Body(mass=3.0), Body(mass=2.0)
    s = Prismatic(ground, trolley, axis="x", prescribed=True)
    u = Prismatic(trolley, load, axis="x", stiffness=8.0)


class EdgedSkate(Mechanism):
    """Skate on ice whose edge an operator turns: y' = x' tan(heading), at constant speed."""

    mass = Parameter(2.0, "kg", "mass", above=0)
    x = Coordinate("m", "along x")
    y = Coordinate("m", "along y")
    heading = ActiveCoordinate("rad", "direction of the edge")

    @non_holonomic("m/s", "speed across the edge")
    def edge(self) -> ca.SX:
        return self.dot(self.x) * ca.sin(self.heading) - self.dot(self.y) * ca.cos(self.heading)

    def kinetic_energy(self) -> ca.SX:
        return self.mass / 2 * self.speed_squared({"x": self.x, "y": self.y})


class Thermostat(Mechanism):
    """x'' = 4 (support - x) - z x', z' = (support - z)/lag."""

    mass = Parameter(1.0, "kg", "mass", above=0)
    stiffness = Parameter(4.0, "N/m", "stiffness", above=0)
    lag = Parameter(0.5, "s", "lag", above=0)
    scale = Parameter(1.0, "m.s", "support at which the friction is 1/s", above=0)
    x = Coordinate("m", "position")
    support = ActiveCoordinate("m", "position of the support")
    z = InternalState("1/s", "friction")

    def kinetic_energy(self) -> ca.SX:
        return self.mass / 2 * self.dot(self.x) ** 2

    def potential_energy(self) -> ca.SX:
        return self.stiffness / 2 * (self.x - self.support) ** 2

    def friction_coefficient(self) -> ca.SX:
        return self.z

    def internal_rates(self) -> dict[str, ca.SX]:
        return {"z": (self.support / self.scale - self.z) / self.lag}


class Bead(Mechanism):
    """Bead on a circle, a passive constraint, on a spring whose support an operator moves."""

    mass = Parameter(1.0, "kg", "mass", above=0)
    stiffness = Parameter(4.0, "N/m", "stiffness", above=0)
    gravity = Gravity()
    radius = Parameter(1.0, "m", "radius", above=0)
    x = Coordinate("m", "horizontal position")
    z = Coordinate("m", "height", start=-1.0)
    pivot = ActiveCoordinate("m", "position of the support")

    @constraint("m", "distance from the circle")
    def circle(self) -> ca.SX:
        return ca.sqrt(self.x**2 + self.z**2) - self.radius

    def kinetic_energy(self) -> ca.SX:
        return self.mass / 2 * self.speed_squared({"x": self.x, "z": self.z})

    def potential_energy(self) -> ca.SX:
        return self.mass * self.gravity * self.z + self.stiffness / 2 * (self.x - self.pivot) ** 2


class Wagons(Mechanism):
    """Wagons in a row, bound by springs, the first one to a hook that an operator moves."""

    n = Size(3, "number of wagons")
    mass = Parameter((1.0, 2.0, 3.0), "kg", "masses", above=0, size="n")
    stiffness = Parameter(5.0, "N/m", "stiffness of the springs", minimum=0)
    x = Coordinate("m", "displacements", size="n")
    hook = ActiveCoordinate("m", "displacement of the hook")

    def kinetic_energy(self) -> ca.SX:
        return ca.dot(self.mass, self.dot(self.x) ** 2) / 2

    def potential_energy(self) -> ca.SX:
        return self.stiffness / 2 * (ca.sumsqr(ca.diff(self.x)) + (self.x[0] - self.hook) ** 2)


def least(A: NDArray, B: NDArray, duration: float, end: NDArray) -> float:
    """Least ∫ u² dt by which x' = A x + B u goes from 0 to the end: Kalman's Gramian, by Van Loan's exponential."""
    n = len(A)
    E = expm(np.block([[A, B @ B.T], [0 * A, -A.T]]) * duration)
    return float(end @ np.linalg.solve(E[:n, n:] @ E[:n, :n].T, end))


def drawn(masses: Sequence[float], stiffness: float) -> tuple[NDArray, NDArray]:
    """A and B of masses in a row on springs, the first one on a hook of acceleration u; x, x', hook, hook'."""
    n = len(masses)
    K = stiffness * (np.diag([2.0] * (n - 1) + [1.0]) - np.eye(n, k=1) - np.eye(n, k=-1))
    A = np.zeros((2 * n + 2,) * 2)
    A[:n, n : 2 * n] = np.eye(n)
    A[n : 2 * n, :n] = -K / np.c_[masses]
    A[n, 2 * n], A[2 * n, 2 * n + 1] = stiffness / masses[0], 1.0
    return A, np.eye(2 * n + 2)[:, -1:]


def filtered(A: ArrayLike, G: ArrayLike, C: ArrayLike, noise: float = 0.01, push: float = 0.1) -> NDArray:
    """Standard deviations of the Kalman-Bucy filter of x' = A x + G w, y = C x + v."""
    A, G, C = (np.array(matrix, dtype=float) for matrix in (A, G, C))
    return np.sqrt(np.diag(solve_continuous_are(A.T, C.T, push**2 * G @ G.T, noise**2 * np.eye(len(C)))))


def left(controller: Controller, stop_time: float, **start: Any) -> float:
    """What is left of a deviation, relative to sizes."""
    run = controller.simulate(stop_time, start_values=start)
    return float(np.abs(controller.deviation(run)[:, -1] / controller.sizes).max())


def thermostat_end(motion: Plan) -> NDArray:
    def rates(t: float, y: NDArray) -> list[float]:
        support = float(motion.sigma(t)["support"])
        return [y[1], 4 * (support - y[0]) - y[2] * y[1], (support - y[2]) / 0.5]

    return ivp(rates, [0, 0, 0], 2.0)[:, -1]


def close(a: Any, b: Any, tolerance: float = 1e-12) -> bool:
    """Equal up to rounding; what is integrated at 1e-11 or 1e-12 has a tolerance of its own."""
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


def circle(
    names: Sequence[str], radius: float = 0.1, centre: Sequence[float] = (0.0, 0.0)
) -> Callable[[Any], dict[str, Any]]:
    return lambda a: dict(zip(names, (centre[0] + radius * ca.cos(a), centre[1] + radius * ca.sin(a)), strict=True))


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

NAMES: dict[str, Any] = {**catalogue(), **globals(), "approx": pytest.approx}
