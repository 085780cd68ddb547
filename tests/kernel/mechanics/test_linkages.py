"""Linkages: the recursion over bodies against derivatives of a Lagrangian that it has no part in."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any, cast

import casadi as ca
import numpy as np
import pytest
from linkages import by_differentiation, random_state, random_tree
from scipy.spatial.transform import Rotation

from liaisons import (
    Body,
    BodyPoint,
    Free,
    Linkage,
    Planar,
    Prismatic,
    Revolute,
    Screw,
    Spherical,
    SpringDamper,
    System,
    Universal,
    assemble,
    build,
    derive,
    flatten,
    ground,
    modelica,
    non_holonomic,
    operator,
    simulate,
)
from liaisons.errors import ComponentError, SimulationError
from liaisons.language import Mechanism
from liaisons.linkages.printing import of_linkage
from liaisons.models import Arm, Sinusoid

QUANTITIES = (
    *("mass_matrix", "momenta", "velocities", "momentum_rates", "accelerations", "operator_forces", "effective_mass"),
    *("kinetic_energy", "potential_energy", "energy", "power", "dissipation"),
)
ROD = {"mass": 2.0, "inertia": (0.01, 0.2, 0.2), "centre": (0.5, 0.0, 0.0)}


@pytest.mark.parametrize("seed", range(50))
@pytest.mark.variants(core=0)
def test_recursion_is_the_derivative_of_the_lagrangian(seed: int) -> None:
    tree = random_tree(seed)
    equations, reference = derive(tree), derive(by_differentiation(tree))
    state = random_state(equations, seed)
    for quantity in QUANTITIES:
        got, expected = equations.evaluate(quantity, **state), reference.evaluate(quantity, **state)
        # Sums of some hundred terms; accelerations are as wrong as the condition of the mass matrix makes them.
        scale = np.abs(expected).max(initial=1e-300)
        if quantity in ("accelerations", "velocities", "operator_forces", "effective_mass", "power"):
            metric = equations.evaluate("mass_matrix", **state)
            scale *= max(1.0, np.linalg.cond(metric) / 100) if metric.size else 1.0
        np.testing.assert_allclose(got, expected, rtol=0, atol=1e-12 * scale, err_msg=quantity)


@pytest.mark.parametrize("prescribed", [(False, True), (True, False), (False, False)])
def test_armature_and_reference_values_are_those_of_the_lagrangian(prescribed: tuple[bool, bool]) -> None:
    class Geared(Linkage):
        arm = Body(1.0, (0.1, 0.2, 0.25), (0.1, 0.2, 0.3))
        slide = Body(2.0, (0.3, 0.2, 0.25), (0, 0.2, 0.1))
        hand = Body(1.5, (0.1, 0.3, 0.25), (0.1, 0, 0.3))
        motor = Revolute(
            ground, arm, axis="y", armature=0.3, stiffness=2.0, unstressed=0.4, reference=0.2, prescribed=prescribed[0]
        )
        rail = Prismatic(arm, slide, axis="x", at=(0, 0.1, 1), armature=0.7, reference=-0.3, prescribed=prescribed[1])
        wrist = Revolute(slide, hand, axis="z", at=(0.3, 0, 0), armature=0.5, damping=0.2)

    equations, reference = derive(Geared), derive(by_differentiation(Geared))
    state = random_state(equations, 5)
    for quantity in QUANTITIES:
        got, expected = equations.evaluate(quantity, **state), reference.evaluate(quantity, **state)
        scale = np.abs(expected).max(initial=1e-300)
        np.testing.assert_allclose(got, expected, rtol=0, atol=1e-12 * scale, err_msg=quantity)  # rounding
    if prescribed == (False, False):
        assert equations.evaluate("potential_energy", gravity=0.0, motor=0.9) == pytest.approx(2 / 2 * 0.5**2)


@pytest.mark.parametrize(
    ("joint", "words"),
    [
        ({"reference": 0.2}, "reference = 0.2: only for one coordinate"),
        ({"unstressed": 0.2}, "unstressed = 0.2: only for one coordinate"),
        ({"armature": 0.2}, "armature = 0.2: of coordinates of different kinds"),
    ],
)
def test_what_belongs_to_one_coordinate(joint: dict[str, Any], words: str) -> None:
    ball = Body(1.0, 1.0)
    with pytest.raises(ComponentError, match=words):
        type("Several", (Linkage,), {"__doc__": "", "ball": ball, "free": Free(ground, ball, **joint)})


def settings(tree: type[Linkage], seed: int) -> dict[str, Any]:
    """Start rates, and Sinusoids for what is prescribed."""
    rng = np.random.default_rng(seed)
    values: dict[str, Any] = {f"{q.name}_dot_0": float(rng.normal()) for q in tree.coordinates}
    values |= {f"{rate}_0": float(rng.normal()) for o in tree.orientations for rate in o.rates}
    values |= {
        s.name: operator(Sinusoid, amplitude=float(rng.uniform(0.1, 0.5)), angular_frequency=float(rng.uniform(1, 3)))
        for s in tree.actives
    }
    interpolated = {"input_reconstruction": 2} if tree.actives else {}
    return values | {"stop_time": 1.0, "step_size": 0.02, "tolerance": 1e-12} | interpolated


@pytest.mark.parametrize("seed", [2, pytest.param(11, marks=pytest.mark.slow)])
@pytest.mark.variants(core=0)
def test_fmus_keep_the_energy_account_and_agree(seed: int, tmp_path: Path) -> None:
    tree = random_tree(seed, most=3)
    values = settings(tree, seed)
    second, third = (simulate(build(tree, tmp_path / fmi, fmi=fmi), **values) for fmi in ("2", "3"))
    size = max(1.0, np.abs(second["energy"]).max())
    assert np.abs(second["energy_balance"]).max() <= 1e-9 * size
    for name in (q.name for q in tree.coordinates):
        assert np.array_equal(second[name], third[name])  # the same C


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(50))
def test_random_trees_keep_the_energy_account(seed: int, tmp_path: Path) -> None:
    tree = random_tree(100 + seed, most=5)
    result = simulate(build(tree, tmp_path), **settings(tree, seed))
    assert np.abs(result["energy_balance"]).max() <= 1e-9 * max(1.0, np.abs(result["energy"]).max())


class Driven(Linkage):
    """A driven arm with a bob on it."""

    arm, bob = Body(**ROD), Body(**ROD)
    turn = Revolute(ground, arm, axis="y", prescribed=True)
    swing = Revolute(arm, bob, axis="z", at=(1, 0, 0), start=1.0)


def test_flattened_system_moves_as_the_fmu(tmp_path: Path) -> None:
    file = build(Driven, tmp_path)
    system = System("driven by a motor")
    arm = system.add("arm", file)
    motor = system.add("motor", build(Sinusoid, tmp_path), amplitude=0.5, angular_frequency=2.0)
    system.connect(motor["y"], arm["turn"])
    run: dict[str, Any] = {"stop_time": 1.0, "step_size": 0.02, "tolerance": 1e-11}
    whole = simulate(flatten(system, tmp_path, components={"Driven": Driven}), **run)
    alone = simulate(file, turn=operator(Sinusoid, amplitude=0.5, angular_frequency=2.0), input_reconstruction=2, **run)
    # Interpolated σ is right to H⁶, 6e-11.
    assert whole["arm.swing"] == pytest.approx(alone["swing"], abs=1e-9)


def test_several_orientations_have_names_of_their_own_and_conserve_their_momenta(tmp_path: Path) -> None:
    """Two bodies in free fall: each keeps its momentum, to rounding, and falls by g t²/2."""
    one, two = Body(1.0, (1.0, 2.0, 2.5)), Body(2.0, (0.5, 0.6, 0.7))
    names = {"one": one, "two": two, "first": Free(ground, one), "second": Free(ground, two)}
    pair = type("Pair", (Linkage,), {"__doc__": "Two free bodies.", **names})
    start: dict[str, Any] = {
        "first_omega_x_0": 0.1,
        "first_omega_y_0": 1.0,
        "second_omega_z_0": 2.0,
        "second_omega_y_0": 0.1,
    }
    result = simulate(build(pair, tmp_path), stop_time=2.0, step_size=0.05, **start)
    for joint in ("first", "second"):
        for axis in "xyz":
            assert np.ptp(result[f"{joint}_H_{axis}"]) == 0.0
        assert result[f"{joint}_z"] == pytest.approx(-9.81 / 2 * result.time**2, abs=1e-9)
    assert result["first_H_y"][0] == pytest.approx(2.0)


def test_spherical_joint_is_three_revolute_joints_between_massless_bodies() -> None:
    """Accelerations of the body's points at the same orientation, by Euler angles and by the quaternion."""
    body = {"mass": 2.0, "inertia": (0.2, 0.3, 0.4, 0.01, 0.02, 0.03), "centre": (0.1, 0.2, -0.5)}

    class Ball(Linkage):
        """A body on a spherical joint."""

        load = Body(**body)
        ball = Spherical(ground, load, at=(1, 0, 0))
        end = BodyPoint(load, at=(0.3, 0.2, 0.1))

    class Gimbal(Linkage):
        """The same on three hinges."""

        first, second, load = Body(), Body(), Body(**body)
        a = Revolute(ground, first, axis="x", at=(1, 0, 0))
        b = Revolute(first, second, axis="y")
        c = Revolute(second, load, axis="z")
        end = BodyPoint(load, at=(0.3, 0.2, 0.1))

    angles, rates = (0.3, -0.4, 0.7), (0.5, 1.1, -0.6)
    turns = [Rotation.from_rotvec(angle * axis) for angle, axis in zip(angles, np.eye(3), strict=True)]
    q = (turns[0] * turns[1] * turns[2]).as_quat(scalar_first=True)
    omega = rates[2] * np.eye(3)[2] + turns[2].inv().apply(rates[1] * np.eye(3)[1])
    omega = omega + (turns[1] * turns[2]).inv().apply(rates[0] * np.eye(3)[0])
    free: dict[str, float] = dict(
        zip([f"ball_q_{x}" for x in "wxyz"] + [f"ball_omega_{x}" for x in "xyz"], [*q, *omega], strict=True)
    )
    bound: dict[str, float] = dict(zip(("a", "b", "c", "a_dot", "b_dot", "c_dot"), (*angles, *rates), strict=True))
    for number, axis in enumerate("xyz"):
        second = [
            acceleration(component, lambda m, i=number: [*m.end.values()][i], values)
            for component, values in ((Ball, free), (Gimbal, bound))
        ]
        assert second[0] == pytest.approx(second[1], abs=1e-13), axis


