"""Conservation laws, similarity and virial against formulas worked out by hand, and their errata."""

from typing import Any

import casadi as ca
import numpy as np
import pytest

from liaisons import analysis
from liaisons.models import (
    ChargedParticle,
    FreeParticle,
    KeplerOrbit,
    LinearMolecule,
    Oscillator,
    Pendulum,
    PlanarOscillator,
    PolarOscillator,
)

ROUNDING = 1e-13  # a few dozen operations on numbers of order 1 to 10


def rotation(m: Any) -> dict[str, ca.SX]:
    return {"x": -m.y, "y": m.x}


def test_rotations_conserve_angular_momentum() -> None:
    """K eq. 51; in a magnetic field the canonical one, m (x y' - y x') + ½ Q B (x² + y²)."""
    state = {"x": 2.0, "y": 1.0, "x_dot": 3.0, "y_dot": 4.0, "mass": 0.5}
    for component in (KeplerOrbit, PlanarOscillator):
        assert analysis.noether(component, rotation).evaluate(**state) == pytest.approx(2.5, rel=ROUNDING)
    canonical = analysis.noether(ChargedParticle, rotation).evaluate(charge=2.0, B_z=3.0, **state)
    assert canonical == pytest.approx(2.5 + 0.5 * 6.0 * 5.0, rel=ROUNDING)


@pytest.mark.parametrize(
    ("component", "held", "degree"),
    [
        (Oscillator, {}, 2),
        (PolarOscillator, {}, 2),  # the angle does not scale
        (LinearMolecule, {"spacing": 0.0}, 2),
        (FreeParticle, {}, 1),
        (KeplerOrbit, {}, -1),
    ],
)
def test_degree_of_homogeneity(component, held, degree) -> None:
    found = analysis.similarity(component, **held)
    assert found.degree == pytest.approx(degree, abs=1e-12)  # a regression over 16 states
    assert found.time_ratio(4.0) == pytest.approx(2.0 ** (2 - degree), rel=1e-11)


def test_virial_under_a_force_that_changes() -> None:
    """x = cos 3t by F = -8 cos 3t."""
    t = np.linspace(0, 2, 401)
    x = np.cos(3 * t)
    driven = analysis.virial(Oscillator, t, {"x": x, "x_dot": -3 * np.sin(3 * t), "x_force": -8 * x})
    assert abs(driven.residual) < 1e-7  # (3 h)⁴ = 5e-8


def test_virial_of_an_orbit_over_any_time_and_over_a_period() -> None:
    """2 T̄ - mean(r·∂V/∂r) = [p·r]/τ; the printed p·r' in its place is wrong (K 2.7, KA11)."""
    start = {"x_0": 1.0, "y_dot_0": 1.2}
    t = np.linspace(0.0, 7.0, 2001)
    motion = KeplerOrbit.exact(t, **start)
    found = analysis.virial(KeplerOrbit, t, motion)
    # Corrected trapezoidal rule: h⁴/720 times the change of a third derivative, of order 10 here.
    assert abs(found.residual) < 1e-11
    p_r = motion["x"] * motion["x_dot"] + motion["y"] * motion["y_dot"]
    assert found.boundary == pytest.approx((p_r[-1] - p_r[0]) / 7.0, rel=1e-12)
    assert found.boundary != pytest.approx(0.0, abs=1e-3)
    square = motion["x_dot"] ** 2 + motion["y_dot"] ** 2
    printed = (square[-1] - square[0]) / 7.0
    assert abs(2 * found.kinetic - found.virial - printed) > 1e-2

    period = KeplerOrbit.period(**start)
    t = np.linspace(0.0, period, 2001)
    whole = analysis.virial(KeplerOrbit, t, KeplerOrbit.exact(t, **start))
    energy = 1.2**2 / 2 - 1
    # K eq. 75 holds over whole periods; rounding of Kepler's equation and of 2000 summands
    assert (whole.kinetic, whole.potential) == pytest.approx(analysis.Similarity(-1).mean_energies(energy), rel=1e-11)


def test_quantities_broadcast_and_take_rates_for_momenta() -> None:
    V = analysis.phase_velocity(Pendulum)
    theta, p = np.linspace(-1, 1, 5)[:, None], np.array([0.0, 1.0, 2.0])
    field = V.evaluate(theta=theta, p_theta=p, length=2.0)
    assert field.shape == (2, 5, 3)
    np.testing.assert_allclose(field[0], np.broadcast_to(p / 4, (5, 3)), rtol=ROUNDING)
    np.testing.assert_allclose(field[1], np.broadcast_to(-2 * 9.81 * np.sin(theta), (5, 3)), rtol=ROUNDING, atol=1e-14)
    by_rate = V.evaluate(theta=0.3, theta_dot=0.7, length=2.0)
    np.testing.assert_allclose(by_rate, V.evaluate(theta=0.3, p_theta=2.8, length=2.0), rtol=ROUNDING)
