"""Kapitza's pendulum: upright on a pivot that shakes up and down."""

import math

from referee.bodies import body, joint
from referee.task import GRAVITY, Equations, Task, cos, integrated, sin, sinusoid

PIVOT = sinusoid(0.0, 0.1, 50.0)
START = math.pi - 0.1  # [rad]


def rates(t, y):
    theta, rate, _ = y
    _, z_dot, z_ddot = PIVOT(t)
    return [rate, -(GRAVITY + z_ddot) * sin(theta), force(t, y) * z_dot]


def force(t, y):
    """Vertical momentum of the bob: m (g + z'' + θ'' sin θ + θ'² cos θ)."""
    theta, rate, _ = y
    z_ddot = PIVOT(t)[2]
    theta_ddot = -(GRAVITY + z_ddot) * sin(theta)
    return GRAVITY + z_ddot + theta_ddot * sin(theta) + rate**2 * cos(theta)


def energy(t, y):
    theta, rate, _ = y
    z, z_dot, _ = PIVOT(t)
    return (z_dot**2 + 2 * z_dot * rate * sin(theta) + rate**2) / 2 + GRAVITY * (z - cos(theta))


EQUATIONS = Equations(rates, [START, 0.0, 0.0], energy)
TASK = Task(
    "Kapitza",
    stop=1.6,
    bodies=body(
        "lift",
        joint("pivot", "slide", "0 0 1"),
        mass=1.0,
        inside=body("rod", joint("theta", "hinge", "0 -1 0"), mass=1.0, centre="0 0 -1"),
    ),
    motions={"pivot": PIVOT},
    asked=[("theta",)],
    start={"theta": (START, 0.0)},
    answer=integrated(EQUATIONS, [0], force),
    checks=lambda: EQUATIONS.checks(1.6),
    carrier=1.0,
    weight=GRAVITY,
    component="Pendulum",
    start_values={"theta_0": START},
    ports={"pivot": "pivot_z"},
    signals=["theta"],
)