def acceleration(component: type[Mechanism], expression: Any, values: dict[str, float]) -> float:
    """Second time derivative of an expression along the motion."""
    equations = derive(component)
    m = equations.mechanism
    second = equations.in_motion(m.dot(m.dot(expression(m))))
    return float(ca.Function("f", [*equations.symbols.values()], [second])(*equations.numbers(values).values()))


def test_equations_frame_by_frame_are_those_that_the_fmu_solves() -> None:
    """Velocities outwards, momenta and weights inwards, one after the other; then p and its rate."""
    equations = derive(Arm)
    m, printed = equations.mechanism, of_linkage(equations, cast("Linkage", equations.mechanism))
    state = random_state(equations, 1) | {p.name: p.start for p in m.parameters}
    values = dict(state)
    for e in printed:
        symbols = ca.symvar(e.right)
        values[e.left] = float(ca.Function("e", symbols, [e.right])(*(values[str(x)] for x in symbols)))
    expected = dict(
        zip(("p_grip_omega_x", "p_grip_omega_y", "p_grip_omega_z"), equations.evaluate("momenta", **state), strict=True)
    )
    rates = np.array(derive(Arm).evaluate("momentum_rates", **state))
    turned = (
        np.array(ca.Function("R", [*m.symbols.values()], [m.free.frame])(*(values[x] for x in m.symbols))).T @ rates
    )
    expected |= dict(zip((f"{name}_dot" for name in [*expected]), turned, strict=True))
    for name, value in expected.items():
        assert values[name] == pytest.approx(value, rel=1e-12), name


