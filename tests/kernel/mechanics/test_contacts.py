"""Contacts in linkages, in arrays and beside constraints: the motion of other equations, written by hand.

Bounds: both FMUs integrate at 1e-11, and localise the same impacts; their errors grow with each of them.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np
import pytest
from scipy.integrate import solve_ivp

from liaisons import (
    ActiveCoordinate,
    Body,
    BodyPoint,
    Coordinate,
    Gravity,
    Linkage,
    Mechanism,
    Parameter,
    Planar,
    Prismatic,
    Result,
    Revolute,
    Size,
    assemble,
    build,
    dry_friction,
    equations,
    ground,
    non_holonomic,
    operator,
    sensitivities,
    simulate,
    unchecked,
    unilateral,
)
from liaisons.composition import compose
from liaisons.errors import ComponentError
from liaisons.models import CartesianPendulum, OscillatorChain, PendulumChain
from liaisons_motion.derivatives import Sensitivities

RUN: dict[str, Any] = {"stop_time": 2.0, "step_size": 0.01, "tolerance": 1e-11}
SHORT: dict[str, Any] = RUN | {"stop_time": 1.0}
ROD: dict[str, Any] = {"mass": 2.0, "inertia": (0.2, 0.2, 0.2), "centre": (0.5, 0, 0)}
PLAIN: dict[str, Any] = {"unchecked": "numbers in SI units"}
plain = unchecked("numbers in SI units")


def restitution(value: float) -> Parameter:
    return Parameter(value, "1", "coefficient of restitution", minimum=0, maximum=1)


def same_motion(run: Result, by_hand: Result, names: Mapping[str, str], bound: float = 1e-9) -> None:
    """Signals are those of the other run, by its names; energy accounts are closed."""
    for name, other in names.items():
        np.testing.assert_allclose(run[name], by_hand[other], rtol=0, atol=bound, err_msg=name)
    assert abs(run["energy_balance"]).max() <= 10 * bound
    assert run["impact_loss"] == pytest.approx(by_hand["impact_loss"], abs=bound)


# ---- linkages --------------------------------------------------------------------------------------------------------


class TwoRods(Linkage):
    """Double pendulum whose tip hits a wall."""

    bounce, wall = restitution(0.6), Parameter(0.3, "m", "distance of the wall")
    upper, lower = Body(1.0, (0.02, 0.02, 0.001), (0, 0, -0.5)), Body(0.7, (0.01, 0.01, 0.001), (0, 0, -0.4))
    shoulder = Revolute(ground, upper, axis="y", start=-0.5)
    elbow = Revolute(upper, lower, axis="y", at=(0, 0, -1.0), start=-0.3)
    tip = BodyPoint(lower, at=(0, 0, -0.8))

    @unilateral("m", "distance of tip and wall", restitution="bounce")
    def gap(self) -> ca.SX:
        return self.wall + self.tip["x"]


class TwoAngles(Mechanism):
    """The same by angles a, b of the rods from the vertical."""

    bounce, wall, gravity = restitution(0.6), Parameter(0.3, "m", "distance of the wall"), Gravity()
    a = Coordinate("rad", "angle of the upper rod", start=-0.5)
    b = Coordinate("rad", "angle of the lower rod", start=-0.8)

    @plain
    def kinetic_energy(self) -> ca.SX:
        a, b = self.dot(self.a), self.dot(self.b)
        return 0.97 / 2 * a**2 + 0.122 / 2 * b**2 + 0.28 * a * b * ca.cos(self.a - self.b)

    @plain
    def potential_energy(self) -> ca.SX:
        return -self.gravity * (1.2 * ca.cos(self.a) + 0.28 * ca.cos(self.b))

    @unilateral("m", "distance of tip and wall", restitution="bounce", **PLAIN)
    def gap(self) -> ca.SX:
        return self.wall - ca.sin(self.a) - 0.8 * ca.sin(self.b)


def two_rods_by_hand(times: np.ndarray) -> tuple[np.ndarray, float, float]:
    """Angles a, b of the rods, the sum of the impulses, and what they dissipate, by SciPy and Newton's impact law."""

    def masses(y: np.ndarray) -> np.ndarray:
        mixed = 0.28 * np.cos(y[0] - y[1])
        return np.array([[0.97, mixed], [mixed, 0.122]])

    def rates(_: float, y: np.ndarray) -> np.ndarray:
        turn = 0.28 * np.sin(y[0] - y[1])
        forces = [-turn * y[3] ** 2 - 9.81 * 1.2 * np.sin(y[0]), turn * y[2] ** 2 - 9.81 * 0.28 * np.sin(y[1])]
        return np.r_[y[2:], np.linalg.solve(masses(y), forces)]

    def gap(_: float, y: np.ndarray) -> float:
        return 0.3 - np.sin(y[0]) - 0.8 * np.sin(y[1])

    vars(gap).update(terminal=True, direction=-1)
    settings: dict[str, Any] = {"method": "DOP853", "rtol": 1e-12, "atol": 1e-13, "events": gap, "dense_output": True}
    e, impulses, loss, begin, y, parts = 0.6, 0.0, 0.0, 0.0, np.array([-0.5, -0.8, 0.0, 0.0]), []
    while True:
        found = solve_ivp(rates, (begin, times[-1]), y, **settings)
        parts.append(found.sol(times[(times >= begin) & (times <= found.t[-1])])[:2])
        if found.status == 0:
            return np.hstack(parts), impulses, loss
        begin, y = found.t[-1], found.y[:, -1].copy()
        normal = -np.array([np.cos(y[0]), 0.8 * np.cos(y[1])])
        by_impulse = np.linalg.solve(masses(y), normal)
        approach, compliance = -normal @ y[2:], normal @ by_impulse
        impulse = (1 + e) * approach / compliance
        y[2:] += by_impulse * impulse
        impulses, loss = impulses + impulse, loss + (1 - e**2) / 2 * approach**2 / compliance


