"""Null directions in words."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from liaisons import identify
from liaisons.models import Pendulum
from liaisons_motion.identification.determinacy import NullSpace, indeterminacy_sentences

NAMES = ["a", "b", "c", "d"]
VALUES = np.array([2.0, 0.7, 1.3, 3.1])


def jacobian(function: Callable, values: np.ndarray) -> np.ndarray:
    """By complex steps: no rounding."""
    steps = 1e-30j * np.eye(len(values))
    return np.array([np.imag(function(values + step)) / 1e-30 for step in steps]).T


def spoken(function: Callable, values: np.ndarray = VALUES) -> tuple[str, ...]:
    near = values * np.linspace(1.01, 1.02, len(values))
    here, there = (NullSpace.from_jacobian(jacobian(function, at), at) for at in (values, near))
    return tuple(indeterminacy_sentences(here, there, NAMES[: len(values)], ["x"]))


t = np.linspace(0, 3, 20)


@pytest.mark.parametrize(
    ("function", "expected"),
    [
        (lambda p: p[0] * t + p[1] * t**2 + p[2] * t**3 + p[3], ()),
        (lambda p: p[0] * t + p[1] * t**2 + p[2], ("d: not determined at all by x",)),
        (lambda p: p[0] * t, ("b, c and d: not determined at all by x",)),
        (lambda p: p[3] * t + np.cos(p[0] / p[1] * t) * p[2], ("of a and b only a/b is determined by x",)),
        (lambda p: p[3] * t + p[0] * p[1] ** 2 / p[2] * t**2, ("of a, b and c only a*b**2/c is determined by x",)),
        (
            lambda p: p[0] / p[1] * t + p[2] / p[1] * t**2 + p[3],
            ("of a, b and c only a/b and a/c are determined by x",),
        ),
        (lambda p: p[3] * t + p[0] * np.exp((p[1] - 2 * p[2]) * t), ("of b and c only b - 2*c is determined by x",)),
        (
            lambda p: p[0] * p[1] * t + p[2] / p[3] * t**2,
            ("of a and b only a*b is determined by x", "of c and d only c/d is determined by x"),
        ),
        (
            lambda p: p[3] * t + np.exp(p[0]) * p[1] * t**2 + p[2],
            ("of a and b only 1 combination near these values is determined by x",),
        ),
    ],
)
def test_sentences(function: Callable, expected: tuple[str, ...]) -> None:
    assert spoken(function) == expected


def test_a_sum_is_no_product_where_values_are_equal() -> None:
    assert spoken(lambda p: (p[0] + p[1]) * t, np.array([1.0, 1.0])) == ("of a and b only a + b is determined by x",)
    assert spoken(lambda p: (p[0] * p[1]) * t, np.array([1.0, 1.0])) == ("of a and b only a*b is determined by x",)


def test_the_last_dependent_unknown_is_held() -> None:
    space = NullSpace.from_jacobian(jacobian(lambda p: p[0] / p[1] * t + p[3], VALUES), VALUES)
    assert space.unknowns_to_hold == [1, 2]
    assert space.undetermined.tolist() == [True, True, True, False]


def test_a_weak_direction_is_determined() -> None:
    assert not spoken(lambda p: p[0] * t + 1e-6 * p[1] * t**2, np.array([1.0, 1.0]))


def test_the_only_unknown_may_be_one_that_nothing_shows() -> None:
    """Rounding of its derivative is not taken for one."""
    times = np.linspace(0, 1, 11)
    data = {"time": times, "theta": Pendulum.exact(times, theta_0=0.1)["theta"]}
    for noise in (0.01, None):
        fit = identify("Pendulum", data, unknown=["mass"], noise=noise)
        assert fit.values == {"mass": 1.0}
        assert np.isnan(fit.standard_errors["mass"])
        assert fit.sentences[0] == "mass: not determined at all by theta"
