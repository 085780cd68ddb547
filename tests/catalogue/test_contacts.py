"""FMUs with contacts against their closed forms: Co-Simulation and Model Exchange, FMI 2.0 and 3.0.

Solvers run at 1e-13; what a bounce or a release amplifies in these runs stays below a factor of 100.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from making import exchange_only

from liaisons import System, flatten, operator
from liaisons.cosim import Result, simulate
from liaisons.models import BallRow, BeadOnSphere, BouncingBall, DryOscillator, Pendulum, Ramp, Sinusoid, StringPendulum

EXACT = 1e-10
TIGHT = 1e-13
INTERFACES = [("2", "CoSimulation"), ("3", "CoSimulation"), ("2", "ModelExchange"), ("3", "ModelExchange")]


def of_kind(kind: str, path: Path, folder: Path) -> Path:
    """The FMU without the interface that importers here would prefer."""
    return path if kind == "CoSimulation" else exchange_only(path, folder)


@pytest.fixture(params=INTERFACES, ids=lambda kind: f"FMI {kind[0]} {kind[1]}")
def of(request: pytest.FixtureRequest, fmu: Any, tmp_path: Path) -> Any:
    """An FMU in each of the interfaces."""
    version, kind = request.param
    return lambda component: of_kind(kind, fmu(component, fmi=version), tmp_path)


def run(path: Path, stop_time: float, step_size: float, **start: Any) -> Result:
    return simulate(path, stop_time=stop_time, step_size=step_size, tolerance=TIGHT, **start)


BELT = 0.2  # m/s
ROW = {"mass": [2.0, 1.0, 3.0], "bounce": 0.6}
RUNS: dict[str, tuple[Any, dict[str, Any], float, tuple[str, ...]]] = {
    "ball comes to rest": (BouncingBall, {}, 5.0, ("height", "impact_loss")),
    "ball on a table at 0.3 m": (
        BouncingBall,
        {"bounce": 0.5, "table": 0.3, "height_dot_0": -2.0, "gravity": 3.0},
        5.0,
        ("height", "impact_loss"),
    ),
    "bead, 1.3 m": (
        BeadOnSphere,
        {"radius": 1.3, "x_0": 1.3 * np.sin(0.8), "z_0": 1.3 * np.cos(0.8), "mass": 2.0},
        1.0,
        ("x", "z", "x_dot", "z_dot"),
    ),
    "string, one tug": (
        StringPendulum,
        {"x_0": 0.0, "z_0": -1.0, "x_dot_0": 4.6},
        3.0,
        ("x", "z", "x_dot", "z_dot", "impact_loss"),
    ),
    "stick-slip": (
        DryOscillator,
        {"mu_static": 0.2, "mu_sliding": 0.1, "belt_dot": BELT, "x_0": 0.0, "x_dot_0": BELT},
        20.0,
        ("x", "x_dot"),
    ),
    "row, unequal": (BallRow, ROW, 3.0, ("x", "x_dot")),
}


@pytest.mark.parametrize("case", RUNS)
def test_motion_is_its_closed_form(case: str, of: Any) -> None:
    component, start, stop_time, names = RUNS[case]
    driven = {"belt": lambda t: (BELT * t, BELT, 0.0)} if "belt_dot" in start else {}
    begin = {name: value for name, value in start.items() if name != "belt_dot"}
    result = run(of(component), stop_time, 0.037, record=[*names, "energy_balance"], inputs=driven, **begin)
    exact = component.exact(result.time, **start)
    for name in names:
        np.testing.assert_allclose(result[name], exact[name], rtol=0, atol=EXACT, err_msg=name)
    assert np.max(np.abs(result["energy_balance"])) < EXACT


def test_ball_rests_at_the_sum_of_all_bounces(of: Any, request: pytest.FixtureRequest) -> None:
    co_simulation = "CoSimulation" in request.node.name
    result = run(of(BouncingBall), 6.0, 0.01)
    rests_at = BouncingBall.rests_at()
    resting = run(of(BouncingBall), 6.0, 0.01, record="gap_rests_from")["gap_rests_from"][-1]
    # An importer that finds the events itself finds them 1e-13 m below the table, of bounces of 1e-12 m.
    assert resting == pytest.approx(rests_at, abs=EXACT if co_simulation else 2e-6)
    np.testing.assert_array_equal(result["gap_closed"] == 1, result.time >= rests_at)
    assert np.all(result["gap"] >= -1e-12)
    np.testing.assert_allclose(result["gap_force"][result.time > rests_at], 9.81, rtol=1e-12)


@pytest.mark.parametrize("ratio", [0.999, 1.001])
def test_ball_stays_on_a_shaken_table_up_to_the_acceleration_of_gravity(fmu: Any, ratio: float) -> None:
    shaken: Any = {"amplitude": ratio * 9.81 / 49, "angular_frequency": 7.0}
    table: Any = operator("Sinusoid", **shaken)
    start = {"height_0": 0.0, "height_dot_0": 7 * shaken["amplitude"]}
    leaves = BouncingBall.leaves_at(**shaken)
    result = run(fmu(BouncingBall), 2.0, 0.001, table=table, **start)
    closed = result["gap_closed"] == 1
    if ratio < 1:
        assert np.all(closed)
        assert np.all(result["gap_force"] > 0)
    else:
        assert result.time[~closed][0] == pytest.approx(leaves, abs=1.0001e-3)


def test_ball_that_rests_does_so_for_ever(of: Any) -> None:
    """It has no further impact in 10⁶ s."""
    result = run(of(BouncingBall), 1e6, 1e4)
    rests = result.time > 0
    assert np.all(result["gap_closed"][rests] == 1)
    np.testing.assert_array_equal(result["gap_impacts"][rests], result["gap_impacts"][-1])
    assert np.all(result["gap"] >= -1e-12)
    assert np.max(np.abs(result["energy_balance"])) < EXACT


@pytest.fixture(scope="module", params=INTERFACES, ids=lambda kind: f"FMI {kind[0]} {kind[1]}")
def shaken(request: pytest.FixtureRequest, fmu: Any, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Ball and shaken table as one FMU."""
    version, kind = request.param
    system = System("shaken")
    shaker = system.add("shaker", fmu(Sinusoid), angular_frequency=10.0)
    system.connect(shaker["y"], system.add("ball", fmu(BouncingBall), height_0=0.0)["table"])
    built = flatten(system, tmp_path_factory.mktemp("shaken"), fmi=version)
    return of_kind(kind, built, tmp_path_factory.mktemp("exchange"))


