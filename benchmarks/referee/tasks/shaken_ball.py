"""A ball on a shaken table: it bounces; force is the sum of the table's impulses."""

import itertools

import numpy as np
from scipy.optimize import brentq

from referee.bodies import body, joint
from referee.task import GRAVITY, Answer, Task, sinusoid

TABLE = sinusoid(0.0, 0.05, 6.0)
BOUNCE, HEIGHT, STOP = 0.8, 0.5, 2.4


def flights():
    """Begin, height and velocity then, impulse and work till then."""
    t, h, v, impulse, work, found = 0.0, HEIGHT, 0.0, 0.0, 0.0, []
    while t < STOP:
        found.append((t, h, v, impulse, work))
        gap = lambda s, t=t, h=h, v=v: h + v * (s - t) - GRAVITY * (s - t) ** 2 / 2 - TABLE(s)[0]  # noqa: E731
        end = t + 1e-3
        while gap(end) > 0 and end < STOP:
            end += 1e-3
        if end >= STOP:
            break
        hit = brentq(gap, end - 1e-3, end, xtol=1e-16, rtol=1e-15)
        table, rate, _ = TABLE(hit)
        down = v - GRAVITY * (hit - t)
        push = (1 + BOUNCE) * (rate - down)
        t, h, v, impulse, work = hit, table, down + push, impulse + push, work + push * rate
    return found


def answer(times):
    found, values = flights(), []
    for t in times:
        begin, h, v, impulse, work = [flight for flight in found if flight[0] <= t][-1]
        values.append((h + v * (t - begin) - GRAVITY * (t - begin) ** 2 / 2, impulse, work))
    array = np.array(values)
    return Answer(array[:, :1], array[:, 1], array[:, 2])


def checks():
    """Momentum and energy from the start to the last flight, with what the impacts take."""
    found = flights()
    begin, h, v, impulse, work = found[-1]
    lost = 0.0
    for (t, _, up, *_), (hit, *_) in itertools.pairwise(found):
        lost += (1 - BOUNCE**2) / 2 * (up - GRAVITY * (hit - t) - TABLE(hit)[1]) ** 2
    energy = v**2 / 2 + GRAVITY * (h - HEIGHT)
    return {
        "momentum": abs(v - impulse + GRAVITY * begin),
        "energy account": abs(energy - work + lost) / abs(work),
        "impacts": len(found) - 1,
    }


TASK = Task(
    "shaken ball",
    stop=STOP,
    bodies=body(
        "plate", joint("table", "slide") + '<geom name="plate" type="box" size="1 1 0.1" pos="0 0 -0.1"/>', mass=1e3
    )
    + body("ball", joint("height", "slide") + '<geom name="ball" type="sphere" size="0.05" pos="0 0 0.05"/>', mass=1.0),
    constraint="contact",
    motions={"table": TABLE},
    asked=[("height",)],
    start={"height": (HEIGHT, 0.0)},
    answer=answer,
    checks=checks,
    component="BouncingBall",
    start_values={"height_0": HEIGHT, "bounce": BOUNCE},
    ports={"table": "table"},
    signals=["height"],
    force="table_impulse",
)
