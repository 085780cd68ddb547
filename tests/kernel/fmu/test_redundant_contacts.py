"""FMUs with more than eight contacts, and with redundant ones, which share their force by least norm."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest
from bodies import FEET, Nine, Plank, Plate, Skid, SquareTable, Table, Twelve, TwoFloors, on_feet
from driver import Instance
from numpy.typing import NDArray
from scipy.integrate import solve_ivp
from scipy.interpolate import PPoly
from scipy.optimize import nnls

from liaisons import assemble, simulate
from liaisons.errors import ComponentError

GRAVITY, MASS, INERTIA = 9.81, 2.0, 0.5
WEIGHT = MASS * GRAVITY
LEGS = {
    Table: np.array([(1, -1.0, -0.8), (1, 1.0, -0.8), (1, 1.2, 0.9), (1, -0.9, 0.7)]),
    SquareTable: np.array([(1, -1.0, -1.0), (1, 1.0, -1.0), (1, 1.0, 1.0), (1, -1.0, 1.0)]),
}


def forces(instance: Instance, count: int, what: str = "force") -> NDArray[np.float64]:
    return np.array(instance.get(*(f"leg_{i}_{what}" for i in range(count))))


def least_norm(legs: NDArray[np.float64], pitch: float, roll: float) -> NDArray[np.float64]:
    """Forces of legs under the weight and two loads, by the pseudoinverse of what they have to balance."""
    return np.linalg.pinv(legs.T) @ [WEIGHT, pitch, roll]


def run(instance: Instance, end: float, steps: int, inputs: Callable[[float], dict[str, float]] | None = None) -> None:
    """Steps from 0 on, with inputs by time."""
    for k in range(steps):
        instance.set(inputs(k * end / steps) if inputs else {})
        instance.step(k * end / steps, end / steps)


@pytest.mark.parametrize("moments", [(0.0, 0.0), (3.0, -2.0), (-4.0, 1.0)])
def test_legs_of_a_table_share_its_weight(library, moments: tuple[float, float]) -> None:
    """Where the least norm pushes on all of them."""
    instance = library(Table).start(pitch_load=moments[0], roll_load=moments[1])
    expected = least_norm(LEGS[Table], *moments)
    assert expected.min() > 0
    np.testing.assert_allclose(forces(instance, len(expected)), expected, rtol=1e-12)
    run(instance, 1.0, 5)
    np.testing.assert_allclose(forces(instance, len(expected)), expected, rtol=1e-12)
    assert np.abs(instance.get("z", "pitch", "roll")).max() < 1e-15


def test_a_leg_that_would_have_to_pull_has_no_force(library) -> None:
    """The least norm pulls at the first leg: what is left of three legs is unique."""
    moments = (14.0, 13.0)
    assert least_norm(LEGS[Table], *moments)[0] < -1
    instance = library(Table).start(pitch_load=moments[0], roll_load=moments[1])
    run(instance, 1.0, 5)
    expected = [0.0, *np.linalg.solve(LEGS[Table][1:].T, [WEIGHT, *moments])]
    np.testing.assert_allclose(forces(instance, 4), expected, rtol=1e-12, atol=1e-12)
    assert np.abs(instance.get("z", "pitch", "roll")).max() < 1e-15


def test_an_impact_on_four_legs(library) -> None:
    """Flat, it is that of a ball; on the ground the legs share the impulse as they share a force."""
    instance = library(Table).start(z_0=0.2, bounce=0.5)
    fall = math.sqrt(2 * 0.2 / GRAVITY)
    instance.step(0.0, 1.5 * fall)
    speed = GRAVITY * fall
    assert instance.get("z", "z_dot") == pytest.approx(
        [0.5 * speed * 0.5 * fall - GRAVITY / 8 * fall**2, 0.5 * speed - GRAVITY * 0.5 * fall], rel=1e-12
    )
    impulses = np.linalg.pinv(LEGS[Table].T) @ [1.5 * MASS * speed, 0, 0]
    np.testing.assert_allclose(forces(instance, 4, "impulse"), impulses, rtol=1e-12)
    assert instance["energy_balance"] == pytest.approx(0, abs=1e-12)


def test_a_table_tilts_off_two_of_its_legs(library) -> None:
    """Under a moment that grows by 8 N m/s, at m g a/8; then it turns about the other two, against SciPy."""
    rate, lifts = 8.0, WEIGHT / 8.0
    instance = library(SquareTable).start()
    size = lifts / 16
    for k in range(20):
        time = k * size
        instance.set(pitch_load=-rate * (time + size / 2))  # that of the middle of a step
        expected = least_norm(LEGS[SquareTable], -rate * (time + size / 2), 0) if k < 16 else None
        instance.step(time, size)
        if expected is not None:
            np.testing.assert_allclose(forces(instance, 4), expected, rtol=0, atol=1e-12)
            assert instance.get("z", "pitch", "roll") == pytest.approx([0, 0, 0], abs=1e-14)
    heights = np.array(instance.get(*(f"leg_{i}" for i in range(4))))
    assert (np.abs(heights) < 1e-12).tolist() == [True, False, False, True]

    def turning(moment: float, y: NDArray[np.float64]) -> list[float]:
        sine, cosine = math.sin(y[0]), math.cos(y[0])
        return [y[1], (moment - WEIGHT * cosine + MASS * sine * cosine * y[1] ** 2) / (INERTIA + MASS * cosine**2)]

    y = np.zeros(2)
    for k in range(16, 20):
        moment = rate * (k + 0.5) * size
        y = solve_ivp(lambda _, y, m=moment: turning(m, y), (0, size), y, rtol=1e-12, atol=1e-14).y[:, -1]
    assert abs(instance["pitch"]) == pytest.approx(y[0], rel=1e-10)
    assert instance["z"] == pytest.approx(math.sin(y[0]), rel=1e-10)
    assert abs(instance["roll"]) < 1e-14


@pytest.mark.parametrize("sign", [1, -1])
def test_a_table_in_a_table_lifts_the_ball_or_goes_away(sign: int) -> None:
    """Both bear half of the weight until the second one moves, with an acceleration that grows from 0."""
    place = PPoly(np.array([[0.0, sign], [0, 0], [0, 0], [0, 0]]), [0, 0.1, 0.6])
    inputs = {f"second{end}": place.derivative(k) for k, end in enumerate(("", "_dot", "_ddot"))}
    result = simulate(TwoFloors, times=np.linspace(0, 0.5, 51), inputs=inputs, height_0=0.0, mass=MASS)
    first, second, gap = (result[name] for name in ("first_gap_force", "second_gap_force", "second_gap"))
    np.testing.assert_allclose([first[:11], second[:11]], WEIGHT / 2, rtol=1e-14)
    lifts = sign > 0
    pressing = MASS * (GRAVITY + result["second_ddot"][11:])
    np.testing.assert_allclose(first[11:], 0 if lifts else WEIGHT, rtol=1e-12)
    np.testing.assert_allclose(second[11:], pressing if lifts else 0, rtol=1e-12)
    np.testing.assert_allclose(gap, 0 if lifts else -result["second"], rtol=0, atol=1e-15)


def test_two_rough_feet_stick_and_slide_together(library) -> None:
    """The load is shared by both while they stick; they slide at μ m g, each with μ times its normal force."""
    instance = library(Skid).start(x_load=-6.0)
    assert instance.get("front_slip_force", "rear_slip_force") == pytest.approx([-3.0, -3.0], rel=1e-13)
    balance, arm = np.array([[1, 1], [1, -0.6]]), 0.5  # of friction, below the centre
    np.testing.assert_allclose(balance @ instance.get("front_force", "rear_force"), [WEIGHT, arm * 6.0], rtol=1e-12)
    instance.step(0.0, 1.0)
    assert instance["x"] == pytest.approx(0, abs=1e-13)
    instance.set(x_load=-0.4 * WEIGHT - 1.0)
    instance.step(1.0, 1.0)
    assert instance.get("x_dot", "x") == pytest.approx([1 / MASS, 1 / MASS / 2], rel=1e-11)
    normal = np.array(instance.get("front_force", "rear_force"))
    np.testing.assert_allclose(instance.get("front_slip_force", "rear_slip_force"), -0.4 * normal, rtol=1e-12)
    np.testing.assert_allclose(balance @ normal, [WEIGHT, arm * 0.4 * WEIGHT], rtol=1e-11)
    instance.set(x_load=0.0)
    instance.step(2.0, 1.0)  # it is braked by 0.4 g, and sticks
    assert instance.get("x_dot", "x") == pytest.approx([0, 0.25 + 0.125 / (0.4 * GRAVITY)], rel=1e-10, abs=1e-13)
    assert instance["energy_balance"] == pytest.approx(0, abs=1e-11)


@pytest.mark.variants(core=0)
def test_more_than_eight_contacts_at_once(library) -> None:
    """Nine balls land on a table; the first of twelve strikes eleven that touch: they go on as one."""
    instance = library(Nine, "fmi2").start(mass=MASS)
    instance.step(0.0, 3.0)
    assert [instance.get_integer(f"gap_{i}_impacts") for i in range(9)] == [1] * 9
    assert instance.get(*(f"gap_{i}_force" for i in range(9))) == pytest.approx([WEIGHT] * 9, rel=1e-12)
    row = library(Twelve).start(bounce=0.6)
    row.step(0.0, 2.0)
    together = 1.6 / 12
    expected = [together - 0.6, *[together] * 11]
    assert row.get(*(f"x_dot[{i}]" for i in range(1, 13))) == pytest.approx(expected, rel=1e-12)
    assert row["energy_balance"] == pytest.approx(0, abs=1e-13)


# ---- many feet -------------------------------------------------------------------------------------------------------

_slow = pytest.mark.slow
BODIES = [
    pytest.param(Plank, 4, marks=_slow),
    (Plank, 16),
    pytest.param(Plank, 64, marks=_slow),
    (Plate, 8),
    pytest.param(Plate, 16, marks=_slow),
    pytest.param(Plate, 64, marks=_slow),
]
bodies = pytest.mark.parametrize(("kind", "feet"), BODIES)


def levers(kind: type[Plank], feet: int) -> NDArray[np.float64]:
    """Change of heights of the feet by z, pitch and, of a plate, roll."""
    return np.column_stack([np.ones(feet), np.array(FEET[:feet])])[:, : 3 if kind is Plate else 2]


def feet_of(instance: Instance, feet: int, ending: str = "") -> NDArray[np.float64]:
    return np.array(instance.get(*(f"gap{ending}[{i}]" for i in range(1, feet + 1))))


def least_pushing_norm(legs: NDArray[np.float64], loads: NDArray[np.float64]) -> NDArray[np.float64]:
    """Shortest forces λ >= 0 with legsᵀ λ = loads: SciPy finds which of them push, NumPy how much."""
    penalty = 1e5
    stacked = np.vstack([penalty * legs.T, np.eye(len(legs))])
    pushing = nnls(stacked, np.concatenate([penalty * loads, np.zeros(len(legs))]))[0] > 1e-6
    result = np.zeros(len(legs))
    result[pushing] = np.linalg.pinv(legs[pushing].T) @ loads
    return result


@bodies
def test_feet_share_a_load(library, kind: type[Plank], feet: int) -> None:
    """By least norm, where all push, and where some would have to pull."""
    legs = levers(kind, feet)
    pulled = compared = 0
    for part in (0.0, 0.1, 0.85):
        moments = part * WEIGHT * np.array([1.0, -0.1])[: legs.shape[1] - 1]
        expected = least_pushing_norm(legs, np.array([WEIGHT, *moments]))
        pulled += (expected == 0).any()
        names = ("pitch_load", "roll_load")[: len(moments)]
        instance = library(on_feet(kind, feet)).start(**dict(zip(names, moments, strict=True)))
        for time in (0.0, 0.5):
            np.testing.assert_allclose(feet_of(instance, feet, "_force"), expected, rtol=1e-9, atol=1e-12)
            instance.step(time, 0.5)
        assert np.abs(feet_of(instance, feet)).max() < 1e-14
        indicators = feet_of(instance, feet, "_indicator")
        assert (indicators[expected == 0] < 1e-12).all()
        pushing = expected > 0
        compliances = legs**2 @ [1 / MASS, *[1 / INERTIA] * len(moments)]
        scales = np.abs(legs) @ [GRAVITY + 1e-3, *(np.abs(moments) / INERTIA + 1e-3)]  # of free accelerations
        margins = expected * compliances / scales
        watched = pushing & (margins < 0.9)
        np.testing.assert_allclose(indicators[watched], margins[watched], rtol=1e-9)
        # It is 1 at most, as that of no contradiction: but for rounding, in parts of 1e-10 of accelerations.
        np.testing.assert_allclose(indicators[pushing & (margins > 1.1)], 1, rtol=1e-5)
        compared += watched.sum()
        assert instance["energy_balance"] == pytest.approx(0, abs=1e-12)
    assert compared
    assert pulled or feet == 4


@bodies
def test_feet_share_an_impulse(library, kind: type[Plank], feet: int) -> None:
    """Flat, it falls and bounces as a ball; tilted, it comes to rest on all of them."""
    instance = library(on_feet(kind, feet)).start(z_0=0.2)
    fall = math.sqrt(2 * 0.2 / GRAVITY)
    instance.step(0.0, 1.5 * fall)
    impulse = np.array([1.5 * MASS * GRAVITY * fall, 0, 0])
    legs = levers(kind, feet)
    expected = np.linalg.pinv(legs.T) @ impulse[: legs.shape[1]]
    np.testing.assert_allclose(feet_of(instance, feet, "_impulse"), expected, rtol=1e-10, atol=1e-12)
    assert instance["z_dot"] == pytest.approx(0.0, abs=1e-12)
    assert instance["energy_balance"] == pytest.approx(0, abs=1e-11)
    tilted = library(on_feet(kind, feet)).start(z_0=1.2, pitch_0=0.3)
    tilted.step(0.0, 8.0)
    assert np.abs(feet_of(tilted, feet)).max() < 1e-12
    assert tilted["impact_loss"] == pytest.approx(1.2 * WEIGHT, rel=1e-9)
    assert tilted["energy_balance"] == pytest.approx(0, abs=1e-8)


@bodies
def test_all_feet_but_those_of_one_edge_lift_off(library, kind: type[Plank], feet: int) -> None:
    """Under more than m g a it turns about the edge at a = 1 m, against SciPy."""
    moment = 1.3 * WEIGHT
    instance = library(on_feet(kind, feet)).start(pitch_load=moment)
    edge = np.array(FEET[:feet])[:, 0] == 1.0
    instance.step(0.0, 0.4)

    def turning(_: float, y: NDArray[np.float64]) -> list[float]:
        sine, cosine = math.sin(y[0]), math.cos(y[0])
        return [y[1], (moment - WEIGHT * cosine + MASS * sine * cosine * y[1] ** 2) / (INERTIA + MASS * cosine**2)]

    y = solve_ivp(turning, (0, 0.4), np.zeros(2), rtol=1e-12, atol=1e-14).y[:, -1]
    assert -instance["pitch"] == pytest.approx(y[0], rel=1e-10)
    assert ((np.abs(feet_of(instance, feet)) < 1e-12) == edge).all()
    assert instance["energy_balance"] == pytest.approx(0, abs=1e-10)


@pytest.mark.parametrize("kind", [Plank, Plate])
def test_code_grows_with_the_number_of_feet(kind: type[Plank]) -> None:
    """In proportion: the exponent of its operations, by regression, is 1."""
    counts = [8, 16, 32, 64]
    models = [assemble(kind, feet) for feet in counts]
    for name in ("derivatives", "outputs_function", "contact", "push", "indicate"):
        operations = [getattr(model, name).n_instructions() for model in models]
        assert np.polyfit(np.log(counts), np.log(operations), 1)[0] < 1.02, name


@pytest.mark.parametrize("kind", [Plank, Plate])
def test_more_feet_than_an_fmu_takes_are_refused(kind: type[Plank]) -> None:
    with pytest.raises(ComponentError, match=r"gap are 65 contacts; an FMU takes 64 at most: take a smaller size$"):
        assemble(on_feet(kind, 65))