@pytest.mark.parametrize("start", [0.0, 1e3])
@pytest.mark.parametrize("ratio", [0.9, 1.1])
def test_ball_on_a_shaken_table_for_hundred_seconds(shaken: Path, ratio: float, start: float) -> None:
    """It does not chatter: it lies still, or has as many impacts in each period as in the others."""
    amplitude = ratio * 9.81 / 100
    place, speed = amplitude * np.sin(10 * start), amplitude * 10 * np.cos(10 * start)
    values = {"shaker.amplitude": amplitude, "ball.height_0": place, "ball.height_dot_0": speed}
    times = start + np.arange(160) * np.pi / 5
    result = simulate(shaken, times=times, tolerance=TIGHT, start_values=values)
    assert np.all(result["ball.gap"] >= -1e-12)
    assert np.all(np.diff(result["ball.impact_loss"]) >= 0)
    assert np.max(np.abs(result["ball.energy_balance"])) < 1e-9  # of the work of 160 periods, 2 J each
    if ratio < 1:
        assert np.all(result["ball.gap_closed"] == 1)
        assert np.all(result["ball.gap_impacts"] == 0)
    else:
        each = np.diff(result["ball.gap_impacts"])[1:]
        assert np.ptp(each) == 0, each  # those that rounding decides on are too low to be counted
        assert 10 < each[0] < 30


