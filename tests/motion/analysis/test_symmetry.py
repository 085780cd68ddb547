"""Conservation laws, similarity and virial against formulas worked out by hand, and their errata."""

from typing import Any

import casadi as ca
import numpy as np
import pytest

from liaisons import Coordinate, Mechanism, Parameter, constraint, unchecked
from liaisons.errors import ComponentError
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
from liaisons_motion import analysis

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


class Railed(Mechanism):
    """A mass on the rail x = 1, along which y (x - 1) of its potential is 0."""

    mass = Parameter(2.0, "kg", "mass", above=0)
    x = Coordinate("m", "distance from the rail and 1 m", start=1.0)
    y = Coordinate("m", "place along the rail")

    def kinetic_energy(self) -> ca.SX:
        return self.mass / 2 * (self.dot(self.x) ** 2 + self.dot(self.y) ** 2)

    @unchecked("numbers in SI units")
    def potential_energy(self) -> ca.SX:
        return self.y * (self.x - 1)

    @constraint("m", "on the rail", unchecked="numbers in SI units")
    def rail(self) -> ca.SX:
        return self.x - 1


def test_a_symmetry_that_holds_on_the_constraints_alone() -> None:
    """Shifted along the rail, L changes by 1 - x, which is 0 on it; beside it, states are projected onto it."""
    shifted = analysis.noether(Railed, lambda _: {"y": 1.0})
    assert shifted.evaluate(x=1.0, y=0.3, y_dot=1.5) == pytest.approx(3.0, rel=ROUNDING)
    free = type("Free", (Railed,), {"rail": None, "__module__": __name__})
    with pytest.raises(ComponentError, match="is no symmetry"):
        analysis.noether(free, lambda _: {"y": 1.0})


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


class Far(Mechanism):
    """A mass in a plane; in subclasses something begins 2 m away, of which nothing is seen near the start."""

    mass = Parameter(1.0, "kg", "mass", above=0)
    stiffness = Parameter(100.0, "N/m", "stiffness")
    damping = Parameter(1.0, "N.s/m", "damping")
    place = Parameter(2.0, "m", "where it begins")
    size = Parameter(1e-3, "m", "how far it reaches", above=0)
    rate = Parameter(3.0, "m/s", "rate at which friction begins")
    x = Coordinate("m", "place of the mass")
    y = Coordinate("m", "height of the mass")

    def kinetic_energy(self) -> ca.SX:
        return self.mass / 2 * (self.dot(self.x) ** 2 + self.dot(self.y) ** 2)

    def potential_energy(self) -> ca.SX:
        return ca.SX(0)


class Wall(Far):
    def potential_energy(self) -> ca.SX:
        return self.stiffness / 2 * ca.fmax(self.x - self.place, 0) ** 2


class RoundWall(Far):
    def potential_energy(self) -> ca.SX:
        return self.stiffness / 2 * ca.fmax(ca.norm_2(ca.vertcat(self.x, self.y)) - self.place, 0) ** 2


class Step(Far):
    def potential_energy(self) -> ca.SX:
        return ca.if_else(self.x > self.place, self.stiffness / 2 * (self.x - self.place) ** 2, 0)


class Well(Far):
    def potential_energy(self) -> ca.SX:
        return -self.stiffness * self.size**2 * ca.exp(-(((self.x - self.place) / self.size) ** 2))


class Stiffening(Far):
    def potential_energy(self) -> ca.SX:
        return self.stiffness / 2 * self.x**2 * (1 + (self.size * self.x / self.place**2) ** 2 * 1e-4)


class LateFriction(Far):
    def dissipation_function(self) -> ca.SX:
        return self.damping / 2 * ca.fmax(ca.fabs(self.dot(self.x)) - self.rate, 0) ** 2


@pytest.mark.parametrize("component", [Wall, Step, Well, Stiffening])
def test_what_begins_far_from_the_start_breaks_a_law(component: type[Far]) -> None:
    """V(x) is 0 up to a wall, 1e-300 beside a well of 1 mm, and of degree 2 up to 1e-11 of a length of its own."""
    assert list(analysis.cyclic_coordinates(component)) == ["y"]
    with pytest.raises(ComponentError, match=r"x: 1.0 is no symmetry: it changes L (at x = |where a condition)"):
        analysis.noether(component, lambda _: {"x": 1.0})
    with pytest.raises(ComponentError, match="not homogeneous in x, y: it has a length of its own"):
        analysis.similarity(component)


def test_friction_that_begins_at_a_rate_breaks_a_law() -> None:
    assert list(analysis.cyclic_coordinates(LateFriction)) == ["y"]
    with pytest.raises(ComponentError, match="moves against friction, drives or loads, which change"):
        analysis.noether(LateFriction, lambda _: {"x": 1})
    with pytest.raises(ComponentError, match="similarity has no friction"):
        analysis.similarity(LateFriction)


def test_laws_that_hold_on_both_sides_of_a_wall() -> None:
    """V = k/2 max(x, 0)² is of degree 2; what depends on r alone leaves turns as they are."""
    assert analysis.similarity(Wall, place=0.0).degree == pytest.approx(2, abs=1e-12)
    state = {"x": 1.0, "y": 3.0, "x_dot": 5.0, "y_dot": 2.0}
    assert analysis.noether(RoundWall, rotation).evaluate(**state) == pytest.approx(-13.0, rel=ROUNDING)
    assert not analysis.cyclic_coordinates(RoundWall)
