"""Friction between parts: Rayleigh's dissipation function against equations by hand, at states and in FMUs."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Literal

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
    ActiveCoordinate,
    Coordinate,
    Friction,
    InternalState,
    Mechanism,
    Orientation,
    Parameter,
    point,
)
from liaisons.mechanics import Equations, assemble, derive
from liaisons.models import OscillatorChain

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


@pytest.mark.parametrize("seed", range(10))
def test_damper_in_a_joint_is_newtons(seed: int) -> None:
    equations = derive(DampedJoint)
    loads = {name: 0.0 for name in equations.symbols if name.endswith(("_force", "_load"))}
    n = random_state(equations, seed) | loads
    theta, rate = (np.array([n[f"theta_{i}{end}"] for i in (1, 2)]) for end in ("", "_dot"))
    expected = two_rods(n, theta, rate)
    np.testing.assert_allclose(equations.evaluate("accelerations", **n), expected, rtol=1e-11)  # condition 100
    lost = n["damping"] * (rate[1] - rate[0]) ** 2
    assert equations.evaluate("dissipation", **n) == pytest.approx(lost, rel=ROUNDING)


@pytest.mark.parametrize("backend", ["native", "python"])
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


# ---- the energy account ------------------------------------------------------------------------------------------


class Drag(Mechanism):
    """Everything at once: free and active rates, powers beside squares, a thermostat's sign, friction of K eq. 64."""

    mass = Parameter(1.3, "kg", "mass", above=0)
    eta = Parameter(0.3, "1/s", "friction coefficient")
    damping = Parameter(0.7, "N.s/m", "against the sleeve")
    drag = Parameter(0.2, "kg/m", "in the air")
    stiffness = Parameter(2.0, "N/m", "of the springs")
    x = Coordinate("m", "a bead", start=1.0)
    y = Coordinate("m", "another one", start=1.0)
    sleeve = ActiveCoordinate("m", "a sleeve that both rub against")
    xi = InternalState("1", "of either sign")

    def kinetic_energy(self) -> ca.SX:
        shared = self.dot(self.x) + self.dot(self.sleeve) + self.dot(self.y) * self.x / (self.x + self.y)
        return self.mass / 2 * (shared**2 + self.dot(self.y) ** 2)

    def potential_energy(self) -> ca.SX:
        return self.stiffness / 2 * ((self.x - self.sleeve) ** 2 + self.y**2)

    def friction_coefficient(self) -> ca.SX:
        return self.eta

    def dissipation_function(self) -> ca.SX:
        along, across = self.dot(self.x) - self.dot(self.sleeve), self.dot(self.y)
        return self.xi * self.damping / 2 * along**2 + self.drag / 3 * ca.fabs(across - along / 2) ** 3

    def internal_rates(self) -> dict[str, ca.SX]:
        return {"xi": self.eta}


DRAG = derive(Drag)


@pytest.mark.parametrize("seed", range(20))
def test_energy_changes_by_the_power_of_ports_less_that_of_friction(seed: int) -> None:
    """dE/dt = Σ λ σ̇ + drives - Σ q̇ ∂D/∂q̇ - Σ σ̇ ∂D/∂σ̇, also where ξ < 0 drives."""
    n = random_state(DRAG, seed) | {"xi": float(np.random.default_rng(seed).normal())}
    n["y_dot"] = float(np.random.default_rng(seed + 100).normal())
    m = DRAG.mechanism
    along = ca.dot(ca.gradient(DRAG.energy, m.free.q), m.free.q_dot) + ca.dot(
        ca.gradient(DRAG.energy, m.active.s), m.active.s_dot
    )
    along += ca.dot(ca.gradient(DRAG.energy, m.free.q_dot), m.free.q_ddot)
    along += ca.dot(ca.gradient(DRAG.energy, m.active.s_dot), m.active.s_ddot)
    change = float(ca.Function("change", list(DRAG.symbols.values()), [DRAG.in_motion(along)])(*n.values()))
    power, dissipation = (DRAG.evaluate(quantity, **n) for quantity in ("power", "dissipation"))
    assert change == pytest.approx(float(power[0] - dissipation[0]), abs=1e-11)  # sums of terms of order 100

    # What friction takes, by hand.
    along_sleeve, across = n["x_dot"] - n["sleeve_dot"], n["y_dot"]
    lost = n["xi"] * n["damping"] * along_sleeve**2 + n["drag"] * abs(across - along_sleeve / 2) ** 3
    lost += 2 * n["eta"] * DRAG.evaluate("kinetic_energy", **n)[0]
    assert dissipation == pytest.approx(lost, rel=ROUNDING, abs=ROUNDING)


def test_friction_coefficient_is_the_simplest_dissipation_function() -> None:
    class Stated(Drag):
        """The same friction, all of it in one function."""

        def friction_coefficient(self) -> ca.SX:
            return ca.SX(0)

        def dissipation_function(self) -> ca.SX:
            return Drag.dissipation_function(self) + self.eta * self.kinetic_energy()

    stated = derive(Stated)
    n = random_state(DRAG, 1)
    for quantity in ("momentum_rates", "accelerations", "operator_forces", "power", "dissipation"):
        np.testing.assert_allclose(DRAG.evaluate(quantity, **n), stated.evaluate(quantity, **n), rtol=ROUNDING)


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


