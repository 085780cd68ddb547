"""Directional and adjoint derivatives of FMI 3.0, of arrays too: against each other, and against differences."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from ctypes import c_int32

import numpy as np
import pytest
from driver import DISCARD, ERROR, OK, reals
from driver3 import CO_SIMULATION, MODEL_EXCHANGE, Instance3, Library3
from numpy.typing import NDArray

from liaisons.fmu import build
from liaisons.mechanics import assemble
from liaisons.models import Sinusoid

UNKNOWNS = ("x", "x_dot", "p", "p_dot", "anchor_force", "kinetic_energy", "work", "power")
INPUTS = ("anchor", "anchor_dot", "anchor_ddot", "force")
PARAMETERS = ("mass", "stiffness", "x_0", "bond")
STATES = ("x", "p", "work")
START = {"anchor_dot": [0.3, -0.2, 0.1], "anchor_ddot": [0.5, 0.4, -0.3], "force": [0.1, 0.2, 0.3], "bond": [1, 0.5, 2]}


@pytest.fixture(
    params=[
        ("initialization", CO_SIMULATION, (*INPUTS, *PARAMETERS)),
        ("step", CO_SIMULATION, (*INPUTS, *PARAMETERS, *STATES)),
        ("event", MODEL_EXCHANGE, (*INPUTS, *PARAMETERS, *STATES)),
        ("continuous", MODEL_EXCHANGE, (*INPUTS, *PARAMETERS, *STATES)),
    ],
    ids=lambda p: p[0],
)
def situation(request, ring3) -> tuple[Instance3, tuple[str, ...]]:
    """An instance in some mode, away from its start, and what is known there."""
    mode, kind, knowns = request.param
    instance = ring3.instantiate(kind)
    assert instance.initialize() == OK
    assert instance.set(START) == OK
    if mode != "initialization":
        assert instance.call("ExitInitializationMode") == OK
    if mode == "step":
        assert instance.step(0.0, 0.7).status == OK
    if mode == "continuous":
        instance.update()
        assert instance.call("EnterContinuousTimeMode") == OK
        assert instance.call("SetContinuousStates", reals([0.3, -0.5, 0.2, 0.7, 0.1, -0.4, 0.2]), 7) == OK
    return instance, knowns


def columns(instance: Instance3, names: tuple[str, ...], seed: int) -> dict[str, NDArray]:
    random = np.random.default_rng(seed)
    return {name: random.normal(size=instance.library.counts[name]) for name in names}


def test_adjoint_is_the_transpose(situation) -> None:
    """<w, J v> = <Jᵀ w, v> up to rounding of sums of some 100 products of order 10."""
    instance, knowns = situation
    for seed in range(5):
        v, w = columns(instance, knowns, seed), columns(instance, UNKNOWNS, 100 + seed)
        forward = instance.directional(UNKNOWNS, v)
        reverse = instance.adjoint(w, knowns)
        left = np.concatenate(list(w.values())) @ forward
        right = reverse @ np.concatenate(list(v.values()))
        assert abs(left) > 1e-3
        assert left == pytest.approx(right, rel=1e-12, abs=1e-12)


def test_rows_and_columns_are_the_same_matrix(situation) -> None:
    """Element by element, from unit vectors."""
    instance, knowns = situation
    units = [(name, unit) for name in UNKNOWNS for unit in np.eye(instance.library.counts[name])]
    rows = [instance.adjoint({name: unit}, knowns) for name, unit in units]
    units = [(name, unit) for name in knowns for unit in np.eye(instance.library.counts[name])]
    matrix = np.column_stack([instance.directional(UNKNOWNS, {name: unit}) for name, unit in units])
    np.testing.assert_allclose(np.array(rows), matrix, rtol=1e-13, atol=1e-13)  # the same products, added otherwise
    assert np.count_nonzero(matrix) > 20


def test_differences_converge_with_the_square_of_their_step(ring3) -> None:
    """At initialization, where everything can be moved; third derivatives are of order 10."""
    instance = ring3.instantiate()
    assert instance.initialize() == OK
    assert instance.set(START) == OK
    knowns = (*INPUTS, *PARAMETERS)
    check(instance, columns(instance, knowns, 7), mover(instance, knowns))


def test_differences_in_continuous_time_mode(ring3) -> None:
    instance = ring3.start(MODEL_EXCHANGE, **START)
    instance.update()
    assert instance.call("EnterContinuousTimeMode") == OK
    knowns = (*INPUTS, *STATES)  # fmi3SetFloat64 takes states there
    assert instance.set(x=[0.3, -0.5, 0.2], p=[0.7, 0.1, -0.4], work=0.2) == OK
    check(instance, columns(instance, knowns, 8), mover(instance, knowns))


def mover(instance: Instance3, knowns: tuple[str, ...]) -> Callable[[float, Mapping[str, NDArray]], None]:
    base = {name: instance.get(name) for name in knowns}

    def move(h: float, direction: Mapping[str, NDArray]) -> None:
        assert instance.set({name: base[name] + h * direction[name] for name in knowns}) == OK

    return move


def check(instance: Instance3, direction: Mapping[str, NDArray], move: Callable) -> None:
    derivative = instance.directional(UNKNOWNS, direction)
    errors = []
    for h in (0.02, 0.01):
        move(h, direction)
        above = instance.get(*UNKNOWNS)
        move(-h, direction)
        below = instance.get(*UNKNOWNS)
        move(0.0, direction)
        errors.append(np.abs((above - below) / (2 * h) - derivative))
    seen = errors[0] > 1e-8
    assert seen.any()
    np.testing.assert_allclose(errors[0][seen] / errors[1][seen], 4.0, rtol=0.02)  # the next order is h² = 4e-4
    np.testing.assert_allclose(errors[1][~seen], 0, atol=1e-8)


def test_time_is_a_known_variable(folder) -> None:
    """y' of a sinusoid at a communication point; forward and back."""
    instance = Library3(build(assemble(Sinusoid), folder, backend="native", fmi="3")).start(angular_frequency=2.0)
    assert instance.step(0.0, 0.4).status == OK
    expected = [2 * np.cos(0.8), -4 * np.sin(0.8), -8 * np.cos(0.8)]
    np.testing.assert_allclose(instance.directional(["y", "y_dot", "y_ddot"], {"time": 1.0}), expected, rtol=1e-13)
    found = instance.adjoint({"y": 1.0, "y_dot": 10.0, "y_ddot": 100.0}, ["time"])
    np.testing.assert_allclose(found, np.dot(expected, [1, 10, 100]), rtol=1e-13)


