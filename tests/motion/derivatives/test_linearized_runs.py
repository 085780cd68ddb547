"""The linear system about the present point of a run: against that of the equations, of flattened systems, and runs."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.linalg import expm

from liaisons import System, linearize, start
from liaisons.errors import LiaisonsError

BOOKED = ("energy_balance", "work")
"""Outputs that a run has booked until its last point; equations at a point have booked nothing."""


def assert_same(found: Any, expected: Any, *, atol: float = 1e-12) -> None:
    """All entries, by the names of rows and columns."""
    assert {*found.states} == {*expected.states}
    assert {*found.inputs} == {*expected.inputs}
    rows = [name for name in found.outputs if not name.endswith(BOOKED)]
    for name, of_row, of_column in (
        ("A", "states", "states"),
        ("B", "states", "inputs"),
        ("C", "outputs", "states"),
        ("D", "outputs", "inputs"),
    ):
        matrices = []
        for one in (found, expected):
            rows_of, columns_of = getattr(one, of_row), getattr(one, of_column)
            lines = [rows_of.index(n) for n in (rows if of_row == "outputs" else found.states)]
            matrices.append(getattr(one, name)[np.ix_(lines, [columns_of.index(n) for n in getattr(found, of_column)])])
        np.testing.assert_allclose(*matrices, rtol=0, atol=atol)


@pytest.mark.parametrize("name", ["Pendulum", "CartesianPendulum"])
def test_the_present_point_of_one_fmu(name: str) -> None:
    force = {"Pendulum": "theta_force", "CartesianPendulum": "x_force"}[name]
    with start(name, step_size=0.05, tolerance=1e-11) as run:
        for _ in range(7):
            run.step({force: 0.2})
        found = run.linearize()
        states = {n: run[n] for n in found.states if not n.endswith(("work", "dissipated"))}
        inputs = {n: run[n] for n in found.inputs}
    np.testing.assert_allclose([found.values[n] for n in states], [*states.values()], rtol=0, atol=0)
    if name == "Pendulum":  # momenta are set through rates
        states = {"theta": states["theta"], "theta_dot": found.values["theta_dot"]}
        assert_same(found, linearize(name, {**states, **inputs}))
    assert found.inputs == tuple(inputs)


def two_pendulums() -> System:
    system = System("two pendulums")
    upper, lower = system.add("upper", "Pendulum", theta_0=0.4), system.add("lower", "Pendulum", theta_0=-0.2)
    system.connect(upper["bob"], lower["pivot"])
    return system


def test_a_system_with_loops_is_its_flattened_one(tmp_path: Path) -> None:
    system = two_pendulums()
    with system.start(step_size=0.01, tolerance=1e-11) as run:
        found = run.linearize()
    expected = linearize(system.flatten(tmp_path / "Both.fmu"))
    assert_same(found, expected, atol=1e-11)
    np.testing.assert_allclose(
        found.rates, [expected.rates[expected.states.index(n)] for n in found.states], rtol=0, atol=1e-12
    )


def test_it_predicts_the_step_of_a_sampled_loop() -> None:
    """Outputs of the controller are inputs, which hold: the next sample from this one by a matrix exponential."""
    system = System("sampled loop")
    plant = system.add("plant", "Oscillator", mass=2.0, stiffness=9.0, damping=0.4, x_0=0.5)
    controller = system.add("controller", "Pid", period=0.1, gain=3.0)
    system.connect(plant["x"], controller["reading"])
    system.connect(controller["output"], plant["x_force"])
    with system.start(step_size=0.1, tolerance=1e-12) as run:
        run.step()
        linear = run.linearize()
        assert "controller.output" in linear.inputs
        n, m = len(linear.states), len(linear.inputs)
        before = np.array([run[name] for name in (*linear.states, *linear.inputs)])
        point = np.array([linear.values[name] for name in (*linear.states, *linear.inputs)])
        np.testing.assert_array_equal(before, point)
        run.step()
        after = np.array([run[name] for name in linear.states])
    whole = np.zeros((n + m + 1, n + m + 1))
    whole[:n] = np.column_stack([linear.A, linear.B, linear.rates])
    moved = expm(0.1 * whole) @ np.r_[np.zeros(n + m), 1.0]
    rows = [linear.states.index(f"plant.{name}") for name in ("x", "p_x")]
    np.testing.assert_allclose(before[:n][rows] + moved[rows], after[rows], rtol=0, atol=1e-11)


def test_what_has_no_derivatives_is_named(fmu) -> None:
    from liaisons.models import Pendulum

    words = r"Pendulum \(Pendulum.fmu\) cannot be linearized: it provides no directional derivatives"
    with start(fmu(Pendulum, "python"), step_size=0.1) as run, pytest.raises(LiaisonsError, match=words):
        run.linearize()
