"""Which expressions vanish identically, against identities of the textbooks and expressions that only seem to."""

import casadi as ca
import numpy as np
import pytest

from liaisons.expressions import nonzero_states

x, y = ca.SX.sym("x"), ca.SX.sym("y")
z = ca.vertcat(x, y)
RNG = np.random.default_rng(3)
STATES = RNG.uniform(-1, 1, (2, 40)) * 10 ** RNG.uniform(-2, 3, (2, 40))
NEAR = RNG.uniform(-0.5, 0.5, (2, 16))
r = ca.norm_2(z)
bump = ca.fmax(r - 2, 0) ** 3


@pytest.mark.parametrize(
    "identity",
    [
        (x + y) ** 3 - x**3 - 3 * x**2 * y - 3 * x * y**2 - y**3,
        ca.sin(x + y) - ca.sin(x) * ca.cos(y) - ca.cos(x) * ca.sin(y),
        ca.exp(x) * ca.exp(-x) - 1,  # underflows at some of the states
        ca.cosh(y) ** 2 - ca.sinh(y) ** 2 - 1,
        ca.jtimes(bump, z, ca.vertcat(-y, x)),  # a turn leaves r alone, on both sides of the wall
        ca.fabs(x) * ca.sign(x) - x,
        ca.fmax(x, y) + ca.fmin(x, y) - x - y,
        ca.if_else(x < y, y - x, x - y) - ca.fabs(x - y),
        ca.jtimes(ca.fmax(x, 0) ** 2, x, x) - 2 * ca.fmax(x, 0) ** 2,
    ],
)
def test_an_identity_vanishes(identity: ca.SX) -> None:
    assert nonzero_states(identity, z, STATES) == -1


@pytest.mark.parametrize(
    ("expression", "seen"),
    [
        (ca.exp(-(((x - 2) / 1e-3) ** 2)), False),  # 0 in doubles at every state
        (ca.fmax(x - 1e6, 0), False),  # beyond every state
        (ca.if_else(ca.logic_and(x > 1e5, y < -1e5), x, 0), False),
        (1e-200 * x, True),
        ((1 + 1e-7 * x) * (1 - 1e-7 * x) - 1, True),
        (x * y + ca.fabs(x * y - 50), True),
    ],
)
def test_what_only_seems_to_vanish(expression: ca.SX, seen: bool) -> None:
    """Each is 0 in doubles, or beside its terms, at all states near the start or all that are tried.

    ``seen``: whether some state shows it as it is, with no condition turned.
    """
    (found,) = nonzero_states(expression, z, np.hstack([NEAR, STATES]))
    assert found >= 0
    if seen:
        assert found < 56


def test_each_entry_is_judged_by_itself_and_the_first_state_is_told() -> None:
    states = np.array([[0.0, 1.0, 2.0], [0.0, 0.0, 3.0]])
    assert nonzero_states(ca.vertcat(x, y, x - x, 0, x * y), z, states).tolist() == [1, 2, -1, -1, 2]
    assert nonzero_states(ca.sqrt(-1 - x**2), z, states).tolist() == [3]  # nowhere a number: not claimed
