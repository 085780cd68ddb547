"""The FMI face of a component: pythonfmu's slave over the numbers of one instance.

Variables live in one array, where their value references say: parameters, inputs, everything else.
Outputs are evaluated when they are read, once per change.

pythonfmu's wrapper knows three answers: OK; Discard, from ``do_step`` alone; Fatal, when a method raises.  A start
that is refused is Fatal, and so is reading outputs after it.  Nothing else raises: what is refused is logged at once,
changes nothing, and makes the next step Discard with the same message.  The wrapper answers Discard with the wish to
terminate, so that importers end there; the log has a step that is refused once more, as long or longer, as an error.
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
from .prescribed import Prescribed, past_size
from .states import State, from_bytes, to_bytes, usable
from .table import load, starts

held: list[dict[str, Any]] = []  # see python_backend

# What makes up the state of an instance, beside whether it is stepping.
_ARRAYS = ("_t", "_k", "_given", "_u", "_y", "_m", "_past", "_size")
_SCALARS = ("_mode", "_tolerance", "_started", "_jumped", "_unusable")

_NEVER = math.nan, math.nan


@cache
def _let_go_at_exit(resources: str) -> None:
    """Have the wrapper let go of the interpreter while it can.

    By itself it does so when the process ends, in memory that is freed by then (pythonfmu 0.7.0, ``onLibraryUnload``
    of Linux), and some processes end with "corrupted double-linked list".
    """
    for binary in Path(resources).parent.glob("binaries/linux64/*.so"):
        atexit.register(_let_go, str(binary))


def _let_go(binary: str) -> None:
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
        if resources in sys.path:  # put there by the wrapper at each instantiation, and done with
            sys.path.remove(resources)
        if sys.platform == "linux":
            _let_go_at_exit(resources)
        self._table = table = load(resources)
        self._first = table.first
        self._first_input = self._first + len(table.parameters)
        self._first_output = self._first_input + len(table.inputs)
        self._mode = EXTRAPOLATE
        self._tolerance = table.tolerance
        self._step: Step | None = None  # there is one from the end of initialization on,
        self._prescribed: Prescribed | None = None  # and this
        self._settable = set(range(self._first, self._first_output))
        self._started = False  # y and m belong to the parameters and inputs as they are
        self._remembered = True  # m belongs to the end of the last step
        self._jumped = False  # something was set since then: the energy may have jumped
        self._evaluated = False  # the outputs belong to all the rest
        self._unusable = ""  # why initialization failed
        self._refused: dict[int, str] = {}  # by value reference: calls that the next step answers for
        self._discarded = _NEVER  # from when and how long the last step was that was refused

        f = table.functions
        # by value reference; those below the first belong to no Real variable
        self._values = np.array([math.nan] * self._first + [entry.start or 0.0 for entry in table.variables])
        self._k = self._values[self._first : self._first_input]
        self._given = self._values[self._first_input : self._first_output]  # inputs as set by the importer
        self._first_drawn = self._first_output + len(table.outputs)
        self._z, drawn = self._values[self._first_output : self._first_drawn], self._values[self._first_drawn :]
        states = f["start"].numel_out(0)
        sizes = (1, states, self._given.size, f["start"].numel_out(1), past_size(table))
        self._moving = np.zeros(sum(sizes))  # what a step changes
        self._t, self._y, self._u, self._m, self._past = np.split(self._moving, np.cumsum(sizes[:-1]))
        self._now = self._moving[: sum(sizes[:3])]  # present time, state, inputs
        self._y_jumped, self._m_next = self._y.copy(), self._m.copy()
        self._H, self._size = np.zeros(1), np.ones(states)
        self._number, self._moving_view, self._now_view = map(view, (self._values, self._moving, self._now))
        self._u_view, self._given_view, self._H_view = map(view, (self._u, self._given, self._H))
        self._y_view, self._y_jumped_view = view(self._y), view(self._y_jumped)
        self._m_view, self._m_next_view = view(self._m), view(self._m_next)
        point = (self._t, self._y, self._u, self._k)
        self._start = Call(f["start"], (self._t, self._u, self._k), (self._y, self._m))
        self._measure = Call(f["nominals"], point, (self._size,))
        self._output = Call(f["outputs"], (*point, self._m), (self._z,))
        self._draw = Call(f["draw"], point, (drawn,)) if "draw" in f else None
        self._jump = Call(f["jump"], (*point, self._m), (self._y_jumped,))
        self._remember = Call(f["remember"], (*point, self._m), (self._m_next,))
        self._events = Events(f["events"], self._k)
        self._project = Call(f["project"], point, (self._y_jumped,)) if "project" in f else None
        self._kept: dict[int, float] = {}  # by value reference: start values that stay where 0 is set
        self._take_starts(resources)

    def _take_starts(self, resources: str) -> None:
        """Start values in the resources, which replace those of the component."""
        for kind, vr, value in starts(resources):
            if kind != "z":
                (self.set_real if kind == "r" else self.set_integer)([vr], [value])
            else:
                values = [(place, self._table.inputs[place]) for place, _, _ in self._table.active]
                self._kept = {self._first_input + i: self._given[i] for i, entry in values if not entry.allows(0.0)}

    # ---- initialization ---------------------------------------------------------------------------------------

    def setup_experiment(self, start_time: float, stop_time: float | None, tolerance: float | None) -> None:
        self._unusable = ""
        for word, time in (("start", start_time), ("stop", stop_time or 0.0)):
            if not math.isfinite(time):
                self._unusable = f"{word} time = {time:g}: it must be finite"
                self.log(self._unusable, Fmi2Status.error)
                return
        self._t[0] = start_time
        self._started = self._evaluated = False
        if tolerance is not None:
            self._tolerance = min(max(tolerance, TIGHTEST), LOOSEST)
            if self._tolerance != tolerance:
                text = f"tolerance = {tolerance:g} is out of range, {self._tolerance:g} is used"
                self.log(text, Fmi2Status.warning)

    def exit_initialization_mode(self) -> None:
        """Begin to step.

        :raises StartRefused: with the reason.
        """
        if not self._unusable:  # times are finite
            self._initialize()
            self._measure.run()
            self._size[~((self._size > 0) & np.isfinite(self._size))] = 1.0
            problem = self._bad_start()
            self._unusable = problem and f"{problem}; reset, set another value and initialize again"
        self._jumped = self._evaluated = False
        self._enter(stepping=True)
        if self._prescribed is not None:
            self._prescribed.follow()
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
        """State and memory from parameters and inputs."""
        if not self._started:
            self._u[:] = self._given
            self._start.run()
            self._started = True

    def _bad_start(self) -> str:
        """What forbids this initialization; empty if nothing does."""
        t = self._t[0]
        for entry, value in zip(self._table.settable, self._values[self._first :], strict=False):
            if not entry.allows(value):
                return entry.violation(value, t)
        if not np.isfinite(self._y).all():
            return "the initial state is not finite"
        failed = self._table.failed_condition(t, self._y, self._u, self._k, 0.0, start=True)
        if failed or not np.isfinite(self._m).all():
            return failed or "the initial energy is not finite"
        return self._overflow(t) if t else ""

    def _overflow(self, t: float) -> str:
        """What is not finite at this start time, and would be at 0: functions of time overflow at 1e300."""
        self._output.run()
        infinite = np.flatnonzero(~np.isfinite(self._z))
        if not infinite.size:
            return ""
        i = infinite[0]
        name, value = self._table.outputs[i].name, self._z[i]
        self._t[0] = 0.0
        self._output.run()
        self._t[0] = t
        return f"{name} = {value:g} at t = {t:.9g}: it must be finite" if np.isfinite(self._z).all() else ""

    def _enter(self, *, stepping: bool) -> None:
        """Enter the phase before the end of initialization, where all can be set, or the one after it."""
        parameters = enumerate(self._table.parameters, self._first)
        fixed = [vr for vr, entry in parameters if stepping and entry.variability == "fixed"]
        self._settable = set(range(self._first, self._first_output)).difference(fixed)
        setting = self._table, self._mode, self._tolerance
        if not stepping:
            self._step = self._prescribed = None
        elif self._step is None or (self._step.mode, self._step.tolerance) != setting[1:]:
            arrays = {"now": self._now, "H": self._H, "given": self._given, "k": self._k, "size": self._size}
            self._step = Step(*setting, **arrays)
            self._prescribed = Prescribed(*setting, **arrays, m=self._m, past=self._past)
        elif self._prescribed is not None:
            self._prescribed.contradicted = True  # perhaps, in a state that was saved

    # ---- stepping ---------------------------------------------------------------------------------------------

    def do_step(self, current_time: float, step_size: float) -> bool:
        before = self._moving_view.tobytes()
        try:
            problem = self._attempt(current_time, step_size)
        except BaseException as reason:  # noqa: BLE001 - an interrupt, say; see above
            problem = f"broken off by {reason!r}; the step from t = {current_time:.9g} is taken back"
        if not problem:
            self._discarded = _NEVER
            self._kept.clear()
            return True
        self._moving_view[:] = memoryview(before).cast("d")
        if self._prescribed is not None:
            self._prescribed.contradicted = True  # perhaps
        begin, size = self._discarded
        now = self._now_view[0]
        again = begin == now and step_size > size * (1 - 1e-9)
        self._discarded = now, step_size
        self.log(problem, Fmi2Status.error if again else Fmi2Status.discard)
        return False

    def _attempt(self, t: float, H: float) -> str:
        """Do the step from t to t + H; empty, or what stands in its way."""
        step, prescribed, now = self._step, self._prescribed, self._now_view
        if step is None or prescribed is None or self._unusable:
            return self._unusable or "initialize the instance first"
        if self._refused:
            problem = "; ".join(self._refused.values())
            self._refused.clear()
            return problem
        if not (0 < H < math.inf and abs(t - now[0]) <= 1e-6 * H + 1e-12 * abs(t) and t < t + H < math.inf):
            return self._wrong_times(t, H)
        if prescribed.contradicted:
            self._warn()
        now[0], self._H_view[0] = t, H
        if self._mode != INTERPOLATE and self._u_view.tobytes() != self._given_view.tobytes():
            self._take_inputs()
        compares = prescribed.contradicted or self._jumped or self._mode == INTERPOLATE
        hurries = compares and prescribed.compare(H)
        if self._jumped:
            prescribed.leap()
            self._jump.run()
            self._y_view[:] = self._y_jumped_view
        obstacle = self._extrapolate(step, prescribed, t, H) if hurries else not step.advance() and step.obstacle()
        if obstacle:
            return f"{obstacle}; the step from t = {t:.9g} is taken back"
        prescribed.arrive(H)
        step.next[0] = self._at_instant(t + H)
        now[:] = step.next
        if self._project is not None:  # back onto constraints and unit quaternions
            self._project.run()
            self._y_view[:] = self._y_jumped_view
        if hurries:
            self._leap(prescribed)
        self._remembered = self._jumped = self._evaluated = False
        return ""

    def _extrapolate(self, step: Step, prescribed: Prescribed, t: float, H: float) -> str:
        """Advance to where the rates of what would hurry lead; empty, or what stands in the way."""
        for entry, value in zip(self._table.inputs, self._given.tolist(), strict=True):
            if not entry.allows(value):
                return entry.violation(value, t + H)
        given = self._given.copy()
        prescribed.extrapolate(H)
        obstacle = "" if step.advance() else step.obstacle()
        self._given[:] = given
        return obstacle

    def _leap(self, prescribed: Prescribed) -> None:
        """From there to what was given."""
        self._remember.run()
        self._m_view[:] = self._m_next_view
        prescribed.leap_to_inputs()
        self._jump.run()
        self._y_view[:] = self._y_jumped_view

    def _wrong_times(self, t: float, H: float) -> str:
        """Why there is no step from t to t + H."""
        if not 0 < H < math.inf:
            return f"step size = {H:g}: it must be > 0 and finite"
        if not math.isfinite(t):
            return f"step from t = {t:g}: it must be finite"
        if not abs(t - self._t[0]) <= 1e-6 * H + 1e-12 * abs(t):  # rounding of the importer's clock
            return f"step from t = {t:.15g}: the instance is at t = {self._t[0]:.15g}"
        return f"step from t = {t:.15g} of size {H:g}: it must end later, at a finite time"

    def _at_instant(self, end: float) -> float:
        """The end of a step, moved onto an instant that it means and misses by rounding: 3 * 0.3 is not 0.9."""
        rounding = 1e-12 * (1 + abs(end))
        instant = self._events.after(end - rounding)
        return instant if instant <= end + rounding else end

    def _take_inputs(self) -> None:
        """What the importer gave becomes the inputs of the present time."""
        self._close_step()
        self._u_view[:] = self._given_view
        self._jumped = True
        self._evaluated = False

    def _close_step(self) -> None:
        """Remember the end of the last step; put off until it matters."""
        if not self._remembered:
            self._remember.run()
            self._m_view[:] = self._m_next_view
            self._remembered = True

    # ---- variables --------------------------------------------------------------------------------------------

    def get_real(self, vrs: list[int]) -> list[float]:
        if not self._evaluated:
            self._evaluate()
        if self._draw is not None and max(vrs, default=0) >= self._first_drawn:
            self._draw.run()
        number = self._number
        try:
            if min(vrs, default=self._first) >= self._first:  # a negative one would be taken from the end
                values = [number[vr] for vr in vrs]
                if not math.isfinite(sum(values)):
                    self._report_infinite(vrs, values)
                return values
        except IndexError:
            pass
        self.log(f"of the value references {vrs} some belong to no Real variable", Fmi2Status.error)
        return [math.nan] * len(vrs)

    def _report_infinite(self, vrs: list[int], values: list[float]) -> None:
        """Log the first number that is not finite, if one is; once initialized, the next step answers for it."""
        found = next(((vr, value) for vr, value in zip(vrs, values, strict=True) if not math.isfinite(value)), None)
        if found is None or self._unusable:
            return
        vr, value = found
        name = self._table.variables[vr - self._first].name
        problem = f"{name} = {value:g} at t = {self._t[0]:.9g}: it must be finite; choose other start values or inputs"
        self.log(problem, Fmi2Status.error)
        if self._step is not None:
            self._refused[vr] = problem

    def _evaluate(self) -> None:
        self._check_start()
        self._initialize()
        self._close_step()
        self._output.run()
        self._evaluated = True

    def set_real(self, vrs: list[int], values: list[float]) -> None:
        if self._kept:
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
        elif self._mode != INTERPOLATE and self._u_view.tobytes() != self._given_view.tobytes():
            self._take_inputs()

    def _ignore_zero(self, vr: int, value: float) -> float:
        """The start value in place of a 0 that is set before the first step; see ``core_ignore_zeros``."""
        if value != 0 or vr not in self._kept:
            return value
        name = self._table.variables[vr - self._first].name
        self.log(f"{name} = 0 before the first step: it stays {self._kept[vr]:.9g}", Fmi2Status.warning)
        return self._kept[vr]

    def _refuse_real(self, vr: int, value: float) -> None:
        if vr in self._settable:
            self._refuse(vr, value, f"set a finite number; it stays {self._number[vr]:.9g}")
        elif not self._first <= vr < self._values.size:
            self._refuse(vr, value, "it belongs to no Real variable")
        elif vr < self._first_input:
            self._refuse(vr, value, "it is a fixed parameter; set it before initialization ends")
        else:
            self._refuse(vr, value, "it is calculated; set parameters and inputs")

    def get_integer(self, vrs: list[int]) -> list[int]:
        integers = {vr: count for vr, (_, count) in enumerate(self._table.sizes, 1)} | {self._values.size: self._mode}
        if not integers.keys() >= set(vrs):
            self.log(f"of the value references {vrs} some belong to no Integer variable", Fmi2Status.error)
        return [integers.get(vr, 0) for vr in vrs]

    def set_integer(self, vrs: list[int], values: list[int]) -> None:
        for vr, value in zip(vrs, values, strict=True):
            if vr != self._values.size:  # input_reconstruction follows the numbers
                self._refuse(vr, value, "it is no Integer variable that can be set")
            elif self._step is not None:
                self._refuse(vr, value, "it is a fixed parameter; set it before initialization ends")
            elif value not in (HOLD, EXTRAPOLATE, INTERPOLATE):
                self._refuse(vr, value, "set 0 (hold), 1 (extrapolate) or 2 (interpolate)")
            else:
                self._mode = value
                self._refused.pop(vr, None)

    def _refuse(self, vr: int, value: float, why: str) -> None:
        """Log that a value was not taken, and let the next step answer for it."""
        table = self._table
        names = [name for name, _ in table.sizes] + [entry.name for entry in table.variables] + ["input_reconstruction"]
        name = names[vr - 1] if 1 <= vr <= len(names) else f"value reference {vr}"
        self._refused[vr] = f"{name} = {value:.9g}: {why}"
        self.log(self._refused[vr], Fmi2Status.discard)

    # ---- state ------------------------------------------------------------------------------------------------

    def _get_fmu_state(self) -> State:
        self._close_step()
        state = {name: getattr(self, name) for name in _SCALARS}
        state |= {name: getattr(self, name).tolist() for name in _ARRAYS}
        return state | {"guid": self._table.guid, "stepping": self._step is not None}

    def _set_fmu_state(self, state: State) -> None:
        if not usable(state, self._table, {name: getattr(self, name).size for name in _ARRAYS}):
            self._refused[-1] = "the state to restore is damaged or belongs to another FMU; the present one is kept"
            self.log(self._refused[-1], Fmi2Status.discard)
            return
        for name in _SCALARS:
            setattr(self, name, state[name])
        for name in _ARRAYS:
            getattr(self, name)[:] = state[name]
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
        return from_bytes(state)  # what is damaged will be refused
