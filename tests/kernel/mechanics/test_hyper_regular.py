"""Lagrangians that are not quadratic in the rates: special relativity, against closed forms and equations by hand."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import quad, solve_ivp
from scipy.special import ellipeinc

from liaisons import (
    ActiveCoordinate,
    Coordinate,
    Friction,
    LiaisonsError,
    Mechanism,
    Parameter,
    build,
    constraint,
    modelica,
    operator,
    simulate,
    unchecked,
    unilateral,
)
from liaisons.errors import ComponentError
from liaisons.mechanics import assemble, derive
from liaisons_motion.analysis import (
    active_hamiltonian,
    effective_mass,
    hamilton_equations,
    hamiltonian,
    kinetic_connection,
    multiplier_equations,
    reduced_multiplier_equations,
)


class RelativisticOscillator(Mechanism):
    """Point mass on a spring whose other end an operator moves: the mass is at x + support."""

    mass = Parameter(2.0, "kg", "rest mass", above=0)
    light = Parameter(3.0, "m/s", "speed of light", above=0)
    stiffness = Parameter(5.0, "N/m", "stiffness of the spring", minimum=0)
    damping = Parameter(0.0, "N.s/m", "damping beside the spring", minimum=0)
    x = Coordinate("m", "elongation of the spring", start=2.0)
    support = ActiveCoordinate("m", "position of the support")

    def lagrangian(self) -> ca.SX:
        beta = self.dot(self.x + self.support) / self.light
        return -self.mass * self.light**2 * ca.sqrt(1 - beta**2) - self.stiffness / 2 * self.x**2

    def dissipation_function(self) -> ca.SX:
        return self.damping / 2 * self.dot(self.x) ** 2


class FastCharge(Mechanism):
    """Charge in a uniform magnetic field along z, in a plane across it that an operator moves."""

    mass = Parameter(2.0, "kg", "rest mass", above=0)
    light = Parameter(3.0, "m/s", "speed of light", above=0)
    turning = Parameter(5.0, "C.T", "charge times magnetic field")
    x = Coordinate("m", "position along x", start_rate=1.2)
    y = Coordinate("m", "position along y")
    height = ActiveCoordinate("m", "height of the plane")

    def lagrangian(self) -> ca.SX:
        x_dot, y_dot = self.dot(self.x), self.dot(self.y)
        square = (x_dot**2 + y_dot**2 + self.dot(self.height) ** 2) / self.light**2
        field = self.turning / 2 * (self.x * y_dot - self.y * x_dot)
        return -self.mass * self.light**2 * ca.sqrt(1 - square) + field


m, c, k, QB = 2.0, 3.0, 5.0, 5.0
SETTINGS: Any = {"step_size": 0.05, "tolerance": 1e-12}
FMUS = [RelativisticOscillator, FastCharge]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("hyper_regular")
    for component in FMUS:
        for fmi in ("2", "3"):
            build(component, folder / fmi, fmi=fmi)
    return folder


def fmu(folder: Path, component: type[Mechanism], fmi: str = "2") -> Path:
    return next((folder / fmi).rglob(f"{component.__name__}.fmu"))


def oscillation(amplitude: float, phase: float) -> float:
    """Time from x = 0 to x = A sin(phase), from E = γ m c² + k x²/2: dx/dt = c √(1 − 1/γ²)."""

    def slowness(angle: float) -> float:
        gained = k * amplitude**2 * np.cos(angle) ** 2 / (2 * m * c**2)  # γ − 1
        return amplitude * np.cos(angle) * (1 + gained) / (c * np.sqrt(gained * (2 + gained)))

    return quad(slowness, 0, phase, epsabs=1e-14, epsrel=1e-13)[0]


# ---- equations -----------------------------------------------------------------------------------------------------


def states(seed: int = 3, count: int = 8) -> list[dict[str, float]]:
    """Rates of up to 0.8 c, in all directions."""
    random = np.random.default_rng(seed)
    return [
        {
            "x": random.normal(),
            "x_dot": random.uniform(-1, 1) * 1.2,
            "support": random.normal(),
            "support_dot": random.uniform(-1, 1) * 1.2,
            "support_ddot": random.normal(),
            "x_force": random.normal(),
        }
        for _ in range(count)
    ]


def test_equations_are_those_by_hand() -> None:
    equations = derive(RelativisticOscillator)
    for n in states():
        u = n["x_dot"] + n["support_dot"]
        gamma = 1 / np.sqrt(1 - (u / c) ** 2)
        acceleration = (n["x_force"] - k * n["x"]) / (m * gamma**3)  # of the mass
        by_hand = {
            "momenta": m * gamma * u,
            "mass_matrix": m * gamma**3,
            "accelerations": acceleration - n["support_ddot"],
            "operator_forces": n["x_force"] - k * n["x"],  # what passes through the spring
            "effective_mass": 0.0,  # a drive on x takes all of the mass: Θ = A − A A⁻¹ A
            "kinetic_energy": m * c**2 * (gamma - 1),
            "potential_energy": m * c**2 + k / 2 * n["x"] ** 2,
        }
        by_hand["power"] = by_hand["operator_forces"] * n["support_dot"] + n["x_force"] * n["x_dot"]
        for quantity, value in by_hand.items():
            # a dozen roundings, some hundredfold by 1 - v²/c² and its third power
            assert equations.evaluate(quantity, **n) == pytest.approx(value, rel=1e-13, abs=1e-12), quantity
        p = {"p_x": by_hand["momenta"], "x": n["x"], "support_dot": n["support_dot"]}
        assert equations.evaluate("velocities", **p) == pytest.approx(n["x_dot"], abs=1e-14)


@pytest.mark.parametrize("factor", [1.0 + 1e-9, 1.5, 10.0, 90.0])
def test_velocities_follow_from_momenta(factor: float) -> None:
    """Lorentz factors up to 90, in three directions; their derivative is A⁻¹."""
    equations = derive(FastCharge)
    free = equations.mechanism.free
    slope = ca.jacobian(equations.velocities, free.p)
    inputs = [free.p, free.q, equations.mechanism.active.s_dot, equations.mechanism.parameter_column]
    function = ca.Function("velocities", inputs, [equations.velocities, slope])
    for angle in (0.1, 2.0, 4.0):
        size = m * c * np.sqrt(factor**2 - 1)
        p = size * np.array([np.cos(angle), np.sin(angle)])
        found, derivative = (np.asarray(part) for part in function(p, [0, 0], 0, [m, c, QB]))
        # p changes γ² times as fast as γ, so that roundings of v count γ² times in p, and p's are left here
        np.testing.assert_allclose(found[:, 0], p / (m * factor), rtol=1e-14, atol=1e-15)
        across = np.eye(2) - np.outer(p, p) / (m * c * factor) ** 2
        np.testing.assert_allclose(derivative, across / (m * factor), rtol=1e-12, atol=1e-12)


def test_energy_changes_by_power_and_friction() -> None:
    equations = derive(RelativisticOscillator)
    rate = equations.in_motion(equations.mechanism.dot(equations.energy))
    balance = rate - equations.in_motion(equations.power) + equations.in_motion(equations.dissipation)
    function = ca.Function("balance", [ca.vertcat(*equations.symbols.values())], [balance, rate])
    for n in states():
        left, size = function([*equations.numbers(n | {"damping": 0.7}).values()])
        assert abs(float(left)) < 1e-13 * (1 + abs(float(size)))


# ---- Hamilton ------------------------------------------------------------------------------------------------------


def test_hamiltonian_generates_the_motion_and_the_force_of_the_operator() -> None:
    for n in states():
        state = {name: value for name, value in n.items() if name != "x_force"}
        u = n["x_dot"] + n["support_dot"]
        p = m * u / np.sqrt(1 - (u / c) ** 2)
        total = c * np.sqrt(m**2 * c**2 + p**2) + k / 2 * n["x"] ** 2
        assert active_hamiltonian(RelativisticOscillator).evaluate(**state) == pytest.approx(total, rel=1e-14)
        reduced = hamiltonian(RelativisticOscillator).evaluate(**state)  # M eq. 46
        assert reduced == pytest.approx(total - p * n["support_dot"], rel=1e-13)
        expected = [n["x_dot"], -k * n["x"]]
        found = hamilton_equations(RelativisticOscillator).evaluate(**state)
        np.testing.assert_allclose(found, expected, rtol=1e-13, atol=1e-13)
        with_force = reduced_multiplier_equations(RelativisticOscillator).evaluate(**state)
        np.testing.assert_allclose(with_force, [*expected, -k * n["x"]], rtol=1e-12, atol=1e-12)


def test_all_momenta_of_a_charge() -> None:
    """H on T*M by Newton's method in three rates; λ and Θ by hand, with γ = √(1 + p²/m²c²)/√(1 − σ̇²/c²)."""
    state = {"x": 0.3, "y": -0.5, "x_dot": 1.2, "y_dot": -0.9, "height": 0.4, "height_dot": 0.7, "height_ddot": 0.6}
    gamma = 1 / np.sqrt(1 - (1.2**2 + 0.9**2 + 0.7**2) / c**2)
    across = np.sqrt(1 + gamma**2 * (1.2**2 + 0.9**2) / c**2)
    theta = m * across / (1 - 0.7**2 / c**2) ** 1.5
    assert effective_mass(FastCharge).evaluate(**state) == pytest.approx(theta, rel=1e-13)
    p = gamma * m * np.array([1.2, -0.9]) + QB / 2 * np.array([0.5, 0.3])  # with the field's part, -y and x
    rates = QB / 2 * np.array([-0.9, -1.2])  # ∂L/∂x = QB ẏ/2, ∂L/∂y = -QB ẋ/2
    for equations in (multiplier_equations, reduced_multiplier_equations):
        found = equations(FastCharge).evaluate(**state)
        np.testing.assert_allclose(found, [1.2, -0.9, *rates, theta * 0.6], rtol=1e-12, atol=1e-12)
    momenta = derive(FastCharge).evaluate("momenta", **state)
    np.testing.assert_allclose(momenta, p, rtol=1e-13)


