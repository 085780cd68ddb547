"""What a component declares: parameters, coordinates, points, outputs, conditions.

Each declaration is a descriptor.  On the class it is the declaration itself (unit, start value, domain); on an
instance of the component, which is its symbolic picture, it is the CasADi symbol or expression of that name.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any, Generic, Self, TypeVar, overload

import casadi as ca

from liaisons import units
from liaisons.errors import ComponentError
from liaisons.mechanics.model import Causality, Variability, Variable

__all__ = [
    "ActiveCoordinate",
    "Coordinate",
    "Parameter",
    "calculated",
    "condition",
    "output",
    "point",
]

T = TypeVar("T")


class Declaration:
    """Name, unit and description of one declared thing; abstract."""

    name: str = "?"

    def __init__(self, unit: str, description: str) -> None:
        if not isinstance(unit, str):
            raise ComponentError(f"unit {unit!r}: the unit comes first as a string, e.g. 'kg'; dimensionless is '1'")
        if not description:
            raise ComponentError(f"declaration with unit {unit!r}: say in the description what it is")
        if unit:
            try:
                units.parse(unit)
            except ValueError as error:
                raise ComponentError(f"{description!r}: {error}") from None
        self.unit = unit
        self.description = description

    def __set_name__(self, owner: type, name: str) -> None:
        self.name = name


class _Symbol(Declaration):
    """A declaration that stands for one scalar symbol with a start value and a domain; abstract."""

    def __init__(
        self,
        unit: str,
        description: str,
        *,
        start: float,
        above: float | None,
        minimum: float | None,
        below: float | None,
        maximum: float | None,
    ) -> None:
        super().__init__(unit, description)
        if (above is not None and minimum is not None) or (below is not None and maximum is not None):
            raise ComponentError(f"{description!r}: give either the excluded bound (above, below) or the included one")
        if (above is not None and maximum is not None) or (below is not None and minimum is not None):
            raise ComponentError(f"{description!r}: the two bounds must be both excluded or both included")
        self.start = _number(start, description)
        self.minimum = above if above is not None else minimum
        self.maximum = below if below is not None else maximum
        self.strict = above is not None or below is not None

    @overload
    def __get__(self, instance: None, owner: type) -> Self: ...
    @overload
    def __get__(self, instance: object, owner: type) -> ca.SX: ...
    def __get__(self, instance: Any, owner: type) -> Self | ca.SX:
        return self if instance is None else instance.symbols[self.name]

    def variable(self, causality: Causality, variability: Variability, name: str | None = None) -> Variable:
        """The symbol as an FMU variable with its start value and domain."""
        return Variable(
            name or self.name,
            self.unit,
            self.description,
            causality,
            variability,
            start=self.start,
            minimum=self.minimum,
            maximum=self.maximum,
            strict=self.strict,
        )

    def __set__(self, instance: object, value: object) -> None:
        raise ComponentError(f"{type(instance).__name__}.{self.name} is a symbol and cannot be assigned")


class Parameter(_Symbol):
    """A number that is set before the start.

    :param default: default value [unit].
    :param unit: SI unit, for example ``"kg.m2"``; ``"1"`` for a pure number.
    :param description: what it is, in a few words.
    :param above: excluded lower bound; ``minimum`` is the included one.
    :param below: excluded upper bound; ``maximum`` is the included one.
    :param tunable: may change between two steps of a simulation.
    :raises ComponentError: for a unit that is not understood or contradictory bounds.
    """

    def __init__(
        self,
        default: float,
        unit: str,
        description: str,
        *,
        above: float | None = None,
        minimum: float | None = None,
        below: float | None = None,
        maximum: float | None = None,
        tunable: bool = False,
    ) -> None:
        super().__init__(unit, description, start=default, above=above, minimum=minimum, below=below, maximum=maximum)
        self.tunable = tunable


class Coordinate(_Symbol):
    """A free coordinate q: it moves by its own dynamics (x^i, i <= p, of M 3.5).

    :param unit: SI unit of q, ``"m"`` or ``"rad"`` as a rule.
    :param description: what it is, zero and sense included.
    :param start: initial value; ``start_rate`` the initial rate.
    :param above: the motion must stay above this value (a singularity lies there).
    :param nominal: a typical size, which scales the absolute tolerance.
    :raises ComponentError: for a unit that is not understood.
    """

    def __init__(
        self,
        unit: str,
        description: str,
        *,
        start: float = 0.0,
        start_rate: float = 0.0,
        above: float | None = None,
        below: float | None = None,
        nominal: float = 1.0,
    ) -> None:
        super().__init__(unit, description, start=start, above=above, minimum=None, below=below, maximum=None)
        self.start_rate = _number(start_rate, description)
        self.nominal = _number(nominal, description)
        if self.nominal <= 0:
            raise ComponentError(f"{description!r}: nominal = {nominal} must be > 0")


class ActiveCoordinate(_Symbol):
    """An active coordinate s = σ(t): an operator prescribes it (x^α, α > p, of M 3.5).

    :param unit: SI unit of s.
    :param description: what it is, zero and sense included.
    :param start: value of the input until the operator gives another.
    :param above: excluded lower bound, ``below`` the upper one.
    :raises ComponentError: for a unit that is not understood.
    """

    def __init__(
        self,
        unit: str,
        description: str,
        *,
        start: float = 0.0,
        above: float | None = None,
        below: float | None = None,
    ) -> None:
        super().__init__(unit, description, start=start, above=above, minimum=None, below=below, maximum=None)


class _Formula(Declaration, Generic[T]):
    """A declared expression: a method of the component behind a unit and a description; abstract."""

    def __init__(self, unit: str, description: str, method: Callable[[Any], T]) -> None:
        super().__init__(unit, description)
        self.method = method

    @overload
    def __get__(self, instance: None, owner: type) -> Self: ...
    @overload
    def __get__(self, instance: object, owner: type) -> T: ...
    def __get__(self, instance: Any, owner: type) -> Self | T:
        if instance is None:
            return self
        if self.name not in instance.formulas:
            instance.formulas[self.name] = self.method(instance)
        return instance.formulas[self.name]


class Point(_Formula[Mapping[str, ca.SX]]):
    """A named point, which is a port: other mechanisms may be attached to it."""


class Output(_Formula[ca.SX]):
    """An output of the FMU beyond the systematic ones."""


class Calculated(_Formula[ca.SX]):
    """A number that follows from the parameters alone."""


class Condition(_Formula[ca.SX]):
    """An expression that must stay positive; a singularity lies where it vanishes."""


def point(unit: str, description: str) -> Callable[[Callable[[Any], Mapping[str, ca.SX]]], Point]:
    """Declare a named point: the method returns its components, for example ``{"x": ..., "z": ...}``.

    :param unit: unit of every component, ``"m"`` as a rule.
    :param description: what moves there, for example ``"the bob"``.
    """
    return lambda method: Point(unit, description, method)


def output(unit: str, description: str) -> Callable[[Callable[[Any], ca.SX]], Output]:
    """Declare an extra output; the method returns a scalar expression of coordinates, rates, momenta, forces."""
    return lambda method: Output(unit, description, method)


def calculated(unit: str, description: str) -> Callable[[Callable[[Any], ca.SX]], Calculated]:
    """Declare a calculated parameter; the method returns a scalar expression of the parameters."""
    return lambda method: Calculated(unit, description, method)


def condition(text: str) -> Callable[[Callable[[Any], ca.SX]], Condition]:
    """Declare what must stay positive; ``text`` is the message when it does not, for example ``"r must stay > 0"``."""
    return lambda method: Condition("1", text, method)


def _number(value: float, description: str) -> float:
    try:
        number = float(value)
    except (TypeError, ValueError):
        raise ComponentError(f"{description!r}: {value!r} is not a number") from None
    if not math.isfinite(number):
        raise ComponentError(f"{description!r}: {number} is not finite")
    return number
