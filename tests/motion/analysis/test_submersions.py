"""One mechanism in adapted coordinates and by a submersion: the geometry of its active constraints is the same."""

from __future__ import annotations

import casadi as ca
import numpy as np
import pytest
from numpy.typing import NDArray

from liaisons import ActiveCoordinate, Coordinate, Gravity, Mechanism, Parameter, rheonomic_constraint
from liaisons.errors import ComponentError
from liaisons.mechanics import derive
from liaisons.models import CartesianPendulum, IsokineticOscillator, Pendulum, PlanarCat
from liaisons_motion.analysis import (
    active_energy,
    active_hamiltonian,
    dynamic_field,
    dynamic_holonomy,
    effective_mass,
    holonomy,
    kinetic_connection,
)

ROUNDING = 1e-12  # some hundred operations on numbers of order 1, and the square root in the length


class Hung(Mechanism):
    """Pendulum in Cartesian coordinates: its pivot is two coordinates of L, its length the value of a constraint."""

    mass = Parameter(1.0, "kg", "mass of the bob", above=0)
    gravity = Gravity()
    x = Coordinate("m", "horizontal position", start=0.6)
    z = Coordinate("m", "height", start=-0.8)
    pivot_x = ActiveCoordinate("m", "horizontal position of the pivot")
    pivot_z = ActiveCoordinate("m", "height of the pivot")

    @rheonomic_constraint("m", "distance from the pivot to the bob", start=1.0, above=0)
    def length(self) -> ca.SX:
        return ca.norm_2(ca.vertcat(self.x - self.pivot_x, self.z - self.pivot_z))

    def kinetic_energy(self) -> ca.SX:
        return self.mass / 2 * self.speed_squared({"x": self.x, "z": self.z})

    def potential_energy(self) -> ca.SX:
        return self.mass * self.gravity * self.z


ACTIVES = ("length", "pivot_x", "pivot_z")  # in the order of the pendulum
OF_HUNG = [2, 0, 1]


class State:
    """A random state of both; F is the bob's position (θ, s) → (x, z)."""

    def __init__(self, seed: int) -> None:
        random = np.random.default_rng(seed)
        self.theta, self.theta_dot = random.uniform(-2, 2, 2)
        self.s = np.array([random.uniform(0.5, 1.5), *random.normal(size=2)])
        self.s_dot, self.mass = random.normal(size=3), random.uniform(0.5, 2)
        length, sine, cosine = self.s[0], np.sin(self.theta), np.cos(self.theta)
        self.along = np.array([sine, -cosine])  # unit vectors along the rod, and across it
        self.across = np.array([cosine, sine])
        self.F_theta = length * self.across
        self.F_s = np.column_stack([self.along, np.eye(2)])
        self.r = length * self.along + self.s[1:]
        self.r_dot = self.F_theta * self.theta_dot + self.F_s @ self.s_dot
        self.p = self.mass * self.r_dot

    @property
    def shared(self) -> dict[str, float]:
        active = dict(zip(ACTIVES, self.s, strict=True))
        return active | {f"{n}_dot": v for n, v in zip(ACTIVES, self.s_dot, strict=True)} | {"mass": self.mass}

    @property
    def adapted(self) -> dict[str, float]:
        return self.shared | {"theta": self.theta, "theta_dot": self.theta_dot}

    @property
    def cartesian(self) -> dict[str, float]:
        names = ("x", "z", "x_dot", "z_dot")
        return self.shared | dict(zip(names, (*self.r, *self.r_dot), strict=True))

    def seen(self, rates: NDArray, s_rates: NDArray) -> NDArray:
        """Rates of θ and p_θ = F_θ·p from those of (x, z, ..., p_x, p_z), while s has these."""
        r_rate, p_rate = rates[:2], rates[-2:]
        along_rod = r_rate - self.F_s @ s_rates
        theta_rate = self.across @ along_rod / self.s[0]
        F_theta_rate = s_rates[0] * self.across - self.s[0] * self.along * theta_rate
        assert self.along @ along_rod == pytest.approx(0, abs=ROUNDING)  # the length changes as it should
        return np.array([theta_rate, F_theta_rate @ self.p + self.F_theta @ p_rate])


@pytest.fixture(params=range(5))
def state(request: pytest.FixtureRequest) -> State:
    return State(request.param)


def test_energies_effective_mass_and_connection(state: State) -> None:
    for quantity in (active_hamiltonian, active_energy):
        values = quantity(Pendulum).evaluate(**state.adapted), quantity(Hung).evaluate(**state.cartesian)
        assert values[1] == pytest.approx(values[0], rel=ROUNDING), quantity.__name__
    theta = effective_mass(Pendulum).evaluate(**state.adapted)
    np.testing.assert_allclose(
        effective_mass(Hung).evaluate(**state.cartesian)[np.ix_(OF_HUNG, OF_HUNG)], theta, rtol=0, atol=1e-13
    )
    by_force = derive(Hung).evaluate("effective_mass", **state.cartesian)
    np.testing.assert_allclose(by_force[np.ix_(OF_HUNG, OF_HUNG)], theta, rtol=0, atol=1e-13)
    lifted = kinetic_connection(Hung).evaluate(**state.cartesian)[:, OF_HUNG]
    expected = np.outer(state.F_theta, kinetic_connection(Pendulum).evaluate(**state.adapted)) + state.F_s
    np.testing.assert_allclose(lifted, expected, rtol=0, atol=ROUNDING)


