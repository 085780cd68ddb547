"""Interface between symbols and FMU: a table of variables and a handful of CasADi functions.

An FMU back end needs nothing else of a component.  The vectors, always in this order, all dense columns of doubles:

====  =========================================================================================
``t``  time [s]
``y``  continuous states: coordinates and momenta, then the integrals ``work`` and ``dissipated``
``u``  inputs, in the order of :attr:`Model.inputs`
``k``  parameters, in the order of :attr:`Model.parameters` (start values ``q_0``, ``q_dot_0`` among them)
``m``  memory: numbers fixed at initialization or at the end of a step (e.g. the energy at start)
``z``  everything that can be read and is neither parameter nor input, in the order of :attr:`Model.outputs`
====  =========================================================================================
"""

from __future__ import annotations

import inspect
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any, Protocol

import casadi as ca
import numpy as np

from liaisons.base.array_names import array_and_index, suffixed_name
from liaisons.errors import ComponentError, LiaisonsError
from liaisons.language import (
    NEXT_EVENT_TIME,
    Component,
    Coordinate,
    Experiment,
    Layout,
    Terminal,
    Variable,
    reject_contacts,
)
from liaisons.mechanics.functions import results_of


@dataclass(frozen=True, slots=True, eq=False)
class Equation:
    """One equation for the documentation: a name, and the expression that it equals, in symbols of known names."""

    section: str  # which law it belongs to: "lagrangian", "momenta", "motion", ...
    left: str
    right: ca.SX


@dataclass(frozen=True, slots=True, eq=False)
class LookupTable:
    """Lookup table: parameters of which functions read two rows at each of some times.

    The parameters r of these functions are, for each time, its columns at the start and at the end of the interval,
    then all parameters behind the table.

    :param lookups: indices of the columns that are read at each time.
    :param rests: whether both rows are the last one behind the table; else they are those of the last interval.
    :param times: (t, y, u, parameters behind the table) → (times,).
    :param derivatives: (t, y, u, r) → (y_dot,).
    :param outputs_function: (t, y, u, r, m) → (z,).
    :param jump: (t, y, u, r, m) → (y,).
    :param conditions: (t, y, u, r) → (c,).
    :param has_events: whether its first column holds the instants of :attr:`Model.events`.
    :param draw: (t, y, u, r) → (next event,), unless these instants are it, or there is none.
    :param sample: (t, y, u, r, m) → (m,) of what samples.
    :param events: (r, t) → (e,).
    """

    columns: int
    rows: int
    lookups: tuple[tuple[int, ...], ...]
    rests: tuple[bool, ...]
    times: ca.Function
    derivatives: ca.Function
    outputs_function: ca.Function
    jump: ca.Function
    conditions: ca.Function
    has_events: bool
    draw: ca.Function | None = None
    sample: ca.Function | None = None
    events: ca.Function | None = None

    @property
    def numbers_read(self) -> int:
        """Count of the numbers that functions read: of two rows at each time."""
        return 2 * sum(map(len, self.lookups))


NEXT_EVENT = Variable(
    NEXT_EVENT_TIME,
    "s",
    "first instant after the present time at which a signal is not smooth; 1.7976931348623157e308: there is none",
    "local",
    "discrete",
)
"""Variable that announces the instants at which an importer should place communication points."""


@dataclass(frozen=True, slots=True)
class Contact:
    """A unilateral liaison, or dry friction, of a model; the outputs called after it: docs/reference/fmu.md."""

    name: str
    friction: bool = False
    normal: str = ""  # of dry friction: the unilateral liaison whose force bounds it

    def variable(self, ending: str) -> str:
        """Name of a variable of the contact with this ending."""
        return suffixed_name(self.name, f"_{ending}")

    def renamed(self, rename: Callable[[str], str]) -> Contact:
        """The contact with new names of itself, and of the unilateral liaison that bounds it."""
        return Contact(rename(self.name), self.friction, self.normal and rename(self.normal))


@dataclass(frozen=True, slots=True)
class Reach:
    """A constraint that may be out of reach.

    :param text: its name and description.
    :param prescribed: names of the prescribed coordinates that it depends on.
    """

    text: str
    prescribed: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Code:
    """A function in C, and the numbers of work space that it needs."""

    text: str
    reals: int


class Loops(Protocol):
    """Functions of a model that run along a row of equal links, as C that CasADi does not write."""

    @property
    def names(self) -> frozenset[str]:
        """Members of Model that they are."""
        ...

    @property
    def links(self) -> int:
        """How many links there are."""
        ...

    def code(self, coupled: int, differentiated: Iterable[str], *, adjoint: bool) -> Mapping[str, Code]:
        """The functions and their derivatives in C, by member of ``Model`` in core.h.

        :param coupled: number of coupled states, on which the rates depend.
        :param differentiated: members of Model of which there are derivatives.
        :param adjoint: with adjoint derivatives.
        """
        ...

    def preamble(self, functions: Iterable[Code]) -> str:
        """C that stands before these functions, and what they use only."""
        ...

    def functions(self, links: int) -> Mapping[str, ca.Function]:
        """The functions of a row with so many links, by member of Model."""
        ...


