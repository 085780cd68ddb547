"""Functions of time as sources of inputs."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import final

import numpy as np
from numpy.typing import ArrayLike

from liaisons.base.arguments import name_dictionary, shown
from liaisons.base.clocks import time_rounding
from liaisons.cosim.compiled.calls import Vector
from liaisons.cosim.structure.components import Port
from liaisons.cosim.structure.document import SystemDocument
from liaisons.cosim.structure.schedule import VariableReference
from liaisons.errors import LiaisonsError, SimulationError
from liaisons.fmu_files import NUMBERS, integer_range

SIGNALS = ""
"""Name of the component to which references of functions of time belong."""

_CACHED = 4096
"""Largest number of values in the cache of a function."""

Function = Callable[[float], float | Sequence[float]]
"""A function of time [s]."""


@final
@dataclass(frozen=True)
class Signal:
    """Function of time [s] with the instants at which its value or one of its rates jumps.

    ``inputs={"length": Signal(lambda t: (1 + abs(t - 0.5), np.sign(t - 0.5), 0.0), breaks=[0.5])}``: a run has
    communication points at these instants, and evaluates the function before and after each, not at it.

    :param function: returns a number, or value, rate and acceleration.
    :param breaks: instants [s].
    :raises SimulationError: if the function is not callable, or the breaks are not a list of finite numbers.
    """

    function: Function
    breaks: ArrayLike = ()

    def __post_init__(self) -> None:
        if not callable(self.function):
            raise SimulationError(f"Signal: {shown(self.function)} is not a function of time")
        object.__setattr__(self, "breaks", tuple(_break_instants("Signal", self.breaks).tolist()))

    def __call__(self, t: float) -> float | Sequence[float]:
        """The value of the function at t [s]."""
        return self.function(t)


@final
@dataclass(frozen=True)
class Drive:
    """Function of time [s] that feeds one input of a component, or value, rate and acceleration of a port.

    :param among: smallest and largest integer that it may return; None: it returns reals.
    :param breaks: instants [s] at which its values or their rates jump, ascending.
    """

    function: Function
    inputs: tuple[VariableReference, ...]
    among: tuple[int, int] | None = None
    breaks: Vector = field(default_factory=lambda: np.empty(0), compare=False)
    _begins: dict[float, Vector] = field(default_factory=dict, compare=False, repr=False)
    _cache: dict[float, Vector] = field(default_factory=dict, compare=False, repr=False)

    @property
    def references(self) -> list[VariableReference]:
        """References of the values of the function on the bus."""
        return [(SIGNALS, f"{part}.{variable}") for part, variable in self.inputs]

    def sample(self, times: Vector) -> Vector:
        """Values at instants inside of steps, shape (*times, inputs).

        :raises SimulationError: as a call does.
        """
        instants = times.ravel().tolist()
        try:
            values = np.array([self.function(t) for t in instants], dtype=float).reshape(len(instants), -1)
        except Exception:  # noqa: BLE001 - raised again for its instant below
            values = np.empty((0, 0))
        if values.shape != (len(instants), len(self.inputs)) or not np.isfinite(values).all():
            values = np.array([self(t) for t in instants])
        return values.reshape(*times.shape, -1)

    def break_margin(self, t: ArrayLike) -> Vector:
        """Distance [s] from a break at t beyond which rounding does not reach the other side of the break."""
        return 8 * np.spacing(np.maximum(np.abs(t), np.max(np.abs(self.breaks), initial=0.0)))

    def begin_piece(self, t: float) -> None:
        """Start a smooth piece at t, whose values there are the limits from the right.

        Integers and truth values are those at t itself, unless the function has a break there.
        """
        self._begins.clear()
        value = self(t)
        if self.among is None or np.any(np.abs(self.breaks - t) <= time_rounding(t)):
            right = self(t + float(self.break_margin(t)))
            self._begins[t] = value if np.allclose(right, value, rtol=1e-12, atol=1e-100) else right

    def save(self) -> dict[float, Vector]:
        """Instant and values at the start of the present piece, for :meth:`restore`."""
        return dict(self._begins)

    def restore(self, saved: Mapping[float, Vector]) -> None:
        """Return to the piece that was saved."""
        self._begins.clear()
        self._begins.update(saved)

    def next_break(self, time: float) -> float | None:
        """First break of the function after a time [s]; None if there is none."""
        index = int(np.searchsorted(self.breaks, time + time_rounding(time), side="right"))
        return float(self.breaks[index]) if index < len(self.breaks) else None

    def __call__(self, t: float) -> Vector:
        """Values at t [s], shape (inputs,).

        :raises SimulationError: if the function raises, or returns other than so many finite numbers or integers.
        """
        if t in self._begins:
            return self._begins[t]
        if (values := self._cache.get(t)) is None:
            if len(self._cache) >= _CACHED:
                self._cache.clear()
            values = self._cache[t] = self._evaluate(float(t))
        return values

    def _evaluate(self, t: float) -> Vector:
        """Values of the function, checked."""
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
                f"{'False or True' if self.among == (0, 1) else f'an integer from {least} to {most}'}"
            )
        return values.reshape(-1)


def drives(document: SystemDocument, inputs: Mapping[str, Function], start_time: float) -> list[Drive]:
    """Drives of inputs; a function that returns three numbers drives value, rate and acceleration of a port.

    :param inputs: functions by input; an attribute ``breaks``, as :class:`Signal` has it, lists their jumps.
    :raises SimulationError: for an unknown input or one that is driven twice, for anything but a function, and for
        breaks that are not numbers.
    """
    sources: list[Drive] = []
    driven: set[VariableReference] = set()
    functions: Mapping[str, Function] = name_dictionary("inputs", inputs)
    for full_name, function in functions.items():
        owner, driven_as = document.reference("input", full_name)
        part = document.parts[owner]
        port = Port(part, driven_as)
        name = driven_as if port.exists else port.value_port.name
        variable = part.scalar(name)
        if variable.causality != "input":
            words = f"{owner}.{name} is of causality {variable.causality!r}"
            raise SimulationError(f"inputs: {words}, so it cannot be driven")
        if variable.type not in NUMBERS:
            raise SimulationError(f"inputs: {owner}.{name} is {variable.type}; only numbers can be driven")
        if not callable(function):
            words = f"{name} = {shown(function)} is not a function of time"
            raise SimulationError(f"inputs: {words}; give a constant as start value")
        triple, order = Port(part, name).motion_and_order()
        whole = triple is not None and order == 0 and evaluate(function, name, start_time).ndim > 0
        fed = tuple(port.reference for port in triple) if triple and whole else ((owner, name),)
        among = None if variable.type == "Real" else integer_range(variable.base)
        breaks = _break_instants(f"inputs: {name}", getattr(function, "breaks", ()))
        sources.append(Drive(function, fed, among, breaks))
        for twice in driven.intersection(fed):
            raise SimulationError(f"inputs: {'.'.join(twice)} is driven twice, by itself and by its port")
        driven.update(fed)
    return sources


def _break_instants(label: str, breaks: object) -> Vector:
    """Instants of breaks [s], sorted and unique.

    :raises SimulationError: unless they are a list of finite numbers.
    """
    listed = isinstance(breaks, (Sequence, np.ndarray)) and not isinstance(breaks, (str, bytes))
    try:
        instants = np.asarray(breaks if listed else None, dtype=float)
    except (TypeError, ValueError):
        instants = np.array(np.nan)
    if instants.ndim != 1 or not np.isfinite(instants).all():
        raise SimulationError(f"{label}: breaks = {shown(breaks)}: give a list of finite numbers, instants in seconds")
    return np.unique(instants)


def evaluate(function: Function, name: str, t: float) -> Vector:
    """Value of a function of time at t [s], shape () or (n,).

    :param name: name of its input, for messages.
    :raises SimulationError: if the function raises, or returns no numbers.
    """
    try:
        return np.asarray(function(t), dtype=float)
    except Exception as error:
        reason = error if isinstance(error, LiaisonsError) else repr(error)
        raise SimulationError(f"input {name!r}: its function fails at t = {t:.10g} s: {reason}") from error