def test_ball_at_rest_is_hit_by_a_table_that_starts_to_rise(fmu: Any, tmp_path: Path) -> None:
    """Inside a step, as one FMU: at 1 m/s from 0.25 s on, e = 0.5; the loss is m (1 - e²)/2 v²."""
    system = System("lifted")
    lift = system.add("lift", fmu(Ramp), start_time=0.25)
    ball = system.add("ball", fmu(BouncingBall), height_0=0.0, bounce=0.5)
    system.connect(lift["y"], ball["table"])
    result = run(flatten(system, tmp_path), 0.3, 0.3)
    assert result["ball.height"][-1] == pytest.approx(1.5 * 0.05 - 9.81 / 2 * 0.05**2, abs=1e-14)
    assert result["ball.impact_loss"][-1] == pytest.approx(0.75 / 2, rel=1e-12)


@pytest.mark.parametrize("start", [1e5, 1e7])
def test_ball_on_a_shaken_table_where_the_clock_is_coarse(shaken: Path, start: float) -> None:
    """The table moves at 1 m/s, and so 2e-9 m between two instants that the clock can tell apart at 10⁷ s."""
    amplitude = 1.1 * 9.81 / 100
    place, speed = amplitude * np.sin(10 * start), amplitude * 10 * np.cos(10 * start)
    values = {"shaker.amplitude": amplitude, "ball.height_0": place, "ball.height_dot_0": speed}
    result = simulate(shaken, times=start + np.arange(300.0), start_values=values)
    assert np.all(result["ball.gap"] >= -10 * np.spacing(start))
    assert np.max(np.abs(result["ball.energy_balance"])) < 1e-4
    assert result["ball.gap_impacts"][-1] > 1000


def test_string_that_stays_taut_is_the_pendulum(of: Any) -> None:
    start = {"x_0": np.sin(1.2), "z_0": -np.cos(1.2)}
    result = run(of(StringPendulum), 5.0, 0.05, record=["x", "z", "slack_force"], **start)
    exact = Pendulum.exact(result.time, theta_0=1.2)
    np.testing.assert_allclose(np.arctan2(result["x"], -result["z"]), exact["theta"], rtol=0, atol=EXACT)
    np.testing.assert_allclose(result["slack_force"], exact["tension"], rtol=0, atol=1e-11)


@pytest.mark.parametrize("bounce", [0.0, 0.5, 1.0])
def test_operator_who_pulls_the_string_taut_gives_the_work_of_the_tug(of: Any, bounce: float) -> None:
    """Without weight, at rest at 0.75 m; the string is drawn in at v = 0.5 m/s: speed (1 + e) v, work m (1 + e) v²."""
    start = {"x_0": 0.0, "z_0": -0.75, "gravity": 0.0, "bounce": bounce, "mass": 2.0}
    drawn = {"length": lambda t: (1 - 0.5 * t, -0.5, 0.0)}
    names = ["z_dot", "work", "impact_loss", "length_impulse"]
    result = run(of(StringPendulum), 0.8, 0.01, inputs=drawn, record=names, **start)
    after = result.time > 0.5
    np.testing.assert_allclose(result["z_dot"][after], (1 + bounce) * 0.5, rtol=0, atol=EXACT)
    np.testing.assert_allclose(result["work"][after], 2 * (1 + bounce) * 0.25, rtol=0, atol=EXACT)
    np.testing.assert_allclose(result["impact_loss"][after], 0.25 * (1 - bounce**2), rtol=0, atol=EXACT)
    np.testing.assert_allclose(result["length_impulse"][after], -2 * (1 + bounce) * 0.5, rtol=0, atol=EXACT)


def test_marks_of_stick_slip(of: Any) -> None:
    friction = {"mu_static": 0.2, "mu_sliding": 0.1}
    sticking, sliding = DryOscillator.stick_slip(belt_dot=BELT, **friction)
    driven = {"belt": lambda t: (BELT * t, BELT, 0.0)}
    result = run(of(DryOscillator), 20.0, 0.001, inputs=driven, x_0=0.0, x_dot_0=BELT, **friction)
    changes = np.diff(result.time[1:][np.diff(result["slip_sticks"]) != 0])
    np.testing.assert_allclose(changes[0::2], sliding, rtol=0, atol=1.0001e-3)
    np.testing.assert_allclose(changes[1::2], sticking, rtol=0, atol=1.0001e-3)
