"""Derivatives of every mechanism, by all its parameters and start values, against differences of SciPy's runs."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from liaisons.chains import Chain
from liaisons.language import Component, Operator, Sampled
from liaisons.mechanics import Model, assemble
from liaisons.models import CATALOGUE
from liaisons_motion.derivatives import motion_of

# Contacts have events, through which SciPy does not go: test_contacts.py has their derivatives.
MECHANISMS = [c for c in CATALOGUE if not issubclass(c, (Operator, Sampled)) and not c.contact_names()]
TIMES = np.linspace(0.0, 1.5, 7)
STEP = 0.005


class Reference:
    """A model, integrated by SciPy as its functions are, at the times of the test."""

    def __init__(self, component: type[Component]) -> None:
        sizes = (3,) if issubclass(component, Chain) else ()
        self.model: Model = assemble(component, *sizes).flat()
        self.names = [v.name for v in (*self.model.parameters, *self.model.inputs)]
        starts = {v.name: v.starts[0] for v in (*self.model.parameters, *self.model.inputs)}
        self.values = starts | {name: x for name, x in component.experiment.reference.items() if name in starts}

    def split(self, values: dict[str, float]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Inputs and parameters."""
        column = np.array([values[name] for name in self.names])
        parameters = len(self.model.parameters)
        return column[parameters:], column[:parameters]

    def starts(self, values: dict[str, float]) -> bool:
        """Whether these values are a start that an FMU takes, too."""
        u, k = self.split(values)
        y = self.model.start(0.0, u, k)[0]
        variables = {v.name: v for v in (*self.model.parameters, *self.model.inputs)}
        allowed = all(variables[name].allows(value) for name, value in values.items())
        return allowed and bool(np.all(np.array(self.model.conditions(0.0, y, u, k)) > 0))

    def run(self, values: dict[str, float]) -> NDArray[np.float64]:
        """States, without integrals, (states, times)."""
        u, k = self.split(values)
        y = np.array(self.model.start(0.0, u, k)[0]).ravel()
        found = solve_ivp(
            lambda t, y: self.model.derivatives(t, y, u, k).full().ravel(),
            (TIMES[0], TIMES[-1]),
            y,
            method="DOP853",
            t_eval=TIMES,
            rtol=1e-12,
            atol=1e-13 * (1 + np.abs(y)),
        )
        assert found.success
        return found.y[: len(y) - 2]

    def derivative(self, name: str) -> NDArray[np.float64] | None:
        """By differences of sixth order; None where the value cannot be changed alone, as of a constraint."""
        step = STEP * max(abs(self.values[name]), 0.1)
        moved = [self.values | {name: self.values[name] + n * step} for n in (-3, -2, -1, 1, 2, 3)]
        if not all(map(self.starts, moved)):
            return None
        a, b, c, d, e, f = map(self.run, moved)
        return (45 * (d - c) - 9 * (e - b) + (f - a)) / (60 * step)


@pytest.mark.slow
@pytest.mark.parametrize("component", MECHANISMS, ids=lambda component: component.__name__)
def test_derivatives_are_limits_of_differences(component: type[Component]) -> None:
    reference = Reference(component)
    varied = [v.name for v in reference.model.parameters] + [a.value for a in reference.model.active]
    differences = {name: reference.derivative(name) for name in varied}
    limits = {name: difference for name, difference in differences.items() if difference is not None}
    by = [*limits]
    assert len(by) >= 2  # starts that constraints bind together are left out
    motion = motion_of(reference.model, by, TIMES, start_values=reference.values, tolerance=1e-12)
    signals, derivatives = motion.forward(motion.values)
    np.testing.assert_allclose(signals, reference.run(reference.values), rtol=0, atol=1e-10 * np.abs(signals).max())
    for i, (name, expected) in enumerate(limits.items()):
        error = np.abs(derivatives[..., i] - expected).max()
        assert error <= 1e-7 * max(np.abs(expected).max(), 1e-2), name
