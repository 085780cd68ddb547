"""FMI 2.0 for co-simulation: pythonfmu's slave over the numbers of one instance.

Outputs are evaluated when they are read, once per change.

pythonfmu's wrapper returns OK; Discard, from ``do_step`` alone; Fatal, when a method raises.  A start that is refused
is Fatal, and so is reading outputs after it.  Nothing else raises: refused values are logged at once, change nothing,
and make the next step Discard with the same message.  With Discard the wrapper requests termination, so that importers
end there; a step that is refused once more, as long or longer, is logged as an error.
"""

from __future__ import annotations

import atexit
import math
import os
import sys
from contextlib import suppress
from ctypes import CDLL, py_object, pythonapi
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from pythonfmu import Fmi2Slave
from pythonfmu.enums import Fmi2Status

from .calls import Call, view
from .motion import EXTRAPOLATE, HOLD, INTERPOLATE, LOOSEST, TIGHTEST, Events, Step
from .prescribed import Prescribed
from .states import ARRAYS, SCALARS, State, from_bytes, to_bytes, usable
from .table import load, starts, violation
from .vectors import Vectors

held: list[dict[str, Any]] = []  # see python_backend

_FIXED = "it is a fixed parameter; set it before initialization ends"
_NEVER = math.nan, math.nan


@cache
def _finalize_at_exit(resources: str) -> None:
    """Finalize the interpreter of the wrapper at exit.

    By itself the wrapper does so when it is unloaded, in memory that is freed by then (pythonfmu 0.7.0,
    ``onLibraryUnload`` of Linux), and some processes end with "corrupted double-linked list".
    """
    for binary in Path(resources).parent.glob("binaries/linux64/*.so"):
        atexit.register(_finalize, str(binary))


def _finalize(binary: str) -> None:
    with suppress(OSError):  # unloaded before
        CDLL(binary, mode=os.RTLD_NOLOAD).finalizePythonInterpreter()


class StartRefused(Exception):  # noqa: N818 - the wrapper's message has its repr
    """The end of initialization is refused."""

    def __repr__(self) -> str:
        return str(self)


