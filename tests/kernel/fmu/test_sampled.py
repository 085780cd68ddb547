"""Sampled components as FMUs: when samples are taken, with which inputs, what is refused, states, importers."""

from __future__ import annotations

from typing import Any

import casadi as ca
import fmpy
import numpy as np
import pytest
from driver import CO_SIMULATION, DISCARD, ERROR, MODEL_EXCHANGE, OK, Instance
from numpy.typing import NDArray

from liaisons.errors import BuildError, ComponentError
from liaisons.fmu import build
from liaisons.language import DiscreteOutput, DiscreteState, Input, Parameter, Sampled
from liaisons.mechanics import assemble
from liaisons.models import Regulator

T = 0.02
LATE = "each sample has to be a communication point: choose a communication step that divides the period"


class Integrator(Sampled):
    """What the reading adds up to."""

    period = Parameter(T, "s", "sampling period", above=0)
    weight = Parameter(1.5, "m", "weight of the reading", tunable=True)
    reading = Input("1", "what is read")
    total = DiscreteState("m", "sum")
    output = DiscreteOutput("m", "sum and reading", start=-7.0)

    def update(self) -> dict[str, ca.SX]:
        total = self.total + self.weight * self.reading
        return {"total": total, "output": total + self.weight * self.reading / 2}


def signal(t: NDArray) -> NDArray:
    return np.cos(3 * t)


def outputs(times: NDArray, delay: float = 0.0, shift: float = 1e-9) -> NDArray:
    """The output at times, by a loop; limits from the right, or with a shift of -1e-9 s from the left."""
    instants = np.arange(np.ceil(times[-1] / T) + 1) * T
    total, seen = 0.0, [-7.0]
    for t in instants:
        total += 1.5 * float(signal(t))
        seen.append(total + 0.75 * float(signal(t)))
    return np.array(seen)[np.searchsorted(instants + delay, times + shift)]


def follow(instance: Instance, size: float, steps: int, *, first: int = 0) -> list[float]:
    """Step with inputs that are set at the start of each step; outputs are read before they are."""
    seen = []
    for i in range(first, first + steps):
        instance.set(reading=float(signal(np.array(i * size))))
        instance.step(i * size, size)
        seen.append(instance["output"])
    return seen


@pytest.mark.parametrize("target", ["fmi2", "fmi3", pytest.param("wasm", marks=pytest.mark.slow)])
@pytest.mark.parametrize("size", [T, T / 2, T / 5])
@pytest.mark.parametrize("delay", [0.0, T / 4, T])
def test_steps_that_reach_the_samples(library, target: str, size: float, delay: float) -> None:
    """Read before inputs are set: without a delay the limits from the left; a late output is there when it is due."""
    instance = library(Integrator, target).start(reading=1.0, delay=delay)
    times = np.arange(1, 41) * size
    np.testing.assert_allclose(follow(instance, size, 40), outputs(times, delay, 1e-9 if delay else -1e-9), rtol=1e-14)


@pytest.mark.parametrize("target", ["fmi2", "fmi3"])
def test_inputs_at_the_instant_of_a_sample_count(library, target: str) -> None:
    """However often they are set there, and the same ones again."""
    instance = library(Integrator, target).start(reading=1.0)
    assert instance["output"] == 2.25
    instance.set(reading=2.0)
    assert instance["output"] == 4.5
    instance.step(0.0, T)
    assert instance["output"] == 4.5
    for reading in (5.0, 0.0, 2.0):
        instance.set(reading=reading)
        assert instance["output"] == 3.0 + 2.25 * reading
        assert instance["total"] == 3.0 + 1.5 * reading
    instance.step(T, T / 2)
    instance.set(reading=9.0)
    assert instance["output"] == 7.5


def test_clocks_of_importers_miss_samples_by_rounding(library) -> None:
    instance = library(Integrator).start(reading=1.0)
    t = 0.0
    for _ in range(3000):
        instance.set(reading=1.0)
        instance.step(t, T / 3)
        t += T / 3
    assert instance["total"] == 1.5 * 1000