@dataclass(frozen=True, kw_only=True)
class Model(Layout):
    """A component, ready to become an FMU.

    What its functions take and return: ``liaisons.mechanics.functions.SIGNATURES``.
    """

    name: str
    description: str
    documentation: str  # the component's docstring
    memory: tuple[str, ...]
    start: ca.Function
    derivatives: ca.Function
    outputs_function: ca.Function
    jump: ca.Function
    remember: ca.Function
    nominals: ca.Function
    conditions: ca.Function
    condition_texts: tuple[str, ...]  # one per condition, e.g. "r must stay > 0"
    events: ca.Function
    project: ca.Function | None = None
    reach: ca.Function | None = None
    reaches: tuple[Reach, ...] = ()  # one per constraint
    margin: ca.Function | None = None  # how far the constraints are from losing rank
    configuration: tuple[str, ...] = ()  # names of the states that are coordinates, of a mechanism
    start_only: int = 0  # count of the last conditions, which hold at the start alone
    redundant: int = 0  # count of constraints that follow from the others on all of them
    module: str = ""  # where the component is declared
    ports: tuple[Terminal, ...] = ()
    experiment: Experiment = field(default_factory=Experiment)
    equations: tuple[Equation, ...] = ()  # for the documentation
    closed_form: str = ""  # likewise: docstring of the component's ``exact``, if it has one
    loops: Loops | None = field(default=None, hash=False)  # functions that run along links
    picture: Mapping[str, Any] | None = field(default=None, hash=False)  # content of resources/picture.json
    drawn: tuple[Variable, ...] = ()  # calculated only when read
    draw: ca.Function | None = None
    table: LookupTable | None = None  # made of the first parameters
    contacts: tuple[Contact, ...] = ()
    contact: ca.Function | None = None
    push: ca.Function | None = None
    indicate: ca.Function | None = None
    forced_motion: ca.Function | None = None
    sample: ca.Function | None = None

    @property
    def indicators(self) -> tuple[str, ...]:
        """Names of the event indicators; of an array its own name."""
        own = {v.name for v in self.outputs}
        names = (contact.variable("indicator") for contact in self.contacts)
        return tuple(dict.fromkeys(name if name in own else array_and_index(name)[0] for name in names))

    @property
    def impulsive_operators(self) -> list[str]:
        """Names of the active coordinates at whose operators impacts have impulses."""
        return impulsive_operators(self.contacts, self.memory)

    @property
    def variables(self) -> tuple[Variable, ...]:
        """Parameters, inputs, outputs, and numbers of the picture; the index is the value reference."""
        return (*super().variables, *self.drawn)

    def results(self, function: str, vectors: Mapping[str, Any]) -> list[Any]:
        """Results of a function of the model, by its name, of vectors by their letters."""
        return results_of(function, getattr(self, function), vectors)

    def refuse_contacts(self, task: str, remedy: str, error: type[LiaisonsError] = ComponentError) -> None:
        """Raise an error if the model has unilateral liaisons or dry friction.

        :param task: what takes none, as ``"an ensemble"``.
        """
        reject_contacts(self.name, (contact.name for contact in self.contacts), task, remedy, error)

    def next_event(self, k: Any, t: float) -> float:
        """First instant after t at which the model is not smooth [s]; inf if there is none.

        :param k: parameters.
        """
        instants = np.asarray(self.events.call([k, t][: self.events.n_in()])[0]).ravel()
        return float(min(instants[instants > t], default=np.inf))

    def flat(self) -> Model:
        """Model with a variable for each element of an array, as in FMI 2.0."""
        if not any(v.dimension for v in self.variables):
            return self
        return replace(super().flat(), drawn=tuple(element for v in self.drawn for element in v.elements()))


def impulsive_operators(contacts: Iterable[Contact], memory: Iterable[str]) -> list[str]:
    """Names of the active coordinates at whose operators impacts have impulses, which the memory sums."""
    gaps = {c.variable("impulse") for c in contacts}
    return [name.removesuffix("_impulse") for name in memory if name.endswith("_impulse") and name not in gaps]


def domain_conditions(item: Coordinate | Variable, value: Any) -> dict[str, Any]:
    """Expressions that are > 0 in the domain of a variable, by the message for a violation."""
    conditions = {}
    if item.minimum is not None:
        conditions[f"{item.name} must stay > {item.minimum:g} {item.unit}"] = value - item.minimum
    if item.maximum is not None:
        conditions[f"{item.name} must stay < {item.maximum:g} {item.unit}"] = item.maximum - value
    return conditions


def declared_fields(instance: Component) -> dict[str, Any]:
    """Fields of Model that a component declares, by name: variables, documentation, experiment."""
    component = type(instance)
    return {
        "name": component.__name__,
        "module": component.__module__,
        "description": component.summary(),
        "documentation": inspect.getdoc(component) or component.__name__,
        "experiment": component.experiment,
        "closed_form": inspect.getdoc(getattr(component, "exact", None)) or "",
        **vars(instance.layout()),
    }
