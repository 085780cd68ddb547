"""The run of a system: instances are made, initialized, stepped, recorded, and released whatever happens.

All connected and recorded reals of a system lie in one array, the *bus*.  FMUs read into it and are set from it, each
by one prepared call for all its variables, and a row of the recording is one copy of it.  The loop over the
communication points, :mod:`liaisons.cosim.loop`, makes no list and looks nothing up, so that a step costs little more
than the bare calls.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from time import perf_counter
from typing import final

import numpy as np
from numpy.typing import NDArray

from liaisons.cosim import schedule
from liaisons.cosim.adaptive import Adaptive
from liaisons.cosim.bus import Bus, Clock
from liaisons.cosim.calls import Call
from liaisons.cosim.coupling.coupled import Coupled
from liaisons.cosim.coupling.signals import watched
from liaisons.cosim.drives import SIGNALS, Drive
from liaisons.cosim.explicit import Explicit
from liaisons.cosim.instances import AnyInstance, extract, make
from liaisons.cosim.interrupts import deferred_interrupts
from liaisons.cosim.loop import Loop
from liaisons.cosim.messages import DISCARD, ERROR, WARNING, Action
from liaisons.cosim.parts import Part
from liaisons.cosim.probe import try_to_start
from liaisons.cosim.refusal import RefusedError
from liaisons.cosim.schedule import Coupling, Feeds, Place
from liaisons.folders import passing_folder
from liaisons.progress import progress_bar

_PORTION = 0.02  # [s] between two looks at the keyboard, about


@final
@dataclass(frozen=True)
class Settings:
    """How a system is run.

    :param tolerance: relative tolerance for the FMUs' solvers; None for their own.
    :param interface_tolerance: how well what FMUs hand each other has to fit, relative to its size.
    :param error_tolerance: error of a communication step, relative to the size of signals; None for fixed steps.
    :param progress: title of the progress bar; none when empty.
    """

    tolerance: float | None
    coupling: Coupling
    interface_tolerance: float
    error_tolerance: float | None
    progress: str


@final
class Execution:
    """One run; :attr:`times` and :attr:`values` say how far it came, after an exception too.

    :param parts: by name, in the order of addition.
    :param connections: input -> output.
    :param signals: functions of time that feed further inputs.
    :param recorded: the real variables to record.
    :param times: communication points [s]; with steps of adapted size the begin, the end of the first step, the end.
    """

    def __init__(
        self,
        parts: Mapping[str, Part],
        connections: Feeds,
        signals: Sequence[Drive],
        recorded: Sequence[Place],
        *,
        times: Sequence[float],
        settings: Settings,
    ) -> None:
        self._parts = parts
        self._signals = signals
        self._recorded = recorded
        self._planned = times
        self._settings = settings
        self._iterates = settings.coupling in {"implicit", "waveform"}

        driven = {place: source for s in signals for place, source in zip(s.inputs, s.places, strict=True)}
        self._feeds = driven | dict(connections)
        self._order = schedule.order([SIGNALS, *parts], self._feeds)
        also = watched(parts, self._feeds) if self._iterates else []
        self._bus = Bus(self._order, self._feeds, also, recorded)
        self._rows = np.empty((len(times), self._bus.values.size))
        self._points: list[float] = []

        self._clock = Clock(times[0])
        self._instances: dict[str, AnyInstance] = {}
        self._owners: dict[Call, tuple[Action, str]] = {}

    @property
    def times(self) -> NDArray[np.float64]:
        """The communication points that were reached [s]."""
        return np.array(self._points)

    @property
    def values(self) -> NDArray[np.float64]:
        """What was recorded so far, shape (len(recorded), len(times))."""
        places = [self._bus.index[place] for place in self._recorded]
        return np.ascontiguousarray(self._rows[: len(self._points)].T[places])

    def run(self) -> None:
        """Everything from extraction to release.

        :raises SimulationError: if an FMU refuses something.
        :raises KeyboardInterrupt: if it is asked for, at the end of the communication step.
        """
        with ExitStack() as stack:
            directory = stack.enter_context(passing_folder())
            folders: dict[Path, Path] = {}
            for name, part in self._parts.items():
                path = part.fmu.path
                if path not in folders:
                    folders[path] = extract(path, directory / str(len(folders)))
                    try_to_start(part, folders[path], self._planned)
                asks = self._iterates and part.asks
                self._instances[name] = stack.enter_context(make(name, part.fmu, folders[path], asks=asks))
            calls = self._initialize()
            span = self._planned[0], self._planned[-1]
            show = stack.enter_context(progress_bar(self._settings.progress, "t = {:.6g} of {:.6g} s", *span))
            interrupts = stack.enter_context(deferred_interrupts())
            if self._settings.error_tolerance is None:
                self._advance(calls, show, interrupts)
            else:
                self._adapt(calls, show, interrupts)

    def _initialize(self) -> list[Call]:
        """Bring everything to the begin; returns the calls of a communication step."""
        begin, end = self._planned[0], self._planned[-1]
        self._clock.set(begin, begin)
        for name, instance in self._instances.items():
            instance.setup(self._settings.tolerance, begin, end)
            for variable, value in self._parts[name].starts.items():
                instance.assign(variable, value)
            instance.enter_initialization()
        calls = self._settle_iterating(begin) if self._iterates else self._settle_explicitly()
        self._record(begin)
        return calls

    def _settle_explicitly(self) -> list[Call]:
        explicit = Explicit(
            self._parts,
            self._instances,
            self._feeds,
            self._bus,
            order=self._order,
            signals=self._signals,
            clock=self._clock,
        )
        self._owners = explicit.owners
        self._perform(explicit.consistent(self._depends_initially, initial=True))
        for instance in self._instances.values():
            instance.exit_initialization()
        self._perform(explicit.consistent(self._depends, initial=False))
        return explicit.step(self._depends, self._settings.coupling)

    def _settle_iterating(self, begin: float) -> list[Call]:
        self._coupled = coupled = Coupled(
            self._parts,
            self._instances,
            self._feeds,
            self._bus,
            drives=self._signals,
            newton=self._settings.coupling == "implicit",
            depends=self._depends,
            depends_initially=self._depends_initially,
            tolerance=self._settings.interface_tolerance,
            judge=self._fail,
            clock=self._clock,
        )
        coupled.settle(begin, self._planned[1], initial=True)
        for instance in self._instances.values():
            instance.exit_initialization()
        coupled.settle(begin, self._planned[1], initial=False)
        others = [call for name in self._parts for call in self._other_readings(name)]
        self._perform(others)
        return [coupled.step, *others]

    def _other_readings(self, name: str) -> list[Call]:
        places = self._bus.others(name)
        if not places:
            return []
        variables = self._parts[name].fmu.variables
        call = self._instances[name].getter([variables[v] for _, v in places], self._bus.buffer(places))
        self._owners[call] = ("get", name)
        return [call]

    def _advance(self, calls: Sequence[Call], show: Callable[[float], None], interrupts: list[int]) -> None:
        """The steps from each communication point to the next one, so many at a time that nobody waits for long."""
        loop = Loop(calls, self._clock, self._bus, self._planned, rows=self._rows, judge=self._judge)
        loop.begin()
        many = 1
        try:
            while loop.done < len(self._planned):
                begin = perf_counter()
                loop.advance(min(loop.done + many, len(self._planned)))
                many = max(1, 2 * many if perf_counter() - begin < _PORTION else many // 2)
                show(self._planned[loop.done - 1])
                if interrupts:
                    raise KeyboardInterrupt
        finally:
            self._points = list(self._planned[: loop.done])

    def _adapt(self, calls: Sequence[Call], show: Callable[[float], None], interrupts: list[int]) -> None:
        """The same, with steps as long as their error allows."""
        begin, first, end = self._planned[0], self._planned[1], self._planned[-1]
        tolerance = self._settings.error_tolerance
        assert tolerance is not None
        adaptive = Adaptive(
            self._parts,
            self._instances,
            self._bus,
            signals=self._coupled.signals if self._iterates else None,
            perform=lambda start, stop: self._step(calls, start, stop),
            judge=self._fail,
            tolerance=tolerance,
            order=self._coupled.order if self._iterates else 1,
        )
        for time, values in adaptive.points(begin, end, first - begin):
            self._record(time, values)
            show(time)
            if interrupts:
                raise KeyboardInterrupt

    def _step(self, calls: Iterable[Call], start: float, end: float) -> None:
        self._clock.set(start, end)
        self._perform(calls)

    def _record(self, time: float, values: NDArray[np.float64] | None = None) -> None:
        count = len(self._points)
        if count == len(self._rows):
            self._rows = np.concatenate([self._rows, np.empty_like(self._rows)])
        self._rows[count] = self._bus.values if values is None else values
        self._points.append(time)

    def _perform(self, calls: Iterable[Call]) -> None:
        for call in calls:
            if status := call():
                self._judge(call, status)

    def _judge(self, call: Call, status: int) -> None:
        if status != WARNING:
            action, name = self._owners[call]
            self._fail(name, action, status)

    def _fail(self, name: str, action: Action, status: int) -> None:
        error = self._instances[name].failure(action, status, self._clock.when(action))
        # after both an instance may go on from a saved state, and the inputs of a shorter step may be better ones
        raise RefusedError(str(error)) if status in {DISCARD, ERROR} else error

    def _depends(self, output: Place, input_: Place) -> bool:
        return self._parts[output[0]].fmu.depends(output[1], input_[1])

    def _depends_initially(self, output: Place, input_: Place) -> bool:
        return self._parts[output[0]].fmu.depends(output[1], input_[1], initially=True)
