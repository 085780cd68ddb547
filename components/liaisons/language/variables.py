"""FMU variables with units and domains, connectors, and the default experiment."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Literal, NamedTuple

from liaisons.base.arguments import check_positive
from liaisons.errors import ComponentError

Causality = Literal["parameter", "calculatedParameter", "input", "output", "local"]
TerminalKind = Literal["free", "active", "point", "signal"]
NumberType = Literal["Real", "Integer", "Boolean"]
Variability = Literal["fixed", "tunable", "discrete", "continuous"]

NEXT_EVENT_TIME = "next_event_time"
"""Name of the variable by which an FMU announces its next event; reserved for it."""


@dataclass(frozen=True, slots=True)
class Dimension:
    """A structural size, fixed when the FMU is built: the length of arrays."""

    name: str
    count: int
    description: str


@dataclass(frozen=True, slots=True)
class Variable:
    """A variable of the model description: a scalar or an array."""

    name: str
    unit: str
    description: str
    causality: Causality
    variability: Variability
    start: float | tuple[float, ...] | None = None  # parameters and inputs only; (1.0, 2.0): the rest are 0
    minimum: float | None = None
    maximum: float | None = None
    strict: bool = False  # True: the bounds themselves are forbidden too
    nominal: float | None = None
    derivative_of: str | None = None  # name of the variable whose time derivative this is
    dimension: Dimension | None = None  # None: a scalar
    symbol: str = ""  # its letter, where it is not the one of its name
    type: NumberType = "Real"  # of what is read in the FMU; functions calculate with 0 and 1 for a Boolean

    @property
    def count(self) -> int:
        """Number of elements."""
        return 1 if self.dimension is None else self.dimension.count

    @property
    def starts(self) -> tuple[float, ...]:
        """Start values of all elements; 0 by default."""
        if isinstance(self.start, tuple):
            return self.start + (0.0,) * (self.count - len(self.start))
        return (self.start or 0.0,) * self.count

    def elements(self) -> tuple[Variable, ...]:
        """Scalar variables ``theta[1]``, ``theta[2]``, ... of an array; for a scalar, the variable itself."""
        if self.dimension is None:
            return (self,)
        return tuple(
            replace(
                self,
                name=element(self.name, i),
                start=None if self.start is None else start,
                derivative_of=None if self.derivative_of is None else element(self.derivative_of, i),
                dimension=None,
            )
            for i, start in enumerate(self.starts, start=1)
        )

    def domain(self) -> str:
        """Allowed values as text: ``"> 0"``, ``"in [0, 1]"``; empty if all are allowed."""
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


class State(NamedTuple):
    """Continuous states: the output that shows them and the variable that is their derivative; a number or an array."""

    name: str
    derivative: str


class ActiveInput(NamedTuple):
    """Names of the three inputs through which an operator prescribes one coordinate: σ, σ̇, σ̈."""

    value: str
    rate: str
    acceleration: str


@dataclass(frozen=True, slots=True)
class TerminalMember:
    """One member of a port: its role (``"s"``, ``"v"``, ``"a"``, ``"f"``, ``"phi"``, ...) and its variable."""

    role: str
    variable: str


@dataclass(frozen=True, slots=True)
class Terminal:
    """A coordinate or a component of a named point, seen as a connector (terminal)."""

    name: str
    kind: TerminalKind
    members: tuple[TerminalMember, ...]


@dataclass(frozen=True, slots=True)
class Experiment:
    """Default experiment.

    If nothing moves at the default start values, ``reference`` has those of the reference results, by the names of
    scalar parameters and inputs; a prescribed coordinate moves by its rate and acceleration.

    :raises ComponentError: unless all three are finite and > 0.
    """

    stop_time: float = 10.0
    step_size: float = 0.01
    tolerance: float = 1e-8
    reference: Mapping[str, float] = field(default_factory=dict, hash=False)

    def __post_init__(self) -> None:
        for name in ("stop_time", "step_size", "tolerance"):
            check_positive(f"Experiment: {name}", getattr(self, name), ComponentError)


def element(name: str, index: int) -> str:
    """Name of an element of an array, counted from 1."""
    return f"{name}[{index}]"
