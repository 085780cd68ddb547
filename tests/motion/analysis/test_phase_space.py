"""Hamilton's mechanics on components whose Hamiltonian, brackets and flow are known in closed form; and the errata."""

import casadi as ca
import numpy as np
import pytest

from liaisons.language import Friction, Mechanism
from liaisons.mechanics import derive
from liaisons.models import (
    CATALOGUE,
    ChargedParticle,
    Oscillator,
    Pendulum,
)
from liaisons_motion import analysis

ROUNDING = 1e-12  # algebra in doubles: a few hundred operations on numbers of order 1 to 10
FLOW = 1e-9  # integration at tolerance 1e-11, amplification below 10, and determinants of entries below 10


def test_hamiltonian_of_a_charge() -> None:
    """K Ex. 7: H = (p - Q A)²/2m + Q φ, A = ½ B∧r, φ = -E·r."""
    m, Q, B, E = 0.6, 1.4, np.array([0.2, -0.5, 1.1]), np.array([0.3, 0.1, -0.7])
    r, p = np.array([0.5, -1.2, 0.8]), np.array([1.0, 0.4, -0.3])
    values = dict(zip(("B_x", "B_y", "B_z", "E_x", "E_y", "E_z"), [*B, *E], strict=True))
    state = dict(zip(("x", "y", "z", "p_x", "p_y", "p_z"), [*r, *p], strict=True))
    kinetic = p - Q * np.cross(B, r) / 2
    expected = kinetic @ kinetic / (2 * m) - Q * E @ r
    H = analysis.hamiltonian(ChargedParticle).evaluate(mass=m, charge=Q, **values, **state)
    assert pytest.approx(expected, rel=ROUNDING) == H


INDEPENDENT = [
    c
    for c in CATALOGUE
    if issubclass(c, Mechanism)
    and not (c.constraints or c.non_holonomic or c.rheonomic_constraints or c.internal_states)
    and not (c.unilaterals or c.dry_frictions)
]


@pytest.mark.parametrize("component", INDEPENDENT)
def test_hamiltons_and_marles_equations_are_the_equations_of_motion(component: type[Mechanism]) -> None:
    """K eq. 81, 82, and D_0 - X_K + H(Y) = (ẋ, Y, ṗ) of M eq. 52, against the momentum form derived from ∂L/∂q."""
    equations, rng = derive(component), np.random.default_rng(3)
    m = equations.mechanism
    moving = ca.vertcat(m.free.q, m.free.p, m.active.s_dot)
    state = {str(symbol): rng.uniform(0.1, 1) for symbol in ca.vertsplit(moving)}
    for turn in m.orientations:
        attitude = rng.normal(size=4)
        state |= dict(zip(turn.quaternion, attitude / np.linalg.norm(attitude), strict=True))
    state |= {p.name: 0.0 for p in m.parameters if isinstance(p, Friction) or p.name.endswith("damping")}
    motion, count = analysis.phase_velocity(equations).evaluate(**state), m.free.q.shape[0]
    size = 1e-11 * (1 + np.abs(motion).max())  # a metric of condition 100 is inverted
    hamilton = analysis.hamilton_equations(equations).evaluate(**state)
    np.testing.assert_allclose(hamilton, motion, rtol=1e-11, atol=size)
    if m.actives:
        marle = [*motion[:count], *(state[f"{s.name}_dot"] for s in m.actives), *motion[count:]]
        np.testing.assert_allclose(analysis.dynamic_field(equations).evaluate(**state), marle, rtol=1e-11, atol=size)


def test_the_printed_divergence_differentiates_the_wrong_way_round() -> None:
    """K eq. 101 (KA13)."""
    V = analysis.phase_velocity(Pendulum)
    free = V.equations.mechanism.free
    printed = ca.jacobian(V.expression[1], free.q) + ca.jacobian(V.expression[0], free.p)
    # ∂p'/∂θ + ∂θ'/∂p = -m g l cos θ + 1/(m l²)
    wrong = analysis.Quantity(V.equations, printed).evaluate(theta=1.0)
    assert wrong == pytest.approx(-9.81 * np.cos(1.0) + 1, rel=ROUNDING)


def test_flow_of_the_oscillator_is_a_rotation_of_phase_space() -> None:
    """J = [[cos ωt, sin ωt/(m ω)], [-m ω sin ωt, cos ωt]]; with damping det J = exp(-γ t)."""
    m, k, t = 0.5, 2.0, 3.0
    flow = analysis.flow(Oscillator, t, mass=m, stiffness=k, x=0.4, x_dot=0.3)
    c, s = np.cos(2.0 * t), np.sin(2.0 * t)
    expected = np.array([[c, s / (m * 2.0)], [-m * 2.0 * s, c]])
    np.testing.assert_allclose(flow.jacobian, expected, rtol=0, atol=FLOW)
    assert [flow.state["x"], flow.state["p_x"]] == pytest.approx(expected @ [0.4, m * 0.3], abs=FLOW)
    assert flow.determinant == pytest.approx(1.0, abs=FLOW)
    moved = analysis.flow(Oscillator, t, mass=m, stiffness=k, x=0.4, x_dot=0.3, support=lambda t: 0.1 + 0.2 * t)
    np.testing.assert_allclose(moved.jacobian, expected, rtol=0, atol=FLOW)
    x, p = expected @ [0.4 - 0.1, m * (0.3 - 0.2)]  # about the support
    assert [moved.state["x"], moved.state["p_x"]] == pytest.approx([0.1 + 0.2 * t + x, m * 0.2 + p], abs=FLOW)
    damped = analysis.flow(Oscillator, t, mass=m, stiffness=k, damping=0.4)
    assert damped.determinant == pytest.approx(np.exp(-0.4 * t), rel=FLOW)


def test_a_short_flow_has_the_divergence_to_first_order_in_its_time() -> None:
    """det J(dt) = 1 + dt ∇·V + O(dt²) (K eq. 100); the identity printed before it lacks the ε (KA14)."""
    dt, damping = 1e-3, 0.4
    growth = analysis.flow(Oscillator, dt, damping=damping).determinant - 1
    assert growth == pytest.approx(-damping * dt, abs=(damping * dt) ** 2)
    assert abs(growth + damping) > 0.1
