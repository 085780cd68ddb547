"""What a component declares: parameters, coordinates, points, outputs, conditions.

Each declaration is a descriptor.  On the class it is the declaration itself (unit, start value, domain); on an
instance of the component, which is its symbolic picture, it is the CasADi symbol or expression of that name.
"""

from __future__ import annotations

import inspect
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import wraps
from typing import Any, Generic, Literal, ParamSpec, Self, TypeVar, overload

import casadi as ca
import numpy as np

from liaisons import units
from liaisons.errors import ComponentError, suggestion
from liaisons.language.variables import Causality, Variability, Variable

__all__ = [
    "ActiveCoordinate",
    "Coordinate",
    "Friction",
    "Gravity",
    "Input",
    "InternalState",
    "Joint",
    "Orientation",
    "Parameter",
    "Size",
    "calculated",
    "condition",
    "constraint",
    "non_holonomic",
    "output",
    "point",
    "submersion",
    "unchecked",
]

P = ParamSpec("P")
T = TypeVar("T")
_EXAMPLES = {
    "Parameter": 'Parameter(1.0, "kg", "mass of the bob")',
    "Coordinate": 'Coordinate("m", "height of the bead")',
    "ActiveCoordinate": 'ActiveCoordinate("m", "length of the rope", start=1.0)',
    "Input": 'Input("rad/s", "rate of the swing")',
    "InternalState": 'InternalState("1/s", "friction of the thermostat")',
    "point": '@point("m", "the bob")',
    "constraint": '@constraint("m", "the rod keeps its length")',
    "non_holonomic": '@non_holonomic("m/s", "the wheel does not slip")',
    "submersion": '@submersion("m", "length of the rope", start=1.0)',
    "calculated": '@calculated("rad/s", "angular frequency")',
    "condition": '@condition("r must stay > 0")',
    "output": '@output("m/s", "speed of the bob")',
}


def _explained(function: Callable[P, T]) -> Callable[P, T]:
    """Say by an example what is missing where a declaration is called with too little or too much."""
    signature, name = inspect.signature(function), function.__qualname__.removesuffix(".__init__")

    @wraps(function)
    def called(*given: P.args, **named: P.kwargs) -> T:
        try:
            signature.bind(*given, **named)
        except TypeError as error:
            texts = [value for value in (*given, *named.values()) if isinstance(value, str)]
            lone = len(texts) == 1 and "description" in str(error)  # the only text stands in the place of the unit
            reason = f"the unit is missing beside {texts[0]!r}" if lone and not _is_unit(texts[0]) else str(error)
            raise ComponentError(f"{name}: {reason}; write for example {_EXAMPLES[name]}") from None
        return function(*given, **named)

    return called


def _is_unit(text: str) -> bool:
    try:
        units.parse(text)
    except ValueError:
        return False
    return True


