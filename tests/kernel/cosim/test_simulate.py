"""One FMU: defaults, inputs as functions of time."""

from __future__ import annotations

import math
import signal
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from making import FmuPaths, Trace, wired
from numpy.testing import assert_array_equal

from liaisons import Result, compare
from liaisons.cosim import IncompleteError, Interrupted, simulate
from liaisons.errors import SimulationError

# powers of two: exact in double precision
H = 0.25
T = np.arange(5) * H


def _cubic(t: float) -> tuple[float, float, float]:
    return t**3, 3 * t**2, 6 * t


def test_defaults_are_those_of_the_file(fmu: FmuPaths, trace: Trace) -> None:
    result = simulate(fmu("Probe"))
    assert_array_equal(result.time, [0.0, 0.25, 0.5])
    assert "Probe setup tolerance=0.001 start=0 stop=0.5" in trace()


def test_default_begin_is_that_of_the_file(fmu: FmuPaths, trace: Trace) -> None:
    result = simulate(fmu("Late"))
    assert result.time.tolist() == result["x"].tolist() == [2.0, 2.5, 3.0]
    assert "Late setup tolerance=-1 start=2 stop=3" in trace()
    assert simulate(fmu("Late"), stop_time=2.5).time.tolist() == [2.0, 2.5]
    assert wired(one=fmu("Late"), other=fmu("Late")).simulate(3.0, 0.5).time[0] == 2.0
    assert wired(one=fmu("Late"), other=fmu("Cubic")).simulate(3.0, 0.5).time[0] == 0.0


def test_missing_default_is_asked_for(fmu: FmuPaths) -> None:
    with pytest.raises(SimulationError, match=r"Cubic\.fmu has no default stop_time: give one"):
        simulate(fmu("Cubic"), step_size=H)
    with pytest.raises(SimulationError, match=r"Cubic\.fmu has no default step_size"):
        simulate(fmu("Cubic"), stop_time=1.0)


def test_whatever_has_numbers_or_strings_is_recorded(fmu: FmuPaths, tmp_path: Path) -> None:
    expected = {
        "count": [0, -1, -2, -3, -4],
        "late": [0, 0, 0, 1, 1],
        "gear": [1, 1, 2, 2, 2],
        "twice": 2 * T,
        "lamp[1]": np.ones(5),
        "lamp[2]": np.ones(5),
        "level": np.zeros(5),
        "armed": np.zeros(5),
        "seen": np.zeros(5),
        "label": ["früh"] * 3 + ["late"] * 2,
        "word": ["früh"] * 5,
    }
    result = simulate(fmu("Discrete"), raised=True, word="früh")
    assert set(result.names) == expected.keys()
    for name, values in expected.items():
        assert_array_equal(result[name], values)
    result.to_csv(tmp_path / "discrete.csv")
    table = np.genfromtxt(tmp_path / "discrete.csv", delimiter=",", names=True)
    assert_array_equal(table["count"], expected["count"])
    again = Result.from_csv(tmp_path / "discrete.csv")
    assert [again[name].tolist() for name in result] == [result[name].tolist() for name in result]
    assert compare(result, again).relative == 0
    assert simulate(fmu("Discrete"), record=["raised", "lamp"]).values.tolist() == [[0] * 5, [1] * 5, [0] * 5]
    with pytest.raises(SimulationError, match=r"Discrete\.label is String of an isolated FMU and cannot be recorded"):
        simulate(fmu("Discrete"), record="label", isolated=True)


def test_what_jumps_is_drawn_in_steps(fmu: FmuPaths, tmp_path: Path) -> None:
    figure = simulate(fmu("Discrete")).plot("twice", "gear", "label", path=tmp_path / "steps.png")
    styles = {line.get_label(): line.get_drawstyle() for axes in figure.axes for line in axes.lines}
    assert styles == {"twice": "default", "gear": "steps-post", "label": "steps-post"}
    assert [text.get_text() for text in figure.axes[-1].get_yticklabels()] == ["", "late"]


