"""Sensitivities and gradients by name, with units."""

from __future__ import annotations

from pathlib import Path

import casadi as ca
import numpy as np
import pytest

from liaisons import Result, System, gradient, sensitivities
from liaisons.base import compiler
from liaisons.base.compiled_code import compiled_library
from liaisons.errors import BuildError, ComponentError, InvalidValueError, SimulationError, UnknownSignalError
from liaisons_motion.derivatives.functions import motion_functions


def test_derivatives_are_found_by_name() -> None:
    found = sensitivities("Pendulum", by=["theta_0", "gravity"], stop_time=9, theta_0=2.0)
    assert found.method == "steps"
    np.testing.assert_allclose(found.time, np.linspace(0, 9, 201), rtol=1e-14)
    assert found["theta"][0] == 2
    assert found.derivative("theta", "theta_0")[0] == 1
    assert found.derivative("theta", "gravity")[0] == 0
    assert found.unit("theta", "gravity") == "s2/m"
    assert found.unit("p_theta", "theta_0") == "kg.m2/s"
    with pytest.raises(UnknownSignalError, match="did you mean 'theta'"):
        found.derivative("thet", "theta_0")


def test_the_energy_keeps_its_derivative() -> None:
    found = sensitivities(
        "Pendulum", "theta_0", stop_time=20, step_size=0.1, theta_0=2.0, record="energy", tolerance=1e-12
    )
    np.testing.assert_allclose(found.derivative("energy", "theta_0"), 9.81 * np.sin(2.0), rtol=1e-10)


def test_arrays_have_axes_of_their_own() -> None:
    found = sensitivities("PendulumChain", ["theta_0", "gravity"], times=[0.0, 0.5, 1.0], theta_0=0.3)
    assert found.derivative("theta", "theta_0").shape == (3, 10, 10)
    assert found.derivative("theta", "theta_0[2]").shape == (3, 10)
    assert found.derivative("theta[3]", "theta_0").shape == (3, 10)
    np.testing.assert_array_equal(found.derivative("theta", "theta_0")[0], np.eye(10))
    np.testing.assert_array_equal(
        found.derivative("theta[3]", "theta_0[2]"), found.derivative("theta", "theta_0")[:, 2, 1]
    )


def test_a_result_is_written_and_read(tmp_path: Path) -> None:
    found = sensitivities("Pendulum", "theta_0", stop_time=1.0, step_size=0.25)
    found.to_result().to_csv(tmp_path / "derivatives.csv")
    read = Result.from_csv(tmp_path / "derivatives.csv")
    np.testing.assert_array_equal(read["d(p_theta)/d(theta_0)"], found.derivative("p_theta", "theta_0"))
    assert read.units["d(p_theta)/d(theta_0)"] == "kg.m2/s"


def test_a_gradient_is_the_sum_of_sensitivities() -> None:
    options = {"by": ["theta_0", "length"], "stop_time": 5.0, "start_values": {"theta_0": 1.5}}
    found = gradient("Pendulum", cost=lambda m: ca.sumsqr(m["theta"] - ca.sin(m["time"])), **options)
    s = sensitivities("Pendulum", **options)
    rest = s["theta"] - np.sin(s.time)
    assert found.value == pytest.approx(rest @ rest, rel=1e-13)
    for name in ("theta_0", "length"):
        assert found[name] == pytest.approx(2 * rest @ s.derivative("theta", name), rel=1e-12)


def test_a_cost_may_be_made_of_arrays() -> None:
    found = gradient("PendulumChain", lambda m: ca.sum1(m["theta"])[2], ["theta_0"], times=[0.0], theta_0=0.3)
    assert found.value == pytest.approx(0.3)
    assert found.derivatives == pytest.approx({f"theta_0[{i}]": float(i == 3) for i in range(1, 11)})


def test_an_event_inside_a_system_is_that_of_an_operator() -> None:
    times, start = np.linspace(0, 4, 41), {"offset": 1.0, "rate": 0.2, "start_time": 1.23}
    values = {"theta_0": 1.0} | {f"length.{name}": value for name, value in start.items()}
    by = ["length.start_time", "theta_0"]
    alone = sensitivities("Pendulum", by, times=times, operators={"length": "Ramp"}, start_values=values)
    system = System("lengthening")
    swing = system.add("swing", "Pendulum", theta_0=1.0)
    system.connect(system.add("ramp", "Ramp", start_values=start)["y"], swing["length"])
    whole = sensitivities(system, ["ramp.start_time", "swing.theta_0"], times=times)
    for one, other in zip(by, ("ramp.start_time", "swing.theta_0"), strict=True):
        np.testing.assert_allclose(
            whole.derivative("swing.theta", other), alone.derivative("theta", one), rtol=1e-9, atol=1e-12
        )


def test_without_a_compiler_there_are_no_derivatives(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("system_compiler", "zig_compiler"):
        monkeypatch.setattr(compiler, name, lambda: None)
    for cached in (compiled_library, motion_functions):
        cached.cache_clear()
    with pytest.raises(BuildError, match=r"^no C compiler is found: pip install 'liaisons\[cross\]'$"):
        sensitivities("Pendulum", "theta_0", stop_time=1.0)


def test_too_many_steps_are_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("liaisons_motion.derivatives.compiled_steps._STEPS", 1000)
    with pytest.raises(SimulationError, match=r"steps until t = .* s; stop earlier, or take a larger tolerance"):
        sensitivities("Pendulum", "theta_0", stop_time=1e4)


def test_they_are_shown_in_a_line() -> None:
    s = sensitivities("Pendulum", ["theta_0", "length"], times=[0.0, 1.0], record="theta")
    signals = "<Result of Pendulum: 2 points, t = 0 to 1 s, 1 signals: theta [rad]>"
    assert repr(s) == f"<Sensitivities by theta_0, length, steps, of {signals}>"


@pytest.mark.parametrize(
    ("wrong", "message", "error"),
    [
        ({"by": "gravty"}, "no value 'gravty' to set; did you mean 'gravity'", ComponentError),
        ({"stop_time": None}, "give stop_time, or the recorded times", InvalidValueError),
        ({"stop_time": -1.0}, "must be greater than start_time", InvalidValueError),
        ({"cost": lambda m: m["theta"]}, r"the cost has shape \(201, 1\); it must be one number", SimulationError),
        ({"cost": lambda m: m["thet"]}, "'thet' is not recorded; did you mean 'theta'", UnknownSignalError),
        ({"stop_time": "2"}, "stop_time = '2': must be a finite number", InvalidValueError),
        ({"step_size": 5e-7}, "step_size = 5e-07: 2000001 recorded times are too many", InvalidValueError),
        ({"times": [0.0, 1.0]}, "leave out stop_time and step_size", InvalidValueError),
        ({"cost": 3.0}, r"cost = 3\.0: give a function of the signals", InvalidValueError),
        ({"cost": lambda _: None}, "the cost is None; it must be one number", SimulationError),
        ({"times": [0.0, 0.0], "stop_time": None}, "times: give finite numbers in ascending order", SimulationError),
        ({"theta_0": [1.0, 2.0]}, r"theta_0 has shape \(2,\); it has 1 elements", SimulationError),
    ],
)
def test_wrong_arguments_are_refused(wrong: dict, message: str, error: type[Exception]) -> None:
    options = {"cost": lambda m: ca.sumsqr(m["theta"]), "by": "theta_0", "stop_time": 1.0}
    with pytest.raises(error, match=message):
        gradient("Pendulum", **options | wrong)
