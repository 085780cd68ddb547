"""Friction between parts: Rayleigh's dissipation function against equations by hand, at states and in FMUs."""

from __future__ import annotations

from pathlib import Path
from typing import Literal

import casadi as ca
import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from liaisons.check import max_error
from liaisons.cosim import simulate
from liaisons.errors import ComponentError
from liaisons.fmu import build
from liaisons.fmu.documentation.page import index_page
from liaisons.language import (
    Coordinate,
    Friction,
    Mechanism,
    Parameter,
    point,
)
from liaisons.mechanics import Equations, assemble, derive
from liaisons.models import KeplerOrbit, OscillatorChain

ROUNDING = 1e-12  # algebra in doubles: some ten operations on numbers of order 1


def random_state(equations: Equations, seed: int) -> dict[str, float]:
    rng = np.random.default_rng(seed)
    return {name: float(rng.uniform(0.5, 1.5)) for name in equations.symbols}


# ---- two rods, one joint with a damper in it ---------------------------------------------------------------------


class DampedJoint(Mechanism):
    """Two point masses on rods, the second hung on the first; a damper in the joint that joins them."""

    mass_1 = Parameter(1.3, "kg", "upper mass", above=0)
    mass_2 = Parameter(0.7, "kg", "lower mass", above=0)
    length_1 = Parameter(1.1, "m", "upper rod", above=0)
    length_2 = Parameter(0.8, "m", "lower rod", above=0)
    gravity = Parameter(9.81, "m/s2", "gravitational acceleration")
    damping = Parameter(0.4, "N.m.s", "of the joint between the rods")
    theta_1 = Coordinate("rad", "upper rod from the downward vertical", start=1.0)
    theta_2 = Coordinate("rad", "lower rod from the downward vertical", start=-0.5)

    @point("m", "upper mass")
    def elbow(self) -> dict[str, ca.SX]:
        return {"x": self.length_1 * ca.sin(self.theta_1), "z": -self.length_1 * ca.cos(self.theta_1)}

    @point("m", "lower mass")
    def hand(self) -> dict[str, ca.SX]:
        x, z = self.length_2 * ca.sin(self.theta_2), -self.length_2 * ca.cos(self.theta_2)
        return {"x": self.elbow["x"] + x, "z": self.elbow["z"] + z}

    def kinetic_energy(self) -> ca.SX:
        upper, lower = self.speed_squared(self.elbow), self.speed_squared(self.hand)
        return self.mass_1 / 2 * upper + self.mass_2 / 2 * lower

    def potential_energy(self) -> ca.SX:
        return self.gravity * (self.mass_1 * self.elbow["z"] + self.mass_2 * self.hand["z"])

    def dissipation_function(self) -> ca.SX:
        return self.damping / 2 * (self.dot(self.theta_2) - self.dot(self.theta_1)) ** 2


def two_rods(n: dict[str, float], theta: NDArray, rate: NDArray) -> NDArray:
    """Angular accelerations by Newton's laws: the damper's moment acts on both rods with opposite signs."""
    difference = theta[0] - theta[1]
    m, l_1, l_2 = n["mass_1"] + n["mass_2"], n["length_1"], n["length_2"]
    coupling = n["mass_2"] * l_1 * l_2
    A = [[m * l_1**2, coupling * np.cos(difference)], [coupling * np.cos(difference), n["mass_2"] * l_2**2]]
    moment = n["damping"] * (rate[1] - rate[0])
    upper = moment - coupling * np.sin(difference) * rate[1] ** 2 - m * n["gravity"] * l_1 * np.sin(theta[0])
    lower = -moment + coupling * np.sin(difference) * rate[0] ** 2 - n["mass_2"] * n["gravity"] * l_2 * np.sin(theta[1])
    return np.linalg.solve(A, [upper, lower])


def test_fmu_with_a_damper_in_its_joint(tmp_path: Path, backend: Literal["native", "python"]) -> None:
    fmu = build(assemble(DampedJoint), tmp_path, backend=backend)
    result = simulate(fmu, stop_time=5.0, step_size=0.05, tolerance=1e-10)
    n = {p.name: p.start for p in DampedJoint.parameters}

    def rates(_: float, y: NDArray) -> NDArray:
        return np.array([*y[2:4], *two_rods(n, y[:2], y[2:4]), n["damping"] * (y[3] - y[2]) ** 2])

    exact = solve_ivp(rates, (0, 5), [1.0, -0.5, 0, 0, 0], "DOP853", result.time, rtol=1e-13, atol=1e-15).y
    # 5 s of a motion that is not yet chaotic: a hundred tolerances.
    for name, values in zip(("theta_1", "theta_2", "theta_1_dot", "theta_2_dot", "dissipated"), exact, strict=True):
        assert max_error(result[name], values) <= 1e-7, name
    assert result["dissipated"][-1] > 1
    assert max_error(result["energy_balance"], 0.0) <= 1e-7


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
    page = index_page(assemble(DampedJoint)).decode()
    assert "<h3>Friction</h3>" in page
    assert "dissipation function" in page
    assert "<h3>Friction</h3>" not in index_page(assemble(KeplerOrbit)).decode()


def test_dissipation_function_is_a_power() -> None:
    with pytest.raises(ComponentError, match=r"Force\.dissipation_function: .* is J where W is expected: .* 1/s"):

        class Force(DampedJoint):
            """A force for a function."""

            def dissipation_function(self) -> ca.SX:
                return self.damping * self.dot(self.theta_1)
