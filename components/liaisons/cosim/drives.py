"""Functions of time that drive inputs, where no FMU does."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import final

import numpy as np
from numpy.typing import NDArray

from liaisons.arguments import shown
from liaisons.cosim.parts import Part
from liaisons.cosim.schedule import Place
from liaisons.cosim.starts import RANGES
from liaisons.cosim.variables import NUMBERS
from liaisons.errors import LiaisonsError, SimulationError

SIGNALS = ""
"""Stands for the functions of time, where the name of a component is expected."""

_BOOLEAN = (0, 1)

Function = Callable[[float], float | Sequence[float]]
"""A function of time [s]."""


@final
@dataclass(frozen=True)
class Drive:
    """A function of time [s] that feeds inputs of one component: a number, or one for each of them.

    :param among: the integers that its values have to be among, if they have to.
    """

    function: Function
    inputs: tuple[Place, ...]
    among: tuple[int, int] | None = None

    @property
    def places(self) -> list[Place]:
        """Where its values stand on the bus."""
        return [(SIGNALS, f"{part}.{variable}") for part, variable in self.inputs]

    def __call__(self, t: float) -> NDArray[np.float64]:
        """Its values, shape (inputs,).

        :raises SimulationError: if the function raises, or returns something else than so many finite numbers, or
            integers.
        """
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


def drives(functions: Mapping[Place, Function], parts: Mapping[str, Part], start_time: float) -> list[Drive]:
    """The functions of time that drive inputs; one that returns several numbers drives a whole port.

    :raises SimulationError: if there is no such input, it is driven twice, or what drives it is no function.
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
        found.append(Drive(function, inputs, among))
    driven = [place for drive in found for place in drive.inputs]
    for place in driven:
        if driven.count(place) > 1:
            raise SimulationError(f"inputs: {'.'.join(place)} is driven twice, by itself and by its port")
    return found


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