class Slave(Fmi2Slave):
    """One instance of the component in the resources folder."""

    def __init__(self, **kwargs: Any) -> None:
        super().__init__(**kwargs)
        resources = kwargs["resources"]
        if resources in sys.path:  # added by the wrapper at each instantiation, and not needed any more
            sys.path.remove(resources)
        if sys.platform == "linux":
            _finalize_at_exit(resources)
        self._table = table = load(resources)
        self._first = table.first
        self._first_input = self._first + len(table.parameters)
        self._first_output = self._first_input + len(table.inputs)
        self._first_drawn = self._first_output + len(table.outputs)
        self._mode = EXTRAPOLATE
        self._tolerance = table.tolerance
        self._step: Step | None = None  # from the end of initialization on
        self._prescribed: Prescribed | None = None  # likewise
        self._settable = set(range(self._first, self._first_output))
        self._started = False  # y and m belong to the present parameters and inputs
        self._remembered = True  # m belongs to the end of the last step
        self._jumped = False  # parameters or inputs were set since then: the energy may have jumped
        self._evaluated = False  # the outputs belong to all the rest
        self._unusable = ""  # why initialization failed
        self._refused: dict[int, str] = {}  # by value reference: messages for the next step
        self._discarded = _NEVER  # start and size of the last step, if it was refused
        self._kept_starts: dict[int, float] = {}  # by value reference: start values that stay where 0 is set

        f, self._v = table.functions, (v := Vectors(table))
        self._number, self._now = view(v.values), view(v.now)
        point = (v.t, v.y, v.u, v.k)
        self._start = Call(f["start"], (v.t, v.u, v.k), (v.y, v.m))
        self._measure = Call(f["nominals"], point, (v.size,))
        self._output = Call(f["outputs"], (*point, v.m), (v.z,))
        self._draw = Call(f["draw"], point, (v.drawn,)) if "draw" in f else None
        self._jump = Call(f["jump"], (*point, v.m), (v.y,))
        self._remember = Call(f["remember"], (*point, v.m), (v.m,))
        self._project = Call(f["project"], point, (v.y,)) if "project" in f else None
        self._events = Events(f["events"], v.k)
        self._read_starts(resources)

    def _read_starts(self, resources: str) -> None:
        """Set start values in the resources, which replace those of the component."""
        for kind, vr, value in starts(resources):
            if kind != "z":
                (self.set_real if kind == "r" else self.set_integer)([vr], [value])
            else:
                excluded = [index for index, _, _ in self._table.active if not self._table.inputs[index].allows(0.0)]
                self._kept_starts = {self._first_input + index: self._v.given[index] for index in excluded}

    # ---- initialization ---------------------------------------------------------------------------------------

    def setup_experiment(self, start_time: float, stop_time: float | None, tolerance: float | None) -> None:
        self._unusable = ""
        for word, time in (("start", start_time), ("stop", stop_time or 0.0)):
            if not math.isfinite(time):
                self._unusable = f"{word} time = {time:g}: it must be finite"
                self.log(self._unusable, Fmi2Status.error)
                return
        self._now[0] = start_time
        self._started = self._evaluated = False
        if tolerance is not None:
            self._tolerance = min(max(tolerance, TIGHTEST), LOOSEST)
            if self._tolerance != tolerance:
                text = f"tolerance = {tolerance:g} is out of range, {self._tolerance:g} is used"
                self.log(text, Fmi2Status.warning)

    def exit_initialization_mode(self) -> None:
        """Enter the phase of communication steps.

        :raises StartRefused: with the reason.
        """
        if not self._unusable:  # times are finite
            self._initialize()
            self._measure.run()
            size = self._v.size
            size[~((size > 0) & np.isfinite(size))] = 1.0
            problem = self._bad_start()
            self._unusable = problem and f"{problem}; reset, set another value and initialize again"
        self._jumped, self._evaluated = self._prescribed is None, False  # a sample may be due
        self._enter(stepping=True)
        if self._prescribed is not None:
            self._prescribed.arrive(0.0)
        self._check_start()

    def _check_start(self) -> None:
        if self._unusable and self._step is not None:
            # The wrapper (0.7.0) releases these now and once more with the instance or at a reset.
            for item in (self, type(self), self.log_queue):
                pythonapi.Py_IncRef(py_object(item))
            raise StartRefused(self._unusable)

    def terminate(self) -> None:
        self._warn()

    def _warn(self) -> None:
        for text in self._prescribed.warnings() if self._prescribed else ():
            self.log(text, Fmi2Status.warning)

    def _initialize(self) -> None:
        """Calculate state and memory from parameters and inputs."""
        if not self._started:
            self._v.u[:] = self._v.given
            self._start.run()
            self._started = True

    def _bad_start(self) -> str:
        """What forbids this initialization; empty if nothing does."""
        v, t = self._v, self._now[0]
        if problem := violation(self._table.settable, v.values[self._first : self._first_output], t):
            return problem
        if not np.isfinite(v.y).all():
            return "the initial state is not finite"
        failed = self._table.failed_condition(t, v.y, v.u, v.k, 0.0, start=True)
        if failed or not np.isfinite(v.m).all():
            return failed or "the initial energy is not finite"
        return self._overflow(t) if t else ""

    def _overflow(self, t: float) -> str:
        """The output that is not finite at this start time, if it is at 0: functions of time overflow at 1e300."""
        self._output.run()
        infinite = np.flatnonzero(~np.isfinite(self._v.z))
        if not infinite.size:
            return ""
        i = infinite[0]
        name, value = self._table.outputs[i].name, self._v.z[i]
        self._now[0] = 0.0
        self._output.run()
        self._now[0] = t
        return f"{name} = {value:g} at t = {t:.9g}: it must be finite" if np.isfinite(self._v.z).all() else ""

    def _enter(self, *, stepping: bool) -> None:
        """Enter the phase before the end of initialization, in which all can be set, or the one after it."""
        parameters = enumerate(self._table.parameters, self._first)
        fixed = [vr for vr, entry in parameters if stepping and entry.variability == "fixed"]
        self._settable = set(range(self._first, self._first_output)).difference(fixed)
        if not stepping:
            self._step = self._prescribed = None
        elif self._step is None or (self._step.mode, self._step.tolerance) != (self._mode, self._tolerance):
            arguments = self._table, self._mode, self._tolerance, self._v
            self._step, self._prescribed = Step(*arguments), Prescribed(*arguments)
        elif self._prescribed is not None:
            self._prescribed.contradicted = True  # perhaps, in a state that was saved

    # ---- stepping ---------------------------------------------------------------------------------------------

    def do_step(self, current_time: float, step_size: float) -> bool:
        before = self._v.moving.copy()
        try:
            problem = self._attempt(current_time, step_size)
        except BaseException as reason:  # noqa: BLE001 - e.g. an interrupt; see above
            problem = f"broken off by {reason!r}; the step from t = {current_time:.9g} is taken back"
        if not problem:
            self._discarded = _NEVER
            self._kept_starts.clear()
            return True
        self._v.moving[:] = before
        if self._prescribed is not None:
            self._prescribed.contradicted = True  # perhaps
        start, size = self._discarded
        again = start == self._now[0] and step_size > size * (1 - 1e-9)
        self._discarded = self._now[0], step_size
        self.log(problem, Fmi2Status.error if again else Fmi2Status.discard)
        return False

    def _attempt(self, t: float, H: float) -> str:
        """Do the step from t to t + H; returns why it failed, or an empty text."""
        step, prescribed, now = self._step, self._prescribed, self._now
        if step is None or prescribed is None or self._unusable:
            return self._unusable or "initialize the instance first"
        if self._refused:
            problem = "; ".join(self._refused.values())
            self._refused.clear()
            return problem
        if problem := self._wrong_times(t, H):
            return problem
        self._warn()
        now[0], self._v.H[0] = t, H
        self._set_present_inputs()
        compares = prescribed.contradicted or self._jumped or self._mode == INTERPOLATE
        jumps_at_end = compares and prescribed.compare(H)
        if self._jumped:
            prescribed.jump()
            self._jump.run()
        if obstacle := self._extrapolate(step, prescribed, t, H) if jumps_at_end else step.advance():
            return f"{obstacle}; the step from t = {t:.9g} is taken back"
        prescribed.arrive(H)
        step.next[0] = self._at_instant(t + H)
        now[:] = step.next
        if self._project is not None:  # back onto constraints and unit quaternions
            self._project.run()
        if jumps_at_end:
            self._remember.run()
            prescribed.jump_to_inputs()
            self._jump.run()
        self._remembered = self._jumped = self._evaluated = False
        return ""

    def _extrapolate(self, step: Step, prescribed: Prescribed, t: float, H: float) -> str:
        """Do a step with extrapolated inputs, which jump at its end; returns why it failed, or an empty text."""
        given = self._v.given
        if obstacle := violation(self._table.inputs, given, t + H):
            return obstacle
        ends = given.copy()
        prescribed.extrapolate(H)
        obstacle = step.advance()
        given[:] = ends
        return obstacle

    def _wrong_times(self, t: float, H: float) -> str:
        """Why there is no step from t to t + H; empty if there is one."""
        if not 0 < H < math.inf:
            return f"step size = {H:g}: it must be > 0 and finite"
        if not math.isfinite(t):
            return f"step from t = {t:g}: it must be finite"
        if not abs(t - self._now[0]) <= 1e-6 * H + 1e-12 * abs(t):  # rounding of the importer's clock
            return f"step from t = {t:.15g}: the instance is at t = {self._now[0]:.15g}"
        if t < t + H < math.inf:
            return ""
        return f"step from t = {t:.15g} of size {H:g}: it must end later, at a finite time"

    def _at_instant(self, end: float) -> float:
        """The end of a step, moved onto an instant that it misses by rounding: 3 * 0.3 is not 0.9."""
        rounding = 1e-12 * (1 + abs(end))
        instant = self._events.after(end - rounding)
        return instant if instant <= end + rounding else end

    def _set_present_inputs(self) -> None:
        """Make the given inputs those of the present time, unless they are interpolated."""
        if self._mode != INTERPOLATE and self._v.u.tobytes() != self._v.given.tobytes():
            self._close_step()
            self._v.u[:] = self._v.given
            self._jumped, self._evaluated = True, False

    def _close_step(self) -> None:
        """Remember the end of the last step; deferred until it matters."""
        if not self._remembered:
            self._remember.run()
            self._remembered = True

    # ---- variables --------------------------------------------------------------------------------------------

    def get_real(self, vrs: list[int]) -> list[float]:
        if not self._evaluated:
            self._evaluate()
        if self._draw is not None and max(vrs, default=0) >= self._first_drawn:
            self._draw.run()
        number = self._number
        try:
            if min(vrs, default=self._first) >= self._first:  # a negative index would count from the end
                values = [number[vr] for vr in vrs]
                if not math.isfinite(sum(values)):
                    self._report_infinite(vrs, values)
                return values
        except IndexError:
            pass
        self.log(f"of the value references {vrs} some belong to no Real variable", Fmi2Status.error)
        return [math.nan] * len(vrs)

    def _report_infinite(self, vrs: list[int], values: list[float]) -> None:
        """Log the first number that is not finite, if any; once initialized, the next step repeats it."""
        for vr, value in zip(vrs, values, strict=True):
            if not math.isfinite(value) and not self._unusable:
                name, t = self._table.variables[vr - self._first].name, self._now[0]
                problem = f"{name} = {value:g} at t = {t:.9g}: it must be finite; choose other start values or inputs"
                self.log(problem, Fmi2Status.error)
                if self._step is not None:
                    self._refused[vr] = problem
                return

    def _evaluate(self) -> None:
        self._check_start()
        self._initialize()
        self._close_step()
        self._output.run()
        self._evaluated = True

    def set_real(self, vrs: list[int], values: list[float]) -> None:
        if self._kept_starts:
            values = [self._ignore_zero(vr, value) for vr, value in zip(vrs, values, strict=True)]
        number, settable, first_input = self._number, self._settable, self._first_input
        for vr, value in zip(vrs, values, strict=True):
            if vr not in settable or not math.isfinite(value):
                self._refuse_real(vr, value)
                return
        for vr, value in zip(vrs, values, strict=True):
            if vr < first_input and number[vr] != value:  # a tunable parameter: the energy may jump with it, too
                self._close_step()
                self._jumped, self._evaluated = True, False
            number[vr] = value
        if self._refused:
            for vr in vrs:
                self._refused.pop(vr, None)
        if self._step is None:
            self._started = self._evaluated = False
        else:
            self._set_present_inputs()

    def _ignore_zero(self, vr: int, value: float) -> float:
        """The start value instead of a 0 that is set before the first step; see ``core_ignore_zeros``."""
        if value != 0 or vr not in self._kept_starts:
            return value
        start, name = self._kept_starts[vr], self._table.variables[vr - self._first].name
        self.log(f"{name} = 0 before the first step: it stays {start:.9g}", Fmi2Status.warning)
        return start

    def _refuse_real(self, vr: int, value: float) -> None:
        if vr in self._settable:
            self._refuse(vr, value, f"set a finite number; it stays {self._number[vr]:.9g}")
        elif not self._first <= vr < self._v.values.size:
            self._refuse(vr, value, "it belongs to no Real variable")
        elif vr < self._first_input:
            self._refuse(vr, value, _FIXED)
        else:
            self._refuse(vr, value, "it is calculated; set parameters and inputs")

    def get_integer(self, vrs: list[int]) -> list[int]:
        integers = {vr: count for vr, (_, count) in enumerate(self._table.sizes, 1)} | {self._v.values.size: self._mode}
        if not integers.keys() >= set(vrs):
            self.log(f"of the value references {vrs} some belong to no Integer variable", Fmi2Status.error)
        return [integers.get(vr, 0) for vr in vrs]

    def set_integer(self, vrs: list[int], values: list[int]) -> None:
        for vr, value in zip(vrs, values, strict=True):
            if vr != self._v.values.size:  # input_reconstruction follows the numbers
                self._refuse(vr, value, "it is no Integer variable that can be set")
            elif self._step is not None:
                self._refuse(vr, value, _FIXED)
            elif value not in (HOLD, EXTRAPOLATE, INTERPOLATE):
                self._refuse(vr, value, "set 0 (hold), 1 (extrapolate) or 2 (interpolate)")
            else:
                self._mode = value
                self._refused.pop(vr, None)

    def _refuse(self, vr: int, value: float, why: str) -> None:
        """Log that a value was refused, and refuse the next step with the same message."""
        table = self._table
        names = [name for name, _ in table.sizes] + [entry.name for entry in table.variables] + ["input_reconstruction"]
        name = names[vr - 1] if 1 <= vr <= len(names) else f"value reference {vr}"
        self._refused[vr] = f"{name} = {value:.9g}: {why}"
        self.log(self._refused[vr], Fmi2Status.discard)

    # ---- state ------------------------------------------------------------------------------------------------

    def _get_fmu_state(self) -> State:
        self._close_step()
        state = {name: getattr(self, f"_{name}") for name in SCALARS}
        state |= {name: getattr(self._v, name).tolist() for name in ARRAYS}
        return state | {"guid": self._table.guid, "stepping": self._step is not None}

    def _set_fmu_state(self, state: State) -> None:
        arrays = {name: getattr(self._v, name) for name in ARRAYS}
        if not usable(state, self._table, {name: array.size for name, array in arrays.items()}):
            self._refused[-1] = "the state to restore is damaged or belongs to another FMU; the present one is kept"
            self.log(self._refused[-1], Fmi2Status.discard)
            return
        for name in SCALARS:
            setattr(self, f"_{name}", state[name])
        for name, array in arrays.items():
            array[:] = state[name]
        self._refused.clear()
        self._discarded = _NEVER
        self._remembered, self._evaluated = True, False
        self._started &= state["stepping"]
        self._enter(stepping=state["stepping"])

    @staticmethod
    def _fmu_state_to_bytes(state: State) -> bytes:
        return to_bytes(state)

    @staticmethod
    def _fmu_state_from_bytes(state: bytes) -> State:
        return from_bytes(state)  # damaged ones are refused when they are set
