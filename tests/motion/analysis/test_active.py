"""Marle's geometry of active constraints on hoop, swing, pivot and cat, against formulas worked out by hand."""

import casadi as ca
import numpy as np
import pytest

from liaisons.errors import ComponentError
from liaisons.language import Friction, Mechanism
from liaisons.mechanics import derive
from liaisons.models import CATALOGUE, CircularHoop, Pendulum
from liaisons_motion import analysis

ROUNDING = 1e-13  # a few dozen operations on numbers of order 1
HOOP = {"xi": 0.7, "beta": 0.2, "p_xi": 1.3, "beta_dot": 0.9, "mass": 0.8, "hoop_inertia": 0.3}
R, d = 1.0, 0.5  # defaults of the hoop


def hoop_geometry(xi: float) -> tuple[float, float, float, float]:
    """a = r²θ' = R + d cos ψ, b = r²r'² = d² sin² ψ and their derivatives by ξ."""
    psi = xi / R
    return R + d * np.cos(psi), d**2 * np.sin(psi) ** 2, -d / R * np.sin(psi), d**2 / R * np.sin(2 * psi)


def test_three_terms_of_the_dynamic_field_of_the_hoop() -> None:
    """M eq. 65-67, and their sum, M eq. 64."""
    m, p, Y = HOOP["mass"], HOOP["p_xi"], HOOP["beta_dot"]
    a, _, a_dash, b_dash = hoop_geometry(HOOP["xi"])
    D = analysis.dynamic_field(CircularHoop)
    np.testing.assert_allclose(D.frozen.evaluate(**HOOP), [p / m, 0, 0], rtol=0, atol=ROUNDING)
    np.testing.assert_allclose(D.energy.evaluate(**HOOP), [0, 0, m / 2 * b_dash * Y**2], rtol=0, atol=ROUNDING)
    np.testing.assert_allclose(D.lift.evaluate(**HOOP), [-a * Y, Y, a_dash * p * Y], rtol=0, atol=ROUNDING)
    whole = [p / m - a * Y, Y, a_dash * p * Y + m / 2 * b_dash * Y**2]
    np.testing.assert_allclose(D.evaluate(**HOOP), whole, rtol=0, atol=ROUNDING)


def test_holonomy_where_areas_do_not_add_up() -> None:
    """A pivot moved round a small square-free circle turns the rod by F times its area to leading order."""
    radius = 1e-3
    loop = lambda a: {"pivot_x": radius * ca.cos(a), "pivot_z": radius * ca.sin(a)}  # noqa: E731
    turn = analysis.holonomy(Pendulum, loop, theta=0.8, length=1.3)["theta"]
    assert turn == pytest.approx(np.pi * radius**2 / 1.3**2, rel=5 * radius)  # next order: radius/length


# ---- Hamilton's equations with multipliers -----------------------------------------------------------------------

RANKS = {
    "BouncingBall": (1, 2),  # the table has no mass
    "CircularHoop": (2, 2),
    "DoublePendulum": (3, 4),  # one bob in the plane, the other about it
    "Arm": (9, 9),
    "CarAxis": (3, 3),
    "DryOscillator": (1, 3),  # nor belt and support
    "EllipticHoop": (2, 2),
    "FourierHoop": (2, 2),
    "Junction": (1, 3),
    "LinkedCat": (5, 5),
    "Oscillator": (1, 2),
    "Pendulum": (2, 4),  # one bob in the plane
    "PlanarCat": (5, 5),
    "Satellite": (6, 6),
    "Scara": (4, 4),
    "SlewingCrane": (4, 4),
    "SpatialCat": (9, 9),
    "StringPendulum": (2, 5),
    "Swing": (3, 3),
}
ADAPTED = [
    c
    for c in CATALOGUE
    if issubclass(c, Mechanism)
    and c.actives
    and not (c.constraints or c.non_holonomic or c.rheonomic_constraints or c.unilaterals or c.dry_frictions)
]


@pytest.mark.parametrize("component", ADAPTED, ids=lambda component: component.__name__)
def test_hamiltons_equations_with_multipliers_are_motion_and_operator_forces(component: type[Mechanism]) -> None:
    """M eq. 36-38 on T*M where L is hyper-regular, and on V*M, against Lagrange's equations (M eq. 26, 27)."""
    equations, rng = derive(component), np.random.default_rng(5)
    m = equations.mechanism
    moving = ca.vertcat(m.free.q, m.free.q_dot, m.active.s_dot, m.active.s_ddot)
    state = {str(symbol): rng.uniform(0.1, 1) for symbol in ca.vertsplit(moving)}
    state |= {item.name: item.start + 0.1 for item in m.actives}
    for turn in m.orientations:
        attitude = rng.normal(size=4)
        state |= dict(zip(turn.quaternion, attitude / np.linalg.norm(attitude), strict=True))
    state |= {p.name: 0.0 for p in m.parameters if isinstance(p, Friction) or p.name.endswith("damping")}
    motion = analysis.phase_velocity(equations).evaluate(**state)
    expected = np.append(motion, equations.evaluate("operator_forces", **state))
    size = 1e-12 * (1 + np.abs(expected).max())  # a metric of condition 100 is inverted
    reduced = analysis.reduced_multiplier_equations(equations).evaluate(**state)
    np.testing.assert_allclose(reduced, expected, rtol=0, atol=size)
    assert analysis.legendre_rank(equations) == RANKS[component.__name__]
    if len(set(RANKS[component.__name__])) == 1:
        whole = analysis.multiplier_equations(equations).evaluate(**state)
        np.testing.assert_allclose(whole, expected, rtol=0, atol=size)
    else:
        with pytest.raises(ComponentError, match=r"L is not hyper-regular: .* rank \d of \d .*reduced_multiplier"):
            analysis.multiplier_equations(equations)


def test_a_hoop_without_inertia_is_degenerate_where_the_bead_runs_across_the_radius() -> None:
    """det g = m² r² r'² for I = 0 (M 8.4): what I is there for."""
    assert analysis.legendre_rank(CircularHoop, hoop_inertia=0.0, xi=0.0) == (1, 2)
    assert analysis.legendre_rank(CircularHoop, hoop_inertia=0.0, xi=1.0) == (2, 2)
