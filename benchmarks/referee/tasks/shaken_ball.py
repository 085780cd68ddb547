"""A ball on a shaken table: it bounces; force is the sum of the table's impulses."""

from itertools import pairwise

import numpy as np

from referee.equations import first_root
from referee.task import GRAVITY, Answer, Task, sinusoid

TABLE = sinusoid(0.0, 0.05, 6.0)
BOUNCE, HEIGHT, STOP = 0.8, 0.5, 2.4


def flights():
    """Begin, height and velocity then, impulse and work till then."""
    found = [(0.0, HEIGHT, 0.0, 0.0, 0.0)]
    while True:
        t, h, v, impulse, work = found[-1]
        hit = first_root(lambda s: h + v * (s - t) - GRAVITY * (s - t) ** 2 / 2 - TABLE(s)[0], t, STOP)  # noqa: B023
        if hit == STOP:
            return found
        table, rate, _ = TABLE(hit)
        down = v - GRAVITY * (hit - t)
        push = (1 + BOUNCE) * (rate - down)
        found.append((hit, table, down + push, impulse + push, work + push * rate))


def answer(times):
    begin, h, v, impulse, work = np.array(flights())[np.searchsorted([f[0] for f in flights()], times) - 1].T
    return Answer((h + v * (times - begin) - GRAVITY * (times - begin) ** 2 / 2)[:, None], impulse, work)


def checks():
    """Momentum and energy from the start to the last flight, with what the impacts take."""
    found = flights()
    begin, h, v, impulse, work = found[-1]
    strikes = [up - GRAVITY * (hit - t) - TABLE(hit)[1] for (t, _, up, *_), (hit, *_) in pairwise(found)]
    lost = (1 - BOUNCE**2) / 2 * sum(strike**2 for strike in strikes)
    account = v**2 / 2 + GRAVITY * (h - HEIGHT) - work + lost
    momentum = v - impulse + GRAVITY * begin
    return {"momentum": abs(momentum), "energy account": abs(account / work), "impacts": len(strikes)}


TASK = Task(
    "shaken ball",
    STOP,
    constraint="contact",
    motions={"table": TABLE},
    asked=["height"],
    start={"height": (HEIGHT, 0.0)},
    answer=answer,
    checks=checks,
    component="BouncingBall",
    parameters={"bounce": BOUNCE},
    force="table_impulse",
)
