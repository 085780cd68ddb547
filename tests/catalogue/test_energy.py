"""Every mechanism of the catalogue: dE/dt = power through its ports - dissipation (K eq. 67, M eq. 28)."""

from __future__ import annotations

import casadi as ca
import numpy as np
import pytest
from hand_derivations import MECHANISMS, WITHOUT_ORIENTATION, states
from on_paper import equations_of


@pytest.mark.variants(quick=None)
@pytest.mark.parametrize("component", MECHANISMS)
def test_energy_changes_by_the_power_of_the_ports_and_the_friction(component) -> None:
    equations = equations_of(component)
    m = equations.mechanism
    free, active = m.free, m.active
    where = ca.vertcat(free.q, active.s, free.q_dot, active.s_dot)
    rates = ca.vertcat(free.kinematics @ free.q_dot, active.s_dot, free.q_ddot, active.s_ddot)
    terms = ca.gradient(equations.energy, where) * rates  # dE/dt = Σ ∂E/∂x x'
    # On a motion one of force and rate is 0; here they are any numbers.
    forces, closing = (x[: len(component.unilaterals), 0] for x in (m.contact_forces, m.contact_rates()))
    pushed = ca.dot(forces, closing)
    for state in states(component):
        contributions = state(terms)
        expected = state(equations.power - equations.dissipation + pushed)
        # Two sums of the same size in doubles: some ten roundings of their largest term.
        assert abs(contributions.sum() - expected) <= 1e-13 * np.abs(contributions).sum()


@pytest.mark.variants(quick=None)
@pytest.mark.parametrize("component", WITHOUT_ORIENTATION)
def test_momentum_form_and_acceleration_form_are_the_same_motion(component) -> None:
    """d/dt of ∂L/∂q' along the accelerations is the momentum rate, which has no σ'' in it (M eq. 26, 36)."""
    equations = equations_of(component)
    m = equations.mechanism
    assert not ca.depends_on(equations.momentum_rates, m.active.s_ddot)
    assert not ca.depends_on(equations.velocities, m.active.s_ddot)
    for state in states(component):
        along = state(m.dot(equations.momenta))
        rate = state("momentum_rates")
        inertia = state(equations.mass_matrix @ m.free.q_ddot)
        # The term A q'' is what cancels; sums of ten roundings of it.
        np.testing.assert_allclose(along, rate, rtol=0, atol=1e-13 * max(1, np.abs(inertia).max(), np.abs(rate).max()))
