"""Closed forms: analytical solutions beside a component's declarations, independent of its derivation."""

from __future__ import annotations

import copy
import inspect
from collections.abc import Callable, Iterator, Mapping
from functools import cache
from typing import Any, Generic, TypeVar, final

import numpy as np
from numpy.typing import NDArray

from liaisons.errors import ComponentError, ValidityError, suggestion
from liaisons.language import Component, Mechanism, Size, Variable

R = TypeVar("R")
_RELATIONS: dict[str, Callable[[Any, Any], Any]] = {
    ">": np.greater,
    ">=": np.greater_equal,
    "<": np.less,
    "<=": np.less_equal,
    "==": np.equal,
    "!=": np.not_equal,
}


@final
class Values:
    """Arguments of a closed form: ``at.gravity`` is the value of the call, else that of the declaration."""

    def __init__(self, label: str, declared: Mapping[str, Variable], values: Mapping[str, object]) -> None:
        self._label, self._declared = label, declared
        self._values = {name: self._checked_value(name, value) for name, value in values.items()}
        self._read: set[str] = set()

    def __str__(self) -> str:
        return self._label

    def __getattr__(self, name: str) -> Any:
        if name.startswith("_"):
            raise AttributeError(name)
        self._read.add(name)
        return self._values[name] if name in self._values else _start_value(self._variable(name))

    def array(self, *names: str) -> NDArray:
        """Values of several variables as an array (n,)."""
        return np.array([getattr(self, name) for name in names])

    def require(self, holds: object, message: str) -> None:
        """Raise a ValidityError with this message unless a condition holds."""
        if not holds:
            raise ValidityError(f"{self}: {message}")

    def reject_unread(self, solution: str) -> None:
        """Raise a ValidityError for values of the call that the solution did not read, unless they are as declared."""
        for name, value in self._values.items():
            start = _start_value(self._declared[name])
            if name not in self._read and not np.array_equal(value, start):
                raise ValidityError(f"{self}: {name} = {value} must be {start}; it is {solution}")

    def _variable(self, name: str) -> Variable:
        if name not in self._declared:
            raise ValidityError(f"{self}: nothing is called {name!r}{suggestion(name, self._declared)}")
        return self._declared[name]

    def _checked_value(self, name: str, value: object) -> Any:
        variable = self._variable(name)
        shape = () if variable.dimension is None else (variable.count,)
        try:
            numbers = np.broadcast_to(np.asarray(value, dtype=float), shape)
        except (TypeError, ValueError):
            expected = "a number" if shape == () else f"{variable.count} numbers"
            raise ValidityError(f"{self}: {name} = {value!r}; give {expected}") from None
        if not all(np.isfinite(x) and variable.allows(float(x)) for x in numbers.ravel()):
            raise ValidityError(f"{self}: {name} = {value} must be {variable.domain() or 'finite'}")
        return numbers if shape else float(numbers)


