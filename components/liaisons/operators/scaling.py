"""Scales of a problem: sizes of mass, length, time and so on, from the numbers that a goal has."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from liaisons.operators.goals import Array
from liaisons.units import ANY, NUMBER, powers


def base_scales(quantities: Iterable[tuple[float, str]]) -> Array:
    """Sizes of the base units such that all quantities are as near to 1 as can be, by least squares of logarithms.

    Who measures in other units has the same quantities in terms of these, so that nothing that is done with them
    depends on units.

    :param quantities: numbers and their units; zero, infinity, and pure numbers say nothing.
    :returns: one size a base unit, in the order of :data:`liaisons.units.Powers`.
    """
    logarithms = {
        (abs(float(value)), unit): np.log(abs(float(value)))
        for value, unit in quantities
        if unit != ANY and np.isfinite(value) and value != 0 and any(powers(unit))
    }
    exponents = np.array([powers(unit) for _, unit in logarithms], dtype=float).reshape(-1, len(NUMBER))
    return np.exp(np.linalg.lstsq(exponents, np.array([*logarithms.values()]), rcond=None)[0])


def size(base: Array, unit: str) -> float:
    """Of a quantity with this unit."""
    return 1.0 if unit == ANY else float(np.prod(base ** np.array(powers(unit), dtype=float)))


@dataclass(frozen=True, eq=False)
class Scales:
    """Sizes of what a problem of optimal control is made of."""

    states: Array
    controls: Array
    time: float
    energy: float
    cost: float
