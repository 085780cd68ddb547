"""A pendulum whose length an operator pumps twice a period."""

from referee.bodies import body, joint
from referee.task import GRAVITY, Equations, Task, cos, integrated, sin, sinusoid

LENGTH = sinusoid(1.0, 0.15, 6.2642)
START = 0.3  # [rad]


def rates(t, y):
    theta, rate, _ = y
    l, l_dot, _ = LENGTH(t)
    return [rate, -(GRAVITY * sin(theta) + 2 * l_dot * rate) / l, force(t, y) * l_dot]


def force(t, y):
    """Along the rod: m (l'' - l θ'² - g cos θ)."""
    l, _, l_ddot = LENGTH(t)
    return l_ddot - l * y[1] ** 2 - GRAVITY * cos(y[0])


def energy(t, y):
    l, l_dot, _ = LENGTH(t)
    return (l_dot**2 + l**2 * y[1] ** 2) / 2 - GRAVITY * l * cos(y[0])


EQUATIONS = Equations(rates, [START, 0.0, 0.0], energy)
TASK = Task(
    "pumped length",
    stop=4.0,
    bodies=body(
        "rod",
        joint("theta", "hinge", "0 -1 0"),
        inside=body("bob", joint("length", "slide", "0 0 -1"), mass=1.0),
    ),
    motions={"length": LENGTH},
    asked=[("theta",)],
    start={"theta": (START, 0.0)},
    answer=integrated(EQUATIONS, [0], force),
    checks=lambda: EQUATIONS.checks(4.0),
    component="Pendulum",
    start_values={"theta_0": START},
    ports={"length": "length"},
    signals=["theta"],
)
