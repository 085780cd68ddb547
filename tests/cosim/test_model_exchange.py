"""FMUs of Model Exchange: equations of others, solved here through all events, alone and in systems."""

from __future__ import annotations

import re
import sys
from pathlib import Path
from zipfile import ZipFile

import fmpy
import numpy as np
import pytest
from making import FmuPaths, packed, wired
from numpy.typing import NDArray

from liaisons import simulate, sweep
from liaisons.errors import SimulationError
from liaisons.results import IncompleteError

HERE = Path(__file__).parent
G, KEPT = 9.81, 0.7
TIGHT = 1e-7
"""A hundred times the tolerance of 1e-10 or less, for errors that add up, times the speed at a bounce of 5 m/s."""


@pytest.fixture(scope="module", params=[2, 3], ids=["FMI 2.0", "FMI 3.0"])
def ball(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The FMU of ball.c."""
    platform = fmpy.platform if request.param == 2 else fmpy.platform_tuple
    code = ("" if request.param == 2 else "#define FMI3\n") + (HERE / "ball.c").read_text()
    description = (HERE / f"ball{request.param}.xml").read_text()
    return packed(tmp_path_factory.mktemp("exchange"), "Ball", code, description, platform)


def heights(times: NDArray) -> tuple[NDArray, NDArray]:
    """Height [m], and number of bounces, of a ball that falls from 1 m."""
    found = [(1.0 - G / 2 * t**2, 0) for t in times]
    begin, speed, count = np.sqrt(2 / G), KEPT * np.sqrt(2 * G), 1
    while begin <= times[-1]:
        since = times - begin
        for k in np.flatnonzero(since >= 0):
            found[k] = (speed * since[k] - G / 2 * since[k] ** 2, count)
        begin, speed, count = begin + 2 * speed / G, KEPT * speed, count + 1
    return np.array([h for h, _ in found]), np.array([n for _, n in found])


def exchange_only(path: Path, folder: Path) -> Path:
    """The FMU without its Co-Simulation."""
    return copied(path, folder, rb"<CoSimulation\b([^>]*/>|.*?</CoSimulation>)")


def copied(path: Path, folder: Path, without: bytes) -> Path:
    """The FMU, its model description without what fits a pattern."""
    with ZipFile(path) as source, ZipFile(folder / path.name, "w") as target:
        for name in source.namelist():
            content = source.read(name)
            if name == "modelDescription.xml":
                content = re.sub(without, b"", content, flags=re.DOTALL)
            target.writestr(name, content)
    return folder / path.name


def test_ball_bounces_when_it_has_to(ball: Path) -> None:
    result = simulate(ball, stop_time=2.5)
    height, bounces = heights(result.time)
    np.testing.assert_allclose(result["h"], height, atol=TIGHT)
    assert result["bounces"].tolist() == bounces.tolist()


def test_without_a_step_it_is_looked_at_500_times(ball: Path, tmp_path: Path) -> None:
    silent = copied(ball, tmp_path, rb' stepSize="0.01"')
    result = simulate(silent, stop_time=2.5)
    assert len(result.time) == 501
    np.testing.assert_allclose(result["h"], heights(result.time)[0], atol=TIGHT)


def test_time_events_belong_to_the_communication_point_that_they_fall_on(ball: Path) -> None:
    result = simulate(ball, stop_time=2.5, step_size=0.1)
    assert result["ticks"].tolist() == [k // 5 for k in range(26)]


def test_an_indicator_that_begins_at_0_is_seen_to_rise(ball: Path) -> None:
    result = simulate(ball, stop_time=0.1, h=0.0, v=1.0)
    assert result["above"].tolist() == [0.0] + [1.0] * 10


@pytest.mark.parametrize("eager", [False, True])
def test_steps_are_completed_and_may_be_events(ball: Path, eager: bool) -> None:
    result = simulate(ball, stop_time=0.4, eager=eager, record=["h", "steps"])
    assert result["steps"][-1] >= 40
    np.testing.assert_allclose(result["h"], heights(result.time)[0], atol=TIGHT)


def test_an_fmu_that_ends_the_simulation_ends_it(ball: Path) -> None:
    result = simulate(ball, last=0.125)
    np.testing.assert_allclose(result.time, [*np.arange(13) * 0.01, 0.125], rtol=1e-15)
    np.testing.assert_allclose(result["h"], heights(result.time)[0], atol=TIGHT)


def test_one_that_ends_at_once_has_no_points(ball: Path) -> None:
    assert not simulate(ball, last=0.0).time.size


def test_real_input_is_followed_or_held_over_a_step(ball: Path, fmu: FmuPaths) -> None:
    """h'' = t³ - g: h' = t⁴/4 - g t; held, t³ is that at the end of each step of 0.01 s: Σ t³ H - g t."""
    system = wired("cubic.y -> ball.push", cubic=fmu("cubic"), ball=(ball, {"h": 1000.0}))
    followed, held = (system.simulate(1.0, 0.01, tolerance=1e-10, coupling=kind) for kind in (None, "gauss-seidel"))
    t = held.time
    np.testing.assert_allclose(followed["ball.v"], t**4 / 4 - G * t, atol=TIGHT)
    np.testing.assert_allclose(held["ball.v"], np.cumsum(held["cubic.y"]) * 0.01 - G * t, atol=TIGHT)


def test_alone_in_its_process_it_gives_the_same_bits(ball: Path) -> None:
    assert np.array_equal(simulate(ball).values, simulate(ball, isolated=True).values)


def test_boolean_input_is_an_event(ball: Path, fmu: FmuPaths) -> None:
    """Pulled from t = 0.5 s on: given over the step that ends later, for the first time over that to 0.75 s."""
    system = wired("switch.late -> ball.pulled", switch=fmu("discrete"), ball=(ball, {"h": 9.0, "pulled": False}))
    result = system.simulate(1.0, 0.25, tolerance=1e-10)
    np.testing.assert_allclose(result["ball.v"], [0, 0, 0, -G / 4, -G / 2], atol=TIGHT)


def test_steps_of_adapted_size_go_back(ball: Path) -> None:
    system = wired(ball=ball)
    result = system.simulate(2.5, 0.1, error_tolerance=1e-5, tolerance=1e-10)
    np.testing.assert_allclose(result["ball.h"], heights(result.time)[0], atol=TIGHT)


def test_sweep_gives_the_bits_of_single_runs(ball: Path) -> None:
    starts = [0.5, 1.0, 2.0]
    swept = sweep(ball, {"h": starts, "last": [9.0] * 3}, ["v", "bounces"], workers=1)
    for k, h in enumerate(starts):
        alone = simulate(ball, h=h, last=9.0)
        assert (swept["v"][k], swept["bounces"][k]) == (alone["v"][-1], alone["bounces"][-1])


def test_what_is_refused_is_said(ball: Path) -> None:
    with pytest.raises(
        IncompleteError, match=r"Ball: fmi\d\w+Derivatives at t = .* returned Discard: t is beyond"
    ) as it:
        simulate(ball, limit=0.5)
    assert it.value.result.time[-1] == pytest.approx(0.5)
    with pytest.raises(SimulationError, match="Ball: its event iteration at t = 0 s has no end"):
        simulate(ball, endless=True)


def test_without_the_solver_it_is_named(ball: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "liaisons.cosim.instances.cvode", None)
    with pytest.raises(SimulationError, match="Model Exchange needs CVODE, which FMPy does not have here"):
        simulate(ball)


@pytest.mark.parametrize("name", ["Pendulum", "fmi3/Pendulum"])
def test_pendulum_moves_as_in_co_simulation(component: FmuPaths, tmp_path: Path, name: str) -> None:
    path = component(name)
    exchange, simulated = (
        simulate(kind, stop_time=5.0, step_size=0.05, tolerance=1e-10, theta_0=1.2)
        for kind in (exchange_only(path, tmp_path), path)
    )
    np.testing.assert_allclose(exchange["theta"], simulated["theta"], atol=TIGHT)
    np.testing.assert_allclose(exchange["energy_balance"], 0, atol=10 * TIGHT)  # energies of 10 J


@pytest.mark.parametrize("name", ["Pendulum", "fmi3/Pendulum"])
def test_coupling_repeats_its_steps(component: FmuPaths, tmp_path: Path, name: str) -> None:
    """Force and motion at once, as between two of Co-Simulation: of second order, 7e-5 at H = 5 ms."""
    path = component(name)
    only = exchange_only(path, tmp_path)

    def angles(upper: Path, size: float) -> NDArray:
        starts = {"theta_0": 1.2}, {"theta_0": -0.6, "mass": 0.5}
        system = wired("upper.bob -> lower.pivot", upper=(upper, starts[0]), lower=(path, starts[1]))
        return system.simulate(0.5, size, tolerance=1e-9)["lower.theta"][-1]

    exact = angles(path, 0.01)
    coarse, fine = (abs(angles(only, size) - exact) for size in (0.02, 0.01))
    assert fine < 1e-3
    assert coarse / fine == pytest.approx(4, rel=0.2)  # terms of higher order, rate · H < 0.1
