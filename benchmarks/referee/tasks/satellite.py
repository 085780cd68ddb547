"""A satellite that tumbles while all of its three wheels are turned."""

from referee.bodies import body, joint
from referee.task import Equations, Task, integrated, sinusoid

J, WHEEL = (10.0, 12.0, 8.0), 0.1  # [kg.m2], with the wheels locked
TURNS = (sinusoid(0.0, 40.0, 0.7), sinusoid(20.0, 20.0, 1.1, -1.5), sinusoid(5.0, 30.0, 0.5, 0.4))
SPIN = (0.1, -0.05, 0.2)  # [rad/s]


def cross(a, b):
    return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]


def spin_rates(t, omega):
    """Euler: J ω' + J_w φ'' = (J ω + J_w φ') × ω."""
    turns = [turn(t) for turn in TURNS]
    momentum = [j * o + WHEEL * turn[1] for j, o, turn in zip(J, omega, turns, strict=True)]
    return [(c - WHEEL * turn[2]) / j for c, turn, j in zip(cross(momentum, omega), turns, J, strict=True)]


def torques(t, y):
    return [WHEEL * (turn(t)[2] + rate) for turn, rate in zip(TURNS, spin_rates(t, y[4:7]), strict=True)]


def rates(t, y):
    w, v, omega = y[0], y[1:4], y[4:7]
    turned = [(w * o + c) / 2 for o, c in zip(omega, cross(v, omega), strict=True)]
    power = sum(force * turn(t)[1] for force, turn in zip(torques(t, y), TURNS, strict=True))
    return [-sum(a * o for a, o in zip(v, omega, strict=True)) / 2, *turned, *spin_rates(t, omega), power]


def energy(t, y):
    turns = [turn(t)[1] for turn in TURNS]
    return sum(j * o**2 + WHEEL * (2 * o * rate + rate**2) for j, o, rate in zip(J, y[4:7], turns, strict=True)) / 2


EQUATIONS = Equations(rates, [1.0, 0.0, 0.0, 0.0, *SPIN, 0.0], energy)
WHEELS = "".join(
    body(
        f"wheel_{axis}",
        joint(f"wheel_{axis}", "hinge", along),
        inertia=tuple(WHEEL if k == axis else WHEEL / 2 for k in range(3)),
    )
    for axis, along in enumerate(("1 0 0", "0 1 0", "0 0 1"))
)
TASK = Task(
    "satellite",
    stop=4.8,
    bodies=body("hull", joint("attitude", "ball"), mass=1.0, inertia=tuple(j - 2 * WHEEL for j in J), inside=WHEELS),
    motions={f"wheel_{axis}": turn for axis, turn in enumerate(TURNS)},
    asked=[("attitude",)],
    start={"attitude": (1.0, 0.0)},
    answer=integrated(EQUATIONS, [0, 1, 2, 3], lambda t, y: torques(t, y)[0]),
    checks=lambda: EQUATIONS.checks(4.8),
    component="Satellite",
    start_values={f"omega_{axis}_0": rate for axis, rate in zip("xyz", SPIN, strict=True)},
    ports={f"wheel_{axis}": f"wheel_{axis + 1}" for axis in range(3)},
    signals=["q_w", "q_x", "q_y", "q_z"],
)
