"""What inputs hold when, what is recorded, and how instances live and die."""

from __future__ import annotations

import math
import signal
import tempfile
from collections import Counter
from collections.abc import Iterable
from contextlib import nullcontext
from pathlib import Path
from typing import Any, Literal

import numpy as np
import pytest
from making import FmuPaths, Trace, wired
from numpy.testing import assert_allclose, assert_array_equal

from liaisons.cosim import IncompleteError, Interrupted, System, simulate
from liaisons.errors import SimulationError
from liaisons_tools.sweeps import sweep

Coupling = Literal["gauss-seidel", "jacobi"]

# powers of two: times and cubes of them are exact in double precision, so equality can be asked for
H = 0.25
T = np.arange(5) * H


def _driven(fmu: FmuPaths, mode: int, names: Iterable[str] = ("cubic", "spring")) -> System:
    parts = {"cubic": (fmu("Cubic"), {}), "spring": (fmu("Spring"), {"input_reconstruction": mode})}
    return wired("cubic.y -> spring.length", **{name: parts[name] for name in names})


@pytest.mark.parametrize("names", [("cubic", "spring"), ("spring", "cubic")])
@pytest.mark.parametrize(
    ("mode", "coupling", "lag"),
    [(0, "gauss-seidel", 1), (1, "gauss-seidel", 1), (2, "gauss-seidel", 0), (0, "jacobi", 1), (1, "jacobi", 1)],
)
def test_step_begins_with_inputs_at_t_or_at_its_end_and_all_that_is_recorded_is_of_one_instant(
    fmu: FmuPaths, mode: int, coupling: Coupling, lag: int, names: tuple[str, str]
) -> None:
    result = _driven(fmu, mode, names).simulate(2.0, H, start_time=1.0, coupling=coupling)
    t = 1 + T
    given_at = t[1:] - lag * H
    assert_array_equal(result["spring.seen"][1:], given_at**3)
    assert_array_equal(result["spring.seen_dot"][1:], 3 * given_at**2)
    assert_array_equal(result.time, t)
    assert_array_equal(result["cubic.y"], t**3)
    assert_array_equal(result["spring.length"], t**3)
    assert_array_equal(result["spring.length_ddot"], 6 * t)
    assert_array_equal(result["spring.length_force"], 2 * t**3)  # depends directly on the input


def test_other_start_values_are_those_of_another_system(fmu: FmuPaths) -> None:
    system = _driven(fmu, 1)
    other = system.with_start_values({"spring.input_reconstruction": 0})
    assert [s.parts["spring"].starts["input_reconstruction"] for s in (system, other)] == [1, 0]
    assert_array_equal(other.simulate(1.0, H)["cubic.y"], system.simulate(1.0, H)["cubic.y"])
    with pytest.raises(SimulationError, match="no component 'sprin'; did you mean 'spring'"):
        system.with_start_values({"sprin.x": 1.0})
    with pytest.raises(SimulationError, match="spring"):
        system.with_start_values({"spring.nothing": 1.0})


def test_interpolation_needs_its_source_to_be_stepped_first(fmu: FmuPaths) -> None:
    with pytest.raises(SimulationError, match=r"spring: input_reconstruction=2 .* cubic\.y .*coupling='gauss-seidel'"):
        _driven(fmu, 2).simulate(1.0, H, coupling="jacobi")
    alone = wired(spring=(fmu("Spring"), {"input_reconstruction": 2}))
    with pytest.raises(SimulationError, match=r"spring: input_reconstruction=2 .* a function of time .*'gauss-seidel'"):
        alone.simulate(1.0, H, coupling="jacobi", inputs={"spring.length": lambda t: (t**3, 3 * t**2, 6 * t)})
    system = _ring(fmu, mass_mode=2)
    with pytest.raises(SimulationError, match=r"mass: input_reconstruction=2 .* spring\.length_force .* cycle"):
        system.simulate(1.0, H)


@pytest.mark.parametrize(("coupling", "lag"), [("gauss-seidel", 0), ("jacobi", 1)])
def test_fmu_of_another_make_is_given_the_newest_value(fmu: FmuPaths, coupling: Coupling, lag: int) -> None:
    result = wired("cubic.y -> probe.u", probe=fmu("Probe"), cubic=fmu("Cubic")).simulate(1.0, H, coupling=coupling)
    assert_array_equal(result["probe.seen"][1:], (T[1:] - lag * H) ** 3)
    assert_array_equal(result["probe.echo"], T**3)


