"""The run of a system: instances are made, initialized, stepped, recorded, and released whatever happens.

All connected and recorded reals of a system lie in one array, the *bus*.  FMUs read into it and are set from it, each
by one prepared call for all its variables, and a row of the recording is one copy of it.  The loop over the
communication points makes no list and looks nothing up, so that a step costs little more than the bare foreign calls.
"""

from __future__ import annotations

import signal
import sys
import threading
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from ctypes import Array, c_double
from dataclasses import dataclass
from functools import partial
from itertools import pairwise
from pathlib import Path
from tempfile import TemporaryDirectory
from types import FrameType
from typing import final

import fmpy
import numpy as np
from numpy.typing import NDArray

from liaisons.cosim import schedule
from liaisons.cosim.component import Component
from liaisons.cosim.instance import WARNING, Call, Instance
from liaisons.cosim.schedule import Coupling, Feeds, Operation, Place
from liaisons.errors import SimulationError

SIGNALS = ""
"""Stands for the functions of time that feed inputs, where the name of a component is expected."""


Function = Callable[[float], float | Sequence[float]]
"""A function of time [s]."""


@final
@dataclass(frozen=True)
class Signal:
    """A function of time [s] that feeds inputs of one component: a number, or one for each of them."""

    function: Function
    inputs: tuple[Place, ...]

    @property
    def places(self) -> list[Place]:
        """Where its values stand on the bus."""
        return [(SIGNALS, f"{component}.{variable}") for component, variable in self.inputs]

    def __call__(self, t: float) -> NDArray[np.float64]:
        """Its values, shape (inputs,).

        :raises SimulationError: if the function raises, or returns something else than so many finite numbers.
        """
        name = self.inputs[0][1]
        values = evaluate(self.function, name, t)
        if values.size != len(self.inputs) or not np.isfinite(values).all():
            raise SimulationError(
                f"input {name!r}: its function returns {values.tolist()} at t = {t:.10g} s, "
                f"expected {len(self.inputs)} finite number{'s' * (len(self.inputs) > 1)}"
            )
        return values.reshape(-1)


def evaluate(function: Function, name: str, t: float) -> NDArray[np.float64]:
    """What a function of time returns.

    :param name: the input that it is for.
    :raises SimulationError: if it raises, or returns no numbers.
    """
    try:
        return np.asarray(function(t), dtype=float)
    except Exception as error:
        raise SimulationError(f"input {name!r}: its function fails at t = {t:.10g} s: {error!r}") from error


