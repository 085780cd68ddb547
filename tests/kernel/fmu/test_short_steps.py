"""A very short step after inputs that came a step late, as masters have that step all at once and end by rounding.

σ then changes in 1e-15 s by what its rate needs 0.05 s for.  That is a jump: no rate is made of it.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from liaisons.language import Component
from liaisons.mechanics import assemble
from liaisons.models import CATALOGUE, Pendulum, StringPendulum

HOLD, EXTRAPOLATE, INTERPOLATE = range(3)
STEP, STEPS, AMPLITUDE = 0.05, 10, 0.1
SIZES = (1e-15, 1e-12, 1e-9, 1e-6, 1e-4, 1e-3)
MOVED = [c for c in CATALOGUE if getattr(c, "actives", ())]
APART: dict[type[Component], dict[str, Any]] = {StringPendulum: {"z_0": -0.5, "gravity": 0.0}}
"""Start values with which σ that comes late pulls no string."""


def prescribed(component: type[Component], t: float) -> dict[str, Any]:
    """All active coordinates swing about their start values, from rest."""
    model, values = assemble(component), {}
    starts = {variable.name: np.array(variable.starts) for variable in model.inputs}
    for i, (value, rate, acceleration) in enumerate((a.value, a.rate, a.acceleration) for a in model.active):
        omega, ones = 3.0 + i, np.ones(starts[value].size)
        values[value] = starts[value] + AMPLITUDE * (1 - np.cos(omega * t))
        values[rate] = AMPLITUDE * omega * np.sin(omega * t) * ones
        values[acceleration] = AMPLITUDE * omega**2 * np.cos(omega * t) * ones
    return values


def check(library: Any, component: type[Component], target: str, mode: int, size: float) -> None:
    states = [state for state in assemble(component).states if state.name not in ("work", "dissipated")]
    names, rates = [state.name for state in states], [state.derivative for state in states]
    start = prescribed(component, 0.0) | APART.get(component, {})
    instance = library(component, target).start(input_reconstruction=mode, tolerance=1e-8, **start)
    instance.follow(STEP, STEPS, lambda t: prescribed(component, max(t - STEP, 0.0)))
    before, rates_before = instance.get(*names), instance.get(*rates)
    instance.set(prescribed(component, STEPS * STEP))
    instance.step(STEPS * STEP, size)
    # What the motion has in 0.05 s, in which σ goes 0.03 at most: no more than a tenth, and accelerations alike.
    assert np.all(np.abs(instance.get(*names) - before) <= 0.1 * (1 + np.abs(before)))
    assert np.all(np.abs(instance.get(*rates) - rates_before) <= 0.5 * (1 + np.abs(rates_before)))
    assert abs(instance["energy_balance"]) <= 1e-6  # energies of 1e3 J, ten steps of 1e-8 each


def test_a_short_step_makes_no_rate_of_a_late_input(library, target: str, mode: int) -> None:
    for size in SIZES:
        check(library, Pendulum, target, mode, size)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("component", "target"),
    [(c, t) for c in MOVED for t in ("fmi2", "fmi3", "python") if t != "python" or not c.contact_names()],
)
def test_short_steps_of_all_components(library, component: type[Component], target: str) -> None:
    for mode in (HOLD, EXTRAPOLATE, INTERPOLATE):
        for size in SIZES:
            check(library, component, target, mode, size)


def test_a_change_that_the_rates_explain_is_interpolated(library, target: str) -> None:
    """Up to five times as far as they say, over the step; beyond, the length stays behind until the end."""
    momenta = []
    for times in (4.9, 5.1):  # what the length is off from where its rate leads, in units of how far that is
        length = 1.0 + 0.03 * (1 + times)
        instance = library(Pendulum, target).start(input_reconstruction=INTERPOLATE, theta_0=0.5, length_dot=0.3)
        instance.set(length=length)
        instance.step(0.0, 0.1)
        assert instance["length"] == length
        assert abs(instance["energy_balance"]) <= 1e-6
        momenta.append(float(instance["p_theta"]))
    # p' = -m g l sin θ: with a length that is 0.075 m larger in the mean of 0.1 s
    assert momenta[1] - momenta[0] == pytest.approx(9.81 * 0.075 * np.sin(0.5) * 0.1, rel=0.2)