@pytest.mark.parametrize("target", ["fmi2", "fmi3"])
def test_a_step_across_a_sample_is_refused(library, target: str) -> None:
    instance = library(Integrator, target).start(reading=1.0)
    late = f"{LATE}; at t = 0.03 it does not (-0.02); the step from t = 0 is taken back"
    instance.step(0.0, 1.5 * T, DISCARD, late)
    instance.step(0.0, 1.5 * T, ERROR, late)
    many = f"{LATE}, or a longer period: before t = 0.05 there are samples at t = 0.02, 0.04 and so on"
    instance.step(0.0, 2.5 * T, ERROR, f"{many}; the step from t = 0 is taken back")
    instance = library(Integrator, target).start(reading=1.0)
    instance.step(0.0, 1.5 * T, DISCARD, late)
    instance.step(0.0, T)
    instance.step(T, T / 2)
    instance.step(1.5 * T, T, DISCARD, f"{LATE}; at t = 0.05 it does not (-0.02); the step from t = 0.03 is taken back")
    instance.set(reading=1.0)
    assert instance["total"] == 3.0


def test_a_start_between_samples(library) -> None:
    """The first sample is at the next multiple of the period; until then outputs have their start values."""
    instance = library(Integrator).instantiate()
    instance.initialize(start=1.5 * T)
    instance.set(reading=1.0)
    instance.exit_initialization()
    assert instance["output"] == -7.0
    instance.step(1.5 * T, T / 2)
    assert instance["next_event_time"] == pytest.approx(3 * T, rel=1e-15)
    instance.set(reading=2.0)
    assert instance["output"] == 4.5


@pytest.mark.parametrize("period", [1e-5, 1e5])
def test_the_first_sample_is_taken_whatever_the_period(library, period: float) -> None:
    instance = library(Integrator).start(reading=1.0, period=period)
    instance.step(0.0, period)
    instance.set(reading=1.0)
    assert (instance["total"], instance["next_event_time"]) == (3.0, pytest.approx(2 * period, rel=1e-12))


def test_a_delay_longer_than_the_period_is_refused(library) -> None:
    instance = library(Integrator).initializing(delay=1.5 * T)
    words = "delay must stay <= period; at t = 0 it does not (-0.01); set another value and initialize again"
    instance.exit_initialization(ERROR, words)


@pytest.mark.parametrize("target", ["fmi2", "fmi3", pytest.param("wasm", marks=pytest.mark.slow)])
def test_saved_states(library, target: str) -> None:
    """A sample that was taken for good, and one whose inputs may still change."""
    instance: Instance = library(Integrator, target).start(reading=1.0, delay=T / 4)
    follow(instance, T / 2, 5)
    state = instance.save()
    after = follow(instance, T / 2, 20, first=5)
    instance.restore(state)
    assert follow(instance, T / 2, 20, first=5) == after
    instance.restore(state)
    content = instance.serialize()
    instance.drop(state)
    assert follow(library(Integrator, target).restored(content), T / 2, 20, first=5) == after


def importer(path: str, kind: str, size: float, delay: float, *, event_mode: bool) -> tuple[NDArray, NDArray]:
    """Times and output of a simulation by FMPy, whose inputs are right at steps and samples."""
    times = np.unique(np.concatenate([np.arange(60) * size, np.arange(60) * T]))
    table = np.array(list(zip(times, signal(times), strict=True)), dtype=[("time", float), ("reading", float)])
    options: dict[str, Any] = {"use_event_mode": True, "early_return_allowed": True} if event_mode else {}
    result = fmpy.simulate_fmu(
        path, fmi_type=kind, stop_time=30 * size, step_size=size, output_interval=size, input=table,
        output=["output"], start_values={"delay": delay}, **options,
    )  # fmt: skip
    return result["time"], result["output"]


@pytest.mark.parametrize(
    ("target", "kind"), [(t, MODEL_EXCHANGE) for t in ("fmi2", "fmi3")] + [("fmi3", CO_SIMULATION)]
)
@pytest.mark.parametrize("size", [T, 1.5 * T, 0.37 * T])
@pytest.mark.parametrize("delay", [0.0, T / 4, T])
def test_any_step_where_there_are_events(library, target: str, kind: str, size: float, delay: float) -> None:
    """FMPy, in Model Exchange and in event mode; beside an event both limits are recorded."""
    path = str(library(Integrator, target).path)
    times, found = importer(path, kind, size, delay, event_mode=kind == CO_SIMULATION)
    off = [np.abs(found - outputs(times, delay, shift)) for shift in (-1e-9, 1e-9)]
    assert np.max(np.minimum(*off)) < 1e-12
    assert len(times) > 30


def test_event_mode_takes_the_inputs_that_are_set_in_it(library) -> None:
    instance = library(Integrator, "fmi3").running(CO_SIMULATION, options={"events": True, "early": True}, reading=1.0)
    assert instance.advance(0.0, 1.5 * T) == (OK, True, True, T)
    assert instance["output"] == 2.25
    instance.do("EnterEventMode")
    for reading in (4.0, 2.0):
        instance.set(reading=reading)
        assert instance.update().next_time == 2 * T
        assert instance["output"] == 1.5 + 2.25 * reading