# ---- FMUs ------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("amplitude", [0.3, 2.0, 8.0])
@pytest.mark.variants(core=0)
def test_period(folder: Path, amplitude: float) -> None:
    """A quarter of the period is a complete integral; energies give up to γ = 9.9."""
    quarter = oscillation(amplitude, np.pi / 2)
    settings: Any = SETTINGS | {"step_size": quarter / 10}
    run = simulate(fmu(folder, RelativisticOscillator), x_0=amplitude, stop_time=5 * quarter, **settings)
    speed = c * np.sqrt(1 - (1 + k * amplitude**2 / (2 * m * c**2)) ** -2)
    x = run["x"]
    # after five quarters: 1e-12 of the tolerance, times the steps; x is off by as much as the time times the speed
    np.testing.assert_allclose(x[[10, 30, 50]], 0, rtol=0, atol=1e-10 * amplitude)
    np.testing.assert_allclose(x[[20, 40]], [-amplitude, amplitude], rtol=1e-10)
    assert run["x_dot"][10] == pytest.approx(-speed, rel=1e-10)
    assert np.max(np.abs(run["energy_balance"])) < 1e-10 * run["energy"][0]


@pytest.mark.variants(core=0)
def test_moved_support_against_newton(folder: Path) -> None:
    """The mass at y = x + σ(t) by hand, d(γ m ẏ)/dt = −k (y − σ), by SciPy."""
    wave = operator("Sinusoid", amplitude=0.4, angular_frequency=3.0)
    run = simulate(fmu(folder, RelativisticOscillator), support=wave, stop_time=6.0, **SETTINGS)

    def rates(t: float, y: NDArray) -> list[float]:
        return [c * y[1] / np.hypot(m * c, y[1]), -k * (y[0] - 0.4 * np.sin(3 * t))]

    u = 1.2  # of the mass at the start: that of the support, x is at rest
    start = [2.0, m * u / np.sqrt(1 - (u / c) ** 2)]
    by_hand = solve_ivp(rates, (0, 6), start, "DOP853", run.time, rtol=1e-13, atol=1e-13).y
    sigma = 0.4 * np.sin(3 * run.time)
    # solver 1e-12 and inputs of sixth order over 120 steps of 0.05 s
    np.testing.assert_allclose(run["x"] + sigma, by_hand[0], rtol=0, atol=1e-8)
    np.testing.assert_allclose(run["support_force"], -k * (by_hand[0] - sigma), rtol=0, atol=5e-8)
    assert np.max(np.abs(run["energy_balance"])) < 1e-10 * run["energy"][0]