def test_screw_advances_by_its_pitch_in_one_revolution() -> None:
    nut = Body(1.0, 1.0)
    screw = type("Lead", (Linkage,), {"nut": nut, "turn": Screw(ground, nut, pitch=0.25, axis="x", at=(1.0, 0, 0))})
    m = screw()
    place = ca.Function("f", [*m.symbols.values()], [m.nut.position()])
    at = m.start_values() | {"turn": 4 * np.pi}
    assert np.array(place(*(at[name] for name in m.symbols))).ravel() == pytest.approx([1.5, 0, 0], abs=1e-15)
    assert derive(screw).evaluate("mass_matrix") == pytest.approx(1.0 + (0.25 / (2 * np.pi)) ** 2)


# ---- loops -----------------------------------------------------------------------------------------------------------


def parallelogram(driven: bool = False, **pin: Any) -> type[Linkage]:
    crank, coupler, rocker = Body(**ROD), Body(**ROD), Body(**ROD)
    options: dict[str, Any] = {"at": (1, 0, 0), "at_child": (1, 0, 0)} | pin
    joints = {
        "turn": Revolute(ground, crank, axis="y", start=-1.0, prescribed=driven),
        "elbow": Revolute(crank, coupler, axis="y", at=(1, 0, 0), start=1.0),
        "swing": Revolute(ground, rocker, axis="y", at=(1, 0, 0), start=-1.0),
        "pin": Revolute(coupler, rocker, axis="y", **options),
    }
    bodies = {"crank": crank, "coupler": coupler, "rocker": rocker}
    return type("Parallelogram", (Linkage,), {"__doc__": "A parallelogram.", **bodies, **joints})


