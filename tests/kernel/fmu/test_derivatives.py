"""Directional and adjoint derivatives: analytic, in every mode, of arrays too; against differences and each other."""

from __future__ import annotations

import numpy as np
import pytest
from driver import CO_SIMULATION, DISCARD, ERROR, MODEL_EXCHANGE, SIGNATURES, Instance, reals
from numpy.typing import NDArray

from liaisons.models import Sinusoid

UNKNOWNS = ("x", "x_dot", "p", "p_dot", "anchor_force", "kinetic_energy", "work", "power")
INPUTS = ("anchor", "anchor_dot", "anchor_ddot", "force")
PARAMETERS = ("mass", "stiffness", "x_0", "bond")
STATES = ("x", "p", "work")
START = {"anchor_dot": [0.3, -0.2, 0.1], "anchor_ddot": [0.5, 0.4, -0.3], "force": [0.1, 0.2, 0.3], "bond": [1, 0.5, 2]}
Situation = tuple[Instance, tuple[str, ...], tuple[str, ...]]


@pytest.fixture(
    params=[
        ("initialization", CO_SIMULATION, PARAMETERS, PARAMETERS),
        ("initialization", MODEL_EXCHANGE, PARAMETERS, PARAMETERS),
        ("step", CO_SIMULATION, (*PARAMETERS, *STATES), ("stiffness",)),
        ("event", MODEL_EXCHANGE, (*PARAMETERS, *STATES), ("stiffness", *STATES)),
        ("continuous", MODEL_EXCHANGE, (*PARAMETERS, *STATES), STATES),
    ],
    ids=lambda p: f"{p[0]}-{p[1]}",
)
def situation(request, ring_library) -> Situation:
    """An instance in some mode, away from its start; what is known there, and of that what can be set."""
    mode, kind, knowns, settable = request.param
    instance = ring_library.initializing(kind)
    instance.set(START)
    if mode != "initialization":
        instance.exit_initialization()
    if mode == "step":
        instance.step(0.0, 0.7)
        instance.set(anchor_dot=[-0.4, 0.5, 0.2])  # an impulse that is still to be booked as work
    if mode == "continuous":
        instance.go_on()
        instance.do("SetContinuousStates", reals([0.3, -0.5, 0.2, 0.7, 0.1, -0.4, 0.2]), 7)
    return instance, (*INPUTS, *knowns), (*INPUTS, *settable)


def columns(instance: Instance, names: tuple[str, ...], seed: int) -> dict[str, NDArray]:
    random = np.random.default_rng(seed)
    return {name: random.normal(size=instance.library.count(name)) for name in names}


def test_differences_converge_with_the_square_of_their_step(situation) -> None:
    """(f(+h) - f(-h))/2h; third derivatives are of order 10."""
    instance, _, knowns = situation
    direction = columns(instance, knowns, 7)
    base = {name: instance.get(name) for name in knowns}
    derivative = instance.directional(UNKNOWNS, direction)

    def moved(h: float) -> NDArray:
        instance.set({name: base[name] + h * direction[name] for name in knowns})
        return instance.get(*UNKNOWNS)

    errors = [np.abs((moved(h) - moved(-h)) / (2 * h) - derivative) for h in (0.02, 0.01)]
    seen = errors[0] > 1e-8
    assert seen.any()
    np.testing.assert_allclose(errors[0][seen] / errors[1][seen], 4.0, rtol=0.02)  # the next order is h² = 4e-4
    np.testing.assert_allclose(errors[1][~seen], 0, rtol=0, atol=1e-8)


def test_work_of_a_jump_is_differentiated_where_it_is_booked(pendulum_library) -> None:
    """Of v²/2 by v at a communication point; in continuous time work follows the motion, whatever the inputs do."""
    start = {"theta_0": 0.9, "theta_dot_0": 0.4, "length_dot": 0.3}
    instance = pendulum_library.start(**start)
    instance.step(0.0, 0.5)
    instance.set(length=1.1)
    assert instance.directional(["work"], {"length_dot": 1.0})[0] == pytest.approx(0.3, rel=1e-14)
    instance = pendulum_library.running(MODEL_EXCHANGE, **start)
    assert instance.directional(["work"], {"length_dot": 1.0})[0] == pytest.approx(0.0, abs=1e-15)