class Declaration:
    """Name, unit and description of one declared thing; abstract.

    :param unchecked: why the unit of its expressions is not checked; None: it is.
    """

    name: str = "?"

    def __init__(self, unit: str, description: str, unchecked: str | None = None) -> None:
        if not isinstance(unit, str):
            raise ComponentError(f"unit {unit!r}: the unit comes first as a string, e.g. 'kg'; dimensionless is '1'")
        self.unchecked = None if unchecked is None else _reason(unchecked)
        if not description:
            raise ComponentError(f"declaration with unit {unit!r}: say in the description what it is")
        if unit:
            try:
                units.parse(unit)
            except ValueError as error:
                raise ComponentError(f"{description!r}: {error}") from None
        self.unit = unit
        self.description = description

    @property
    def checked_unit(self) -> str:
        """The unit that expressions are checked with."""
        return units.ANY if self.unchecked else self.unit

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
        symbol: str = "",
        unchecked: str | None = None,
    ) -> None:
        super().__init__(unit, description, unchecked)
        if not isinstance(symbol, str):
            raise ComponentError(f"{description!r}: symbol = {symbol!r}: write the letter as text, e.g. 'κ' or 'm_1'")
        self.symbol = symbol
        if (above is not None and minimum is not None) or (below is not None and maximum is not None):
            raise ComponentError(f"{description!r}: give either the excluded bound (above, below) or the included one")
        if (above is not None and maximum is not None) or (below is not None and minimum is not None):
            raise ComponentError(f"{description!r}: the two bounds must be both excluded or both included")
        for bound in (above, minimum, below, maximum):
            if bound is not None:
                _number(bound, description)
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
            symbol="" if name else self.symbol,
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
    :param symbol: its letter on the page of the FMU, ``"κ"`` or ``"m_1"``, where it is not the one of its name.
    :param unchecked: why its unit is left out of account where units are checked, for example ``"an empirical law"``.
    :raises ComponentError: for a unit that is not understood or contradictory bounds.
    """

    @_explained
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
        symbol: str = "",
        unchecked: str | None = None,
    ) -> None:
        bounds = {"above": above, "minimum": minimum, "below": below, "maximum": maximum}
        super().__init__(unit, description, start=default, symbol=symbol, unchecked=unchecked, **bounds)
        self.tunable = tunable


class Gravity(Parameter):
    """The gravitational acceleration g [m/s2], of either sign; 0 is weightlessness."""

    def __init__(self) -> None:
        super().__init__(9.81, "m/s2", "gravitational acceleration", symbol="g")


class Friction(Parameter):
    """η [1/s] of K eq. 64, tunable: where it is declared every velocity is braked by it, and no method is needed.

    :param description: what it is, and ``symbol`` its letter, where the component has others.
    """

    def __init__(self, description: str = "friction coefficient eta of K eq. 61", symbol: str = "η") -> None:
        super().__init__(0.0, "1/s", description, minimum=0, tunable=True, symbol=symbol)


class Coordinate(_Symbol):
    """A free coordinate q: it moves by its own dynamics (x^i, i <= p, of M 3.5).

    :param unit: SI unit of q, ``"m"`` or ``"rad"`` as a rule.
    :param description: what it is, zero and sense included.
    :param start: initial value; ``start_rate`` the initial rate.  For the links of a chain also a tuple: the first
        links start with these, the others with 0.
    :param above: the motion must stay above this value (a singularity lies there).
    :param nominal: a typical size, which scales the absolute tolerance.
    :param symbol: its letter on the page of the FMU, as of a :class:`Parameter`.
    :raises ComponentError: for a unit that is not understood.
    """

    @_explained
    def __init__(
        self,
        unit: str,
        description: str,
        *,
        start: float | tuple[float, ...] = 0.0,
        start_rate: float = 0.0,
        above: float | None = None,
        below: float | None = None,
        nominal: float = 1.0,
        symbol: str = "",
    ) -> None:
        self.leading = tuple(_number(value, description) for value in start) if isinstance(start, tuple) else ()
        rest = 0.0 if isinstance(start, tuple) else start
        bounds = {"above": above, "minimum": None, "below": below, "maximum": None}
        super().__init__(unit, description, start=rest, symbol=symbol, **bounds)
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
    :param symbol: its letter on the page of the FMU, as of a :class:`Parameter`.
    :raises ComponentError: for a unit that is not understood.
    """

    @_explained
    def __init__(
        self,
        unit: str,
        description: str,
        *,
        start: float = 0.0,
        above: float | None = None,
        below: float | None = None,
        symbol: str = "",
    ) -> None:
        bounds = {"above": above, "minimum": None, "below": below, "maximum": None}
        super().__init__(unit, description, start=start, symbol=symbol, **bounds)


class Input(_Symbol):
    """What an operator measures: an FMU input, to be connected with an output of the mechanism that it controls.

    :param unit: SI unit.
    :param description: what it is.
    :param start: its value until something else is connected or set.
    :raises ComponentError: for a unit that is not understood.
    """

    @_explained
    def __init__(self, unit: str, description: str, *, start: float = 0.0) -> None:
        super().__init__(unit, description, start=start, above=None, minimum=None, below=None, maximum=None)