@pytest.mark.parametrize("names", [("cubic", "first", "second"), ("second", "first", "cubic")])
def test_values_run_through_direct_dependencies_at_initialization_and_after(
    fmu: FmuPaths, names: tuple[str, ...], trace: Trace
) -> None:
    parts = {name: fmu("Cubic" if name == "cubic" else "Probe") for name in names}
    system = wired("cubic.y -> first.u", "first.echo -> second.u", **parts)
    result = system.simulate(2.0, H, start_time=1.0)
    assert_array_equal(result["second.echo"], (1 + T) ** 3)
    assert trace().index("second set") < trace().index("second exit")  # consistent before initialization ends


def _ring(fmu: FmuPaths, mass_mode: int = 1) -> System:
    mass = fmu("Mass"), {"q_0": 1.0, "input_reconstruction": mass_mode}
    return wired("mass.q -> spring.length", mass=mass, spring=fmu("Spring"))


@pytest.mark.parametrize("coupling", ["gauss-seidel", "jacobi"])
def test_cycle_is_consistent_where_no_loop_is_algebraic(fmu: FmuPaths, coupling: Coupling) -> None:
    result = _ring(fmu).simulate(5.0, 0.1, coupling=coupling)
    assert_array_equal(result["spring.length"], result["mass.q"])
    assert_array_equal(result["spring.length_force"], 2 * result["mass.q"])
    assert_array_equal(result["mass.q_load"], result["spring.length_force"])
    assert_array_equal(result["mass.q_ddot"], -result["mass.q_load"])  # mass 1 kg


def test_cycle_is_reported(fmu: FmuPaths, caplog: pytest.LogCaptureFixture) -> None:
    with caplog.at_level("INFO", logger="liaisons.cosim"):
        _ring(fmu).simulate(1.0, H)
    assert "mass -> spring form a cycle" in caplog.text


def test_acceleration_force_loop_is_swept_once_and_says_so_in_its_values(fmu: FmuPaths) -> None:
    """q_ddot depends directly on the load, and the load here directly on q_ddot: explicit coupling cannot close it."""
    parts: dict[str, Any] = {"mass": (fmu("Mass"), {"q_force": 8.0}), "probe": fmu("Probe")}
    result = wired("mass.q_ddot -> probe.u", "probe.echo -> mass.q_load", **parts).simulate(1.0, H)
    assert_array_equal(result["probe.u"], result["mass.q_ddot"])  # the first half of the loop is closed
    assert_array_equal(result["mass.q_ddot"], 8.0 - result["mass.q_load"])
    assert np.any(result["mass.q_load"] != result["probe.echo"])  # the second half is one sweep behind


@pytest.mark.usefixtures("either_loop")
def test_value_that_an_fmu_refuses_from_another_is_named(fmu: FmuPaths) -> None:
    parts: dict[str, Any] = {"mass": (fmu("Mass"), {"mass": 5e-324}), "probe": fmu("Probe"), "push": fmu("Cubic")}
    system = wired("push.y -> mass.q_force", "mass.q_ddot -> probe.u", **parts)
    with pytest.raises(IncompleteError, match=r"^probe: fmi2SetReal at t = 0\.25 s returned Discard: .* inf is not"):
        system.simulate(1.0, H)


def test_one_call_of_each_kind_a_step(fmu: FmuPaths, trace: Trace) -> None:
    for mode, expected in ((1, ["step", "set", "get"]), (2, ["set", "step", "get"])):
        before = len(trace())
        _driven(fmu, mode).simulate(10 * H, H)
        calls = [line.split()[1] for line in trace()[before:] if line.startswith("spring ")]
        loop = calls[calls.index("step") - expected.index("step") : calls.index("terminate")]
        assert loop == 10 * expected


def test_only_what_is_asked_for_is_recorded(fmu: FmuPaths) -> None:
    result = _driven(fmu, 1).simulate(1.0, H, record=["spring.seen", "cubic.y", "spring.stiffness"])
    assert result.names == ("spring.seen", "cubic.y", "spring.stiffness")
    assert_array_equal(result["cubic.y"], T**3)
    assert_array_equal(result["spring.stiffness"], np.full(5, 2.0))
    assert _driven(fmu, 1).simulate(1.0, H, record=[]).values.shape == (0, 5)


def test_units_come_from_the_files_and_through_connections(fmu: FmuPaths) -> None:
    units = _driven(fmu, 1).simulate(1.0, H).units
    assert units["spring.length_force"] == "N"
    assert units["cubic.y_dot"] == "m/s"  # the signal has none of its own
    assert units["spring.length_dot"] == "m/s"


