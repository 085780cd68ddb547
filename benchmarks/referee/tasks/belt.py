"""A mass on a spring, on a belt that moves to and fro: it sticks and slips."""

from itertools import pairwise

import numpy as np
from scipy.integrate import quad

from referee.equations import pieces
from referee.task import GRAVITY, Answer, Task, sinusoid

STIFFNESS, GRIP, STOP = 10.0, 0.1 * GRAVITY, 6.4  # [N/m], [N], [s]; mass 1 kg
BELT, OMEGA = sinusoid(0.0, 0.5, 2.0), STIFFNESS**0.5


def at(t, piece):
    """Place, rate, force and lost energy in a piece of the motion, which slips to one side, or sticks (0)."""
    begin, side, x, v, lost = piece
    moved, rate, acceleration = BELT(t)
    moved = moved - BELT(begin)[0]
    if not side:
        return x + moved, rate, acceleration + STIFFNESS * (x + moved), lost
    # An oscillation about the drag.
    middle, angle = side * GRIP / STIFFNESS, OMEGA * (t - begin)
    place = middle + (x - middle) * np.cos(angle) + v / OMEGA * np.sin(angle)
    rate = v * np.cos(angle) - (x - middle) * OMEGA * np.sin(angle)
    return place, rate, side * GRIP, lost + side * GRIP * (moved - place + x)


def leaves(t, piece):
    """Where the slip ends, or the force that keeps the mass on the belt exceeds the grip."""
    _, rate, force, _ = at(t, piece)
    return rate - BELT(t)[1] if piece[1] else abs(force) - GRIP


def following(t, piece):
    x, v, _, lost = at(t, piece)
    needed = BELT(t)[2] + STIFFNESS * x
    sticks = piece[1] and abs(needed) <= GRIP
    return t, 0.0 if sticks else float(np.sign(needed)), x, v, lost


def reference(times):
    """Work: energy and what friction takes, held against a quadrature of the power.

    The number of pieces says that it sticks and slips.
    """
    found = [*pieces((0.0, 1.0, 0.0, 0.0, 0.0), leaves, following, STOP)]
    x, v, force, lost = np.array([at(t, [piece for piece in found if piece[0] <= t][-1]) for t in times]).T
    work = (v**2 + STIFFNESS * x**2) / 2 + lost

    def power(t, piece):
        return at(t, piece)[2] * BELT(t)[1]

    ends = pairwise([*found, (STOP,)])
    gained = sum(quad(power, piece[0], end, (piece,), epsabs=1e-13, epsrel=1e-13)[0] for piece, (end, *_) in ends)
    return Answer(x[:, None], force, work), {"power": abs(gained / work[-1] - 1), "pieces": len(found)}


TASK = Task(
    "belt",
    STOP,
    {"belt": BELT},
    ["x"],
    "DryOscillator",
    reference,
    constraint="friction loss",
    springs={"x": STIFFNESS},
    parameters={"x_0": 0.0, "mu_static": 0.1, "mu_sliding": 0.1},
)