@pytest.mark.parametrize("fmi", ["2", pytest.param("3", marks=pytest.mark.slow)])
def test_tip_of_two_rods_hits_a_wall(fmu: Callable[..., Path], fmi: str) -> None:
    run = simulate(fmu(TwoRods, fmi=fmi), **RUN)
    (a, b), impulses, loss = two_rods_by_hand(run.time)
    assert run["gap_impacts"][-1] == 3
    for name, expected in {"shoulder": a, "elbow": b - a, "gap": 0.3 - np.sin(a) - 0.8 * np.sin(b)}.items():
        np.testing.assert_allclose(run[name], expected, rtol=0, atol=1e-10, err_msg=name)
    assert [run["gap_impulse"][-1], run["impact_loss"][-1]] == pytest.approx([impulses, loss], abs=1e-10)
    assert abs(run["energy_balance"]).max() <= 1e-9


def same_derivatives(ours: Sensitivities, by_hand: Sensitivities, signals: tuple[str, str]) -> None:
    """Both signals, the first ours, and their derivatives are the same."""
    assert ours.method == "steps"
    assert ours[signals[0]] == pytest.approx(by_hand[signals[1]], abs=1e-9)
    for name in ours.names:
        derivative = by_hand.derivative(signals[1], name)
        assert abs(derivative[-1]) > 0.01
        assert ours.derivative(signals[0], name) == pytest.approx(derivative, abs=1e-8 * abs(derivative).max())


def test_sensitivities_of_impacts_of_a_linkage() -> None:
    settings: dict[str, Any] = {"by": ["bounce", "wall"], "stop_time": 1.0, "step_size": 0.1}
    ours, by_hand = (
        sensitivities(kind, record=signal, **settings) for kind, signal in ((TwoRods, "shoulder"), (TwoAngles, "a"))
    )
    same_derivatives(ours, by_hand, ("shoulder", "a"))


class FourBar(Linkage):
    """Parallelogram whose crank has stops, whose rocker rubs, and whose knee hits a table."""

    bounce, depth = restitution(0.5), Parameter(0.8, "m", "depth of the table below the hinges")
    crank, coupler, rocker = Body(**ROD), Body(**ROD), Body(**ROD)
    turn = Revolute(ground, crank, axis="y", start=-1.0, start_rate=-3.0, limits=(-1.5, 1.0), restitution=0.7)
    elbow = Revolute(crank, coupler, axis="y", at=(1, 0, 0), start=1.0, start_rate=3.0)
    swing = Revolute(ground, rocker, axis="y", at=(1, 0, 0), start=-1.0, start_rate=-3.0, friction=0.5)
    pin = Revolute(coupler, rocker, axis="y", at=(1, 0, 0), at_child=(1, 0, 0))
    knee = BodyPoint(crank, at=(1, 0, 0))

    @unilateral("m", "height of the knee above the table", restitution="bounce")
    def gap(self) -> ca.SX:
        return self.knee["z"] + self.depth


class OneAngle(Mechanism):
    """The same by the crank's angle."""

    bounce, stop, grip, gravity = restitution(0.5), restitution(0.7), Parameter(0.5, "N.m", "rub", minimum=0), Gravity()
    turn = Coordinate("rad", "angle of the crank below the horizontal", start=-1.0, start_rate=-3.0)

    @plain
    def kinetic_energy(self) -> ca.SX:
        return 3.4 / 2 * self.dot(self.turn) ** 2

    @plain
    def potential_energy(self) -> ca.SX:
        return -self.gravity * 4.0 * ca.sin(self.turn)

    @unilateral("rad", "distance from the lower stop", restitution="stop", **PLAIN)
    def above(self) -> ca.SX:
        return self.turn + 1.5

    @unilateral("m", "height of the knee", restitution="bounce", **PLAIN)
    def gap(self) -> ca.SX:
        return 0.8 - ca.sin(self.turn)

    @dry_friction("rad/s", "slip of the hinge", static="grip")
    def slip(self) -> ca.SX:
        return self.dot(self.turn)


