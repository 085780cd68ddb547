"""What mechanisms and operators have in common: a class of declarations, an instance of symbols."""

from __future__ import annotations

import inspect
import re
import warnings
from abc import ABC, abstractmethod
from collections.abc import Iterable, Mapping
from difflib import get_close_matches
from types import CodeType, FunctionType
from typing import Any, ClassVar, TypeVar

import casadi as ca

from liaisons import units
from liaisons.errors import ComponentError, LiaisonsError, suggestion
from liaisons.expressions.dimensions import Declared
from liaisons.language.declarations import (
    UNCHECKED,
    ActiveCoordinate,
    Coordinate,
    Declaration,
    Friction,
    InternalState,
    Parameter,
    Point,
)
from liaisons.language.variables import Experiment

D = TypeVar("D", bound=Declaration)
_IDENTIFIER = re.compile(r"^[A-Za-z][A-Za-z0-9_]*$")


class Component(ABC):
    """A model with declared parameters, on its way to an FMU; abstract.

    On the class, ``Pendulum.mass`` is the declaration.  An instance is the symbolic picture of the component:
    ``self.mass`` is a CasADi symbol.  Subclasses are checked when they are defined: what is wrong is reported by
    name, before any derivation.
    """

    experiment: ClassVar[Experiment] = Experiment()
    parameters: ClassVar[tuple[Parameter, ...]] = ()
    symbols: dict[str, ca.SX]
    formulas: dict[str, Any]
    parameter_column: ca.SX
    is_abstract: ClassVar[bool] = True

    def __init__(self) -> None:
        self.symbols = {}
        self.formulas = {}
        self.parameter_column = self._symbols(p.name for p in self.parameters)

    def __init_subclass__(cls, *, abstract: bool = False, **kwargs: Any) -> None:
        super().__init_subclass__(**kwargs)
        cls.is_abstract = abstract
        cls._collect()
        _reject_misspelt_methods(cls)
        if not abstract:
            _require_methods(cls)
            _reject_name_clashes(cls)
            cls._check()

    @classmethod
    def _collect(cls) -> None:
        cls.parameters = declared(cls, Parameter)

    @classmethod
    @abstractmethod
    def _check(cls) -> None:
        """Raise a ComponentError for what can be found wrong without deriving anything."""

    @classmethod
    @abstractmethod
    def variable_names(cls) -> list[str]:
        """Names of all FMU variables of the component, in no particular order."""

    @classmethod
    def summary(cls) -> str:
        """First line of the docstring."""
        return (inspect.getdoc(cls) or cls.__name__).splitlines()[0]

    def declared_friction(self) -> ca.SX:
        """η of K eq. 64 where the component declares one; else 0."""
        return sum((self.symbols[p.name] for p in self.parameters if isinstance(p, Friction)), ca.SX(0))

    def __getattr__(self, name: str) -> Any:
        # Only reached for names that do not exist: a misspelt symbol in one of the component's methods.
        if name.startswith("__") or "symbols" not in self.__dict__:
            raise AttributeError(name)
        known = [*self.symbols, *(n for n in dir(type(self)) if not n.startswith("_"))]
        raise ComponentError(f"{type(self).__name__}: unknown symbol self.{name}{suggestion(name, known)}")

    def _symbols(self, names: Iterable[str]) -> ca.SX:
        column = [ca.SX.sym(name) for name in names]
        self.symbols.update((str(symbol), symbol) for symbol in column)
        return ca.vertcat(*column) if column else ca.SX(0, 1)


def declared(cls: type, kind: type[D]) -> tuple[D, ...]:
    """Declarations of one kind, base classes first, each in the order of the file."""
    found: dict[str, D] = {}
    for base in reversed(cls.__mro__):
        for name, value in vars(base).items():
            found.pop(name, None)  # what a subclass overrides takes its place
            if isinstance(value, kind):
                found[name] = value
    return tuple(found.values())


