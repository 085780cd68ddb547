"""A four-bar linkage whose crank is turned."""

from dataclasses import replace

import numpy as np
from sympy import Matrix, cos, nsolve, sin
from sympy.physics.mechanics import dynamicsymbols

from referee.equations import TIME, lagrange, point
from referee.task import sinusoid

A, B, C, D = 0.5, 1.5, 1.2, 1.5  # [m] crank, coupler, rocker, frame
MASSES, INERTIAS, WOBBLE = (1.0, 2.0, 1.5), (0.02, 0.4, 0.2), sinusoid(0.0, 0.3, 2.0)


def crank(t):
    wobble = WOBBLE(t)
    return 1 + 3 * t + wobble[0], 3 + wobble[1], wobble[2]


swing, elbow, turn = dynamicsymbols("swing elbow turn")
angles = (turn, turn + elbow, swing)
bars = [r * Matrix([cos(angle), sin(angle)]) for r, angle in zip((A, B, C), angles, strict=True)]
ends = (0 * bars[0], bars[0], Matrix([D, 0]))
closure = bars[0] + bars[1] - bars[2] - ends[2]
energies = [
    point(m, *(end + bar / 2)) + i * angle.diff(TIME) ** 2 / 2
    for m, end, bar, i, angle in zip(MASSES, ends, bars, INERTIAS, angles, strict=True)
]
unknown = [swing, elbow, swing.diff(TIME), elbow.diff(TIME)]
place, rate, _ = crank(0.0)
closed = Matrix([closure, closure.diff(TIME)]).subs({turn.diff(TIME): rate, turn: place})
start = np.array(nsolve(closed, unknown, (1.8, 0.0, 0.0, 0.0)), dtype=float).reshape(2, 2).T.tolist()
CLOSED = lagrange(
    "four-bar",
    3.2,
    sum(energies),
    dict(zip(unknown[:2], start, strict=True)),
    {turn: crank},
    closure=closure,
    component="FourBar",
    asked=["swing"],
    constraint="equality",
)


def reference(times):
    """Freudenstein's equation says whether the loop stays closed."""
    found, checks = CLOSED.reference(times)
    phi, psi = np.array([crank(t)[0] for t in times]), found.motion[:, 0]
    gap = D / A * np.cos(psi) - D / C * np.cos(phi) + (A**2 - B**2 + C**2 + D**2) / (2 * A * C) - np.cos(phi - psi)
    return found, {**checks, "Freudenstein": max(abs(gap))}


TASK = replace(CLOSED, reference=reference)
