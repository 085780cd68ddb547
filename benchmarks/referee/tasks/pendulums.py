"""A pendulum in four ways: pumped in length, in a sudden crouch, and on a pivot that moves to and fro or up and down.

An operator pumps the length twice a period.  To crouch and to stand up takes a tenth of a second each.  Kapitza's
stands upright on a pivot that shakes.
"""

from math import pi

from sympy import cos, sin
from sympy.physics.mechanics import dynamicsymbols

from referee.equations import lagrange, point
from referee.task import GRAVITY, sinusoid

RATE = 2.0  # [m/s]
TURNS = {t + k: change for k in (0.0, 1.2) for t, change in {0.4: -RATE, 0.5: RATE, 1.0: RATE, 1.1: -RATE}.items()}


def crouch(t):
    passed = {turn: change for turn, change in TURNS.items() if t >= turn}
    return 1.0 + sum(change * (t - turn) for turn, change in passed.items()), sum(passed.values()), 0.0


theta, length, x, z = dynamicsymbols("theta length pivot_x pivot_z")
hanging = point(1.0, length * sin(theta), -length * cos(theta))
TASKS = (
    lagrange(
        "pumped length",
        4.0,
        hanging,
        {theta: (0.3, 0.0)},
        {length: sinusoid(1.0, 0.15, 6.2642)},
        component="Pendulum",
    ),
    lagrange(
        "sudden crouch",
        2.4,
        hanging,
        {theta: (0.5, 0.0)},
        {length: crouch},
        # p_θ = m l² θ' and l stay, so θ' does; the impulse m Δl' does the work m Δ(l'²)/2, l' being 0 before or after.
        jumps=dict(zip(TURNS, [RATE**2 / 2, -(RATE**2) / 2] * 4, strict=True)),
        component="Pendulum",
    ),
    lagrange(
        "moving pivot",
        9.6,
        point(1.0, x + sin(theta), -cos(theta)),
        {theta: (0.3, 0.0)},
        {x: sinusoid(0.0, 0.1, 3.0)},
        component="Pendulum",
        carrier=1.0,
    ),
    lagrange(
        "Kapitza",
        1.6,
        point(1.0, sin(theta), z - cos(theta)),
        {theta: (pi - 0.1, 0.0)},
        {z: sinusoid(0.0, 0.1, 50.0)},
        component="Pendulum",
        carrier=1.0,
        weight=GRAVITY,
    ),
)