def test_charge_turns_slower_as_its_plane_moves(folder: Path) -> None:
    """p is constant in size and turns by ∫ QB/(γ m) dt, an elliptic integral of the second kind; λ and Θ by hand."""
    amplitude, frequency = 0.8, 3.0  # of the plane: up to 0.8 c
    wave = operator("Sinusoid", amplitude=amplitude, angular_frequency=frequency)
    fastest, speed = amplitude * frequency / c, 1.2
    settings: Any = SETTINGS | {"step_size": 0.01, "stop_time": 4.0}
    run = simulate(fmu(folder, FastCharge), height=wave, x_dot_0=speed, **settings)
    start = 1 / np.sqrt(1 - (speed / c) ** 2 - fastest**2)
    across = np.sqrt(1 + (start * speed / c) ** 2)  # √(1 + p²/m²c²)
    phase = frequency * run.time
    elliptic = ellipeinc(phase + np.pi / 2, fastest**2) - ellipeinc(np.pi / 2, fastest**2)
    angle = QB / (m * across) * elliptic / frequency
    sigma_dot, sigma_ddot = amplitude * frequency * np.cos(phase), -amplitude * frequency**2 * np.sin(phase)
    gamma = across / np.sqrt(1 - (sigma_dot / c) ** 2)
    velocity = start * speed / gamma * np.exp(-1j * angle)
    np.testing.assert_allclose(run["x_dot"] + 1j * run["y_dot"], velocity, rtol=0, atol=1e-9)
    theta = m * across / (1 - (sigma_dot / c) ** 2) ** 1.5
    np.testing.assert_allclose(run["height_force"], theta * sigma_ddot, rtol=0, atol=1e-11)
    assert np.max(np.abs(run["energy_balance"])) < 1e-9 * run["energy"][0]