@pytest.mark.slow
@pytest.mark.parametrize("fmi", ["2", "3"])
def test_closed_loop_with_stops_and_friction(fmu: Callable[..., Path], fmi: str) -> None:
    run, by_hand = (simulate(fmu(kind, fmi=fmi), **RUN) for kind in (FourBar, OneAngle))
    assert run["turn_above_impacts"][-1] == 1
    assert run["gap_impacts"][-1] >= 3
    assert run["swing_slip_sticks"][-1] == by_hand["slip_sticks"][-1]
    same_motion(run, by_hand, {"turn": "turn", "gap_impulse": "gap_impulse", "dissipated": "dissipated"})


class Scara(Linkage):
    """Arm whose quill falls onto a table."""

    table = Parameter(-0.3, "m", "height of the table")
    mu = Parameter(0.5, "1", "coefficient of friction", minimum=0)
    arm, quill = Body(3.0, (0.2, 0.2, 0.3), (0.3, 0, 0)), Body(1.0)
    slew = Revolute(ground, arm, axis="z", start_rate=1.0)
    drop = Prismatic(arm, quill, axis="z", at=(0.6, 0, 0))

    @unilateral("m", "height of the quill above the table")
    def gap(self) -> ca.SX:
        return self.quill.position()[2] - self.table

    @dry_friction("m/s", "sliding of the quill on the table", static="mu", normal="gap")
    def slip(self) -> ca.SX:
        velocity = self.quill.velocity_of()
        return velocity[1] * ca.cos(self.slew) - velocity[0] * ca.sin(self.slew)


def test_quill_on_a_table_brakes_the_arm(fmu: Callable[..., Path]) -> None:
    """It falls √(2 h/g); its impulse m g t takes μ m g t r/I off the rate of the arm, its weight the rest."""
    run = simulate(fmu(Scara), **RUN)
    g, r, mu, inertia = 9.81, 0.6, 0.5, 0.3 + 3.0 * 0.3**2 + 0.6**2
    lands, slows = np.sqrt(2 * 0.3 / g), mu * g * r / inertia
    rate = np.where(run.time < lands, 1.0, np.maximum(1.0 - slows * run.time, 0.0))
    # friction has had the impulse μ m g t by t, of the impact and of the weight alike
    np.testing.assert_allclose(run["slew_dot"], rate, rtol=0, atol=1e-9)
    assert run["slip_sticks"][-1]
    assert abs(run["energy_balance"]).max() < 1e-9


# ---- constraints -----------------------------------------------------------------------------------------------------


class FlooredPendulum(CartesianPendulum):
    """Pendulum in Cartesian coordinates above a floor."""

    bounce, floor = restitution(0.5), Parameter(0.2, "m", "height of the floor")

    @unilateral("m", "height above the floor", restitution="bounce")
    def gap(self) -> ca.SX:
        return self.z - self.floor


class FlooredAngle(Mechanism):
    """The same by its angle."""

    bounce, gravity = restitution(0.5), Gravity()
    theta = Coordinate("rad", "angle", start=1.0)

    @plain
    def kinetic_energy(self) -> ca.SX:
        return self.dot(self.theta) ** 2 / 2

    @plain
    def potential_energy(self) -> ca.SX:
        return -self.gravity * ca.cos(self.theta)

    @unilateral("m", "height above the floor", restitution="bounce", **PLAIN)
    def gap(self) -> ca.SX:
        return 0.8 - ca.cos(self.theta)

    @property
    def x(self) -> ca.SX:
        return ca.sin(self.theta)


def test_constraints_and_a_floor(fmu: Callable[..., Path]) -> None:
    """Its bounces end on the floor, where rod and floor hold it."""
    start = {"x_0": np.sin(1.0), "z_0": 1 - np.cos(1.0)}
    run, by_hand = simulate(fmu(FlooredPendulum), **RUN, **start), simulate(fmu(FlooredAngle), **RUN)
    assert run["x"] == pytest.approx(np.sin(by_hand["theta"]), abs=1e-13)
    assert run["gap_closed"][-1]
    same_motion(run, by_hand, {"gap": "gap", "gap_impulse": "gap_impulse", "gap_force": "gap_force"})