@pytest.mark.parametrize(
    ("record", "words"),
    [
        (["sprig.seen"], "wired has no component 'sprig'; did you mean 'spring'"),
        (["spring.sen"], r"spring: Spring\.fmu has no variable 'sen'; did you mean 'seen'"),
    ],
)
def test_unknown_record(fmu: FmuPaths, record: list[str], words: str) -> None:
    with pytest.raises(SimulationError, match=words):
        _driven(fmu, 1).simulate(1.0, H, record=record)


# ---- communication points ---------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("start", "stop", "step", "points"),
    [
        (0.0, 1.0, 0.25, [0.0, 0.25, 0.5, 0.75, 1.0]),
        (0.0, 1.0, 0.4, [0.0, 0.4, 0.8, 1.0]),  # the last step is shorter
        (0.0, 1.0, 3.0, [0.0, 1.0]),
        (-1.0, 0.0, 0.5, [-1.0, -0.5, 0.0]),
    ],
)
def test_points(fmu: FmuPaths, start: float, stop: float, step: float, points: list[float]) -> None:
    result = wired(cubic=fmu("Cubic")).simulate(stop, step, start_time=start)
    assert_array_equal(result.time, points)
    # t³ by two multiplications from the time that the FMU adds up itself: a few roundings
    assert_allclose(result["cubic.y"], np.array(points) ** 3, rtol=1e-14)


def test_times_are_multiples_and_no_sums(fmu: FmuPaths) -> None:
    time = wired(cubic=fmu("Cubic")).simulate(1000.0, 0.1).time
    assert len(time) == 10_001  # 1000/0.1 is no integer in binary; no step of a rounding's length
    assert_array_equal(time[:-1], np.arange(10_000) * 0.1)
    assert time[-1] == 1000.0


def test_points_that_differ_by_rounding_are_one(fmu: FmuPaths) -> None:
    coarse, fine = np.linspace(0, 2, 41), np.linspace(0, 2, 401)
    both = np.unique(np.r_[coarse, fine])
    assert len(both) > 401
    assert_allclose(wired(cubic=fmu("Cubic")).simulate(times=both).time, fine, rtol=0, atol=1e-15)
    apart = [0.0, 1.0, 1.0 + 1e-14, 2.0]
    assert_array_equal(wired(cubic=fmu("Cubic")).simulate(times=apart).time, apart)


def test_large_system_is_printed_on_a_screen(fmu: FmuPaths) -> None:
    system = wired(**{f"cubic_{k}": fmu("Cubic") for k in range(30)})
    lines = repr(system).splitlines()
    assert lines[0] == "System 'wired'"
    assert lines[20] == "  <cubic_19: Cubic.fmu>"
    assert lines[21:] == ["  and 10 more"]
    named = wired(probe=(fmu("Probe"), {"u": 1.0}))
    assert repr(named) == "System 'wired'\n  <probe: Probe.fmu, u=1.0>"


def test_short_last_step_is_not_given_to_an_fmu_that_cannot(fmu: FmuPaths) -> None:
    system = wired(faulty=fmu("Faulty"))
    with pytest.raises(SimulationError, match=r"faulty: takes steps of one size only, .* 0\.2 s"):
        system.simulate(1.0, 0.4)
    assert len(system.simulate(1.0, 0.1).time) == 11


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"step_size": 0.0}, r"step_size = 0\.0: must be > 0"),
        ({"step_size": -0.1}, r"step_size = -0\.1: must be > 0"),
        ({"step_size": math.nan}, "step_size = nan: must be a finite number"),
        ({"step_size": "0.1"}, r"step_size = '0\.1': must be a finite number"),
        ({"stop_time": 0.0}, r"stop_time = 0\.0: must be greater than start_time = 0\.0"),
        ({"stop_time": math.inf}, "stop_time = inf: must be a finite number"),
        ({"start_time": 2.0}, r"stop_time = 1\.0: must be greater than start_time = 2\.0"),
        ({"tolerance": 0.0}, r"tolerance = 0\.0: must be > 0"),
        ({"tolerance": math.nan}, "tolerance = nan: must be a finite number"),
        ({"coupling": "newton"}, "coupling = 'newton': choose one of 'gauss-seidel', 'jacobi'"),
    ],
)
def test_bad_arguments(fmu: FmuPaths, arguments: dict[str, Any], words: str, trace: Trace) -> None:
    good: dict[str, Any] = {"stop_time": 1.0, "step_size": H}
    with pytest.raises(SimulationError, match=words):
        _driven(fmu, 1).simulate(**(good | arguments))
    assert trace() == []  # said before any FMU was touched


