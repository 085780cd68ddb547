"""Friction between parts: Rayleigh's dissipation function against equations by hand, at states and in FMUs."""

from __future__ import annotations

import casadi as ca
import numpy as np
import pytest

from liaisons.errors import ComponentError
from liaisons.fmu import extra_members
from liaisons.language import (
    Coordinate,
    Friction,
    Mechanism,
    Parameter,
)
from liaisons.mechanics import Equations, assemble, derive
from liaisons.models import KeplerOrbit, OscillatorChain

ROUNDING = 1e-12  # algebra in doubles: some ten operations on numbers of order 1


def random_state(equations: Equations, seed: int) -> dict[str, float]:
    rng = np.random.default_rng(seed)
    return {name: float(rng.uniform(0.5, 1.5)) for name in equations.symbols}


class DampedJoint(Mechanism):
    """Two rods on one axle, a damper between them."""

    inertia = Parameter(1.3, "kg.m2", "moment of inertia of each", above=0)
    damping = Parameter(0.4, "N.m.s", "of the damper")
    theta_1 = Coordinate("rad", "angle of the first rod")
    theta_2 = Coordinate("rad", "angle of the second rod")

    def kinetic_energy(self) -> ca.SX:
        return self.inertia / 2 * (self.dot(self.theta_1) ** 2 + self.dot(self.theta_2) ** 2)

    def dissipation_function(self) -> ca.SX:
        return self.damping / 2 * (self.dot(self.theta_2) - self.dot(self.theta_1)) ** 2


def test_declared_friction_needs_no_method() -> None:
    class Sledge(Mechanism):
        """Mass that is braked."""

        mass = Parameter(2.0, "kg", "mass", above=0)
        air = Friction("of the air")
        snow = Friction("of the snow")
        x = Coordinate("m", "position")

        def kinetic_energy(self) -> ca.SX:
            return self.mass / 2 * self.dot(self.x) ** 2

    sledge = derive(Sledge)
    n = random_state(sledge, 3) | {"air": 0.25, "snow": 0.5, "x_dot": 0.8, "p_x": 1.6, "x_force": 0.0, "x_load": 0.0}
    assert sledge.evaluate("accelerations", **n)[0] == pytest.approx(-0.75 * n["x_dot"], rel=ROUNDING)
    variables = {v.name: v for v in assemble(Sledge).parameters}
    assert (variables["air"].variability, variables["air"].description) == ("tunable", "of the air")


# ---- chains ------------------------------------------------------------------------------------------------------


class DampedChain(OscillatorChain):
    """Masses in a row with a damper beside each spring, both ends free, all braked by what they move in."""

    damping = Parameter(0.3, "N.s/m", "of each damper", minimum=0)
    air = Friction()

    def bond_dissipation(self) -> ca.SX:
        return self.damping / 2 * (self.dot(self.u) - self.dot(self.joint["x"])) ** 2


@pytest.mark.parametrize("air", [0.0, 0.4])
def test_dampers_of_a_free_chain_act_between_its_links(air: float) -> None:
    """M u'' = -(K u + C u') - η p with C ∝ K, the matrix of differences; without η the momenta have a constant sum."""
    n = 5
    model = assemble(DampedChain, n).flat()
    u, p = np.random.default_rng(5).normal(size=(2, n))
    k = {v.name: v.starts[0] for v in model.parameters} | {"air": air}
    z = model.outputs_function(0, [*u, *p, 0, 0], [0.0] * len(model.inputs), list(k.values()), [0, 0]).full()[:, 0]
    found = dict(zip((v.name for v in model.outputs), z, strict=True))
    difference = np.diff(np.eye(n), axis=0)
    v = p / k["mass"]
    forces = -difference.T @ (k["stiffness"] * (difference @ u) + 0.3 * (difference @ v)) - air * p
    rates = [found[f"p_u_dot[{i}]"] for i in range(1, n + 1)]
    np.testing.assert_allclose(rates, forces, rtol=0, atol=ROUNDING * 10)
    assert abs(sum(rates) + air * sum(p)) <= ROUNDING * 10
    assert found["dissipation"] == pytest.approx(0.3 * np.sum((difference @ v) ** 2) + air * p @ v, rel=ROUNDING)
    assert found["potential_energy"] == pytest.approx(k["stiffness"] / 2 * np.sum((difference @ u) ** 2), rel=ROUNDING)


# ---- what is said of it ------------------------------------------------------------------------------------------


def test_page_shows_the_dissipation_function() -> None:
    page = extra_members(assemble(DampedJoint), "2")["documentation/index.html"].decode()
    assert "<h3>Friction</h3>" in page
    assert "dissipation function" in page
    assert "<h3>Friction</h3>" not in extra_members(assemble(KeplerOrbit), "2")["documentation/index.html"].decode()


def test_dissipation_function_is_a_power() -> None:
    with pytest.raises(ComponentError, match=r"Force\.dissipation_function: .* is J where W is expected: .* 1/s"):

        class Force(DampedJoint):
            """A force for a function."""

            def dissipation_function(self) -> ca.SX:
                return self.damping * self.dot(self.theta_1)