@pytest.mark.parametrize("ring_library", ["fmi3"], indirect=True)
def test_adjoint_is_the_transpose(situation) -> None:
    """<w, J v> = <Jᵀ w, v> up to rounding of sums of some 100 products of order 10; and element by element."""
    instance, knowns, _ = situation
    for seed in range(5):
        v, w = columns(instance, knowns, seed), columns(instance, UNKNOWNS, 100 + seed)
        left = np.concatenate(list(w.values())) @ instance.directional(UNKNOWNS, v)
        right = instance.adjoint(w, knowns) @ np.concatenate(list(v.values()))
        assert abs(left) > 1e-3
        assert left == pytest.approx(right, rel=1e-12, abs=1e-12)

    def units(names: tuple[str, ...]) -> list[dict[str, NDArray]]:
        return [{name: unit} for name in names for unit in np.eye(instance.library.count(name))]

    rows = [instance.adjoint(unit, knowns) for unit in units(UNKNOWNS)]
    matrix = np.column_stack([instance.directional(UNKNOWNS, unit) for unit in units(knowns)])
    np.testing.assert_allclose(np.array(rows), matrix, rtol=1e-13, atol=1e-13)  # the same products, added otherwise
    assert np.count_nonzero(matrix) > 20


def test_time_is_a_known_variable(library) -> None:
    """y' of a sinusoid at a communication point; forward and back."""
    instance = library(Sinusoid, "fmi3").start(angular_frequency=2.0)
    instance.step(0.0, 0.4)
    expected = [2 * np.cos(0.8), -4 * np.sin(0.8), -8 * np.cos(0.8)]
    np.testing.assert_allclose(instance.directional(["y", "y_dot", "y_ddot"], {"time": 1.0}), expected, rtol=1e-13)
    found = instance.adjoint({"y": 1.0, "y_dot": 10.0, "y_ddot": 100.0}, ["time"])
    np.testing.assert_allclose(found, np.dot(expected, [1, 10, 100]), rtol=1e-13)


def test_output_derivatives(ring_library) -> None:
    """Rates of the outputs while the anchors move: chain rule along the motion."""
    instance = ring_library.start(**START)
    instance.step(0.0, 0.3)
    found = instance.output_derivatives("x", "anchor_force")
    x_dot, acceleration = instance.get("x_dot"), np.array(START["anchor_ddot"])
    np.testing.assert_allclose(found[:3], x_dot, rtol=1e-14)
    rate = np.array(START["anchor_dot"]) + 0.3 * acceleration  # extrapolated to the end of the step
    moved = 0.125 + 0.3 * np.array(START["anchor_dot"]) + 0.3**2 / 2 * acceleration
    expected = 2 * np.cos(moved - instance.get("x")) * (rate - x_dot)
    np.testing.assert_allclose(found[3:], expected, rtol=1e-12)


@pytest.mark.parametrize(
    ("function", "said"),
    [("GetDirectionalDerivative", "the direction has"), ("GetAdjointDerivative", "the weights have")],
)
def test_what_cannot_be_differentiated_is_named(ring_library, function, said) -> None:
    if function not in SIGNATURES[ring_library.fmi]:
        return
    instance = ring_library.start()
    unknowns, knowns = instance.refs(["x_dot"]), instance.refs(["force"])
    n, good, wrong, result = len(unknowns), *(reals([0.0, number, 0.0]) for number in (0.0, np.nan, 0.0))
    for sought, given, seed, status, message in (
        (unknowns, knowns, wrong, DISCARD, f"{said} numbers that are not finite"),
        (knowns, knowns, good, ERROR, "force[1] is not an unknown variable: it is set, not calculated"),
        (
            unknowns,
            unknowns,
            good,
            ERROR,
            "x_dot[1] is not among the known variables now; they are parameters, inputs, states",
        ),
    ):
        instance.refuse(message, function, sought, n, given, n, seed, 3, result, 3, status=status)
    if ring_library.fmi == "3":  # which says how many numbers there are
        for sizes in ((2, 3), (3, 2)):
            seed, found = (reals([0.0] * size) for size in sizes)
            message = "2 values for variables that hold 3"
            instance.refuse(message, function, unknowns, 1, knowns, 1, seed, sizes[0], found, sizes[1])