# ---- life and death ---------------------------------------------------------------------------------------------


@pytest.fixture
def extracted(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Directory in which FMUs are extracted during the test."""
    directory = tmp_path / "extracted"
    directory.mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(directory))
    return directory


def _with_faulty(fmu: FmuPaths, **starts: float) -> System:
    return wired(cubic=fmu("Cubic"), faulty=(fmu("Faulty"), starts))


def _count(trace: Trace, call: str) -> int:
    return Counter(line.split()[1] for line in trace())[call]


def test_good_run_leaves_nothing_behind_and_can_be_repeated(fmu: FmuPaths, trace: Trace, extracted: Path) -> None:
    system = _driven(fmu, 1)
    first, second = system.simulate(1.0, H, tolerance=1e-6), system.simulate(1.0, H, tolerance=1e-6)
    assert_array_equal(first.values, second.values)
    assert _count(trace, "instantiate") == _count(trace, "terminate") == _count(trace, "free") == 4
    assert "spring setup tolerance=1e-06 start=0 stop=1" in trace()
    assert list(extracted.iterdir()) == []


@pytest.mark.usefixtures("either_loop")
@pytest.mark.parametrize(("status", "word"), [(2, "Discard"), (3, "Error"), (4, "Fatal"), (5, "Pending")])
def test_failing_step_keeps_what_there_is(fmu: FmuPaths, status: int, word: str, trace: Trace, extracted: Path) -> None:
    system = _with_faulty(fmu, time_of_failure=0.6, status=status)
    with pytest.raises(IncompleteError) as caught:
        system.simulate(1.0, H)
    assert str(caught.value) == (
        f"faulty: fmi2DoStep from t = 0.5 s to t = 0.75 s returned {word}: time 0.75 is beyond"
    )
    assert_array_equal(caught.value.result.time, [0.0, 0.25, 0.5])
    assert_array_equal(caught.value.result["cubic.y"], [0.0, 0.25**3, 0.5**3])
    # after Error an instance may only be freed, after Fatal not even that
    assert _count(trace, "terminate") == {2: 2, 3: 1, 4: 1, 5: 1}[status]
    assert _count(trace, "free") == (1 if status == 4 else 2)
    assert list(extracted.iterdir()) == []


@pytest.mark.usefixtures("either_loop")
@pytest.mark.parametrize(("last", "times"), [(0.6, [0.0, 0.25, 0.5]), (0.75, [0.0, 0.25, 0.5, 0.75])])
@pytest.mark.usefixtures("either_loop")
def test_fmu_that_ends_the_simulation_ends_it(
    fmu: FmuPaths, last: float, times: list[float], caplog: pytest.LogCaptureFixture
) -> None:
    alone = simulate(fmu("Finite"), stop_time=1.0, step_size=H, last=last)
    assert alone.time.tolist() == alone["x"].tolist() == [0.0, 0.25, 0.5, last]
    assert f"Finite ends the simulation at t = {last} s of 1 s" in caplog.text
    assert alone.warnings == (f"Finite ends the simulation at t = {last} s of 1 s",)
    system = wired(finite=(fmu("Finite"), {"last": last}), cubic=fmu("Cubic"))  # further than the other by then
    result = system.simulate(1.0, H)
    assert result.time.tolist() == result["finite.x"].tolist() == times
    assert result["cubic.y"].tolist() == [t**3 for t in times]
    swept = sweep(fmu("Finite"), {"last": [last, 2.0]}, "x", stop_time=1.0, step_size=H, workers=1)
    assert (swept["x"].tolist(), swept.failures) == ([last, 1.0], {})
    finite = wired(finite=(fmu("Finite"), {"last": last}))
    assert 0.25 <= finite.simulate(1.0, H, error_tolerance=1e-3).time[-1] <= last


@pytest.mark.parametrize("coupling", ["gauss-seidel", "jacobi"])
def test_integers_and_booleans_are_connected(fmu: FmuPaths, coupling: Literal["gauss-seidel", "jacobi"]) -> None:
    links = "one.count -> two.level", "one.late -> two.armed", "one.count -> probe.u"
    system = wired(*links, one=fmu("Discrete"), two=fmu("Discrete"), probe=fmu("Probe"))
    result = system.simulate(1.0, H, coupling=coupling)
    assert result["two.seen"].tolist() == [0, -1, -2, 10 - 3, 10 - 4]
    assert result["probe.echo"].tolist() == result["one.count"].tolist() == [0, -1, -2, -3, -4]
    shifted = wired("one.gear -> two.level", one=fmu("Discrete"), two=fmu("Discrete")).simulate(1.0, H)
    assert shifted["two.seen"].tolist() == shifted["one.gear"].tolist() == [1, 1, 2, 2, 2]
    goes_back = wired(links[0], one=fmu("Discrete"), two=fmu("Discrete"))
    with pytest.raises(SimulationError, match=r"reals only, but one\.count -> two\.level is of type Integer: choose"):
        goes_back.simulate(1.0, H, coupling="implicit")


def test_warning_is_logged_once_and_the_run_goes_on(fmu: FmuPaths, caplog: pytest.LogCaptureFixture) -> None:
    result = _with_faulty(fmu, time_of_failure=0.9, status=1).simulate(1.0, H)
    assert len(result.time) == 5
    assert result.warnings == ("faulty: time 1 is beyond",)
    assert [record.getMessage() for record in caplog.records if record.levelname == "WARNING"] == [
        "faulty: time 1 is beyond"
    ]


def test_refused_initialization_says_why(fmu: FmuPaths, trace: Trace, extracted: Path) -> None:
    with pytest.raises(SimulationError) as caught:
        _with_faulty(fmu, limit=-2.0).simulate(1.0, H)
    assert str(caught.value) == "faulty: fmi2ExitInitializationMode returned Error: limit = -2 must be >= 0"
    assert not isinstance(caught.value, IncompleteError)  # there is nothing yet
    assert _count(trace, "free") == 2
    assert list(extracted.iterdir()) == []


def test_messages_are_told_apart_by_instance(fmu: FmuPaths) -> None:
    first, second = {"time_of_failure": 0.3, "status": 1}, {"time_of_failure": 0.6, "status": 3}
    system = wired(first=(fmu("Faulty"), first), second=(fmu("Faulty"), second))
    with pytest.raises(IncompleteError, match=r"^second: .* returned Error: time 0\.75 is beyond$"):
        system.simulate(1.0, H)


def test_refused_instantiation_says_why(fmu: FmuPaths, trace: Trace, extracted: Path) -> None:
    with pytest.raises(SimulationError, match=r"^mute: Mute\.fmu cannot be instantiated: no licence for mute$"):
        wired(cubic=fmu("Cubic"), mute=fmu("Mute")).simulate(1.0, H)
    assert _count(trace, "instantiate") == _count(trace, "free") == 1
    assert list(extracted.iterdir()) == []


@pytest.mark.usefixtures("either_loop", "interruptible")
def test_interrupt_ends_at_a_communication_point(
    fmu: FmuPaths, trace: Trace, extracted: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from liaisons.cosim.running import run

    def show(t: float) -> None:
        if t == 0.25:  # the first look: after one step
            signal.raise_signal(signal.SIGINT)

    monkeypatch.setattr(run, "progress_bar", lambda *_: nullcontext(show))
    usual = signal.getsignal(signal.SIGINT)
    with pytest.raises(Interrupted, match=r"wired: interrupted at t = 0\.25 of 1 s") as caught:
        _driven(fmu, 1).simulate(1.0, H, progress=True)
    assert isinstance(caught.value, KeyboardInterrupt)  # a script stops
    assert_array_equal(caught.value.result["spring.length"], [0.0, 0.25**3])
    assert signal.getsignal(signal.SIGINT) is usual
    assert _count(trace, "free") == 2
    assert list(extracted.iterdir()) == []


@pytest.mark.parametrize("terminal", [True, False])
def test_progress_is_shown_on_the_stderr_of_terminals(
    fmu: FmuPaths, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, terminal: bool
) -> None:
    monkeypatch.setenv("TTY_COMPATIBLE", "1" if terminal else "0")
    monkeypatch.setenv("TERM", "xterm")
    _driven(fmu, 1).simulate(1.0, H, progress=True)
    captured = capsys.readouterr()
    assert captured.out == ""
    assert ("wired: t = 1 of 1 s" in captured.err) == bool(captured.err) == terminal


@pytest.mark.usefixtures("either_loop")
@pytest.mark.parametrize("where", [1e9, 1e308, 0.3, 0.76])
def test_an_fmu_that_ends_outside_of_its_step_ends_at_its_begin(fmu: FmuPaths, where: float) -> None:
    result = simulate(fmu("Astray"), stop_time=1.0, step_size=H, where=where)
    assert result.time.tolist() == [0.0, 0.25, 0.5]
    assert result.warnings == ("Astray ends the simulation at t = 0.5 s of 1 s",)
