"""Checks of a component when its class is defined; errors name the declaration."""

import inspect
import re
import traceback
import warnings
from collections.abc import Iterable, Mapping, Sequence
from difflib import get_close_matches
from pathlib import Path
from types import CodeType, FunctionType
from typing import Any, TypeVar

import casadi as ca

from liaisons.base import units
from liaisons.errors import ComponentError, LiaisonsError, suggestion
from liaisons.expressions import Declared, check_units
from liaisons.language.declarations import (
    UNCHECKED,
    ContactFormula,
    Declaration,
    InternalState,
    Joint,
    Parameter,
    Size,
    Symbol,
    calculated,
    output,
    rheonomic_constraint,
)
from liaisons.language.shapes import Shape
from liaisons.language.variables import NEXT_EVENT_TIME, Variable

D = TypeVar("D", bound=Declaration)
_IDENTIFIER = re.compile(r"^[A-Za-z][A-Za-z0-9_]*$")
_OURS = "liaisons."
_VARIABLES = (Symbol, Size, output, calculated, ContactFormula, rheonomic_constraint)
"""What declares a variable of its own name; of points, constraints, bodies and the like, names have endings."""
_KINDS = (Parameter, Size, Joint)
"""What base classes declare; a subclass may declare another one of the same kind."""


def declarations_of(cls: type, kind: type[D] | tuple[type[D], ...]) -> tuple[D, ...]:
    """Declarations of one kind: those of base classes first, in the order of the file."""
    declarations: dict[str, D] = {}
    for base in reversed(cls.__mro__):
        for name, value in vars(base).items():
            declarations.pop(name, None)  # what a subclass overrides takes its place
            if isinstance(value, kind):
                declarations[name] = value
    return tuple(declarations.values())


# ---- return values of methods --------------------------------------------------------------------------------------


def call(instance: object, name: str, *arguments: Any) -> Any:
    """Value of an attribute, or of a method for these arguments; exceptions become ComponentErrors that name it."""
    try:
        with warnings.catch_warnings():
            warnings.filterwarnings("error", message=r"\s*casadi: a numpy function", category=FutureWarning)
            value = getattr(instance, name)
            return value(*arguments) if callable(value) else value
    except LiaisonsError:
        raise
    except Exception as error:
        raise ComponentError(f"{type(instance).__name__}.{name}: {_explanation(error)}{_line_suffix(error)}") from error


def checked_scalar(owner: type, name: str, value: Any, symbols: Mapping[str, ca.SX]) -> ca.SX:
    """Value as a scalar expression of known symbols.

    :raises ComponentError: if it is not an expression, not a scalar, or contains an unknown symbol.
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
    allowed = {symbol.__hash__() for symbol in symbols.values()}
    strangers = [str(symbol) for symbol in ca.symvar(expression) if symbol.__hash__() not in allowed]
    if strangers:
        raise ComponentError(f"{label} contains the unknown symbol {strangers[0]!r}{suggestion(strangers[0], symbols)}")
    return expression


def shapes_of(instance: object) -> Sequence[Shape]:
    """Shapes of a component's picture; a ComponentError for any other return value."""
    shapes = call(instance, "picture")
    if isinstance(shapes, Sequence) and all(isinstance(shape, Shape) for shape in shapes):
        return shapes
    raise ComponentError(f"{type(instance).__name__}.picture returns {shapes!r}; return a list of Rod, Ball, Box, ...")


def components_of(instance: object, name: str) -> Mapping[str, ca.SX]:
    """Components of a named point by axis; a ComponentError for any other return value."""
    components = call(instance, name)
    if not isinstance(components, Mapping) or not components:
        raise ComponentError(f"{type(instance).__name__}.{name}: return the components, e.g. {{'x': ..., 'z': ...}}")
    return components


