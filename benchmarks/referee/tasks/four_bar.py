"""A four-bar linkage whose crank is turned: circles about its end and the rocker's bearing cut each other."""

from dataclasses import replace

import numpy as np
from sympy import Matrix, atan2, cos, lambdify, sin
from sympy.physics.mechanics import dynamicsymbols

from referee.equations import TIME, lagrange
from referee.task import GRAVITY, sinusoid

A, B, C, D = 0.5, 1.5, 1.2, 1.5  # [m] crank, coupler, rocker, frame
MASSES, INERTIAS, WOBBLE = (1.0, 2.0, 1.5), (0.02, 0.4, 0.2), sinusoid(0.0, 0.3, 2.0)


def crank(t):
    wobble = WOBBLE(t)
    return 1 + 3 * t + wobble[0], 3 + wobble[1], wobble[2]


turn = dynamicsymbols("turn")
end, bearing = A * Matrix([cos(turn), sin(turn)]), Matrix([D, 0])
way = bearing - end
distance = (way.dot(way)) ** 0.5
reach = (distance**2 + B**2 - C**2) / (2 * distance)
pin = end + (reach * way + (B**2 - reach**2) ** 0.5 * Matrix([-way[1], way[0]])) / distance
angles = [atan2(bar[1], bar[0]) for bar in (end, pin - end, pin - bearing)]
centres = (end / 2, (end + pin) / 2, (bearing + pin) / 2)
energies = [
    m * (centre.diff(TIME).dot(centre.diff(TIME)) / 2 - GRAVITY * centre[1]) + i * angle.diff(TIME) ** 2 / 2
    for m, centre, i, angle in zip(MASSES, centres, INERTIAS, angles, strict=True)
]
ANGLES = lambdify([turn, turn.diff(TIME)], [*angles, *(angle.diff(TIME) for angle in angles)], "math")
DRIVEN = lagrange("crank", 3.2, sum(energies), {}, {turn: crank}, component="FourBar")


def reference(times):
    """The crank's, with the rocker's angle by SymPy, which Freudenstein's equation is held against."""
    found, checks = DRIVEN.reference(times)
    phi = np.array([crank(t)[0] for t in times])
    psi = np.unwrap([ANGLES(p, 0.0)[2] for p in phi])
    gap = D / A * np.cos(psi) - D / C * np.cos(phi) + (A**2 - B**2 + C**2 + D**2) / (2 * A * C) - np.cos(phi - psi)
    return found._replace(motion=psi[:, None]), {**checks, "Freudenstein": float(max(abs(gap)))}


first, second, third, *spin = ANGLES(*crank(0.0)[:2])
TASK = replace(
    DRIVEN,
    name="four-bar",
    constraint="equality",
    asked=["swing"],
    start={"elbow": (second - first, spin[1] - spin[0]), "swing": (third, spin[2])},
    reference=reference,
    functions=None,
)