class Skate(Mechanism):
    """Skate that cannot slip sideways and runs into a wall."""

    bounce = restitution(0.6)
    mass, inertia = Parameter(2.0, "kg", "mass", above=0), Parameter(0.1, "kg.m2", "moment of inertia", above=0)
    wall = Parameter(0.5, "m", "place of the wall")
    x = Coordinate("m", "place along", start_rate=1.0)
    y = Coordinate("m", "place across")
    heading = Coordinate("rad", "direction of the blade from x", start_rate=1.2)

    def kinetic_energy(self) -> ca.SX:
        return self.mass / 2 * self.speed_squared({"x": self.x, "y": self.y}) + (
            self.inertia / 2 * self.dot(self.heading) ** 2
        )

    @non_holonomic("m/s", "no slip across the blade")
    def across(self) -> ca.SX:
        return self.dot(self.y) * ca.cos(self.heading) - self.dot(self.x) * ca.sin(self.heading)

    @unilateral("m", "distance from the wall", restitution="bounce")
    def gap(self) -> ca.SX:
        return self.wall - self.x


def test_skate_runs_back_from_a_wall_on_a_circle(fmu: Callable[..., Path]) -> None:
    """The impulse acts along the blade alone, and turns v into -e v; the circles have radii v/ω and e v/ω."""
    run, omega, e, wall = simulate(fmu(Skate), **SHORT), 1.2, 0.6, 0.5
    hits = np.arcsin(wall * omega) / omega
    v = np.where(run.time < hits, 1.0, -e)
    x = np.where(run.time < hits, 0.0, wall * (1 + e)) + v * np.sin(omega * run.time) / omega
    np.testing.assert_allclose(run["x"], x, rtol=0, atol=1e-13)
    assert run["heading"] == pytest.approx(omega * run.time, abs=1e-13)
    assert run["gap_impulse"][-1] == pytest.approx(2.0 * (1 + e) / np.cos(omega * hits), abs=1e-13)
    assert abs(run["energy_balance"]).max() < 1e-9


# ---- arrays ----------------------------------------------------------------------------------------------------------


class Blocks(Mechanism):
    """Blocks on a belt, bound to each other and to their places by springs."""

    n = Size(3, "number of blocks")
    stiffness = Parameter(20.0, "N/m", "stiffness of the springs", minimum=0)
    mass = Parameter(1.0, "kg", "masses of the blocks", above=0, size="n")
    grip = Parameter((3.0, 2.0, 1.0), "N", "static friction", minimum=0, size="n")
    drag = Parameter(0.5, "N", "sliding friction", minimum=0)
    x = Coordinate("m", "displacements", start=(0.3,), size="n")
    belt = ActiveCoordinate("m", "way of the belt")

    def kinetic_energy(self) -> ca.SX:
        return ca.dot(self.mass, self.dot(self.x) ** 2) / 2

    def potential_energy(self) -> ca.SX:
        return self.stiffness / 2 * (ca.sumsqr(ca.diff(self.x)) + ca.sumsqr(self.x))

    @dry_friction("m/s", "sliding of the blocks", static="grip", sliding="drag", size="n")
    def slip(self) -> ca.SX:
        return self.dot(self.x) - self.dot(self.belt)


def written_out() -> type[Mechanism]:
    """Blocks whose frictions are declared one by one."""
    single = [
        dry_friction("m/s", "sliding of a block", static=f"grip[{i}]", sliding="drag")(
            lambda m, i=i: m.dot(m.x[i - 1]) - m.dot(m.belt)
        )
        for i in (1, 2, 3)
    ]
    return type("WrittenOut", (Blocks,), {"slip": None, **{f"slip_{i}": s for i, s in enumerate(single, start=1)}})


@pytest.mark.parametrize("fmi", ["2", pytest.param("3", marks=pytest.mark.slow)])
def test_arrays_of_dry_friction(fmu: Callable[..., Path], fmi: str) -> None:
    run, other = (
        simulate(fmu(kind, fmi=fmi), **RUN, belt=operator("Ramp", rate=0.1)) for kind in (Blocks, written_out())
    )
    names = {f"slip{end}[{i}]": f"slip_{i}{end}" for end in ("", "_force", "_sticks") for i in (1, 2, 3)}
    same_motion(run, other, names)
    assert 0 < np.mean(run["slip_sticks"]) < 1
    assert run["slip_force"].shape == (len(run.time), 3)


def test_blocks_that_slide_together_oscillate_about_two_places(fmu: Callable[..., Path]) -> None:
    """m x'' = -k x ± drag: about x = ±drag/k, until x' is that of the belt again; nothing sticks so early."""
    rate, shift, omega = 0.1, 0.5 / 20, 20**0.5
    run = simulate(fmu(Blocks), **RUN, belt=operator("Ramp", rate=rate), x_0=[0.3] * 3)
    expected, begin, x, v = np.empty(len(run.time)), 0.0, 0.3 - shift, 0.0
    while begin < run.time[-1]:  # x is the distance from the place about which it oscillates
        size, phase = np.hypot(x, v / omega), np.arctan2(-v / omega, x)
        later = run.time >= begin
        expected[later] = shift + size * np.cos(omega * (run.time[later] - begin) + phase)
        turn = np.arcsin(rate / omega / size)
        end = np.pi + turn if shift > 0 else -turn
        begin, x, v = begin + (end - phase) / omega, size * np.cos(end) + 2 * shift, rate
        shift = -shift
    np.testing.assert_allclose(run["x"], np.transpose([expected] * 3), rtol=0, atol=1e-11)
    assert not run["slip_sticks"].any()


