"""The falling cat: Newton's and Euler's laws by hand, free fall, conserved angular momentum, and its holonomy.

A plane vector (x, z) is the complex number x + i z.
"""

from __future__ import annotations

import casadi as ca
import numpy as np
import pytest
from hand_derivations import Bodies
from numpy.typing import ArrayLike, NDArray
from on_paper import INTERPOLATE, Values, assert_follows, defaults, derivative, equations_of
from scipy.integrate import dblquad, quad

from liaisons import analysis
from liaisons.check import max_error
from liaisons.cosim import Result, System
from liaisons.models.fourier_series import FourierSeries
from liaisons.models.planar_cat import PlanarCat


def test_phi_is_cyclic_and_x_k_vanishes() -> None:
    """φ appears nowhere: p_φ is constant (K 2.4), Θ and with it K_Y depend on the shape alone (M 8.4, first lines)."""
    equations = equations_of(PlanarCat)
    for expression in (equations.lagrangian, equations.effective_mass, equations.momentum_rates):
        assert not ca.depends_on(expression, equations.mechanism.phi)
    forces = ca.vertcat(equations.drives, equations.loads)
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


# ---- the FMU -----------------------------------------------------------------------------------------------------


LEAP: Values = {"com_x_dot_0": 0.7, "com_z_dot_0": 2.0}


def falling(
    fmu, *, frequency: float, stop_time: float, centre=CENTRE, size=SIZE, phases=(0.0, 1.0), spin=0.0, parameters=CAT
) -> Result:
    """A cat whose limbs go round the ellipse, started without angular momentum (and ``spin`` more of φ').

    :param phases: coefficients (of the cosine, of the sine) of ψ_2; ψ_1 follows the cosine.
    """
    rates = np.array([0.0, size[1] * phases[1] * frequency])
    shape = centre[0] + size[0], centre[1] + size[1] * phases[0]
    start = {"phi_dot_0": spin - float(connection_by_hand(shape, parameters) @ rates)} | LEAP
    system = System("falling cat")
    cat = system.add("cat", fmu(PlanarCat), input_reconstruction=INTERPOLATE, **start, **parameters)
    for i, (cosine, sine) in enumerate(((1.0, 0.0), phases), 1):
        loop = {"offset": centre[i - 1], "cos_1": size[i - 1] * cosine, "sin_1": size[i - 1] * sine}
        operator = system.add(f"operator_{i}", fmu(FourierSeries), angular_frequency=frequency, **loop)
        system.connect(operator["y"], cat[f"psi_{i}"])
    return system.simulate(stop_time=stop_time, step_size=2 * np.pi / abs(frequency) / 100, tolerance=1e-10)


@pytest.mark.parametrize("seconds", [0.5, 2.0, 8.0, -2.0])
def test_turn_in_a_loop_of_shapes_is_the_holonomy_however_fast(fmu, seconds: float) -> None:
    """Three rounds; a negative time runs them backwards."""
    rounds = 3
    result = falling(fmu, frequency=2 * np.pi / seconds, stop_time=rounds * abs(seconds))
    turn = result["cat.phi"][-1] - result["cat.phi"][0]
    # σ by Hermite's quintic: (ωH)⁶/46080 = 1e-12; the solver adds its 1e-10 a step, κ = 1, no more than 300 steps.
    assert turn == pytest.approx(rounds * np.sign(seconds) * line_integral(), abs=1e-8)


def test_loop_that_is_retraced_turns_nothing(fmu) -> None:
    result = falling(fmu, frequency=3.0, stop_time=2 * np.pi / 3, phases=(1.0, 0.0))
    assert np.ptp(result["cat.phi"]) > 0.1  # it turned, and turned back
    assert result["cat.phi"][-1] == pytest.approx(result["cat.phi"][0], abs=1e-8)  # as above


def test_loop_about_the_symmetric_shape_of_equal_limbs_turns_nothing(fmu) -> None:
    result = falling(fmu, frequency=3.0, stop_time=2 * np.pi / 3, centre=(0.0, 0.0), size=(0.8, 0.8), parameters={})
    assert result["cat.phi"][-1] == pytest.approx(0, abs=1e-8)  # as above
    assert line_integral((0.0, 0.0), (0.8, 0.8), {}) == pytest.approx(0, abs=1e-12)  # of the quadrature


def test_angular_momentum_adds_its_own_turn(fmu) -> None:
    """φ' = p_φ/I - A ψ': with angular momentum the turn depends on the time, by p_φ ∫ dt/I."""
    frequency, spin = 3.0, 0.4
    result = falling(fmu, frequency=frequency, stop_time=2 * np.pi / frequency, spin=spin)
    p_phi = result["cat.p_phi"][0]

    def rate(t: float) -> float:
        return p_phi / angular_momenta(on_the_loop(frequency * t), CAT)[0]

    own, _ = quad(rate, 0, 2 * np.pi / frequency, epsabs=1e-12)
    assert abs(own) > 0.1
    assert result["cat.phi"][-1] == pytest.approx(line_integral() + own, abs=1e-8)  # as above


def test_moving_limbs_leave_the_parabola_and_the_angular_momentum(fmu) -> None:
    """M eq. 59, and p_φ = L from positions and velocities of the bodies."""
    result = falling(fmu, frequency=7.0, stop_time=5.0, spin=0.3)
    exact = PlanarCat.exact(result.time, **LEAP)
    assert_follows(result, exact, 1e-12 * 130, "cat.", ("com_x", "com_x_dot", "com_z", "com_z_dot"))  # of 113 m
    assert max_error(result["cat.angular_momentum"], result["cat.p_phi"][0]) <= 1e-14  # a few roundings of 0.06
    scale = np.max(np.abs(result["cat.energy"])) + np.max(np.abs(result["cat.work"]))
    assert max_error(result["cat.energy_balance"], 0.0) <= 10 * 1e-10 * scale * 5.0  # ten tolerances a second
    assert np.max(np.abs(result["cat.work"])) > 0.1
