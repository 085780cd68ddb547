"""Base of mechanisms, chains and operators: the class holds declarations, an instance symbols."""

import inspect
from abc import ABC, abstractmethod
from collections.abc import Iterable, Mapping, Sequence
from functools import cache
from typing import Any, ClassVar, Generic, TypeVar, final

import casadi as ca

from liaisons.algebra import stack
from liaisons.errors import ComponentError, LiaisonsError, suggestion
from liaisons.language.checks import (
    declarations_of,
    reject_clashes,
    reject_contacts,
    reject_misspelt_methods,
    reject_reserved_names,
    require_methods,
)
from liaisons.language.declarations import Declaration, Input, InternalState, Parameter
from liaisons.language.layout import Layout, internal_state_outputs
from liaisons.language.variables import Experiment, State, Variable

D = TypeVar("D", bound=Declaration)


@cache
def elements_of(owner: type, kind: type[D]) -> tuple[D, ...]:
    """Declarations of one kind of a class; for an array, those of its elements."""
    return tuple(element for item in declarations_of(owner, kind) for element in item.elements(owner))


class DeclarationsOf(Generic[D]):
    """Descriptor: all declarations of one kind of a class, base classes first."""

    def __init__(self, kind: type[D]) -> None:
        self._kind = kind

    def __get__(self, instance: object, owner: type) -> tuple[D, ...]:
        return elements_of(owner, self._kind)


class Component(ABC):
    """A model with declared parameters; abstract.

    On the class, ``Pendulum.mass`` is the declaration; on an instance, ``self.mass`` is a CasADi symbol.  Subclasses
    are checked when they are defined, before any derivation: errors name the declaration.
    """

    experiment: ClassVar[Experiment] = Experiment()
    is_abstract: ClassVar[bool] = True
    parameters = DeclarationsOf(Parameter)
    internal_states = DeclarationsOf(InternalState)
    symbols: dict[str, ca.SX]
    formulas: dict[str, Any]
    parameter_column: ca.SX
    internal: ca.SX

    def __init__(self) -> None:
        self.symbols = {}
        self.formulas = {}
        self.parameter_column = self._add_symbols(name for p in self.parameters for name in p.names)

    def internal_rates(self) -> Mapping[str, ca.SX]:
        """Rates of the internal states, by name."""
        return {}

    @final
    def internal_rate_column(self) -> ca.SX:
        """Rates of the internal states, in their order."""
        rates = self.internal_rates()
        return stack(ca.SX(rates[state.name]) for state in self.internal_states)

    @classmethod
    def is_sampled(cls) -> bool:
        """Whether inputs are read at samples only."""
        return False

    @classmethod
    def contact_names(cls) -> tuple[str, ...]:
        """Names of the unilateral liaisons, then of the dry frictions."""
        return ()

    @classmethod
    @final
    def refuse_contacts(cls, task: str, remedy: str, error: type[LiaisonsError] = ComponentError) -> None:
        """Raise an error if the component has unilateral liaisons or dry friction.

        :param task: what takes none, as ``"an ensemble"``.
        """
        reject_contacts(cls.__name__, cls.contact_names(), task, remedy, error)

    @classmethod
    @final
    def refuse_samples(cls, task: str, remedy: str, error: type[LiaisonsError] = ComponentError) -> None:
        """Raise an error if the component is sampled: its equations hold between samples only.

        :param task: what takes none, as ``"an ensemble"``.
        """
        if cls.is_sampled():
            raise error(f"{cls.__name__}: {task} takes no samples of inputs; {remedy}")

    def __init_subclass__(cls, *, abstract: bool = False, **kwargs: Any) -> None:
        super().__init_subclass__(**kwargs)
        cls.is_abstract = abstract
        reject_misspelt_methods(cls)
        if not abstract:
            require_methods(cls)
            reject_reserved_names(cls)
            instance = cls()
            reject_clashes(cls, instance.claimed_names())
            instance._check()

    @abstractmethod
    def _check(self) -> None:
        """Raise a ComponentError for errors that show without a derivation."""

    @abstractmethod
    def layout(self) -> Layout:
        """Variables of the FMU."""

    def claimed_names(self) -> list[tuple[str, str]]:
        """Names of all variables of the FMU with their descriptions; one that two claim comes twice."""
        layout = self.layout()
        return [(v.name, v.description) for v in (*layout.variables, *layout.dimensions)]

    @classmethod
    def summary(cls) -> str:
        """First line of the docstring."""
        return (inspect.getdoc(cls) or cls.__name__).splitlines()[0]

    def __getattr__(self, name: str) -> Any:
        # Only called for names that are not declared: rates, and misspelt symbols in a method of the component.
        if name.startswith("__") or "symbols" not in self.__dict__:
            raise AttributeError(f"{name}: there are no symbols yet; let __init__ begin with super().__init__()")
        array, bracket, index = name.partition("[")
        if bracket:
            return getattr(self, array)[int(index[:-1]) - 1]
        names = [n for n in dir(type(self)) if not n.startswith("_")]
        coordinate, _, order = name.rpartition("_")
        if name in self.symbols and coordinate in names and order in ("dot", "ddot"):
            return self.symbols[name]
        raise ComponentError(f"{type(self).__name__}: unknown symbol self.{name}{suggestion(name, names)}")

    def _add_symbols(self, names: Iterable[str]) -> ca.SX:
        """Column of new symbols, which are added to ``symbols``."""
        column = [ca.SX.sym(name) for name in names]
        self.symbols.update((str(symbol), symbol) for symbol in column)
        return ca.vertcat(*column) if column else ca.SX(0, 1)

    def _symbols_by_name(self, *columns: ca.SX) -> dict[str, ca.SX]:
        """Symbols in columns, by name."""
        names = (str(symbol) for column in columns for symbol in ca.vertsplit(column))
        return {name: self.symbols[name] for name in names}

    def _declared_parameters(self) -> list[Variable]:
        return [p.variable("parameter", "tunable" if p.tunable else "fixed") for p in self.parameters]


class SignalComponent(Component, abstract=True):
    """A component that calculates signals from inputs; abstract."""

    inputs = DeclarationsOf(Input)
    clock: ca.SX
    input_column: ca.SX

    def __init__(self) -> None:
        super().__init__()
        self.clock = ca.SX.sym("t")
        self.internal = self._add_symbols(state.name for state in self.internal_states)
        self.input_column = self._add_symbols(item.name for item in self.inputs)

    def layout(self) -> Layout:
        of_states = [list(internal_state_outputs(state)) for state in self.internal_states]
        return Layout(
            parameters=(*self._declared_parameters(), *(state.start_parameter() for state in self.internal_states)),
            inputs=tuple(item.variable("input", "continuous") for item in self.inputs),
            outputs=tuple(variable for group in zip(*of_states, strict=True) for variable in group),
            states=tuple(State(state.name, f"{state.name}_dot") for state in self.internal_states),
            ports=(),
        )

    def claimed_names(self) -> list[tuple[str, str]]:
        return [*super().claimed_names(), ("t", "time")]  # in formulas

    def triple(self) -> list[ca.SX]:
        """Signal of an active port and its two derivatives; empty without a port."""
        return []

    def conditions(self) -> Mapping[str, ca.SX]:
        """Expressions that must stay > 0, by the message of a violation."""
        return {}

    @abstractmethod
    def events(self) -> Sequence[ca.SX]:
        """Instants [s] at which an output is not smooth."""

    @abstractmethod
    def next_event_time(self) -> ca.SX | None:
        """First instant [s] after ``clock`` at which an output is not smooth; None: they always are."""