def test_equations_of_arrays_of_dry_friction() -> None:
    text = equations(Blocks)["dry_friction"].text()
    assert "slip₂ = ẋ₂ − belt˙" in text
    assert "S_slip,2 = grip₂" in text


class Crate(Mechanism):
    """A crate that slides and stands on a floor, or is above it."""

    mass = Parameter(2.0, "kg", "mass", minimum=0)
    gravity = Parameter(10.0, "m/s2", "gravity")
    grip = Parameter(0.6, "1", "coefficient of static friction", minimum=0)
    drag = Parameter(0.5, "1", "coefficient of sliding friction", minimum=0)
    x = Coordinate("m", "way along the floor")
    z = Coordinate("m", "height above the floor")

    def kinetic_energy(self) -> ca.SX:
        return self.mass / 2 * (self.dot(self.x) ** 2 + self.dot(self.z) ** 2)

    def potential_energy(self) -> ca.SX:
        return self.mass * self.gravity * self.z

    @unilateral("m", "distance of crate and floor")
    def gap(self) -> ca.SX:
        return self.z

    @dry_friction("m/s", "sliding of the crate", static="grip", sliding="drag", normal="gap")
    def slip(self) -> ca.SX:
        return self.dot(self.x)


# Modes and motion; indicators by hand, of scales with a nominal value of 1 m and rates of 1 m/s.
STANDS = {"gap_closed": 1.0}, {}, (20 / 2 / 10.001, (0.6 * 20 - 3) / 2 / 1.501)
SLIDES = {"gap_closed": 1.0, "slip_direction": 1.0}, {"p_x": 0.4}, (20 / 2 / 10.001, 0.2 / 1.2)
TURNS = {"gap_closed": 1.0, "slip_direction": -1.0}, {"p_x": 0.4}, (20 / 2 / 10.001, -0.2 / 1.2)
FLIES = {"gap_closed": -0.25}, {"z": 0.3, "p_z": 1.0}, (0.3 / 1.3 + 1e-3 * 0.5 / 1.5 + 0.25, 1.0)


@pytest.mark.symbolic
@pytest.mark.parametrize(("modes", "state", "expected"), [STANDS, SLIDES, TURNS, FLIES])
def test_indicators_measure_distances_from_the_end_of_modes(modes: Any, state: Any, expected: Any) -> None:
    """Slacks of forces and rates relative to their scales, on a crate that is pulled by 3 N."""
    model = assemble(Crate)
    y = [state.get(item.name, 0.0) for item in model.states]
    u = [3.0 if v.name == "x_force" else v.starts[0] for v in model.inputs]
    k, m = [v.starts[0] for v in model.parameters], [modes.get(name, 0.0) for name in model.memory]
    assert model.indicate is not None
    found = model.indicate(0.0, y, u, k, m).full().ravel()
    np.testing.assert_allclose(found, expected, rtol=0, atol=2e-12)  # margins are 1e-12


class Table(Linkage):
    """Table top on two feet, which it lands on."""

    feet = Size(2, "number of feet")
    mu = Parameter((0.4, 0.2), "1", "coefficients of friction", minimum=0, size="feet")
    bounce = Parameter((0.3, 0.5), "1", "coefficients of restitution", minimum=0, maximum=1, size="feet")
    top = Body(2.0, (0.1, 0.1, 0.2))
    move = Planar(ground, top, rotation=(np.pi / 2, 0, 0), start=(0.0, 0.5, 0.1), start_rate=(0.5, 0, 0))
    left, right = BodyPoint(top, at=(-1, -0.3, 0)), BodyPoint(top, at=(1, -0.3, 0))

    @unilateral("m", "heights of the feet", restitution="bounce", size="feet")
    def gap(self) -> ca.SX:
        return ca.vertcat(self.left["z"], self.right["z"])

    @dry_friction("m/s", "sliding of the feet", static="mu", normal="gap", size="feet")
    def slip(self) -> ca.SX:
        return self.dot(ca.vertcat(self.left["x"], self.right["x"]))


