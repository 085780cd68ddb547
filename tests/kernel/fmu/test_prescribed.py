"""Jumps of what is prescribed, and contradictions between σ, σ̇ and σ̈.

A jump of σ̇ is an impulse: momenta stay, and the work of the operator is what the energy has gained.  A jump of σ itself
is the limit of an ever faster straight motion, where that has one: for the swing p_θ stays and Δθ = -∫ (J/I) ds.
"""

from __future__ import annotations

import ctypes
from collections.abc import Callable, Sequence
from functools import cache, partial
from itertools import product
from typing import Any

import numpy as np
import pytest
from driver import CO_SIMULATION, MODEL_EXCHANGE, OK, WARNING, Instance
from numpy.typing import NDArray
from scipy.integrate import quad, solve_ivp

from liaisons.language import Component
from liaisons.mechanics import assemble
from liaisons.models import CartesianPendulum, Pendulum, PlanarCat, Satellite, SpatialCat, Swing

HOLD, EXTRAPOLATE, INTERPOLATE = range(3)
WITH_EVENTS = {"events": True}
SWING = {"theta_0": 0.3, "gravity": 0.0}
ROPE, LEAN = 2.0, np.pi / 2  # start values of the swing


def swing_forms(rope: float, lean: float) -> tuple[float, float, float]:
    """I, J_rope and J_lean of M eq. 55 with the default parameters, by hand."""
    m_1, m_2, b = 20.0, 20.0, 0.5
    inertia = m_1 * rope**2 + m_2 * (rope**2 + b**2 + 2 * rope * b * np.cos(lean))
    return inertia, -m_2 * b * np.sin(lean), m_2 * (b**2 + rope * b * np.cos(lean))


def swing_lift(rope: float, lean: float) -> float:
    """Δθ = -∫ (J/I) ds along the straight line from the start values to these."""

    def rate(part: float) -> float:
        inertia, along, about = swing_forms(ROPE + part * (rope - ROPE), LEAN + part * (lean - LEAN))
        return -(along * (rope - ROPE) + about * (lean - LEAN)) / inertia

    return quad(rate, 0, 1, epsabs=1e-13, epsrel=1e-13)[0]


# ---- jumps of σ --------------------------------------------------------------------------------------------------


def jump(instance: Instance, moved: dict[str, float], *names: str, at: float, size: float) -> NDArray:
    """After a step up to then prescribed values jump, and a short step follows; what there was before."""
    instance.step(0.0, at)
    before = instance.get(*names)
    instance.set(moved)
    instance.step(at, size)
    return before


@pytest.mark.parametrize(("rope", "lean"), [(2.0, 0.2), (1.6, LEAN), (1.7, -0.4)])
def test_a_jump_of_the_posture_lifts_the_swing(library, mode: int, rope: float, lean: float) -> None:
    instance = library(Swing).start(input_reconstruction=mode, tolerance=1e-10, **SWING)
    jump(instance, {"rope": rope, "lean": lean}, at=0.1, size=1e-9)
    assert instance["theta"] == pytest.approx(0.3 + swing_lift(rope, lean), abs=1e-8)
    assert abs(instance["p_theta"]) + abs(instance["work"]) + abs(instance["energy_balance"]) <= 1e-9


def test_a_jump_while_the_swing_moves_does_the_work_of_the_operator(library) -> None:
    """p_θ stays: with gravity and in motion the energy after the jump is that of the lifted posture."""
    instance = library(Swing).start(tolerance=1e-11, theta_0=0.4, theta_dot_0=0.7)
    names = ("theta", "p_theta", "energy", "work")
    theta, momentum, energy, work = jump(instance, {"lean": 0.2}, *names, at=0.3, size=1e-9)
    lifted = theta + swing_lift(ROPE, 0.2)
    x, z = (20 * f(lifted) * ROPE + 20 * (ROPE * f(lifted) + 0.5 * f(lifted + 0.2)) for f in (np.sin, np.cos))
    assert np.hypot(x, z) > 0
    expected = momentum**2 / (2 * swing_forms(ROPE, 0.2)[0]) - 9.81 * z
    assert instance["theta"] == pytest.approx(lifted, abs=1e-8)  # 1e-9 s go by at 1 rad/s
    assert instance["p_theta"] == pytest.approx(momentum, abs=1e-6)  # and at 400 N.m
    assert instance["energy"] == pytest.approx(expected, abs=1e-5)
    assert instance["work"] - work == pytest.approx(expected - energy, abs=1e-9)
    assert abs(instance["energy_balance"]) <= 1e-7


@pytest.mark.parametrize(("mode", "each"), [(HOLD, 1), (EXTRAPOLATE, 2)])
def test_many_small_jumps_are_the_motion(library, mode: int, each: int) -> None:
    """Without rates the posture goes in steps; each one lifts the swing, and together they are a fast motion.

    Where not each communication point has a jump: else rates are missing, and are derived.
    """
    errors = []
    for steps in (50, 100, 200):
        instance = library(Swing).start(input_reconstruction=mode, tolerance=1e-10, **SWING)
        stairs = partial(stair, steps=steps, each=each)
        instance.follow(1 / steps, steps, stairs, ahead=True)
        errors.append(abs(instance["theta"] - 0.3 - swing_lift(ROPE, 0.2)))
    assert max(errors) <= 1e-8  # p = 0: nothing but the lift moves it


