"""A four-bar linkage whose crank is turned: geometry gives the motion, energy the torque."""

import numpy as np

from referee.bodies import body, joint
from referee.task import GRAVITY, Answer, Task, sinusoid

A, B, C, D = 0.5, 1.5, 1.2, 1.5  # [m] crank, coupler, rocker, frame
MASSES, INERTIAS, CENTRES = (1.0, 2.0, 1.5), (0.02, 0.4, 0.2), (0.25, 0.75, 0.6)
WOBBLE = sinusoid(0.0, 0.3, 2.0)


def turn(t):
    wobble = WOBBLE(t)
    return 1 + 3 * t + wobble[0], 3 + wobble[1], wobble[2]


def unit(angle):
    return np.array([np.cos(angle), np.sin(angle)])


def normal(angle):
    return np.array([-np.sin(angle), np.cos(angle)])


def angles(crank):
    """Of coupler and rocker: circles about the crank's end and the rocker's bearing cut each other above."""
    end, bearing = A * unit(crank), np.array([D, 0.0])
    way = bearing - end
    distance = np.hypot(*way)
    along = (distance**2 + B**2 - C**2) / (2 * distance)
    pin = end + along * way / distance + np.sqrt(B**2 - along**2) * np.array([-way[1], way[0]]) / distance
    return np.arctan2(*(pin - end)[::-1]), np.arctan2(*(pin - bearing)[::-1])


def moved(t):
    """Angles, rates and accelerations of the three bodies, (3, 3): the loop, once and twice differentiated."""
    phi, phi_dot, phi_ddot = turn(t)
    chi, psi = angles(phi)
    matrix = np.column_stack([B * normal(chi), -C * normal(psi)])
    chi_dot, psi_dot = np.linalg.solve(matrix, -A * normal(phi) * phi_dot)
    rest = (
        A * (unit(phi) * phi_dot**2 - normal(phi) * phi_ddot) + B * unit(chi) * chi_dot**2 - C * unit(psi) * psi_dot**2
    )
    chi_ddot, psi_ddot = np.linalg.solve(matrix, rest)
    return np.array([[phi, chi, psi], [phi_dot, chi_dot, psi_dot], [phi_ddot, chi_ddot, psi_ddot]])


def points(t):
    """Places, velocities and accelerations of the centres of mass, (3, 3, 2)."""
    motion = moved(t)
    ends = np.zeros((3, 3, 2))
    for k, (q, v, a) in enumerate(motion.T):
        arm = np.array([unit(q), normal(q) * v, normal(q) * a - unit(q) * v**2])
        base = (0.0, A, 0.0)[k] * np.array(
            [
                unit(motion[0, 0]),
                normal(motion[0, 0]) * motion[1, 0],
                normal(motion[0, 0]) * motion[2, 0] - unit(motion[0, 0]) * motion[1, 0] ** 2,
            ]
        )
        ends[:, k] = CENTRES[k] * arm + base
    return ends


def energy(t):
    motion, (place, velocity, _) = moved(t), points(t)
    kinetic = np.dot(MASSES, np.sum(velocity**2, axis=1)) + np.dot(INERTIAS, motion[1] ** 2)
    return kinetic / 2 + GRAVITY * np.dot(MASSES, place[:, 1])


def power(t):
    """Rate of the energy, by accelerations."""
    motion, (_, velocity, acceleration) = moved(t), points(t)
    inertia = np.dot(MASSES, np.sum(velocity * acceleration, axis=1)) + np.dot(INERTIAS, motion[1] * motion[2])
    return inertia + GRAVITY * np.dot(MASSES, velocity[:, 1])


def answer(times):
    rockers = np.unwrap([angles(turn(t)[0])[1] for t in times])
    torques = np.array([power(t) / turn(t)[1] for t in times])
    return Answer(rockers[:, None], torques, np.array([energy(t) for t in times]) - energy(0.0))


def checks():
    phi = np.array([turn(t)[0] for t in np.linspace(0, 3, 20)])
    psi = np.array([angles(p)[1] for p in phi])
    gap = D / A * np.cos(psi) - D / C * np.cos(phi) + (A**2 - B**2 + C**2 + D**2) / (2 * A * C) - np.cos(phi - psi)
    nodes, weights = np.polynomial.legendre.leggauss(60)
    work = sum(w * 1.5 * power(1.5 + 1.5 * x) for x, w in zip(nodes, weights, strict=True))
    account = abs(work - energy(3.0) + energy(0.0)) / np.ptp([energy(t) for t in np.linspace(0, 3, 40)])
    return {"Freudenstein": float(np.max(np.abs(gap))), "energy account": float(account)}


START, RATES = angles(1.0), moved(0.0)[1]
HINGE = "0 -1 0"
TASK = Task(
    "four-bar",
    stop=3.2,
    bodies=body(
        "crank",
        joint("turn", "hinge", HINGE),
        mass=1.0,
        centre="0.25 0 0",
        inertia=(0.02, 0.02, 0.02),
        inside=body(
            "coupler",
            joint("elbow", "hinge", HINGE) + '<site name="end" pos="1.5 0 0"/>',
            at="0.5 0 0",
            mass=2.0,
            centre="0.75 0 0",
            inertia=(0.4,) * 3,
        ),
    )
    + body(
        "rocker",
        joint("swing", "hinge", HINGE) + '<site name="top" pos="1.2 0 0"/>',
        at="1.5 0 0",
        mass=1.5,
        centre="0.6 0 0",
        inertia=(0.2,) * 3,
    ),
    more='<equality><connect name="pin" site1="end" site2="top"/></equality>',
    constraint="equality",
    motions={"turn": turn},
    asked=[("swing",)],
    start={
        "elbow": (START[0] - 1.0, RATES[1] - RATES[0]),
        "swing": (START[1], RATES[2]),
    },
    answer=answer,
    checks=checks,
    component="FourBar",
    start_values={"elbow_0": START[0] - 1.0, "swing_0": START[1]}
    | dict(zip(("elbow_dot_0", "swing_dot_0"), (RATES[1] - RATES[0], RATES[2]), strict=True)),
    ports={"turn": "turn"},
    signals=["swing"],
)