@final
class Execution:
    """One run; :attr:`count` and :attr:`values` say how far it came, after an exception too.

    :param components: by name, in the order of addition.
    :param links: input -> output.
    :param signals: functions of time that feed further inputs.
    :param recorded: the real variables to record.
    :param times: communication points [s].
    :param tolerance: relative tolerance for the FMUs' solvers; None for their own.
    :param progress: title of the progress bar; none when empty.
    """

    def __init__(
        self,
        components: Mapping[str, Component],
        links: Feeds,
        signals: Sequence[Signal],
        recorded: Sequence[Place],
        times: Sequence[float],
        *,
        tolerance: float | None,
        coupling: Coupling,
        progress: str,
    ) -> None:
        self._components = components
        self._signals = signals
        self._recorded = recorded
        self._times = times
        self._tolerance = tolerance
        self._coupling: Coupling = coupling
        self._progress = progress

        driven = {place: source for s in signals for place, source in zip(s.inputs, s.places, strict=True)}
        self._feeds = driven | dict(links)
        self._order = schedule.order([SIGNALS, *components], self._feeds)
        self._bus = _Bus(self._order, self._feeds, recorded)
        self._rows = np.empty((len(times), self._bus.values.size))
        self.count = 0

        self._start, self._size, self._end = c_double(), c_double(), times[0]
        self._instances: dict[str, Instance] = {}
        self._owners: dict[Call, Operation] = {}

    @property
    def values(self) -> NDArray[np.float64]:
        """What was recorded so far, shape (len(recorded), count)."""
        return np.ascontiguousarray(self._rows[: self.count].T[[self._bus.index[place] for place in self._recorded]])

    def run(self) -> None:
        """Everything from extraction to release.

        :raises SimulationError: if an FMU refuses something.
        :raises KeyboardInterrupt: if it is asked for, at the end of the communication step.
        """
        with ExitStack() as stack:
            directory = Path(stack.enter_context(TemporaryDirectory(prefix="liaisons-", ignore_cleanup_errors=True)))
            folders: dict[Path, Path] = {}
            for name, component in self._components.items():
                path = component.fmu.path
                if path not in folders:
                    folders[path] = _extract(path, directory / str(len(folders)))
                self._instances[name] = stack.enter_context(Instance(name, component.fmu, folders[path]))
            self._initialize()
            self._advance(stack.enter_context(_deferred_interrupts()))

    def _initialize(self) -> None:
        for name, instance in self._instances.items():
            component = self._components[name]
            instance.setup(self._tolerance, self._times[0], self._times[-1])
            for variable, value in component.starts.items():
                instance.assign(component.fmu.variables[variable], value)
            instance.enter_initialization()
        program = schedule.consistent(self._order, self._feeds, self._depends_initially)
        self._perform(self._prepared(program, initial=True))
        for instance in self._instances.values():
            instance.exit_initialization()
        self._perform(self._prepared(schedule.consistent(self._order, self._feeds, self._depends)))
        self._rows[0] = self._bus.values
        self.count = 1

    def _advance(self, interrupts: list[int]) -> None:
        """The loop over the communication points."""
        newest = {name for name, component in self._components.items() if component.takes_newest}
        calls = self._prepared(schedule.step(self._order, self._feeds, self._depends, self._coupling, newest))
        bus, rows, width = self._bus.values.data, self._rows.reshape(-1).data, self._bus.values.size
        start, size = self._start, self._size
        show = _progress_bar(self._progress, self._times) if self._progress else None
        place = width
        for now, then in pairwise(self._times):
            start.value = now
            size.value = then - now
            self._end = then
            for call in calls:  # _perform written out: one Python call less a step
                if status := call():
                    self._judge(call, status)
            rows[place : place + width] = bus
            place += width
            self.count += 1
            if show is not None:
                show(then)
            if interrupts:
                raise KeyboardInterrupt

    def _perform(self, calls: Iterable[Call]) -> None:
        for call in calls:
            if status := call():
                self._judge(call, status)

    def _judge(self, call: Call, status: int) -> None:
        if status == WARNING:
            return
        action, name = self._owners[call]
        since = f"from t = {self._start.value:.10g} s to" if action == "step" else "at"
        raise self._instances[name].failure(action, status, f" {since} t = {self._end:.10g} s")

    def _depends(self, output: Place, input_: Place) -> bool:
        return self._components[output[0]].fmu.depends(output[1], input_[1])

    def _depends_initially(self, output: Place, input_: Place) -> bool:
        return self._components[output[0]].fmu.depends(output[1], input_[1], initially=True)

    def _prepared(self, program: Iterable[Operation], *, initial: bool = False) -> list[Call]:
        """The calls that perform a program; in initialization, only what is connected is read."""
        return [call for operation in program for call in self._lowered(operation, initial)]

    def _lowered(self, operation: Operation, initial: bool) -> Iterator[Call]:
        action, name = operation
        bus = self._bus
        if name == SIGNALS:
            if action == "get":
                yield from (partial(self._evaluate, s, bus.part(s.places)) for s in self._signals)
            return
        instance, variables = self._instances[name], self._components[name].fmu.variables
        if action == "step":
            call = instance.stepper(self._start, self._size)
        else:
            places = bus.inputs[name] if action == "set" else bus.outputs(name, every=not initial)
            if not places:
                return
            if action == "set":
                yield from bus.copies(places)
            prepare = instance.setter if action == "set" else instance.getter
            call = prepare([variables[variable].reference for _, variable in places], bus.buffer(places))
        self._owners[call] = operation
        yield call

    def _evaluate(self, source: Signal, part: NDArray[np.float64]) -> None:
        part[:] = source(self._end)