@pytest.mark.parametrize("component", FMUS)
def test_fmi_2_and_3_agree_with_the_equations(folder: Path, component: type[Mechanism]) -> None:
    settings: Any = SETTINGS | {"stop_time": 2.0}
    two, three = (simulate(fmu(folder, component, fmi), **settings) for fmi in ("2", "3"))
    equations = derive(component)
    q = [item.name for item in component.coordinates]
    for name in two.names:
        np.testing.assert_array_equal(two[name], three[name])
    for i in (0, 17, 40):
        state = {name: two[name][i] for item in q for name in (item, f"{item}_dot")}
        found = [two[f"{item}_ddot"][i] for item in q]
        np.testing.assert_allclose(found, equations.evaluate("accelerations", **state), rtol=1e-11, atol=1e-11)
        (active,) = (item.name for item in component.actives)
        force = equations.evaluate("operator_forces", **state)
        assert two[f"{active}_force"][i] == pytest.approx(force[0], rel=1e-11, abs=1e-11)


def test_order(folder: Path) -> None:
    """Error of x at the end of five quarters against the step of the symplectic solver: slope 6."""
    quarter, counts, errors = oscillation(2.0, np.pi / 2), np.array([4, 6, 9]), []
    for count in counts:
        settings: Any = {"stop_time": 5 * quarter, "step_size": quarter / 2, "symplectic_steps": int(count)}
        errors.append(abs(simulate(fmu(folder, RelativisticOscillator), x_0=2.0, **settings)["x"][-1]))
    slope = np.polyfit(np.log(counts), np.log(errors), 1)[0]
    assert -6.5 < slope < -5.5


