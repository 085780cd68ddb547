"""The derivation against the general theory: any metric, random states, no component of the catalogue."""

import casadi as ca
import numpy as np
import pytest

from liaisons.errors import ComponentError
from liaisons.language import (
    ActiveCoordinate,
    Coordinate,
    InternalState,
    Mechanism,
    Parameter,
    assertion,
    point,
    unchecked,
)
from liaisons.mechanics import assemble, derive

ROUNDING = 1e-12  # algebra in doubles: a few hundred operations on numbers of order 1


NUMBERS = "made of bare numbers, in SI units"


class Generic(Mechanism):
    """Two free and two active coordinates, a metric that mixes all four, friction of all kinds and a point."""

    stiffness = Parameter(1.3, "N/m", "stiffness")
    eta = Parameter(0.2, "1/s", "friction", minimum=0)
    a = Coordinate("m", "free", start=0.1)
    b = Coordinate("rad", "free", start=0.2)
    c = ActiveCoordinate("m", "active", start=0.3)
    d = ActiveCoordinate("rad", "active", start=0.4)
    xi = InternalState("kg/s", "a friction of either sign", start=0.5)

    @point("m", "the tip", unchecked=NUMBERS)
    def tip(self) -> dict[str, ca.SX]:
        return {"x": self.a + self.c * ca.cos(self.b), "z": self.c * ca.sin(self.b + self.d)}

    @unchecked(NUMBERS)
    def kinetic_energy(self) -> ca.SX:
        spin = self.dot(self.b) + self.dot(self.d) * (1 + self.a**2)
        return self.speed_squared(self.tip) + self.dot(self.a) ** 2 / 2 + 0.7 * spin**2 + self.dot(self.c) ** 2

    @unchecked(NUMBERS)
    def potential_energy(self) -> ca.SX:
        return self.stiffness * (self.a - self.c) ** 2 / 2 + ca.cos(self.b) * self.a + self.c * self.d**2

    def friction_coefficient(self) -> ca.SX:
        return self.eta

    @unchecked(NUMBERS)
    def dissipation_function(self) -> ca.SX:
        along, across = self.dot(self.a) - self.dot(self.c), self.dot(self.b) + self.dot(self.d)
        return self.xi / 2 * along**2 + 0.2 / 3 * ca.fabs(across - along / 2) ** 3

    @unchecked(NUMBERS)
    def internal_rates(self) -> dict[str, ca.SX]:
        return {"xi": self.eta}


EQUATIONS = derive(Generic)
STATES = ["a", "b", "c", "d", "a_dot", "b_dot", "c_dot", "d_dot", "c_ddot", "d_ddot", "xi"]
FORCES = ["a_force", "b_force", "a_load", "b_load", "tip_x_load", "tip_z_load"]


def _random_state(seed: int, *, forces: bool = True) -> dict[str, float]:
    rng = np.random.default_rng(seed)
    names = STATES + (FORCES if forces else [])
    return dict(zip(names, rng.uniform(-1, 1, len(names)), strict=True))


def _lagrangian_at(q: np.ndarray, rates: np.ndarray) -> float:
    """L written once more in plain NumPy, q = (a, b, c, d)."""
    a, b, c, d = q
    va, vb, vc, vd = rates
    vx = va + vc * np.cos(b) - c * np.sin(b) * vb
    vz = vc * np.sin(b + d) + c * np.cos(b + d) * (vb + vd)
    kinetic = vx**2 + vz**2 + va**2 / 2 + 0.7 * (vb + vd * (1 + a**2)) ** 2 + vc**2
    return kinetic - (1.3 * (a - c) ** 2 / 2 + np.cos(b) * a + c * d**2)


