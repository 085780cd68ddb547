"""Running FMUs of Model Exchange: their states are integrated here, by CVODE, from each event to the next one.

An input that is told how it moves within a step moves so; else it is held.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from ctypes import CDLL, Structure, byref, c_bool, c_double, c_int, c_size_t, c_void_p
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, final

import numpy as np
from numpy.typing import NDArray

from liaisons.cosim.calls import Call
from liaisons.cosim.description import Fmu
from liaisons.cosim.instances.fmi2 import Instance2
from liaisons.cosim.instances.fmi3 import Instance3
from liaisons.cosim.instances.protocol import Loaded, Numbers, Scalars
from liaisons.cosim.messages import DISCARD, WARNING
from liaisons.cosim.starts import Value
from liaisons.errors import EndedError, RefusedError, SimulationError

if TYPE_CHECKING:
    from liaisons.cosim.instances.cvode import Cvode

TOLERANCE = 1e-8
"""Relative, where neither the user nor the FMU says more."""
_ROUNDING = 1e-9
"""Relative difference of inputs, and part of a step behind its end, that is none."""
_STUCK, _MOST = 1e-12, 1000
"""So many events within this part of a step have no end."""


@final
class _Motion:
    """How inputs move within the next step.

    :param orders: of the derivatives that are told, each of the input with the number in ``rows``.
    :param told: where the derivatives stand, and which of them.
    :param places: of the inputs among all that are held.
    :ivar values: of the inputs, shape (inputs,); ``buffer`` is the same.
    """

    def __init__(
        self, orders: Sequence[int], rows: Sequence[int], told: tuple[Numbers, Sequence[int]], places: NDArray[np.intp]
    ) -> None:
        self._orders, self._rows, self._told = (np.array(numbers, dtype=np.intp) for numbers in (orders, rows, told[1]))
        self._all, self.places = np.ctypeslib.as_array(told[0]), places
        self._factorials = np.array([math.factorial(order) for order in orders])
        self.buffer = (c_double * places.size)()
        self.values = np.ctypeslib.as_array(self.buffer)

    def begin(self, time: float) -> None:
        """Take the inputs for what they are now [s]."""
        self._first, self._begin = self.values.copy(), time
        self._slopes = self._all[self._told] / self._factorials

    def go(self, time: float) -> None:
        """Go to a time [s]."""
        self.values[:] = self._first
        np.add.at(self.values, self._rows, self._slopes * (time - self._begin) ** self._orders)


class ModelExchange(Loaded, ABC):
    """An instance of Model Exchange: between steps in continuous-time mode, where its outputs are those of the time.

    :cvar derivatives: the function that calculates them.
    """

    derivatives: ClassVar[str]

    def __init__(self, name: str, fmu: Fmu, directory: Path) -> None:
        self._solver: Cvode | None = None
        self._clock = c_double()
        self._final = self.flag(True)  # no state from before a step will be set after it
        self._places: dict[str, int] = {}  # of inputs in:
        self._held = np.empty(0)
        self._motion: tuple[_Motion, Call, Call] | None = None  # and what reads and sets its inputs
        super().__init__(name, fmu, directory)

    # ---- from the begin to the first step

    def initialize(
        self, starts: Mapping[str, Value], tolerance: float | None, start_time: float, stop_time: float
    ) -> None:
        self._tolerance = tolerance or self._fmu.experiment.tolerance or TOLERANCE
        self._clock.value, self._next_event, self._end_time = start_time, math.inf, math.inf
        self._jumped, self._motion, self._held[:] = False, None, np.nan
        super().initialize(starts, tolerance, start_time, stop_time)

    def exit_initialization(self) -> None:
        super().exit_initialization()
        if self._solver is None:
            states, indicators = self._sizes()
            self._nominals, self._indicators = np.ones(states), np.zeros(indicators)
            self._set_time = self._function(f"{self.prefix}SetTime")
            self._set_states = self._function(f"{self.prefix}SetContinuousStates")
            self._get_rates = self._function(self.derivatives)
            self._get_indicators = self._function(f"{self.prefix}GetEventIndicators")
            self._solver = _cvode()(states, indicators, self._rates, self._signs, self._tolerance)
            self._there = c_void_p(self._solver.states.ctypes.data)
            self._count = c_size_t(states)
        self._iterate()

    @abstractmethod
    def _sizes(self) -> tuple[int, int]:
        """Numbers of states and of event indicators."""

    # ---- inputs

    def setter(self, variables: Scalars, values: Numbers) -> Call:
        """As :meth:`Instance.setter`; what moves in jumps only is set in event mode, with what is set beside it."""
        write, numbers = super().setter(variables, values), np.ctypeslib.as_array(values)
        places, continuous = self._placed(variables), all(variable.continuous for variable in variables)

        def put() -> int | None:
            if not self._initialized:
                return write()
            held = self._held[places]
            same = bool((np.abs(numbers - held) <= _ROUNDING * np.maximum(np.abs(numbers), np.abs(held))).all())
            if continuous:
                self._jumped |= not same
            elif same:
                return 0
            else:
                self._call(f"{self.prefix}EnterEventMode")
            self._held[places] = numbers
            status = write()
            if not continuous:
                self._iterate()
            return status

        return Call(put).of("set", write.failure or self.failure)

    def _placed(self, variables: Scalars) -> NDArray[np.intp]:
        """Where inputs stand among those that are held."""
        places = [self._places.setdefault(variable.name, len(self._places)) for variable in variables]
        self._held = np.full(len(self._places), np.nan)
        return np.array(places, dtype=np.intp)

    def input_derivatives(self, variables: Scalars, orders: Sequence[int], values: Numbers) -> Call:
        inputs = [variable for variable in dict.fromkeys(variables) if variable.continuous]  # others do not move
        moving = [k for k, variable in enumerate(variables) if variable.continuous]
        rows = [inputs.index(variables[k]) for k in moving]
        motion = _Motion([orders[k] for k in moving], rows, (values, moving), self._placed(inputs))
        told = motion, self.getter(inputs, motion.buffer), super().setter(inputs, motion.buffer)
        return Call(setattr, self, "_motion", told).of("shape", self.failure)

    def output_derivatives(self, variables: Scalars, orders: Sequence[int], values: Numbers) -> Call:
        raise NotImplementedError  # Fmu.output_derivative_order is 0

    # ---- a step

    def stepper(self, time: c_double, size: c_double) -> Call:
        return Call(self._advance, time, size).of("step", self.failure)

    def _advance(self, time: c_double, size: c_double) -> int:
        try:
            self._go(time.value + size.value, size.value)
        except EndedError as ended:
            self._end_time = ended.time
            return DISCARD
        return 0

    def _end(self) -> float | None:
        return None if math.isinf(self._end_time) else self._end_time

    def _go(self, end: float, size: float) -> None:
        """Integrate to the end of a step [s], through all events."""
        if self._motion is not None:
            motion, read, _ = self._motion
            self._require(self._fine(self.functions["get"], read()))
            motion.begin(self._clock.value)
        if self._jumped:
            self._jumped, self._stale = False, True
            if self._crossed():
                self._event()
        stuck = 0
        while self._clock.value < end:
            begin = self._clock.value
            soon = self._next_event <= end + _ROUNDING * size
            happened = self._integrate(self._next_event if soon else end)
            if happened or self._clock.value >= self._next_event:
                self._event()
            stuck = 0 if self._clock.value > begin + _STUCK * size else stuck + 1
            if stuck > _MOST:
                raise RefusedError(f"{self.name}: more than {_MOST} events{self._when()}; it may chatter")
        if self._motion is not None:
            motion, self._motion = self._motion[0], None
            self._held[motion.places] = motion.values
        if self._places:
            self._crossed()

    def _integrate(self, stop: float) -> bool:
        """Take a step of the solver, not beyond a time [s]; whether there is an event then."""
        begin, time, event, solver = self._clock.value, stop, False, self._solver
        assert solver is not None
        self._refusal: tuple[str, int] | None = None
        if (self._count.value or self._indicators.size) and stop - begin > 4 * np.spacing(max(abs(begin), abs(stop))):
            if self._stale:
                self._restart(solver)
            try:
                time, event = solver.step(stop)
            except RefusedError as error:
                self._require(self._refusal is None)
                raise RefusedError(f"{self.name}: cannot be integrated from t = {begin:.10g} s: {error}") from None
        self._require(self._place(time, self._there))
        return self._completed() or event

    def _restart(self, solver: Cvode) -> None:
        if self._count.value:
            self._call(f"{self.prefix}GetContinuousStates", self._there, self._count)
            nominals = c_void_p(self._nominals.ctypes.data)
            self._call(f"{self.prefix}GetNominalsOfContinuousStates", nominals, self._count)
        solver.restart(self._clock.value, self._nominals)
        self._stale = False

    def _completed(self) -> bool:
        """Tell that a step of the solver is complete; whether the FMU wants an event."""
        if not self._fmu.completes:
            return False
        event, ends = self.flag(), self.flag()
        self._call(f"{self.prefix}CompletedIntegratorStep", self._final, byref(event), byref(ends), about=self._when())
        if ends.value:
            raise self._ending()
        return bool(event.value)

    # ---- what the solver asks for

    def _rates(self, time: float, states: int, result: int) -> int:
        fine = self._place(time, c_void_p(states)) and self._fine(
            self.derivatives, self._get_rates(self._pointer, c_void_p(result), self._count)
        )
        return self._answer(fine)

    def _signs(self, time: float, states: int, result: int) -> int:
        fine = self._place(time, c_void_p(states)) and self._fine(
            f"{self.prefix}GetEventIndicators",
            self._get_indicators(self._pointer, c_void_p(result), c_size_t(self._indicators.size)),
        )
        return self._answer(fine)

    def _place(self, time: float, states: c_void_p) -> bool:
        """Go to a time [s] with states at an address; whether the FMU does."""
        self._clock.value = time
        fine = self._fine(f"{self.prefix}SetTime", self._set_time(self._pointer, self._clock))
        if fine and self._motion is not None:
            motion, _, write = self._motion
            motion.go(time)
            fine = self._fine(self.functions["set"], write())
        if fine and self._count.value:
            status = self._set_states(self._pointer, states, self._count)
            return self._fine(f"{self.prefix}SetContinuousStates", status)
        return fine

    def _fine(self, function: str, status: int | None) -> bool:
        if status is None or status <= WARNING:
            return True
        self._refusal = function, status
        return False

    def _answer(self, fine: bool) -> int:
        """What the solver understands: a shorter step may do where the FMU discards this one."""
        return 0 if fine else 1 if self._refusal and self._refusal[1] == DISCARD else -1

    def _require(self, fine: bool) -> None:
        if not fine:
            function, status = self._refusal or ("", DISCARD)
            raise self._failure(function, status, self._when())

    # ---- events

    def _event(self) -> None:
        self._call(f"{self.prefix}EnterEventMode", about=self._when())
        self._iterate()

    def _iterate(self) -> None:
        """From event mode to continuous-time mode."""
        for _ in range(_MOST):
            again, ends, self._next_event = self._updated()
            if ends:
                raise self._ending()
            if not again:
                break
        else:
            raise RefusedError(f"{self.name}: its event iteration{self._when()} has no end")
        self._call(f"{self.prefix}EnterContinuousTimeMode")
        self._stale = True
        self._crossed()

    @abstractmethod
    def _updated(self) -> tuple[bool, bool, float]:
        """One round: whether another one is needed, whether to end the simulation, time of the next event [s]."""

    def _crossed(self) -> bool:
        """Whether an event indicator has another sign than when this was asked last."""
        if not self._indicators.size:
            return False
        before = self._indicators > 0
        there = c_void_p(self._indicators.ctypes.data), c_size_t(self._indicators.size)
        self._call(f"{self.prefix}GetEventIndicators", *there)
        return not np.array_equal(before, self._indicators > 0)

    def _ending(self) -> EndedError:
        return EndedError(f"{self.name} ends the simulation{self._when()}", self._clock.value)

    def _when(self) -> str:
        return f" at t = {self._clock.value:.10g} s"

    # ---- back

    def states(self) -> tuple[Call, Call]:
        """As :meth:`Instance.states`; the solver begins anew after both, so that a repeated step has the same bits."""
        self._final = self.flag(False)
        save, restore = super().states()
        kept: list[Any] = []

        def take() -> int:
            if self._initialized:
                kept[:] = self._clock.value, self._next_event, self._jumped, self._held.copy(), self._indicators.copy()
                self._stale = True
            return save()

        def go_back() -> int:
            if self._initialized and kept:
                self._clock.value, self._next_event, self._jumped, self._held[:], self._indicators[:] = kept
                self._stale, self._end_time = True, math.inf
            return restore()

        return Call(take).of("save", self.failure), Call(go_back).of("restore", self.failure)

    def _forget(self, library: CDLL) -> None:
        if self._solver is not None:
            self._solver.close()
        super()._forget(library)


@final
class _Discrete(Structure):
    """What an event iteration leads to: ``fmi2EventInfo``."""

    _fields_ = [(name, c_int) for name in ("again", "ends", "nominals", "states", "known")] + [("next_event", c_double)]


@final
class ModelExchange2(ModelExchange, Instance2):
    """An FMI 2.0 instance of Model Exchange."""

    kind = 0
    derivatives = "fmi2GetDerivatives"

    def _sizes(self) -> tuple[int, int]:
        return self._fmu.states, self._fmu.indicators

    def _updated(self) -> tuple[bool, bool, float]:
        found = _Discrete()
        self._call("fmi2NewDiscreteStates", byref(found), about=self._when())
        return bool(found.again), bool(found.ends), found.next_event if found.known else math.inf


@final
class ModelExchange3(ModelExchange, Instance3):
    """An FMI 3.0 instance of Model Exchange."""

    functions: ClassVar = {**Instance3.functions, "shape": "fmi3SetFloat64"}
    derivatives = "fmi3GetContinuousStateDerivatives"

    def _particulars(self) -> tuple[Sequence[object], Sequence[object]]:
        return (), ()

    def _sizes(self) -> tuple[int, int]:
        states, indicators = c_size_t(), c_size_t()
        self._call("fmi3GetNumberOfContinuousStates", byref(states))
        self._call("fmi3GetNumberOfEventIndicators", byref(indicators))
        return states.value, indicators.value

    def _updated(self) -> tuple[bool, bool, float]:
        again, ends, nominals, states, known = (c_bool() for _ in range(5))
        next_event = c_double()
        found = again, ends, nominals, states, known, next_event
        self._call("fmi3UpdateDiscreteStates", *map(byref, found), about=self._when())
        return again.value, ends.value, next_event.value if known.value else math.inf


def _cvode() -> type[Cvode]:
    """The solver, loaded where it is needed: FMPy does not ship it for every platform."""
    try:
        from liaisons.cosim.instances.cvode import Cvode
    except (ImportError, OSError) as error:
        raise SimulationError(
            f"Model Exchange needs CVODE, which FMPy does not have here ({error}); export the FMU for co-simulation"
        ) from error
    return Cvode
