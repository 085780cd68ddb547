"""Orientations: a heavy top with a wheel and a slider against Newton and Euler, in NumPy, without a Lagrangian."""

from __future__ import annotations

from typing import Literal

import casadi as ca
import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from liaisons.errors import ComponentError
from liaisons.language import (
    ActiveCoordinate,
    Coordinate,
    Mechanism,
    Orientation,
    Parameter,
    constraint,
    point,
    unchecked,
)
from liaisons.mechanics import Equations, assemble, derive

State = dict[str, float]

GRAVITY = np.array([0, 0, -9.81])
INERTIA = np.array([[2.0, 0.1, -0.2], [0.1, 2.5, 0.3], [-0.2, 0.3, 1.5]])  # about the fixed point, wheel locked
MOMENT = np.array([0.3, -0.2, 1.1])  # mass times centre of mass
AXIS = np.array([2.0, 1.0, 2.0]) / 3  # of the wheel
J_WHEEL = 0.2
RAIL, TRACK = np.array([0.4, 0.1, 0.0]), np.array([0.0, 0.6, 0.8])  # the slider is at RAIL + slider · TRACK
SLIDER_MASS, STIFFNESS, OIL = 0.5, 3.0, 0.3
PIN = np.array([0.2, -0.5, 0.3])  # body point where a load acts


NUMBERS = "made of bare numbers, in SI units"


class HeavyTop(Mechanism):
    """Rigid body about a fixed point in gravity, in oil, with a wheel that an operator turns and a mass on a spring."""

    attitude = Orientation("attitude of the body")
    slider = Coordinate("m", "position of the slider on its track", start=0.2)
    wheel = ActiveCoordinate("rad", "angle of the wheel")

    def _place(self) -> ca.SX:
        return ca.DM(RAIL) + self.slider * ca.DM(TRACK)

    @point("m", "the slider", unchecked=NUMBERS)
    def mass(self) -> dict[str, ca.SX]:
        return dict(zip("xyz", ca.vertsplit(self.attitude.matrix @ self._place()), strict=True))

    @point("m", "a pin on the body", unchecked=NUMBERS)
    def pin(self) -> dict[str, ca.SX]:
        return dict(zip("xyz", ca.vertsplit(self.attitude.matrix @ ca.DM(PIN)), strict=True))

    @unchecked(NUMBERS)
    def kinetic_energy(self) -> ca.SX:
        omega, spin = self.attitude.rate, self.dot(self.wheel)
        body = ca.dot(omega, ca.DM(INERTIA) @ omega) + J_WHEEL * (2 * spin * ca.dot(ca.DM(AXIS), omega) + spin**2)
        return body / 2 + SLIDER_MASS / 2 * self.speed_squared(self.mass)

    @unchecked(NUMBERS)
    def potential_energy(self) -> ca.SX:
        weight = -9.81 * (self.attitude.matrix @ ca.DM(MOMENT))[2]
        return -weight + SLIDER_MASS * 9.81 * self.mass["z"] + STIFFNESS / 2 * self.slider**2

    @unchecked(NUMBERS)
    def dissipation_function(self) -> ca.SX:
        return OIL / 2 * ca.sumsqr(self.attitude.rate)


TOP = derive(HeavyTop)


def random_state(equations: Equations, seed: int) -> State:
    """Everything moves and is loaded; the quaternion has unit length, and the momentum fits the rates."""
    rng = np.random.default_rng(seed)
    state = {name: float(rng.normal()) for name in equations.symbols}
    q = rng.normal(size=4)
    state |= dict(zip(Orientation.quaternion, q / np.linalg.norm(q), strict=True))
    momenta = equations.evaluate("momenta", **state)
    H = attitude(state) @ momenta[-3:]
    return state | {"p_slider": float(momenta[0])} | dict(zip(Orientation.momenta, H, strict=True))


def vector(state: State, *names: str) -> NDArray:
    return np.array([state[name] for name in names])


def attitude(state: State) -> NDArray:
    """Rotation matrix by SciPy."""
    return Rotation.from_quat(vector(state, *Orientation.quaternion), scalar_first=True).as_matrix()


