"""Impacts in systems where no impulses go through: a run says so, and the flattened system has them."""

from __future__ import annotations

import logging
import signal
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np
import pytest
from making import FmuPaths, coupling_errors, wired

from liaisons import (
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
from liaisons.cosim import Coupling, Interrupted
from liaisons.coupling_estimate.contacts import ContactMechanism, accumulated_errors


class BallOnSpring(Mechanism):
    """Ball above a table of the same mass on a spring, which weighs nothing: in one Lagrangian."""

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


def _on_spring(component: FmuPaths, height: float = 0.3, x: float = 0.0) -> System:
    table = component("Oscillator"), {"stiffness": 50.0, "x_0": x}
    return wired("table.x -> ball.table", ball=(component("BouncingBall"), {"height_0": height}), table=table)


def _shaken(component: FmuPaths) -> System:
    """The table starts from its highest point, with 0.9 g at most: the ball comes to rest and stays."""
    motor = component("Sinusoid"), {"amplitude": 0.9 * 9.81 / 100, "angular_frequency": 10.0, "phase": np.pi / 2}
    return wired(
        "motor.y -> ball.table", ball=(component("BouncingBall"), {"height_0": 0.3, "bounce": 0.5}), motor=motor
    )


def test_moved_mechanism_keeps_its_impulses_to_itself(component: FmuPaths) -> None:
    """On a table at rest, which does not yield: impulse (1 + e) √(2 g h), where both would share half of that."""
    run = _on_spring(component).simulate(stop_time=0.4, step_size=0.01, coupling="gauss-seidel")
    (warning,) = run.warnings
    impulse = 1.8 * np.sqrt(2 * 9.81 * 0.3)
    assert warning.startswith(
        "wired: impulses do not go through ball.table_force -> table.x_load: of ball.table_impulse, "
        f"{impulse:.4g} N.s at t = 0.25 s and 0 more; what follows is wrong by an unknown amount: "
    )
    errors = coupling_errors(run)
    assert np.flatnonzero(np.isnan(errors)).tolist() == [25]


def test_mover_hears_of_no_impulse_either(component: FmuPaths) -> None:
    """A pendulum whose pivot is the ball, which jumps in rate: no accuracy is claimed there."""
    run = wired(
        "ball.height -> bob.pivot_z", ball=(component("BouncingBall"), {"height_0": 0.3}), bob=component("Pendulum")
    ).simulate(stop_time=0.3, step_size=0.01, record=["ball.height"])
    (warning,) = run.warnings
    assert "bob.pivot_z_force -> ball.height_load: of ball.gap_impulse, " in warning
    assert np.flatnonzero(np.isnan(coupling_errors(run))).tolist() == [25]


def test_contact_without_impacts_is_coupled(component: FmuPaths) -> None:
    """A ball that lies on the table makes it heavier: x = x_e + (x_0 - x_e) cos(√(k/2m) t), x_e = -m g/k."""
    system = _on_spring(component, height=-0.1, x=-0.1)
    run = system.simulate(stop_time=2.0, step_size=0.01)
    assert run.warnings == ()
    assert run["ball.gap_impacts"][-1] == 0
    assert np.all(run["ball.gap_closed"])
    rest = -9.81 / 50.0
    expected = rest + (-0.1 - rest) * np.cos(5.0 * run.time)
    np.testing.assert_allclose(run["table.x"], expected, rtol=0, atol=1e-7)  # tolerance 1e-8, coupling of order 4
    assert np.nansum(coupling_errors(run)) < 1e-6


def test_flattened_is_one_mechanism(component: FmuPaths, tmp_path: Path) -> None:
    """Its impacts share the impulse: as in the one Lagrangian of both bodies; until bounces are too low for 1e-9."""
    path = flatten(_on_spring(component), tmp_path)
    names = ["ball.height", "table.x", "ball.gap_impulse", "ball.gap_impacts", "ball.energy_balance"]
    settings: dict[str, Any] = {"stop_time": 1.2, "step_size": 0.01, "tolerance": 1e-12}
    one = simulate(path, record=names, **settings)
    other = simulate(build(BallOnSpring, tmp_path), **settings)
    for name, same in zip(names, ("height", "x", "gap_impulse", "gap_impacts", "energy_balance"), strict=True):
        np.testing.assert_allclose(one[name], other[same], rtol=0, atol=1e-9)
    assert one["ball.gap_impacts"][-1] > 3


@pytest.mark.parametrize("coupling", [None, "gauss-seidel", "implicit", "waveform"])
def test_table_that_an_operator_moves(component: FmuPaths, coupling: Coupling | None) -> None:
    """Impacts lie inside steps, none is lost, and contact at rest does not chatter, whatever the steps."""
    ends = []
    for step_size in (0.01, 0.1):
        run = _shaken(component).simulate(stop_time=4.0, step_size=step_size, coupling=coupling, tolerance=1e-11)
        assert bool(run.warnings) == (step_size == 0.1)  # its rate is off by 1.3e-4 m/s of 2 before it rests
        resting = run.time > 2.0
        assert np.all(run["ball.gap_closed"][resting])
        assert np.ptp(run["ball.gap_impacts"][resting]) == 0
        np.testing.assert_allclose(run["ball.height"][resting], run["motor.y"][resting], rtol=0, atol=1e-12)
        ends.append(run["ball.gap_impacts"][-1])
    assert len(set(ends)) == 1


def test_flattened_tower_shares_its_impact(component: FmuPaths, tmp_path: Path) -> None:
    """A ball of 0.3 kg just above one of 1 kg, dropped onto a floor: shot up by the impact with the other, e = 0.9."""
    e, m, g, above, h = 0.9, 0.3, 9.81, 1e-3, 0.5
    lower = component("BouncingBall"), {"height_0": h, "bounce": 1.0}
    upper = component("BouncingBall"), {"height_0": h + above, "bounce": e, "mass": m}
    system = wired("lower.height -> upper.table", lower=lower, upper=upper)
    v = np.sqrt(2 * g * h)
    first, since = v / g, above / (2 * v)  # they approach with 2v
    hit = first + since
    speed = -(v + g * since) + (1 + e) / (1 + m) * 2 * v
    place = v * since - g / 2 * since**2
    run = simulate(flatten(system, tmp_path), stop_time=hit + 0.2, step_size=hit + 0.2, tolerance=1e-12)
    assert run["upper.height"][-1] == pytest.approx(place + speed * 0.2 - g / 2 * 0.2**2, abs=1e-11)
    assert run["upper.gap_impacts"][-1] == 1


def test_flattened_operator_moves_the_table(component: FmuPaths, tmp_path: Path) -> None:
    system = _shaken(component)
    run = system.simulate(stop_time=1.0, step_size=0.01, tolerance=1e-11)
    whole = simulate(flatten(system, tmp_path), stop_time=1.0, step_size=0.01, tolerance=1e-11)
    np.testing.assert_allclose(run["ball.height"], whole["ball.height"], rtol=0, atol=1e-9)


@pytest.mark.parametrize(
    ("name", "port", "offset", "starts"),
    [
        ("BouncingBall", "table", 0.0, {"height_0": 1.0, "bounce": 0.5}),
        ("StringPendulum", "pivot_z", 0.0, {"x_0": 0.66, "z_0": -0.5, "bounce": 0.1}),
        ("StringPendulum", "length", 1.0, {"x_0": 0.3, "z_0": -0.2, "bounce": 0.5}),
    ],
)
def test_what_is_missed_of_a_motion_goes_through_impacts(
    component: FmuPaths, name: str, port: str, offset: float, starts: dict[str, float]
) -> None:
    """Against 4000 steps, where 40 rad/s times a step is 0.02 and a quintic is off by (ωH)⁶/46080 < 1e-14."""
    motor = component("Sinusoid"), {"amplitude": 0.1, "angular_frequency": 40.0, "offset": offset}
    system = wired(f"motor.y -> body.{port}", motor=motor, body=(component(name), starts))
    first = "height" if name == "BouncingBall" else "z"
    exact = system.simulate(times=np.linspace(0, 2, 4001), tolerance=1e-11)[f"body.{first}"]
    for count in (20, 40, 400):
        run = system.simulate(times=np.linspace(0, 2, count + 1))
        z = run[f"body.{first}"]
        error = np.max(np.abs(z - exact[:: 4000 // count])) / np.max(np.abs(z))
        claimed = np.nansum(coupling_errors(run))
        assert claimed >= min(error, 1.0) / 2  # deviations of a random sign, in the mean over a step
        assert bool(run.warnings) == (count < 400)
        assert all(f"motor.y -> body.{port} is handed over" in text for text in run.warnings)
        assert any("too rarely" in text for text in run.warnings) == (count < 400)
        if count == 400:
            assert error < 1e-4
            assert claimed < 1e-4


def test_a_contact_that_is_not_reached_magnifies_nothing(component: FmuPaths) -> None:
    """Free fall, on a table that steps of 0.1 s know nothing of."""
    motor = component("Sinusoid"), {"amplitude": 0.1, "angular_frequency": 40.0}
    ball = component("BouncingBall"), {"height_0": 10.0}
    run = wired("motor.y -> ball.table", motor=motor, ball=ball).simulate(times=np.linspace(0, 1, 11))
    np.testing.assert_allclose(run["ball.height"], 10 - 9.81 / 2 * run.time**2, rtol=1e-9)
    assert run.warnings == ()
    assert not coupling_errors(run).any()


def test_steps_that_choose_their_size_follow_a_table(component: FmuPaths) -> None:
    """40 rad/s, where the default step is 0.01 s: the first bounce by bisection, at the parabola and the sine."""
    motor = component("Sinusoid"), {"amplitude": 0.1, "angular_frequency": 40.0}
    system = wired("motor.y -> ball.table", motor=motor, ball=(component("BouncingBall"), {"bounce": 0.5}))
    exact = system.simulate(times=np.linspace(0, 1, 4001), tolerance=1e-11)
    run = system.simulate(1.0, tolerance=1e-9)
    assert run["ball.gap_impacts"][-1] == exact["ball.gap_impacts"][-1] > 0
    assert abs(run["ball.height"][-1] - exact["ball.height"][-1]) < 1e-6  # a thousand times the tolerance
    assert run.warnings == ()


def test_errors_are_reflected_with_the_motion() -> None:
    """Straight flight at 1 m/s from 1.5 m, back at e: an error (x, v) after 1 s is e (x + v τ, v) τ later."""
    e, x, v, time = 0.4, 1.5e-6, 1e-6, np.arange(5.0)
    distance = np.where(time < 1.5, 1.5 - time, e * (time - 1.5))
    rows = np.array([distance, np.where(time < 1.5, -1, e), 0 * time, time > 1.5]).T
    ball = ContactMechanism("ball", np.array([[0, 1, 2, 3]]), frozenset())
    errors, doubtful = accumulated_errors(ball, rows, time, 0 * time, np.array([0, 1e-6, 0, 0, 0]), crossing=time < 0)
    assert doubtful == []
    # two deviations, relative to 1.5 m
    expected = [0, 2 * x / 1.5, *(2 * e * np.hypot(x, v * tau) / 1.5 for tau in (1, 2, 3))]
    np.testing.assert_allclose(errors, expected, rtol=1e-12)
    rows[1, :2] = 0.0  # a jump out of rest, which nothing is off before
    assert accumulated_errors(ball, rows, time, 0 * time, 0 * time, crossing=time < 0)[0].tolist() == [0.0] * 5
    rows[:, :2] *= 1e200  # a run that has diverged
    assert accumulated_errors(ball, rows, time, 0 * time, 0 * time, crossing=time < 0)[0].tolist() == [0.0] + [1.0] * 4


@pytest.mark.parametrize(("off", "doubts"), [(1e-9, 1), (1e-14, 0)])
def test_rounding_of_a_distance_is_no_doubt(off: float, doubts: int) -> None:
    """A distance of (t - 1.5)²/2 that touches 0 between points: shorter steps would tell, down to rounding."""
    time = np.arange(4.0)
    rows = np.array([(time - 1.5) ** 2 / 2, time - 1.5, 0 * time, 0 * time]).T
    ball = ContactMechanism("ball", np.array([[0, 1, 2, 3]]), frozenset())
    doubtful = accumulated_errors(ball, rows, time, np.full(4, off), 0 * time, crossing=time < 0)[1]
    assert [one.time for one in doubtful] == [2.0] * doubts


@pytest.mark.usefixtures("interruptible")
def test_interrupted_run_keeps_its_warnings(component: FmuPaths, caplog: pytest.LogCaptureFixture) -> None:
    """Whatever is logged: of the impulse that went missing at 0.247 s."""
    caplog.set_level(logging.ERROR, "liaisons.cosim")
    presses: list[float] = []

    def pressed(t: float) -> float:
        if t > 0.35 and not presses:
            presses.append(t)
            signal.raise_signal(signal.SIGINT)
        return 0.0

    with pytest.raises(Interrupted) as caught:
        _on_spring(component).simulate(
            stop_time=1.0, step_size=0.01, coupling="gauss-seidel", inputs={"ball.height_force": pressed}
        )
    kept = caught.value.result
    assert [text.split(" ball.table_force")[0] for text in kept.warnings] == ["wired: impulses do not go through"]
    assert np.flatnonzero(np.isnan(coupling_errors(kept))).tolist() == [25]
    assert 0.34 < kept.time[-1] < 1.0
    assert caplog.records == []