class InternalState(_Symbol):
    """A state that is no coordinate, for example the friction of a thermostat; its rate is the component's to give.

    :param unit: SI unit.
    :param description: what it is.
    :param start: initial value.
    :param symbol: its letter on the page of the FMU, as of a :class:`Parameter`.
    :raises ComponentError: for a unit that is not understood.
    """

    @_explained
    def __init__(self, unit: str, description: str, *, start: float = 0.0, symbol: str = "") -> None:
        bounds = dict.fromkeys(("above", "minimum", "below", "maximum"))
        super().__init__(unit, description, start=start, symbol=symbol, **bounds)


class Size(Declaration):
    """A structural size: how many links a chain has; fixed when the FMU is built.

    :param default: the size where none is asked for.
    :param description: of what it is the number.
    :param minimum: the smallest that makes sense.
    """

    def __init__(self, default: int, description: str, *, minimum: int = 2) -> None:
        super().__init__("1", description)
        self.minimum = minimum
        self.default = self.checked("Size", default)

    def checked(self, owner: str, value: Any) -> int:
        """The value as a size.

        :raises ComponentError: unless it is a whole number and not too small.
        """
        whole = isinstance(value, (int, np.integer)) and not isinstance(value, bool)
        if not whole or int(value) < self.minimum:
            name = f"{owner}: {self.name} = {value!r} ({self.description})"
            raise ComponentError(f"{name}: it must be a whole number >= {self.minimum}")
        return int(value)

    @overload
    def __get__(self, instance: None, owner: type) -> Self: ...
    @overload
    def __get__(self, instance: object, owner: type) -> int: ...
    def __get__(self, instance: Any, owner: type) -> Self | int:
        return self if instance is None else instance.sizes[self.name]


class Components(dict[str, Any]):
    """Components of a point by axis; one that is not there is an error that names the others."""

    def __init__(self, label: str, components: Mapping[str, Any]) -> None:
        super().__init__(components)
        self.label = label

    def __missing__(self, axis: object) -> Any:
        raise ComponentError(f"{self.label} has no component {axis!r}{suggestion(str(axis), self)}")


class Joint(Declaration):
    """Where a link of a chain meets the one before; ``self.joint`` maps its axes to symbols.

    :param unit: unit of the axes, ``"m"`` as a rule.
    :param axes: their names, ``"x", "z"``.
    :param others: further axes with units of their own, ``phi="rad"``.
    """

    def __init__(self, unit: str, *axes: str, **others: str) -> None:
        super().__init__(unit, "where a link meets the one before")
        self.unit_of = dict.fromkeys(axes, unit) | others
        for axis, of in others.items():
            if not _is_unit(of):
                raise ComponentError(f"Joint: {axis} = {of!r}: a further axis has its unit, e.g. phi='rad'")

    @property
    def axes(self) -> tuple[str, ...]:
        """Names of all axes."""
        return tuple(self.unit_of)

    @overload
    def __get__(self, instance: None, owner: type) -> Self: ...
    @overload
    def __get__(self, instance: object, owner: type) -> dict[str, ca.SX]: ...
    def __get__(self, instance: Any, owner: type) -> Self | dict[str, ca.SX]:
        if instance is None:
            return self
        axes = {axis: instance.symbols[f"{self.name}_{axis}"] for axis in self.axes}
        return Components(f"{type(instance).__name__}.{self.name}", axes)


@dataclass(frozen=True, eq=False)
class Attitude:
    """Symbols of one orientation: what ``self.attitude`` is in a method of the component."""

    quaternion: ca.SX  # (4, 1), scalar first, body to inertial frame
    rate: ca.SX  # (3, 1), angular velocity in the body frame
    momentum: ca.SX  # (3, 1), angular momentum in the inertial frame

    @property
    def matrix(self) -> ca.SX:
        """Rotation matrix, body to inertial frame, (3, 3); of a unit quaternion."""
        w, x, y, z = ca.vertsplit(self.quaternion)
        return ca.vertcat(
            ca.horzcat(1 - 2 * (y**2 + z**2), 2 * (x * y - w * z), 2 * (x * z + w * y)),
            ca.horzcat(2 * (x * y + w * z), 1 - 2 * (x**2 + z**2), 2 * (y * z - w * x)),
            ca.horzcat(2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x**2 + y**2)),
        )

    @property
    def kinematics(self) -> ca.SX:
        """K with q̇ = K ω, (4, 3): q̇ = q (0, ω)/2 as quaternions."""
        w, x, y, z = ca.vertsplit(self.quaternion)
        rows = ((-x, -y, -z), (w, -z, y), (z, w, -x), (-y, x, w))
        return ca.vertcat(*(ca.horzcat(*row) for row in rows)) / 2


