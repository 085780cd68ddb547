"""The derived equations against Newton's and Euler's laws written down by hand: hand_derivations.py."""

from __future__ import annotations

import numpy as np
import pytest
from hand_derivations import BY_HAND, states


@pytest.mark.parametrize("component", BY_HAND)
def test_motion_and_operator_forces_are_those_of_newton(component) -> None:
    # Two evaluation orders of sums of ten terms: some ten roundings of the largest, which random states make up to ten
    # times the result; the mass matrix of the double pendulum has a condition of up to a hundred.
    for n in states(component):
        for quantity, expected in BY_HAND[component](n).items():
            np.testing.assert_allclose(n(quantity), expected, rtol=1e-12, atol=1e-12, err_msg=quantity)


@pytest.mark.parametrize("component", [c for c in BY_HAND if c.actives])
def test_effective_mass_is_the_force_that_one_more_unit_of_acceleration_asks_for(component) -> None:
    """M eq. 50: the columns of Θ are differences of the forces by hand, which are linear in σ''."""
    accelerations = [f"{active.name}_ddot" for active in component.actives]
    for n in states(component):
        at_rest = n | dict.fromkeys(accelerations, 0.0)
        zero, *forces = (
            BY_HAND[component](at_rest | more)["operator_forces"] for more in ({}, *({a: 1.0} for a in accelerations))
        )
        # Differences of forces of up to 1e4 N: roundings of 1e-12.
        np.testing.assert_allclose(n("effective_mass"), np.squeeze(np.subtract(forces, zero).T), atol=1e-10, rtol=0)