class ByFeet(Mechanism):
    """The same, foot by foot."""

    e_left, e_right, gravity = restitution(0.3), restitution(0.5), Gravity()
    rough, smooth = (Parameter(mu, "1", "coefficient of friction", minimum=0) for mu in (0.4, 0.2))
    x = Coordinate("m", "place", start_rate=0.5)
    z = Coordinate("m", "height", start=0.5)
    a = Coordinate("rad", "inclination", start=0.1)

    def foot(self, side: float) -> tuple[ca.SX, ca.SX]:
        c, s = ca.cos(self.a), ca.sin(self.a)
        return self.x + side * c + 0.3 * s, self.z + side * s - 0.3 * c

    @plain
    def kinetic_energy(self) -> ca.SX:
        return self.dot(self.x) ** 2 + self.dot(self.z) ** 2 + 0.1 * self.dot(self.a) ** 2

    @plain
    def potential_energy(self) -> ca.SX:
        return 2.0 * self.gravity * self.z

    @unilateral("m", "height of the left foot", restitution="e_left", **PLAIN)
    def left(self) -> ca.SX:
        return self.foot(-1)[1]

    @unilateral("m", "height of the right foot", restitution="e_right", **PLAIN)
    def right(self) -> ca.SX:
        return self.foot(1)[1]

    @dry_friction("m/s", "sliding of the left foot", static="rough", normal="left", **PLAIN)
    def left_slip(self) -> ca.SX:
        return self.dot(self.foot(-1)[0])

    @dry_friction("m/s", "sliding of the right foot", static="smooth", normal="right", **PLAIN)
    def right_slip(self) -> ca.SX:
        return self.dot(self.foot(1)[0])


@pytest.mark.slow
def test_feet_of_a_linkage_as_arrays_with_coefficients_of_their_own(fmu: Callable[..., Path]) -> None:
    names = {"move_x": "x", "gap_impulse[1]": "left_impulse", "gap_force[2]": "right_force", "slip[2]": "right_slip"}
    same_motion(simulate(fmu(Table), **SHORT), simulate(fmu(ByFeet), **SHORT), names)


# ---- chains ----------------------------------------------------------------------------------------------------------


class Train(OscillatorChain):
    """Masses on a rough track before a buffer."""

    bounce, room = restitution(0.7), Parameter(0.2, "m", "distance of the last mass from the buffer")
    grip = Parameter(0.15, "N", "static friction", minimum=0)
    drag = Parameter(0.1, "N", "sliding friction", minimum=0)

    @unilateral("m", "distance of the last mass from the buffer", restitution="bounce", last=True)
    def gap(self) -> ca.SX:
        return self.room - self.u

    @dry_friction("m/s", "sliding of the masses", static="grip", sliding="drag")
    def slip(self) -> ca.SX:
        return self.dot(self.u)


class Row(Mechanism):
    """The same as an array."""

    n = Size(4, "number of masses")
    bounce, room = restitution(0.7), Parameter(0.2, "m", "distance of the last mass from the buffer")
    grip = Parameter(0.15, "N", "static friction", minimum=0)
    drag = Parameter(0.1, "N", "sliding friction", minimum=0)
    u = Coordinate("m", "displacements", start=(1.0,), size="n")

    @plain
    def kinetic_energy(self) -> ca.SX:
        return ca.sumsqr(self.dot(self.u)) / 2

    @plain
    def potential_energy(self) -> ca.SX:
        return ca.sumsqr(ca.diff(self.u)) / 2

    @unilateral("m", "distance of the last mass from the buffer", restitution="bounce")
    def gap(self) -> ca.SX:
        return self.room - self.u[-1]

    @dry_friction("m/s", "sliding of the masses", static="grip", sliding="drag", size="n")
    def slip(self) -> ca.SX:
        return self.dot(self.u)


TRAIN = {"u": "u", **{f"slip{end}[{i}]": f"slip{end}[{i}]" for end in ("", "_force", "_sticks") for i in (1, 4)}}
TRAIN |= {name: name for name in ("gap", "gap_force", "gap_impulse", "gap_impacts", "dissipated")}


@pytest.mark.parametrize(
    ("fmi", "n", "stop"), [("3", 3, 5.0), *(pytest.param("2", n, 20.0, marks=pytest.mark.slow) for n in (4, 7, 63))]
)
def test_masses_of_a_chain_rub_and_run_into_a_buffer(tmp_path: Path, fmi: Any, n: int, stop: float) -> None:
    files = (build(assemble(kind, n), tmp_path, fmi=fmi) for kind in (Train, Row))
    start = {"u_dot_0": np.r_[np.zeros(n - 1), 0.5], "grip": 0.3, "drag": 0.2}
    run, by_hand = (simulate(file, **RUN | {"stop_time": stop}, **start) for file in files)
    same_motion(run, by_hand, TRAIN if n > 3 else {name: TRAIN[name] for name in TRAIN if "[4]" not in name})
    assert run["gap_impacts"][-1] >= 1
    assert 0 < np.mean(run["slip_sticks"]) < 1