def test_euler_lagrange_residual_by_finite_differences(seed: int) -> None:
    """d/dt ∂L/∂q̇ − ∂L/∂q − Q − λ = 0 (M eq. 22) along a Taylor curve through a random state, L in plain NumPy."""
    state = _random_state(seed)
    acceleration = EQUATIONS.evaluate("accelerations", **state)
    operator = EQUATIONS.evaluate("operator_forces", **state)
    q, v = (np.array([state[n] for n in names]) for names in (["a", "b", "c", "d"], STATES[4:8]))
    acc = np.array([*acceleration, state["c_ddot"], state["d_ddot"]])

    h = 1e-4  # central differences: error h² ~ 1e-8 times derivatives of order 10
    unit = np.eye(4)

    def momentum(t: float) -> np.ndarray:
        q_t, v_t = q + v * t + acc * t**2 / 2, v + acc * t
        # L is quadratic in the rates, so this central difference is exact but for rounding
        return np.array([_lagrangian_at(q_t, v_t + e) - _lagrangian_at(q_t, v_t - e) for e in unit]) / 2

    p_dot = (momentum(h) - momentum(-h)) / (2 * h)
    gradient = np.array([_lagrangian_at(q + h * e, v) - _lagrangian_at(q - h * e, v) for e in unit]) / (2 * h)
    b, c, d = q[1:]
    load = np.array([state["tip_x_load"], state["tip_z_load"]])
    tip = np.array(
        [
            [1, -c * np.sin(b), np.cos(b), 0],
            [0, c * np.cos(b + d), np.sin(b + d), c * np.cos(b + d)],
        ]
    )

    def dissipated(rates: np.ndarray) -> float:
        along, across = rates[0] - rates[2], rates[1] + rates[3]
        return state["xi"] / 2 * along**2 + 0.2 / 3 * abs(across - along / 2) ** 3

    friction = -0.2 * momentum(0.0)  # T and L differ by V, which has no rates
    friction -= np.array([dissipated(v + h * e) - dissipated(v - h * e) for e in unit]) / (2 * h)
    np.testing.assert_allclose(EQUATIONS.evaluate("dissipation", **state), -friction @ v, rtol=0, atol=1e-7)
    drive = np.array([state["a_force"] - state["a_load"], state["b_force"] - state["b_load"], 0, 0])
    forces = drive - tip.T @ load + friction + np.array([0, 0, *operator])
    np.testing.assert_allclose(p_dot - gradient - forces, 0, rtol=0, atol=1e-6)


@pytest.mark.parametrize("seed", range(20))
def test_energy_theorem(seed: int, number) -> None:
    """dE/dt = Σ λ σ̇ + drives and loads − Σ q̇ ∂D/∂q̇ − Σ σ̇ ∂D/∂σ̇ (K eq. 67, M eq. 28), also where ξ < 0 drives."""
    state = _random_state(seed)
    found = number(EQUATIONS, EQUATIONS.mechanism.dot(EQUATIONS.energy), state)
    balance = EQUATIONS.evaluate("power", **state) - EQUATIONS.evaluate("dissipation", **state)
    assert found == pytest.approx(balance[0], rel=ROUNDING, abs=10 * ROUNDING)


def test_friction_coefficient_is_the_simplest_dissipation_function() -> None:
    class Stated(Generic):
        """The same friction, all of it in one function."""

        def friction_coefficient(self) -> ca.SX:
            return ca.SX(0)

        @unchecked(NUMBERS)
        def dissipation_function(self) -> ca.SX:
            return Generic.dissipation_function(self) + self.eta * self.kinetic_energy()

    stated, state = derive(Stated), _random_state(1)
    for quantity in ("momentum_rates", "accelerations", "operator_forces", "power", "dissipation"):
        expected = EQUATIONS.evaluate(quantity, **state)
        np.testing.assert_allclose(stated.evaluate(quantity, **state), expected, rtol=ROUNDING, atol=ROUNDING)


def test_velocities_invert_the_momenta(seed: int) -> None:
    state = _random_state(seed)
    momenta = EQUATIONS.evaluate("momenta", **state)
    rates = EQUATIONS.evaluate("velocities", **state, p_a=momenta[0], p_b=momenta[1])
    np.testing.assert_allclose(rates, [state["a_dot"], state["b_dot"]], rtol=ROUNDING)


def test_effective_mass_is_the_inverse_of_the_block_of_the_inverse_metric(seed: int) -> None:
    """Θ = (g^{αβ})⁻¹ (M eq. 50, proof of 52): the metric of all four coordinates, by second differences of L."""
    state = _random_state(seed, forces=False)
    q = np.array([state[n] for n in ["a", "b", "c", "d"]])
    unit, zero = np.eye(4), np.zeros(4)

    def kinetic(rates: np.ndarray) -> float:
        return _lagrangian_at(q, rates) - _lagrangian_at(q, zero)

    metric = np.array([[kinetic(e + f) - kinetic(e) - kinetic(f) for f in unit] for e in unit])
    expected = np.linalg.inv(np.linalg.inv(metric)[2:, 2:])
    theta = EQUATIONS.evaluate("effective_mass", **state)
    np.testing.assert_allclose(theta, expected, rtol=1e-11)  # two 4x4 inversions of condition ~10
    np.testing.assert_allclose(theta, theta.T, rtol=1e-11)


