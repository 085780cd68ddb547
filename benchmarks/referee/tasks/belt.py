"""A mass on a spring, on a belt that moves to and fro: it sticks and slips."""

from itertools import pairwise

import numpy as np
from scipy.integrate import quad

from referee.equations import pieces
from referee.task import GRAVITY, Answer, Task, sinusoid

STIFFNESS, GRIP, STOP = 10.0, 0.1 * GRAVITY, 6.4  # [N/m], [N], [s]; mass 1 kg
BELT, OMEGA = sinusoid(0.0, 0.5, 2.0), STIFFNESS**0.5


def at(t, piece):
    """Place, rate, force and work in a piece of the motion, which slips to one side, or sticks (0)."""
    begin, side, x, v, sigma, work = piece
    moved, rate, acceleration = BELT(t)
    moved = moved - sigma
    if side:  # an oscillation about the drag
        middle, angle = side * GRIP / STIFFNESS, OMEGA * (t - begin)
        place = middle + (x - middle) * np.cos(angle) + v / OMEGA * np.sin(angle)
        rate = v * np.cos(angle) - (x - middle) * OMEGA * np.sin(angle)
        return place, rate, side * GRIP, work + side * GRIP * moved
    gained = (rate**2 + STIFFNESS * (x + moved) ** 2 - v**2 - STIFFNESS * x**2) / 2
    return x + moved, rate, acceleration + STIFFNESS * (x + moved), work + gained


def leaves(t, piece):
    """Where the slip ends, or the force that keeps the mass on the belt exceeds the grip."""
    _, rate, force, _ = at(t, piece)
    return rate - BELT(t)[1] if piece[1] else abs(force) - GRIP


def following(t, piece):
    x, v, _, work = at(t, piece)
    needed = BELT(t)[2] + STIFFNESS * x
    sticks = piece[1] and abs(needed) <= GRIP
    return t, 0.0 if sticks else float(np.sign(needed)), x, v, BELT(t)[0], work


def reference(times):
    """Energy: work less what friction takes, by quadrature; the number of pieces says that it sticks and slips."""
    found = pieces((0.0, 1.0, 0.0, 0.0, 0.0, 0.0), leaves, following, STOP)
    values = np.array([at(t, [piece for piece in found if piece[0] <= t][-1]) for t in times])
    x, v, _, work = at(STOP, found[-1])
    lost = 0.0
    for piece, (end, *_) in pairwise([*found, (STOP,)]):
        slip = quad(lambda t, piece=piece: BELT(t)[1] - at(t, piece)[1], piece[0], end, epsabs=1e-13, epsrel=1e-13)
        lost += piece[1] * GRIP * slip[0]
    account = abs(work - lost - (v**2 + STIFFNESS * x**2) / 2) / abs(work)
    return Answer(values[:, :1], values[:, 2], values[:, 3]), {"energy account": account, "pieces": len(found)}


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