# ---- refusals --------------------------------------------------------------------------------------------------------


class Bounded(Mechanism):
    """Momenta are less than 1 kg m/s, whatever the velocity."""

    x = Coordinate("m", "position")
    unit = Parameter(1.0, "m/s", "unit of velocity", above=0)
    mass = Parameter(1.0, "kg", "mass", above=0)

    def lagrangian(self) -> ca.SX:
        return self.mass * self.unit**2 * ca.sqrt(1 + (self.dot(self.x) / self.unit) ** 2)


def test_momenta_without_velocities_are_refused_by_name(tmp_path: Path) -> None:
    path = build(Bounded, tmp_path)
    settings: Any = {"step_size": 0.1, "x_force": 0.5}
    run = simulate(path, stop_time=1.0, **settings)
    assert run["x_dot"][-1] == pytest.approx(0.5 / np.sqrt(1 - 0.25), rel=1e-13)
    with pytest.raises(LiaisonsError, match=r"x_dot must follow from p_x by Newton's method, in its 12 steps"):
        simulate(path, stop_time=3.0, **settings)


def quartic(**more: Any) -> type[Mechanism]:
    def lagrangian(self: Any) -> ca.SX:
        return self.mass / 2 * self.dot(self.x) ** 2 * (1 + self.dot(self.x) ** 2 / self.unit**2)

    parts: dict[str, Any] = {
        "x": Coordinate("m", "position"),
        "unit": Parameter(1.0, "m/s", "unit of velocity", above=0),
        "mass": Parameter(1.0, "kg", "mass", above=0),
        "lagrangian": lagrangian,
    }
    return type("Quartic", (Mechanism,), {"__doc__": "A body.", **parts, **more})


@pytest.mark.parametrize(
    ("more", "text"),
    [
        ({"held": constraint("m", "it stays")(lambda m: m.x)}, "held needs a Lagrangian that is quadratic"),
        ({"gap": unilateral("m", "it stays above")(lambda m: m.x)}, "gap needs a Lagrangian that is quadratic"),
        ({"rubbing": Friction()}, "friction_coefficient needs a Lagrangian that is quadratic"),
        ({"kinetic_energy": lambda m: m.mass / 2 * m.dot(m.x) ** 2}, r"define lagrangian\(\) alone"),
    ],
)
def test_what_needs_linear_momenta_is_refused(more: dict[str, Any], text: str) -> None:
    with pytest.raises(ComponentError, match=text):
        quartic(**more)


def test_what_needs_a_metric_is_refused() -> None:
    with pytest.raises(ComponentError, match="a connection needs a Lagrangian that is quadratic"):
        kinetic_connection(FastCharge)
    with pytest.raises(ComponentError, match="Modelica text takes no Lagrangian that is not quadratic"):
        modelica(FastCharge)


def test_energies_of_a_lagrangian_that_is_quadratic() -> None:
    """T and V follow from L; velocities come without Newton's method."""

    class Ball(Mechanism):
        """A ball in a field."""

        mass = Parameter(2.0, "kg", "mass", above=0)
        z = Coordinate("m", "height")

        @unchecked("9.81 has a unit")
        def lagrangian(self) -> ca.SX:
            return self.mass / 2 * self.dot(self.z) ** 2 - self.mass * 9.81 * self.z

    equations = derive(Ball)
    assert equations.dynamics.convergence.shape == (0, 1)
    assert assemble(Ball).condition_texts == ()
    assert equations.evaluate("kinetic_energy", z=1.5, z_dot=3.0) == pytest.approx(9.0, rel=1e-15)
    assert equations.evaluate("potential_energy", z=1.5, z_dot=3.0) == pytest.approx(2 * 9.81 * 1.5, rel=1e-15)