def test_strings_are_handed_on(fmu: FmuPaths) -> None:
    system = wired("one.label -> other.word", one=(fmu("Discrete"), {"word": "früh"}), other=fmu("Discrete"))
    result = system.simulate(1.0, 0.25)
    assert result["other.word"].tolist() == result["one.label"].tolist() == ["früh"] * 3 + ["late"] * 2
    apart = wired("one.label -> other.word", one=fmu("Discrete"), other=(fmu("Discrete"), {"isolated": True}))
    with pytest.raises(SimulationError, match="carries strings, which isolated FMUs cannot exchange: do not isolate"):
        apart.simulate(1.0, 0.25)


def test_integers_and_booleans_are_driven(fmu: FmuPaths, caplog: pytest.LogCaptureFixture) -> None:
    result = simulate(fmu("Discrete"), inputs={"level": lambda t: round(4 * t), "armed": lambda t: t > 0.5})
    assert result["seen"].tolist() == [0, 1, 2, 13, 14]
    assert not caplog.text  # what jumps is handed over as it is


@pytest.mark.parametrize(
    ("name", "value", "words"),
    [
        ("level", 0.5, "its function returns 0.5 at t = 0 s, expected an integer from -2147483648"),
        ("armed", 2, "its function returns 2 at t = 0 s, expected False or True"),
        ("word", 0, "Discrete.word is String; only numbers can be driven"),
    ],
)
def test_drives_fit_the_types(fmu: FmuPaths, name: str, value: float, words: str) -> None:
    with pytest.raises(SimulationError, match=words):
        simulate(fmu("Discrete"), inputs={name: lambda _: value})


@pytest.mark.parametrize("record", ["y_dot", ["y_dot"]])
def test_names_are_bare(fmu: FmuPaths, record: str | list[str]) -> None:
    result = simulate(fmu("Cubic"), stop_time=1.0, step_size=H, record=record)
    assert result.names == ("y_dot",)
    assert_array_equal(result["y_dot"], 3 * T**2)


def test_start_values_reach_the_fmu(fmu: FmuPaths, trace: Trace) -> None:
    result = simulate(fmu("Spring"), stop_time=1.0, step_size=H, stiffness=4.0, length=0.5)
    assert_array_equal(result["length_force"], np.full(5, 2.0))
    simulate(fmu("Faulty"), stop_time=1.0, step_size=H, label="a name", flag=True)
    assert "Faulty label a name" in trace()


@pytest.mark.parametrize(("mode", "lag"), [(0, 1), (1, 1), (2, 0)])
def test_function_of_a_port_gives_value_and_derivatives_as_a_source_would(fmu: FmuPaths, mode: int, lag: int) -> None:
    result = simulate(fmu("Spring"), stop_time=1.0, step_size=H, inputs={"length": _cubic}, input_reconstruction=mode)
    assert_array_equal(result["length"], T**3)
    assert_array_equal(result["length_ddot"], 6 * T)
    assert_array_equal(result["length_force"], 2 * T**3)
    assert_array_equal(result["seen"][1:], (T[1:] - lag * H) ** 3)
    assert_array_equal(result["seen_dot"][1:], 3 * (T[1:] - lag * H) ** 2)


def test_functions_of_single_inputs(fmu: FmuPaths) -> None:
    result = simulate(
        fmu("Mass"),
        stop_time=1.0,
        step_size=H,
        mass=2.0,
        inputs={"q_force": lambda t: 4.0, "q_load": lambda t: 2 * t},  # noqa: ARG005
    )
    assert_array_equal(result["q_ddot"], (4 - 2 * T) / 2)
    assert simulate(fmu("Probe"), inputs={"u": math.sin})["echo"][-1] == math.sin(0.5)