def test_three_terms_of_the_dynamic_field(state: State) -> None:
    adapted, cartesian = dynamic_field(Pendulum), dynamic_field(Hung)
    still = np.zeros(3)
    for term, s_rates in (("frozen", still), ("energy", still), ("lift", state.s_dot)):
        own = getattr(adapted, term).evaluate(**state.adapted)
        found = getattr(cartesian, term).evaluate(**state.cartesian)
        np.testing.assert_allclose(found[2:4], s_rates[1:], rtol=0, atol=ROUNDING)
        np.testing.assert_allclose(state.seen(found, s_rates), own[[0, -1]], rtol=0, atol=1e-13, err_msg=term)
    whole = state.seen(cartesian.evaluate(**state.cartesian), state.s_dot)
    equations = derive(Hung)
    np.testing.assert_allclose(whole[0], state.theta_dot, rtol=0, atol=1e-11)
    r_rates = [*state.r_dot, *equations.evaluate("momentum_rates", **state.cartesian)]
    np.testing.assert_allclose(whole, state.seen(np.array(r_rates), state.s_dot), rtol=0, atol=1e-12)


def test_passive_constraints_beside() -> None:
    """The CartesianPendulum, which is held in a plane, too."""
    theta, theta_dot, length, length_dot = 0.7, 0.4, 1.3, -0.6
    r = np.array([length * np.sin(theta), 1 - length * np.cos(theta)])
    v = length * theta_dot * np.array([np.cos(theta), np.sin(theta)])
    v += length_dot * np.array([np.sin(theta), -np.cos(theta)])
    here = {"x": r[0], "z": r[1], "x_dot": v[0], "z_dot": v[1], "rod": length, "rod_dot": length_dot, "mass": 1.7}
    lift = kinetic_connection(CartesianPendulum).evaluate(**here)
    np.testing.assert_allclose(lift.ravel(), [np.sin(theta), 0, -np.cos(theta)], rtol=0, atol=ROUNDING)
    assert float(effective_mass(CartesianPendulum).evaluate(**here)) == pytest.approx(1.7, abs=1e-13)
    assert active_energy(CartesianPendulum).evaluate(**here) == pytest.approx(1.7 / 2 * 0.36, rel=ROUNDING)
    energy = 1.7 / 2 * v @ v + 1.7 * 9.81 * r[1]
    assert active_hamiltonian(CartesianPendulum).evaluate(**here) == pytest.approx(energy, rel=ROUNDING)


# ---- transport -------------------------------------------------------------------------------------------------------


def loop(a: ca.SX) -> dict[str, ca.SX]:
    return {"length": 1 + 0.2 * ca.sin(a), "pivot_x": 0.5 * ca.sin(2 * a), "pivot_z": 0.4 * (ca.cos(a) - 1)}


def test_holonomy_of_a_submersion() -> None:
    theta = 0.8
    turned = theta + holonomy(Pendulum, loop, theta=theta)["theta"]
    moved = holonomy(Hung, loop, x=np.sin(theta), z=-np.cos(theta))
    expected = [np.sin(turned) - np.sin(theta), -np.cos(turned) + np.cos(theta)]
    np.testing.assert_allclose([moved["x"], moved["z"]], expected, rtol=0, atol=1e-10)
    with pytest.raises(ComponentError, match=r"Hung: length is off by 0\.4.* where the loop begins"):
        holonomy(Hung, loop, x=1.4, z=0.0)


def test_dynamic_transport_moves_momenta_with_the_map_of_fibres() -> None:
    """p δθ is constant: p is multiplied by 1/(∂θ'/∂θ), the derivative of the kinetic holonomy."""
    theta, p, step = 0.8, 1.7, 1e-3
    ends = [theta + k * step + holonomy(Pendulum, loop, theta=theta + k * step)["theta"] for k in (-2, -1, 1, 2)]
    slope = (ends[0] - 8 * ends[1] + 8 * ends[2] - ends[3]) / (12 * step)
    moved = dynamic_holonomy(Pendulum, loop, theta=theta, p_theta=p)
    assert moved["theta"] == pytest.approx(holonomy(Pendulum, loop, theta=theta)["theta"], abs=1e-11)
    assert abs(slope - 1) > 0.01
    assert p + moved["p_theta"] == pytest.approx(p / slope, rel=1e-9)  # the difference is of fourth order in 1e-3


def test_dynamic_holonomy_of_a_submersion() -> None:
    theta, p = 0.8, 1.7
    own = dynamic_holonomy(Pendulum, loop, theta=theta, p_theta=p)
    across = np.array([np.cos(theta), np.sin(theta)])
    moved = dynamic_holonomy(Hung, loop, x=np.sin(theta), z=-np.cos(theta), p_x=p * across[0], p_z=p * across[1])
    turned = theta + own["theta"]
    momentum = p * across + [moved["p_x"], moved["p_z"]]
    assert momentum @ [np.cos(turned), np.sin(turned)] == pytest.approx(p + own["p_theta"], abs=1e-10)
    np.testing.assert_allclose(np.sin(theta) + moved["x"], np.sin(turned), rtol=0, atol=1e-11)


def test_momenta_of_a_symmetry_are_not_moved() -> None:
    """The connection of a cat does not depend on its angle: its fibres are shifted."""
    circle = lambda a: {"psi_1": ca.sin(a), "psi_2": ca.cos(a) - 1}  # noqa: E731
    moved = dynamic_holonomy(PlanarCat, circle, p_phi=0.7)
    assert moved["p_phi"] == pytest.approx(0, abs=1e-13)
    assert moved["phi"] == pytest.approx(holonomy(PlanarCat, circle)["phi"], abs=1e-12)
    assert abs(moved["phi"]) > 0.01


def test_what_is_no_submersion_is_refused() -> None:
    for quantity in (active_hamiltonian, effective_mass, active_energy, kinetic_connection, dynamic_field):
        with pytest.raises(ComponentError, match=r"needs a submersion, and .* constrains rates alone"):
            quantity(IsokineticOscillator)