@final
class _Bus:
    """All connected and recorded reals, those of one call side by side.

    :param order: components, :data:`SIGNALS` among them.
    :param feeds: input -> output.
    :param recorded: further variables that are wanted.
    """

    def __init__(self, order: Sequence[str], feeds: Feeds, recorded: Iterable[Place]) -> None:
        sources = dict.fromkeys(feeds.values())
        self._feeds = feeds
        self._connected = _by_component(order, sources)
        self._others = _by_component(order, [p for p in dict.fromkeys(recorded) if p not in feeds and p not in sources])
        self.inputs = _by_component(order, feeds)
        places = [p for name in order for p in (*self.outputs(name), *self.inputs[name])]
        self.index = {place: k for k, place in enumerate(places)}
        self.values = np.zeros(len(places))

    def outputs(self, name: str, *, every: bool = True) -> list[Place]:
        """What is read from a component: what feeds something, and ``every`` other thing that is recorded."""
        return [*self._connected[name], *(self._others[name] if every else ())]

    def part(self, places: Sequence[Place]) -> NDArray[np.float64]:
        """View of places that lie side by side."""
        first = self.index[places[0]]
        return self.values[first : first + len(places)]

    def buffer(self, places: Sequence[Place]) -> Array[c_double]:
        """The same for foreign functions."""
        return (c_double * len(places)).from_buffer(self.part(places).data)

    def copies(self, inputs: Sequence[Place]) -> list[Call]:
        """Calls that copy to inputs what feeds them, neighbours at once."""
        runs: list[tuple[int, int, int]] = []
        for place in inputs:
            target, source = self.index[place], self.index[self._feeds[place]]
            if runs and (target, source) == (runs[-1][0] + runs[-1][2], runs[-1][1] + runs[-1][2]):
                runs[-1] = (*runs[-1][:2], runs[-1][2] + 1)
            else:
                runs.append((target, source, 1))
        bus = self.values.data
        return [partial(bus[t : t + n].__setitem__, slice(None), bus[s : s + n]) for t, s, n in runs]


def _by_component(names: Iterable[str], places: Iterable[Place]) -> dict[str, list[Place]]:
    grouped: dict[str, list[Place]] = {name: [] for name in names}
    for place in places:
        grouped[place[0]].append(place)
    return grouped


def _extract(path: Path, folder: Path) -> Path:
    try:
        fmpy.extract(path, folder, include=lambda name: not name.startswith(("sources/", "documentation/")))
    except Exception as error:  # fmpy raises the base class; zipfile and zlib their own
        raise SimulationError(f"{path}: cannot be extracted: {error}; build or copy it again") from error
    return folder


@contextmanager
def _deferred_interrupts() -> Iterator[list[int]]:
    """A list into which an interrupt from the keyboard goes; a second one acts at once.

    A communication step is not broken off in its middle, where an FMU of Python code would take it for its own error.
    """
    interrupts: list[int] = []
    usual = signal.getsignal(signal.SIGINT)
    if threading.current_thread() is not threading.main_thread() or usual is not signal.default_int_handler:
        yield interrupts
        return

    def defer(number: int, _frame: FrameType | None) -> None:
        interrupts.append(number)
        signal.signal(signal.SIGINT, usual)

    signal.signal(signal.SIGINT, defer)
    try:
        yield interrupts
    finally:
        signal.signal(signal.SIGINT, usual)


def _progress_bar(title: str, times: Sequence[float]) -> Callable[[float], None]:
    """A function that is told the time reached [s]; it writes to stderr ten times a second, and at the end."""
    begin = shown = time.monotonic()
    first, last = times[0], times[-1]

    def show(t: float) -> None:
        nonlocal shown
        now = time.monotonic()
        if now - shown < 0.1 and t < last:
            return
        shown = now
        part = (t - first) / (last - first)
        rest = (now - begin) * (1 / part - 1)
        bar = f"[{'#' * int(30 * part):30}]"
        sys.stderr.write(f"\r{title} {bar} t = {t:.6g} of {last:.6g} s, {rest:.0f} s left " + "\n" * (t == last))
        sys.stderr.flush()

    return show
