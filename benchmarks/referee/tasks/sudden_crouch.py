"""A pendulum that crouches and stands up in a tenth of a second each: σ̇ jumps eight times."""

from functools import partial

from referee.bodies import body, joint
from referee.task import GRAVITY, Equations, Task, cos, integrated, sin

SHORT, RATE, START = 0.8, 2.0, 0.5  # [m], [m/s], [rad]
TURNS = ((0.4, 0.0, -RATE), (0.5, -RATE, 0.0), (1.0, 0.0, RATE), (1.1, RATE, 0.0))
TURNS += tuple((t + 1.2, before, after) for t, before, after in TURNS)


def length(t, since=None):
    """By the last turn before ``since``, t by default."""
    l, l_dot, before = t * 0 + 1.0, t * 0, 0.0
    for turn, _, after in TURNS:
        if (t if since is None else since) >= turn:
            l += (after - before) * (t - turn)
            l_dot = after + t * 0
            before = after
    return l, l_dot, 0.0


def rates(t, y, since=None):
    theta, rate, _ = y
    l, l_dot, _ = length(t, since)
    return [rate, -(GRAVITY * sin(theta) + 2 * l_dot * rate) / l, force(t, y, since) * l_dot]


def force(t, y, since=None):
    """Along the rod, between jumps: -m (l θ'² + g cos θ)."""
    return -length(t, since)[0] * y[1] ** 2 - GRAVITY * cos(y[0])


def energy(t, y):
    l, l_dot, _ = length(t)
    return (l_dot**2 + l**2 * y[1] ** 2) / 2 - GRAVITY * l * cos(y[0])


# p_θ = m l² θ' and l stay, so θ' does; the impulse m Δl' does the work m Δ(l'²)/2.
JUMPS = [(t, (after**2 - before**2) / 2) for t, before, after in TURNS]
EQUATIONS = Equations(rates, [START, 0.0, 0.0], energy, JUMPS, lambda begin: partial(rates, since=begin))
TASK = Task(
    "sudden crouch",
    stop=2.4,
    bodies=body(
        "rod",
        joint("theta", "hinge", "0 -1 0"),
        inside=body("bob", joint("length", "slide", "0 0 -1"), mass=1.0),
    ),
    motions={"length": length},
    asked=[("theta",)],
    start={"theta": (START, 0.0)},
    answer=integrated(EQUATIONS, [0], force),
    checks=lambda: EQUATIONS.checks(2.4),
    component="Pendulum",
    start_values={"theta_0": START},
    ports={"length": "length"},
    signals=["theta"],
    jumps=tuple(t for t, *_ in TURNS),
)