def scalar(owner: type, name: str, value: Any, symbols: dict[str, ca.SX]) -> ca.SX:
    """The value as a scalar expression of known symbols.

    :raises ComponentError: if it is no expression, no scalar, or holds a symbol that the component does not have.
    """
    label = f"{owner.__name__}.{name}"
    if value is None:
        raise ComponentError(f"{label} returns nothing; return a CasADi expression or a number")
    try:
        expression = ca.SX(value)
    except (NotImplementedError, TypeError):
        raise ComponentError(f"{label} returns {value!r}; return a CasADi expression or a number") from None
    if expression.shape != (1, 1):
        raise ComponentError(f"{label} has shape {expression.shape}; return a scalar, (1, 1)")
    known = {symbol.__hash__() for symbol in symbols.values()}
    strangers = [str(symbol) for symbol in ca.symvar(expression) if symbol.__hash__() not in known]
    if strangers:
        raise ComponentError(f"{label} contains the unknown symbol {strangers[0]!r}{suggestion(strangers[0], symbols)}")
    return expression


def call(instance: Component, name: str, *arguments: Any) -> Any:
    """Evaluate a method or formula of a component; whatever it raises becomes a ComponentError with its name."""
    try:
        with warnings.catch_warnings():
            warnings.filterwarnings("error", message=r"\s*casadi: a numpy function", category=FutureWarning)
            value = getattr(instance, name)
            return value(*arguments) if callable(value) else value
    except LiaisonsError:
        raise
    except Exception as error:
        raise ComponentError(f"{type(instance).__name__}.{name}: {_reason(error)}") from error


def _reason(error: Exception) -> str:
    """What went wrong in a method, in words that say what to write instead."""
    text = str(error).strip().splitlines()
    if isinstance(error, FutureWarning) or "no implementation found for 'numpy" in str(error):
        return "a function of numpy is given a symbol; use CasADi's, which know symbols: ca.sin, ca.sqrt, ca.fmax, ..."
    if "truth value" in str(error):
        return (
            "'if', 'and', 'or', 'not', max() and min() ask for the truth of a symbol, which has none before the "
            "simulation; use ca.if_else(condition, a, b), ca.logic_and, ca.logic_or, ca.fmax, ca.fmin"
        )
    return f"{type(error).__name__}: {text[-1] if text else 'no reason is given'}"


def components_of(picture: Component, item: Point) -> Mapping[str, ca.SX]:
    """What a named point returns: its components, by axis; anything else is a ComponentError."""
    components = call(picture, item.name)
    if not isinstance(components, Mapping) or not components:
        raise ComponentError(
            f"{type(picture).__name__}.{item.name}: return the components, e.g. {{'x': ..., 'z': ...}}"
        )
    return components


def formula_unit(owner: type[Component], name: str, unit: str) -> str | None:
    """Unit that a method or formula is checked with; None where nothing of it is to be checked."""
    attribute = inspect.getattr_static(owner, name)
    if isinstance(attribute, Declaration):
        return None if attribute.unchecked else unit
    return None if hasattr(attribute, UNCHECKED) else unit


def checked(owner: type[Component], name: str, expression: ca.SX, unit: str) -> Iterable[Declared]:
    """The expression of a method or formula for the check of units, unless this is unchecked.

    :param name: of the method or formula, with what is taken of it in brackets: ``"bob['x']"``.
    """
    if formula_unit(owner, name.partition("[")[0], unit) is not None:
        yield Declared(f"{owner.__name__}.{name}", expression, unit)


def check_internal_rates(
    picture: Component, states: Iterable[InternalState], symbols: dict[str, ca.SX]
) -> list[Declared]:
    """Raise a ComponentError unless ``internal_rates`` gives one scalar rate for each internal state.

    :returns: the rates with the units that they must have.
    """
    owner, given, unit = type(picture), call(picture, "internal_rates"), {s.name: s.checked_unit for s in states}
    if not isinstance(given, Mapping) or given.keys() != unit.keys():
        what = sorted(given) if isinstance(given, Mapping) else given
        raise ComponentError(f"{owner.__name__}.internal_rates gives {what}; it must give {sorted(unit)}")
    found: list[Declared] = []
    for name, rate in given.items():
        label = f"internal_rates[{name!r}]"
        expected = units.rate(unit[name]) if unit[name] else units.ANY
        found += checked(owner, label, scalar(owner, label, rate, symbols), expected)
    return found


