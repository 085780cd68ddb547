"""The hand-over from symbols to FMU: a table of variables and a handful of CasADi functions.

Everything that an FMU back end has to know of a component stands here, and nothing else of it does.  The
vectors, always in this order, all dense columns of doubles:

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

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

import casadi as ca

Causality = Literal["parameter", "calculatedParameter", "input", "output", "local"]
PortKind = Literal["free", "active", "point", "signal"]
Variability = Literal["fixed", "tunable", "continuous"]


@dataclass(frozen=True, slots=True)
class Variable:
    """One scalar variable of the model description."""

    name: str
    unit: str
    description: str
    causality: Causality
    variability: Variability
    start: float | None = None  # parameters and inputs only
    minimum: float | None = None
    maximum: float | None = None
    strict: bool = False  # True: the bounds themselves are forbidden too
    nominal: float | None = None
    derivative_of: str | None = None  # name of the variable whose time derivative this is

    def domain(self) -> str:
        """The allowed values in words: ``"> 0"``, ``"in [0, 1]"``; empty when all are allowed."""
        less, more = ("<", ">") if self.strict else ("<=", ">=")
        if self.minimum is not None and self.maximum is not None:
            left, right = ("]", "[") if self.strict else ("[", "]")
            return f"in {left}{self.minimum:g}, {self.maximum:g}{right}"
        if self.minimum is not None:
            return f"{more} {self.minimum:g}"
        return f"{less} {self.maximum:g}" if self.maximum is not None else ""

    def allows(self, value: float) -> bool:
        """Whether a finite value lies in the domain."""
        below = self.minimum is not None and (value < self.minimum or (self.strict and value == self.minimum))
        above = self.maximum is not None and (value > self.maximum or (self.strict and value == self.maximum))
        return not (below or above)


@dataclass(frozen=True, slots=True)
class State:
    """One continuous state: the output that shows it and the variable that is its derivative."""

    name: str
    derivative: str


@dataclass(frozen=True, slots=True)
class ActiveInput:
    """Names of the three inputs through which an operator prescribes one coordinate: σ, σ̇, σ̈."""

    value: str
    rate: str
    acceleration: str


@dataclass(frozen=True, slots=True)
class PortMember:
    """One member of a port: its role (``"s"``, ``"v"``, ``"a"``, ``"f"``, ``"phi"``, ...) and its variable."""

    role: str
    variable: str


@dataclass(frozen=True, slots=True)
class Port:
    """A coordinate or a component of a named point, seen as a connector (terminal)."""

    name: str
    kind: PortKind
    members: tuple[PortMember, ...]


@dataclass(frozen=True, slots=True)
class Experiment:
    """Default experiment: one that shows something worthwhile."""

    stop_time: float = 10.0
    step_size: float = 0.01
    tolerance: float = 1e-8


@dataclass(frozen=True, slots=True)
class Model:
    """A component, ready to become an FMU.

    Functions (inputs → outputs, shapes by the vectors above):

    * ``start``       (t, u, k) → (y, m)            state and memory at initialization
    * ``derivatives`` (t, y, u, k) → (y_dot,)       right-hand side
    * ``outputs``     (t, y, u, k, m) → (z,)        all readable variables
    * ``jump``        (t, y, u, k, m) → (y,)        state after the inputs have jumped: books the impulse's work
    * ``remember``    (t, y, u, k, m) → (m,)        memory after a completed step or jump
    * ``nominals``    (t, y, u, k) → (n,)           size of each state, at initialization; scales the tolerance
    * ``project``     (t, y, u, k) → (y,)           state put back onto constraints after a solver's step; None: no need
    * ``conditions``  (t, y, u, k) → (c,)           each entry must stay > 0 (a singularity lies at 0)
    * ``events``      (k,) → (times,)               instants at which the model is not smooth, unsorted
    """

    name: str
    description: str
    documentation: str  # the component's docstring
    parameters: tuple[Variable, ...]
    inputs: tuple[Variable, ...]
    outputs: tuple[Variable, ...]
    states: tuple[State, ...]
    memory: tuple[str, ...]
    start: ca.Function
    derivatives: ca.Function
    outputs_function: ca.Function
    jump: ca.Function
    remember: ca.Function
    nominals: ca.Function
    conditions: ca.Function
    condition_texts: tuple[str, ...]  # one a condition, e.g. "r must stay > 0"
    events: ca.Function
    project: ca.Function | None = None
    start_only: int = 0  # so many of the conditions, the last ones, are asked of the start alone
    active: tuple[ActiveInput, ...] = ()
    ports: tuple[Port, ...] = ()
    experiment: Experiment = field(default_factory=Experiment)
    equations: Mapping[str, str] = field(default_factory=dict)  # title -> printed equation, for the documentation

    @property
    def variables(self) -> tuple[Variable, ...]:
        """All real variables; the place in this tuple is the value reference: parameters, inputs, outputs."""
        return self.parameters + self.inputs + self.outputs