@pytest.mark.parametrize("target", ["fmi2", "fmi3"])
def test_an_output_depends_on_inputs_at_samples(library, target: str) -> None:
    """So importers that order their calls by dependencies set inputs before they read the outputs."""
    text: Any = fmpy.read_model_description(str(library(Integrator, target).path))
    (output,) = [unknown for unknown in text.outputs if unknown.variable.name == "output"]
    assert {known.name for known in output.dependencies} >= {"reading"}
    variability = {variable.name: variable.variability for variable in text.modelVariables}
    assert variability["output"] == variability["total"] == "discrete"


def test_the_python_back_end_refuses_it(tmp_path) -> None:
    with pytest.raises(BuildError, match="Integrator: FMUs in Python take no samples; take backend='native'"):
        build(assemble(Integrator), tmp_path, backend="python")


def acceleration(times: NDArray) -> NDArray:
    """T x''' = w - x'', with w = -2 cos 3t held from its samples: exponentials."""
    a, found = 0.0, []
    samples = np.arange(np.ceil(times[-1] / T) + 2) * T
    for t in samples:
        w = -2 * float(signal(t))
        inside = times[(times >= t - 1e-9) & (times < t + T - 1e-9)]
        found += [w + (a - w) * np.exp(-(x - t) / T) for x in inside]
        a = w + (a - w) * np.exp(-1)
    return np.array(found)


@pytest.mark.parametrize(
    ("target", "kind", "size"),
    [
        pytest.param(
            target, kind, part * T, marks=[pytest.mark.slow] * (part in (1.0, 0.2) or (target, part) == ("fmi2", 1.5))
        )
        for target, kind, parts in (
            ("fmi2", MODEL_EXCHANGE, (1.0, 1.5, 0.37)),
            ("fmi3", MODEL_EXCHANGE, (1.0, 1.5, 0.37)),
            ("fmi3", "event mode", (1.0, 1.5, 0.37)),
            ("fmi2", CO_SIMULATION, (1.0, 0.5, 0.2)),
            ("fmi3", CO_SIMULATION, (1.0, 0.5, 0.2)),
        )
        for part in parts
    ],
)
def test_a_regulator_in_every_kind_of_importer(library, target: str, kind: str, size: float) -> None:
    """At any step where there are events; in Co-Simulation at steps that reach its samples."""
    times = np.unique(np.concatenate([np.arange(60) * size, np.arange(60) * T]))
    table = np.array(list(zip(times, signal(times), strict=True)), dtype=[("time", float), ("reading_1", float)])
    events: dict[str, Any] = {"use_event_mode": True, "early_return_allowed": True} if kind == "event mode" else {}
    path = library(Regulator, target).path
    gains = {"gain_1": [2.0] * 50} if target == "fmi3" else {f"gain_1[{i}]": 2.0 for i in range(1, 51)}
    result = fmpy.simulate_fmu(
        str(path), fmi_type=CO_SIMULATION if events else kind, stop_time=30 * size, step_size=size, input=table,
        output_interval=size, output=["y_ddot"], relative_tolerance=1e-10, start_values=gains | {"period": T}, **events,
    )  # fmt: skip
    found, expected = result["y_ddot"], acceleration(result["time"])
    assert np.max(np.abs(found - expected)) < (1e-6 if kind == MODEL_EXCHANGE else 1e-9)  # FMPy's solver, or ours
    assert len(found) > 30


class TestDeclarations:
    def test_units(self) -> None:
        with pytest.raises(ComponentError, match="total"):

            class Wrong(Sampled):
                """Metres and seconds."""

                total = DiscreteState("m", "sum")

                def update(self) -> dict[str, ca.SX]:
                    return {"total": self.total + self.period}

    def test_what_update_returns(self) -> None:
        with pytest.raises(
            ComponentError, match=r"Short.update returns \['total'\]; it must give \['total', 'output'\]"
        ):

            class Short(Sampled):
                """Half of it."""

                total = DiscreteState("m", "sum")
                output = DiscreteOutput("m", "sum")

                def update(self) -> dict[str, ca.SX]:
                    return {"total": self.total}

    def test_without_states(self) -> None:
        with pytest.raises(ComponentError, match="declares no DiscreteState and no DiscreteOutput"):

            class Empty(Sampled):
                """Nothing."""

                def update(self) -> dict[str, ca.SX]:
                    return {}
