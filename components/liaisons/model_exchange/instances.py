"""Instances of Model Exchange FMUs, whose states a solver integrates from event to event.

The solver is DOP853, whose steps can be repeated, or CVODE if the equations are stiff or there is no C compiler.
Within a step, inputs follow the derivatives that were set, else they are held.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from ctypes import byref, c_bool, c_double, c_size_t, c_void_p
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, NamedTuple, final

import numpy as np
from fmpy.fmi2 import FMU2Model, fmi2EventInfo
from fmpy.fmi3 import FMU3Model
from numpy.typing import NDArray

from liaisons.base.arrays import Floats
from liaisons.base.logs import logger
from liaisons.cosim import (
    DISCARD,
    SUCCESS,
    Call,
    Fmu,
    Instance2,
    Instance3,
    Loaded,
    Numbers,
    Scalars,
    SharedFunctions,
)
from liaisons.errors import EndedError, RefusedError, SimulationError
from liaisons.model_exchange import dop853
from liaisons.model_exchange.dop853 import Dop853, InputMotion

if TYPE_CHECKING:
    from liaisons.model_exchange.cvode import Cvode, Function

TOLERANCE = 1e-8
"""Relative tolerance, if neither the user nor the FMU gives one."""
_ROUNDING = 1e-9
"""Relative difference of inputs, and part of a step beyond its end, that count as zero."""
_CHATTER_SPAN = 1e-12
"""Part of a step in which the events of an FMU that chatters follow one another."""
_MOST_EVENTS = 1000
"""Number of events within that part above which the FMU chatters."""
_AHEAD = 1e-6, 1e-3, 1.0
"""Parts of what is left of a step, at whose ends an FMU is asked why the solver comes no further."""
_MOST_STEPS = 100_000
"""Limit of solver steps and events in a communication step, as in our own FMUs."""
_MOST_STATES = 10_000_000
"""Largest number of states and of event indicators; more would not fit into memory."""
_DIFFERENCE_SPAN = 1e-3
"""Part of a step between the points of the difference formula of outputs; truncation and rounding are 1e-12."""
_FORWARD_DIFFERENCE = (4.0, -3.0, 4 / 3, -1 / 4)
"""Weights of outputs at the next four points for the rate now, beside -25/12 now: forward difference of order 4."""


# the first four characters of a name tell FMPy the version


@final
class FMU2ModelExchange(SharedFunctions, FMU2Model):
    """A Model Exchange FMU of FMI 2.0."""


@final
class FMU3ModelExchange(SharedFunctions, FMU3Model):
    """A Model Exchange FMU of FMI 3.0."""


class DiscreteStatesUpdate(NamedTuple):
    """Result of an update of discrete states: whether to repeat it, whether to end, and the next event [s]."""

    is_needed_again: bool
    ends_simulation: bool
    next_event: float


class ModelExchange(Loaded, ABC):
    """An instance for Model Exchange, between steps in continuous-time mode.

    :cvar derivatives_function: name of the FMI function that gets the derivatives of the states.
    """

    derivatives_function: ClassVar[str]

    def __init__(self, name: str, fmu: Fmu, directory: Path) -> None:
        self._solver: Cvode | Dop853 | None = None
        self._warned: set[str] = set()
        self._clock = c_double()
        self._final = self.flag(True)  # whether no earlier state is restored after a step
        self._input_indices: dict[str, int] = {}  # by name, in:
        self._held_inputs = np.empty(0)
        self._motion: InputMotion | None = None
        super().__init__(name, fmu, directory)

    # ---- initialization

    def initialize(
        self, starts: Mapping[str, Any], tolerance: float | None, start_time: float, stop_time: float
    ) -> None:
        self._tolerance = tolerance or self._fmu.experiment.tolerance or TOLERANCE
        self._clock.value, self._next_event, self._end_time = start_time, math.inf, math.inf
        self._jumped, self._motion, self._held_inputs[:] = False, None, np.nan
        span = stop_time - start_time if math.isfinite(stop_time) else 1.0
        self._size = self._fmu.experiment.step_size or span * _DIFFERENCE_SPAN
        super().initialize(starts, tolerance, start_time, stop_time)

    def exit_initialization(self) -> None:
        super().exit_initialization()
        if self._solver is None:
            states, indicators = self._count_states_and_indicators()
            for noun, number in (("states", states), ("event indicators", indicators)):
                if number not in range(_MOST_STATES):
                    raise SimulationError(f"{self.name}: says that it has {number} {noun}; ask its maker")
            self._nominals, self._indicators = np.ones(states), np.zeros(indicators)
            functions = [self._function(name) for name in self._solver_functions]
            self._set_time, self._set_states, *_ = functions
            self._count = c_size_t(states)
            code = dop853.library()
            self._explicit = code and Dop853(code, self._pointer, functions, states, self._indicators, self._tolerance)
        if self._solver is None or self._solver is not self._explicit:
            self._set_solver(self._explicit or self._make_cvode())
        self._iterate_events()

    @property
    def _solver_functions(self) -> tuple[str, str, str, str]:
        """Names of the FMI functions that a solver calls: for time, states, derivatives and event indicators."""
        prefix = self.prefix
        return (
            f"{prefix}SetTime",
            f"{prefix}SetContinuousStates",
            self.derivatives_function,
            f"{prefix}GetEventIndicators",
        )

    def _make_cvode(self) -> Cvode:
        """The implicit solver.

        :raises SimulationError: if FMPy has none for this platform.
        """
        try:
            from liaisons.model_exchange.cvode import Cvode  # FMPy does not ship it for every platform
        except (ImportError, OSError) as error:
            raise SimulationError(
                "Model Exchange needs a C compiler, or CVODE, which FMPy does not have here, where equations are stiff "
                f"({error}); export the FMU for co-simulation"
            ) from error
        sizes = self._count.value, self._indicators.size
        rates, signs = map(self._cvode_callback, self._solver_functions[2:], sizes)
        return Cvode(*sizes, rates, signs, self._tolerance)

    def _set_solver(self, solver: Cvode | Dop853) -> None:
        """Set the solver, and release the one before."""
        if self._solver is not None:
            self._solver.close()
        self._solver, self._stale = solver, True
        self._states_address = c_void_p(solver.states.ctypes.data)

    @abstractmethod
    def _count_states_and_indicators(self) -> tuple[int, int]:
        """Number of continuous states, and number of event indicators."""

    # ---- inputs

    def setter(self, variables: Scalars, values: Numbers) -> Call:
        """As :meth:`Instance.setter`; a call with a discrete variable is made in event mode."""
        write, numbers = super().setter(variables, values), np.asarray(values)
        held, continuous = self._add_held_inputs(variables), all(variable.continuous for variable in variables)

        def write_changes() -> int | None:
            if not self._initialized:
                return write()
            before = self._held_inputs[held]
            same = bool((np.abs(numbers - before) <= _ROUNDING * np.maximum(np.abs(numbers), np.abs(before))).all())
            if continuous:
                self._jumped |= not same
            elif same:
                return 0
            else:
                self._call(f"{self.prefix}EnterEventMode")
            self._held_inputs[held] = numbers
            status = write()
            if not continuous:
                self._iterate_events()
            return status

        return Call(write_changes).set_failure("set", write.failure)

    def _add_held_inputs(self, variables: Scalars) -> NDArray[np.intp]:
        """Add variables to the held inputs, whose values are then unknown; returns their indices there."""
        indices = [self._input_indices.setdefault(variable.name, len(self._input_indices)) for variable in variables]
        self._held_inputs = np.full(len(self._input_indices), np.nan)
        return np.array(indices, dtype=np.intp)

    def input_derivatives(self, variables: Scalars, orders: Sequence[int], values: Numbers) -> Call:
        inputs = [variable for variable in dict.fromkeys(variables) if variable.continuous]  # discrete ones do not move
        moving = [k for k, variable in enumerate(variables) if variable.continuous]
        rows = [inputs.index(variables[k]) for k in moving]
        motion = InputMotion([orders[k] for k in moving], rows, (values, moving), self._add_held_inputs(inputs))
        motion.read, motion.write = self.getter(inputs, motion.values), super().setter(inputs, motion.values)
        return self.prepare_call("shape", setattr, self, "_motion", motion)

    def _begin_input_motion(self) -> None:
        """Start the polynomials of the inputs at the present time, if derivatives were set."""
        if self._motion is not None:
            self._check(self.functions["get"], self._motion.read(), self._time_text())
            self._motion.begin(self._clock.value)

    def output_derivatives(
        self,
        variables: Scalars,
        orders: Sequence[int],  # noqa: ARG002 - all 1
        values: Numbers,
    ) -> Call:
        """As :meth:`Instance.output_derivatives`, of order 1, by differences along the derivatives set for inputs."""
        read, result = self.getter(variables, values), np.asarray(values)

        def outputs() -> Floats:
            self._check(self.functions["get"], read(), self._time_text())
            return result

        def differentiate() -> int:
            begin, solver = self._clock.value, self._restart_if_stale()
            rates = np.zeros_like(solver.states)
            self._begin_input_motion()
            if rates.size:
                self._read_numbers(rates, self.derivatives_function, self._time_text())
            apart = min(_DIFFERENCE_SPAN * self._size, (self._next_event - begin) / len(_FORWARD_DIFFERENCE))
            total = -sum(_FORWARD_DIFFERENCE) * outputs()
            for k, factor in enumerate(_FORWARD_DIFFERENCE, 1):
                self.set_time_and_states(begin + k * apart, solver.states + k * apart * rates)
                total += factor * outputs()
            self.set_time_and_states(begin, solver.states)
            self._motion = None
            result[:] = total / apart
            return 0

        return self.prepare_call("slope", differentiate)

    # ---- a step

    def stepper(self, time: c_double, size: c_double) -> Call:
        return self.prepare_call("step", self._advance, time, size)

    def _advance(self, time: c_double, size: c_double) -> int:
        """Make a communication step; returns the status."""
        try:
            self._step_to(time.value + size.value, size.value)
        except EndedError as ended:
            self._end_time = ended.time
            return DISCARD
        return 0

    def _requested_end_time(self) -> float | None:
        return None if math.isinf(self._end_time) else self._end_time

    def _step_to(self, end: float, size: float) -> None:
        """Integrate to the end [s] of a communication step with its size [s], through all events."""
        self._size = size
        self._begin_input_motion()
        if self._jumped:
            self._jumped, self._stale = False, True
            if self._update_indicators():
                self._handle_event()
        stuck = steps = 0
        while self._clock.value < end:
            begin, steps = self._clock.value, steps + 1
            if steps > _MOST_STEPS:
                words = f"more than {_MOST_STEPS} steps and events from t = {end - size:.10g} s{self._time_text(' to')}"
                raise RefusedError(f"{self.name}: {words}; choose a smaller step_size, or look for what is not smooth")
            soon = self._next_event <= end + _ROUNDING * size
            happened = self._integrate(self._next_event if soon else end)
            if happened or self._clock.value >= self._next_event:
                self._handle_event()
            stuck = 0 if self._clock.value > begin + _CHATTER_SPAN * size else stuck + 1
            if stuck > _MOST_EVENTS:
                self._check_what_follows(end)
                raise RefusedError(
                    f"{self.name}: more than {_MOST_EVENTS} events or steps{self._time_text()}; it may chatter"
                )
        if self._motion is not None:
            self._held_inputs[self._motion.held] = self._motion.values
            self._motion = None
        if self._input_indices:
            self._update_indicators()

    def _integrate(self, stop: float) -> bool:
        """Make a step of the solver, to ``stop`` [s] at most; returns whether there is an event at its end."""
        begin, time, event = self._clock.value, stop, False
        self._refusal = "", 0
        if (self._count.value or self._indicators.size) and stop - begin > 4 * np.spacing(max(abs(begin), abs(stop))):
            solver = self._restart_if_stale()
            if isinstance(solver, Dop853):
                solver.set_motion(self._motion)
            try:
                time, event = solver.step(stop)
            except RefusedError as error:
                if not isinstance(solver, Dop853):
                    self._check(*self._refusal, self._time_text())
                    raise RefusedError(f"{self.name}: cannot be integrated from t = {begin:.10g} s: {error}") from None
                self._check_last_call(solver)
                self._check_finite_derivatives(solver.states)
                self._change_to_cvode()
                return False
        self._check(*self._try_time_and_states(time, self._states_address), self._time_text())
        if isinstance(self._solver, Dop853) and self._solver.stiff:
            self._change_to_cvode()
        return self._complete_step() or event

    def _check_finite_derivatives(self, states: Floats) -> None:
        """Raise an error if derivatives of the states are not finite at the present time or right after it."""
        begin, rates = self._clock.value, np.zeros_like(states)
        for later in (0.0, _CHATTER_SPAN * self._size, 4 * float(np.spacing(abs(begin)))):
            trial = states + later * rates
            self.set_time_and_states(begin + later, trial)
            self._read_numbers(rates, self.derivatives_function, self._time_text())
            if not np.isfinite(rates).all():
                k = int(np.argmin(np.isfinite(rates)))
                words = f"the derivative of continuous state {k + 1} is {rates[k]:g}{self._time_text()}, where that is"
                raise RefusedError(f"{self.name}: {words} {trial[k]:.10g}; choose other start values, or ask its maker")
        self.set_time_and_states(begin, states)

    def _check_what_follows(self, end: float) -> None:
        """Raise the error with which the FMU discards the instants that follow, with the present states, if it does.

        :param end: of the communication step [s].
        """
        solver, begin = self._restart_if_stale(), self._clock.value
        rates = np.zeros_like(solver.states)
        for part in _AHEAD:
            self.set_time_and_states(begin + part * (end - begin), solver.states)
            if rates.size:
                self._read_numbers(rates, self.derivatives_function, self._time_text())
        self.set_time_and_states(begin, solver.states)

    def _check_last_call(self, solver: Dop853) -> None:
        """Raise the error of the call of the FMU that ended a step of the solver, if one did."""
        equations = solver.equations
        if equations.function:
            time, *others = self._solver_functions
            self._clock.value = equations.at
            function = (time, self.functions["set"], *others)[equations.function - 1]
            self._check(function, equations.status, self._time_text())

    def _restart_if_stale(self) -> Cvode | Dop853:
        """Restart the solver if the states may have changed; returns the solver."""
        solver = self._solver
        assert solver is not None
        if self._stale:
            if self._count.value:
                self._read_numbers(solver.states, f"{self.prefix}GetContinuousStates")
                self._read_numbers(self._nominals, f"{self.prefix}GetNominalsOfContinuousStates")
            solver.restart(self._clock.value, self._nominal_values())
            self._stale = False
        return solver

    def _nominal_values(self) -> Floats:
        """Nominal values of the states; 1 for a value that is not positive and finite."""
        fine = (self._nominals > 0) & np.isfinite(self._nominals)
        if not fine.all():
            words = "nominal values of continuous states are not above 0, such as %.10g; they are taken for 1"
            self._warn_once(words, self._nominals[~fine][0])
        return np.where(fine, self._nominals, 1.0)

    def _warn_once(self, words: str, about: object) -> None:
        """Log a warning, unless it was logged before; ``about`` is formatted into the words."""
        if words not in self._warned:
            self._warned.add(words)
            logger.warning("%s: %s", self.name, words % about)

    def _change_to_cvode(self) -> None:
        """Replace DOP853 by CVODE, and log that the equations are stiff."""
        self._set_solver(self._make_cvode())
        logger.info("%s: its equations are stiff%s: CVODE integrates them", self.name, self._time_text())

    def _complete_step(self) -> bool:
        """Call completedIntegratorStep, if the FMU needs it; returns whether the FMU requests an event."""
        if not self._fmu.needs_completed_step:
            return False
        event, ends = self.flag(), self.flag()
        name = f"{self.prefix}CompletedIntegratorStep"
        self._check(
            name, self._function(name)(self._pointer, self._final, byref(event), byref(ends)), self._time_text()
        )
        if ends.value:
            raise self._end_error()
        return bool(event.value)

    # ---- its equations

    @property
    def continuous_states(self) -> tuple[Floats, Floats]:
        return self._restart_if_stale().states.copy(), self._nominal_values()

    @property
    def has_events(self) -> bool:
        return bool(self._indicators.size) or math.isfinite(self._next_event)

    def set_time_and_states(self, time: float, states: Floats) -> None:
        states = np.ascontiguousarray(states)
        self._check(*self._try_time_and_states(time, c_void_p(states.ctypes.data)), self._time_text())

    # ---- functions for the solver

    def _cvode_callback(self, name: str, size: int) -> Function:
        """Python function that calls an FMI function of time and states, for CVODE; ``size`` is that of its result."""
        function, count = self._function(name), c_size_t(size)

        def evaluate(time: float, states: int, result: int) -> int:
            last = self._try_time_and_states(time, c_void_p(states))
            if last[1] in SUCCESS:
                last = name, function(self._pointer, c_void_p(result), count)
            if last[1] in SUCCESS:
                return 0
            self._refusal = last
            return 1 if last[1] == DISCARD else -1  # a shorter step may do where the FMU discards this one

        return evaluate

    def _try_time_and_states(self, time: float, states: c_void_p) -> tuple[str, int]:
        """Set a time [s], inputs, and the states at an address, unless the FMU refuses one of them.

        :returns: name and status of the last FMI function that was called.
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
        """Enter event mode, iterate, and return to continuous-time mode."""
        self._call(f"{self.prefix}EnterEventMode", about=self._time_text())
        self._iterate_events()

    def _iterate_events(self) -> None:
        """Update discrete states in event mode until none changes, then enter continuous-time mode."""
        for _ in range(_MOST_EVENTS):
            again, ends, self._next_event = self._update_discrete_states()
            if ends:
                raise self._end_error()
            if not again:
                break
        else:
            raise RefusedError(f"{self.name}: its event iteration{self._time_text()} does not end")
        now = self._clock.value  # time does not go back: a next event that is earlier by rounding only is now
        if not self._next_event >= now - _ROUNDING * max(self._size, abs(now)):
            raise SimulationError(
                f"{self.name}: its next event{self._time_text()} is to be at {self._next_event:.10g} s, which is not "
                "later; ask its maker"
            )
        self._next_event = max(self._next_event, now)
        self._call(f"{self.prefix}EnterContinuousTimeMode")
        self._stale = True
        self._update_indicators()

    @abstractmethod
    def _update_discrete_states(self) -> DiscreteStatesUpdate:
        """Update discrete states once."""

    def _update_indicators(self) -> bool:
        """Read the event indicators; returns whether the sign of one differs from when they were read last."""
        if not self._indicators.size:
            return False
        before = self._indicators > 0
        self._read_numbers(self._indicators, f"{self.prefix}GetEventIndicators")
        if np.isnan(self._indicators).any():
            self._warn_once("an event indicator is nan%s, so that events may be missed", self._time_text())
        return not np.array_equal(before, self._indicators > 0)

    def _read_numbers(self, numbers: Floats, function: str, about: str = "") -> None:
        """Read states, derivatives or indicators into an array by an FMI function, and check its status."""
        status = self._function(function)(self._pointer, c_void_p(numbers.ctypes.data), c_size_t(numbers.size))
        self._check(function, status, about)

    def _end_error(self) -> EndedError:
        """Error for an FMU that ends the simulation at the present time."""
        return EndedError(f"{self.name} ends the simulation{self._time_text()}", self._clock.value)

    def _time_text(self, preposition: str = " at") -> str:
        """The present time with a preposition, for a message."""
        return f"{preposition} t = {self._clock.value:.10g} s"

    # ---- saved states

    def save_and_restore_calls(self) -> tuple[Call, Call]:
        """As :meth:`Instance.save_and_restore_calls`; CVODE, whose state cannot be saved, restarts after both."""
        self._final = self.flag(False)
        save, restore = super().save_and_restore_calls()
        saved: list[Any] = []

        def save_with_solver() -> int:
            if self._initialized:
                solver = self._solver
                memory = solver.save() if isinstance(solver, Dop853) and not self._stale else None
                arrays = self._held_inputs.copy(), self._indicators.copy()
                saved[:] = solver, memory, self._clock.value, self._next_event, self._jumped, *arrays
                self._stale = memory is None
            return save()

        def restore_with_solver() -> int:
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
                    self._warn_once(words + more, self._time_text(""))
            return restore()

        return self.prepare_call("save", save_with_solver), self.prepare_call("restore", restore_with_solver)

    def _close_private(self) -> None:
        if self._solver is not None:
            self._solver.close()
        super()._close_private()


