"""A pendulum that crouches and stands up in a tenth of a second each: σ̇ jumps eight times."""

from sympy import cos
from sympy.physics.mechanics import dynamicsymbols

from referee.equations import lagrange
from referee.task import GRAVITY

RATE = 2.0  # [m/s]
TURNS = ((0.4, 0.0, -RATE), (0.5, -RATE, 0.0), (1.0, 0.0, RATE), (1.1, RATE, 0.0))
TURNS += tuple((t + 1.2, before, after) for t, before, after in TURNS)


def motion(t):
    place, rate = 1.0, 0.0
    for turn, before, after in TURNS:
        if t >= turn:
            place += (after - before) * (t - turn)
            rate = after
    return place, rate, 0.0


theta, length = dynamicsymbols("theta length")
theta_dot, length_dot = dynamicsymbols("theta length", 1)
TASK = lagrange(
    "sudden crouch",
    2.4,
    (length_dot**2 + (length * theta_dot) ** 2) / 2 + GRAVITY * length * cos(theta),
    {theta: (0.5, 0.0)},
    {length: motion},
    # p_θ = m l² θ' and l stay, so θ' does; the impulse m Δl' does the work m Δ(l'²)/2.
    jumps={t: (after**2 - before**2) / 2 for t, before, after in TURNS},
    component="Pendulum",
)