def newton_and_euler(n: State) -> tuple[NDArray, float, float, NDArray]:
    """ω', slider acceleration, torque on the wheel, and the torque about the fixed point in the inertial frame.

    In the body frame.  Unknown: ω' and the slider's acceleration; moment balance of everything, force on the slider.
    """
    R, omega = attitude(n), vector(n, "omega_x", "omega_y", "omega_z")
    down = R.T @ GRAVITY
    place = RAIL + n["slider"] * TRACK
    on_slider = SLIDER_MASS * down - R.T @ vector(n, "mass_x_load", "mass_y_load", "mass_z_load")
    on_pin = -R.T @ vector(n, "pin_x_load", "pin_y_load", "pin_z_load")
    torque = np.cross(MOMENT, down) + np.cross(place, on_slider) + np.cross(PIN, on_pin) - OIL * omega

    def missing(omega_dot: NDArray, slide: float) -> NDArray:
        """What the balances lack when the accelerations are these; linear in them."""
        centripetal = np.cross(omega, np.cross(omega, place)) + 2 * np.cross(omega, n["slider_dot"] * TRACK)
        acceleration = np.cross(omega_dot, place) + centripetal + slide * TRACK
        spin = INERTIA @ omega + J_WHEEL * n["wheel_dot"] * AXIS
        change = INERTIA @ omega_dot + J_WHEEL * n["wheel_ddot"] * AXIS + np.cross(omega, spin)
        moment = change + SLIDER_MASS * np.cross(place, acceleration) - torque
        along = n["slider_force"] - n["slider_load"] - STIFFNESS * n["slider"]
        return np.array([*moment, SLIDER_MASS * acceleration @ TRACK - on_slider @ TRACK - along])

    unit = np.eye(4)
    at_rest = missing(np.zeros(3), 0.0)
    matrix = np.array([missing(e[:3], e[3]) - at_rest for e in unit]).T
    *omega_dot, slide = np.linalg.solve(matrix, -at_rest)
    wheel_torque = J_WHEEL * (n["wheel_ddot"] + AXIS @ omega_dot)
    return np.array(omega_dot), float(slide), float(wheel_torque), R @ torque


def test_top_moves_by_newton_and_euler(seed: int) -> None:
    n = random_state(TOP, seed)
    omega_dot, slide, wheel_torque, torque = newton_and_euler(n)
    found = TOP.evaluate("accelerations", **n)
    # Linear systems of condition 10 in numbers of order 100.
    np.testing.assert_allclose(found, [slide, *omega_dot], rtol=1e-11, atol=1e-11)
    assert TOP.evaluate("operator_forces", **n)[0] == pytest.approx(wheel_torque, rel=1e-11, abs=1e-11)
    # H' is the torque in the inertial frame: gravity, loads and friction.
    np.testing.assert_allclose(TOP.evaluate("momentum_rates", **n)[1:], torque, rtol=1e-12, atol=1e-12)


def test_momentum_is_the_angular_momentum_of_the_parts_and_gives_the_rates_back(seed: int) -> None:
    n = random_state(TOP, seed)
    omega, place = vector(n, "omega_x", "omega_y", "omega_z"), RAIL + n["slider"] * TRACK
    velocity = np.cross(omega, place) + n["slider_dot"] * TRACK
    spin = INERTIA @ omega + J_WHEEL * n["wheel_dot"] * AXIS + SLIDER_MASS * np.cross(place, velocity)
    np.testing.assert_allclose(vector(n, "H_x", "H_y", "H_z"), attitude(n) @ spin, rtol=1e-12, atol=1e-12)
    np.testing.assert_allclose(TOP.evaluate("velocities", **n), [n["slider_dot"], *omega], rtol=1e-12, atol=1e-12)


def test_energy_changes_by_the_power_of_wheel_drives_loads_and_friction(seed: int, number) -> None:
    n = random_state(TOP, seed)
    found = number(TOP, TOP.mechanism.dot(TOP.energy), n)
    balance = TOP.evaluate("power", **n)[0] - TOP.evaluate("dissipation", **n)[0]
    assert found == pytest.approx(balance, rel=1e-11, abs=1e-11)  # sums of a dozen terms of size 100


def test_quaternion_turns_the_body_with_omega(seed: int, number) -> None:
    """R' = R [ω×], and the matrix of the declaration is SciPy's."""
    n = random_state(TOP, seed)
    turn = TOP.mechanism.attitude.matrix
    R, R_dot = number(TOP, turn, n), number(TOP, TOP.mechanism.dot(ca.vec(turn)), n)
    np.testing.assert_allclose(R, attitude(n), rtol=0, atol=1e-15)  # a few roundings
    x, y, z = vector(n, "omega_x", "omega_y", "omega_z")
    across = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    np.testing.assert_allclose(R_dot.reshape(3, 3, order="F"), R @ across, rtol=0, atol=1e-14)  # numbers of order 3


