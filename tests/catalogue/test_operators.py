"""Operators: their triples (y, y', y'') against their closed forms, and consistent with one another."""

from __future__ import annotations

import sys
from typing import Any

import casadi as ca
import fmpy
import numpy as np
import pytest
from on_paper import BACKENDS

from liaisons import simulate
from liaisons.cosim import System, SystemComponent
from liaisons.errors import ComponentError
from liaisons.language import Input, InternalState, Operator, Parameter
from liaisons.mechanics import Model, assemble
from liaisons.models import CATALOGUE, Constant, FourierSeries, Pendulum, PlannedMotion, Ramp, Sinusoid, SmoothStep

OPERATORS = [c for c in CATALOGUE if issubclass(c, Operator) and not c.inputs]  # functions of time alone


def _knots(*knots: tuple[float, float, float, float]) -> dict[str, Any]:
    columns = np.pad(np.transpose(knots), ((0, 0), (0, 100 - len(knots))))
    return dict(zip(("instant", "value", "rate", "acceleration"), columns, strict=True))


VALUES: dict[type[Operator], dict[str, Any]] = {
    Constant: {"value": 2.5},
    Ramp: {"offset": 1.0, "rate": -0.3, "start_time": 0.75},
    Sinusoid: {"offset": 1.0, "amplitude": 0.1, "angular_frequency": 2.0, "phase": 0.3},
    FourierSeries: {"offset": 1.0, "angular_frequency": 0.7}
    | {f"{wave}_{k}": 0.3 / k for wave in ("cos", "sin") for k in range(1, 5)},
    SmoothStep: {"start_value": 1.0, "end_value": 3.0, "start_time": 0.5, "duration": 1.5},
    PlannedMotion: _knots((0.5, 1, 0, 2), (1.5, 0, 1, 0), (1.5, 2, -1, 1), (2.5, 1, 0.5, 0), (3, 1, 0, -1)),
}
TIMES = np.linspace(-1, 4, 41)  # 0.125 apart: the instants of all jumps are among them


def _column(model: Model, values: dict[str, Any]) -> np.ndarray:
    """The vector of parameters."""
    return np.concatenate([np.atleast_1d(values[parameter.name]) for parameter in model.parameters])


def triple(component: type[Operator], times: np.ndarray, values: dict[str, Any]) -> dict[str, np.ndarray]:
    """What the FMU's equations give: y, y', y'' at the times."""
    model = assemble(component)
    k = _column(model, values)
    rows = [np.asarray(model.outputs_function(t, [], [], k, [])).ravel() for t in times]
    return dict(zip((output.name for output in model.outputs), np.array(rows).T, strict=True))


@pytest.mark.parametrize("component", OPERATORS)
def test_triple_is_the_closed_form(component) -> None:
    values = VALUES[component]
    exact = component.exact(TIMES, **values)
    # Two orders of evaluation of a polynomial or sine: roundings of terms of size 5000 (y'' of the step).
    for name, column in triple(component, TIMES, values).items():
        np.testing.assert_allclose(column, exact[name], rtol=0, atol=1e-12)


@pytest.mark.parametrize("component", OPERATORS)
def test_derivatives_belong_to_the_value(component) -> None:
    values, model = VALUES[component], assemble(component)
    instants = np.asarray(model.events(_column(model, values))).ravel()
    times = TIMES[np.abs(TIMES[:, None] - instants[None, :]).min(axis=1, initial=1.0) > 0.01]
    h = 1e-3
    at = {shift: component.exact(times + shift * h, **values) for shift in (-2, -1, 0, 1, 2)}
    for value, rate in (("y", "y_dot"), ("y_dot", "y_ddot")):
        near, far = at[1][value] - at[-1][value], at[2][value] - at[-2][value]
        difference = (8 * near - far) / (12 * h)
        # Fourth order: h⁴ y⁽⁵⁾/30 with y⁽⁵⁾ up to 1e4 in the step, and roundings of y/h.
        np.testing.assert_allclose(difference, at[0][rate], rtol=0, atol=1e-9)


