"""FMUs of Model Exchange: equations of others, solved here through all events, alone and in systems."""

from __future__ import annotations

import sys
from pathlib import Path

import fmpy
import numpy as np
import pytest
from equations import equations
from making import FmuPaths, copied, exchange_only, packed, wired
from numpy.testing import assert_allclose
from numpy.typing import NDArray

from liaisons import System, simulate, sweep
from liaisons.errors import SimulationError
from liaisons.model_exchange import dop853
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


def test_ball_bounces_when_it_has_to(ball: Path) -> None:
    result = simulate(ball, stop_time=2.5)
    height, bounces = heights(result.time)
    assert_allclose(result["h"], height, rtol=0, atol=TIGHT)
    assert result["bounces"].tolist() == bounces.tolist()


def test_without_a_step_it_is_looked_at_500_times(ball: Path, tmp_path: Path) -> None:
    silent = copied(ball, tmp_path, rb' stepSize="0.01"')
    result = simulate(silent, stop_time=2.5)
    assert len(result.time) == len(simulate(silent, start_time=1.0, stop_time=2.5).time) == 501
    assert_allclose(result["h"], heights(result.time)[0], rtol=0, atol=TIGHT)


@pytest.mark.parametrize("parts", [5, 49])
def test_time_events_belong_to_the_communication_point_that_they_fall_on(ball: Path, parts: int) -> None:
    result = simulate(ball, stop_time=2.5, step_size=0.5 / parts)  # 49 of which are less than 0.5, by rounding
    assert result["ticks"].tolist() == [k // parts for k in range(5 * parts + 1)]


def test_an_indicator_that_begins_at_0_is_seen_to_rise(ball: Path) -> None:
    result = simulate(ball, stop_time=0.1, h=0.0, v=1.0)
    assert result["above"].tolist() == [0.0] + [1.0] * 10


@pytest.mark.parametrize("eager", [False, True])
def test_steps_are_completed_and_may_be_events(ball: Path, eager: bool) -> None:
    result = simulate(ball, stop_time=0.4, eager=eager, record=["h", "steps"])
    assert result["steps"][-1] >= 40
    assert_allclose(result["h"], heights(result.time)[0], rtol=0, atol=TIGHT)


def test_an_fmu_that_ends_the_simulation_ends_it(ball: Path) -> None:
    result = simulate(ball, last=0.125)
    assert_allclose(result.time, [*np.arange(13) * 0.01, 0.125], rtol=1e-15)
    assert_allclose(result["h"], heights(result.time)[0], rtol=0, atol=TIGHT)


def test_one_that_ends_at_once_has_no_points(ball: Path) -> None:
    assert not simulate(ball, last=0.0).time.size


def test_real_input_is_followed_or_held_over_a_step(ball: Path, fmu: FmuPaths) -> None:
    """h'' = t³ - g: h' = t⁴/4 - g t; held, t³ is that at the end of each step of 0.01 s: Σ t³ H - g t."""
    system = wired("cubic.y -> ball.push", cubic=fmu("cubic"), ball=(ball, {"h": 1000.0}))
    followed, held = (system.simulate(1.0, 0.01, tolerance=1e-10, coupling=kind) for kind in (None, "gauss-seidel"))
    t = held.time
    assert_allclose(followed["ball.v"], t**4 / 4 - G * t, rtol=0, atol=TIGHT)
    assert_allclose(held["ball.v"], np.cumsum(held["cubic.y"]) * 0.01 - G * t, rtol=0, atol=TIGHT)


def test_alone_in_its_process_it_gives_the_same_bits(ball: Path) -> None:
    assert np.array_equal(simulate(ball).values, simulate(ball, isolated=True).values)


def test_boolean_input_is_an_event(ball: Path, fmu: FmuPaths) -> None:
    """Pulled from t = 0.5 s on: given over the step that ends later, for the first time over that to 0.75 s."""
    system = wired("switch.late -> ball.pulled", switch=fmu("discrete"), ball=(ball, {"h": 9.0, "pulled": False}))
    result = system.simulate(1.0, 0.25, tolerance=1e-10)
    assert_allclose(result["ball.v"], [0, 0, 0, -G / 4, -G / 2], rtol=0, atol=TIGHT)


def test_steps_of_adapted_size_go_back(ball: Path) -> None:
    system = wired(ball=ball)
    result = system.simulate(2.5, 0.1, error_tolerance=1e-5, tolerance=1e-10)
    assert_allclose(result["ball.h"], heights(result.time)[0], rtol=0, atol=TIGHT)


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
    with pytest.raises(SimulationError, match="Ball: its event iteration at t = 0 s does not end"):
        simulate(ball, endless=True)


def test_without_a_solver_it_is_named(ball: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(dop853, "library", lambda: None)
    assert simulate(ball, stop_time=2.5)["bounces"][-1] == heights(np.array([2.5]))[1]  # by CVODE
    monkeypatch.setitem(sys.modules, "liaisons.model_exchange.cvode", None)
    with pytest.raises(SimulationError, match="needs a C compiler, or CVODE, which FMPy does not have here"):
        simulate(ball)


STIFF = {
    # y' = -k (y - cos t) - sin t, y(0) = 1: y = cos t (Dahlquist; Prothero and Robinson)
    "Dahlquist": (1, {"start": "x[0] = 1;", "rates": "f[0] = -1e6 * (x[0] - cos(t)) - sin(t);"}, 2.0, [np.cos(2.0)]),
    # Test Set for IVP Solvers, VDPOL, ε = 1e-6, whose unit of time is 1000 of ours
    "Van der Pol": (
        2,
        {"start": "x[0] = 2;", "rates": "f[0] = x[1]; f[1] = 1000 * (1 - x[0] * x[0]) * x[1] - x[0];"},
        2000.0,
        [1.706167732170483, -0.8928097010247975e-3],
    ),
    # Test Set for IVP Solvers, ROBER, and the sum of all is 1
    "Robertson": (
        3,
        {
            "start": "x[0] = 1;",
            "nominals": "nominal[1] = 1e-5;",
            "rates": "f[0] = -0.04 * x[0] + 1e4 * x[1] * x[2]; f[2] = 3e7 * x[1] * x[1]; f[1] = -f[0] - f[2];",
        },
        40.0,
        [0.7158270688, 0.9185534765e-5, 0.2841637457],
    ),
}


@pytest.mark.parametrize("name", STIFF)
def test_stiff_equations_are_seen_to_be_so(tmp_path: Path, caplog: pytest.LogCaptureFixture, name: str) -> None:
    states, code, end, exact = STIFF[name]
    with caplog.at_level("INFO", logger="liaisons.cosim"):
        result = simulate(equations(tmp_path, states, **code), stop_time=end, step_size=end / 20, tolerance=1e-9)
    for k, value in enumerate(exact):
        assert result[f"x{k}"][-1] == pytest.approx(value, rel=1e-6)  # tolerance · steps
    assert [record.message.partition(" at t")[0] for record in caplog.records] == ["x: its equations are stiff"]


def test_equations_that_are_not_stiff_need_no_other_solver(
    tmp_path: Path, caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    """An oscillator of 1 Hz in steps of 30 s, and one that is let go at t = 1 s."""
    monkeypatch.setitem(sys.modules, "liaisons.model_exchange.cvode", None)
    rates = "f[0] = x[1]; f[1] = -x[0] * 39.47841760435743;"
    result = simulate(equations(tmp_path, 2, start="x[0] = 1;", rates=rates), stop_time=90.0, step_size=30.0)
    assert_allclose(result["x0"], 1.0, rtol=0, atol=1e-5)
    assert not caplog.records


@pytest.fixture(params=["DOP853", "CVODE"])
def either_solver(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> None:
    if request.param == "CVODE":
        monkeypatch.setattr(dop853, "library", lambda: None)


@pytest.mark.usefixtures("either_solver")
def test_errors_are_measured_by_nominal_values(tmp_path: Path) -> None:
    """A charge of 1e-9 C that comes and goes: an error of tolerance · 1 C would leave nothing of it."""
    rates = "f[0] = 1e-9 * 2 * t * cos(t * t);"
    fmu = equations(tmp_path, 1, rates=rates, nominals="nominal[0] = 1e-9;")
    result = simulate(fmu, stop_time=4.0, step_size=4.0, tolerance=1e-7)
    assert result["x0"][-1] == pytest.approx(1e-9 * np.sin(16.0), abs=1e-9 * 1e-5)


@pytest.mark.parametrize("nominal", ["0", "-1", "NAN", "INFINITY"])
def test_nominal_values_that_are_none_are_said(tmp_path: Path, caplog: pytest.LogCaptureFixture, nominal: str) -> None:
    fmu = equations(
        tmp_path, 2, start="x[0] = 1;", rates="f[0] = -x[0]; f[1] = 0;", nominals=f"nominal[0] = {nominal};"
    )
    result = simulate(fmu, stop_time=1.0, step_size=0.1)
    assert_allclose(result["x0"], np.exp(-result.time), rtol=0, atol=TIGHT)
    assert len(caplog.records) == 1
    assert "x: nominal values of continuous states are not above 0" in caplog.text


@pytest.mark.parametrize("time", ["0.3 - 1e-3", "NAN", "-INFINITY"])
def test_the_next_event_is_not_in_the_past(tmp_path: Path, time: str) -> None:
    event = f"info->nextEventTimeDefined = 1; info->nextEventTime = t < 0.25 ? 0.3 : {time};"
    fmu = equations(tmp_path, 1, rates="f[0] = 1;", event=event)
    with pytest.raises(
        IncompleteError, match=r"x: its next event at t = 0.3 s is to be at \S+ s, which is not later"
    ) as it:
        simulate(fmu, stop_time=1.0, step_size=0.1)
    assert (np.diff(it.value.result.time) > 0).all()


@pytest.mark.usefixtures("either_solver")
def test_an_event_by_a_jump_of_an_input_is_one(tmp_path: Path) -> None:
    """It counts how often u - 0.5 has changed its sign; u is held, and jumps at t = 0.3, 0.6."""
    fmu = equations(
        tmp_path,
        1,
        1,
        rates="f[0] = memory[0];",
        indicators_of="z[0] = u - 0.5;",
        event="if ((u > 0.5) != (memory[1] > 0)) memory[0]++, memory[1] = u > 0.5;",
        output="y = memory[0];",
    )
    pulse = {"u": lambda t: float(0.25 < t < 0.55)}
    assert simulate(fmu, stop_time=1.0, step_size=0.1, coupling="gauss-seidel", inputs=pulse)["y"][-1] == 2.0


def test_indicators_that_change_twice_within_a_step_are_seen(tmp_path: Path) -> None:
    """sin t is above 0.95 from t = 1.25 to 1.89 s, within the only step."""
    fmu = equations(
        tmp_path,
        1,
        1,
        rates="f[0] = cos(t);",
        indicators_of="z[0] = x[0] - 0.95;",
        event="memory[x[0] > 0.95 ? 0 : 1] = t;",
        output="y = memory[0];",
    )
    result = simulate(fmu, stop_time=2.5, step_size=2.5, tolerance=1e-3)
    assert result["y"][-1] == pytest.approx(np.arcsin(0.95), abs=1e-7)


@pytest.mark.parametrize(
    ("code", "words"),
    [
        ({"rates": "f[0] = NAN;"}, "the derivative of continuous state 1 is nan at t = 0 s"),
        ({"rates": "f[0] = t > 0.45 ? INFINITY : 0;"}, r"the derivative of continuous state 1 is inf at t = 0\.45"),
        ({"rates": "f[0] = 0; if (t > 0.45) return 2;"}, r"fmi2GetDerivatives at t = 0\.45 s returned Discard"),
        ({"rates": "f[0] = x[0] > 0.5 ? -1 : 1;"}, r"more than 100000 steps and events from t = 0\.5 s"),
        ({"event": "info->nextEventTimeDefined = 1; info->nextEventTime = t;"}, "more than 1000 events or steps"),
    ],
)
def test_what_cannot_be_integrated_is_said(tmp_path: Path, code: dict[str, str], words: str) -> None:
    with pytest.raises(SimulationError, match=f"^x: {words}"):
        simulate(equations(tmp_path, 1, 0, **code), stop_time=1.0, step_size=0.1)


@pytest.mark.parametrize("count", [-5, 10**19])
def test_numbers_of_indicators_that_cannot_be_are_refused(tmp_path: Path, count: int) -> None:
    with pytest.raises(SimulationError, match=f"^x: says that it has {count} event indicators; ask its maker"):
        simulate(equations(tmp_path, 1, count, rates="f[0] = 0;"), stop_time=1.0, step_size=0.1)


def test_cvode_integrates_through_events_in_a_process_of_its_own(ball: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    explicit = simulate(ball, stop_time=2.5)
    monkeypatch.setattr(dop853, "library", lambda: None)
    result = simulate(ball, stop_time=2.5, isolated=True)
    assert_allclose(result["h"], heights(result.time)[0], rtol=0, atol=1e-5)  # tolerance 1e-8 of the FMU · 1000
    assert not np.array_equal(result["h"], explicit["h"])


def test_steps_that_cvode_repeats_are_warned_of_once(
    component: FmuPaths, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """And only where they are: not without a cycle, where nothing is repeated."""
    monkeypatch.setattr(dop853, "library", lambda: None)
    only = exchange_only(component("Pendulum"), tmp_path)
    system = System("two")
    upper, lower = (system.add(name, only, theta_0=0.1) for name in ("upper", "lower"))
    assert not system.simulate(0.2, 0.05).warnings
    system.connect(upper["bob"], lower["pivot"])
    result = system.simulate(0.2, 0.05, coupling="implicit")
    said = [text for text in result.warnings if "CVODE, which cannot go back" in text]
    assert [text.partition(":")[0] for text in said] == ["upper", "lower"]
