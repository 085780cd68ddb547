"""Impacts in systems: FMUs hand over forces, not impulses; a run says so, and the flattened system has them."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np
import pytest
from making import FmuPaths, coupling_errors, wired

from liaisons import (
    ActiveCoordinate,
    Coordinate,
    Gravity,
    Mechanism,
    Parameter,
    System,
    build,
    flatten,
    simulate,
    unilateral,
)
from liaisons.cosim.structure.schedule import Coupling


class Ball(Mechanism):
    """Ball above a table that an operator moves."""

    mass = Parameter(1.0, "kg", "mass of the ball", above=0)
    bounce = Parameter(0.8, "1", "coefficient of restitution", minimum=0, maximum=1)
    gravity = Gravity()
    height = Coordinate("m", "height of the ball", start=0.3)
    table = ActiveCoordinate("m", "height of the table")

    def kinetic_energy(self) -> ca.SX:
        return self.mass / 2 * self.dot(self.height) ** 2

    def potential_energy(self) -> ca.SX:
        return self.mass * self.gravity * self.height

    @unilateral("m", "distance of ball and table", restitution="bounce")
    def gap(self) -> ca.SX:
        return self.height - self.table


class BallOnSpring(Mechanism):
    """The same above a table of 1 kg on a spring, without weight: in one Lagrangian."""

    mass = Parameter(1.0, "kg", "mass of either", above=0)
    stiffness = Parameter(50.0, "N/m", "stiffness of the spring", above=0)
    bounce = Parameter(0.8, "1", "coefficient of restitution", minimum=0, maximum=1)
    gravity = Gravity()
    height = Coordinate("m", "height of the ball", start=0.3)
    x = Coordinate("m", "height of the table")

    def kinetic_energy(self) -> ca.SX:
        return self.mass / 2 * (self.dot(self.height) ** 2 + self.dot(self.x) ** 2)

    def potential_energy(self) -> ca.SX:
        return self.mass * self.gravity * self.height + self.stiffness / 2 * self.x**2

    @unilateral("m", "distance of ball and table", restitution="bounce")
    def gap(self) -> ca.SX:
        return self.height - self.x


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("balls")


@pytest.fixture(scope="module")
def ball(folder: Path) -> Path:
    return build(Ball, folder)


def _on_spring(ball: Path, component: FmuPaths, height: float = 0.3, x: float = 0.0) -> System:
    table = component("Oscillator"), {"stiffness": 50.0, "x_0": x}
    return wired("table.x -> ball.table", ball=(ball, {"height_0": height}), table=table)


def _shaken(ball: Path, component: FmuPaths) -> System:
    """The table starts from its highest point, with 0.9 g at most: the ball comes to rest and stays."""
    motor = {"amplitude": 0.9 * 9.81 / 100, "angular_frequency": 10.0, "phase": np.pi / 2}
    return wired("motor.y -> ball.table", ball=(ball, {"bounce": 0.5}), motor=(component("Sinusoid"), motor))


@pytest.mark.parametrize("coupling", ["implicit", "gauss-seidel"])
def test_moved_mechanism_keeps_its_impulses_to_itself(ball: Path, component: FmuPaths, coupling: Coupling) -> None:
    """On a table at rest, which does not yield: impulse (1 + e) √(2 g h), where both would share half of that."""
    run = _on_spring(ball, component).simulate(stop_time=0.4, step_size=0.01, coupling=coupling)
    (warning,) = run.warnings
    impulse = 1.8 * np.sqrt(2 * 9.81 * 0.3)
    assert warning.startswith(
        "wired: impulses do not go through ball.table_force -> table.x_load: of ball.table_impulse, "
        f"{impulse:.4g} N.s at t = 0.25 s and 0 more; what follows is wrong by an unknown amount: "
    )
    errors = coupling_errors(run)
    assert np.flatnonzero(np.isnan(errors)).tolist() == [25]


def test_mover_hears_of_no_impulse_either(ball: Path, component: FmuPaths) -> None:
    """A pendulum whose pivot is the ball, which jumps in rate: no accuracy is claimed there."""
    run = wired("ball.height -> bob.pivot_z", ball=ball, bob=component("Pendulum")).simulate(
        stop_time=0.3, step_size=0.01, record=["ball.height"]
    )
    (warning,) = run.warnings
    assert "bob.pivot_z_force -> ball.height_load: of ball.gap_impulse, " in warning
    assert np.flatnonzero(np.isnan(coupling_errors(run))).tolist() == [25]


def test_contact_without_impacts_is_coupled(ball: Path, component: FmuPaths) -> None:
    """A ball that lies on the table makes it heavier: x = x_e + (x_0 - x_e) cos(√(k/2m) t), x_e = -m g/k."""
    system = _on_spring(ball, component, height=-0.1, x=-0.1)
    run = system.simulate(stop_time=2.0, step_size=0.01)
    assert run.warnings == ()
    assert run["ball.gap_impacts"][-1] == 0
    assert np.all(run["ball.gap_closed"])
    rest = -9.81 / 50.0
    expected = rest + (-0.1 - rest) * np.cos(5.0 * run.time)
    np.testing.assert_allclose(run["table.x"], expected, atol=1e-7)  # tolerance 1e-8, coupling of order 4
    assert np.nansum(coupling_errors(run)) < 1e-6


def test_flattened_is_one_mechanism(ball: Path, component: FmuPaths, folder: Path) -> None:
    """Its impacts share the impulse: as in the one Lagrangian of both bodies; until bounces are too low for 1e-9."""
    path = flatten(_on_spring(ball, component), folder, components={"Ball": Ball})
    names = ["ball.height", "table.x", "ball.gap_impulse", "ball.gap_impacts", "ball.energy_balance"]
    settings: dict[str, Any] = {"stop_time": 1.2, "step_size": 0.01, "tolerance": 1e-12}
    one = simulate(path, record=names, **settings)
    other = simulate(build(BallOnSpring, folder), **settings)
    for name, same in zip(names, ("height", "x", "gap_impulse", "gap_impacts", "energy_balance"), strict=True):
        np.testing.assert_allclose(one[name], other[same], rtol=0, atol=1e-9)
    assert one["ball.gap_impacts"][-1] > 3


@pytest.mark.parametrize("coupling", [None, "gauss-seidel", "implicit", "waveform"])
def test_table_that_an_operator_moves(ball: Path, component: FmuPaths, coupling: Coupling | None) -> None:
    """Impacts lie inside steps, none is lost, and contact at rest does not chatter, whatever the steps."""
    ends = []
    for step_size in (0.01, 0.1):
        run = _shaken(ball, component).simulate(stop_time=4.0, step_size=step_size, coupling=coupling, tolerance=1e-11)
        assert run.warnings == ()
        resting = run.time > 2.0
        assert np.all(run["ball.gap_closed"][resting])
        assert np.ptp(run["ball.gap_impacts"][resting]) == 0
        np.testing.assert_allclose(run["ball.height"][resting], run["motor.y"][resting], atol=1e-12)
        ends.append(run["ball.gap_impacts"][-1])
    assert len(set(ends)) == 1
