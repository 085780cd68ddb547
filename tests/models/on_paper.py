"""What is written by hand in several tests: equality up to rounding, vectors of named numbers, derivatives, signals."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
import pytest
from numpy.typing import ArrayLike, NDArray


def algebra(value: ArrayLike, rounding: float = 1e-12) -> Any:
    """Equal up to the rounding of an algebraic identity: sums of a few terms, a few roundings of the largest."""
    return pytest.approx(value, rel=rounding, abs=rounding)


def vector(n: Mapping[str, Any], form: str, axes: str = "xyz") -> NDArray:
    """The numbers of one vector: ``vector(n, "{}_dot")`` is the velocity."""
    return np.array([n[form.format(axis)] for axis in axes])


def derivative(f: Callable[[float], Any], t: float, h: float = 0.02) -> Any:
    """Central difference of order 10."""
    weights = (5 / 6, -5 / 21, 5 / 84, -5 / 504, 1 / 1260)
    return sum(w * (f(t + i * h) - f(t - i * h)) for i, w in enumerate(weights, 1)) / h


def wave(
    offset: float, amplitude: float, frequency: float, phase: float = 0.0
) -> Callable[[float], tuple[float, float, float]]:
    """offset + amplitude · sin(frequency t + phase) with its two derivatives, as a function of time."""

    def signal(t: float) -> tuple[float, float, float]:
        sine, cosine = amplitude * np.sin(frequency * t + phase), amplitude * np.cos(frequency * t + phase)
        return offset + sine, frequency * cosine, -(frequency**2) * sine

    return signal
