"""The mechanisms of the catalogue, each moved so that something happens."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from pathlib import Path

import pytest

import liaisons.models
from liaisons import Result, simulate
from liaisons.language import Operator, Sampled
from liaisons.library import catalogue

Fmu = Callable[..., Path]
Moved = Callable[[str], Result]
MECHANISMS = sorted(name for name, item in catalogue().items() if not issubclass(item, (Operator, Sampled)))


@pytest.fixture(scope="session")
def moved(fmu: Fmu) -> Moved:
    """A short motion of a component, in which all that an operator prescribes moves as its rate says."""

    @cache
    def of(name: str) -> Result:
        component = getattr(liaisons.models, name)
        # Where there are constraints, rates have to agree with the start.
        pace, gain = (0.0, 1.0) if component.rheonomic_constraints or component.constraints else (0.3, 0.0)
        rates = {
            s.name: (lambda t, s=s: (s.start + pace * t + gain / 2 * t**2, pace + gain * t, gain))
            for s in component.actives
        }
        return simulate(fmu(component), stop_time=0.6, step_size=0.05, inputs=rates)

    return of