class Orientation(Declaration):
    """Free orientation of a body: unit quaternion, its angular velocity, and angular momentum as the momentum.

    The FMU has the states ``q_w, q_x, q_y, q_z`` (body to inertial frame) and ``H_x, H_y, H_z`` (inertial frame,
    constant where no torque acts), and the outputs ``omega_x, omega_y, omega_z`` (body frame) with derivatives.

    :param description: of what.
    :param start: ``"rate"``: the start values are ``omega_x_0``, ...; ``"momentum"``: they are ``H_x_0``, ...
    """

    axes = ("x", "y", "z")
    quaternion = ("q_w", "q_x", "q_y", "q_z")
    rates = ("omega_x", "omega_y", "omega_z")
    momenta = ("H_x", "H_y", "H_z")

    def __init__(self, description: str, *, start: Literal["rate", "momentum"] = "rate") -> None:
        super().__init__("1", description)
        self.start = start

    @property
    def start_names(self) -> tuple[str, str, str]:
        """What is given at the start beside the quaternion."""
        return self.rates if self.start == "rate" else self.momenta

    @overload
    def __get__(self, instance: None, owner: type) -> Self: ...
    @overload
    def __get__(self, instance: object, owner: type) -> Attitude: ...
    def __get__(self, instance: Any, owner: type) -> Self | Attitude:
        if instance is None:
            return self
        columns = (self.quaternion, self.rates, self.momenta)
        return Attitude(*(ca.vertcat(*(instance.symbols[name] for name in names)) for names in columns))


class _Formula(Declaration, Generic[T]):
    """A declared expression: a method of the component behind a unit and a description; abstract."""

    def __init__(
        self, unit: str, description: str, method: Callable[[Any], T], *, unchecked: str | None = None
    ) -> None:
        if not callable(method):
            raise ComponentError(f"{description!r}: {method!r} is no method; put the declaration above one, as @...")
        super().__init__(unit, description, unchecked)
        self.method = method

    @overload
    def __get__(self, instance: None, owner: type) -> Self: ...
    @overload
    def __get__(self, instance: object, owner: type) -> T: ...
    def __get__(self, instance: Any, owner: type) -> Self | T:
        if instance is None:
            return self
        if self.name not in instance.formulas:
            value: Any = self.method(instance)
            if isinstance(value, Mapping):
                value = Components(f"{type(instance).__name__}.{self.name}", value)
            instance.formulas[self.name] = value
        return instance.formulas[self.name]


class Point(_Formula[Mapping[str, ca.SX]]):
    """A named point, which is a port: other mechanisms may be attached to it."""


class Output(_Formula[ca.SX]):
    """An output of the FMU beyond the systematic ones."""


class Calculated(_Formula[ca.SX]):
    """A number that follows from the parameters alone."""


class Condition(_Formula[ca.SX]):
    """An expression that must stay positive; a singularity lies where it vanishes."""


class Constraint(_Formula[ca.SX]):
    """An expression of the configuration that stays zero (K eq. 2)."""


class NonHolonomic(_Formula[ca.SX]):
    """An expression of configuration and rates that stays zero, upheld by Gauss's principle (K eq. 107)."""


class Submersion(_Formula[ca.SX]):
    """An active constraint π(x) = σ(t) on coordinates that are not adapted to it (M eq. 20)."""

    def __init__(
        self,
        unit: str,
        description: str,
        method: Callable[[Any], ca.SX],
        active: ActiveCoordinate,
        *,
        unchecked: str | None = None,
    ) -> None:
        super().__init__(unit, description, method, unchecked=unchecked)
        self.active = active

    def __set_name__(self, owner: type, name: str) -> None:
        super().__set_name__(owner, name)
        self.active.name = name