def test_redundant_conditions_of_a_plane_loop_are_left_out_and_named() -> None:
    four_bar = parallelogram()
    assert len(four_bar.constraints) == 2
    assert len(four_bar.redundant) == 3
    assert {name.partition("_")[0] for name in four_bar.redundant} == {"pin"}


def test_loop_moves_as_its_reduced_equation_says(tmp_path: Path) -> None:
    """A parallelogram of hinges: crank and rocker turn as one, the coupler moves without turning."""
    result = simulate(build(parallelogram(), tmp_path), stop_time=1.0, step_size=0.01, tolerance=1e-11)
    inertia = 2 * (0.2 + 2.0 * 0.25) + 2.0  # of crank and rocker about their hinges, of the coupler's mass at 1 m
    torque = 9.81 * (2 * 2.0 * 0.5 + 2.0)  # of the weights, while the rods lie level
    energy = inertia / 2 * result["turn_dot"] ** 2 - torque * np.sin(result["turn"])
    assert energy == pytest.approx(energy[0], abs=1e-9 * torque)
    assert result["swing"] == pytest.approx(result["turn"], abs=1e-12)
    assert np.abs(result["energy_balance"]).max() <= 1e-9


@pytest.mark.parametrize("driven", [False, True])
def test_start_values_of_a_loop_are_moved_onto_its_conditions(driven: bool) -> None:
    """Those of free coordinates: what an operator prescribes stays."""
    tree = parallelogram(driven, at_child=(1.1, 0, 0))
    start = {q.name: q.start for q in (*tree.coordinates, *tree.actives)}
    tip = np.exp(-1j * start["turn"]) + np.exp(-1j * (start["turn"] + start["elbow"]))
    assert 1 + 1.1 * np.exp(-1j * start["swing"]) == pytest.approx(tip, abs=1e-12)


# ---- forces, limits, wheels ------------------------------------------------------------------------------------------


class Sprung(Linkage):
    """Two sliders with a spring and damper between them; one is caught by a stop, one rubs."""

    one, two = Body(1.0), Body(3.0)
    a = Prismatic(ground, one, axis="x", limits=(-1.0, 2.0), restitution=0.5, start=1.0, start_rate=-6.0)
    b = Prismatic(ground, two, axis="x", at=(0, 1, 0), friction=0.1, start=4.0)
    tie = SpringDamper(one, (two, (0, 0, 0)), stiffness=2.0, damping=0.1, length=1.0)
    gravity_direction = (0.0, 0.0, -1.0)


