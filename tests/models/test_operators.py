"""Operators: their triples (y, y', y'') against their closed forms, and consistent with one another."""

from __future__ import annotations

import numpy as np
import pytest

from liaisons.cosim import System
from liaisons.language import Operator
from liaisons.mechanics import assemble
from liaisons.models import CATALOGUE, Constant, FourierSeries, Ramp, Sinusoid, SmoothStep

OPERATORS = [c for c in CATALOGUE if issubclass(c, Operator) and not c.inputs]  # functions of time alone
VALUES: dict[type[Operator], dict[str, float]] = {
    Constant: {"value": 2.5},
    Ramp: {"offset": 1.0, "rate": -0.3, "start_time": 0.75},
    Sinusoid: {"offset": 1.0, "amplitude": 0.1, "angular_frequency": 2.0, "phase": 0.3},
    FourierSeries: {"offset": 1.0, "angular_frequency": 0.7}
    | {f"{wave}_{k}": 0.3 / k for wave in ("cos", "sin") for k in range(1, 5)},
    SmoothStep: {"start_value": 1.0, "end_value": 3.0, "start_time": 0.5, "duration": 1.5},
}
TIMES = np.linspace(-1, 4, 41)  # 0.125 apart: the instants of all jumps are among them


def triple(component: type[Operator], times: np.ndarray, values: dict[str, float]) -> dict[str, np.ndarray]:
    """What the FMU's equations give: y, y', y'' at the times."""
    model = assemble(component)
    k = [values[parameter.name] for parameter in model.parameters]
    rows = [np.asarray(model.outputs_function(t, [], [], k, [])).ravel() for t in times]
    return dict(zip((output.name for output in model.outputs), np.array(rows).T, strict=True))


@pytest.mark.parametrize("component", OPERATORS, ids=lambda component: component.__name__)
def test_triple_is_the_closed_form(component) -> None:
    values = VALUES[component]
    exact = component.exact(TIMES, **values)
    for name, column in triple(component, TIMES, values).items():
        # Two orders of evaluation of a polynomial or sine: roundings of terms of size 5000 (y'' of the step).
        np.testing.assert_allclose(column, exact[name], rtol=0, atol=1e-12)


@pytest.mark.parametrize("component", OPERATORS, ids=lambda component: component.__name__)
def test_derivatives_belong_to_the_value(component) -> None:
    values = VALUES[component]
    instants = np.asarray(assemble(component).events([values[p.name] for p in component.parameters])).ravel()
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


def test_ramp_takes_the_rate_after_the_jump_at_the_jump() -> None:
    at_jump = triple(Ramp, np.array([0.75]), VALUES[Ramp])
    assert (at_jump["y"][0], at_jump["y_dot"][0], at_jump["y_ddot"][0]) == (1.0, -0.3, 0.0)


@pytest.mark.parametrize("backend", ["native", "python"])
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