def test_events_are_the_instants_where_the_signal_is_not_smooth() -> None:
    assert np.asarray(assemble(Ramp).events([0.0, 1.0, 0.75])).ravel() == pytest.approx([0.75])
    assert np.asarray(assemble(SmoothStep).events([0.0, 1.0, 0.5, 1.5])).ravel() == pytest.approx([0.5, 2.0])
    assert assemble(Sinusoid).events([0.0] * 4).numel() == 0


class SquareWave(Operator):
    """Jumps between 0 and 1 at every multiple of half a period."""

    half = Parameter(0.15, "s", "half a period", above=0)

    def signal(self, t: ca.SX) -> ca.SX:
        return ca.fmod(ca.floor(t / self.half + 1e-9), 2)

    def events(self) -> list[ca.SX]:
        k = ca.floor(self.clock / self.half)
        return [i * self.half for i in (k, k + 1, k + 2)]


ANNOUNCED: dict[type[Operator], tuple[dict[str, Any], list[float]]] = {
    Ramp: ({"start_time": 0.25}, [0.25]),
    SmoothStep: ({"start_time": 0.25, "duration": 0.5}, [0.25, 0.75]),
    PlannedMotion: (
        _knots((0, 1, 0, 0), (0.25, 1, 0, 0), (0.25, 1, 1, 0), (0.5, 1, 0, 0), (0.5, 1, 0, 0)),
        [0.25, 0.5],
    ),
    SquareWave: ({}, [i * 0.15 for i in range(1, 8)]),
}


@pytest.mark.parametrize("component", ANNOUNCED)
@pytest.mark.parametrize("kind", ["native 2", "native 3", "python 2", "exchange 2", "exchange 3"])
def test_next_event_time_is_the_first_instant_that_is_not_smooth(fmu, component: type[Operator], kind: str) -> None:
    values, jumps = ANNOUNCED[component]
    backend, fmi = kind.split()
    file = fmu(component, "python" if backend == "python" else "native", fmi=fmi)
    assert SystemComponent.read("operator", file, {}).fmu.next_event_variable is not None
    times = np.linspace(0, 1, 11)
    if backend == "exchange":
        starts = {f"{k}[{i + 1}]": x for k, column in values.items() for i, x in enumerate(np.ravel(column))}
        result = fmpy.simulate_fmu(
            str(file),
            fmi_type="ModelExchange",
            stop_time=1,
            output_interval=0.1,
            output=["next_event_time"],
            start_values=starts if component is PlannedMotion and fmi == "2" else values,
        )
        times, found = result["time"], result["next_event_time"]
    else:
        system = System("announces")
        system.add("operator", file, **values)
        found = system.simulate(1.0, 0.1, record=["operator.next_event_time"])["operator.next_event_time"]
    for t, announced in zip(times, found, strict=True):
        after = [jump for jump in jumps if jump > t + 1e-12] or [sys.float_info.max]
        at = [jump for jump in jumps if abs(jump - t) <= 1e-12]  # model exchange: the event may still be to come
        assert announced == after[0] or (backend == "exchange" and announced in at), (t, announced, after[0])


def test_what_is_smooth_announces_nothing(fmu) -> None:
    assert SystemComponent.read("operator", fmu(Sinusoid), {}).fmu.next_event_variable is None


def test_the_name_of_the_next_event_is_reserved() -> None:
    for component in (Constant, Pendulum):
        with pytest.raises(ComponentError, match="next_event_time"):
            type("Early", (component,), {"next_event_time": Parameter(0.0, "s", "mine")})


def test_a_signal_with_a_kink_that_is_not_announced_is_warned_of(caplog: pytest.LogCaptureFixture) -> None:
    type("Folded", (Constant,), {"signal": lambda self, t: ca.fabs(t - self.value)})
    assert "Folded: the signal has kinks" in caplog.text
    caplog.clear()
    type("Size", (Constant,), {"signal": lambda self, t: t * ca.fabs(self.value)})  # of a parameter
    assert not caplog.text


