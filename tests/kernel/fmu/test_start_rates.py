"""Rates at the start that loops and other constraints demand: what is not given follows, and is named."""

from __future__ import annotations

import numpy as np
import pytest
from driver import CO_SIMULATION, ERROR, MODEL_EXCHANGE, WARNING, Instance
from numpy.typing import NDArray

from liaisons import assemble, ensemble, simulate
from liaisons.errors import RefusedError
from liaisons.fmu import start_vectors
from liaisons.mechanics import Model
from liaisons.models import Bricard, CartesianPendulum, FourBar, four_bars

TURN, RATE = 1.0, 0.7
CRANK, COUPLER, ROCKER = 0.5, 1.5, 1.2


def turning_four_bar() -> tuple[float, float]:
    """Rates of elbow and swing, from the derivative of the loop a e^iφ + b e^i(φ + ε) - c e^iψ = d by time."""
    angles = {name: float(x) for name, x in FourBar.freudenstein(TURN).items()}
    crank, coupler = CRANK * np.exp(1j * TURN), COUPLER * np.exp(1j * (TURN + angles["elbow"]))
    rocker = ROCKER * np.exp(1j * angles["swing"])
    columns = np.array([[coupler.real, -rocker.real], [coupler.imag, -rocker.imag]])
    right = -RATE * (crank + coupler)
    elbow, swing = np.linalg.solve(columns, [right.real, right.imag])
    return float(elbow), float(swing)


@pytest.mark.parametrize(
    ("target", "kind"),
    [
        *(("fmi2", CO_SIMULATION), ("fmi2", MODEL_EXCHANGE), ("fmi3", CO_SIMULATION), ("fmi3", MODEL_EXCHANGE)),
        ("python", CO_SIMULATION),
    ],
)
def test_a_crank_that_turns_at_the_start_moves_its_loop(library, target: str, kind: str) -> None:
    instance: Instance = library(FourBar, target).start(kind, options={"logging": True}, turn_dot=RATE)
    elbow, swing = turning_four_bar()
    np.testing.assert_allclose(instance.get("elbow_dot", "swing_dot"), [elbow, swing], rtol=1e-13)
    words = f"elbow_dot = {elbow:.6g} for elbow_dot_0 = 0, swing_dot = {swing:.6g} for swing_dot_0 = 0"
    ((status, _, message),) = instance.log
    assert (status, message) == (WARNING, f"rates at the start follow from the constraints: {words}")


@pytest.mark.parametrize("target", ["fmi2", "python"])
def test_nothing_is_said_where_no_rate_changes(library, target: str) -> None:
    elbow, swing = turning_four_bar()
    for rates in ({}, {"turn_dot": RATE, "elbow_dot_0": elbow, "swing_dot_0": swing}):
        assert library(FourBar, target).start(options={"logging": True}, **rates).messages == []


@pytest.mark.parametrize("target", ["fmi2", "python"])
def test_a_given_rate_that_contradicts_the_crank_is_refused(library, target: str) -> None:
    """At the start the tip of the coupler would be off by |b (ε' - elbow')| along and across the rocker."""
    instance = library(FourBar, target).initializing(turn_dot=RATE, elbow_dot_0=2.0)
    instance.exit_initialization(None)
    assert (
        "the rate of pin_offset_1 (rocker stays at coupler, along axis 1 of pin) must be kept" in instance.messages[-1]
    )
    assert "; given are elbow_dot_0 = 2; " in instance.messages[-1]


@pytest.mark.variants(core=0)
def test_a_free_loop_follows_the_rate_that_is_given(library) -> None:
    """By the symmetry of the cube all hinges turn alike; a second rate has to be that one."""
    instance = library(Bricard).start(hinge_3_dot_0=0.8)
    rates = instance.get(*(f"hinge_{i}_dot" for i in range(1, 6)))
    np.testing.assert_allclose(rates, 0.8, rtol=1e-12)
    library(Bricard).start(hinge_3_dot_0=0.8, hinge_1_dot_0=0.8)
    refused = library(Bricard).initializing(hinge_3_dot_0=0.8, hinge_1_dot_0=0.9)
    refused.exit_initialization(ERROR)
    assert "; given are hinge_1_dot_0 = 0.9, hinge_3_dot_0 = 0.8; set another" in refused.messages[-1]


def start_rates(model: Model, **values: float) -> NDArray:
    """Rates A⁻¹ p at the start by the functions of a model without inputs."""
    inputs, starts = start_vectors(model)
    starts[[v.name in values for v in model.parameters]] = [*values.values()]
    y, m = model.start(0, inputs, starts)
    z = np.array(model.outputs_function(0, y, inputs, starts, m)).ravel()
    rate = {variable.name: z[i] for i, variable in enumerate(model.outputs)}
    return np.array([rate[state.derivative] for state in model.states if state.name + "_dot" in rate])


@pytest.mark.parametrize("windows", [2, 9])
def test_rods_that_are_left_at_their_rates_follow_those_that_are_not(windows: int) -> None:
    """Declared rates, -1 rad/s, follow, too; nine windows are solved by a sparse system."""
    rates = start_rates(assemble(four_bars(windows)), theta_1_dot_0=-2.5)[: windows + 1]
    np.testing.assert_allclose(rates, -2.5, rtol=1e-12)


def test_a_bob_whose_rod_lengthens_at_the_start_moves_along_it(library) -> None:
    """With a given speed across, too: x' cos θ + z' sin θ = across, x' sin θ - z' cos θ = along."""
    theta, across, along = 0.1, 0.8, 0.3
    x, z = across * np.cos(theta) + along * np.sin(theta), across * np.sin(theta) - along * np.cos(theta)
    instance = library(CartesianPendulum).start(rod_dot=along, x_dot_0=x)
    np.testing.assert_allclose(instance.get("x_dot", "y_dot", "z_dot"), [x, 0, z], rtol=1e-13, atol=1e-16)
    instance = library(CartesianPendulum).start(rod_dot=along)
    np.testing.assert_allclose(
        instance.get("x_dot", "z_dot"), [along * np.sin(theta), -along * np.cos(theta)], rtol=1e-13
    )


def test_runs_and_ensembles_start_with_the_rates_of_the_loop() -> None:
    elbow, _ = turning_four_bar()
    turning = {"turn": lambda t: (TURN + RATE * t, RATE, 0.0)}
    run = simulate("FourBar", stop_time=0.1, step_size=0.05, inputs=turning)
    assert run["elbow_dot"][0] == pytest.approx(elbow, rel=1e-13)
    assert "for elbow_dot_0 = 0" in run.warnings[0]
    with pytest.raises(RefusedError, match="swing_dot_0"):
        simulate("FourBar", stop_time=0.1, step_size=0.05, inputs=turning, swing_dot_0=1.0)
    many = ensemble("FourBar", {"turn_dot": [RATE, 2 * RATE]}, stop_time=0.01, step_size=0.001, record="elbow_dot")
    np.testing.assert_allclose(many["elbow_dot"][0], [elbow, 2 * elbow], rtol=1e-13)
