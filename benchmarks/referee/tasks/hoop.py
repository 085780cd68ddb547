"""A bead on a hoop that turns about a point off its centre, ever faster."""

from referee.bodies import body, joint
from referee.task import Equations, Task, cos, integrated, sin

OFFSET, INERTIA = 0.5, 0.1  # [m], [kg.m2]; radius 1 m, mass 1 kg
START = (1.0, 1.0)  # [rad], [rad/s]


def turn(t):
    return 2 * t + t * t / 4, 2 + t / 2, 0.5


def psi_ddot(t, y):
    _, b_dot, b_ddot = turn(t)
    return -b_ddot - OFFSET * (b_ddot * cos(y[0]) + b_dot**2 * sin(y[0]))


def rates(t, y):
    return [y[1], psi_ddot(t, y), force(t, y) * turn(t)[1]]


def force(t, y):
    """Rate of the angular momentum about O."""
    psi, rate, _ = y
    _, b_dot, b_ddot = turn(t)
    acceleration = psi_ddot(t, y)
    d = OFFSET
    tangential = d * (cos(psi) * (2 * b_ddot + acceleration) - sin(psi) * rate * (2 * b_dot + rate))
    return (d**2 + INERTIA) * b_ddot + b_ddot + acceleration + tangential


def energy(t, y):
    psi, rate, _ = y
    b_dot = turn(t)[1]
    spin = b_dot + rate
    return ((OFFSET**2 + INERTIA) * b_dot**2 + spin**2 + 2 * OFFSET * b_dot * spin * cos(psi)) / 2


EQUATIONS = Equations(rates, [*START, 0.0], energy)
TASK = Task(
    "hoop speeds up",
    stop=4.0,
    bodies=body(
        "hoop",
        joint("beta", "hinge"),
        inertia=(INERTIA, INERTIA, INERTIA),
        inside=body("bead", joint("psi", "hinge"), at=f"{OFFSET} 0 0", mass=1.0, centre="1 0 0"),
    ),
    motions={"beta": turn},
    asked=[("psi",)],
    start={"psi": START},
    answer=integrated(EQUATIONS, [0], force),
    checks=lambda: EQUATIONS.checks(4.0),
    component="CircularHoop",
    start_values={"xi_0": START[0], "xi_dot_0": START[1], "hoop_inertia": INERTIA},
    ports={"beta": "beta"},
    signals=["xi"],
)