@_explained
def submersion(
    unit: str,
    description: str,
    *,
    start: float,
    above: float | None = None,
    below: float | None = None,
    unchecked: str | None = None,
) -> Callable[[Callable[[Any], ca.SX]], Submersion]:
    """Declare an active constraint π(x) = σ(t); the method returns π(x), and σ is an FMU input of its name.

    :param start: value of σ until the operator gives another; the start of the motion has to fit it.
    :param above: excluded lower bound of σ, ``below`` the upper one.
    """
    active = ActiveCoordinate(unit, description, start=start, above=above, below=below)
    return lambda method: Submersion(unit, description, method, active, unchecked=unchecked)


@_explained
def constraint(
    unit: str, description: str, *, unchecked: str | None = None
) -> Callable[[Callable[[Any], ca.SX]], Constraint]:
    """Declare a passive constraint; the method returns the expression of the configuration that stays zero."""
    return lambda method: Constraint(unit, description, method, unchecked=unchecked)


@_explained
def non_holonomic(
    unit: str, description: str, *, unchecked: str | None = None
) -> Callable[[Callable[[Any], ca.SX]], NonHolonomic]:
    """Declare a non-holonomic constraint; the method returns the expression of rates that stays zero."""
    return lambda method: NonHolonomic(unit, description, method, unchecked=unchecked)


@_explained
def point(
    unit: str, description: str, *, unchecked: str | None = None
) -> Callable[[Callable[[Any], Mapping[str, ca.SX]]], Point]:
    """Declare a named point: the method returns its components, for example ``{"x": ..., "z": ...}``.

    :param unit: unit of every component, ``"m"`` as a rule.
    :param description: what moves there, for example ``"the bob"``.
    """
    return lambda method: Point(unit, description, method, unchecked=unchecked)


@_explained
def output(unit: str, description: str, *, unchecked: str | None = None) -> Callable[[Callable[[Any], ca.SX]], Output]:
    """Declare an extra output; the method returns a scalar expression of coordinates, rates, momenta, forces."""
    return lambda method: Output(unit, description, method, unchecked=unchecked)


@_explained
def calculated(
    unit: str, description: str, *, unchecked: str | None = None
) -> Callable[[Callable[[Any], ca.SX]], Calculated]:
    """Declare a calculated parameter; the method returns a scalar expression of the parameters."""
    return lambda method: Calculated(unit, description, method, unchecked=unchecked)


def unchecked(reason: str) -> Callable[[Callable[P, T]], Callable[P, T]]:
    """Say of a method such as ``potential_energy`` why its unit is not checked; declarations take ``unchecked=``.

    :param reason: for example ``"an empirical law, numbers in SI units"``.
    """
    why = _reason(reason)

    def mark(method: Callable[P, T]) -> Callable[P, T]:
        setattr(method, UNCHECKED, why)
        return method

    return mark


UNCHECKED = "unchecked_because"


@_explained
def condition(text: str, *, unchecked: str | None = None) -> Callable[[Callable[[Any], ca.SX]], Condition]:
    """Declare what must stay positive; ``text`` is the message when it does not, for example ``"r must stay > 0"``."""
    return lambda method: Condition("1", text, method, unchecked=unchecked)


def _reason(why: object) -> str:
    if not isinstance(why, str) or not why.strip():
        raise ComponentError(f"unchecked = {why!r}: say why, for example unchecked='an empirical law'")
    return why


def _number(value: float, description: str) -> float:
    if isinstance(value, str):
        raise ComponentError(f"{description!r}: {value!r} is text; write a number, without quotation marks")
    try:
        number = float(value)
    except (TypeError, ValueError):
        raise ComponentError(f"{description!r}: {value!r} is not a number") from None
    if not math.isfinite(number):
        raise ComponentError(f"{description!r}: {number} is not finite")
    return number
