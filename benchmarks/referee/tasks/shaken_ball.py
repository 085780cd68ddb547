"""A ball on a shaken table: it bounces; force is the sum of the table's impulses."""

from functools import cache
from itertools import pairwise

import numpy as np

from referee.equations import pieces
from referee.task import GRAVITY, Answer, Task, sinusoid

TABLE = sinusoid(0.0, 0.05, 6.0)
BOUNCE, HEIGHT, STOP = 0.8, 0.5, 2.4


def above(t, flight):
    begin, h, v, *_ = flight
    return h + v * (t - begin) - GRAVITY * (t - begin) ** 2 / 2 - TABLE(t)[0]


def thrown(t, flight):
    begin, _, v, impulse, work = flight
    table, rate, _ = TABLE(t)
    down = v - GRAVITY * (t - begin)
    push = (1 + BOUNCE) * (rate - down)
    return t, table, down + push, impulse + push, work + push * rate


@cache
def flights():
    """Begin, height and velocity then, impulse and work till then."""
    return pieces((0.0, HEIGHT, 0.0, 0.0, 0.0), above, thrown, STOP)


def answer(times):
    begin, h, v, impulse, work = np.array(flights())[np.searchsorted([f[0] for f in flights()], times) - 1].T
    return Answer((h + v * (times - begin) - GRAVITY * (times - begin) ** 2 / 2)[:, None], impulse, work)


def checks():
    """Momentum and energy from the start to the last flight, with what the impacts take."""
    begin, h, v, impulse, work = flights()[-1]
    strikes = [up - GRAVITY * (hit - t) - TABLE(hit)[1] for (t, _, up, *_), (hit, *_) in pairwise(flights())]
    lost = (1 - BOUNCE**2) / 2 * sum(strike**2 for strike in strikes)
    account = v**2 / 2 + GRAVITY * (h - HEIGHT) - work + lost
    momentum = v - impulse + GRAVITY * begin
    return {"momentum": abs(momentum), "energy account": abs(account / work), "impacts": len(strikes)}


TASK = Task(
    "shaken ball",
    STOP,
    {"table": TABLE},
    ["height"],
    "BouncingBall",
    answer,
    checks,
    constraint="contact",
    start={"height": (HEIGHT, 0.0)},
    parameters={"bounce": BOUNCE},
    force="table_impulse",
)