def stair(t: float, *, steps: int, each: int) -> dict[str, float]:
    """The posture after so many steps of one; it changes with each so many."""
    return {"lean": LEAN + (0.2 - LEAN) * each * round(t * steps // each) / steps}


@pytest.mark.parametrize("mode", [HOLD, EXTRAPOLATE])
def test_what_the_rate_has_moved_does_not_jump_again(library, mode: int) -> None:
    """With its rate the posture moves the swing inside the step; only what is left jumps at the end of it."""

    def at(t: float) -> dict[str, float]:
        lean, phase = 0.4 * np.sin(2 * t), 2 * t
        return {"lean": LEAN + lean, "lean_dot": 0.8 * np.cos(phase), "lean_ddot": -1.6 * np.sin(phase)}

    errors = []
    for steps in (20, 40, 80):
        instance = library(Swing).start(input_reconstruction=mode, tolerance=1e-11, **SWING, **at(0.0))
        instance.follow(1 / steps, steps, at)
        instance.set(at(1.0))
        instance.step(1.0, 1e-9)
        # At the start the swing moves with the posture, so that p_θ ≠ 0 lets θ go on.
        errors.append(abs(instance["theta"] - swing_reference(at)))
    order = np.log2(errors[0] / errors[-1]) / 2
    assert order >= 0.8 if mode == HOLD else order >= 2.8


@cache
def swing_reference(at: Callable[[float], dict[str, float]]) -> float:
    """θ(1) where p_θ is kept: θ' = (p_θ - J ψ')/I, p_θ = J(0) ψ'(0) for a start at rest."""
    _, _, about = swing_forms(ROPE, at(0.0)["lean"])
    momentum = about * at(0.0)["lean_dot"]

    def rate(t: float, _: Any) -> list[float]:
        inertia, _, about = swing_forms(ROPE, at(t)["lean"])
        return [(momentum - about * at(t)["lean_dot"]) / inertia]

    return float(solve_ivp(rate, (0, 1), [0.3], method="DOP853", rtol=1e-12, atol=1e-12).y[0, -1])


POSTURES: dict[type[Component], dict[str, float]] = {
    PlanarCat: {"psi_1": 0.7, "psi_2": -0.4},
    SpatialCat: {"bend": 0.9, "azimuth": 0.5, "twist": 0.2},
    Satellite: {"wheel_1": 2.0, "wheel_2": -1.0, "wheel_3": 0.7},
}


@pytest.mark.parametrize("component", POSTURES)
def test_jumps_are_fast_motions(library, component) -> None:
    """All at once, while everything turns: a straight motion of 1 µs, up to what the rest does meanwhile."""
    start = dict.fromkeys(_rates(component), 0.3)
    states = [state.name for state in assemble(component).states if state.name not in ("work", "dissipated")]
    duration, posture = 1e-6, POSTURES[component]
    moving = library(component).start(tolerance=1e-12, **start)
    at_rest = {v.name: v.starts[0] for v in assemble(component).inputs}
    jump(moving, {f"{s}_dot": (end - at_rest[s]) / duration for s, end in posture.items()}, at=0.1, size=duration)
    expected = moving.get(*states)
    found = []
    for mode in (EXTRAPOLATE, HOLD, INTERPOLATE):
        instance = library(component).start(input_reconstruction=mode, tolerance=1e-12, **start)
        jump(instance, posture, at=0.1, size=1e-12)
        found.append(instance.get(*states))
        assert abs(instance["energy_balance"]) <= 1e-9
    np.testing.assert_allclose(found[0], expected, rtol=0, atol=1e-4)  # forces of 40 N for 1e-6 s
    np.testing.assert_array_equal(found[1], found[0])
    np.testing.assert_allclose(found[2], found[0], rtol=0, atol=1e-10)  # before, or after 1e-12 s at 40 N


def _rates(component: type[Any]) -> list[str]:
    """Parameters that are rates at the start."""
    return [p.name for p in assemble(component).parameters if p.name.endswith("_dot_0") or p.name.startswith("omega")]


@pytest.mark.parametrize("moved", [{"length": 0.7}, {"pivot_x": 0.5}, {"length": 1.2, "pivot_z": 0.3}])
def test_a_pendulum_at_rest_stays_through_jumps(library, moved: dict[str, float]) -> None:
    """Of the length by the limit, of the pivot as ever: θ and p_θ stay, the work is that on the energy."""
    instance = library(Pendulum).start(tolerance=1e-12, theta_0=0.8)
    names, at = ("theta", "p_theta", "energy", "work"), {"length": 1.0, "pivot_z": 0.0} | moved
    theta, momentum, energy, work = jump(instance, moved, *names, at=0.3, size=1e-12)
    np.testing.assert_allclose(instance.get("theta", "p_theta"), [theta, momentum], rtol=0, atol=1e-10)
    expected = momentum**2 / (2 * at["length"] ** 2) + 9.81 * (at["pivot_z"] - at["length"] * np.cos(theta))
    assert instance["energy"] == pytest.approx(expected, abs=1e-9)
    assert instance["work"] - work == pytest.approx(expected - energy, abs=1e-9)
    assert abs(instance["energy_balance"]) <= 1e-10


def test_a_jump_of_the_length_while_the_pivot_moves_turns_the_momentum(library) -> None:
    """ṗ = m l̇ ẋ_p cos θ + ...: in the limit p gains m ẋ_p cos θ Δl."""
    instance = library(Pendulum).start(tolerance=1e-12, theta_0=0.8, pivot_x_dot=0.6)
    moved = {"pivot_x": 0.06, "length": 0.7}
    theta, momentum = jump(instance, moved, "theta", "p_theta", at=0.1, size=1e-12)
    assert instance["theta"] == pytest.approx(theta, abs=1e-10)
    assert instance["p_theta"] - momentum == pytest.approx(0.6 * np.cos(theta) * -0.3, abs=1e-9)
    assert abs(instance["energy_balance"]) <= 1e-10


def test_rates_alone_turn_the_satellite(library) -> None:
    """Who sets the rates of its wheels and leaves their angles as they are makes them jump nowhere."""
    ends = []
    for mode in (HOLD, EXTRAPOLATE):
        instance = library(Satellite).start(input_reconstruction=mode, wheel_1_dot=5.0)
        instance.follow(0.1, 10)
        ends.append(instance.get("q_w", "q_x", "q_y", "q_z"))
    consistent = library(Satellite).start(wheel_1_dot=5.0)
    consistent.follow(0.1, 10, lambda t: {"wheel_1": 5.0 * t})
    for end in ends:
        np.testing.assert_allclose(end, consistent.get("q_w", "q_x", "q_y", "q_z"), rtol=0, atol=1e-7)


@pytest.mark.parametrize(("kind", "fmi"), [(MODEL_EXCHANGE, "fmi2"), (MODEL_EXCHANGE, "fmi3"), (CO_SIMULATION, "fmi3")])
def test_a_jump_in_event_mode_lifts_the_swing(library, kind: str, fmi: str) -> None:
    options = WITH_EVENTS if kind == CO_SIMULATION else {}
    instance = library(Swing, fmi).start(kind, options=options, tolerance=1e-10, **SWING)
    assert not instance.go_on().states_changed
    if kind == CO_SIMULATION:
        instance.step(0.0, 0.5)
    else:
        instance.do("SetTime", 0.5)
    instance.do("EnterEventMode")
    instance.set(lean=0.2)
    assert instance.update().states_changed
    if kind == MODEL_EXCHANGE:
        assert instance.vector("GetContinuousStates", 4)[0] == pytest.approx(0.3 + swing_lift(ROPE, 0.2), abs=1e-7)
    assert instance["theta"] == pytest.approx(0.3 + swing_lift(ROPE, 0.2), abs=1e-7)
    assert abs(instance["energy_balance"]) <= 1e-10


# ---- contradictions ----------------------------------------------------------------------------------------------

Motion = Callable[[float], tuple[float, float, float]]
NAMES = ("length", "length_dot", "length_ddot")


def wave(omega: float, phase: float = 0.0) -> Motion:
    def motion(t: float) -> tuple[float, float, float]:
        a, x = 0.2, omega * t + phase
        return 1 + a * np.sin(x), a * omega * np.cos(x), -a * omega**2 * np.sin(x)

    return motion


def kinked(at: float, *, before: bool = False) -> Motion:
    """A rate that jumps, inside a step or at the end of one; there it is given as it is after or before that."""

    def motion(t: float) -> tuple[float, float, float]:
        on = t > at if before else t >= at
        return 1 + 0.5 * max(t - at, 0), 0.5 * on, 0.0

    return motion


def smooth_step(t: float) -> tuple[float, float, float]:
    """Quintic, from 1 m to 1.4 m between 0.13 s and 0.83 s."""
    T = 0.7
    x = min(max((t - 0.13) / T, 0), 1)
    shape = (x**3 * (10 - 15 * x + 6 * x**2), 30 * x**2 * (1 - x) ** 2 / T, 60 * x * (1 - x) * (1 - 2 * x) / T**2)
    return 1 + 0.4 * shape[0], 0.4 * shape[1], 0.4 * shape[2]


def parabolas(t: float) -> tuple[float, float, float]:
    """An acceleration that changes its sign at 0.25 s and 0.75 s."""
    x, sign = (t, 1) if t < 0.25 else (t - 0.5, -1) if t < 0.75 else (t - 1, 1)
    if sign > 0:
        return 1 + x**2, 2 * x, 2.0
    return 1 + 0.125 - x**2, -2 * x, -2.0


def steady(t: float) -> tuple[float, float, float]:
    return 1 + 0.3 * t, 0.3, 0.0


def wrong(t: float) -> tuple[float, float, float]:
    return 1 + 0.3 * t, -0.3, 0.0


HONEST: dict[str, Motion] = {
    "steady": steady,
    "wave of 6 steps": wave(2 * np.pi / 0.6),
    "wave of 6 steps, shifted": wave(2 * np.pi / 0.6, 0.3),
    "wave of 4 steps": wave(2 * np.pi / 0.4, 0.1),
    "fine wave": wave(0.7),
    "kink in a step": kinked(0.33),
    "kink early in a step": kinked(0.301),
    "kink late in a step": kinked(0.399),
    "kink at a point, after it": kinked(0.3),
    "kink at a point, before it": kinked(0.3, before=True),
    "smooth step": smooth_step,
    "parabolas": parabolas,
}
CONTRADICTORY: dict[str, tuple[Motion, float, str]] = {  # motion, largest mismatch, what the warning says
    "wrong sign": (wrong, 0.06, "contradict"),
    "rate alone": (lambda _: (1.0, 0.3, 0.0), -0.03, "contradict"),
    "acceleration alone": (lambda _: (1.0, 0.0, 0.5), -0.0025, "contradict"),
    "jump": (lambda t: (1.0 if t < 0.45 else 0.7, 0.0, 0.0), -0.3, "length jumps by -0.3 at t = 0.5"),
    "no rate": (lambda t: (1 + 0.3 * t, 0.0, 0.0), 0.03, "length_dot and length_ddot stay 0 while length changes"),
}


def drive(instance: Instance, motion: Motion, mode: int) -> list[float]:
    """Step along a motion; the mismatches after each step."""
    found = []
    for i in range(10):
        instance.set(dict(zip(NAMES, motion((i + (mode == INTERPOLATE)) * 0.1), strict=True)))
        instance.step(i * 0.1, 0.1, None)  # with a warning where rates are missing
        found.append(instance["length_mismatch"])
    return found


def warned(instance: Instance) -> list[str]:
    """All warnings of an instance, which is terminated."""
    instance.do("Terminate")
    assert all(status == WARNING for status, _, _ in instance.log)
    return instance.messages


@pytest.fixture(params=["fmi2", "fmi3", "python"])
def pendulum_in(request, library) -> Callable[[int, Motion], Instance]:
    """Starts an instance of the pendulum that logs."""

    def start(mode: int, motion: Motion) -> Instance:
        values = dict(zip(NAMES, motion(0.0), strict=True))
        options = {"logging": True}
        return library(Pendulum, request.param).start(options=options, input_reconstruction=mode, **values)

    return start


def test_honest_motions_are_not_complained_about(pendulum_in, mode: int) -> None:
    for name, motion in HONEST.items():
        instance = pendulum_in(mode, motion)
        assert drive(instance, motion, mode) == [0.0] * 10, name
        assert warned(instance) == [], name


@pytest.mark.variants(core=3)
def test_contradictions_are_measured_and_named_once(pendulum_in) -> None:
    for mode, (motion, mismatch, text) in product((EXTRAPOLATE, INTERPOLATE), CONTRADICTORY.values()):
        instance = pendulum_in(mode, motion)
        found = drive(instance, motion, mode)
        assert max(found, key=abs) == pytest.approx(mismatch, rel=1e-9), (mode, text)
        if text == "contradict":  # at the first step that is compared
            assert found[2 - mode] == pytest.approx(mismatch, rel=1e-9), mode
        (message,) = warned(instance)
        assert text in message, mode
        assert "length" in message


def test_hold_and_the_first_communication_point_are_not_complained_about(pendulum_in) -> None:
    held = pendulum_in(HOLD, wrong)
    assert drive(held, wrong, HOLD) == [0.0] * 10
    instance = pendulum_in(EXTRAPOLATE, steady)
    instance.set(length=1.4)  # other than at initialization
    instance.step(0.0, 0.1)
    assert instance["length_mismatch"] == 0
    assert warned(held) == warned(instance) == []


def test_steps_that_are_rolled_back_are_not_complained_about(library) -> None:
    for mode in (EXTRAPOLATE, INTERPOLATE):
        instance = library(Pendulum).start(options={"logging": True}, input_reconstruction=mode)
        instance.step(0.0, 0.1)
        state = instance.save()
        instance.set(length=0.7)
        instance.step(0.1, 0.1)
        assert instance["length_mismatch"] == pytest.approx(-0.3, rel=1e-14)
        instance.restore(state)
        instance.drop(state)
        assert instance["length_mismatch"] == 0
        instance.set(length=1.0)
        instance.follow(0.1, 4, first=1)
        instance.do("Terminate")
        assert instance.messages == []


FACTORS: dict[str, tuple[tuple[float, float], str]] = {  # of rate and acceleration, and what is wrong then
    "half rates": ((0.5, 0.5), "length contradicts length_dot and length_ddot: "),
    "rates in degrees": ((57.3, 57.3), "length contradicts length_dot and length_ddot: "),
    "rates of the other sign": ((-1, -1), "length contradicts length_dot and length_ddot: "),
    "half rate": ((0.5, 1), "length_dot contradicts length and length_ddot: "),
    "half rate, no acceleration": ((0.5, 0), "length, length_dot and length_ddot contradict each other: "),
    "acceleration of the other sign": ((1, -1), "length_ddot contradicts length and length_dot: "),
    "half acceleration": ((1, 0.5), "length_ddot contradicts length and length_dot: "),
}


@pytest.mark.parametrize("mode", [EXTRAPOLATE, INTERPOLATE])
@pytest.mark.parametrize("name", FACTORS)
def test_what_contradicts_is_named(library, mode: int, name: str) -> None:
    """The mismatch is what the value goes beyond the parabola of the rates; for more than a half of a fine wave."""
    (rate, acceleration), text = FACTORS[name]

    def motion(t: float) -> tuple[float, float, float]:
        return 1 + 0.1 * np.sin(t), rate * 0.1 * np.cos(t), -acceleration * 0.1 * np.sin(t)

    start, H, found = dict(zip(NAMES, motion(0.0), strict=True)), 0.02, []
    instance = library(Pendulum).start(options={"logging": True}, input_reconstruction=mode, **start)
    for i in range(200):
        instance.set(dict(zip(NAMES, motion((i + (mode == INTERPOLATE)) * H), strict=True)))
        instance.step(i * H, H)
        found.append(instance["length_mismatch"])
        begin = (i - (mode == EXTRAPOLATE)) * H
        (v_0, r, a), (v_1, _, _) = motion(begin), motion(begin + H)
        if found[-1]:
            assert found[-1] == pytest.approx(v_1 - v_0 - H * r - H**2 / 2 * a, rel=1e-6, abs=1e-14)  # 1e-5 of 1 m
    assert np.count_nonzero(found) > 100
    (message,) = warned(instance)
    assert message.startswith(text)


# ---- rates that nobody gives -------------------------------------------------------------------------------------


def wavy(t: float) -> tuple[float, float, float]:
    return 1 + 0.1 * np.sin(3 * t), 0.3 * np.cos(3 * t), -0.9 * np.sin(3 * t)


def given(count: int, t: float) -> dict[str, float]:
    """The first so many of value, rate and acceleration."""
    return dict(zip(NAMES[:count], wavy(t)[:count], strict=True))


def used_rates(instance: Instance) -> tuple[float, float]:
    """Rate and acceleration of the length, from the operator's force m (l'' - l θ'² - g cos θ) and its power."""
    force, power, length, theta, rate = instance.get("length_force", "length_power", "bob_z", "theta", "theta_dot")
    length = -length / np.cos(theta)
    return power / force, force + length * rate**2 + 9.81 * np.cos(theta)


def driven_by(instance: Instance, count: int, mode: int, sizes: Sequence[float], time: float = 0.0) -> list[int]:
    """Step along the wave with the first so many of its numbers; the status of each step, and the inputs of its end."""
    statuses = []
    for size in sizes:
        instance.set(given(count, time + size * (mode == INTERPOLATE)))
        statuses.append(instance.step(time, size, None))
        time += size
    if mode == EXTRAPOLATE:
        instance.set(given(count, time))
    return statuses


@pytest.mark.parametrize("mode", [EXTRAPOLATE, INTERPOLATE])
@pytest.mark.parametrize("count", [1, 2])
@pytest.mark.parametrize("ratio", [1.0, 2.0])
def test_derived_rates_have_their_order(library, target: str, mode: int, count: int, ratio: float) -> None:
    """Polynomials through five points: of order 4 for a first derivative, 3 for a second one; by unequal steps, too."""
    sizes, errors = (0.04, 0.02, 0.01), []
    for size in sizes:
        instance = library(Pendulum, target).start(input_reconstruction=mode, theta_0=0.5, **given(count, 0.0))
        pair = [2 * size * part / (1 + ratio) for part in (ratio, 1.0)]
        driven_by(instance, count, mode, pair * round(0.6 / size))
        assert instance["length_derived"] == 3 - count
        errors.append(np.abs(np.array(used_rates(instance)) - wavy(1.2)[1:]))
    for order, error in zip((4, 3) if count == 1 else (4,), np.transpose(errors)[count - 1 :], strict=True):
        assert np.polyfit(np.log(sizes), np.log(error), 1)[0] == pytest.approx(order, abs=0.35)  # of the next order


@pytest.mark.parametrize("target", ["fmi2", "fmi3"])
@pytest.mark.parametrize("mode", [EXTRAPOLATE, INTERPOLATE])
def test_missing_rates_are_said_once_and_kept_in_the_state(library, target: str, mode: int) -> None:
    """By a status, a message without any log, and a variable; a roll-back and another process go on to the bit."""
    fmu, steps = library(Pendulum, target), [0.01] * 20
    instance = fmu.start(input_reconstruction=mode, theta_0=0.5, **given(1, 0.0))
    statuses = driven_by(instance, 1, mode, steps)
    assert [i for i, status in enumerate(statuses) if status == WARNING] == [3 - (mode == INTERPOLATE)]
    assert set(statuses) == {OK, WARNING}
    (message,) = instance.messages
    assert message.startswith("length_dot and length_ddot stay 0 while length changes, at t = ")
    assert instance["length_derived"] == 2
    saved, content, names = instance.save(), instance.serialize(), ("theta", "p_theta", "length_force", "work")
    assert WARNING not in driven_by(instance, 1, mode, steps, 0.2)
    expected = instance.get(*names)
    instance.restore(saved)
    driven_by(instance, 1, mode, steps, 0.2)
    np.testing.assert_array_equal(instance.get(*names), expected)
    other = fmu.restored(content)
    assert WARNING not in driven_by(other, 1, mode, steps, 0.2)
    np.testing.assert_array_equal(other.get(*names), expected)
    driven_by(instance, 3, mode, [0.01], 0.4)  # rates come after all
    assert instance["length_derived"] == 0
    instance.do("Reset")
    instance.initialize()
    instance.exit_initialization()
    assert driven_by(instance, 1, mode, steps).count(WARNING) == 1
    instance.drop(saved)


def test_a_motion_by_its_value_alone_is_near_that_by_its_rates(library, target: str) -> None:
    """The first three steps hold the length, an error of second order; without derived rates it was of 30 % in λ."""
    forces = []
    for count in (1, 3):
        instance = library(Pendulum, target).start(theta_0=0.5, **given(count, 0.0))
        driven_by(instance, count, EXTRAPOLATE, [0.01] * 200)
        forces.append(instance.get("theta", "length_force", "energy_balance"))
    assert forces[0][2] == pytest.approx(0, abs=1e-9)  # energies of 10 J, to the tolerance of 1e-8 of the steps
    np.testing.assert_allclose(forces[0][:2], forces[1][:2], rtol=0, atol=1e-3)  # 3 steps of 0.01 s at 0.3 m/s


def test_a_jump_among_values_alone_is_not_smoothed(library, target: str) -> None:
    """The polynomial is left at it: the rate is not that of a way of 0.3 m in 0.01 s."""
    instance = library(Pendulum, target).start(tolerance=1e-10, theta_0=0.5, **given(1, 0.0))
    driven_by(instance, 1, EXTRAPOLATE, [0.01] * 20)
    momentum = instance["p_theta"]
    for i in range(20, 40):
        instance.set(length=given(1, i * 0.01)["length"] + 0.3)
        instance.step(i * 0.01, 0.01, None)
        assert abs(used_rates(instance)[0]) <= 0.4
        if i == 20:
            assert instance["p_theta"] == pytest.approx(momentum, abs=0.1)  # forces of 5 N.m for 0.01 s
    assert used_rates(instance)[0] == pytest.approx(wavy(0.4)[1], abs=1e-3)  # found again, to what a parabola misses


def test_hold_derives_nothing(library, target: str) -> None:
    instance = library(Pendulum, target).start(input_reconstruction=HOLD, theta_0=0.5, **given(1, 0.0))
    assert set(driven_by(instance, 1, HOLD, [0.01] * 20)) == {OK}
    assert instance["length_derived"] == 0
    assert instance.messages == []


@pytest.mark.parametrize("target", ["fmi2", "fmi3"])
@pytest.mark.parametrize("count", [1, 2, 3])
def test_model_exchange_says_what_is_missing(library, target: str, count: int) -> None:
    instance = library(Pendulum, target).running(MODEL_EXCHANGE, theta_0=0.5, **given(count, 0.0))
    statuses = []
    for i in range(1, 20):
        statuses.append(instance.call("SetTime", i * 0.01))
        instance.set(given(count, i * 0.01))
    assert statuses.count(WARNING) == len(instance.messages) == (count < 3)
    assert instance["length_derived"] == 3 - count
    assert used_rates(instance) == pytest.approx([*wavy(0.19)[1:count], *[0.0] * (3 - count)], abs=1e-9)  # roundings
    assert ["model exchange" in message for message in instance.messages] == [True] * (count < 3)


# ---- the account -------------------------------------------------------------------------------------------------

RATES = {"consistent": (1, 1), "half": (0.5, 0), "other sign": (-1, -1), "acceleration's": (1, -1), "missing": (0, 0)}
SOLVERS: dict[str, dict[str, int]] = {
    "explicit": {},
    "symplectic": {"symplectic_steps": 2},
    "stiff": {"stiff_solver": 1},
    "python": {},
}
MOVED_PORTS: dict[str, tuple[type[Component], float]] = {"pivot_x": (Pendulum, 0.0), "length": (CartesianPendulum, 1.0)}
STEPS, SIZE = 40, 0.02


def wave_of(name: str, factors: tuple[float, float]) -> Callable[[float], dict[str, float]]:
    """A wave that begins at rest; its rate and its acceleration have these factors."""
    a, w, (rate, acceleration), begin = 0.03, 3.0, factors, MOVED_PORTS[name][1]
    return lambda t: {
        name: begin + a * (1 - np.cos(w * t)),
        f"{name}_dot": rate * a * w * np.sin(w * t),
        f"{name}_ddot": acceleration * a * w**2 * np.cos(w * t),
    }


@pytest.mark.parametrize("solver", SOLVERS)
@pytest.mark.parametrize("name", MOVED_PORTS)
def test_work_is_done_along_the_motion_that_is_integrated(library, mode: int, name: str, solver: str) -> None:
    """The account closes whatever the rates say; where they are right the work is that of the operator."""
    component, works = MOVED_PORTS[name][0], {}
    fmu = library(component, "python" if solver == "python" else "fmi2")
    for rates, factors in RATES.items():
        inputs, worst = wave_of(name, factors), 0.0
        instance = fmu.start(input_reconstruction=mode, tolerance=1e-10, **SOLVERS[solver], **inputs(0.0))
        for i in range(STEPS):
            instance.set(inputs((i + (mode == INTERPOLATE)) * SIZE))
            instance.step(i * SIZE, SIZE, None)  # with a warning where rates are missing
            worst = max(worst, abs(instance["energy_balance"]))
        # Energies of 10 J, 40 steps with an error of 1e-10 each; equal steps miss more of wrong rates, interpolated.
        assert worst <= (1e-6 if solver == "symplectic" else 1e-8), rates
        works[rates] = instance["work"]
    # What the energy gains along the same motion in small steps; what is held is of first order, 1 % of 0.2 J here.
    inputs, fine = wave_of(name, RATES["consistent"]), 500
    instance = library(component).start(tolerance=1e-12, **inputs(0.0))
    energy = instance["energy"]
    instance.follow(STEPS * SIZE / fine, fine, inputs)
    instance.set(inputs(STEPS * SIZE))
    assert works["consistent"] == pytest.approx(instance["energy"] - energy, abs=0.01 if mode == HOLD else 1e-3)


def test_work_follows_given_polynomials_of_an_input_alone(library) -> None:
    """The length goes by its polynomial, whose rate is not said: the account is that of the way that it goes."""
    instance = library(Pendulum).start(tolerance=1e-11, theta_0=0.5)
    value, orders = instance.refs(["length"] * 2), (ctypes.c_int32 * 2)(1, 2)
    instance.do("SetRealInputDerivatives", value, 2, orders, (ctypes.c_double * 2)(0.5, -0.8))
    instance.step(0.0, 0.2)
    theta, momentum, work = instance.get("theta", "p_theta", "work")
    length = 1 + 0.5 * 0.2 - 0.4 * 0.2**2
    gained = momentum**2 / (2 * length**2) - 9.81 * (length * np.cos(theta) - np.cos(0.5))
    assert instance["length"] == pytest.approx(1.0)  # as it was set
    assert work == pytest.approx(gained, rel=1e-9)  # energies of 10 J, to the tolerance
    assert abs(work) > 0.5


# ---- what no test noticed ----------------------------------------------------------------------------------------


def test_what_begins_at_rest_with_an_acceleration_moves(library, target: str) -> None:
    """Extrapolated from σ̇ = 0 with σ̈ ≠ 0, and interpolated to the end of the same parabola."""
    a, H, found = 1.5, 0.4, []
    ends = {"lean": LEAN + a * H**2 / 2, "lean_dot": a * H, "lean_ddot": a}
    for mode, acceleration in ((EXTRAPOLATE, a), (INTERPOLATE, a), (EXTRAPOLATE, 0.0)):
        start = {"theta_0": 0.4, "lean_ddot": acceleration}
        instance = library(Swing, target).start(input_reconstruction=mode, tolerance=1e-11, **start)
        instance.set(ends if mode == INTERPOLATE else {})
        instance.step(0.0, H)
        found.append(instance.get("theta", "p_theta", "energy", "work", "torso_x"))
    np.testing.assert_allclose(found[0], found[1], rtol=0, atol=1e-7)
    assert abs(found[0][0] - found[2][0]) > 1e-3  # it makes a difference


@pytest.mark.parametrize(
    ("target", "kind", "settings"),
    [
        ("fmi2", CO_SIMULATION, {"input_reconstruction": EXTRAPOLATE}),
        ("fmi2", CO_SIMULATION, {"input_reconstruction": HOLD}),
        ("python", CO_SIMULATION, {"input_reconstruction": EXTRAPOLATE}),
        ("fmi2", MODEL_EXCHANGE, {}),
        ("fmi3", CO_SIMULATION, {"options": WITH_EVENTS}),
    ],
)
def test_impulses_do_the_whole_work(library, target: str, kind: str, settings: dict[str, Any]) -> None:
    """σ̇ jumps from 0: p stays, and the energy gains ½ σ̇ᵀ Θ σ̇ with Θ = g - J Jᵀ/I."""
    rates = {"rope_dot": 0.4, "lean_dot": -0.9}
    inertia, *along = swing_forms(ROPE, LEAN)
    J, rate = np.array(along), np.array(list(rates.values()))
    g = np.array([[40.0, -10.0 * np.sin(LEAN)], [-10.0 * np.sin(LEAN), 20.0 * 0.25]])
    gain = rate @ (g - np.outer(J, J) / inertia) @ rate / 2
    instance = library(Swing, target).start(kind, theta_0=0.4, theta_dot_0=0.7, **settings)
    instance.set(rates)
    if "input_reconstruction" in settings:
        assert instance["work"] == pytest.approx(gain, rel=1e-12)  # before it is booked
        instance.step(0.0, 1e-12)
    else:
        instance.go_on()
    work, balance, p = instance.get("work", "energy_balance", "p_theta")
    assert work == pytest.approx(gain, rel=1e-9)
    assert p == pytest.approx(inertia * 0.7, rel=1e-9)
    assert abs(balance) <= 1e-9


# ---- steps before which nothing is set ---------------------------------------------------------------------------

NOTHING: dict[str, float] = {}
SWUNG = {"rope_dot": 0.3, "lean_dot": -0.2, "lean_ddot": 0.5}
CHANGES: list[dict[str, float]] = [
    *[NOTHING] * 3,
    {"rope": ROPE + 0.1},  # which jumps, and of which the rates say nothing
    *[NOTHING] * 2,
    {"theta_force": 5.0},
    *[NOTHING] * 2,
    {"rope": ROPE + 0.1, **SWUNG},  # moves on by its rates
    NOTHING,
    dict.fromkeys(SWUNG, 0.0),
    *[NOTHING] * 3,
]


@pytest.mark.parametrize("target", ["fmi2", "fmi3"])
def test_what_nobody_sets_again_is_as_it_was(library, mode: int, target: str) -> None:
    """To the last bit, saved states too: whether inputs are set once, or again before each step."""
    fmu = library(Swing, target)
    once, again = (fmu.start(input_reconstruction=mode, theta_0=0.4) for _ in range(2))
    values = dict(zip(INPUTS, once.get(*INPUTS).tolist(), strict=True))
    states, H = [], 0.03

    def step(k: int, changes: dict[str, float]) -> None:
        values.update(changes)
        if changes:
            once.set(changes)
        again.set(values)
        for instance in (once, again):
            instance.step(k * H, H, None)
        states.append(once.serialize())
        assert states[-1] == again.serialize(), k

    for k, changes in enumerate(CHANGES):
        step(k, changes)
        if mode == EXTRAPOLATE and k < CHANGES.index({"theta_force": 5.0}):  # what is set after rest is looked at
            jumped = changes == {"rope": ROPE + 0.1}
            assert once["rope_mismatch"] == pytest.approx(0.1 if jumped else 0.0), k
    assert once["theta"] != pytest.approx(0.4, abs=0.01)
    begun = CHANGES.index(NOTHING, CHANGES.index({"rope": ROPE + 0.1, **SWUNG}))
    for instance in (once, again):  # back into the motion, from where all rests
        instance.deserialize(states[begun])
    values.update({"rope": ROPE + 0.1, **SWUNG})
    for k in range(begun + 1, begun + 4):
        step(k, NOTHING)
    if mode != HOLD:
        assert once["theta"] != fmu.restored(states[begun + 2])["theta"]


INPUTS = (*(f"{name}{end}" for name in ("rope", "lean") for end in ("", "_dot", "_ddot")), "theta_force")


def test_derivatives_of_inputs_and_events_count_after_rest(library) -> None:
    """The length goes by its polynomial after steps of rest, as it does at once; an event begins anew."""
    found = []
    for steps in (1, 4):
        instance = library(Pendulum).start(theta_0=0.0)  # at rest, where the length changes nothing but the work
        for k in range(steps):
            instance.step(k * 0.1, 0.1)
        references, orders = instance.refs(["length"]), (ctypes.c_int32 * 1)(1)
        instance.do("SetRealInputDerivatives", references, 1, orders, (ctypes.c_double * 1)(0.5))
        instance.step(steps * 0.1, 0.2)
        found.append(instance["work"])
    assert found[0] == pytest.approx(-9.81 * 0.5 * 0.2, rel=1e-9)  # the bob sinks by 0.1 m
    assert found[1] == pytest.approx(found[0], rel=1e-12)
    rows = []
    for touched in (False, True):
        instance = library(Swing, "fmi3").start(options=WITH_EVENTS, theta_0=0.4)
        instance.go_on()
        for k in range(6):
            if k == 3:
                instance.do("EnterEventMode")
                instance.go_on()
            if touched:
                instance.set(rope=ROPE)
            instance.step(k * 0.1, 0.1)
        rows.append(instance.serialize())
    assert rows[0] == rows[1]
