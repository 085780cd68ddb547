"""What runs watch: FMUs that show another variable as the residual of a constraint, or as their energy balance."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from making import FmuPaths, described, exchange_only, lying, wired

from liaisons import System, simulate, start, sweep
from liaisons.cosim.compiled import library
from liaisons.errors import IncompleteError, SimulationError

RUN: dict[str, Any] = {"stop_time": 1.0, "step_size": 0.1}
HEIGHT = 0.3  # of the bob on the rod of 1 m
HANGING: dict[str, Any] = {"x_0": math.sqrt(1 - (1 - HEIGHT) ** 2), "z_0": HEIGHT}


@pytest.fixture
def pendulum(component: FmuPaths, tmp_path: Path) -> Path:
    """A pendulum that falls, whose account is off by its kinetic energy."""
    return lying(component("Pendulum"), tmp_path / "Pendulum.fmu", "energy_balance", "kinetic_energy")


@pytest.fixture
def bob(component: FmuPaths, tmp_path: Path) -> Path:
    """A bob on a rod, which it leaves by as much as it is displaced."""
    return lying(component("CartesianPendulum"), tmp_path / "CartesianPendulum.fmu", "rod_residual", "x")


@pytest.mark.parametrize("settings", [{}, {"record": ["theta"]}, {"isolated": True}, {"error_tolerance": 1e-6}])
def test_an_account_that_does_not_close_is_told(pendulum: Path, settings: dict[str, Any]) -> None:
    """Released at a right angle: T = m g l cos θ, which grows until the lowest point, at 0.59 s."""
    result = simulate(pendulum, theta_0=math.pi / 2, **{**RUN, **settings}, tolerance=1e-8)
    (warning,) = result.warnings
    assert warning.startswith("Pendulum: the energy account does not close: energy_balance = 9.")
    assert "exceeded from t = 0.1 s on" in warning or "error_tolerance" in settings
    allowed = float(warning.split("where ")[1].split(" J")[0])
    assert allowed == pytest.approx(1e-6 * 9.81, rel=0.1)  # 100 steps of 1e-8, and the potential energy, m g l


def test_each_mechanism_is_told_once_wherever_it_runs(component: FmuPaths, pendulum: Path, tmp_path: Path) -> None:
    (tmp_path / "exchange").mkdir()
    parts = {"good": component("Pendulum"), "bad": pendulum, "worse": exchange_only(pendulum, tmp_path / "exchange")}
    system = wired(**{name: (path, {"theta_0": 1.0}) for name, path in parts.items()})
    told = [warning.partition(":")[0] for warning in system.simulate(**RUN, record=["good.theta"]).warnings]
    assert told == ["bad", "worse"]
    with system.start(step_size=0.1) as run:
        for _ in range(5):
            run.step()
            assert [warning.partition(":")[0] for warning in run.result.warnings] == ["bad", "worse"]
        run.reset({"bad.theta_0": 0.0, "worse.theta_0": 0.0})
        run.step()
        assert run.result.warnings == ()


def test_tolerances_allow_what_they_leave(component: FmuPaths) -> None:
    """The CarAxis, stiff, keeps its energy to some tolerances, in Model Exchange to hundreds of them."""
    for tolerance in (1e-2, 1e-3, 1e-6):
        result = simulate(component("CarAxis"), **RUN, tolerance=tolerance, bounce_dot_0=1.0)
        assert result.warnings == ()
        assert np.max(np.abs(result["energy_balance"])) > 1e-14


def test_what_rates_that_are_rounding_have_of_energy_is_not_told(component: FmuPaths, tmp_path: Path) -> None:
    """E = 1/2 K x_0², at rest 1e-28 J, of a nominal energy of 1/2 m (1 m/s)², of which rates of 1e-12 m/s are 1e-24."""
    oscillator = lying(component("Oscillator"), tmp_path / "Oscillator.fmu", "energy_balance", "kinetic_energy")
    assert simulate(oscillator, x_0=1e-14, **RUN).warnings == ()
    (warning,) = simulate(oscillator, x_0=1e-10, **RUN).warnings
    assert warning.startswith("Oscillator: the energy account does not close: energy_balance = ")
    assert "where 5e-25 J are allowed" in warning


def test_symplectic_steps_may_swing(component: FmuPaths) -> None:
    result = simulate(component("Pendulum"), stop_time=20.0, step_size=0.25, theta_0=2.0, symplectic_steps=1)
    assert 1e-6 < np.max(np.abs(result["energy_balance"])) / 10 < 1e-2
    assert result.warnings == ()


@pytest.mark.parametrize("way", ["compiled", "Python", "implicit", "adapted", "isolated"])
def test_a_step_that_leaves_a_constraint_is_refused(bob: Path, monkeypatch: pytest.MonkeyPatch, way: str) -> None:
    if way == "Python":
        monkeypatch.setattr(library, "step_library", lambda **_: None)
    settings: dict[str, Any] = {"implicit": {"coupling": "implicit"}, "adapted": {"error_tolerance": 1e-6}}.get(way, {})
    system = System("one")
    system.add("bob", bob, isolated=way == "isolated", **HANGING)
    with pytest.raises(IncompleteError, match=r"bob: a constraint is not kept: rod_residual = 0.\d+ m") as caught:
        system.simulate(**RUN, **settings, record=["bob.z"])
    assert "m from t = 0 s to t = " in str(caught.value)
    assert "1e-06 m are allowed" in str(caught.value)
    assert caught.value.result.time.tolist() == [0.0]


def test_a_run_returns_to_where_its_constraints_were_kept(bob: Path) -> None:
    with start(bob, step_size=0.1, **HANGING) as run:
        state = run.save()
        for _ in range(2):
            with pytest.raises(IncompleteError, match="a constraint is not kept"):
                run.step()
            assert run.time == 0.0
            with pytest.raises(SimulationError, match="a constraint was not kept; restore a state, or start another"):
                run.step()
            run.restore(state)
        run.reset(x_0=0.0, z_0=0.0)
        run.step()
        assert run.time == 0.1


def test_sweeps_are_watched(bob: Path) -> None:
    swept = sweep(bob, {"x_0": [0.0, HANGING["x_0"]], "z_0": [0.0, HEIGHT]}, "z", workers=1, **RUN)
    assert np.isnan(swept["z"]).tolist() == [False, True]


def test_what_has_no_energies_or_multipliers_is_not_watched(component: FmuPaths, tmp_path: Path) -> None:
    """An FMU of another maker may call something so."""
    changes = {b'"kinetic_energy"': b'"heat"', b'"theta_force"': b'"theta_residual"'}
    path = tmp_path / "Pendulum.fmu"
    made = lying(component("Pendulum"), tmp_path / "lying.fmu", "energy_balance", "kinetic_energy")

    def change(content: bytes) -> bytes:
        for old, new in changes.items():
            content = content.replace(b"name=" + old, b"name=" + new)
        return content

    described(made, path, change)
    assert simulate(path, **RUN, theta_0=1.0, theta_residual=1.0).warnings == ()
