"""A pendulum whose pivot moves to and fro."""

from referee.bodies import body, joint
from referee.task import GRAVITY, Equations, Task, cos, integrated, sin, sinusoid

PIVOT = sinusoid(0.0, 0.1, 3.0)
START = 0.3  # [rad]


def rates(t, y):
    theta, rate, _ = y
    _, x_dot, x_ddot = PIVOT(t)
    return [rate, -GRAVITY * sin(theta) - x_ddot * cos(theta), force(t, y) * x_dot]


def force(t, y):
    """Horizontal momentum of the bob: m (x'' + θ'' cos θ - θ'² sin θ)."""
    theta, rate, _ = y
    x_ddot = PIVOT(t)[2]
    theta_ddot = -GRAVITY * sin(theta) - x_ddot * cos(theta)
    return x_ddot + theta_ddot * cos(theta) - rate**2 * sin(theta)


def energy(t, y):
    theta, rate, _ = y
    x_dot = PIVOT(t)[1]
    return (x_dot**2 + 2 * x_dot * rate * cos(theta) + rate**2) / 2 - GRAVITY * cos(theta)


EQUATIONS = Equations(rates, [START, 0.0, 0.0], energy)
TASK = Task(
    "moving pivot",
    stop=9.6,
    bodies=body(
        "cart",
        joint("pivot", "slide", "1 0 0"),
        mass=1.0,
        inside=body("rod", joint("theta", "hinge", "0 -1 0"), mass=1.0, centre="0 0 -1"),
    ),
    motions={"pivot": PIVOT},
    asked=[("theta",)],
    start={"theta": (START, 0.0)},
    answer=integrated(EQUATIONS, [0], force),
    checks=lambda: EQUATIONS.checks(9.6),
    carrier=1.0,
    component="Pendulum",
    start_values={"theta_0": START},
    ports={"pivot": "pivot_x"},
    signals=["theta"],
)