@final
class ModelExchange2(ModelExchange, Instance2):
    """An FMI 2.0 instance of Model Exchange."""

    fmpy_class = FMU2ModelExchange
    derivatives_function = "fmi2GetDerivatives"

    def _count_states_and_indicators(self) -> tuple[int, int]:
        return self._fmu.states, self._fmu.indicators

    def _update_discrete_states(self) -> DiscreteStatesUpdate:
        info = fmi2EventInfo()
        self._call("fmi2NewDiscreteStates", byref(info), about=self._time_text())
        next_event = info.nextEventTime if info.nextEventTimeDefined else math.inf
        return DiscreteStatesUpdate(bool(info.newDiscreteStatesNeeded), bool(info.terminateSimulation), next_event)


@final
class ModelExchange3(ModelExchange, Instance3):
    """An FMI 3.0 instance of Model Exchange."""

    fmpy_class = FMU3ModelExchange
    derivatives_function = "fmi3GetContinuousStateDerivatives"

    def _count_states_and_indicators(self) -> tuple[int, int]:
        states, indicators = c_size_t(), c_size_t()
        self._call("fmi3GetNumberOfContinuousStates", byref(states))
        self._call("fmi3GetNumberOfEventIndicators", byref(indicators))
        return states.value, indicators.value

    def _update_discrete_states(self) -> DiscreteStatesUpdate:
        flags, next_event = [c_bool() for _ in range(5)], c_double()
        self._call("fmi3UpdateDiscreteStates", *map(byref, (*flags, next_event)), about=self._time_text())
        again, ends, _nominals, _states, defined = (flag.value for flag in flags)
        return DiscreteStatesUpdate(again, ends, next_event.value if defined else math.inf)
