"""Balls in a row: impacts of all at once, by Moreau's rule, and one after the other."""

import numpy as np
from numpy.typing import NDArray

from liaisons.closed_forms import Values, closed_form


@closed_form("velocities [m/s] after ball 1 strikes others that touch and move together: Moreau's rule")
def moreau(at: Values) -> NDArray:
    """Return velocities of the balls, (n,): those struck move on as one body."""
    (first, *struck), v = at.mass, at.x_dot_0
    at.require(v[0] > v[1] and np.ptp(v[1:]) == 0, f"x_dot_0 = {v}: the balls struck must move together")
    impulse = (1 + at.bounce) * (v[0] - v[1]) * first * sum(struck) / (first + sum(struck))
    return v + impulse * np.array([-1 / first, *(1 / sum(struck) for _ in struck)])


@closed_form("velocities [m/s] after all impacts of ball 1 with 2 and of 2 with 3, one after the other from the left")
def sequence(at: Values) -> NDArray:
    """Return velocities at the start and after each impact, (impacts + 1, 3), of three balls with gaps between them."""
    m, v = at.mass, [at.x_dot_0]
    at.require(len(m) == 3, f"{len(m)} balls: of more than three the order depends on the gaps")
    while np.any(np.diff(v[-1]) < -1e-12 * np.max(np.abs(v[0]))):
        pair = int(np.argmin(np.diff(v[-1])))  # those of three balls alternate: the other pair parts
        before, masses = v[-1][pair : pair + 2], m[pair : pair + 2]
        impulse = (1 + at.bounce) * (before[0] - before[1]) / np.sum(1 / masses)
        v.append(v[-1].copy())
        v[-1][pair : pair + 2] += impulse / masses * [-1, 1]
    return np.array(v)


@closed_form("the motion of ball 1 up to others that touch and move together, and after Moreau's rule")
def exact(t: NDArray, at: Values) -> dict[str, NDArray]:
    x, v = at.x_0, at.x_dot_0
    after, gaps = moreau(at=at), np.diff(x) - at.diameter
    at.require(np.all(np.abs(gaps[1:]) <= 1e-9), f"x_0 = {x}: the balls struck must touch")
    impact = gaps[0] / (v[0] - v[1])
    rates = np.where(np.expand_dims(t, -1) < impact, v, after)
    return {"x": x + v * impact + rates * np.expand_dims(t - impact, -1), "x_dot": rates}
