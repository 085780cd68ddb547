"""A four-bar linkage whose crank is turned: circles about its end and the rocker's bearing cut each other."""

import numpy as np
from sympy import Matrix, atan2, cos, lambdify, sin

from referee.equations import TIME, Lagrange, coordinates
from referee.task import GRAVITY, Answer, sinusoid

A, B, C, D = 0.5, 1.5, 1.2, 1.5  # [m] crank, coupler, rocker, frame
MASSES, INERTIAS, WOBBLE = (1.0, 2.0, 1.5), (0.02, 0.4, 0.2), sinusoid(0.0, 0.3, 2.0)


def crank(t, *_):
    wobble = WOBBLE(t)
    return 1 + 3 * t + wobble[0], 3 + wobble[1], wobble[2]


[turn] = coordinates("turn")
end, bearing = A * Matrix([cos(turn), sin(turn)]), Matrix([D, 0])
way = bearing - end
distance = (way.dot(way)) ** 0.5
reach = (distance**2 + B**2 - C**2) / (2 * distance)
pin = end + (reach * way + (B**2 - reach**2) ** 0.5 * Matrix([-way[1], way[0]])) / distance
bars = (end, pin - end, pin - bearing)
centres = (end / 2, (end + pin) / 2, (bearing + pin) / 2)
spins = [(bar[0] * bar[1].diff(TIME) - bar[1] * bar[0].diff(TIME)) / bar.dot(bar) for bar in bars]
energies = [
    m * (centre.diff(TIME).dot(centre.diff(TIME)) / 2 - GRAVITY * centre[1]) + i * spin**2 / 2
    for m, centre, i, spin in zip(MASSES, centres, INERTIAS, spins, strict=True)
]
ANGLES = lambdify([turn], [atan2(bar[1], bar[0]) for bar in bars], "math")


def answer(times):
    rocker = np.unwrap([ANGLES(crank(t)[0])[2] for t in times])
    found = DRIVEN.answer(times)
    return Answer(rocker[:, None], found.force, found.work)


def checks():
    phi = np.linspace(1, 10, 20)
    psi = np.array([ANGLES(p)[2] for p in phi])
    gap = D / A * np.cos(psi) - D / C * np.cos(phi) + (A**2 - B**2 + C**2 + D**2) / (2 * A * C) - np.cos(phi - psi)
    return DRIVEN.checks() | {"Freudenstein": float(np.max(np.abs(gap)))}


START, FIRST = ANGLES(1.0), lambdify([turn, turn.diff(TIME)], spins, "math")(1.0, crank(0.0)[1])
LAGRANGE = Lagrange(sum(energies), {}, {turn: crank})
DRIVEN = LAGRANGE.task("crank", 3.2, component="")
TASK = LAGRANGE.task(
    "four-bar",
    3.2,
    constraint="equality",
    asked=["swing"],
    start={"elbow": (START[1] - START[0], FIRST[1] - FIRST[0]), "swing": (START[2], FIRST[2])},
    answer=answer,
    checks=checks,
    component="FourBar",
    lagrange=None,
)
