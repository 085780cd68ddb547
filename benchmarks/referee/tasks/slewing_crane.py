"""A crane that slews while its trolley travels: the load is a rigid body on a universal joint."""

import numpy as np

from referee.bodies import body, joint
from referee.task import GRAVITY, Equations, Task, cos, integrated, sin, sinusoid

MASS, TROLLEY, ROPE, ACROSS, ALONG, TOWER = 1000.0, 400.0, 20.0, 500.0, 300.0, 1e5
SLEW = sinusoid(0.3, 0.3, 0.8, -np.pi / 2)
TRAVEL = sinusoid(8.0, 1.5, 0.6)
PIVOT = ACROSS + MASS * ROPE**2  # moment about the joint


def cross(a, b):
    return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]


def dot(a, b):
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def into_load(v, alpha, beta):
    """Components along the axes of the load of a vector in those of the tower: turned back by α about x, β about y."""
    x, y, z = v[0], cos(alpha) * v[1] + sin(alpha) * v[2], cos(alpha) * v[2] - sin(alpha) * v[1]
    return [cos(beta) * x - sin(beta) * z, y, sin(beta) * x + cos(beta) * z]


def dynamics(t, y):
    """Accelerations of α and β, torque of the slew and force of the travel; all vectors in axes of the load."""
    alpha, beta, a, b, _ = y
    (_, w, w_dot), (r, v, v_dot) = SLEW(t), TRAVEL(t)
    e_1, e_2 = [cos(beta), 0, sin(beta)], [0, 1, 0]
    z = into_load([0, 0, 1], alpha, beta)
    tower = into_load([0, 0, w], alpha, beta)
    omega = [p + a * q + b * s for p, q, s in zip(tower, e_1, e_2, strict=True)]
    # Axes that turn: z with the tower and not at all in space, e_1 with the tower, e_2 with the load's first turn.
    e_1_dot, e_2_dot = cross(tower, e_1), cross([p + a * q for p, q in zip(tower, e_1, strict=True)], e_2)
    rest = [w_dot * i + a * j + b * k for i, j, k in zip(z, e_1_dot, e_2_dot, strict=True)]  # of ω' in space
    pivot = into_load([v_dot - r * w**2, r * w_dot + 2 * v * w, 0], alpha, beta)  # acceleration of the trolley
    arm = [0, 0, -ROPE]
    inertia = lambda u: [PIVOT * u[0], PIVOT * u[1], ALONG * u[2]]  # noqa: E731
    pull = [MASS * (p + GRAVITY * q) for p, q in zip(pivot, z, strict=True)]
    moment = [p + q + s for p, q, s in zip(inertia(rest), cross(omega, inertia(omega)), cross(arm, pull), strict=True)]
    m_11, m_12, m_22 = dot(e_1, inertia(e_1)), dot(e_1, inertia(e_2)), dot(e_2, inertia(e_2))
    f_1, f_2 = -dot(e_1, moment), -dot(e_2, moment)
    determinant = m_11 * m_22 - m_12**2
    a_dot, b_dot = (m_22 * f_1 - m_12 * f_2) / determinant, (m_11 * f_2 - m_12 * f_1) / determinant
    omega_dot = [p + a_dot * q + b_dot * s for p, q, s in zip(rest, e_1, e_2, strict=True)]
    swing = [p + q for p, q in zip(cross(omega_dot, arm), cross(omega, cross(omega, arm)), strict=True)]
    load = [MASS * (p + q) for p, q in zip(pivot, swing, strict=True)]  # m a of the load's centre
    own = [ACROSS * omega[0], ACROSS * omega[1], ALONG * omega[2]]
    turning = [ACROSS * omega_dot[0], ACROSS * omega_dot[1], ALONG * omega_dot[2]]
    outwards, sideways = into_load([1, 0, 0], alpha, beta), into_load([0, 1, 0], alpha, beta)
    place = [r * p + q for p, q in zip(outwards, arm, strict=True)]
    spin = [p + q + s for p, q, s in zip(cross(place, load), turning, cross(omega, own), strict=True)]
    torque = TOWER * w_dot + TROLLEY * r * (r * w_dot + 2 * v * w) + dot(z, spin)
    push = TROLLEY * (v_dot - r * w**2) + dot(outwards, load)
    velocity = [v * p + r * w * q + s for p, q, s in zip(outwards, sideways, cross(omega, arm), strict=True)]
    kinetic = TOWER * w**2 + TROLLEY * (v**2 + (r * w) ** 2) + MASS * dot(velocity, velocity) + dot(omega, own)
    return a_dot, b_dot, torque, push, kinetic / 2 - MASS * GRAVITY * ROPE * z[2]


def rates(t, y):
    a_dot, b_dot, torque, push, _ = dynamics(t, y)
    return [y[2], y[3], a_dot, b_dot, torque * SLEW(t)[1] + push * TRAVEL(t)[1]]


EQUATIONS = Equations(rates, [0.05, -0.03, 0.0, 0.0, 0.0], lambda t, y: dynamics(t, y)[4])
TASK = Task(
    "slewing crane",
    stop=6.4,
    bodies=body(
        "tower",
        joint("slew", "hinge"),
        mass=8000.0,
        centre="0 0 12",
        inertia=(4e5, 4e5, TOWER),
        inside=body(
            "trolley",
            joint("travel", "slide", "1 0 0"),
            at="0 0 24",
            mass=TROLLEY,
            inside=body(
                "gimbal",
                joint("rope_x", "hinge", "1 0 0"),
                inside=body(
                    "load",
                    joint("rope_y", "hinge", "0 1 0"),
                    mass=MASS,
                    centre="0 0 -20",
                    inertia=(ACROSS, ACROSS, ALONG),
                ),
            ),
        ),
    ),
    motions={"slew": SLEW, "travel": TRAVEL},
    asked=[("rope_x",), ("rope_y",)],
    start={"rope_x": (0.05, 0.0), "rope_y": (-0.03, 0.0)},
    answer=integrated(EQUATIONS, [0, 1], lambda t, y: dynamics(t, y)[2]),
    checks=lambda: EQUATIONS.checks(6.4),
    component="SlewingCrane",
    start_values={"rope_x_0": 0.05, "rope_y_0": -0.03, "rope_damping": 0.0},
    ports={"slew": "slew", "travel": "travel"},
    signals=["rope_x", "rope_y"],
)