@final
class ClosedForm(Generic[R]):
    """An analytical solution of a component, called with the names of its parameters, start values and inputs.

    ``Pendulum.exact(t, theta_0=0.5)``: ``t`` are times [s], of any shape; other values are as declared.  Results have
    the names and the units of the component's variables.

    :raises ValidityError: for an unknown name, a value outside its domain, or one that the solution does not cover.
    """

    def __init__(self, function: Callable[..., R], text: str, conditions: Mapping[str, str]) -> None:
        self._function, self._text, self._conditions = function, text, conditions
        self.owner: type[Component] | None = None
        self._signature = inspect.signature(function)
        self.__name__ = function.__name__
        holds = " and ".join(f"{name} {condition.replace('==', '=')}" for name, condition in conditions.items())
        first = f"{text[:1].upper()}{text[1:]}{', for ' if holds else ''}{holds}."
        self.__doc__ = "\n\n".join(filter(None, (first, inspect.cleandoc(function.__doc__ or ""))))

    def __set_name__(self, _: type, name: str) -> None:
        self.__name__ = name

    def __get__(self, _: object, owner: type[Component]) -> ClosedForm[R]:
        bound = copy.copy(self)
        bound.owner = owner
        return bound

    @property
    def arguments(self) -> tuple[str, ...]:
        """Names of its arguments, apart from the values of the component."""
        return tuple(name for name in self._signature.parameters if name not in {"at", "component"})

    def with_function(self, function: Callable[..., R]) -> ClosedForm[R]:
        """The same conditions and owner with another function of the same parameters."""
        other = ClosedForm(function, self._text, self._conditions)
        other.owner = self.owner
        return other

    def __call__(self, *arguments: Any, **values: Any) -> R:
        if self.owner is None:  # by another closed form: it is not an attribute of a component
            return self._function(*arguments, **values)
        label = f"{self.owner.__name__}.{self.__name__}"
        expected = self._signature.parameters
        own = {name: values.pop(name) for name in [*values] if name in expected}
        at = Values(label, _variables(self.owner, *_pop_size(self.owner, values)), values)
        own |= {name: value for name, value in (("at", at), ("component", self.owner)) if name in expected}
        try:
            call = self._signature.bind(*arguments, **own)
        except TypeError as error:
            raise TypeError(f"{label}: {error}") from None
        call.apply_defaults()
        bound = call.arguments
        if "t" in bound:
            bound["t"] = np.asarray(bound["t"], dtype=float)
        for name, condition in self._conditions.items():
            relation, _, bounding = condition.partition(" ")
            value, limit = (_word_value(word, bound, at) for word in (name, bounding))
            if not np.all(_RELATIONS[relation](value, limit)):
                shown = np.min(value) if np.ndim(value) else value
                raise ValidityError(f"{label}: {name} = {shown} must be {condition}; it is {self._text}")
        result = self._function(**bound)
        at.reject_unread(self._text)
        return result


def closed_form(text: str, **conditions: str) -> Callable[[Callable[..., R]], ClosedForm[R]]:
    """Decorator that makes a function the closed form of a component.

    It takes times ``t`` or other arguments, and ``at``: :class:`Values` of the component's variables, with the names,
    start values and domains of the declarations; a parameter ``component`` is the class.  It returns values by the
    names of variables::

        @closed_form("the motion with fixed pivot: Jacobi's elliptic functions", gravity="> 0", friction="== 0")
        @staticmethod
        def exact(t: NDArray, at: Values) -> dict[str, NDArray]: ...

    :param text: name of the solution, for the FMU's documentation and for messages.
    :param conditions: of values, beyond their domains: a relation and a number or another name.
    """
    for name, condition in conditions.items():
        relation, _, limit = condition.partition(" ")
        if relation not in _RELATIONS or not limit:
            raise ValidityError(f"closed_form({name}={condition!r}): write a relation and a number or name, as '> 0'")
    return lambda function: ClosedForm(function, text, conditions)


def _pop_size(owner: type[Component], values: dict[str, Any]) -> Iterator[int]:
    """Remove n from values and yield it, or the length of an array among them; nothing unless the owner has a Size."""
    size = getattr(owner, "n", None)
    if isinstance(size, Size):
        lengths = (len(value) for value in values.values() if np.ndim(value) == 1)
        try:
            yield size.checked(owner.__name__, values.pop("n", next(lengths, size.default)))
        except ComponentError as error:
            raise ValidityError(str(error)) from None


@cache
def _variables(owner: type[Component], *size: int) -> Mapping[str, Variable]:
    """Parameters, start values and inputs as declared, by name.

    :param size: number of elements or links.
    """
    layout = (owner.of_size(*size)() if size and issubclass(owner, Mechanism) else owner(*size)).layout()
    sizes = (Variable(d.name, "1", d.description, "parameter", "fixed", start=d.count) for d in layout.dimensions)
    return {variable.name: variable for variable in (*layout.parameters, *layout.inputs, *sizes)}


def _start_value(variable: Variable) -> Any:
    return variable.starts[0] if variable.dimension is None else np.array(variable.starts)


def _word_value(word: str, bound: Mapping[str, Any], at: Values) -> Any:
    """Value of a word in a condition: a number, an argument of the function, or a variable."""
    try:
        return float(word)
    except ValueError:
        return bound[word] if word in bound else getattr(at, word)
