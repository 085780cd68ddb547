"""Declarations of a component: parameters, coordinates, points, outputs, constraints, assertions.

Each declaration is a descriptor.  On the class it is the declaration itself (unit, start value, domain); on an
instance of the component it is the CasADi symbol or expression of that name.
"""

import inspect
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any, ClassVar, Generic, Literal, NoReturn, ParamSpec, Self, TypeVar, overload

import casadi as ca

from liaisons.base import units
from liaisons.base.arguments import check_finite, check_integer
from liaisons.base.array_names import suffixed_name
from liaisons.errors import ComponentError, suggestion
from liaisons.language.variables import Causality, Dimension, Variability, Variable, element

P = ParamSpec("P")
T = TypeVar("T")


class Declaration(ABC, Generic[T]):
    """Name, unit and description; abstract.

    :param unit: SI unit, for example ``"kg.m2"``; ``"1"`` for a pure number.
    :param description: in a few words; of a coordinate, with its zero and sense.
    :param unchecked: why its unit is not checked, for example ``"an empirical law"``.
    :raises ComponentError: for a unit that is not understood, or an argument that is missing or unknown.
    """

    example: ClassVar[str] = ""  # for messages about wrong arguments
    name: str = "?"
    owner: str = "?"  # name of the class that declares it
    size: str = ""  # of an array in a mechanism: name of a Size, or that less a number

    def __new__(cls, *arguments: Any, **options: Any) -> Self:
        try:
            inspect.signature(cls.__init__).bind(None, *arguments, **options)
        except TypeError as error:
            texts = [value for value in (*arguments, *options.values()) if isinstance(value, str)]
            lone = len(texts) == 1 and "description" in str(error)  # the only text stands in the place of the unit
            reason = f"the unit is missing beside {texts[0]!r}" if lone and not _is_unit(texts[0]) else str(error)
            raise ComponentError(f"{cls.__name__}: {reason}; write for example {cls.example}") from None
        return super().__new__(cls)

    def __init__(self, unit: str, description: str, *, unchecked: str | None = None) -> None:
        if not isinstance(unit, str):
            raise ComponentError(f"unit {unit!r}: the unit comes first as a string, e.g. 'kg'; dimensionless is '1'")
        if not description:
            raise ComponentError(f"declaration with unit {unit!r}: say in the description what it is")
        if unit:
            try:
                units.parse(unit)
            except ValueError as error:
                raise ComponentError(f"{description!r}: {error}") from None
        self.unit, self.description = unit, description
        self.unchecked = None if unchecked is None else _checked_reason(unchecked)

    def __set_name__(self, owner: type, name: str) -> None:
        self.owner, self.name = owner.__name__, name

    def refuse(self, reason: str) -> NoReturn:
        """Raise a ComponentError about this declaration."""
        raise ComponentError(f"{self.owner}.{self.name}: {reason}")

    @overload
    def __get__(self, instance: None, owner: type) -> Self: ...
    @overload
    def __get__(self, instance: object, owner: type) -> T: ...
    def __get__(self, instance: Any, owner: type) -> Self | T:
        return self if instance is None else self.value_in(instance)

    @abstractmethod
    def value_in(self, instance: Any) -> T:
        """Value on an instance of the component: a symbol or an expression."""

    def extent(self, owner: type) -> Dimension | None:
        """Number of elements of an array in a mechanism; None for a scalar."""
        if not self.size:
            return None
        name, _, less = self.size.replace(" ", "").partition("-")
        size = getattr(owner, name, None)
        if not isinstance(size, Size) or (less and not less.isdigit()):
            self.refuse(f"size = {self.size!r}: name a Size of the mechanism, as 'n' or 'n - 1'")
        count = size.default - int(less or 0)
        if count < 1:
            self.refuse(f"size = {self.size!r} is {count} with {name} = {size.default}")
        return Dimension(self.size, count, size.description)

    def elements(self, owner: type) -> tuple[Self, ...]:
        """Declarations of the elements of an array; for a scalar, the declaration itself."""
        extent = self.extent(owner)
        return (self,) if extent is None else tuple(self._element(i) for i in range(extent.count))

    def _element(self, i: int) -> Self:
        """Declaration of element i, from 0, whose name counts from 1."""
        item = object.__new__(type(self))
        vars(item).update(vars(self), name=element(self.name, i + 1), size="")
        return item