# ---- two descriptions of one body: a fixed point by choice of coordinates, or by constraints ---------------------

ARM = np.array([0.1, 0.2, -0.9])  # from the centre of mass to the point that is held
OWN = np.diag([0.7, 0.9, 0.5])
MASS = 1.7


def _turning(rate: ca.SX, tensor: NDArray) -> ca.SX:
    return ca.dot(rate, ca.DM(tensor) @ rate) / 2


class Held(Mechanism):
    """Turns about the held point."""

    attitude = Orientation("attitude")

    @unchecked(NUMBERS)
    def kinetic_energy(self) -> ca.SX:
        steiner = MASS * (ARM @ ARM * np.eye(3) - np.outer(ARM, ARM))
        return _turning(self.attitude.rate, OWN + steiner)

    @unchecked(NUMBERS)
    def potential_energy(self) -> ca.SX:
        return -MASS * 9.81 * (self.attitude.matrix @ ca.DM(ARM))[2]


class Free(Mechanism):
    """Flies freely, but for three constraints on the point that is held."""

    attitude = Orientation("attitude")
    x = Coordinate("m", "centre of mass", start=float(-ARM[0]))
    y = Coordinate("m", "centre of mass", start=float(-ARM[1]))
    z = Coordinate("m", "centre of mass", start=float(-ARM[2]))

    def _point(self) -> ca.SX:
        return ca.vertcat(self.x, self.y, self.z) + self.attitude.matrix @ ca.DM(ARM)

    @constraint("m", "the held point stays at x = 0", unchecked=NUMBERS)
    def in_x(self) -> ca.SX:
        return self._point()[0]

    @constraint("m", "the held point stays at y = 0", unchecked=NUMBERS)
    def in_y(self) -> ca.SX:
        return self._point()[1]

    @constraint("m", "the held point stays at z = 0", unchecked=NUMBERS)
    def in_z(self) -> ca.SX:
        return self._point()[2]

    @unchecked(NUMBERS)
    def kinetic_energy(self) -> ca.SX:
        fall = MASS / 2 * self.speed_squared({"x": self.x, "y": self.y, "z": self.z})
        return fall + _turning(self.attitude.rate, OWN)

    @unchecked(NUMBERS)
    def potential_energy(self) -> ca.SX:
        return MASS * 9.81 * self.z


def on_the_constraints(seed: int) -> State:
    """A random attitude and angular velocity, the centre of mass where the held point asks for it."""
    rng = np.random.default_rng(seed)
    q, omega = rng.normal(size=4), rng.normal(size=3)
    n: State = dict(zip((*Orientation.quaternion, *Orientation.rates), (*(q / np.linalg.norm(q)), *omega), strict=True))
    R = attitude(n)
    place, velocity = -R @ ARM, -R @ np.cross(omega, ARM)
    at: State = dict(zip(("x", "y", "z", "x_dot", "y_dot", "z_dot"), (*place, *velocity), strict=True))
    return n | at


def test_constraints_that_hold_a_point_make_the_top_of_a_body_that_flies_freely(seed: int) -> None:
    n = on_the_constraints(seed)
    turning = {name: n[name] for name in (*Orientation.quaternion, *Orientation.rates)}
    free, held = derive(Free), derive(Held)
    # Linear systems of condition 10, numbers of order 10.
    expected = held.evaluate("accelerations", **turning)
    np.testing.assert_allclose(free.evaluate("accelerations", **n)[3:], expected, rtol=1e-11, atol=1e-11)


