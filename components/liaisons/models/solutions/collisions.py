"""Balls in a row: impacts of two at once, by Moreau's rule, and one after the other."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from liaisons.language import Values, closed_form
from liaisons.models.solutions.validity import require

MASSES = ("mass_1", "mass_2", "mass_3")
RATES = ("x_1_dot_0", "x_2_dot_0", "x_3_dot_0")


@closed_form("velocities [m/s] after ball 1 strikes two that touch and move together: Moreau's rule")
def moreau(at: Values) -> NDArray:
    """Ball 1 strikes both at once: they stay together, as one body of their mass."""
    (first, *struck), v = at.array(*MASSES), at.array(*RATES)
    require(v[0] > v[1] == v[2], f"BallRow.moreau: velocities {v}: ball 1 must strike two that move together")
    impulse = (1 + at.bounce) * (v[0] - v[1]) * first * sum(struck) / (first + sum(struck))
    return v + impulse * np.array([-1 / first, 1 / sum(struck), 1 / sum(struck)])


@closed_form("velocities [m/s] after all impacts of ball 1 with 2 and of 2 with 3, one after the other from the left")
def sequence(at: Values) -> NDArray:
    """What a gap between balls 2 and 3 gives, however small; (n + 1, 3): at the start, after each impact."""
    m, v = at.array(*MASSES), [at.array(*RATES)]
    while np.any(np.diff(v[-1]) < -1e-12 * np.max(np.abs(v[0]))):
        pair = int(np.argmin(np.diff(v[-1])))  # those of three balls alternate: the other pair parts
        before, masses = v[-1][pair : pair + 2], m[pair : pair + 2]
        impulse = (1 + at.bounce) * (before[0] - before[1]) / np.sum(1 / masses)
        v.append(v[-1].copy())
        v[-1][pair : pair + 2] += impulse / masses * [-1, 1]
    return np.array(v)


@closed_form("the motion of ball 1 up to two that touch and move together, and after Moreau's rule")
def exact(t: NDArray, at: Values) -> dict[str, NDArray]:
    x, v = at.array("x_1_0", "x_2_0", "x_3_0"), at.array(*RATES)
    after = moreau(at=at)
    require(abs(x[2] - x[1] - at.diameter) <= 1e-9, f"BallRow.exact: x_3_0 = {x[2]}: balls 2 and 3 must touch")
    impact = (x[1] - x[0] - at.diameter) / (v[0] - v[1])
    rates = np.where(np.expand_dims(t, -1) < impact, v, after)
    positions = x + v * impact + rates * np.expand_dims(t - impact, -1)
    names = ("x_1", "x_2", "x_3")
    return {f"{n}{end}": y[..., i] for end, y in (("", positions), ("_dot", rates)) for i, n in enumerate(names)}
