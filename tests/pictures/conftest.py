"""The mechanisms of the catalogue, each moved so that something happens."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from pathlib import Path

import pytest

import liaisons.models
from liaisons import Result, simulate
from liaisons.language import Operator
from liaisons.library import catalogue

Fmu = Callable[..., Path]
Moved = Callable[[str], Result]
MECHANISMS = sorted(name for name, item in catalogue().items() if not issubclass(item, Operator))


@pytest.fixture(scope="session")
def moved(fmu: Fmu) -> Moved:
    """A short motion of a component, in which all that an operator prescribes moves as its rate says."""

    @cache
    def of(name: str) -> Result:
        component = getattr(liaisons.models, name)
        pace = 0.0 if component.rheonomic_constraints else 0.3  # its rate has to agree with the start
        rates = {s.name: (lambda t, s=s: (s.start + pace * t, pace, 0.0)) for s in component.actives}
        return simulate(fmu(component), stop_time=0.6, step_size=0.05, inputs=rates)

    return of