class Symbol(Declaration[ca.SX]):
    """A declaration that stands for one scalar symbol with a start value and a domain; abstract.

    :param start: default value.
    :param above: excluded lower bound.
    :param minimum: included lower bound.
    :param below: excluded upper bound.
    :param maximum: included upper bound.
    :param symbol: letter in the FMU's documentation, ``"κ"`` or ``"m_1"``; by default that of the name.
    :raises ComponentError: for contradictory bounds, or a value that is not a number.
    """

    leading: tuple[float, ...] = ()  # start values of the first elements of an array

    def __init__(
        self,
        unit: str,
        description: str,
        *,
        start: float = 0.0,
        above: float | None = None,
        minimum: float | None = None,
        below: float | None = None,
        maximum: float | None = None,
        symbol: str = "",
        unchecked: str | None = None,
    ) -> None:
        super().__init__(unit, description, unchecked=unchecked)
        if not isinstance(symbol, str):
            raise ComponentError(f"{description!r}: symbol = {symbol!r}: write the letter as text, e.g. 'κ' or 'm_1'")
        self.symbol = symbol
        excluded, included = [x for x in (above, below) if x is not None], [minimum, maximum]
        if (above is not None and minimum is not None) or (below is not None and maximum is not None):
            raise ComponentError(f"{description!r}: give either the excluded bound (above, below) or the included one")
        if excluded and included != [None, None]:
            raise ComponentError(f"{description!r}: the two bounds must be both excluded or both included")
        self.strict = bool(excluded)
        low, high = (above, below) if self.strict else (minimum, maximum)
        self.start = _finite_number(start, description)
        self.minimum, self.maximum = (x if x is None else _finite_number(x, description) for x in (low, high))

    def value_in(self, instance: Any) -> ca.SX:
        if self.size:
            return ca.vertcat(*(instance.symbols[item.name] for item in self.elements(type(instance))))
        return instance.symbols[self.name]

    def __set__(self, instance: object, value: object) -> None:
        raise ComponentError(f"{type(instance).__name__}.{self.name} is a symbol and cannot be assigned")

    def _element(self, i: int) -> Self:
        item = super()._element(i)
        item.start, item.leading = _element_value(self.leading, i, self.start), ()
        return item

    def variable(self, causality: Causality, variability: Variability) -> Variable:
        """FMU variable of the symbol, with its start value and domain."""
        return Variable(
            self.name,
            self.unit,
            self.description,
            causality,
            variability,
            start=self.start,
            minimum=self.minimum,
            maximum=self.maximum,
            strict=self.strict,
            symbol=self.symbol,
        )

    def start_parameter(self) -> Variable:
        """FMU parameter ``name_0`` for the start value."""
        return replace(self.variable("parameter", "fixed"), name=suffixed_name(self.name, "_0"), symbol="")