def test_sensitivities_of_contacts_of_a_chain() -> None:
    settings: dict[str, Any] = {"by": ["bounce", "drag"], "record": "u[2]", "stop_time": 5.0, "step_size": 0.5}
    chain, array = (sensitivities(assemble(kind, 3), **settings) for kind in (Train, Row))
    same_derivatives(chain, array, ("u[2]", "u[2]"))


class Rope(PendulumChain):
    """Rope that swings against a rough wall."""

    n = Size(2, "number of bobs")
    bounce, wall = restitution(0.5), Parameter(0.1, "m", "distance of the wall")
    mu = Parameter(0.3, "1", "coefficient of friction", minimum=0)

    @unilateral("m", "distances of the bobs from the wall", restitution="bounce")
    def gap(self) -> ca.SX:
        return self.bob["x"] + self.wall

    @dry_friction("m/s", "sliding of the bobs along the wall", static="mu", normal="gap")
    def slip(self) -> ca.SX:
        return self.dot(self.bob["z"])


class Bobs(Mechanism):
    """The same as an array."""

    n = Size(2, "number of bobs")
    bounce, wall, gravity = restitution(0.5), Parameter(0.1, "m", "distance of the wall"), Gravity()
    mu = Parameter(0.3, "1", "coefficient of friction", minimum=0)
    theta = Coordinate("rad", "angles", start=0.1, size="n")
    pivot_x = ActiveCoordinate("m", "horizontal position of the pivot")
    pivot_z = ActiveCoordinate("m", "height of the pivot")

    def bobs(self) -> tuple[ca.SX, ca.SX]:
        x, z = ca.cumsum(ca.sin(self.theta)), ca.cumsum(ca.cos(self.theta))
        return self.pivot_x + x, self.pivot_z - z

    @plain
    def kinetic_energy(self) -> ca.SX:
        return sum((ca.sumsqr(self.dot(column)) for column in self.bobs()), ca.SX(0)) / 2

    @plain
    def potential_energy(self) -> ca.SX:
        return self.gravity * ca.sum1(self.bobs()[1])

    @unilateral("m", "distances of the bobs from the wall", restitution="bounce", size="n", **PLAIN)
    def gap(self) -> ca.SX:
        return self.bobs()[0] + self.wall

    @dry_friction("m/s", "sliding of the bobs along the wall", static="mu", normal="gap", size="n", **PLAIN)
    def slip(self) -> ca.SX:
        return self.dot(self.bobs()[1])


@pytest.mark.variants(core=0)
def test_links_of_a_moved_chain_hit_a_rough_wall(tmp_path: Path) -> None:
    """The operator of the pivot feels the impulses, too."""
    settings = RUN | {"stop_time": 1.5, "pivot_x": operator("Sinusoid", amplitude=0.2, angular_frequency=3.0)}
    run, by_hand = (simulate(build(kind, tmp_path), **settings) for kind in (Rope, Bobs))
    names = ("theta", "gap", "slip", "gap_impulse", "pivot_x_impulse", "pivot_z_impulse", "pivot_x_force", "work")
    same_motion(run, by_hand, {name: name for name in (*names, "gap_impacts", "slip_force")})
    assert run["gap_impacts"][-1, 0] >= 1


def test_equations_of_contacts_of_a_link() -> None:
    shown = equations(Rope)
    assert "gap = wall + joint" in shown["unilateral"].text()
    assert shown["dry_friction"].text().splitlines()[1:] == ["    slip = joint˙_z + l θ̇ sin θ", "  S_slip = μ · λ_gap"]


class Bumper(Mechanism):
    """Mass on a spring at the end of a chain, on a rough track before a buffer."""

    bounce, room, grip = restitution(0.7), Parameter(0.2, "m", "room"), Parameter(0.1, "N", "friction", minimum=0)
    x = Coordinate("m", "place", start_rate=1.0)
    end = ActiveCoordinate("m", "end of the chain")

    @plain
    def kinetic_energy(self) -> ca.SX:
        return self.dot(self.x) ** 2

    @plain
    def potential_energy(self) -> ca.SX:
        return 1.5 * (self.x - self.end) ** 2

    @unilateral("m", "distance from the buffer", restitution="bounce")
    def gap(self) -> ca.SX:
        return self.room - self.x

    @dry_friction("m/s", "sliding of the mass", static="grip")
    def slip(self) -> ca.SX:
        return self.dot(self.x)


class Whole(Bumper):
    """The same with the masses of the chain."""

    n = Size(3, "number of masses")
    u = Coordinate("m", "displacements", start=(1.0,), size="n")
    end = None

    @plain
    def kinetic_energy(self) -> ca.SX:
        return self.dot(self.x) ** 2 + ca.sumsqr(self.dot(self.u)) / 2

    @plain
    def potential_energy(self) -> ca.SX:
        return 1.5 * (self.x - self.u[-1]) ** 2 + ca.sumsqr(ca.diff(self.u)) / 2


