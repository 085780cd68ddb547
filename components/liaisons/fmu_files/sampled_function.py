"""A Python function as a sampled component of a system: what it reads and writes, and its description as an FMU."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Sequence
from copy import deepcopy
from dataclasses import dataclass
from hashlib import sha256
from typing import Any, final
from zipfile import ZipFile

from liaisons.base.arguments import check_finite, check_positive, shown
from liaisons.base.clocks import CLOCK_ERROR
from liaisons.base.folders import process_folder
from liaisons.errors import InvalidValueError, one_line
from liaisons.fmu_files.fmu import Fmu
from liaisons.fmu_files.terminals import Terminals
from liaisons.fmu_files.variables import Scalar, Variables

TIME = "time"
"""Name by which the instant of a sample is read."""


@final
@dataclass(frozen=True, eq=False)
class SampledFunction:
    """A function that is called at t = 0, period, 2 period, ...; made by :func:`sampled`."""

    function: Callable[..., Any]
    period: float
    reads: tuple[str, ...]
    writes: tuple[str, ...]
    state: Any
    delay: float

    @property
    def name(self) -> str:
        """Name of the function, for messages."""
        return getattr(self.function, "__name__", type(self.function).__name__)

    @property
    def inputs(self) -> dict[str, str]:
        """Name of each input -> ``"component.variable"`` that it reads, time excepted."""
        return {variable_name(name): name for name in self.reads if name != TIME}

    @property
    def outputs(self) -> dict[str, str]:
        """Name of each output -> ``"component.variable"`` that it writes."""
        return {variable_name(name): name for name in self.writes}

    def last_sample(self, t: float) -> float:
        """Instant of the last sample [s] at or before t [s], up to the error of clocks."""
        return self.period * math.floor(t / self.period + CLOCK_ERROR)

    def is_sample(self, t: float) -> bool:
        """Whether t [s] is the instant of a sample, up to the error of clocks."""
        return t - self.last_sample(t) <= CLOCK_ERROR * self.period

    def next_event(self, t: float) -> float:
        """Instant [s] of the next sample, or change of the outputs, after t [s]."""
        return min(self.last_sample(t - lag) + self.period + lag for lag in (0.0, self.delay))

    def is_due(self, t: float, instant: float) -> bool:
        """Whether t [s] has reached an instant [s], up to the error of clocks."""
        return t >= instant - CLOCK_ERROR * self.period

    def description(self) -> Fmu:
        """Description of the function as an FMU, whose file is empty."""
        kinds = [*((name, "input", True) for name in self.inputs), *((name, "output", False) for name in self.outputs)]
        scalars = [
            Scalar(name, i, "Real", "Real", causality, causality == "input", "0", "", i, continuous=continuous)
            for i, (name, causality, continuous) in enumerate(kinds)
        ]
        event = Scalar("next_event_time", len(kinds), "Real", "Real", "local", False, None, "s", len(kinds), 0, False)
        variables = Variables({scalar.name: scalar for scalar in (*scalars, event)})
        path = process_folder() / sha256(repr(id(self)).encode()).hexdigest()[:16] / f"{self.name.strip('<>')}.fmu"
        path.parent.mkdir(exist_ok=True)
        with ZipFile(path, "w"):
            pass
        return Fmu(path, self.name, variables, Terminals(variables), function=self)


def variable_name(reference: str) -> str:
    """Name of the variable in ``"component.variable"``."""
    return reference.rpartition(".")[2]


def sampled(
    function: Callable[..., Any],
    *,
    period: float,
    reads: Sequence[str] = (),
    writes: Sequence[str],
    state: Any = None,
    delay: float = 0.0,
) -> SampledFunction:
    """Component of a system that calls a Python function once per period, and holds its outputs between.

    ::

        def feedback(theta, theta_dot):
            return -20 * theta - 5 * theta_dot

        controller = sampled(feedback, period=0.02, reads=["cart.theta", "cart.theta_dot"], writes=["cart.theta_force"])
        system.add("controller", controller)

    With a ``state`` the function takes it as the first argument and returns it last, ``(outputs, state)``.  It must
    return a new state and not change the old one, because runs return to earlier states, and call the function again if
    its inputs at an instant change.

    :param period: sampling period [s]: samples are at its multiples.
    :param reads: names of the arguments: variables ``"component.variable"``, with which they are connected, or names of
        inputs to be connected; ``"time"`` is the instant of the sample [s].
    :param writes: names of the numbers that it returns, in the same way.
    :param state: state before the first sample; None: the function has no state.
    :param delay: time from a sample to the change of the outputs [s], at most the period.
    :raises InvalidValueError: for anything but a function, a time out of range, and a name that is given twice.
    """
    if not callable(function):
        raise InvalidValueError(f"sampled: {shown(function)} is not a function")
    label = f"sampled: {getattr(function, '__name__', 'function')}"
    check_positive(f"{label}: period", period)
    check_finite(f"{label}: delay", delay)
    if not 0 <= delay <= period:
        raise InvalidValueError(f"{label}: delay = {delay:g} s: must be from 0 to the period, {period:g} s")
    for argument, names in (("reads", reads), ("writes", writes)):
        if isinstance(names, str) or not all(isinstance(name, str) and name for name in names):
            raise InvalidValueError(f"{label}: {argument} = {shown(names)}: give a list of names")
    if not writes or TIME in writes:
        raise InvalidValueError(f"{label}: writes = {shown(writes)}: name what it returns")
    for name, count in Counter(map(variable_name, (*reads, *writes))).items():
        if count > 1:
            raise InvalidValueError(f"{label}: two variables would be called {name!r}: name them, and connect them")
    try:
        own = deepcopy(state)
    except Exception as error:  # of any class, whose own it is
        words = f"cannot be copied ({one_line(str(error))}), so that no run could return to it; give numbers or arrays"
        raise InvalidValueError(f"{label}: state = {shown(state)} {words}") from error
    return SampledFunction(function, float(period), tuple(reads), tuple(writes), own, float(delay))