class Formulas:
    """Methods and formulas of a component, evaluated one by one; their units are checked together.

    :raises ComponentError: for one that raises, or returns no scalar of the allowed symbols.
    """

    def __init__(self, instance: object) -> None:
        self._instance, self._owner = instance, type(instance)
        self._declared: list[Declared] = []  # in the order of their dependence

    def __call__(self, name: str, symbols: Mapping[str, ca.SX], unit: str, *arguments: Any) -> ca.SX:
        """Scalar of the allowed symbols that a method returns, in this unit."""
        return self.add(name, call(self._instance, name, *arguments), symbols, unit)

    def add(self, label: str, value: Any, symbols: Mapping[str, ca.SX], unit: str) -> ca.SX:
        """Scalar expression of a value, whose unit is checked later.

        :param label: name of the method, with a key where it returns several, ``"bob['x']"``.
        """
        expression = checked_scalar(self._owner, label, value, symbols)
        attribute = inspect.getattr_static(self._owner, label.partition("[")[0])
        if not (attribute.unchecked if isinstance(attribute, Declaration) else hasattr(attribute, UNCHECKED)):
            self._declared.append(Declared(f"{self._owner.__name__}.{label}", expression, unit))
        return expression

    def check_mapping(self, name: str, symbols: Mapping[str, ca.SX], unit: Mapping[str, str]) -> None:
        """Check a method that returns scalars by name.

        :param unit: by name.
        """
        returned = call(self._instance, name)
        if not isinstance(returned, Mapping) or returned.keys() != unit.keys():
            got = list(returned) if isinstance(returned, Mapping) else returned
            raise ComponentError(f"{self._owner.__name__}.{name} returns {got}; it must give {list(unit)}")
        for key, value in returned.items():
            self.add(f"{name}[{key!r}]", value, symbols, unit[key])

    def check_internal_rates(self, symbols: Mapping[str, ca.SX]) -> None:
        """Check the method ``internal_rates``."""
        states = declarations_of(self._owner, InternalState)
        unit = {state.name: units.rate(units.ANY if state.unchecked else state.unit) for state in states}
        self.check_mapping("internal_rates", symbols, unit)

    def check_units(self, variables: Iterable[Variable], symbols: Mapping[str, ca.SX], **further: str) -> None:
        """Raise a ComponentError for formulas whose units do not fit.

        :param symbols: all that occur; their units are those of the variables of their names.
        :param further: units of symbols that are not variables.
        """
        unit = {v.name: v.unit for variable in variables for v in (variable, *variable.elements())} | further
        unit |= {item.name: units.ANY for item in declarations_of(self._owner, Symbol) if item.unchecked}
        check_units({name: (symbol, unit.get(name, units.ANY)) for name, symbol in symbols.items()}, self._declared)


def _explanation(error: Exception) -> str:
    """Explanation of an exception in a method, with the remedy."""
    text = str(error).strip().splitlines()
    if isinstance(error, FutureWarning) or "no implementation found for 'numpy" in str(error):
        return "a function of numpy is given a symbol; use CasADi's, which know symbols: ca.sin, ca.sqrt, ca.fmax, ..."
    if "truth value" in str(error):
        return (
            "'if', 'and', 'or', 'not', max() and min() ask for the truth of a symbol, which has none before the "
            "simulation; use ca.if_else(condition, a, b), ca.logic_and, ca.logic_or, ca.fmax, ca.fmin"
        )
    return f"{type(error).__name__}: {text[-1] if text else 'no reason is given'}"


def _line_suffix(error: Exception) -> str:
    """File and line of the component at which an exception was raised, in brackets; else no text."""
    ours = str(Path(__file__).parent)
    frames = [f for f in traceback.extract_tb(error.__traceback__) if not f.filename.startswith((ours, "<string>"))]
    return f" ({Path(frames[-1].filename).name}, line {frames[-1].lineno})" if frames else ""


# ---- names and methods of a class ---------------------------------------------------------------------------------


def require_units(cls: type) -> None:
    """Raise a ComponentError for a declaration without a unit; only an operator's may take any."""
    for item in declarations_of(cls, Declaration):
        if item.unit == units.ANY:
            item.refuse("its unit is missing; that of a pure number is '1'")


def _is_ours(cls: type) -> bool:
    """Whether a class is a base of components, here or in a package for a kind of them."""
    return cls.__module__.startswith(_OURS)


def require_methods(cls: type) -> None:
    """Raise a ComponentError for a method that a component has to define and does not."""
    for name in dir(cls):
        if name[0] != "_" and getattr(inspect.getattr_static(cls, name), "__isabstractmethod__", False):
            base = next(base for base in cls.__mro__ if _is_ours(base))
            raise ComponentError(f"{cls.__name__} defines no {name}(), which every {base.__name__} has to")


