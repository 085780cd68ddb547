"""Ensembles, against closed forms and against FMUs."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from liaisons import System, build, compiler, max_error, slope
from liaisons.ensembles import ensemble, integrating
from liaisons.ensembles.methods import METHODS
from liaisons.ensembles.right_hand_sides import flat, right_hand_side
from liaisons.ensembles.steps import source
from liaisons.errors import ComponentError, SimulationError
from liaisons.mechanics import assemble
from liaisons.models import (
    CartesianPendulum,
    CircularHoop,
    Oscillator,
    Pendulum,
    PendulumChain,
    Ramp,
    Sinusoid,
)

ANGLES = np.linspace(0.2, 3.0, 37)  # no multiple of the lanes
RATES = np.linspace(0.0, 9.0, 37)  # librations and rotations

METHOD_NAMES = tuple(METHODS)


@pytest.fixture(scope="module")
def fmus(tmp_path_factory) -> Path:
    return tmp_path_factory.mktemp("fmus")


def exact(time: np.ndarray, **values: np.ndarray) -> np.ndarray:
    """Angle of each pendulum, shape (times, members)."""
    members = [dict(zip(values, member, strict=True)) for member in zip(*values.values(), strict=True)]
    return np.array([Pendulum.exact(time, **member)["theta"] for member in members]).T


@pytest.mark.parametrize("backend", ["native", "numpy"])
def test_pendulums_that_swing_and_turn(backend) -> None:
    values = {"theta_0": ANGLES, "theta_dot_0": RATES}
    found = ensemble(Pendulum, values, stop_time=2.0, step_size=0.01, samples=4, backend=backend)
    assert found.compiled == (backend == "native")
    assert found["theta"].shape == (5, 37)
    # Order 8: (10/s · 0.01 s)^8 is 1e-8 a step in units of the error constant, 1e-6; 200 steps; growth below 1e3.
    assert max_error(found["theta"], exact(found.time, **values)) <= 1e-10


@pytest.mark.parametrize("method", METHOD_NAMES)
def test_order(method) -> None:
    order = METHODS[method].order
    steps = np.array([0.2, 0.1, 0.05]) * (1.0 if order == 8 else 0.1)
    errors = []
    for step in steps:
        found = ensemble(
            Pendulum,
            {"theta_0": ANGLES[:5]},
            stop_time=2.0,
            step_size=step,
            method=method,
            backend="numpy",
            estimate=False,
        )
        errors.append(max_error(found["theta"], exact(found.time, theta_0=ANGLES[:5])))
    # A method of lower order would show one less; the next order makes it steeper at these steps.
    assert slope(steps, errors) >= order - 0.3


@pytest.mark.parametrize("method", METHOD_NAMES)
def test_coefficients(method) -> None:
    tableau = METHODS[method]
    a = np.array([[*row, *[0.0] * (tableau.stages - len(row))] for row in tableau.matrix])
    b, c = np.array(tableau.weights), np.array(tableau.nodes)
    # Some ten roundings of coefficients up to 10.
    np.testing.assert_allclose(a.sum(axis=1), c, atol=1e-14)
    for k in range(1, tableau.order + 1):
        assert b @ c ** (k - 1) == pytest.approx(1 / k, abs=1e-14)  # quadrature: y' = t^(k-1)
        assert b @ np.linalg.matrix_power(a, k - 1) @ np.ones(len(b)) == pytest.approx(1 / math.factorial(k), abs=1e-14)


@pytest.mark.parametrize("method", METHOD_NAMES)
def test_the_estimated_error_is_the_error(method) -> None:
    found = ensemble(Pendulum, {"theta_0": ANGLES}, stop_time=4.0, step_size=0.04, samples=8, method=method)
    error = np.max(np.abs(found["theta"] - exact(found.time, theta_0=ANGLES)), axis=0)
    # The orders after the leading one count at twice the step: it may be too large, but hardly too small.
    assert np.all(found.error("theta") > 0.7 * error)
    assert np.all(found.error("theta") < 5 * error)


def test_compiled_and_numpy_differ_by_roundings() -> None:
    values = {"theta_0": ANGLES, "length.amplitude": np.linspace(0, 0.3, 37), "length.offset": 1.0, "friction": 0.1}
    both = [
        ensemble(Pendulum, values, stop_time=2.0, step_size=0.02, operators={"length": Sinusoid}, backend=backend)
        for backend in ("native", "numpy")
    ]
    # 100 steps of some ten roundings each of numbers of order 1, which the motion lets grow tenfold.
    assert max_error(both[0].values, both[1].values) <= 1e-12


def test_members_do_not_depend_on_their_neighbours() -> None:
    many = ensemble(Pendulum, {"theta_0": np.linspace(0.1, 3, 2000)}, stop_time=1.0, step_size=0.01, threads=2)
    few = ensemble(Pendulum, {"theta_0": np.linspace(0.1, 3, 2000)[700:703]}, stop_time=1.0, step_size=0.01, threads=1)
    assert np.array_equal(many["theta"][:, 700:703], few["theta"])


def test_an_operator_moves_the_length_as_an_fmu_does(fmus) -> None:
    amplitudes = [0.05, 0.1, 0.2]
    found = ensemble(
        Pendulum,
        {"length.amplitude": amplitudes, "length.offset": 1.0, "length.angular_frequency": 6.0, "theta_0": 0.4},
        stop_time=5.0,
        step_size=0.01,
        operators={"length": Sinusoid},
        record=["theta", "p_theta", "length_force", "energy_balance"],
    )
    for member, amplitude in enumerate(amplitudes):
        system = System("swing")
        swing = system.add("swing", build(assemble(Pendulum), fmus), theta_0=0.4, input_reconstruction=2)
        motor = system.add(
            "motor", build(assemble(Sinusoid), fmus), offset=1.0, amplitude=amplitude, angular_frequency=6.0
        )
        system.connect(motor["y"], swing["length"])
        result = system.simulate(5.0, 0.01, tolerance=1e-11)
        for name in ("theta", "p_theta", "length_force"):
            # The solver keeps 1e-11 a step; interpolated inputs 1e-13; forces are ten times as large.
            assert abs(found[name][-1, member] - result[f"swing.{name}"][-1]) <= 1e-8
    assert np.max(np.abs(found["energy_balance"])) <= 1e-10  # energies of 10 J, error of order 8 as estimated below
    assert np.max(found.error("energy_balance")) <= 1e-10


def test_hoops_that_turn_evenly() -> None:
    rates = np.linspace(0.5, 3.0, 7)
    found = ensemble(
        CircularHoop,
        {"beta.rate": rates},
        stop_time=5.0,
        step_size=0.01,
        operators={"beta": Ramp},
        record=["xi", "xi_dot", "normal_force", "beta_force"],
    )
    for member, rate in enumerate(rates):
        expected = CircularHoop.exact(found.time, beta_dot=rate)
        for name in found.names:
            # Order 8 with h times the frequency below 0.03; forces are ten times as large as xi.
            assert max_error(found[name][:, member], expected[name]) <= 1e-11


def test_constraints_hold() -> None:
    found = ensemble(
        CartesianPendulum,
        {"gravity": [5.0, 9.81]},
        stop_time=2.0,
        step_size=0.01,
        samples=10,
        method="rk4",
        record=["x", "y", "z"],
    )
    length = np.sqrt(found["x"] ** 2 + found["y"] ** 2 + (1 - found["z"]) ** 2)
    # Each step is put back onto the sphere, to the last bits.
    assert np.max(np.abs(length - 1.0)) <= 1e-15 * 10


def test_a_chain_agrees_with_another_integrator() -> None:
    found = ensemble(PendulumChain, {"gravity": [5.0, 9.0]}, stop_time=1.0, step_size=0.01)
    model = assemble(PendulumChain).flat()
    k = [9.0 if v.name == "gravity" else v.starts[0] for v in model.parameters]
    u = [v.starts[0] for v in model.inputs]
    start = np.array(model.start(0.0, u, k)[0]).reshape(-1)
    other = solve_ivp(
        lambda t, y: np.array(model.derivatives(t, y, u, k)).reshape(-1),
        (0, 1),
        start,
        "DOP853",
        rtol=1e-11,
        atol=1e-12,
    )
    # The other one keeps 1e-11 a step; over a second a chain of ten lets errors grow a hundredfold.
    assert abs(found["theta[3]"][-1, 1] - other.y[2, -1]) <= 1e-8


def test_a_member_that_fails_does_not_harm_the_others() -> None:
    values = {"mass": [1.0, -1.0, 1.0], "length.amplitude": [0.1, 0.1, 1.5], "length.offset": 1.0}
    found = ensemble(
        Pendulum, values, stop_time=4.0, step_size=0.01, samples=40, operators={"length": Sinusoid}, estimate=False
    )
    assert found.failures.keys() == {1, 2}
    assert found.failures[1] == "mass = -1: must be > 0"
    assert found.failures[2] == "length must stay > 0 (t = 3.9 s)"
    assert np.isfinite(found["theta"][:, 0]).all()
    # 1 + 1.5 sin t falls below 0 at t = π + asin(1/1.5) = 3.871
    failing = np.isnan(found["theta"][:, 2])
    assert found.time[failing].min() == pytest.approx(3.9)
    alone = ensemble(
        Pendulum,
        {"mass": [1.0], "length.amplitude": 0.1, "length.offset": 1.0},
        stop_time=4.0,
        step_size=0.01,
        samples=40,
        operators={"length": Sinusoid},
        estimate=False,
    )
    assert np.array_equal(found["theta"][:, :1], alone["theta"])


def test_without_a_compiler(monkeypatch) -> None:
    for name in ("system_compiler", "zig_compiler"):
        monkeypatch.setattr(integrating, name, lambda: None)
    found = ensemble(Oscillator, {"x_0": [1.0, 2.0]}, stop_time=1.0, step_size=0.1)
    assert not found.compiled
    assert max_error(found["x"][-1], np.cos(1.0) * np.array([1.0, 2.0])) <= 1e-11  # h^8/9! · 10 steps


def test_integrals_are_left_out_unless_they_are_wanted() -> None:
    for value, output, states in (("theta_0", "theta", 2), ("friction", "dissipated", 3)):
        equations = right_hand_side(flat(Pendulum), {}, lanes=[value], shared=[], record=[output])
        assert equations.start.numel() == states


def test_the_generated_code_is_clean(monkeypatch) -> None:
    found = right_hand_side(flat(CartesianPendulum), {}, lanes=["gravity"], shared=[], record=["x"])
    code = source(found, METHODS["rk4"])
    monkeypatch.setattr(
        compiler, "FLAGS", (*compiler.FLAGS, "-Wall", "-Wextra", "-pedantic", "-Werror", "-fopenmp-simd")
    )
    assert compiler.compile_library({"ensemble.c": code.encode()}, compiler.host())


@pytest.mark.parametrize(
    ("values", "options", "error", "message"),
    [
        ({"theta0": [1.0]}, {}, ComponentError, "did you mean 'theta_0'"),
        ({"theta_0": []}, {}, SimulationError, "no cases"),
        ({"theta_0": 1.0}, {}, SimulationError, "no cases"),
        ({"theta_0": [1.0], "mass": [1.0, 2.0]}, {}, SimulationError, "theta_0 1, mass 2"),
        ({"theta_0": [[1.0]]}, {}, SimulationError, r"shape \(1, 1\)"),
        ({"theta_0": ["a"]}, {}, SimulationError, "theta_0"),
        ({"theta_0": [1.0]}, {"record": ["tehta"]}, ComponentError, "did you mean 'theta'"),
        ({"theta_0": [1.0]}, {"record": []}, ComponentError, "depends on a state"),
        ({"theta_0": [1.0]}, {"method": "rk5"}, SimulationError, "'rk4'|'rk8'"),
        ({"theta_0": [1.0]}, {"step_size": 0.0}, SimulationError, "step_size = 0.0: must be > 0"),
        ({"theta_0": [1.0]}, {"stop_time": -1.0}, SimulationError, "greater than start_time"),
        ({"theta_0": [1.0]}, {"samples": 0}, SimulationError, "samples = 0"),
        ({"theta_0": [1.0]}, {"operators": {"theta": Ramp}}, ComponentError, "no active coordinate 'theta'"),
        ({"theta_0": [1.0]}, {"operators": {"length": Pendulum}}, ComponentError, "no Operator"),
        ({"length": [1.0]}, {"operators": {"length": Ramp}}, ComponentError, "no value 'length'"),
    ],
)
def test_misuse(values, options, error, message) -> None:
    with pytest.raises(error, match=message):
        ensemble(Pendulum, values, **{"stop_time": 1.0, "step_size": 0.1, **options})