def test_momentum_rate_does_not_contain_the_acceleration_of_the_operator() -> None:
    """Only σ and σ̇ enter the motion (M eq. 36), so p stays continuous when σ̇ jumps."""
    model = assemble(Generic)
    pattern = np.array(ca.DM(model.derivatives.jac_sparsity(0, 2), 1))
    names = [variable.name for variable in model.inputs]
    motion = pattern[:4]  # a, b, p_a, p_b; the work does depend on it
    for name in ("c_ddot", "d_ddot"):
        assert not motion[:, names.index(name)].any()
    assert motion[:, names.index("c_dot")].any()


def test_model_functions_agree_with_the_equations() -> None:
    model = assemble(Generic)
    state = _random_state(11)
    k = np.array([v.start for v in model.parameters])
    names = [v.name for v in model.parameters]
    k[names.index("xi_0")] = state["xi"]
    for q in ("a", "b"):
        k[names.index(f"{q}_0")], k[names.index(f"{q}_dot_0")] = state[q], state[f"{q}_dot"]
    u = np.array([state.get(v.name, 0.0) for v in model.inputs])
    y, memory = model.start(0, u, k)
    rates = np.asarray(model.derivatives(0, y, u, k))[:, 0]
    momentum_rates, *account = (EQUATIONS.evaluate(q, **state) for q in ("momentum_rates", "power", "dissipation"))
    expected = np.concatenate([[state["a_dot"], state["b_dot"]], momentum_rates, [0.2], *account])
    np.testing.assert_allclose(rates, expected, rtol=ROUNDING)
    values = np.asarray(model.outputs_function(0, y, u, k, memory))[:, 0]
    z = {variable.name: value for variable, value in zip(model.outputs, values, strict=True)}
    np.testing.assert_allclose([z["a_ddot"], z["b_ddot"]], EQUATIONS.evaluate("accelerations", **state), rtol=ROUNDING)
    np.testing.assert_allclose([z["c_force"], z["d_force"]], EQUATIONS.evaluate("operator_forces", **state), rtol=1e-13)
    assert z["energy_balance"] == 0.0
    assert z["work"] == 0.0


def test_jump_books_the_work_of_an_impulse() -> None:
    """σ̇ jumps: p stays, the energy jumps, and the booked work is that difference: the balance stays closed."""
    model = assemble(Generic)
    k = np.array([v.start for v in model.parameters])
    u = np.array([v.start for v in model.inputs])
    y, memory = model.start(0, u, k)
    names = [v.name for v in model.outputs]
    u_after = u.copy()
    u_after[[v.name for v in model.inputs].index("c_dot")] = 2.0
    before = np.asarray(model.outputs_function(0, y, u, k, memory))[:, 0]
    pending = np.asarray(model.outputs_function(0, y, u_after, k, memory))[:, 0]
    y_after = model.jump(0, y, u_after, k, memory)
    booked = np.asarray(model.outputs_function(0, y_after, u_after, k, model.remember(0, y_after, u_after, k, memory)))
    work, energy, balance, p_a = (names.index(n) for n in ("work", "energy", "energy_balance", "p_a"))
    assert pending[energy] - before[energy] == pytest.approx(pending[work], rel=1e-14)
    assert booked[work, 0] == pending[work] > 0
    assert booked[p_a, 0] == before[p_a]
    assert abs(pending[balance]) + abs(booked[balance, 0]) < 1e-14


def test_a_mechanism_stays_within_all_domains_and_assertions() -> None:
    class Fenced(Mechanism):
        """A mass in the plane that must stay off two axes and a line."""

        mass = Parameter(1.0, "kg", "mass")
        x = Coordinate("m", "to the right", start=1.0, above=0)
        z = Coordinate("m", "up", start=2.0, below=3)

        def kinetic_energy(self) -> ca.SX:
            return self.mass / 2 * (self.dot(self.x) ** 2 + self.dot(self.z) ** 2)

        @assertion("it must stay above the line")
        def above_the_line(self) -> ca.SX:
            return self.z - self.x

    assert list(assemble(Fenced).condition_texts) == [
        "it must stay above the line",
        "x must stay > 0 m",
        "z must stay < 3 m",
    ]


def test_evaluate_refuses_unknown_names() -> None:
    with pytest.raises(ComponentError, match=r"unknown quantity 'acceleration'; did you mean 'accelerations'\?"):
        EQUATIONS.evaluate("acceleration")
    with pytest.raises(ComponentError, match=r"unknown symbol 'a_dott'; did you mean 'a_dot'\?"):
        EQUATIONS.evaluate("accelerations", a_dott=1.0)
