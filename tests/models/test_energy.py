"""Every mechanism of the catalogue: dE/dt = power through its ports - dissipation (K eq. 67, M eq. 28)."""

from __future__ import annotations

import casadi as ca
import numpy as np
import pytest

from liaisons.language import Mechanism
from liaisons.mechanics import derive
from liaisons.models import CATALOGUE

MECHANISMS = [  # those whose coordinates may take any values; the others have tests of their own
    c
    for c in CATALOGUE
    if issubclass(c, Mechanism) and not (c.orientations or c.constraints or c.non_holonomic or c.rheonomic_constraints)
]


@pytest.mark.parametrize("component", MECHANISMS, ids=lambda component: component.__name__)
def test_energy_changes_by_the_power_of_the_ports_and_the_friction(component, random_states, number) -> None:
    equations = derive(component)
    free, active = equations.mechanism.free, equations.mechanism.active
    where = ca.vertcat(free.q, active.s, free.q_dot, active.s_dot)
    rates = ca.vertcat(free.q_dot, active.s_dot, free.q_ddot, active.s_ddot)
    terms = ca.gradient(equations.energy, where) * rates  # dE/dt = Σ ∂E/∂x x'
    for state in random_states(equations):
        contributions = number(equations, terms, state)
        expected = number(equations, equations.power - equations.dissipation, state)
        # Two sums of the same size in doubles: some ten roundings of their largest term.
        assert abs(contributions.sum() - expected) <= 1e-13 * np.abs(contributions).sum()


@pytest.mark.parametrize("component", MECHANISMS, ids=lambda component: component.__name__)
def test_momentum_form_and_acceleration_form_are_the_same_motion(component, random_states, number) -> None:
    """d/dt of ∂L/∂q' along the accelerations is the momentum rate, which has no σ'' in it (M eq. 26, 36)."""
    equations = derive(component)
    m = equations.mechanism
    assert not ca.depends_on(equations.momentum_rates, m.active.s_ddot)
    assert not ca.depends_on(equations.velocities, m.active.s_ddot)
    for state in random_states(equations):
        along = number(equations, m.dot(equations.momenta), state)
        rate = number(equations, equations.momentum_rates, state)
        inertia = number(equations, equations.mass_matrix @ m.free.q_ddot, state)
        # The term A q'' is what cancels; sums of ten roundings of it.
        np.testing.assert_allclose(along, rate, rtol=0, atol=1e-13 * max(1, np.abs(inertia).max(), np.abs(rate).max()))
