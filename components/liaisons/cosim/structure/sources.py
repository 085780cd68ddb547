"""Functions of time that drive inputs, where no FMU does."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from liaisons.arguments import shown
from liaisons.cosim.description.start_values import RANGES
from liaisons.cosim.description.variables import NUMBERS
from liaisons.cosim.structure.components import SystemComponent
from liaisons.cosim.structure.schedule import VariableReference
from liaisons.errors import LiaisonsError, SimulationError

SIGNALS = ""
"""Stands for the functions of time, where the name of a component is expected."""

_BOOLEAN = (0, 1)
_KEPT = 4096
"""So many values are kept, of steps that are made together and the one before."""
_ROUNDING = 1e-12
"""Of 1 s and of the time; FMUs of ours do the same."""

Function = Callable[[float], float | Sequence[float]]
"""A function of time [s]."""


@final
@dataclass(frozen=True)
class Signal:
    """A function of time [s] with the instants at which its value or one of its rates jumps.

    ``inputs={"length": Signal(lambda t: (1 + abs(t - 0.5), np.sign(t - 0.5), 0.0), breaks=[0.5])}``: a run has
    communication points there of its own accord, and asks for the values before and after each, not for those at it.

    :param function: of the time; returns a number, or value, rate and acceleration.
    :param breaks: these instants [s].
    :raises SimulationError: if the function is none, or the breaks are no list of finite numbers.
    """

    function: Function
    breaks: ArrayLike = ()

    def __post_init__(self) -> None:
        if not callable(self.function):
            raise SimulationError(f"Signal: {shown(self.function)} is no function of time")
        object.__setattr__(self, "breaks", tuple(_instants("Signal", self.breaks).tolist()))

    def __call__(self, t: float) -> float | Sequence[float]:
        """What the function returns at t [s]."""
        return self.function(t)


@final
@dataclass(frozen=True)
class Drive:
    """A function of time [s] that feeds inputs of one component: a number, or one for each of them.

    :param among: the integers that its values have to be among, if they have to.
    :param breaks: instants [s] at which its values or their rates jump, ascending.
    """

    function: Function
    inputs: tuple[VariableReference, ...]
    among: tuple[int, int] | None = None
    breaks: NDArray[np.float64] = field(default_factory=lambda: np.empty(0), compare=False)
    _begins: dict[float, NDArray[np.float64]] = field(default_factory=dict, compare=False, repr=False)
    _known: dict[float, NDArray[np.float64]] = field(default_factory=dict, compare=False, repr=False)

    @property
    def places(self) -> list[VariableReference]:
        """Where its values stand on the bus."""
        return [(SIGNALS, f"{part}.{variable}") for part, variable in self.inputs]

    def right(self, t: float) -> NDArray[np.float64]:
        """Its values just after t, shape (inputs,): the limits from the right, to rounding."""
        return self(t + float(self.rounding(t)))

    def sample(self, times: NDArray[np.float64]) -> NDArray[np.float64]:
        """Its values at instants inside of steps, shape (*times, inputs).

        :raises SimulationError: as a call does.
        """
        instants = times.ravel().tolist()
        try:
            values = np.array([self.function(t) for t in instants], dtype=float).reshape(len(instants), -1)
        except Exception:  # noqa: BLE001 - said by the call for the instant that it is of
            values = np.empty((0, 0))
        if values.shape != (len(instants), len(self.inputs)) or not np.isfinite(values).all():
            values = np.array([self(t) for t in instants])
        return values.reshape(*times.shape, -1)

    def rounding(self, t: ArrayLike) -> NDArray[np.float64]:
        """The function may compare its time with a break after some roundings of both."""
        return 8 * np.spacing(np.maximum(np.abs(t), np.max(np.abs(self.breaks), initial=0.0)))

    def begin(self, t: float) -> None:
        """From now on, its values at t are the limits from the right: a smooth piece begins there.

        Integers and truth values are what the function returns at t itself, unless it has a break there.
        """
        self._begins.clear()
        here = self(t)
        if self.among is None or np.any(np.abs(self.breaks - t) <= rounding(t)):
            right = self.right(t)
            self._begins[t] = here if np.allclose(right, here, rtol=1e-12, atol=1e-100) else right

    def next_break(self, time: float) -> float | None:
        """The first of its breaks after an instant [s]."""
        place = int(np.searchsorted(self.breaks, time + rounding(time), side="right"))
        return float(self.breaks[place]) if place < len(self.breaks) else None

    def __call__(self, t: float) -> NDArray[np.float64]:
        """Its values, shape (inputs,).

        :raises SimulationError: if the function raises, or returns something else than so many finite numbers, or
            integers.
        """
        if t in self._begins:
            return self._begins[t]
        if (known := self._known.get(t)) is None:
            if len(self._known) >= _KEPT:
                self._known.clear()
            known = self._known[t] = self._evaluated(float(t))
        return known

    def _evaluated(self, t: float) -> NDArray[np.float64]:
        name = self.inputs[0][1]
        values = evaluate(self.function, name, t)
        if values.size != len(self.inputs) or not np.isfinite(values).all():
            raise SimulationError(
                f"input {name!r}: its function returns {values.tolist()} at t = {t:.10g} s, "
                f"expected {len(self.inputs)} finite number{'s' * (len(self.inputs) > 1)}"
            )
        if self.among is not None and not (values == np.clip(np.round(values), *self.among)).all():
            least, most = self.among
            raise SimulationError(
                f"input {name!r}: its function returns {values.item():g} at t = {t:.10g} s, expected "
                f"{'False or True' if self.among == _BOOLEAN else f'an integer from {least} to {most}'}"
            )
        return values.reshape(-1)


def rounding(time: float) -> float:
    """So far from an instant is the same instant [s]."""
    return _ROUNDING * (1 + abs(time))


def drives(
    functions: Mapping[VariableReference, Function], parts: Mapping[str, SystemComponent], start_time: float
) -> list[Drive]:
    """The functions of time that drive inputs; one that returns several numbers drives a whole port.

    :param functions: their instants of jumps are what they have as ``breaks``, :class:`Signal` or not.
    :raises SimulationError: if there is no such input, it is driven twice, what drives it is no function, or its breaks
        are no numbers.
    """
    found: list[Drive] = []
    for (owner, name), function in functions.items():
        part = parts[owner]
        variable = part.scalar(name)
        if variable.causality != "input":
            words = f"{owner}.{name} is of causality {variable.causality!r}"
            raise SimulationError(f"inputs: {words}, so it cannot be driven")
        if variable.type not in NUMBERS:
            raise SimulationError(f"inputs: {owner}.{name} is {variable.type}; only numbers can be driven")
        if not callable(function):
            words = f"{name} = {shown(function)} is no function of time"
            raise SimulationError(f"inputs: {words}; give a constant as start value")
        triple = part[name].triple()
        whole = triple is not None and evaluate(function, name, start_time).ndim > 0
        inputs = tuple(port.place for port in triple) if triple and whole else ((owner, name),)
        among = None if variable.type == "Real" else _BOOLEAN if variable.type == "Boolean" else RANGES[variable.base]
        found.append(Drive(function, inputs, among, _instants(f"inputs: {name}", getattr(function, "breaks", ()))))
    for place, count in Counter(place for drive in found for place in drive.inputs).items():
        if count > 1:
            raise SimulationError(f"inputs: {'.'.join(place)} is driven twice, by itself and by its port")
    return found


def _instants(label: str, breaks: object) -> NDArray[np.float64]:
    """Instants [s], ascending, each once.

    :raises SimulationError: if they are no list of finite numbers.
    """
    listed = isinstance(breaks, (Sequence, np.ndarray)) and not isinstance(breaks, (str, bytes))
    try:
        found = np.asarray(breaks if listed else None, dtype=float)
    except (TypeError, ValueError):
        found = np.array(np.nan)
    if found.ndim != 1 or not np.isfinite(found).all():
        raise SimulationError(f"{label}: breaks = {shown(breaks)}: give a list of finite numbers, instants in seconds")
    return np.unique(found)


def evaluate(function: Function, name: str, t: float) -> NDArray[np.float64]:
    """What a function of time returns.

    :param name: the input that it is for.
    :raises SimulationError: if it raises, or returns no numbers.
    """
    try:
        return np.asarray(function(t), dtype=float)
    except Exception as error:
        reason = error if isinstance(error, LiaisonsError) else repr(error)
        raise SimulationError(f"input {name!r}: its function fails at t = {t:.10g} s: {reason}") from error