class Parameter(Symbol):
    """A parameter, set before the start.

    :param default: default value [unit]; of an array also a tuple, whose last value is that of all further elements.
    :param tunable: may change between two communication steps.
    :param size: of an array in a mechanism: name of a Size, ``"n"``, or that less a number, ``"n - 1"``.
    """

    example = 'Parameter(1.0, "kg", "mass of the bob")'

    def __init__(
        self,
        default: float | tuple[float, ...],
        unit: str,
        description: str,
        *,
        above: float | None = None,
        minimum: float | None = None,
        below: float | None = None,
        maximum: float | None = None,
        tunable: bool = False,
        symbol: str = "",
        size: str = "",
        unchecked: str | None = None,
    ) -> None:
        self.leading, start = _leading_and_rest(default, description)
        if self.leading:
            start = self.leading[-1]
        bounds = {"above": above, "minimum": minimum, "below": below, "maximum": maximum}
        super().__init__(unit, description, start=start, symbol=symbol, unchecked=unchecked, **bounds)
        self.tunable, self.size = tunable, size

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the symbols."""
        return (self.name,)


class ParameterArray(Parameter):
    """An array of parameters; the symbol is a column.

    :param default: default values of the first elements; the rest are 0.
    :param dimension: number of elements, and its name in the FMU.
    """

    example = 'ParameterArray((0.0, 1.0), "s", "instants", Dimension("knots", 100, "number of knots"))'

    def __init__(self, default: tuple[float, ...], unit: str, description: str, dimension: Dimension) -> None:
        super().__init__(default, unit, description)
        self.dimension = dimension

    @property
    def names(self) -> tuple[str, ...]:
        return tuple(element(self.name, i) for i in range(1, self.dimension.count + 1))

    def value_in(self, instance: Any) -> ca.SX:
        return ca.vertcat(*(instance.symbols[name] for name in self.names))

    def variable(self, causality: Causality, variability: Variability) -> Variable:
        return replace(super().variable(causality, variability), start=self.leading, dimension=self.dimension)


class Gravity(Parameter):
    """The gravitational acceleration g [m/s2], of either sign; 0 is weightlessness."""

    example = "Gravity()"

    def __init__(self) -> None:
        super().__init__(9.81, "m/s2", "gravitational acceleration", symbol="g")


class Friction(Parameter):
    """Friction coefficient η [1/s] of K eq. 64, tunable, for all velocities of the component.

    :param description: in a few words.
    :param symbol: its letter.
    """

    example = 'Friction("of the air")'

    def __init__(self, description: str = "friction coefficient eta of K eq. 61", symbol: str = "η") -> None:
        super().__init__(0.0, "1/s", description, minimum=0, tunable=True, symbol=symbol)


class Coordinate(Symbol):
    """A free coordinate q, which follows the equations of motion (x^i, i <= p, of M 3.5).

    :param start: initial value.  In a chain also a tuple: values of the first links; those of the others are 0.
        Likewise in an array, which has a ``size``, as parameters have.
    :param start_rate: initial rate, likewise.
    :param above: excluded lower bound of the motion.
    :param below: excluded upper bound; a singularity lies at both.
    :param nominal: nominal value, which scales the absolute tolerance.
    """

    example = 'Coordinate("m", "height of the bead")'

    def __init__(
        self,
        unit: str,
        description: str,
        *,
        start: float | tuple[float, ...] = 0.0,
        start_rate: float | tuple[float, ...] = 0.0,
        above: float | None = None,
        below: float | None = None,
        nominal: float = 1.0,
        symbol: str = "",
        size: str = "",
    ) -> None:
        self.leading, rest = _leading_and_rest(start, description)
        super().__init__(unit, description, start=rest, above=above, below=below, symbol=symbol)
        self.leading_rates, rate = _leading_and_rest(start_rate, description)
        self.start_rate, self.size = _finite_number(rate, description), size
        self.nominal = _finite_number(nominal, description)
        if self.nominal <= 0:
            raise ComponentError(f"{description!r}: nominal = {nominal} must be > 0")

    def _element(self, i: int) -> Self:
        item = super()._element(i)
        item.start_rate, item.leading_rates = _element_value(self.leading_rates, i, self.start_rate), ()
        return item


class ActiveCoordinate(Symbol):
    """An active coordinate s = σ(t): an operator prescribes it (x^α, α > p, of M 3.5)."""

    example = 'ActiveCoordinate("m", "length of the rope", start=1.0)'


class Input(Symbol):
    """An input of an operator, to be connected with an output of the mechanism that it controls."""

    example = 'Input("rad/s", "rate of the swing")'


class InternalState(Symbol):
    """A state that is not a coordinate, for example the friction of a thermostat; ``internal_rates`` gives its rate."""

    example = 'InternalState("1/s", "friction of the thermostat")'


class DiscreteState(Symbol):
    """A number that a sampled component holds from one sample to the next; ``update`` gives the next one.

    :param start: value before the first sample.
    """

    example = 'DiscreteState("rad.s", "integral of the error")'
    causality: ClassVar[Causality] = "local"


class DiscreteOutput(DiscreteState):
    """An output of a sampled component, constant between samples; ``update`` gives the next one."""

    example = 'DiscreteOutput("N", "force of the motor")'
    causality: ClassVar[Causality] = "output"


class Size(Declaration[int]):
    """A structural parameter: the number of links of a chain, or of elements, at least 2, fixed when the FMU is built.

    :param default: default value.
    """

    example = 'Size(10, "number of links")'

    def __init__(self, default: int, description: str) -> None:
        super().__init__("1", description)
        self.default = self.checked("Size", default)

    def checked(self, owner: str, value: Any) -> int:
        """Number of links or elements as an ``int``.

        :raises ComponentError: unless it is a whole number >= 2.
        """
        check_integer(f"{owner}: {self.name}", value, ComponentError, minimum=2)
        return int(value)

    def value_in(self, instance: Any) -> int:
        return instance.sizes[self.name]


class Components(dict[str, Any]):
    """Components of a point by axis; a missing one raises a ComponentError that names the others."""

    def __init__(self, label: str, components: Mapping[str, Any]) -> None:
        super().__init__(components)
        self.label = label

    def __missing__(self, axis: object) -> Any:
        raise ComponentError(f"{self.label} has no component {axis!r}{suggestion(str(axis), self)}")


class Joint(Declaration[Components]):
    """Joint of a link of a chain with the previous one; ``self.joint`` maps its axes to symbols.

    :param unit: unit of the axes, ``"m"`` as a rule.
    :param axes: their names, ``"x", "z"``.
    :param others: further axes with units of their own, ``phi="rad"``.
    """

    example = 'Joint("m", "x", "z", phi="rad")'

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

    def value_in(self, instance: Any) -> Components:
        axes = {axis: instance.symbols[f"{self.name}_{axis}"] for axis in self.axes}
        return Components(f"{type(instance).__name__}.{self.name}", axes)


@dataclass(frozen=True, eq=False)
class Attitude:
    """Symbols of an orientation: ``self.attitude`` in a method of the component."""

    quaternion: ca.SX  # (4, 1), scalar first, body to inertial frame
    rate: ca.SX  # (3, 1), angular velocity in the body frame
    momentum: ca.SX  # (3, 1), angular momentum in the inertial frame

    @property
    def matrix(self) -> ca.SX:
        """Rotation matrix (3, 3) from body to inertial frame, if the quaternion has unit length."""
        w, x, y, z = ca.vertsplit(self.quaternion)
        return ca.vertcat(
            ca.horzcat(1 - 2 * (y**2 + z**2), 2 * (x * y - w * z), 2 * (x * z + w * y)),
            ca.horzcat(2 * (x * y + w * z), 1 - 2 * (x**2 + z**2), 2 * (y * z - w * x)),
            ca.horzcat(2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x**2 + y**2)),
        )

    @property
    def kinematics(self) -> ca.SX:
        """Matrix K (4, 3) from the angular velocity to the rate of the quaternion, q̇ = K ω = q (0, ω)/2."""
        w, x, y, z = ca.vertsplit(self.quaternion)
        rows = ((-x, -y, -z), (w, -z, y), (z, w, -x), (-y, x, w))
        return ca.vertcat(*(ca.horzcat(*row) for row in rows)) / 2


class Orientation(Declaration[Attitude]):
    """Free orientation of a body: unit quaternion, its angular velocity, and angular momentum as the momentum.

    The FMU has the states ``q_w, q_x, q_y, q_z`` (body to inertial frame) and ``H_x, H_y, H_z`` (inertial frame,
    constant where no torque acts), and the outputs ``omega_x, omega_y, omega_z`` (body frame) with derivatives.

    :param start: ``"rate"``: the start values are ``omega_x_0``, ...; ``"momentum"``: they are ``H_x_0``, ...
    :param prefix: of the names of these variables, where a mechanism has several orientations.
    """

    example = 'Orientation("attitude of the body")'
    quaternion = ("q_w", "q_x", "q_y", "q_z")
    rates = ("omega_x", "omega_y", "omega_z")
    accelerations = ("omega_x_dot", "omega_y_dot", "omega_z_dot")
    momenta = ("H_x", "H_y", "H_z")

    def __init__(self, description: str, *, start: Literal["rate", "momentum"] = "rate", prefix: str = "") -> None:
        super().__init__("1", description)
        self.start = start
        for kind in ("quaternion", "rates", "accelerations", "momenta"):
            setattr(self, kind, tuple(prefix + name for name in getattr(self, kind)))

    def value_in(self, instance: Any) -> Attitude:
        columns = (self.quaternion, self.rates, self.momenta)
        return Attitude(*(ca.vertcat(*(instance.symbols[name] for name in names)) for names in columns))


class DeclaredFormula(Declaration[T]):
    """Decorator of a method that returns an expression, as ``@output("m/s", "speed")``; abstract."""

    method: Callable[[Any], T]

    def __call__(self, method: Callable[[Any], T]) -> Self:
        if not callable(method):
            text = f"{self.description!r}: {method!r} is not a method; put the declaration above one, as @..."
            raise ComponentError(text)
        self.method = method
        return self

    def value_in(self, instance: Any) -> T:
        if self.name not in instance.formulas:
            value: Any = self.method(instance)
            if isinstance(value, Mapping):
                value = Components(f"{type(instance).__name__}.{self.name}", value)
            instance.formulas[self.name] = value
        return instance.formulas[self.name]


class point(DeclaredFormula[Mapping[str, ca.SX]]):
    """A named point: a port, to which other mechanisms may be attached.

    The method returns its components in the same unit, for example ``{"x": ..., "z": ...}``.
    """

    example = '@point("m", "the bob")'


class output(DeclaredFormula[ca.SX]):
    """An output of the FMU beyond the systematic ones: of coordinates, rates, momenta, forces."""

    example = '@output("m/s", "speed of the bob")'


class calculated(DeclaredFormula[ca.SX]):
    """A calculated parameter: a number that depends on parameters alone."""

    example = '@calculated("rad/s", "angular frequency")'


class constraint(DeclaredFormula[ca.SX]):
    """A holonomic constraint: an expression of the configuration that stays zero (K eq. 2)."""

    example = '@constraint("m", "the rod keeps its length")'


class non_holonomic(DeclaredFormula[ca.SX]):
    """A non-holonomic constraint: an expression of configuration and rates that stays zero, by Gauss (K eq. 110)."""

    example = '@non_holonomic("m/s", "the wheel does not slip")'


class ContactFormula(DeclaredFormula[ca.SX]):
    """A contact, whose arrays take the elements of the arrays that they name; abstract."""

    names: ClassVar[tuple[str, ...]]  # attributes that name parameters or contacts
    is_friction: ClassVar[bool]
    last: bool  # of a chain: of the last link alone

    @abstractmethod
    def variables(self, readable: Callable[..., Variable], at_events: Callable[..., Variable]) -> Iterator[Variable]:
        """Output variables of the contact.

        :param readable: makes one of name, unit and description.
        :param at_events: makes one that changes at events alone.
        """

    @abstractmethod
    def check(
        self,
        m: Any,
        formulas: Any,
        configuration: Mapping[str, ca.SX],
        motion: Mapping[str, ca.SX],
        free: tuple[ca.SX, ca.SX],
    ) -> None:
        """Raise a ComponentError if the contact is declared wrongly.

        :param m: the mechanism or chain.
        :param formulas: its checked formulas.
        :param configuration: symbols that a gap may depend on, by name.
        :param motion: symbols that a slip may depend on.
        :param free: coordinates and their rates.
        """

    def elements(self, owner: type) -> tuple[Self, ...]:
        items = super().elements(owner)
        arrays = [name for name in self.names if getattr(getattr(owner, str(getattr(self, name)), None), "size", "")]
        for i, item in enumerate(items if self.size else (), start=1):
            vars(item).update({name: element(getattr(self, name), i) for name in arrays})
        return items


class assertion(DeclaredFormula[ca.SX]):
    """An expression that must stay positive, as of Modelica's ``assert``; a singularity lies where it vanishes.

    :param text: message of a violation, for example ``"r must stay > 0"``.
    """

    example = '@assertion("r must stay > 0")'

    def __init__(self, text: str, *, unchecked: str | None = None) -> None:
        super().__init__("1", text, unchecked=unchecked)


class rheonomic_constraint(DeclaredFormula[ca.SX]):
    """An active constraint π(x) = σ(t), a submersion on coordinates not adapted to it (M eq. 20); σ is an FMU input.

    :param start: default value of σ, consistent with the start of the motion.
    :param above: excluded lower bound of σ.
    :param below: excluded upper bound.
    """

    example = '@rheonomic_constraint("m", "length of the rope", start=1.0)'

    def __init__(
        self,
        unit: str,
        description: str,
        *,
        start: float,
        above: float | None = None,
        below: float | None = None,
        unchecked: str | None = None,
    ) -> None:
        super().__init__(unit, description, unchecked=unchecked)
        self.active = ActiveCoordinate(unit, description, start=start, above=above, below=below)

    def __set_name__(self, owner: type, name: str) -> None:
        super().__set_name__(owner, name)
        self.active.name = name


def declare(cls: type, name: str, declaration: Declaration) -> None:
    """Add a declaration to a class, as if it stood in its body."""
    setattr(cls, name, declaration)
    declaration.__set_name__(cls, name)


UNCHECKED = "unchecked_because"


def unchecked(reason: str) -> Callable[[Callable[P, T]], Callable[P, T]]:
    """Decorator of a method whose unit is not checked, as of ``potential_energy``; declarations take ``unchecked=``.

    :param reason: for example ``"an empirical law, numbers in SI units"``.
    """
    why = _checked_reason(reason)

    def mark(method: Callable[P, T]) -> Callable[P, T]:
        setattr(method, UNCHECKED, why)
        return method

    return mark


def _is_unit(text: str) -> bool:
    try:
        units.parse(text)
    except ValueError:
        return False
    return True


def _checked_reason(why: object) -> str:
    if not isinstance(why, str) or not why.strip():
        raise ComponentError(f"unchecked = {why!r}: say why, for example unchecked='an empirical law'")
    return why


def _leading_and_rest(value: float | tuple[float, ...], description: str) -> tuple[tuple[float, ...], float]:
    """Values of the first elements of an array, and the value of all further ones."""
    return (tuple(_finite_number(x, description) for x in value), 0.0) if isinstance(value, tuple) else ((), value)


def _element_value(leading: tuple[float, ...], i: int, rest: float) -> float:
    return leading[i] if i < len(leading) else rest


def _finite_number(value: float, description: str) -> float:
    check_finite(repr(description), value, ComponentError)
    return float(value)