def require_units(cls: type[Component]) -> None:
    """Raise a ComponentError for a declaration without a unit; only an operator's may take any."""
    for item in declared(cls, Declaration):
        if item.unit == units.ANY:
            raise ComponentError(f"{cls.__name__}.{item.name} has no unit; that of a pure number is '1'")


def _require_methods(cls: type[Component]) -> None:
    """Raise a ComponentError for a method that a component has to define and does not."""
    for name in dir(cls):
        if name != "_check" and getattr(inspect.getattr_static(cls, name), "__isabstractmethod__", False):
            base = next(base for base in cls.__mro__ if name in vars(base))
            raise ComponentError(f"{cls.__name__} defines no {name}(), which every {base.__name__} has to")


def _ours(cls: type) -> bool:
    return cls.__module__.startswith("liaisons.language")


def _reject_misspelt_methods(cls: type[Component]) -> None:
    """Raise a ComponentError for a method that nothing calls and whose name is nearly one that would be called."""
    if _ours(cls):
        return
    own = {name for name, value in vars(cls).items() if isinstance(value, FunctionType) and name[0] != "_"}
    inherited = {name for base in cls.__mro__[1:] for name in vars(base)}
    ours = (vars(base).items() for base in cls.__mro__ if _ours(base))
    known = {name for items in ours for name, value in items if isinstance(value, FunctionType) and name[0] != "_"}
    for name in sorted(own - inherited):
        near = get_close_matches(name, known | {"exact", "picture"}, n=1, cutoff=0.85)
        if near and near[0] not in name and name not in _called(cls):
            raise ComponentError(f"{cls.__name__}.{name}: nothing calls this method; did you mean {near[0]!r}?")


def _called(cls: type[Component]) -> set[str]:
    """Names that occur in the methods and formulas of a component."""
    methods = (getattr(value, "method", value) for base in cls.__mro__ for value in vars(base).values())
    waiting: list[Any] = [method.__code__ for method in methods if isinstance(method, FunctionType)]
    found: set[str] = set()
    while waiting:
        code = waiting.pop()
        found.update(code.co_names)
        waiting += [constant for constant in code.co_consts if isinstance(constant, CodeType)]
    return found


def _reject_name_clashes(cls: type[Component]) -> None:
    for item in declared(cls, Declaration):
        if not _IDENTIFIER.match(item.name):
            raise ComponentError(f"{cls.__name__}.{item.name}: use an ASCII identifier that starts with a letter")
        if item.name in _reserved(cls):
            raise ComponentError(f"{cls.__name__}.{item.name}: the name is taken by the base class; choose another")
    for item in (*cls.parameters, *declared(cls, Coordinate), *declared(cls, ActiveCoordinate)):
        variable = item.variable("parameter", "fixed")
        if not variable.allows(item.start):
            raise ComponentError(
                f"{cls.__name__}.{item.name}: default {item.start:g} {item.unit} is outside its own domain: "
                f"it must be {variable.domain()}"
            )
    seen: set[str] = set()
    for name in [*cls.variable_names(), "input_reconstruction", "symplectic_steps", "time"]:
        if name in seen:
            raise ComponentError(
                f"{cls.__name__}: two variables would be called {name!r}; rename the parameter, coordinate, "
                "point or output that makes the second one"
            )
        seen.add(name)


def _reserved(cls: type[Component]) -> set[str]:
    """Public names of the abstract bases, which a declaration must not hide."""
    names: set[str] = set()
    for base in cls.__mro__:
        if base.__module__.startswith("liaisons.language"):
            names.update(name for name, value in vars(base).items() if not isinstance(value, Declaration))
            names.update(vars(base).get("__annotations__", ()))
    return names
