"""Start values: a dictionary or keywords, the same in every public function that takes them."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import nullcontext
from typing import Any

import numpy as np
import pytest

from liaisons import LiaisonsError, System, hold, observe, operator, plan, show, simulate
from liaisons.models import Pendulum, Ramp

SPAN: dict[str, Any] = {"stop_time": 0.2, "step_size": 0.1}
TWICE = r"theta_0 is given in start_values and as a keyword; leave one out$"


def test_dictionary_and_keywords_are_the_same(fmu: Callable[..., Any]) -> None:
    path = fmu(Pendulum, "python")
    runs = [
        simulate(path, theta_0=0.2, mass=2.0, **SPAN),
        simulate(path, start_values={"theta_0": 0.2, "mass": 2.0}, **SPAN),
        simulate(path, start_values={"theta_0": 0.2}, mass=2.0, **SPAN),
    ]
    values: dict[str, Any] = {"theta_0": 0.2, "mass": 2.0}
    for start_values, keywords in ((values, {}), ({}, values)):
        system = System("one")
        system.add("swing", path, start_values=start_values, **keywords)
        assert dict(system.parts["swing"].starts) == {"theta_0": 0.2, "mass": 2.0}
    assert runs[0]["theta"][0] == 0.2
    for run in runs[1:]:
        assert np.array_equal(run.values, runs[0].values)


def test_a_name_given_twice_is_an_error(fmu: Callable[..., Any]) -> None:
    path = fmu(Pendulum, "python")
    twice: dict[str, Any] = {"start_values": {"theta_0": 0.2}, "theta_0": 0.2}
    motion: dict[str, Any] = {"moves": "pivot_x", **twice}
    calls: list[Callable[[], object]] = [
        lambda: simulate(path, **SPAN, **twice),
        lambda: System("one").add("swing", path, **twice),
        lambda: operator(path, **twice),
        lambda: show(path, **twice),
        lambda: plan(Pendulum, duration=1.0, **motion),
        lambda: hold(Pendulum, {"theta": 0.0}, **motion),
        lambda: observe(Pendulum, "theta", {"theta": 1.0}, **motion),
    ]
    for call in calls:
        with pytest.raises(LiaisonsError, match=TWICE):
            call()


def test_a_setting_is_the_setting_and_the_variable_of_its_name_is_a_start_value(fmu: Callable[..., Any]) -> None:
    path = fmu(Ramp, "python")
    run = simulate(path, rate=1.0, start_values={"start_time": 0.1}, **SPAN)
    assert run["y"] == pytest.approx([0.0, 0.0, 0.1], abs=1e-12)
    assert simulate(path, rate=1.0, start_time=0.1, **SPAN).time[0] == 0.1
    words = r"start_time = 'a': must be a finite number; start_time is a variable, too: give it in start_values$"
    with pytest.raises(LiaisonsError, match=words):
        simulate(path, start_time="a", **SPAN)  # pyright: ignore[reportArgumentType]


def test_one_fmu_takes_the_settings_of_a_system(fmu: Callable[..., Any], monkeypatch: pytest.MonkeyPatch) -> None:
    path = fmu(Pendulum, "python")
    titles: list[str] = []

    def bar(title: str, *_: object) -> nullcontext[Callable[[float], None]]:
        titles.append(title)
        return nullcontext(lambda _: None)

    monkeypatch.setattr("liaisons.cosim.running.run.progress_bar", bar)
    run = simulate(path, theta_0=0.2, verify=True, progress=True, **SPAN)
    assert 0 < run.error("theta")[-1] < 1e-6
    assert titles == ["Pendulum"]
    system = System("one")
    system.add("swing", path, theta_0=0.2, length=operator(fmu(Ramp, "python"), offset=1.0))
    choices: list[dict[str, Any]] = [{"coupling": "jacobi"}, {"error_tolerance": 1e-7, "tolerance": 1e-9}]
    for chosen in choices:
        moved = simulate(path, theta_0=0.2, length=operator(fmu(Ramp, "python"), offset=1.0), **chosen, **SPAN)
        whole = system.simulate(**chosen, **SPAN)
        assert np.array_equal(moved.time, whole.time)
        assert np.array_equal(moved["theta"], whole["swing.theta"])
    with pytest.raises(LiaisonsError, match="coupling = 'x': choose one of"):
        simulate(path, coupling="x", **SPAN)  # pyright: ignore[reportArgumentType]
