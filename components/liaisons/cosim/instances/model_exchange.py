"""Running FMUs of Model Exchange, whose states are integrated here from event to event.

DOP853, whose steps can be repeated, integrates them; CVODE, if they are stiff or there is no C compiler.  Inputs follow
their derivatives within a step, if these are set, else they are held.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from ctypes import byref, c_bool, c_double, c_size_t, c_void_p
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, final

import numpy as np
from fmpy.fmi2 import fmi2EventInfo
from numpy.typing import NDArray

from liaisons.cosim.compiled.calls import Call
from liaisons.cosim.description.fmu import Fmu
from liaisons.cosim.description.start_values import Value
from liaisons.cosim.instances import dop853
from liaisons.cosim.instances.dop853 import Dop853
from liaisons.cosim.instances.fmi2 import Instance2
from liaisons.cosim.instances.fmi3 import Instance3
from liaisons.cosim.instances.loading import FMU2ModelExchange, FMU3ModelExchange
from liaisons.cosim.instances.motion import InputMotion
from liaisons.cosim.instances.protocol import Loaded, Numbers, Scalars
from liaisons.cosim.messages import DISCARD, OK, WARNING, logger
from liaisons.errors import EndedError, RefusedError, SimulationError

if TYPE_CHECKING:
    from liaisons.cosim.instances.cvode import Cvode, Function

TOLERANCE = 1e-8
"""Relative, where neither the user nor the FMU says more."""
_ROUNDING = 1e-9
"""Relative difference of inputs, and part of a step behind its end, that is none."""
_STUCK, _MOST = 1e-12, 1000
"""So many events within this part of a step have no end."""
_MOST_STEPS = 100_000
"""Steps of the solver, and events, in a step; as many as FMUs of ours take."""
_MOST_NUMBERS = 10_000_000
"""States, or event indicators; more would not fit into memory."""
_NEAR = 1e-3
"""Part of a step between the instants at which outputs are taken for their rates: truncation and rounding are 1e-12."""
_FORWARD = (4.0, -3.0, 4 / 3, -1 / 4)
"""Of the outputs at these four instants, for the rate at the first one; with -25/12 of those now, of order 4."""


class ModelExchange(Loaded, ABC):
    """An instance of Model Exchange: between steps in continuous-time mode, where its outputs are those of the time.

    :param stiff: CVODE integrates from the start on.
    :cvar derivatives: the function that calculates them.
    """

    derivatives: ClassVar[str]

    def __init__(self, name: str, fmu: Fmu, directory: Path, *, stiff: bool = False) -> None:
        self._stiff = stiff
        self._solver: Cvode | Dop853 | None = None
        self._warned: set[str] = set()
        self._clock = c_double()
        self._final = self.flag(True)  # no state from before a step will be set after it
        self._places: dict[str, int] = {}  # of inputs in:
        self._held = np.empty(0)
        self._motion: InputMotion | None = None
        super().__init__(name, fmu, directory)

    # ---- initialization

    def initialize(
        self, starts: Mapping[str, Value], tolerance: float | None, start_time: float, stop_time: float
    ) -> None:
        self._tolerance = tolerance or self._fmu.experiment.tolerance or TOLERANCE
        self._clock.value, self._next_event, self._end_time = start_time, math.inf, math.inf
        self._jumped, self._motion, self._held[:] = False, None, np.nan
        self._size = self._fmu.experiment.step_size or (stop_time - start_time) * _NEAR
        super().initialize(starts, tolerance, start_time, stop_time)

    def exit_initialization(self) -> None:
        super().exit_initialization()
        if self._solver is None:
            states, indicators = self._sizes()
            for noun, number in (("states", states), ("event indicators", indicators)):
                if number not in range(_MOST_NUMBERS):
                    raise SimulationError(f"{self.name}: says that it has {number} {noun}; ask its maker")
            self._nominals, self._indicators = np.ones(states), np.zeros(indicators)
            self._set_time, self._set_states, *_ = map(self._function, self._asked)
            self._count = c_size_t(states)
            self._explicit = None if self._stiff else self._dop853()
        if self._solver is None or self._solver is not self._explicit:
            self._use(self._explicit or self._cvode())
        self._iterate()

    @property
    def _asked(self) -> tuple[str, str, str, str]:
        """The functions of FMI that a solver needs."""
        prefix = self.prefix
        return f"{prefix}SetTime", f"{prefix}SetContinuousStates", self.derivatives, f"{prefix}GetEventIndicators"

    def _dop853(self) -> Dop853 | None:
        code, functions = dop853.library(), [self._function(name) for name in self._asked]
        size, signs = self._count.value, self._indicators
        return code and Dop853(code, self._pointer, functions, size, signs, self._tolerance)

    def _cvode(self) -> Cvode:
        try:
            from liaisons.cosim.instances.cvode import Cvode  # FMPy does not ship it for every platform
        except (ImportError, OSError) as error:
            raise SimulationError(
                "Model Exchange needs a C compiler, or CVODE, which FMPy does not have here, where equations are stiff "
                f"({error}); export the FMU for co-simulation"
            ) from error
        sizes = self._count.value, self._indicators.size
        rates, signs = map(self._answering, self._asked[2:], sizes)
        return Cvode(*sizes, rates, signs, self._tolerance)

    def _use(self, solver: Cvode | Dop853) -> None:
        """Integrate by this solver from now on."""
        if self._solver is not None:
            self._solver.close()
        self._solver, self._stale = solver, True
        self._states_address = c_void_p(solver.states.ctypes.data)

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

        return Call(put).with_failure("set", write.failure or self.failure)

    def _placed(self, variables: Scalars) -> NDArray[np.intp]:
        """Indices of inputs among those that are held."""
        places = [self._places.setdefault(variable.name, len(self._places)) for variable in variables]
        self._held = np.full(len(self._places), np.nan)
        return np.array(places, dtype=np.intp)

    def input_derivatives(self, variables: Scalars, orders: Sequence[int], values: Numbers) -> Call:
        inputs = [variable for variable in dict.fromkeys(variables) if variable.continuous]  # others do not move
        moving = [k for k, variable in enumerate(variables) if variable.continuous]
        rows = [inputs.index(variables[k]) for k in moving]
        motion = InputMotion([orders[k] for k in moving], rows, (values, moving), self._placed(inputs))
        motion.read, motion.write = self.getter(inputs, motion.buffer), super().setter(inputs, motion.buffer)
        return Call(setattr, self, "_motion", motion).with_failure("shape", self.failure)

    def _begin_motion(self) -> None:
        if self._motion is not None:
            self._require(self._fine(self.functions["get"], self._motion.read()))
            self._motion.begin(self._clock.value)

    def output_derivatives(
        self,
        variables: Scalars,
        orders: Sequence[int],  # noqa: ARG002 - all 1
        values: Numbers,
    ) -> Call:
        """As :meth:`Instance.output_derivatives`, of order 1; inputs move as was told since the last step."""
        read, result = self.getter(variables, values), np.ctypeslib.as_array(values)

        def take() -> NDArray[np.float64]:
            self._require(self._fine(self.functions["get"], read()))
            return result

        def differentiate() -> int:
            begin, solver = self._clock.value, self._begun()
            rates = np.zeros_like(solver.states)
            self._begin_motion()
            if rates.size:
                self._fill(rates, self.derivatives, self._when())
            apart = min(_NEAR * self._size, (self._next_event - begin) / len(_FORWARD))
            total = -sum(_FORWARD) * take()
            for k, factor in enumerate(_FORWARD, 1):
                states = solver.states + k * apart * rates
                self._require(self._place(begin + k * apart, c_void_p(states.ctypes.data)))
                total += factor * take()
            self._require(self._place(begin, self._states_address))
            self._motion = None
            result[:] = total / apart
            return 0

        return Call(differentiate).with_failure("slope", self.failure)

    # ---- a step

    def stepper(self, time: c_double, size: c_double) -> Call:
        return Call(self._advance, time, size).with_failure("step", self.failure)

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
        self._size = size
        self._begin_motion()
        if self._jumped:
            self._jumped, self._stale = False, True
            if self._crossed():
                self._event()
        stuck = steps = 0
        while self._clock.value < end:
            begin, steps = self._clock.value, steps + 1
            if steps > _MOST_STEPS:
                words = f"more than {_MOST_STEPS} steps and events from t = {end - size:.10g} s{self._when(' to')}"
                raise RefusedError(f"{self.name}: {words}; choose a smaller step_size, or look what is not smooth")
            soon = self._next_event <= end + _ROUNDING * size
            happened = self._integrate(self._next_event if soon else end)
            if happened or self._clock.value >= self._next_event:
                self._event()
            stuck = 0 if self._clock.value > begin + _STUCK * size else stuck + 1
            if stuck > _MOST:
                raise RefusedError(f"{self.name}: more than {_MOST} events or steps{self._when()}; it may chatter")
        if self._motion is not None:
            self._held[self._motion.places] = self._motion.values
            self._motion = None
        if self._places:
            self._crossed()

    def _integrate(self, stop: float) -> bool:
        """Take a step of the solver, not beyond a time [s]; whether there is an event then."""
        begin, time, event = self._clock.value, stop, False
        self._refusal: tuple[str, int] | None = None
        if (self._count.value or self._indicators.size) and stop - begin > 4 * np.spacing(max(abs(begin), abs(stop))):
            solver = self._begun()
            if isinstance(solver, Dop853):
                solver.follow(self._motion)
            try:
                time, event = solver.step(stop)
            except RefusedError as error:
                self._require(self._refusal is None)
                if not isinstance(solver, Dop853):
                    raise RefusedError(f"{self.name}: cannot be integrated from t = {begin:.10g} s: {error}") from None
                self._require(self._accepted(solver))
                self._check_rates(solver.states)
                self._change_solver()
                return False
        self._require(self._place(time, self._states_address))
        if isinstance(self._solver, Dop853) and self._solver.stiff:
            self._change_solver()
        return self._completed() or event

    def _check_rates(self, states: NDArray[np.float64]) -> None:
        """Whether the derivatives are finite where no step is small enough, and right after it."""
        begin, rates = self._clock.value, np.zeros_like(states)
        for later in (0.0, _STUCK * self._size, 4 * float(np.spacing(abs(begin)))):
            trial = states + later * rates
            self._require(self._place(begin + later, c_void_p(trial.ctypes.data)))
            self._fill(rates, self.derivatives, self._when())
            if not np.isfinite(rates).all():
                k = int(np.argmin(np.isfinite(rates)))
                words = f"the derivative of continuous state {k + 1} is {rates[k]:g}{self._when()}, where that is"
                raise RefusedError(f"{self.name}: {words} {trial[k]:.10g}; choose other start values, or ask its maker")
        self._require(self._place(begin, self._states_address))

    def _accepted(self, solver: Dop853) -> bool:
        """Whether the FMU has refused nothing that it was asked in the last step."""
        which, status = solver.refusal
        if not which:
            return True
        time, *others = self._asked
        self._refusal = (time, self.functions["set"], *others)[which - 1], status
        self._clock.value = solver.asked
        return False

    def _begun(self) -> Cvode | Dop853:
        """The solver, restarted if the states may have changed."""
        solver = self._solver
        assert solver is not None
        if self._stale:
            if self._count.value:
                self._fill(solver.states, f"{self.prefix}GetContinuousStates")
                self._fill(self._nominals, f"{self.prefix}GetNominalsOfContinuousStates")
            solver.restart(self._clock.value, self._sizes_of_states())
            self._stale = False
        return solver

    def _sizes_of_states(self) -> NDArray[np.float64]:
        """The nominal values; 1 for one that is none."""
        fine = (self._nominals > 0) & np.isfinite(self._nominals)
        if not fine.all():
            words = "nominal values of continuous states are not above 0, such as %.10g; they are taken for 1"
            self._warn(words, self._nominals[~fine][0])
        return np.where(fine, self._nominals, 1.0)

    def _warn(self, words: str, about: object) -> None:
        """Log a warning, once."""
        if words not in self._warned:
            self._warned.add(words)
            logger.warning("%s: %s", self.name, words % about)

    def _change_solver(self) -> None:
        """Have CVODE integrate from here on: the equations are stiff."""
        self._use(self._cvode())
        logger.info("%s: its equations are stiff%s: CVODE integrates them", self.name, self._when())

    def _completed(self) -> bool:
        """Tell that a step of the solver is complete; whether the FMU wants an event."""
        if not self._fmu.completes:
            return False
        event, ends = self.flag(), self.flag()
        name = f"{self.prefix}CompletedIntegratorStep"
        self._check(name, self._function(name)(self._pointer, self._final, byref(event), byref(ends)), self._when())
        if ends.value:
            raise self._ending()
        return bool(event.value)

    # ---- its equations

    @property
    def continuous_states(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """The continuous states, and the sizes by which their errors are scaled."""
        return self._begun().states.copy(), self._sizes_of_states()

    @property
    def has_events(self) -> bool:
        """Whether it has event indicators or a next time event."""
        return bool(self._indicators.size) or math.isfinite(self._next_event)

    def go_to(self, time: float, states: NDArray[np.float64]) -> None:
        """Go to a time [s] and continuous states, without an event.

        :raises RefusedError: if the FMU discards them.
        """
        states = np.ascontiguousarray(states)
        self._require(self._place(time, c_void_p(states.ctypes.data)))

    # ---- what the solver asks for

    def _answering(self, name: str, size: int) -> Function:
        """For CVODE: what a function of FMI calculates."""
        function, count = self._function(name), c_size_t(size)

        def answer(time: float, states: int, result: int) -> int:
            fine = self._place(time, c_void_p(states)) and self._fine(
                name, function(self._pointer, c_void_p(result), count)
            )  # a shorter step may do where the FMU discards this one
            return 0 if fine else 1 if self._refusal and self._refusal[1] == DISCARD else -1

        return answer

    def _place(self, time: float, states: c_void_p) -> bool:
        """Go to a time [s] with states at an address; whether the FMU does."""
        self._clock.value = time
        fine = self._fine(f"{self.prefix}SetTime", self._set_time(self._pointer, self._clock))
        if fine and self._motion is not None:
            self._motion.evaluate(time)
            fine = self._fine(self.functions["set"], self._motion.write())
        if fine and self._count.value:
            status = self._set_states(self._pointer, states, self._count)
            return self._fine(f"{self.prefix}SetContinuousStates", status)
        return fine

    def _fine(self, function: str, status: int | None) -> bool:
        if status is None or status in {OK, WARNING}:
            return True
        self._refusal = function, status
        return False

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
        now = self._clock.value  # time does not go back: a next event that is earlier by rounding only is now
        if not self._next_event >= now - _ROUNDING * max(self._size, abs(now)):
            raise SimulationError(
                f"{self.name}: its next event{self._when()} is to be at {self._next_event:.10g} s, which is not later; "
                "ask its maker"
            )
        self._next_event = max(self._next_event, now)
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
        self._fill(self._indicators, f"{self.prefix}GetEventIndicators")
        if np.isnan(self._indicators).any():
            self._warn("an event indicator is nan%s, so that events may be missed", self._when())
        return not np.array_equal(before, self._indicators > 0)

    def _fill(self, numbers: NDArray[np.float64], function: str, about: str = "") -> None:
        """Have a function of FMI write numbers of the equations."""
        status = self._function(function)(self._pointer, c_void_p(numbers.ctypes.data), c_size_t(numbers.size))
        self._check(function, status, about)

    def _ending(self) -> EndedError:
        return EndedError(f"{self.name} ends the simulation{self._when()}", self._clock.value)

    def _when(self, word: str = " at") -> str:
        return f"{word} t = {self._clock.value:.10g} s"

    # ---- back

    def states(self) -> tuple[Call, Call]:
        """As :meth:`Instance.states`; CVODE, whose state cannot be saved, restarts after both."""
        self._final = self.flag(False)
        save, restore = super().states()
        saved: list[Any] = []
        memory: list[Any] = []

        def take() -> int:
            if self._initialized:
                saved[:] = self._clock.value, self._next_event, self._jumped, self._held.copy(), self._indicators.copy()
                solver = self._solver
                memory[:] = [] if self._stale or not isinstance(solver, Dop853) else [solver, solver.memory()]
                self._stale = not memory
            return save()

        def go_back() -> int:
            if self._initialized and saved:
                self._clock.value, self._next_event, self._jumped, self._held[:], self._indicators[:] = saved
                self._end_time, self._motion = math.inf, None
                self._stale = not memory or self._solver is not memory[0]
                if not self._stale:
                    memory[0].remember(memory[1])
                elif not isinstance(self._solver, Dop853):
                    words = "CVODE, which cannot go back, integrates its equations: steps that are repeated, first from"
                    more = "%s, restart and are less accurate; smaller ones and a smaller tolerance may be needed"
                    self._warn(words + more, self._when(""))
            return restore()

        return Call(take).with_failure("save", self.failure), Call(go_back).with_failure("restore", self.failure)

    def _forget(self) -> None:
        if self._solver is not None:
            self._solver.close()
        super()._forget()


@final
class ModelExchange2(ModelExchange, Instance2):
    """An FMI 2.0 instance of Model Exchange."""

    fmpy_class = FMU2ModelExchange
    derivatives = "fmi2GetDerivatives"

    def _sizes(self) -> tuple[int, int]:
        return self._fmu.states, self._fmu.indicators

    def _updated(self) -> tuple[bool, bool, float]:
        info = fmi2EventInfo()
        self._call("fmi2NewDiscreteStates", byref(info), about=self._when())
        next_event = info.nextEventTime if info.nextEventTimeDefined else math.inf
        return bool(info.newDiscreteStatesNeeded), bool(info.terminateSimulation), next_event


@final
class ModelExchange3(ModelExchange, Instance3):
    """An FMI 3.0 instance of Model Exchange."""

    fmpy_class = FMU3ModelExchange
    derivatives = "fmi3GetContinuousStateDerivatives"

    def _sizes(self) -> tuple[int, int]:
        states, indicators = c_size_t(), c_size_t()
        self._call("fmi3GetNumberOfContinuousStates", byref(states))
        self._call("fmi3GetNumberOfEventIndicators", byref(indicators))
        return states.value, indicators.value

    def _updated(self) -> tuple[bool, bool, float]:
        flags, next_event = [c_bool() for _ in range(5)], c_double()
        self._call("fmi3UpdateDiscreteStates", *map(byref, (*flags, next_event)), about=self._when())
        again, ends, _nominals, _states, defined = (flag.value for flag in flags)
        return again, ends, next_event.value if defined else math.inf