def test_springs_stops_and_dry_friction_are_in_the_energy_account(tmp_path: Path) -> None:
    result = simulate(build(Sprung, tmp_path), stop_time=4.0, step_size=0.01, tolerance=1e-10)
    assert result["a_above_impacts"][-1] >= 1
    assert result["a"].min() >= -1.0 - 1e-9
    assert result["impact_loss"][-1] > 0.1
    length = np.hypot(1.0, result["b"] - result["a"])
    expected = result["kinetic_energy"] + (length - 1.0) ** 2
    assert result["energy"] == pytest.approx(expected, abs=1e-12)
    assert np.abs(result["energy_balance"]).max() <= 1e-8  # localised events


class Wheel(Linkage):
    """A wheel that rolls upright on a plane, without slip."""

    hub, slide, fork, disc = Body(), Body(), Body(), Body(2.0, (0.1, 0.2, 0.1))
    x = Prismatic(ground, hub, axis="x", at=(0, 0, 0.5), start_rate=0.5)
    y = Prismatic(hub, slide, axis="y")
    steer = Revolute(slide, fork, axis="z", start_rate=0.8)
    roll = Revolute(fork, disc, axis="y", start_rate=1.0)

    def contact(self) -> ca.SX:
        """Velocity of the lowest point."""
        return self.fork.velocity_of() + ca.cross(self.disc.matrix @ self.disc.spin, ca.vertcat(0, 0, -self.x_at_z))

    @non_holonomic("m/s", "no slip along x")
    def along(self) -> ca.SX:
        return self.contact()[0]

    @non_holonomic("m/s", "no slip along y")
    def across(self) -> ca.SX:
        return self.contact()[1]


def test_rolling_wheel_goes_round_in_a_circle(tmp_path: Path) -> None:
    """At constant rates of roll and steering, of the radius r roll'/steer' (Neimark and Fufaev)."""
    result = simulate(build(Wheel, tmp_path), stop_time=3.0, step_size=0.01, tolerance=1e-10)
    radius = 0.5 * 1.0 / 0.8
    assert result["x"] == pytest.approx(radius * np.sin(0.8 * result.time), abs=1e-13)
    assert result["y"] == pytest.approx(radius * (1 - np.cos(0.8 * result.time)), abs=1e-13)


# ---- cost ------------------------------------------------------------------------------------------------------------


@pytest.mark.variants(core=0)
def test_code_is_linear_in_the_number_of_bodies() -> None:
    counts = []
    for n in (8, 16, 32):
        bodies = [Body(**ROD) for _ in range(n)]
        pairs = enumerate(zip([ground, *bodies], bodies, strict=False))
        joints = [Revolute(parent, child, axis="xyz"[i % 3], at=(1, 0, 0)) for i, (parent, child) in pairs]
        names = {f"b{i}": b for i, b in enumerate(bodies)} | {f"j{i}": j for i, j in enumerate(joints)}
        equations = derive(type("Row", (Linkage,), {"__doc__": "A row of rods.", **names}))
        rates = ca.cse(equations.in_phase_space(equations.state_rates))
        counts.append(ca.Function("f", [ca.vertcat(*ca.symvar(rates))], [rates]).n_instructions())
    first, second = np.diff(counts)
    assert second <= 1.05 * 2 * first, counts  # the first bodies move less, and cost less


# ---- misuse ----------------------------------------------------------------------------------------------------------


def one_body(body: Body, **more: Any) -> type[Linkage]:
    """A body on a hinge."""
    return type("Wrong", (Linkage,), {"__doc__": "Wrong.", "arm": body, "hinge": Revolute(ground, body), **more})


def one_joint(kind: Any, **options: Any) -> type[Linkage]:
    body = Body(**ROD)
    return type("Wrong", (Linkage,), {"__doc__": "Wrong.", "arm": body, "hinge": kind(ground, body, **options)})


def tied(**options: Any) -> type[Linkage]:
    body = Body(**ROD)
    return one_body(body, tie=SpringDamper(ground, body, **options))