def test_output_derivatives(ring3) -> None:
    """Rates of the outputs while the anchors move: chain rule along the motion."""
    instance = ring3.start(**START)
    assert instance.step(0.0, 0.3).status == OK
    names = ("x", "anchor_force")
    values = reals([0.0] * 6)
    assert instance.call("GetOutputDerivatives", instance.refs(names), 2, (c_int32 * 2)(1, 1), values, 6) == OK
    x_dot, acceleration = instance.get("x_dot"), np.array(START["anchor_ddot"])
    np.testing.assert_allclose(values[:3], x_dot, rtol=1e-14)
    rate = np.array(START["anchor_dot"]) + 0.3 * acceleration  # extrapolated to the end of the step
    moved = 0.125 + 0.3 * np.array(START["anchor_dot"]) + 0.3**2 / 2 * acceleration
    expected = 2 * np.cos(moved - instance.get("x")) * (rate - x_dot)
    np.testing.assert_allclose(values[3:], expected, rtol=1e-12)


def test_seeds_of_the_wrong_size_or_not_finite(ring3) -> None:
    instance = ring3.start()
    unknowns, knowns = instance.refs(["x_dot"]), instance.refs(["force"])
    for function in ("GetDirectionalDerivative", "GetAdjointDerivative"):
        three, two, wrong = reals([0.0] * 3), reals([0.0] * 2), reals([0.0, np.nan, 0.0])
        assert instance.call(function, unknowns, 1, knowns, 1, two, 2, three, 3) == ERROR
        assert instance.call(function, unknowns, 1, knowns, 1, three, 3, two, 2) == ERROR
        assert instance.call(function, unknowns, 1, knowns, 1, wrong, 3, three, 3) == DISCARD
        assert instance.call(function, knowns, 1, knowns, 1, three, 3, three, 3) == ERROR
        assert instance.call(function, unknowns, 1, unknowns, 1, three, 3, three, 3) == ERROR
    assert instance.messages[:2] == ["2 values for variables that hold 3"] * 2
    assert instance.messages[2] == "the direction has numbers that are not finite"
    assert instance.messages[3] == "force[1] is not an unknown variable: it is set, not calculated"
    assert instance.messages[4] == "x_dot[1] is not among the known variables now; they are parameters, inputs, states"
    assert instance.messages[7] == "the weights have numbers that are not finite"
