"""A ball on a shaken table: it bounces; force is the sum of the table's impulses."""

import numpy as np

from referee.equations import pieces
from referee.task import GRAVITY, Answer, Task, sinusoid

TABLE = sinusoid(0.0, 0.05, 6.0)
BOUNCE, HEIGHT, STOP = 0.8, 0.5, 2.4


def height(t, flight):
    begin, h, v, *_ = flight
    return h + v * (t - begin) - GRAVITY * (t - begin) ** 2 / 2


def above(t, flight):
    return height(t, flight) - TABLE(t)[0]


def thrown(t, flight):
    begin, _, v, impulse, work = flight
    table, rate, _ = TABLE(t)
    down = v - GRAVITY * (t - begin)
    push = (1 + BOUNCE) * (rate - down)
    return t, table, down + push, impulse + push, work + push * rate


def reference(times):
    """Momentum and energy from the start to the last flight, with what the impacts take."""
    flights = np.array([*pieces((0.0, HEIGHT, 0.0, 0.0, 0.0), above, thrown, STOP)])
    begin, h, v, impulse, work = flights[-1]
    pushes = np.diff(flights[:, 3])
    lost = (1 - BOUNCE) / (1 + BOUNCE) / 2 * pushes @ pushes
    account = v**2 / 2 + GRAVITY * (h - HEIGHT) - work + lost
    momentum = v - impulse + GRAVITY * begin
    checks = {"momentum": abs(momentum), "energy account": abs(account / work), "impacts": len(pushes)}
    rows = flights[np.searchsorted(flights[:, 0], times) - 1].T
    return Answer(height(times, rows)[:, None], *rows[3:]), checks


TASK = Task(
    "shaken ball",
    STOP,
    {"table": TABLE},
    ["height"],
    "BouncingBall",
    reference,
    constraint="contact",
    start={"height": (HEIGHT, 0.0)},
    parameters={"bounce": BOUNCE},
    force="table_impulse",
)