class Clutch(Mechanism):
    """A wheel, and a shaft that an operator turns, with oil between them."""

    wheel_moment = Parameter(0.5, "kg.m2", "of the wheel", above=0)
    shaft_moment = Parameter(0.2, "kg.m2", "of the shaft", above=0)
    oil = Parameter(0.3, "N.m.s", "moment over difference of rates")
    wheel = Coordinate("rad", "angle of the wheel")
    shaft = ActiveCoordinate("rad", "angle of the shaft")

    def kinetic_energy(self) -> ca.SX:
        return self.wheel_moment / 2 * self.dot(self.wheel) ** 2 + self.shaft_moment / 2 * self.dot(self.shaft) ** 2

    def dissipation_function(self) -> ca.SX:
        return self.oil / 2 * (self.dot(self.wheel) - self.dot(self.shaft)) ** 2


def test_operator_feels_the_friction_of_what_it_moves() -> None:
    n = {"wheel_dot": 2.0, "shaft_dot": 5.0, "shaft_ddot": 7.0}
    equations = derive(Clutch)
    assert equations.evaluate("accelerations", **n) == pytest.approx([0.3 * 3.0 / 0.5], rel=ROUNDING)
    assert equations.evaluate("operator_forces", **n) == pytest.approx([0.2 * 7.0 + 0.3 * 3.0], rel=ROUNDING)
    assert equations.evaluate("dissipation", **n) == pytest.approx([0.3 * 9.0], rel=ROUNDING)


@pytest.mark.parametrize("oil", [0.3, -0.3])
def test_fmu_of_a_clutch_that_slips_or_drives(tmp_path: Path, oil: float) -> None:
    """I ω' = c (Ω - ω): an exponential, which grows where the friction is negative; then energy comes in."""
    fmu = build(assemble(Clutch), tmp_path)
    result = simulate(fmu, stop_time=3.0, step_size=0.1, tolerance=1e-10, oil=oil, shaft_dot=2.0, wheel_dot_0=1.0)
    slip = -np.exp(-oil * result.time / 0.5)
    assert max_error(result["wheel_dot"], 2.0 + slip) <= 1e-8  # a hundred tolerances
    assert max_error(result["shaft_force"], -oil * slip) <= 1e-8
    assert max_error(result["dissipated"], 0.25 * (1 - slip**2)) <= 1e-8  # ∫ c slip² dt
    assert np.sign(result["dissipated"][-1]) == np.sign(oil)
    assert max_error(result["energy_balance"], 0.0) <= 1e-8


# ---- momentum ----------------------------------------------------------------------------------------------------


class FreePair(Mechanism):
    """Two bodies in the plane, free of forces but for a spring and a damper along the line between them."""

    mass_1 = Parameter(1.0, "kg", "first mass", above=0)
    mass_2 = Parameter(2.0, "kg", "second mass", above=0)
    stiffness = Parameter(5.0, "N/m", "of the spring")
    rest = Parameter(1.0, "m", "its length at rest", above=0)
    damping = Parameter(0.6, "N.s/m", "of the damper", minimum=0)
    x_1 = Coordinate("m", "first body", start_rate=0.3)
    y_1 = Coordinate("m", "first body", start_rate=-0.8)
    x_2 = Coordinate("m", "second body", start=1.5)
    y_2 = Coordinate("m", "second body", start_rate=0.5)

    def _distance(self) -> ca.SX:
        return ca.sqrt((self.x_2 - self.x_1) ** 2 + (self.y_2 - self.y_1) ** 2)

    def kinetic_energy(self) -> ca.SX:
        first = self.speed_squared({"x": self.x_1, "y": self.y_1})
        second = self.speed_squared({"x": self.x_2, "y": self.y_2})
        return self.mass_1 / 2 * first + self.mass_2 / 2 * second

    def potential_energy(self) -> ca.SX:
        return self.stiffness / 2 * (self._distance() - self.rest) ** 2

    def dissipation_function(self) -> ca.SX:
        return self.damping / 2 * self.dot(self._distance()) ** 2


def test_friction_within_a_free_system_leaves_its_momenta(tmp_path: Path) -> None:
    """Noether's theorem holds of D, too: unchanged when the whole is moved or turned, it leaves the momenta."""
    result = simulate(build(assemble(FreePair), tmp_path), stop_time=20.0, step_size=0.1, tolerance=1e-11)
    momentum = [result[f"p_{axis}_1"] + result[f"p_{axis}_2"] for axis in "xy"]
    moments = [result[f"x_{i}"] * result[f"p_y_{i}"] - result[f"y_{i}"] * result[f"p_x_{i}"] for i in (1, 2)]
    turning = moments[0] + moments[1]
    for conserved in (*momentum, turning):
        assert max_error(conserved, conserved[0]) <= 1e-8  # 20 s at 1e-11, and roundings of a body that flies off
    assert result["dissipated"][-1] > 0.1
    # In the end the pair turns as one: what is left is the energy of that motion.
    stretch = np.hypot(result["x_2"] - result["x_1"], result["y_2"] - result["y_1"])
    assert np.ptp(stretch[-20:]) < np.ptp(stretch[:20]) / 10


