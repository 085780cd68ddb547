"""A cat of three bodies that falls and turns by its limbs."""

import numpy as np

from referee.bodies import body, joint
from referee.task import Equations, Task, cos, integrated, sin, sinusoid

MASSES, INERTIAS, HINGE, ARMS = (2.0, 1.0, 1.0), (0.05, 0.02, 0.02), 0.2, (0.15, 0.15)
LIMBS = (sinusoid(0.5, 0.8, 4.0, -np.pi / 2), sinusoid(0.0, 0.9, 4.0))
RATE = 0.5  # [rad/s], of the trunk at the start

TOTAL = sum(MASSES)
OUTER = [m * (TOTAL - m) / TOTAL for m in MASSES[1:]]
SHARED = MASSES[1] * MASSES[2] / TOTAL
A, B = (HINGE * arm * (mu + SHARED) for arm, mu in zip(ARMS, OUTER, strict=True))
C = ARMS[0] * ARMS[1] * SHARED
G = [INERTIAS[0] + HINGE**2 * (sum(OUTER) + 2 * SHARED)]
G += [i + arm**2 * mu for i, arm, mu in zip(INERTIAS[1:], ARMS, OUTER, strict=True)]


def matrix(one, two):
    """Of the energy in the rates of the three bodies in space."""
    a, b, c = A * cos(one), B * cos(two), C * cos(one - two)
    return [[G[0], a, b], [a, G[1], c], [b, c, G[2]]]


def momenta(t, rate):
    (one, v_1, _), (two, v_2, _) = (limb(t) for limb in LIMBS)
    spins = [rate, rate + v_1, rate + v_2]
    return [sum(m * w for m, w in zip(row, spins, strict=True)) for row in matrix(one, two)], spins


MOMENTUM = sum(momenta(0.0, RATE)[0])


def trunk(t):
    """Rate of the trunk, since the angular momentum stays."""
    at_rest = sum(momenta(t, 0.0)[0])
    return (MOMENTUM - at_rest) / (sum(momenta(t, 1.0)[0]) - at_rest)


def torques(t):
    """Of both hinges: rate of a limb's momentum, less the slope of the energy."""
    (one, v_1, a_1), (two, v_2, a_2) = (limb(t) for limb in LIMBS)
    spins = momenta(t, trunk(t))[1]
    m = matrix(one, two)
    # Slopes of a, b and c along the motion.
    a, b, c = -A * sin(one) * v_1, -B * sin(two) * v_2, -C * sin(one - two) * (v_1 - v_2)
    m_dot = [[0, a, b], [a, 0, c], [b, c, 0]]
    known = [sum(row[k] * spins[k] for k in range(3)) + m[i][1] * a_1 + m[i][2] * a_2 for i, row in enumerate(m_dot)]
    whole = [sum(row) for row in m]
    acceleration = -sum(known) / sum(whole)
    one_slope = -A * sin(one) * spins[0] * spins[1] - C * sin(one - two) * spins[1] * spins[2]
    two_slope = -B * sin(two) * spins[0] * spins[2] + C * sin(one - two) * spins[1] * spins[2]
    return known[1] + whole[1] * acceleration - one_slope, known[2] + whole[2] * acceleration - two_slope


def rates(t, y):  # noqa: ARG001
    power = sum(torque * limb(t)[1] for torque, limb in zip(torques(t), LIMBS, strict=True))
    return [trunk(t), power]


def energy(t, y):  # noqa: ARG001
    momentum, spins = momenta(t, trunk(t))
    return sum(p * w for p, w in zip(momentum, spins, strict=True)) / 2


EQUATIONS = Equations(rates, [0.0, 0.0], energy)
FORE = body(
    "fore",
    joint("psi_1", "hinge", "0 -1 0"),
    at="0.2 0 0",
    mass=MASSES[1],
    centre="0.15 0 0",
    inertia=(INERTIAS[1],) * 3,
)
HIND = body(
    "hind",
    joint("psi_2", "hinge", "0 -1 0"),
    at="-0.2 0 0",
    mass=MASSES[2],
    centre="-0.15 0 0",
    inertia=(INERTIAS[2],) * 3,
)
TRUNK = body("trunk", joint("phi", "hinge", "0 -1 0"), mass=MASSES[0], inertia=(INERTIAS[0],) * 3, inside=FORE + HIND)
TASK = Task(
    "cat",
    stop=3.2,
    bodies=body("sideways", joint("x", "slide", "1 0 0"), inside=body("up", joint("z", "slide"), inside=TRUNK)),
    motions={"psi_1": LIMBS[0], "psi_2": LIMBS[1]},
    asked=[("phi",)],
    start={"phi": (0.0, RATE)},
    answer=integrated(EQUATIONS, [0], lambda t, _: torques(t)[0]),
    checks=lambda: EQUATIONS.checks(3.2),
    component="PlanarCat",
    start_values={"phi_dot_0": RATE},
    ports={"psi_1": "psi_1", "psi_2": "psi_2"},
    signals=["phi"],
)