def test_ramp_takes_the_rate_after_the_jump_at_the_jump() -> None:
    at_jump = triple(Ramp, np.array([0.75]), VALUES[Ramp])
    assert (at_jump["y"][0], at_jump["y_dot"][0], at_jump["y_ddot"][0]) == (1.0, -0.3, 0.0)


@pytest.mark.parametrize("backend", BACKENDS)
def test_a_communication_point_that_misses_the_jump_by_rounding_is_taken_for_it(fmu, backend: str) -> None:
    assert 3 * 0.3 < 0.9
    system = System("late")
    system.add("ramp", fmu(Ramp, backend), rate=2.0, start_time=0.9)
    result = system.simulate(1.5, 0.3)
    assert result["ramp.y_dot"].tolist() == [0, 0, 0, 2, 2, 2]


@pytest.mark.parametrize("t", [0.5, 2.0])
def test_smooth_step_starts_and_ends_with_three_vanishing_derivatives(t: float) -> None:
    values, h = VALUES[SmoothStep], 1e-3
    inside = t + h if t == 0.5 else t - h
    end = triple(SmoothStep, np.array([t]), values)
    assert (end["y_dot"][0], end["y_ddot"][0]) == pytest.approx((0, 0), abs=1e-13)  # roundings of the terms
    # y'' = 420 rise u² / duration² to leading order: the third derivative vanishes at the end, the fourth does not.
    assert abs(triple(SmoothStep, np.array([inside]), values)["y_ddot"][0]) < 420 * 2 * (h / 1.5) ** 2 / 1.5**2


def test_a_repeated_knot_is_a_jump_and_the_polynomials_go_on_beyond_the_ends() -> None:
    before, at, after = triple(PlannedMotion, np.array([1.5 - 1e-9, 1.5, 4.0]), VALUES[PlannedMotion])["y"]
    assert (before, at) == (pytest.approx(0, abs=2e-9), 2)  # y' = 1 before the jump
    assert after == pytest.approx(PlannedMotion.exact([4.0], **VALUES[PlannedMotion])["y"][0], abs=1e-12)


@pytest.mark.parametrize(
    ("instants", "values"),
    [
        ([0.0, 1.0, 0.5, 3.0], [0.0, 1.0, 7.0, 9.0]),  # the list ends where the instants no longer ascend
        ([0.0, 1.0, -1e300, 1e300], [0.0, 1.0, 7.0, 9.0]),
    ],
)
def test_knots_behind_one_that_goes_back_are_not_there(instants: list[float], values: list[float]) -> None:
    span: dict[str, Any] = {"stop_time": 4.0, "step_size": 0.25}
    padded = [({"instant": instants[:n], "value": values[:n]}) for n in (4, 2)]
    run, two = (
        simulate("PlannedMotion", **{name: np.pad(x, (0, 100 - len(x))) for name, x in knots.items()}, **span)
        for knots in padded
    )
    np.testing.assert_array_equal(run["y"], two["y"])
    np.testing.assert_allclose(run["y"][run.time == 0.5], 0.5, rtol=1e-12)  # at rest at both ends: half of the way


def test_an_operator_whose_signal_jumps_with_an_input_is_refused() -> None:
    with pytest.raises(ComponentError, match=r"Hasty: y_dot jumps with an input; pass the input through three"):

        class Hasty(Operator):
            angle = Input("rad", "angle")
            x = InternalState("rad", "follows the angle")
            rate = Parameter(1.0, "1/s", "how fast")

            def signal(self, t: ca.SX) -> ca.SX:  # noqa: ARG002 - the signature of the base class
                return self.x

            def internal_rates(self) -> dict[str, ca.SX]:
                return {"x": self.rate * (self.angle - self.x)}