def hung_on_itself() -> type[Linkage]:
    one, two = Body(**ROD), Body(**ROD)
    return type("Wrong", (Linkage,), {"one": one, "two": two, "a": Revolute(one, two), "b": Revolute(two, one)})


def joined(parent: Any, child: Any) -> type[Linkage]:
    body = Body(**ROD)
    parent, child = (body if x is None else x for x in (parent, child))
    return type("Wrong", (Linkage,), {"arm": body, "hinge": Revolute(parent, child)})


WRONG = [
    (lambda: one_body(Body(-1.0)), "Wrong.arm: mass = -1: it must be >= 0"),
    (lambda: one_body(Body(float("nan"))), "Wrong.arm: mass = [nan]: it must have 1 finite numbers"),
    (lambda: one_body(Body(cast("Any", "heavy"))), "Wrong.arm: mass = ['heavy']: it must have 1 finite numbers"),
    (lambda: one_body(Body(1.0, (1.0, 2.0))), "Wrong.arm: inertia = (1.0, 2.0): it must have 3 or 6 finite numbers"),
    (lambda: one_body(Body(1.0, (1.0, 1.0, -1.0))), "Wrong.arm: inertia = (1.0, 1.0, -1.0): its principal moments"),
    (lambda: one_body(Body(1.0, (1.0, 1.0, 1.0, 2.0, 0, 0))), "Wrong.arm: inertia = (1.0, 1.0, 1.0, 2.0, 0, 0)"),
    (lambda: one_body(Body(1.0, (1.0, 1.0, 3.0))), "one exceeds the sum of the others"),
    (lambda: one_body(Body(1.0, 1.0, (1.0, 2.0))), "Wrong.arm: centre = (1.0, 2.0): it must have 3 finite numbers"),
    (lambda: one_body(Body(centre=(1.0, 0, 0))), "Wrong.arm: centre = (1.0, 0, 0): a body without mass has none"),
    (lambda: one_body(Body(1.0)), "Wrong.hinge: no mass moves with hinge_dot at the start, neither of arm"),
    (lambda: one_joint(Revolute, axis="w"), "Wrong.hinge: axis = 'w': it is 'x', 'y', 'z'"),
    (lambda: one_joint(Revolute, axis=(0, 0, 0)), "Wrong.hinge: axis = (0, 0, 0): it is 'x', 'y', 'z'"),
    (lambda: one_joint(Revolute, at=(0, 1)), "Wrong.hinge: at = (0, 1): it must have 3 finite numbers"),
    (lambda: one_joint(Revolute, rotation="xyz"), "Wrong.hinge: rotation = 'xyz': it must have 3 finite numbers"),
    (lambda: one_joint(Revolute, at_child=(1, 0, 0)), "Wrong.hinge: at_child is for a joint that closes a loop"),
    (lambda: one_joint(Revolute, start="up"), "Wrong.hinge: start = 'up': it must have 1 finite numbers"),
    (lambda: one_joint(Universal, start=(1, 2, 3)), "Wrong.hinge: start = (1, 2, 3): it must have 2 finite numbers"),
    (lambda: one_joint(Revolute, limits=(1, -1)), "Wrong.hinge: limits = (1, -1): the lower one comes first"),
    (lambda: one_joint(Universal, limits=(0, 1)), "Wrong.hinge: limits = (0, 1): only for one coordinate"),
    (lambda: one_joint(Revolute, stiffness=-1.0), "Wrong.hinge: stiffness = -1: it must be >= 0"),
    (lambda: one_joint(Free, damping=1.0), "Wrong.hinge: damping = 1.0: of coordinates of different kinds"),
    (lambda: one_joint(Spherical, stiffness=1.0), "Wrong.hinge: stiffness = 1.0: of coordinates of different kinds"),
    (lambda: one_joint(Spherical, prescribed=True), "Wrong.hinge: an orientation cannot be prescribed: three Revolute"),
    (lambda: one_joint(Free, prescribed=True), "Wrong.hinge: an orientation cannot be prescribed: three Revolute"),
    (
        lambda: one_joint(Planar, prescribed=("z",)),
        "Wrong.hinge: prescribed = ('z',): 'z' is not one of its coordinates",
    ),
    (lambda: one_joint(Revolute, prescribed=True, friction=1.0), "Wrong.hinge: friction is against a free coordinate"),
    (lambda: one_joint(Screw, pitch="fine"), "Wrong.hinge: pitch = ['fine']: it must have 1 finite numbers"),
    (lambda: joined(ground, "arm"), "Wrong.hinge: 'arm' is not a body of Wrong"),
    (lambda: joined(Body(1.0), None), "is not a body of Wrong; declare it above by Body(...), or take ground"),
    (lambda: joined(None, ground), "Wrong.hinge: the second body is ground; let it be arm, and the first one ground"),
    (lambda: joined(None, None), "Wrong.hinge: both bodies are arm; a joint has two"),
    (lambda: one_body(Body(**ROD), rest=Body(1.0)), "Wrong.rest: no joint holds this body; a free one has Free"),
    (hung_on_itself, "Wrong.a: two hangs on one, from which no joint leads to ground"),
    (lambda: parallelogram(at=(5, 0, 0)), "Parallelogram.pin: the loop through coupler and rocker does not close"),
    (lambda: parallelogram(prescribed=True), "Parallelogram.pin: it closes a loop, so that it has no coordinate"),
    (lambda: tied(stiffness=-1.0), "Wrong.tie: stiffness = -1: it must be >= 0"),
]