def reject_misspelt_methods(cls: type) -> None:
    """Raise a ComponentError for a method that nothing calls and whose name is nearly one that would be called."""
    if _is_ours(cls):
        return

    def methods(base: type) -> set[str]:
        return {name for name, value in vars(base).items() if isinstance(value, FunctionType) and name[0] != "_"}

    inherited = {name for base in cls.__mro__[1:] for name in vars(base)}
    allowed = {name for base in cls.__mro__ if _is_ours(base) for name in methods(base)}
    for name in sorted(methods(cls) - inherited):
        near = get_close_matches(name, allowed | {"exact", "picture"}, n=1, cutoff=0.85)
        if near and near[0] not in name and name not in _names_in_methods(cls):
            raise ComponentError(f"{cls.__name__}.{name}: nothing calls this method; did you mean {near[0]!r}?")


def _names_in_methods(cls: type) -> set[str]:
    """Names that the code of a component's methods and formulas uses."""
    methods = (getattr(value, "method", value) for base in cls.__mro__ for value in vars(base).values())
    waiting: list[Any] = [method.__code__ for method in methods if isinstance(method, FunctionType)]
    names: set[str] = set()
    while waiting:
        code = waiting.pop()
        names.update(code.co_names)
        waiting += [constant for constant in code.co_consts if isinstance(constant, CodeType)]
    return names


def reject_contacts(owner: str, contacts: Iterable[str], task: str, remedy: str, error: type[LiaisonsError]) -> None:
    """Raise an error if there are contacts.

    :param task: what takes none, as ``"an ensemble"``.
    """
    if which := ", ".join(contacts):
        raise error(f"{owner}: {task} takes no unilateral liaisons and no dry friction ({which}); {remedy}")


def reject_reserved_names(cls: type) -> None:
    """Raise a ComponentError for a declaration with a reserved name, or with a default outside its own domain."""
    ours = [base for base in cls.__mro__ if _is_ours(base)]
    taken = {name for base in ours for name, value in vars(base).items() if not isinstance(value, Declaration)}
    taken |= {name for base in ours for name in vars(base).get("__annotations__", ())}
    kinds = {
        name: kind for base in ours for name, value in vars(base).items() for kind in _KINDS if isinstance(value, kind)
    }
    for item in declarations_of(cls, Declaration):
        if not isinstance(item, kind := kinds.get(item.name, Declaration)):
            item.refuse(f"the base class has a {kind.__name__} of this name; choose another")
        if not _IDENTIFIER.match(item.name):
            item.refuse("use an ASCII identifier that starts with a letter")
        if item.name in taken:
            item.refuse("the name is taken by the base class; choose another")
    for item in declarations_of(cls, Symbol):
        variable = item.variable("parameter", "fixed")
        if not variable.allows(item.start):
            item.refuse(f"default {item.start:g} {item.unit} is outside its own domain: it must be {variable.domain()}")


def reject_clashes(cls: type, names: Iterable[tuple[str, str]]) -> None:
    """Raise a ComponentError for two variables of one name, or a declaration called as a variable of something else.

    :param names: of all variables, each with its description; a name that two claim comes twice.
    """
    reserved = f"input_reconstruction symplectic_steps stiff_solver time picture coupling_error {NEXT_EVENT_TIME}"
    seen: dict[str, str] = dict.fromkeys(reserved.split(), "which every FMU has")
    declared = {item.name: item for item in declarations_of(cls, Declaration)}
    others = [(name, item.description) for name, item in declared.items() if not isinstance(item, _VARIABLES)]
    clashes: list[tuple[str, str, str]] = []
    for name, description in (*names, *others):
        clashes += [(name, seen[name], description)] if name in seen else []
        seen.setdefault(name, description)
    if not clashes:
        return
    name, *texts = next((clash for clash in clashes if clash[0] in declared), clashes[0])
    fix = "rename the parameter, coordinate, point or output that makes one of them"
    if name in declared:
        other = texts[0] if texts[1] == declared[name].description else texts[1]
        verb = "says" if other.split()[0] in {"whether", "what", "how", "when", "where"} else "is the"
        what = "" if other.startswith("which") else f"{name} {verb} {re.split('[:(]', other)[0].strip()}: "
        fix = f"{what}choose another name"
    raise ComponentError(
        f"{cls.__name__}: two variables would be called {name!r}: {texts[0]!r} and {texts[1]!r}; {fix}"
    )
