"""Instances of Model Exchange FMUs, with a solver that integrates their states from event to event.

The solver is DOP853, whose steps can be repeated, or CVODE if the equations are stiff or there is no C compiler.
Within a step, inputs follow the derivatives that were set, else they are held.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Sequence
from ctypes import byref, c_bool, c_double, c_size_t, c_void_p
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, final

import numpy as np
from fmpy.fmi2 import fmi2EventInfo

from liaisons.cosim.arrays import Indices, Numbers, Vector, as_indices
from liaisons.cosim.compiled.calls import Call
from liaisons.cosim.description.fmu import Fmu
from liaisons.cosim.description.start_values import Starts
from liaisons.cosim.instances import dop853
from liaisons.cosim.instances.dop853 import Dop853, InputMotion
from liaisons.cosim.instances.fmi2 import Instance2
from liaisons.cosim.instances.fmi3 import Instance3
from liaisons.cosim.instances.loading import FMU2ModelExchange, FMU3ModelExchange
from liaisons.cosim.instances.protocol import Loaded, Scalars
from liaisons.cosim.messages import DISCARD, OK, SUCCESS, logger
from liaisons.errors import EndedError, RefusedError, SimulationError

if TYPE_CHECKING:
    from liaisons.cosim.instances.cvode import Cvode, Function

TOLERANCE = 1e-8
"""Relative tolerance, where neither the user nor the FMU has one."""
_ROUNDING = 1e-9
"""Relative difference of inputs, and part of a step beyond its end, that count as zero."""
_CHATTER_SPAN, _MOST_EVENTS = 1e-12, 1000
"""This part of a step; more than so many events within it count as chattering."""
_MOST_STEPS = 100_000
"""Limit of solver steps and events in a communication step, as in our own FMUs."""
_MOST_STATES = 10_000_000
"""Limit of states and of event indicators; more would not fit into memory."""
_DIFFERENCE_SPAN = 1e-3
"""Part of a step between the points of the difference formula of outputs; truncation and rounding are 1e-12."""
_FORWARD_DIFFERENCE = (4.0, -3.0, 4 / 3, -1 / 4)
"""Weights of outputs at the next four points for the rate now, beside -25/12 now: forward difference of order 4."""


class ModelExchange(Loaded, ABC):
    """An instance for Model Exchange, between steps in continuous-time mode.

    :param stiff: CVODE integrates from the start on.
    :cvar derivatives: name of the FMI function that evaluates the derivatives of states.
    """

    derivatives: ClassVar[str]

    def __init__(self, name: str, fmu: Fmu, directory: Path, *, stiff: bool = False) -> None:
        self._stiff = stiff
        self._solver: Cvode | Dop853 | None = None
        self._warned: set[str] = set()
        self._clock = c_double()
        self._final = self.flag(True)  # whether no earlier state is restored after a step
        self._input_indices: dict[str, int] = {}  # of inputs in:
        self._held_inputs = np.empty(0)
        self._motion: InputMotion | None = None
        super().__init__(name, fmu, directory)

    # ---- initialization

    def initialize(self, starts: Starts, tolerance: float | None, start_time: float, stop_time: float) -> None:
        self._tolerance = tolerance or self._fmu.experiment.tolerance or TOLERANCE
        self._clock.value, self._next_event, self._end_time = start_time, math.inf, math.inf
        self._jumped, self._motion, self._held_inputs[:] = False, None, np.nan
        span = stop_time - start_time if math.isfinite(stop_time) else 1.0
        self._size = self._fmu.experiment.step_size or span * _DIFFERENCE_SPAN
        super().initialize(starts, tolerance, start_time, stop_time)

    def exit_initialization(self) -> None:
        super().exit_initialization()
        if self._solver is None:
            states, indicators = self._sizes()
            for noun, number in (("states", states), ("event indicators", indicators)):
                if number not in range(_MOST_STATES):
                    raise SimulationError(f"{self.name}: says that it has {number} {noun}; ask its maker")
            self._nominals, self._indicators = np.ones(states), np.zeros(indicators)
            self._set_time, self._set_states, *_ = map(self._function, self._solver_functions)
            self._count = c_size_t(states)
            self._explicit = None if self._stiff else self._dop853()
        if self._solver is None or self._solver is not self._explicit:
            self._set_solver(self._explicit or self._cvode())
        self._iterate_events()

    @property
    def _solver_functions(self) -> tuple[str, str, str, str]:
        """Names of the FMI functions that a solver calls."""
        prefix = self.prefix
        return f"{prefix}SetTime", f"{prefix}SetContinuousStates", self.derivatives, f"{prefix}GetEventIndicators"

    def _dop853(self) -> Dop853 | None:
        code, functions = dop853.library(), [self._function(name) for name in self._solver_functions]
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
        rates, signs = map(self._callback, self._solver_functions[2:], sizes)
        return Cvode(*sizes, rates, signs, self._tolerance)

    def _set_solver(self, solver: Cvode | Dop853) -> None:
        """Replace the solver."""
        if self._solver is not None:
            self._solver.close()
        self._solver, self._stale = solver, True
        self._states_address = c_void_p(solver.states.ctypes.data)

    @abstractmethod
    def _sizes(self) -> tuple[int, int]:
        """Numbers of states and of event indicators."""

    # ---- inputs

    def setter(self, variables: Scalars, values: Numbers) -> Call:
        """As :meth:`Instance.setter`; discrete variables, and those set with them, are set in event mode."""
        write, numbers = super().setter(variables, values), np.asarray(values)
        places, continuous = self._index_inputs(variables), all(variable.continuous for variable in variables)

        def put() -> int | None:
            if not self._initialized:
                return write()
            held = self._held_inputs[places]
            same = bool((np.abs(numbers - held) <= _ROUNDING * np.maximum(np.abs(numbers), np.abs(held))).all())
            if continuous:
                self._jumped |= not same
            elif same:
                return 0
            else:
                self._call(f"{self.prefix}EnterEventMode")
            self._held_inputs[places] = numbers
            status = write()
            if not continuous:
                self._iterate_events()
            return status

        return Call(put).set_failure("set", write.failure)

    def _index_inputs(self, variables: Scalars) -> Indices:
        """Give inputs indices among the held ones; returns these."""
        places = [self._input_indices.setdefault(variable.name, len(self._input_indices)) for variable in variables]
        self._held_inputs = np.full(len(self._input_indices), np.nan)
        return as_indices(places)

    def input_derivatives(self, variables: Scalars, orders: Sequence[int], values: Numbers) -> Call:
        inputs = [variable for variable in dict.fromkeys(variables) if variable.continuous]  # discrete ones do not move
        moving = [k for k, variable in enumerate(variables) if variable.continuous]
        rows = [inputs.index(variables[k]) for k in moving]
        motion = InputMotion([orders[k] for k in moving], rows, (values, moving), self._index_inputs(inputs))
        motion.read, motion.write = self.getter(inputs, motion.values), super().setter(inputs, motion.values)
        return self.prepared("shape", setattr, self, "_motion", motion)

    def _begin_motion(self) -> None:
        if self._motion is not None:
            self._check(self.functions["get"], self._motion.read(), self._at())
            self._motion.begin(self._clock.value)

    def output_derivatives(
        self,
        variables: Scalars,
        orders: Sequence[int],  # noqa: ARG002 - all 1
        values: Numbers,
    ) -> Call:
        """As :meth:`Instance.output_derivatives`, of order 1; inputs follow the derivatives set since the last step."""
        read, result = self.getter(variables, values), np.asarray(values)

        def take() -> Vector:
            self._check(self.functions["get"], read(), self._at())
            return result

        def differentiate() -> int:
            begin, solver = self._clock.value, self._restart_if_stale()
            rates = np.zeros_like(solver.states)
            self._begin_motion()
            if rates.size:
                self._fill(rates, self.derivatives, self._at())
            apart = min(_DIFFERENCE_SPAN * self._size, (self._next_event - begin) / len(_FORWARD_DIFFERENCE))
            total = -sum(_FORWARD_DIFFERENCE) * take()
            for k, factor in enumerate(_FORWARD_DIFFERENCE, 1):
                self.set_time_and_states(begin + k * apart, solver.states + k * apart * rates)
                total += factor * take()
            self.set_time_and_states(begin, solver.states)
            self._motion = None
            result[:] = total / apart
            return 0

        return self.prepared("slope", differentiate)

    # ---- a step

    def stepper(self, time: c_double, size: c_double) -> Call:
        return self.prepared("step", self._advance, time, size)

    def _advance(self, time: c_double, size: c_double) -> int:
        try:
            self._step_to(time.value + size.value, size.value)
        except EndedError as ended:
            self._end_time = ended.time
            return DISCARD
        return 0

    def _requested_end(self) -> float | None:
        return None if math.isinf(self._end_time) else self._end_time

    def _step_to(self, end: float, size: float) -> None:
        """Integrate to the end of a communication step [s], through all events."""
        self._size = size
        self._begin_motion()
        if self._jumped:
            self._jumped, self._stale = False, True
            if self._update_indicators():
                self._handle_event()
        stuck = steps = 0
        while self._clock.value < end:
            begin, steps = self._clock.value, steps + 1
            if steps > _MOST_STEPS:
                words = f"more than {_MOST_STEPS} steps and events from t = {end - size:.10g} s{self._at(' to')}"
                raise RefusedError(f"{self.name}: {words}; choose a smaller step_size, or look what is not smooth")
            soon = self._next_event <= end + _ROUNDING * size
            happened = self._integrate(self._next_event if soon else end)
            if happened or self._clock.value >= self._next_event:
                self._handle_event()
            stuck = 0 if self._clock.value > begin + _CHATTER_SPAN * size else stuck + 1
            if stuck > _MOST_EVENTS:
                raise RefusedError(f"{self.name}: more than {_MOST_EVENTS} events or steps{self._at()}; it may chatter")
        if self._motion is not None:
            self._held_inputs[self._motion.places] = self._motion.values
            self._motion = None
        if self._input_indices:
            self._update_indicators()

    def _integrate(self, stop: float) -> bool:
        """Make a step of the solver, at most to a time [s]; returns whether an event follows."""
        begin, time, event = self._clock.value, stop, False
        self._refusal = "", OK
        if (self._count.value or self._indicators.size) and stop - begin > 4 * np.spacing(max(abs(begin), abs(stop))):
            solver = self._restart_if_stale()
            if isinstance(solver, Dop853):
                solver.follow(self._motion)
            try:
                time, event = solver.step(stop)
            except RefusedError as error:
                if not isinstance(solver, Dop853):
                    self._check(*self._refusal, self._at())
                    raise RefusedError(f"{self.name}: cannot be integrated from t = {begin:.10g} s: {error}") from None
                self._check_last_call(solver)
                self._check_rates(solver.states)
                self._change_solver()
                return False
        self._check(*self._try_time_and_states(time, self._states_address), self._at())
        if isinstance(self._solver, Dop853) and self._solver.stiff:
            self._change_solver()
        return self._complete_step() or event

    def _check_rates(self, states: Vector) -> None:
        """Raise the error of derivatives that are not finite, where no step is small enough and right after it."""
        begin, rates = self._clock.value, np.zeros_like(states)
        for later in (0.0, _CHATTER_SPAN * self._size, 4 * float(np.spacing(abs(begin)))):
            trial = states + later * rates
            self.set_time_and_states(begin + later, trial)
            self._fill(rates, self.derivatives, self._at())
            if not np.isfinite(rates).all():
                k = int(np.argmin(np.isfinite(rates)))
                words = f"the derivative of continuous state {k + 1} is {rates[k]:g}{self._at()}, where that is"
                raise RefusedError(f"{self.name}: {words} {trial[k]:.10g}; choose other start values, or ask its maker")
        self.set_time_and_states(begin, states)

    def _check_last_call(self, solver: Dop853) -> None:
        """Raise the error of the call of the FMU that has ended a step of the solver, if one has."""
        which, status = solver.refusal
        if which:
            time, *others = self._solver_functions
            self._clock.value = solver.last_time
            self._check((time, self.functions["set"], *others)[which - 1], status, self._at())

    def _restart_if_stale(self) -> Cvode | Dop853:
        """Restart the solver if the states may have changed; returns it."""
        solver = self._solver
        assert solver is not None
        if self._stale:
            if self._count.value:
                self._fill(solver.states, f"{self.prefix}GetContinuousStates")
                self._fill(self._nominals, f"{self.prefix}GetNominalsOfContinuousStates")
            solver.restart(self._clock.value, self._nominal_values())
            self._stale = False
        return solver

    def _nominal_values(self) -> Vector:
        """Nominal values of states; 1 instead of one that is not positive and finite."""
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
        """Replace DOP853 by CVODE, since the equations are stiff."""
        self._set_solver(self._cvode())
        logger.info("%s: its equations are stiff%s: CVODE integrates them", self.name, self._at())

    def _complete_step(self) -> bool:
        """Call completedIntegratorStep, if needed; returns whether the FMU requests an event."""
        if not self._fmu.completes:
            return False
        event, ends = self.flag(), self.flag()
        name = f"{self.prefix}CompletedIntegratorStep"
        self._check(name, self._function(name)(self._pointer, self._final, byref(event), byref(ends)), self._at())
        if ends.value:
            raise self._end_error()
        return bool(event.value)

    # ---- its equations

    @property
    def continuous_states(self) -> tuple[Vector, Vector]:
        """The continuous states, and the nominal values that scale their errors."""
        return self._restart_if_stale().states.copy(), self._nominal_values()

    @property
    def has_events(self) -> bool:
        """Whether it has event indicators or a next time event."""
        return bool(self._indicators.size) or math.isfinite(self._next_event)

    def set_time_and_states(self, time: float, states: Vector) -> None:
        """Set a time [s] and continuous states, without an event.

        :raises RefusedError: if the FMU discards them.
        """
        states = np.ascontiguousarray(states)
        self._check(*self._try_time_and_states(time, c_void_p(states.ctypes.data)), self._at())

    # ---- functions for the solver

    def _callback(self, name: str, size: int) -> Function:
        """An FMI function as CVODE calls it."""
        function, count = self._function(name), c_size_t(size)

        def answer(time: float, states: int, result: int) -> int:
            last = self._try_time_and_states(time, c_void_p(states))
            if last[1] in SUCCESS:
                last = name, function(self._pointer, c_void_p(result), count)
            if last[1] in SUCCESS:
                return 0
            self._refusal = last
            return 1 if last[1] == DISCARD else -1  # a shorter step may do where the FMU discards this one

        return answer

    def _try_time_and_states(self, time: float, states: c_void_p) -> tuple[str, int]:
        """Set a time [s], inputs, and the states at an address.

        :returns: name and status of the last function of FMI that was called: the one that was refused, if one was.
        """
        self._clock.value = time
        last = f"{self.prefix}SetTime", self._set_time(self._pointer, self._clock)
        if last[1] in SUCCESS and self._motion is not None:
            self._motion.evaluate(time)
            last = self.functions["set"], self._motion.write()
        if last[1] in SUCCESS and self._count.value:
            last = f"{self.prefix}SetContinuousStates", self._set_states(self._pointer, states, self._count)
        return last

    # ---- events

    def _handle_event(self) -> None:
        self._call(f"{self.prefix}EnterEventMode", about=self._at())
        self._iterate_events()

    def _iterate_events(self) -> None:
        """Iterate in event mode, then enter continuous-time mode."""
        for _ in range(_MOST_EVENTS):
            again, ends, self._next_event = self._update_discrete_states()
            if ends:
                raise self._end_error()
            if not again:
                break
        else:
            raise RefusedError(f"{self.name}: its event iteration{self._at()} has no end")
        now = self._clock.value  # time does not go back: a next event that is earlier by rounding only is now
        if not self._next_event >= now - _ROUNDING * max(self._size, abs(now)):
            raise SimulationError(
                f"{self.name}: its next event{self._at()} is to be at {self._next_event:.10g} s, which is not later; "
                "ask its maker"
            )
        self._next_event = max(self._next_event, now)
        self._call(f"{self.prefix}EnterContinuousTimeMode")
        self._stale = True
        self._update_indicators()

    @abstractmethod
    def _update_discrete_states(self) -> tuple[bool, bool, float]:
        """Update discrete states once; returns whether to repeat, whether to end, and the next event time [s]."""

    def _update_indicators(self) -> bool:
        """Read the event indicators; returns whether one has changed its sign since they were last read."""
        if not self._indicators.size:
            return False
        before = self._indicators > 0
        self._fill(self._indicators, f"{self.prefix}GetEventIndicators")
        if np.isnan(self._indicators).any():
            self._warn("an event indicator is nan%s, so that events may be missed", self._at())
        return not np.array_equal(before, self._indicators > 0)

    def _fill(self, numbers: Vector, function: str, about: str = "") -> None:
        """Call a function of FMI that fills an array with numbers of the equations; raise the error of its status."""
        status = self._function(function)(self._pointer, c_void_p(numbers.ctypes.data), c_size_t(numbers.size))
        self._check(function, status, about)

    def _end_error(self) -> EndedError:
        """The error that ends the simulation at the present time."""
        return EndedError(f"{self.name} ends the simulation{self._at()}", self._clock.value)

    def _at(self, word: str = " at") -> str:
        """The present time, for a message."""
        return f"{word} t = {self._clock.value:.10g} s"

    # ---- back

    def save_and_restore_calls(self) -> tuple[Call, Call]:
        """As :meth:`Instance.states`; CVODE, whose state cannot be saved, restarts after both."""
        self._final = self.flag(False)
        save, restore = super().save_and_restore_calls()
        saved: list[Any] = []

        def take() -> int:
            if self._initialized:
                solver = self._solver
                memory = solver.save() if isinstance(solver, Dop853) and not self._stale else None
                arrays = self._held_inputs.copy(), self._indicators.copy()
                saved[:] = solver, memory, self._clock.value, self._next_event, self._jumped, *arrays
                self._stale = memory is None
            return save()

        def go_back() -> int:
            if self._initialized and saved:
                solver, memory, self._clock.value, self._next_event, self._jumped, *arrays = saved
                self._held_inputs[:], self._indicators[:] = arrays
                self._end_time, self._motion = math.inf, None
                self._stale = memory is None or self._solver is not solver
                if not self._stale:
                    solver.restore(memory)
                elif not isinstance(self._solver, Dop853):
                    words = "CVODE, which cannot go back, integrates its equations: steps that are repeated, first from"
                    more = "%s, restart and are less accurate; smaller ones and a smaller tolerance may be needed"
                    self._warn(words + more, self._at(""))
            return restore()

        return self.prepared("save", take), self.prepared("restore", go_back)

    def _close_own(self) -> None:
        if self._solver is not None:
            self._solver.close()
        super()._close_own()


@final
class ModelExchange2(ModelExchange, Instance2):
    """An FMI 2.0 instance of Model Exchange."""

    fmpy_class = FMU2ModelExchange
    derivatives = "fmi2GetDerivatives"

    def _sizes(self) -> tuple[int, int]:
        return self._fmu.states, self._fmu.indicators

    def _update_discrete_states(self) -> tuple[bool, bool, float]:
        info = fmi2EventInfo()
        self._call("fmi2NewDiscreteStates", byref(info), about=self._at())
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

    def _update_discrete_states(self) -> tuple[bool, bool, float]:
        flags, next_event = [c_bool() for _ in range(5)], c_double()
        self._call("fmi3UpdateDiscreteStates", *map(byref, (*flags, next_event)), about=self._at())
        again, ends, _nominals, _states, defined = (flag.value for flag in flags)
        return again, ends, next_event.value if defined else math.inf
