"""What tests of plans and of controllers share."""

from __future__ import annotations

from math import prod
from typing import Any

from liaisons import Controller, Observer, Plan
from liaisons.base.units import powers
from liaisons.library import component, model

Scale = tuple[float, float, float]
"""Of mass, length and time."""
SCALES: list[Scale] = [(1e-3, 1, 1), (1e3, 1, 1), (1, 1e-3, 1), (1, 1e3, 1), (1, 1, 1e-3), (1, 1, 1e3)]


def verified(subject: Plan | Controller | Observer) -> list[str]:
    """Claims of the verdicts, all of which pass."""
    verdicts = subject.verify()
    assert all(verdict.passed for verdict in verdicts), "\n".join(map(str, verdicts))
    return [verdict.claim for verdict in verdicts]


def size(unit: str, scale: Scale) -> float:
    """By how much a number with a unit is larger."""
    return 1.0 if not unit else prod(factor**power for factor, power in zip(scale, powers(unit)[:3], strict=True))


def sizes(mechanism: Any, scale: Scale) -> dict[str, float]:
    """The same of all variables of a mechanism."""
    return {variable.name: size(variable.unit, scale) for variable in model(component(mechanism)).flat().variables}


def times(values: Any, factor: float) -> Any:
    """A number, or several of them, times a factor."""
    return tuple(value * factor for value in values) if isinstance(values, tuple) else values * factor


def scaled(values: Any, of: dict[str, float]) -> dict[str, Any]:
    """Values of variables by name, times their factors."""
    return {name: times(value, of.get(name, 1.0)) for name, value in values.items()}


def parameters(mechanism: Any, scale: Scale, values: dict[str, float], moves: Any) -> dict[str, float]:
    """Scaled values of parameters, and of coordinates that nobody moves."""
    own, whole = {p.name for p in component(mechanism).parameters}, model(component(mechanism))
    declared = {v.name: v.starts[0] for v in whole.parameters if v.name in own}
    declared |= {v.name: v.starts[0] for v in whole.inputs if v.starts[0] and v.name not in moves} | values
    return scaled(declared, sizes(mechanism, scale))
