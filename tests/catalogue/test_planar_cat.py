"""The falling cat: Newton's and Euler's laws by hand, free fall, conserved angular momentum, and its holonomy.

A plane vector (x, z) is the complex number x + i z.
"""

from __future__ import annotations

import casadi as ca
import numpy as np
import pytest
from hand_derivations import Bodies
from numpy.typing import ArrayLike, NDArray
from on_paper import Values, defaults, derivative, equations_of
from scipy.integrate import dblquad, quad

from liaisons_catalogue.planar_cat import PlanarCat
from liaisons_motion import analysis


def test_phi_is_cyclic_and_x_k_vanishes() -> None:
    """φ appears nowhere: p_φ is constant (K 2.4), Θ and with it K_Y depend on the shape alone (M 8.4, first lines)."""
    equations = equations_of(PlanarCat)
    for expression in (equations.lagrangian, equations.effective_mass, equations.momentum_rates):
        assert not ca.depends_on(expression, equations.mechanism.phi)
    forces = ca.vertcat(equations.applied.drives, equations.applied.loads)
    free = ca.substitute(equations.momentum_rates, forces, ca.SX.zeros(forces.shape))
    assert free[0].is_zero()
    assert free[2].is_zero()


# ---- connection and curvature ------------------------------------------------------------------------------------

CAT: Values = {"mass_1": 0.8, "arm_2": 0.25, "inertia_2": 0.04, "hinge": 0.3}  # no symmetry
CONNECTION, CURVATURE = analysis.kinetic_connection(PlanarCat), analysis.curvature(PlanarCat)
CENTRE, SIZE = (0.9, -0.5), (0.8, 0.6)  # a loop of shapes: an ellipse


def angular_momenta(psi: ArrayLike, parameters: Values) -> list[float]:
    """I and J_α: what a unit rate of each angle makes."""
    still = {f"{q}{order}": 0.0 for q in ("phi", "psi_1", "psi_2") for order in ("", "_dot", "_ddot")}
    shape = defaults(PlanarCat) | parameters | still
    shape |= dict(zip(("psi_1", "psi_2"), np.asarray(psi), strict=True))
    rates = ("phi_dot", "psi_1_dot", "psi_2_dot")
    return [Bodies(shape | {rate: 1.0}).angular_momentum() for rate in rates]


def connection_by_hand(psi: ArrayLike, parameters: Values) -> NDArray:
    """J_α/I."""
    inertia, *couplings = angular_momenta(psi, parameters)
    return np.array(couplings) / inertia


def on_the_loop(s: float, centre=CENTRE, size=SIZE) -> NDArray:
    return np.array(centre) + np.array(size) * [np.cos(s), np.sin(s)]


def line_integral(centre=CENTRE, size=SIZE, parameters: Values = CAT) -> float:
    """Turn of the trunk in one counter-clockwise round of the ellipse: -∮ A_1 dψ_1 + A_2 dψ_2."""

    def integrand(s: float) -> float:
        psi, along = on_the_loop(s, centre, size), np.array(size) * [-np.sin(s), np.cos(s)]
        return float(-connection_by_hand(psi, parameters) @ along)

    return quad(integrand, 0, 2 * np.pi, epsabs=1e-12)[0]


@pytest.mark.parametrize("parameters", [{}, CAT])
def test_connection_is_the_one_by_hand_and_curvature_its_curl(parameters: Values) -> None:
    random = np.random.default_rng(3)
    for psi in random.uniform(-3, 3, (20, 2)):
        expected = connection_by_hand(psi, parameters)
        shape = dict(zip(("psi_1", "psi_2"), psi.tolist(), strict=True)) | parameters
        # φ' = Γ ψ' without angular momentum; roundings of some dozen terms.
        assert -CONNECTION.evaluate(**shape)[2] == pytest.approx(expected, rel=1e-12, abs=1e-14)
        turn_rate = PlanarCat.turn_rate(*psi, 0.7, -1.3, **parameters)
        assert turn_rate == pytest.approx(-expected @ [0.7, -1.3], rel=1e-12, abs=1e-14)
        along_1, along_2 = (
            derivative(lambda x, at=psi, axis=axis: connection_by_hand(at + x * axis, parameters), 0.0)
            for axis in np.eye(2)
        )
        curl = along_1[1] - along_2[0]
        # Order 10 with h = 0.02, and roundings of A/h.
        assert -CURVATURE.evaluate(**shape)[2] == pytest.approx(curl, abs=1e-10)


@pytest.mark.variants(core=0)
def test_line_integral_of_the_connection_is_the_area_integral_of_its_curvature() -> None:
    (x, y), (a, b) = CENTRE, SIZE

    def ring(radius: float, s: float) -> float:
        shape = x + a * radius * np.cos(s), y + b * radius * np.sin(s)
        return float(CURVATURE.evaluate(psi_1=shape[0], psi_2=shape[1], **CAT)[2]) * a * b * radius

    area = dblquad(ring, 0, 2 * np.pi, 0, 1, epsabs=1e-10)[0]
    assert line_integral() == pytest.approx(area, abs=1e-9)  # ten times the quadrature's
    around = analysis.holonomy(PlanarCat, lambda s: {"psi_1": x + a * ca.cos(s), "psi_2": y + b * ca.sin(s)}, **CAT)
    assert around["phi"] == pytest.approx(line_integral(), abs=1e-10)  # integration at 1e-12
    assert abs(area) > 0.01  # and it is a turn worth falling for