@pytest.mark.parametrize(("declare", "text"), WRONG, ids=range(len(WRONG)))
def test_wrong_declarations_are_refused_in_one_line_that_names_them(declare: Any, text: str) -> None:
    with pytest.raises(ComponentError, match=re.escape(text)) as refusal:
        declare()
    assert "\n" not in str(refusal.value)


def test_unknown_argument_of_a_joint_shows_how_it_is_written() -> None:
    with pytest.raises(ComponentError, match=r"unexpected keyword argument 'angle'; write for example Revolute\("):
        Revolute(ground, Body(1.0), angle=1.0)  # type: ignore[call-arg]


def test_open_loop_at_the_start_of_a_simulation_is_refused(tmp_path: Path) -> None:
    with pytest.raises(SimulationError, match=r"pin_offset_.* must be kept to 1e-06 m"):
        simulate(build(parallelogram(), tmp_path), stop_time=0.1, elbow_0=1.5)


def test_each_spherical_joint_has_angular_accelerations_of_its_own() -> None:
    """Outputs of FMUs, which were 0, and variables of Modelica text, which were those of one joint."""
    one, two = (Body(2.0, (0.1, 0.2, 0.25), (0.5, 0.0, 0.0)) for _ in range(2))
    members = {"one": one, "two": two, "j": Spherical(ground, one), "k": Spherical(one, two, at=(1, 0, 0))}
    hung = type("Hung", (Linkage,), members)
    names = [f"{joint}_omega_{axis}" for joint in "jk" for axis in "xyz"]
    words = re.findall(r"\w*omega_[xyz]_dot\b", modelica(hung))
    assert set(words) == {f"{name}_dot" for name in names}
    model = assemble(hung)
    start = {f"{name}_0": 0.3 * i - 0.5 for i, name in enumerate(names)}
    k = [start.get(v.name, v.starts[0]) for v in model.parameters]
    u, m, outputs = np.zeros(len(model.inputs)), np.zeros(len(model.memory)), [v.name for v in model.outputs]
    y = ca.SX.sym("y", model.derivatives.size1_out(0))
    z = model.outputs_function(0, y, u, k, m)
    rate = ca.jtimes(z, y, model.derivatives(0, y, u, k))
    both = ca.Function("both", [y], [z, rate])(model.start(0, u, k)[0])
    for name in names:
        angular_acceleration, expected = both[0][outputs.index(f"{name}_dot")], both[1][outputs.index(name)]
        assert abs(float(expected)) > 1e-3
        assert float(angular_acceleration) == pytest.approx(float(expected), rel=1e-12)
