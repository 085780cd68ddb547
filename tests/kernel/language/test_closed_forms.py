"""Closed forms know the declarations of their component: names, start values, domains."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import casadi as ca
import numpy as np
import pytest
from numpy.typing import NDArray

from liaisons.chains import Chain
from liaisons.closed_forms import Values, closed_form
from liaisons.errors import ValidityError
from liaisons.language import ActiveCoordinate, Coordinate, Joint, Mechanism, Parameter


class Slide(Mechanism):
    """Free mass, beside a track that an operator moves."""

    mass = Parameter(2.0, "kg", "mass", above=0)
    x = Coordinate("m", "position", start=1.0, start_rate=0.5)
    track = ActiveCoordinate("m", "position of the track", start=3.0)

    def kinetic_energy(self) -> ca.SX:
        return self.mass / 2 * (self.dot(self.x) ** 2 + self.dot(self.track) ** 2)

    @closed_form("the motion under a constant force", t=">= 0", x_dot_0="< limit")
    @staticmethod
    def exact(t: NDArray, at: Values, *, limit: float = 9.0) -> dict[str, NDArray]:  # noqa: ARG004 - for the condition
        return {"x": at.x_0 + at.x_dot_0 * t + at.x_force / at.mass * t**2 / 2}


class Heavier(Slide):
    """The same with another start value."""

    mass = Parameter(4.0, "kg", "mass", above=0)


class Row(Chain):
    """Free masses."""

    mass = Parameter(1.0, "kg", "mass of each", above=0)
    joint = Joint("m", "x")
    u = Coordinate("m", "positions", start=(1.0,))

    def tip(self) -> dict[str, ca.SX]:
        return {"x": self.u}

    def kinetic_energy(self) -> ca.SX:
        return self.mass / 2 * self.dot(self.u) ** 2

    @closed_form("the uniform motion")
    @staticmethod
    def exact(t: NDArray, at: Values) -> dict[str, NDArray]:
        return {"u": at.u_0 + np.multiply.outer(t, at.u_dot_0)}


def test_what_is_not_given_is_as_declared() -> None:
    assert Slide.exact(2)["x"] == 2.0
    assert Slide.exact(2, x_force=1.0)["x"] == 3.0
    assert Heavier.exact(2, x_force=1.0)["x"] == 2.5  # its own declaration
    np.testing.assert_array_equal(Slide.exact([0, 1], x_0=-1)["x"], [-1.0, -0.5])
    assert Slide.exact(0, track=3.0)["x"] == 1.0  # as it is anyway


def test_arrays_of_a_chain_are_as_long_as_what_is_given() -> None:
    np.testing.assert_array_equal(Row.exact(1.0, n=3)["u"], [1.0, 0.0, 0.0])
    np.testing.assert_array_equal(Row.exact(1.0, u_0=[1, 2], u_dot_0=0.5)["u"], [1.5, 2.5])


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda: Slide.exact(1.0, mass=0.0), r"Slide.exact: mass = 0.0 must be > 0$"),
        (lambda: Slide.exact(1.0, x_0=np.inf), "x_0 = inf must be finite"),
        (lambda: Slide.exact(1.0, x_0="far"), "x_0 = 'far'; give a number"),
        (lambda: Slide.exact(1.0, x_0=[1.0, 2.0]), r"x_0 = \[1.0, 2.0\]; give a number"),
        (lambda: Slide.exact(1.0, x0=1.0), "Slide.exact: nothing is called 'x0'; did you mean 'x_0'"),
        (lambda: Slide.exact([0.0, -1.0]), "t = -1.0 must be >= 0; it is the motion under a constant force"),
        (lambda: Slide.exact(1.0, x_dot_0=9.0), "x_dot_0 = 9.0 must be < limit"),
        (lambda: Slide.exact(1.0, track=1.0), "track = 1.0 must be 3.0; it is the motion under a constant force"),
        (lambda: Row.exact(1.0, n=1), "Row: n = 1"),
        (lambda: Row.exact(1.0, u_0=[1.0, 2.0], u_dot_0=[1.0, 2.0, 3.0]), "u_dot_0 = .* give 2 numbers"),
        (lambda: closed_form("x", mass="positive"), r"closed_form\(mass='positive'\): write a relation"),
    ],
)
def test_values_that_a_closed_form_does_not_cover_are_named(call: Callable[[], Any], words: str) -> None:
    with pytest.raises(ValidityError, match=words):
        call()


def test_docstring_says_what_it_is_and_where_it_holds() -> None:
    assert Slide.exact.__doc__ == "The motion under a constant force, for t >= 0 and x_dot_0 < limit."
