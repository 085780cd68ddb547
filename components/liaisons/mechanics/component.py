"""What mechanisms and operators have in common: a class of declarations, an instance of symbols."""

from __future__ import annotations

import inspect
import re
from abc import ABC, abstractmethod
from collections.abc import Iterable
from typing import Any, ClassVar, TypeVar

import casadi as ca

from liaisons.errors import ComponentError, LiaisonsError, suggestion
from liaisons.mechanics.declarations import (
    ActiveCoordinate,
    Coordinate,
    Declaration,
    InternalState,
    Parameter,
)
from liaisons.mechanics.model import Experiment, Model

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
        if not abstract:
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
    @abstractmethod
    def model(cls) -> Model:
        """The component as variables and CasADi functions, ready for an FMU back end."""

    @classmethod
    def summary(cls) -> str:
        """First line of the docstring."""
        return (inspect.getdoc(cls) or cls.__name__).splitlines()[0]

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
        value = getattr(instance, name)
        return value(*arguments) if callable(value) else value
    except LiaisonsError:
        raise
    except Exception as error:
        text = str(error).strip().splitlines()
        reason = text[-1] if text else type(error).__name__
        raise ComponentError(f"{type(instance).__name__}.{name}: {type(error).__name__}: {reason}") from error


def check_internal_rates(picture: Component, states: Iterable[InternalState], symbols: dict[str, ca.SX]) -> None:
    """Raise a ComponentError unless ``internal_rates`` gives one scalar rate for each internal state."""
    owner, given, names = type(picture), call(picture, "internal_rates"), sorted(state.name for state in states)
    if sorted(given) != names:
        raise ComponentError(f"{owner.__name__}.internal_rates gives {sorted(given)}; it must give {names}")
    for name, rate in given.items():
        scalar(owner, f"internal_rates[{name!r}]", rate, symbols)


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
        if base.__module__.startswith("liaisons.mechanics"):
            names.update(name for name, value in vars(base).items() if not isinstance(value, Declaration))
            names.update(vars(base).get("__annotations__", ()))
    return names