def test_contacts_beside_a_chain(tmp_path: Path) -> None:
    """Both as one FMU."""
    connections = {"bumper.end": "chain.u[3]", "bumper.end_dot": "chain.u_dot[3]", "bumper.end_ddot": "chain.u_ddot[3]"}
    connections |= {"chain.u_load[3]": "bumper.end_force"}
    models = {"chain": assemble(OscillatorChain, 3), "bumper": assemble(Bumper)}
    whole = build(compose("Both", models, connections), tmp_path)
    run, by_hand = simulate(whole, **RUN), simulate(build(Whole, tmp_path), **RUN)
    names = {f"bumper.{name}": name for name in ("x", "gap_impulse", "slip_force", "slip_sticks")} | {
        "chain.u[1]": "u[1]"
    }
    for name, other in names.items():
        np.testing.assert_allclose(run[name], by_hand[other], rtol=0, atol=1e-13, err_msg=name)
    assert run["bumper.gap_impacts"][-1] == 1
    assert abs(run["bumper.energy_balance"]).max() < 1e-9


# ---- misuse ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("options", "text"),
    [
        ({"size": "n - 1"}, r"Wrong.slip: returns .*: it must be a column of n - 1 = 2 elements"),
        ({"size": "n", "static": "few"}, r"Wrong.slip\[3\]: is bounded by 'few\[3\]', which is neither a parameter"),
        (
            {"size": "n", "static": "few", "normal": "gap"},
            r"Wrong.slip\[3\]: takes the force of normal = 'gap\[3\]': na",
        ),
    ],
)
def test_arrays_that_do_not_fit_are_refused(options: dict[str, Any], text: str) -> None:
    with pytest.raises(ComponentError, match=text):

        class Wrong(Blocks):
            few = Parameter(1.0, "N", "static friction of some", minimum=0, size="n - 1")

            @unilateral("m", "distances", size="n - 1")
            def gap(self) -> ca.SX:
                return ca.diff(self.x)

            @dry_friction("m/s", "sliding of the blocks", **{"static": "grip", **options})
            def slip(self) -> ca.SX:
                return self.dot(self.x)


@pytest.mark.parametrize(
    ("kind", "n", "text"),
    [
        (Train, 64, r"^Train: gap, slip are 65 contacts; an FMU takes 64 at most: take a smaller size$"),
        (Rope, 1000, r"^Rope: gap, slip are 2000 contacts; an FMU takes 64 at most: take a smaller size$"),
        (Blocks, 65, r"^Blocks: slip are 65 contacts; an FMU takes 64 at most: take a smaller size$"),
    ],
)
def test_more_contacts_than_an_fmu_takes_are_refused(kind: Any, n: int, text: str) -> None:
    with pytest.raises(ComponentError, match=text):
        assemble(kind, n)


class Buffered(OscillatorChain):
    """Chain before a buffer."""

    @unilateral("m", "distance of the last mass from its place", last=True)
    def gap(self) -> ca.SX:
        return -self.u


LONG = r": a chain of n = 301 links with contacts is written out link by link; take n <= 300$"


def test_long_chains_with_contacts_are_refused() -> None:
    with pytest.raises(ComponentError, match="^Buffered" + LONG):
        assemble(Buffered, 301)


@pytest.mark.slow
def test_long_chains_beside_contacts_are_refused() -> None:
    with pytest.raises(ComponentError, match="^Both" + LONG):
        compose("Both", {"chain": assemble(OscillatorChain, 301), "bumper": assemble(Bumper)}, {})


@pytest.mark.parametrize(
    ("members", "text"),
    [
        (
            {"gap": unilateral("m", "gap")(lambda m: m.u - m.joint["x"])},
            "Wrong: gap needs the joint, which a free end la",
        ),
        (
            {"slip": dry_friction("m/s", "slip", static="mu", normal="gap")(lambda m: m.dot(m.u))},
            "Wrong.slip: it and normal = 'gap' are of different links; let both have last=True, or neither",
        ),
        ({"gap": unilateral("m", "gap", size="n")(lambda m: m.u)}, "Wrong.gap: size = 'n': a Chain describes one link"),
    ],
)
def test_contacts_of_chains_that_do_not_fit_are_refused(members: dict[str, Any], text: str) -> None:
    with pytest.raises(ComponentError, match=text):
        type("Wrong", (Train,), {"mu": Parameter(0.3, "1", "coefficient", minimum=0), **members})


def test_the_last_link_is_of_a_chain() -> None:
    with pytest.raises(ComponentError, match=r"^Wrong.gap: has last=True, which is of a Chain; leave it out$"):
        type("Wrong", (Bumper,), {"gap": unilateral("m", "gap", last=True)(lambda m: m.x)})
