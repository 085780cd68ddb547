"""A pendulum that crouches and stands up in a tenth of a second each: σ̇ jumps eight times."""

from sympy import cos

from referee.equations import TIME, Lagrange, coordinates
from referee.task import GRAVITY

RATE = 2.0  # [m/s]
TURNS = ((0.4, 0.0, -RATE), (0.5, -RATE, 0.0), (1.0, 0.0, RATE), (1.1, RATE, 0.0))
TURNS += tuple((t + 1.2, before, after) for t, before, after in TURNS)


def motion(t, since=None):
    """By the last turn before ``since``, t by default."""
    place, rate = t * 0 + 1.0, t * 0
    for turn, before, after in TURNS:
        if (t if since is None else since) >= turn:
            place += (after - before) * (t - turn)
            rate = after + t * 0
    return place, rate, 0.0


theta, length = coordinates("theta length")
TASK = Lagrange(
    (length.diff(TIME) ** 2 + (length * theta.diff(TIME)) ** 2) / 2 + GRAVITY * length * cos(theta),
    {theta: (0.5, 0.0)},
    {length: motion},
).task(
    "sudden crouch",
    2.4,
    # p_θ = m l² θ' and l stay, so θ' does; the impulse m Δl' does the work m Δ(l'²)/2.
    {t: (after**2 - before**2) / 2 for t, before, after in TURNS},
    component="Pendulum",
)
