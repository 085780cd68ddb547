"""FMUs with unilateral liaisons in systems: their Boolean and integer outputs, and their events in Model Exchange."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from making import exchange_only, wired

from liaisons import Coordinate, Parameter, System
from liaisons.fmu import build
from liaisons.mechanics import assemble
from liaisons.models import BouncingBall
from liaisons.results import Result

KEPT, HEIGHT, G = 0.5, 1.0, 9.81
SCALE = 1 + 2 * HEIGHT
"""Of the gap, at most."""
LOWEST = {"CoSimulation": 1e-12 * SCALE, "ModelExchange": 1e-8 * SCALE}
"""Bounces that are not summed: higher than rounding, or than the tolerance with which an importer knows them."""
RECORD = [f"ball.{name}" for name in ("gap_closed", "gap_impacts", "gap_impulse", "energy_balance")]
TIGHT = 1e-9
"""Of the energy; the tolerance of the FMU is 1e-8, its share in each step 2e-10."""


class WatchedBall(BouncingBall):
    """It falls from a height, and keeps half of its rate."""

    bounce = Parameter(KEPT, "1", "coefficient of restitution", minimum=0, maximum=1)
    height = Coordinate("m", "height of the ball", start=HEIGHT)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("contacts")


@pytest.fixture(scope="module", params=["CS 2", "CS 3", "ME 2", "ME 3"])
def ball(request: pytest.FixtureRequest, folder: Path) -> Path:
    kind, fmi = request.param.split()
    path = build(assemble(WatchedBall), folder, backend="native", fmi=fmi)
    if kind == "CS":
        return path
    target = folder / f"exchange{fmi}"
    target.mkdir()
    return exchange_only(path, target)


@pytest.fixture
def watched(ball: Path, fmu: Callable[[str], Path]) -> System:
    """A ball, and an FMU of another make that reads its integer and its Boolean: ``seen = level + 10 armed``."""
    links = ("ball.gap_impacts -> watch.level", "ball.gap_closed -> watch.armed")
    return wired(*links, ball=ball, watch=fmu("discrete"))


@pytest.mark.parametrize("step_size", [0.01, 0.1, 0.7])
def test_impacts_are_seen_at_every_step_size(ball: Path, step_size: float) -> None:
    """It falls for T = sqrt(2 h/g), bounces for 2 T e, 2 T e², ..., and rests after T (1 + e)/(1 - e)."""
    result = wired(ball=ball).simulate(stop_time=2.1, step_size=step_size, record=RECORD)
    fall = np.sqrt(2 * HEIGHT / G)
    rest, flying = fall * (1 + KEPT) / (1 - KEPT), result["ball.gap_closed"] == 0
    assert flying.tolist() == (result.time < rest).tolist()
    bounces = rest - 2 * fall * KEPT ** np.arange(1, 30) / (1 - KEPT)
    assert result["ball.gap_impacts"][flying].tolist() == np.searchsorted(bounces, result.time[flying]).tolist()
    kind = "ModelExchange" if ball.parent.name.startswith("exchange") else "CoSimulation"
    lowest = np.sqrt(2 * G * LOWEST[kind])  # its speed; those that are summed are a force, and no impulses
    assert 0 <= G * rest - result["ball.gap_impulse"][-1] <= 2 * lowest / (1 - KEPT)
    assert np.max(np.abs(result["ball.energy_balance"])) < TIGHT * G * HEIGHT


def test_types_are_connected_recorded_and_kept_in_files(watched: System, folder: Path) -> None:
    result = watched.simulate(stop_time=1.5, step_size=0.01)
    last = result["ball.gap_impacts"][-1]
    assert (result["ball.gap_closed"][-1], result["watch.seen"][-1]) == (1, last + 10)
    assert set(np.unique(result["ball.gap_closed"])) == {0, 1}
    result.to_csv(folder / "watched.csv")
    result.to_parquet(folder / "watched.parquet")
    for read in (Result.from_csv(folder / "watched.csv"), Result.from_parquet(folder / "watched.parquet")):
        for name in ("ball.gap_closed", "ball.gap_impacts"):
            assert read[name].tolist() == result[name].tolist()


def test_types_are_kept_in_archives(watched: System, folder: Path) -> None:
    watched.write_ssp(folder / "watched.ssp", form="full")
    again = System.from_ssp(folder / "watched.ssp")
    one, other = (system.simulate(stop_time=1.5, step_size=0.05) for system in (watched, again))
    for name in ("ball.gap_closed", "ball.gap_impacts", "watch.seen"):
        assert one[name].tolist() == other[name].tolist()


@pytest.mark.parametrize("step_size", [0.08, 0.04, 0.002])
def test_a_touch_that_steps_may_miss_is_found(component: Callable[[str], Path], step_size: float) -> None:
    """A table that meets a ball in flight by 10 µm, for a millisecond: a sine, a polynomial in each step."""
    amplitude, omega, phase, rate, stop = 0.02, 60.0, 0.5, 0.5, 0.08
    t = np.linspace(0, stop, 80001)
    start = -1e-5 - float(np.min(rate * t - G / 2 * t**2 - amplitude * np.sin(omega * t + phase)))
    system = wired("table.y -> ball.table", table=component("Sinusoid"), ball=component("BouncingBall"))
    values = {"table.amplitude": amplitude, "table.angular_frequency": omega, "table.phase": phase}
    values |= {"ball.height_0": start, "ball.height_dot_0": rate, "ball.bounce": KEPT}
    run = system.with_start_values(values).simulate(stop_time=stop, step_size=step_size, tolerance=1e-10, verify=True)
    assert not any("a contact may be missed" in warning for warning in run.warnings)
    assert len(run.time) == 1 + round(stop / step_size)  # steps are divided, the result is not
    first = int(np.argmax(rate * t - G / 2 * t**2 + start < amplitude * np.sin(omega * t + phase)))
    below, floor = rate - G * t[first], amplitude * omega * np.cos(omega * t[first] + phase)
    above, left = floor - KEPT * (below - floor), stop - t[first]
    after = start + rate * t[first] - G / 2 * t[first] ** 2 + above * left - G / 2 * left**2
    assert run.coupling_error is not None
    told = 3 * float(np.nansum(run.coupling_error)) * np.ptp(run["ball.gap"])  # the rates, of a polynomial of degree 5
    assert abs(start + rate * stop - G / 2 * stop**2 - after) > told
    np.testing.assert_allclose(run["ball.height"][-1], after, rtol=0, atol=1e-5 + told)  # read off to 1e-6 s
    assert run.errors is not None
    assert np.max(run.errors[run.names.index("ball.height")]) < 1e-5 + told  # what verifies it meets the table, too
