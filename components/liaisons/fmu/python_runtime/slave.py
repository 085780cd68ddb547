"""The FMI face of a component: pythonfmu's slave over the numbers of one instance.

Variables live in one array, where their value references say: parameters, inputs, everything else.
Outputs are evaluated when they are read, once per change.

pythonfmu's wrapper knows three answers: OK; Discard, from ``do_step`` alone; Fatal, when a method raises, after
which it goes on with freed objects.  So nothing here raises: what is refused is logged at once, changes nothing,
and makes the next step Discard with the same message.  The wrapper answers Discard with the wish to terminate, so that
importers end there; the log has a step that is refused once more, as long or longer, as an error.
"""

from __future__ import annotations

import atexit
import math
import os
import sys
from contextlib import suppress
from ctypes import CDLL
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from pythonfmu import Fmi2Slave
from pythonfmu.enums import Fmi2Status

from .calls import Call, view
from .motion import EXTRAPOLATE, HOLD, INTERPOLATE, LOOSEST, TIGHTEST, Step
from .prescribed import Prescribed
from .states import State, from_bytes, to_bytes, usable
from .table import load, starts

held: list[dict[str, Any]] = []  # see python_backend

# What makes up the state of an instance, beside whether it is stepping.
_ARRAYS = ("_t", "_k", "_given", "_u", "_y", "_m", "_past", "_size")
_SCALARS = ("_mode", "_tolerance", "_started", "_jumped", "_unusable")


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
        self._step: Step | None = None  # there is one from the end of initialization on
        self._settable = set(range(self._first, self._first_output))
        self._started = False  # y and m belong to the parameters and inputs as they are
        self._remembered = True  # m belongs to the end of the last step
        self._jumped = False  # something was set since then: the energy may have jumped
        self._evaluated = False  # the outputs belong to all the rest
        self._unusable = ""  # why initialization failed
        self._refused: dict[int, str] = {}  # by value reference: calls that the next step answers for
        self._discarded = math.nan, math.nan  # from when and how long the last step was that was refused

        f = table.functions
        # by value reference; those below the first belong to no Real variable
        self._values = np.array([math.nan] * self._first + [entry.start or 0.0 for entry in table.variables])
        self._k = self._values[self._first : self._first_input]
        self._given = self._values[self._first_input : self._first_output]  # inputs as set by the importer
        self._first_drawn = self._first_output + len(table.outputs)
        self._z, drawn = self._values[self._first_output : self._first_drawn], self._values[self._first_drawn :]
        states = f["start"].numel_out(0)
        self._now = np.zeros(1 + states + self._given.size)
        self._t, self._y, self._u = np.split(self._now, [1, 1 + states])  # present time, state, inputs
        self._m = np.zeros(f["start"].numel_out(1))
        self._y_jumped, self._m_next = self._y.copy(), self._m.copy()
        self._H, self._size = np.zeros(1), np.ones(states)
        self._number, self._now_view, self._H_view = map(view, (self._values, self._now, self._H))
        self._u_view, self._given_view = view(self._u), view(self._given)
        point = (self._t, self._y, self._u, self._k)
        self._start = Call(f["start"], (self._t, self._u, self._k), (self._y, self._m))
        self._measure = Call(f["nominals"], point, (self._size,))
        self._output = Call(f["outputs"], (*point, self._m), (self._z,))
        self._draw = Call(f["draw"], point, (drawn,)) if "draw" in f else None
        self._jump = Call(f["jump"], (*point, self._m), (self._y_jumped,))
        self._remember = Call(f["remember"], (*point, self._m), (self._m_next,))
        self._instants = np.zeros(f["events"].numel_out(0))
        self._find_instants = Call(f["events"], (self._k,), (self._instants,))
        self._prescribed = Prescribed(table, now=self._now, given=self._given, k=self._k, m=self._m, size=self._size)
        self._past = self._prescribed.past.ravel()  # the same numbers, as those of a saved state
        self._project = Call(f["project"], point, (self._y_jumped,)) if "project" in f else None
        for kind, vr, value in starts(resources):
            (self.set_real if kind == "r" else self.set_integer)([vr], [value])

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
        if self._unusable:  # times that are not finite
            self._enter(stepping=True)
            return
        self._initialize()
        self._measure.run()
        self._size[~((self._size > 0) & np.isfinite(self._size))] = 1.0
        self._unusable = self._bad_start()
        if self._unusable:
            self._unusable += "; reset, set another value and initialize again"
            self.log(self._unusable, Fmi2Status.error)
        self._jumped = self._evaluated = False
        self._prescribed.follow()
        self._enter(stepping=True)

    def terminate(self) -> None:
        self._warn()

    def _warn(self) -> None:
        for text in self._prescribed.warnings(self._mode):
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
        return failed or ("" if np.isfinite(self._m).all() else "the initial energy is not finite")

    def _enter(self, *, stepping: bool) -> None:
        """Enter the phase before the end of initialization, where all can be set, or the one after it."""
        parameters = enumerate(self._table.parameters, self._first)
        fixed = [vr for vr, entry in parameters if stepping and entry.variability == "fixed"]
        self._settable = set(range(self._first, self._first_output)).difference(fixed)
        if not stepping:
            self._step = None
        elif self._step is None or (self._step.mode, self._step.tolerance) != (self._mode, self._tolerance):
            arrays = {"now": self._now, "H": self._H, "given": self._given, "k": self._k, "size": self._size}
            self._step = Step(self._table, self._mode, self._tolerance, **arrays)

    # ---- stepping ---------------------------------------------------------------------------------------------

    def do_step(self, current_time: float, step_size: float) -> bool:
        now = self._now_view
        before, past, memory = now.tobytes(), self._past.copy(), self._m.copy()
        try:
            problem = self._attempt(current_time, step_size)
        except BaseException as reason:  # noqa: BLE001 - an interrupt, say; see above
            problem = f"broken off by {reason!r}; the step from t = {current_time:.9g} is taken back"
        if not problem:
            self._discarded = math.nan, math.nan
            return True
        now[:] = memoryview(before).cast("d")
        self._past[:], self._m[:] = past, memory
        begin, size = self._discarded
        again = begin == now[0] and step_size > size * (1 - 1e-9)
        self._discarded = now[0], step_size
        self.log(problem, Fmi2Status.error if again else Fmi2Status.discard)
        return False

    def _attempt(self, t: float, H: float) -> str:
        """Do the step from t to t + H; empty, or what stands in its way."""
        step, now = self._step, self._now_view
        if step is None or self._unusable:
            return self._unusable or "initialize the instance first"
        if self._refused:
            problem = "; ".join(self._refused.values())
            self._refused.clear()
            return problem
        wrong = self._wrong_times(t, H)
        if wrong:
            return wrong
        self._warn()
        now[0], self._H_view[0] = t, H
        if self._mode != INTERPOLATE:
            self._take_inputs()
        self._prescribed.compare(self._mode, H)
        if self._jumped:
            self._prescribed.leap(self._tolerance)
            self._jump.run()
            self._y[:] = self._y_jumped
        self._prescribed.depart()
        if not step.advance():
            return f"{step.obstacle()}; the step from t = {t:.9g} is taken back"
        step.next[0] = self._at_instant(t + H) if self._instants.size else t + H
        now[:] = step.next
        self._prescribed.arrive(self._mode, H)
        if self._project is not None:  # back onto constraints and unit quaternions
            self._project.run()
            self._y[:] = self._y_jumped
        self._remembered = self._jumped = self._evaluated = False
        return ""

    def _wrong_times(self, t: float, H: float) -> str:
        """Why there is no step from t to t + H; empty if there is."""
        here = self._t[0]
        if not 0 < H < math.inf:
            return f"step size = {H:g}: it must be > 0 and finite"
        if not math.isfinite(t):
            return f"step from t = {t:g}: it must be finite"
        if not abs(t - here) <= 1e-6 * H + 1e-12 * abs(t):  # rounding of the importer's clock
            return f"step from t = {t:.15g}: the instance is at t = {here:.15g}"
        if not t < t + H < math.inf:
            return f"step from t = {t:.15g} of size {H:g}: it must end later, at a finite time"
        return ""

    def _at_instant(self, end: float) -> float:
        """The end of a step, moved onto an instant that it means and misses by rounding: 3 * 0.3 is not 0.9."""
        self._find_instants.run()
        near = (instant for instant in self._instants.tolist() if abs(instant - end) <= 1e-12 * (1 + abs(end)))
        return next(near, end)

    def _take_inputs(self) -> None:
        """What the importer gave becomes the inputs of the present time."""
        if self._u_view.tobytes() != self._given_view.tobytes():
            self._close_step()
            self._u_view[:] = self._given_view
            self._jumped = True
            self._evaluated = False

    def _close_step(self) -> None:
        """Remember the end of the last step; put off until it matters."""
        if not self._remembered:
            self._remember.run()
            self._m[:] = self._m_next
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
        self._initialize()
        self._close_step()
        self._output.run()
        if self._unusable:
            self._z[:] = math.nan
        self._evaluated = True

    def set_real(self, vrs: list[int], values: list[float]) -> None:
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
        elif self._mode != INTERPOLATE:
            self._take_inputs()

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
        self._discarded = math.nan, math.nan
        self._remembered, self._evaluated = True, False
        self._started &= state["stepping"]
        self._enter(stepping=state["stepping"])

    @staticmethod
    def _fmu_state_to_bytes(state: State) -> bytes:
        return to_bytes(state)

    @staticmethod
    def _fmu_state_from_bytes(state: bytes) -> State:
        return from_bytes(state)  # what is damaged will be refused
