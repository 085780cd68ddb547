"""Piecewise polynomials of time as inputs of FMUs."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from scipy.interpolate import PPoly

    from liaisons.cosim import SystemDocument


def input_functions(document: SystemDocument, polynomials: Mapping[str, PPoly]) -> dict[str, Callable[[float], Any]]:
    """Functions of time for inputs; those of an active coordinate return value, rate and acceleration.

    :raises SimulationError: for an unknown name.
    """
    functions: dict[str, Callable[[float], Any]] = {}
    for name, polynomial in polynomials.items():
        owner, variable = document.reference("input", name)
        part = document.parts[owner]
        is_port = variable in part.fmu.variables and part[variable].triple()
        functions[name] = partial(_value_and_rates, polynomial) if is_port else polynomial
    return functions


def _value_and_rates(polynomial: PPoly, t: float) -> tuple[Any, ...]:
    """Value, rate and acceleration of a polynomial at a time [s]."""
    return tuple(polynomial(t, order) for order in range(3))