class Stirred(Mechanism):
    """A ball in oil."""

    moment = Parameter(0.4, "kg.m2", "moment of inertia", above=0)
    oil = Parameter(0.3, "N.m.s", "moment over rate")
    attitude = Orientation("attitude of the ball")

    def kinetic_energy(self) -> ca.SX:
        return self.moment / 2 * ca.sumsqr(self.attitude.rate)

    def dissipation_function(self) -> ca.SX:
        return self.oil / 2 * ca.sumsqr(self.attitude.rate)


def test_friction_of_an_orientation_is_a_torque_against_its_turn(tmp_path: Path) -> None:
    start: Any = {"omega_x_0": 1.0, "omega_y_0": -2.0, "omega_z_0": 0.5}
    result = simulate(build(assemble(Stirred), tmp_path), stop_time=2.0, step_size=0.1, tolerance=1e-10, **start)
    for axis in "xyz":  # H = I ω, H' = -c ω about an axis that stays
        expected = 0.4 * start[f"omega_{axis}_0"] * np.exp(-0.3 / 0.4 * result.time)
        assert max_error(result[f"H_{axis}"], expected) <= 1e-8  # a hundred tolerances
    assert max_error(result["energy_balance"], 0.0) <= 1e-8


# ---- chains ------------------------------------------------------------------------------------------------------


class DampedChain(OscillatorChain):
    """Masses in a row with a damper beside each spring; both ends are free."""

    damping = Parameter(0.3, "N.s/m", "of each damper", minimum=0)

    def bond_dissipation(self) -> ca.SX:
        return self.damping / 2 * (self.dot(self.u) - self.dot(self.joint["x"])) ** 2


def test_dampers_of_a_free_chain_act_between_its_links() -> None:
    """M u'' = -(K u + C u') with C ∝ K, the matrix of differences; the sum of the momenta is constant."""
    n = 5
    model = assemble(DampedChain, n).flat()
    names = [v.name for v in model.outputs]
    rng = np.random.default_rng(5)
    u, p = rng.normal(size=(2, n))
    values = {v.name: v.starts[0] for v in model.parameters}
    arguments = (0, [*u, *p, 0, 0], [0.0] * len(model.inputs), list(values.values()))
    found = dict(zip(names, model.outputs_function(*arguments, [0, 0]).full()[:, 0], strict=True))
    difference = np.diff(np.eye(n), axis=0)
    v = p / values["mass"]
    forces = -difference.T @ (values["stiffness"] * (difference @ u) + 0.3 * (difference @ v))
    expected = [found[f"p_u_dot[{i}]"] for i in range(1, n + 1)]
    np.testing.assert_allclose(expected, forces, rtol=0, atol=ROUNDING * 10)
    assert abs(sum(expected)) <= ROUNDING * 10
    assert found["dissipation"] == pytest.approx(0.3 * np.sum((difference @ v) ** 2), rel=ROUNDING)


class BrakedChain(OscillatorChain):
    """Masses in a row, all braked by what they move in."""

    air = Friction()


def test_declared_friction_brakes_every_link_of_a_chain() -> None:
    """p' = -K u - η p, and the potential energy is that of the springs."""
    model = assemble(BrakedChain, 2).flat()
    u, p, k = [0.3, -0.2], [1.5, -0.5], {v.name: v.starts[0] for v in model.parameters} | {"air": 0.4}
    arguments = (0, [*u, *p, 0, 0], [0.0] * len(model.inputs), list(k.values()), [0, 0])
    names = [v.name for v in model.outputs]
    found = dict(zip(names, model.outputs_function(*arguments).full()[:, 0], strict=True))
    assert [found["p_u_dot[1]"], found["p_u_dot[2]"]] == pytest.approx([-0.5 - 0.6, 0.5 + 0.2], rel=ROUNDING)
    assert found["potential_energy"] == pytest.approx(0.125, rel=ROUNDING)


# ---- what is said of it ------------------------------------------------------------------------------------------


def test_page_shows_the_dissipation_function() -> None:
    page = index_page(assemble(Clutch)).decode()
    assert "<h3>Friction</h3>" in page
    assert "dissipation function" in page
    assert "<h3>Friction</h3>" not in index_page(assemble(FrictionlessPair)).decode()


class FrictionlessPair(FreePair):
    """The pair without a damper."""

    def dissipation_function(self) -> ca.SX:
        return ca.SX(0)


def test_dissipation_function_is_a_power() -> None:
    with pytest.raises(ComponentError, match=r"Force\.dissipation_function: .* is N where W is expected: .* m/s"):

        class Force(Clutch):
            """A force for a function."""

            grip = Parameter(1.0, "N.s", "of a hand")

            def dissipation_function(self) -> ca.SX:
                return self.grip * self.dot(self.wheel)
