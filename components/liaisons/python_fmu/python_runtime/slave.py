"""FMI 2.0 for co-simulation: pythonfmu's slave over the motion of one instance.

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

from pythonfmu import Fmi2Slave
from pythonfmu.enums import Fmi2Status

from .component import load_component, start_values
from .motion import Motion, MotionError
from .states import NUMBERS, State, from_bytes, is_usable, to_bytes

held: list[dict[str, Any]] = []  # see python_backend

_FIXED = "it is a fixed parameter; set it before initialization ends"
_FAILED = "initialization failed before this state was saved; reset and initialize again"
_NEVER = math.nan, math.nan
_TIGHTEST, _LOOSEST = 1e-14, 1e-2  # tolerances are kept between these


@cache
def _finalize_at_exit(resources: str) -> None:
    """Register an exit handler that finalizes the interpreter of pythonfmu's wrapper.

    By itself the wrapper does so when it is unloaded, in memory that is freed by then (pythonfmu 0.7.0,
    ``onLibraryUnload`` of Linux), and some processes end with "corrupted double-linked list".
    """
    for binary in Path(resources).parent.glob("binaries/linux64/*.so"):
        atexit.register(_finalize_interpreter, str(binary))


def _finalize_interpreter(binary: str) -> None:
    """Finalize the interpreter of the wrapper in a loaded binary."""
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
        self._component = component = load_component(resources)
        self._motion = Motion(component)
        unlimited = {i for i in range(len(component.fixed)) if component.first + i not in component.impulses}
        self._settable = unlimited, {i for i in unlimited if not component.fixed[i]}  # before steps, and between them
        self._stepping = False  # initialization has ended
        self._unusable = ""  # why initialization failed
        self._refused: dict[int, str] = {}  # by value reference: messages for the next step
        self._discarded = _NEVER  # start and size of the last step, if it was refused
        self._kept_starts: dict[int, float] = {}  # by value reference: start values that stay where 0 is set
        for kind, vr, value in start_values(resources):  # these replace the component's own
            if kind == "z":
                self._kept_starts = {vr: self._motion.reals[vr - component.first] for vr in component.never_0}
            else:
                (self.set_real if kind == "r" else self.set_integer)([vr], [value])

    # ---- initialization ---------------------------------------------------------------------------------------

    def setup_experiment(self, start_time: float, stop_time: float | None, tolerance: float | None) -> None:
        """Set start time and tolerance; times that are not finite make the instance unusable."""
        n, self._unusable = self._motion.n, ""
        for word, time in (("start", start_time), ("stop", stop_time or 0.0)):
            if not math.isfinite(time):
                self._unusable = f"{word} time = {time:g}: it must be finite"
                self.log(self._unusable, Fmi2Status.error)
                return
        n.t[0] = start_time
        if tolerance is not None:
            n.tolerance[0] = min(max(tolerance, _TIGHTEST), _LOOSEST)
            if n.tolerance[0] != tolerance:
                text = f"tolerance = {tolerance:g} is out of range, {n.tolerance[0]:g} is used"
                self.log(text, Fmi2Status.warning)

    def exit_initialization_mode(self) -> None:
        """Enter the phase of communication steps.

        :raises StartRefused: with the reason.
        """
        try:
            if not self._unusable:  # times are finite
                self._motion.initialize()
                if text := self._motion.changed_rates():
                    self.log(text, Fmi2Status.warning)
        except MotionError as reason:
            self._unusable = f"{reason}; reset, set another value and initialize again"
        self._stepping = True
        self._check_usable()

    def _check_usable(self) -> None:
        """Raise StartRefused if initialization has ended and failed."""
        if self._unusable and self._stepping:
            # The wrapper (0.7.0) releases these now and once more with the instance or at a reset.
            for item in (self, type(self), self.log_queue):
                pythonapi.Py_IncRef(py_object(item))
            raise StartRefused(self._unusable)

    def terminate(self) -> None:
        """Log the last warnings."""
        self._log_warnings(last=True)

    def _log_warnings(self, *, last: bool = False) -> None:
        """Log the new warnings of the motion."""
        for text in self._motion.new_warnings(last=last):
            self.log(text, Fmi2Status.warning)

    # ---- stepping ---------------------------------------------------------------------------------------------

    def do_step(self, current_time: float, step_size: float) -> bool:
        """Do a communication step; return False, with all numbers restored, if it is discarded."""
        numbers, before = self._motion.all, self._motion.all.copy()
        try:
            problem = self._try_step(current_time, step_size)
        except BaseException as reason:  # noqa: BLE001 - e.g. an interrupt; see above
            numbers[:] = before
            why = reason if isinstance(reason, MotionError) else f"broken off by {reason!r}"
            problem = f"{why}; the step from t = {current_time:.9g} is taken back"
        if not problem:
            self._discarded = _NEVER
            self._kept_starts.clear()
            return True
        now, (start, size) = self._motion.n.t[0], self._discarded
        again = start == now and step_size > size * (1 - 1e-9)
        self._discarded = now, step_size
        self.log(problem, Fmi2Status.error if again else Fmi2Status.discard)
        return False

    def _try_step(self, t: float, H: float) -> str:
        """Do the step from t to t + H unless it is refused; returns the reason then, else an empty text.

        :raises MotionError: if the motion does not reach its end.
        """
        if self._unusable or not self._stepping:
            return self._unusable or "initialize the instance first"
        problem = "; ".join(self._refused.values()) or self._time_refusal(t, H)
        self._refused.clear()
        if not problem:
            self._log_warnings()
            self._motion.views.t[0] = t
            self._motion.step(H)
        return problem

    def _time_refusal(self, t: float, H: float) -> str:
        """Reason why a step from t to t + H is refused; empty if it is not."""
        now = self._motion.views.t[0]
        if not 0 < H < math.inf:
            return f"step size = {H:g}: it must be > 0 and finite"
        if not math.isfinite(t):
            return f"step from t = {t:g}: it must be finite"
        if not abs(t - now) <= 1e-6 * H + 1e-12 * abs(t):  # rounding of the importer's clock
            return f"step from t = {t:.15g}: the instance is at t = {now:.15g}"
        if t < t + H < math.inf:
            return ""
        return f"step from t = {t:.15g} of size {H:g}: it must end later, at a finite time"

    # ---- variables --------------------------------------------------------------------------------------------

    def get_real(self, vrs: list[int]) -> list[float]:
        """Return the values of Real variables, calculated anew after inputs were set."""
        self._check_usable()
        if not self._stepping:
            self._motion.apply_function("start")
        self._motion.apply_function("outputs")
        first, numbers = self._component.first, self._motion.reals
        if vrs and not first <= min(vrs) <= max(vrs) < first + len(numbers):
            self.log(f"of the value references {vrs} some belong to no Real variable", Fmi2Status.error)
            return [math.nan] * len(vrs)
        values = [numbers[vr - first] for vr in vrs]
        if not (math.isfinite(sum(values)) or self._unusable):
            self._refuse_infinite(vrs, values)
        return values

    def _refuse_infinite(self, vrs: list[int], values: list[float]) -> None:
        """Log the first value that is not finite, if there is one, and make the next step Discard."""
        for vr, value in zip(vrs, values, strict=True):
            if not math.isfinite(value):
                name, t = self._component.names[vr - 1], self._motion.n.t[0]
                problem = f"{name} = {value:g} at t = {t:.9g}: it must be finite; choose other start values or inputs"
                self.log(problem, Fmi2Status.error)
                if self._stepping:  # the next step repeats it
                    self._refused[vr] = problem
                return

    def set_real(self, vrs: list[int], values: list[float]) -> None:
        """Set Real variables, or refuse the next step with the reason."""
        first, motion, settable = self._component.first, self._motion, self._settable[self._stepping]
        if self._kept_starts:
            values = [self._replaced_zero(vr, value) for vr, value in zip(vrs, values, strict=True)]
        new = dict(zip(vrs, values, strict=True))
        for vr, value in new.items():
            if not (vr - first in settable and math.isfinite(value)) and (why := self._refusal(vr - first, value)):
                self._refuse_value(vr, value, why)
                return
        reals, parameters = motion.reals, first + motion.n.k.size
        for vr, value in new.items():
            # With a tunable parameter the energy may jump, too.
            if vr < parameters and reals[vr - first] != value:
                motion.views.jumped[0] = 1
            reals[vr - first] = value
        for vr in self._refused.keys() & new.keys():
            del self._refused[vr]
        if self._stepping:
            motion.apply_inputs()

    def _refusal(self, index: int, value: float) -> str:
        """Reason why a value is refused; empty if it is not."""
        component, reals = self._component, self._motion.reals
        if not 0 <= index < len(reals):
            return "it belongs to no Real variable"
        if index >= len(component.fixed):
            return "it is calculated; set parameters and inputs"
        if self._stepping and component.fixed[index]:
            return _FIXED
        if self._stepping and value != reals[index] and component.first + index in component.impulses:
            return "a Python FMU takes no impulses; build it with backend='native'"
        if not math.isfinite(value):
            return f"set a finite number; it stays {reals[index]:.9g}"
        return ""

    def _replaced_zero(self, vr: int, value: float) -> float:
        """The start value instead of a 0 that is ignored before the first step, as by ``core_ignore_zeros``."""
        if value != 0 or vr not in self._kept_starts:
            return value
        start, name = self._kept_starts[vr], self._component.names[vr - 1]
        self.log(f"{name} = 0 before the first step: it stays {start:.9g}", Fmi2Status.warning)
        return start

    def get_integer(self, vrs: list[int]) -> list[int]:
        """Return values of Integer variables: structural sizes and ``input_reconstruction``."""
        integers = dict(enumerate(self._component.sizes, 1))
        integers[len(self._component.names)] = int(self._motion.n.mode[0])
        if not integers.keys() >= set(vrs):
            self.log(f"of the value references {vrs} some belong to no Integer variable", Fmi2Status.error)
        return [integers.get(vr, 0) for vr in vrs]

    def set_integer(self, vrs: list[int], values: list[int]) -> None:
        """Set ``input_reconstruction``; refuse other variables, and that one once steps have begun."""
        for vr, value in zip(vrs, values, strict=True):
            if vr != len(self._component.names):
                self._refuse_value(vr, value, "it is no Integer variable that can be set")
            elif self._stepping:
                self._refuse_value(vr, value, _FIXED)
            elif value not in (0, 1, 2):
                self._refuse_value(vr, value, "set 0 (hold), 1 (extrapolate) or 2 (interpolate)")
            else:
                self._motion.n.mode[0] = value
                self._refused.pop(vr, None)

    def _refuse_value(self, vr: int, value: float, why: str) -> None:
        """Log the refusal of a value, and make the next step Discard with the same message."""
        name = dict(enumerate(self._component.names, 1)).get(vr, f"value reference {vr}")
        self._refused[vr] = f"{name} = {value:.9g}: {why}"
        self.log(self._refused[vr], Fmi2Status.discard)

    # ---- state ------------------------------------------------------------------------------------------------

    def _get_fmu_state(self) -> State:
        """Return all numbers of the instance, its GUID and its phase."""
        state: State = {name: getattr(self._motion.n, name).tolist() for name in NUMBERS}
        return state | {"guid": self._component.guid, "stepping": self._stepping, "unusable": self._unusable}

    def _set_fmu_state(self, state: State) -> None:
        """Restore a saved state, or refuse the next step if it is damaged or foreign."""
        if not is_usable(state, self._get_fmu_state()):
            self._refused[-1] = "the state to restore is damaged or belongs to another FMU; the present one is kept"
            self.log(self._refused[-1], Fmi2Status.discard)
            return
        for name in NUMBERS:
            getattr(self._motion.n, name)[:] = state[name]
        self._stepping = state["stepping"]
        self._unusable = state["unusable"] and _FAILED  # no message shows what bytes hold
        self._refused.clear()
        self._discarded = _NEVER

    _fmu_state_to_bytes = staticmethod(to_bytes)
    _fmu_state_from_bytes = staticmethod(from_bytes)  # damaged ones are refused when they are set