@pytest.mark.parametrize(
    ("inputs", "words"),
    [
        ({"lenght": math.sin}, "no variable 'lenght'; did you mean 'length'"),
        ({"seen": math.sin}, r"inputs: Spring\.seen is of causality 'output'"),
        ({"input_reconstruction": math.sin}, r"inputs: Spring\.input_reconstruction is of causality 'parameter'"),
        ({"length": 1.0}, r"inputs: length = 1\.0 is not a function of time"),
        (
            {"length_dot": lambda t: (t, t)},
            r"input 'length_dot': .* \[0\.0, 0\.0\] at t = 0 s, expected 1 finite number$",
        ),
        ({"length": lambda t: (t, t)}, "input 'length': its function returns .* expected 3 finite numbers$"),
        ({"length": lambda t: "long" + str(t)}, "input 'length': its function fails at t = 0 s: ValueError"),
        ({"length": _cubic, "length_dot": math.sin}, r"Spring\.length_dot is driven twice"),
    ],
)
def test_inputs_that_will_not_do(fmu: FmuPaths, inputs: dict[str, Any], words: str) -> None:
    with pytest.raises(SimulationError, match=words):
        simulate(fmu("Spring"), stop_time=1.0, step_size=H, inputs=inputs)


@pytest.mark.parametrize(
    ("function", "words"),
    [
        (lambda t: 1 / (t - 0.5), r"input 'u': its function fails at t = 0\.5 s: ZeroDivisionError"),
        (lambda t: math.nan if t == 0.5 else t, r"input 'u': its function returns nan at t = 0\.5 s"),
    ],
)
def test_function_that_fails_on_the_way_keeps_what_there_is(
    fmu: FmuPaths, function: Callable[[float], float], words: str
) -> None:
    with pytest.raises(IncompleteError, match=words) as caught:
        simulate(fmu("Probe"), stop_time=1.0, step_size=H, inputs={"u": function})
    assert_array_equal(caught.value.result.time, [0.0, 0.25])


def test_a_rate_that_contradicts_its_function_is_no_break_at_every_instant(fmu: FmuPaths) -> None:
    calls: list[float] = []

    def contradicted(t: float) -> tuple[float, float, float]:
        calls.append(t)
        return 1 + 0.1 * math.sin(t), 0.05 * math.cos(t), 0.0

    simulate(fmu("Spring"), stop_time=1.0, step_size=0.05, inputs={"length": contradicted})
    # At most 20 breaks in each of three steps, each found by some fifty bisections of 12 evaluations.
    assert len(calls) < 60 * 50 * 12 * 2


def test_a_start_value_beside_a_function_is_refused(fmu: FmuPaths) -> None:
    words = r"^Probe\.u = 0\.7: its function in inputs starts with 0; leave one out$"
    with pytest.raises(SimulationError, match=words):
        simulate(fmu("Probe"), stop_time=1.0, step_size=H, inputs={"u": math.sin}, u=0.7)
    with pytest.raises(SimulationError, match=r"^Spring\.length_dot = 0\.1: "):
        simulate(fmu("Spring"), stop_time=1.0, step_size=H, inputs={"length": _cubic}, length_dot=0.1)
    simulate(fmu("Probe"), stop_time=1.0, step_size=H, inputs={"u": math.cos}, u=1.0)  # they agree


@pytest.mark.usefixtures("interruptible")
def test_interrupt_keeps_what_there_is(fmu: FmuPaths) -> None:
    def pressed(t: float) -> float:
        if t == 0.5:
            signal.raise_signal(signal.SIGINT)
        return t

    with pytest.raises(KeyboardInterrupt, match=r"interrupted at t = 0\.\d+ of 1 s; \.result of this") as caught:
        simulate(fmu("Probe"), stop_time=1.0, step_size=H, inputs={"u": pressed})
    assert isinstance(caught.value, Interrupted)
    kept = caught.value.result
    assert 0.25 <= kept.time[-1] < 1.0
    assert_array_equal(kept["echo"], kept.time)


def test_process_ends_well_after_a_python_fmu(component: FmuPaths) -> None:
    path = component("python/Pendulum")
    code = f"from liaisons.cosim import simulate; simulate({str(path)!r}, stop_time=1); simulate({str(path)!r})"
    finished = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert (finished.returncode, finished.stderr) == (0, "")
