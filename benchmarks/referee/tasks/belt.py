"""A mass on a spring, on a belt that moves to and fro: it sticks and slips."""

import numpy as np
from scipy.optimize import brentq

from referee.bodies import body, joint
from referee.task import GRAVITY, Answer, Task, sinusoid

STIFFNESS, GRIP = 10.0, 0.1 * GRAVITY  # [N/m], [N]; mass 1 kg
BELT = sinusoid(0.0, 0.5, 2.0)
STOP = 6.4
OMEGA = STIFFNESS**0.5


def first_root(function, begin, step=1e-3):
    """Of a function of time, at which its sign changes; STOP if it does not."""
    t = begin + 1e-7
    while t < STOP:
        if function(t) * function(t + step) <= 0:
            return brentq(function, t, t + step, xtol=1e-16, rtol=1e-15)
        t += step
    return STOP


def pieces():
    """Of the motion: begin, end, direction of the drag (0: it sticks), place, rate and belt there, work till then."""
    t, x, v, work, found = 0.0, 0.0, 0.0, 0.0, []
    sign = 1.0
    while t < STOP:
        begin, sigma = t, BELT(t)[0]
        found.append((begin, sign, x, v, sigma, work))
        if sign:
            place, rate = slide(begin, sign, x, v)
            t = first_root(lambda t, rate=rate: rate(t) - BELT(t)[1], begin)
            x, v, work = place(t), BELT(t)[1], work + sign * GRIP * (BELT(t)[0] - sigma)
            needed = BELT(t)[2] + STIFFNESS * x
            sign = 0.0 if abs(needed) <= GRIP else float(np.sign(needed))
        else:
            grip = lambda t, x=x, sigma=sigma: BELT(t)[2] + STIFFNESS * (x + BELT(t)[0] - sigma)  # noqa: E731
            t = first_root(lambda t, grip=grip: abs(grip(t)) - GRIP, begin)
            x, before, v = x + BELT(t)[0] - sigma, (v**2 + STIFFNESS * x**2) / 2, BELT(t)[1]
            work += (v**2 + STIFFNESS * x**2) / 2 - before
            sign = float(np.sign(grip(t)))
    return found


def slide(begin, sign, x, v):
    """Place and rate while it slides: an oscillation about the drag."""
    middle = sign * GRIP / STIFFNESS

    def place(t):
        return middle + (x - middle) * np.cos(OMEGA * (t - begin)) + v / OMEGA * np.sin(OMEGA * (t - begin))

    def rate(t):
        return v * np.cos(OMEGA * (t - begin)) - (x - middle) * OMEGA * np.sin(OMEGA * (t - begin))

    return place, rate


def at(t, found):
    """Place, rate, force and work."""
    begin, sign, x, v, sigma, work = [piece for piece in found if piece[0] <= t][-1]
    moved, rate, acceleration = BELT(t)
    if sign:
        place, speed = slide(begin, sign, x, v)
        return place(t), speed(t), sign * GRIP, work + sign * GRIP * (moved - sigma)
    now = x + moved - sigma
    return (
        now,
        rate,
        acceleration + STIFFNESS * now,
        work + (rate**2 + STIFFNESS * now**2 - v**2 - STIFFNESS * x**2) / 2,
    )


def answer(times):
    values = np.array([at(t, pieces()) for t in times])
    return Answer(values[:, :1], values[:, 2], values[:, 3])


def checks():
    """Energy: work less what friction takes, by quadrature; the number of pieces says that it sticks and slips."""
    found = pieces()
    x, v, _, work = at(STOP, found)
    lost, nodes = 0.0, np.polynomial.legendre.leggauss(40)
    for (begin, sign, *start), end in zip(found, [*(p[0] for p in found[1:]), STOP], strict=True):
        rate = slide(begin, sign, *start[:2])[1]
        middle, half = (begin + end) / 2, (end - begin) / 2
        lost += sum(
            w * half * sign * GRIP * (BELT(middle + half * n)[1] - rate(middle + half * n))
            for n, w in zip(*nodes, strict=True)
        )
    return {"energy account": abs(work - lost - (v**2 + STIFFNESS * x**2) / 2) / abs(work), "pieces": len(found)}


TASK = Task(
    "belt",
    stop=STOP,
    bodies=body("mass", joint("x", "slide", "1 0 0", f'stiffness="{STIFFNESS}"'), mass=1.0)
    + body("track", joint("belt", "slide", "1 0 0"), mass=1e-3),
    more=f'<tendon><fixed name="grip" frictionloss="{GRIP}"><joint joint="x" coef="1"/><joint joint="belt" coef="-1"/>'
    "</fixed></tendon>",
    constraint="friction loss",
    motions={"belt": BELT},
    asked=[("x",)],
    answer=answer,
    checks=checks,
    component="DryOscillator",
    start_values={"x_0": 0.0, "mu_static": 0.1, "mu_sliding": 0.1},
    ports={"belt": "belt"},
    signals=["x"],
    springs={"x": STIFFNESS},
)