def test_projection_of_an_orientation_under_constraints(seed: int) -> None:
    """Constraints and unit length together, from the error that a step at a loose tolerance leaves."""
    model, equations = assemble(Free), derive(Free)
    n = on_the_constraints(seed)
    names = ["x", "y", "z", *Orientation.quaternion]
    k = np.array([variable.start for variable in model.parameters])
    p = equations.evaluate("momenta", **n)
    H = attitude(n) @ p[3:]
    y = np.array([*(n[name] for name in names), *p[:3], *H, 0, 0])
    u = np.zeros(len(model.inputs))
    assert model.project is not None

    def project(state: NDArray) -> NDArray:
        return np.asarray(model.project(0, state, u, k))[:, 0]  # type: ignore[misc]

    def residual(state: NDArray) -> float:
        R = attitude(dict(zip(names, state[:7], strict=True)))
        omega = np.linalg.solve(OWN, R.T @ state[10:13])
        place, velocity = state[:3] + R @ ARM, state[7:10] / MASS + R @ np.cross(omega, ARM)
        return float(np.max(np.abs([*place, *velocity, np.linalg.norm(state[3:7]) - 1])))

    perturbed = y + 1e-3 * np.random.default_rng(seed).normal(size=y.size) * ([1] * 13 + [0, 0])
    assert residual(perturbed) > 1e-4
    there = project(perturbed)
    assert residual(there) <= 1e-14  # roundings of velocities of order 5
    np.testing.assert_allclose(project(there), there, rtol=0, atol=1e-14)
    np.testing.assert_allclose(project(y), y, rtol=0, atol=1e-14)


def test_projection_without_constraints_only_divides_by_the_norm() -> None:
    model = assemble(HeavyTop)
    y = np.array([0.3, 0.8, 0.1, -0.6, 0.2, 1.0, 2.0, 3.0, 4.0, 0.0, 0.0])
    u, k = np.zeros(len(model.inputs)), np.array([variable.start for variable in model.parameters])
    assert model.project is not None
    found = np.asarray(model.project(0, y, u, k))[:, 0]
    expected = y.copy()
    expected[1:5] /= np.linalg.norm(y[1:5])
    np.testing.assert_allclose(found, expected, rtol=1e-15)  # one rounding


# ---- starts ------------------------------------------------------------------------------------------------------


def spinning(kind: Literal["rate", "momentum"]) -> type[Mechanism]:
    class Body(Mechanism):
        moment = Parameter(2.0, "kg.m2", "moment of inertia", above=0)
        attitude = Orientation("attitude", start=kind)
        wheel_moment = Parameter(1.0, "kg.m2", "moment of inertia of the wheel", above=0)
        wheel = ActiveCoordinate("rad", "angle of the wheel")

        def kinetic_energy(self) -> ca.SX:
            omega = self.attitude.rate
            turn = self.moment * ca.dot(omega, ca.DM([1.0, 2.0, 2.5]) * omega) / 2
            return turn + self.wheel_moment / 2 * (omega[0] + self.dot(self.wheel)) ** 2

    return Body


def start(component: type[Mechanism], **values: float) -> dict[str, float]:
    model = assemble(component)
    given = values | dict(zip(("q_w_0", "q_x_0", "q_y_0", "q_z_0"), (0.5, -0.5, 0.5, 0.5), strict=True))
    k = np.array([given.get(variable.name, variable.start) for variable in model.parameters])
    u = np.array([3.0 if variable.name == "wheel_dot" else 0.0 for variable in model.inputs])
    y, memory = model.start(0, u, k)
    z = np.asarray(model.outputs_function(0, y, u, k, memory))[:, 0]
    return dict(zip((variable.name for variable in model.outputs), z, strict=True))


def test_start_by_momentum_and_by_rate_are_the_same() -> None:
    """The wheel turns at the start: that momentum is in H, too."""
    by_rate = start(spinning("rate"), omega_x_0=0.3, omega_y_0=-0.2, omega_z_0=0.7)
    H = {f"{name}_0": by_rate[name] for name in Orientation.momenta}
    by_momentum = start(spinning("momentum"), **H)
    # R turns x, y, z into z, -x, -y or the like: what the wheel adds is not where it was in the body.
    assert by_rate == pytest.approx(by_momentum, rel=1e-14, abs=1e-14)
    body = np.array([2 * 0.3 + 0.3 + 3.0, 4 * -0.2, 5 * 0.7])
    R = attitude(by_rate)
    np.testing.assert_allclose([by_rate[name] for name in Orientation.momenta], R @ body, rtol=1e-14)


def test_a_mechanism_has_one_orientation_at_most() -> None:
    with pytest.raises(
        ComponentError, match="Twins: variables of two orientations have the same names; give each a prefix"
    ):

        class Twins(Mechanism):
            first = Orientation("one")
            second = Orientation("two")

            def kinetic_energy(self) -> ca.SX:
                return ca.sumsqr(self.first.rate) + ca.sumsqr(self.second.rate)
