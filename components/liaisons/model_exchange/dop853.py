"""DOP853 for FMUs of Model Exchange: explicit, of order 8, for equations that are not stiff.

The whole state of the solver can be saved, and steps repeated to the same bits.
"""

from __future__ import annotations

import ctypes as c
import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any, final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from liaisons.base.arrays import Floats
from liaisons.cosim import HEADER, Call, Numbers, cached_library, record_type
from liaisons.errors import RefusedError


@final
class InputMotion:
    """Taylor polynomials of inputs, from their values at the start of a step.

    :param orders: order of each derivative.
    :param rows: index of its input.
    :param derivatives: a buffer, and the indices of the derivatives in it.
    :param held: indices of the inputs among the held ones.
    :ivar values: values of the inputs, shape (inputs,).
    :ivar first: values at ``start`` [s].
    :ivar slopes: coefficients of the powers of time, shape (orders,).
    :ivar read: call that reads the inputs into the values.
    :ivar write: call that sets them.
    """

    read: Call
    write: Call

    def __init__(
        self,
        orders: Sequence[int],
        rows: Sequence[int],
        derivatives: tuple[Numbers, Sequence[int]],
        held: NDArray[np.intp],
    ) -> None:
        self.orders, self.rows, self._moving = (np.array(x, np.intp) for x in (orders, rows, derivatives[1]))
        self._all, self.held = np.asarray(derivatives[0]), held
        self._factorials = np.array([math.factorial(order) for order in orders])
        self.values = np.zeros(held.size)
        self.first, self.slopes, self.start = np.empty(held.size), np.empty(len(orders)), 0.0

    def begin(self, time: float) -> None:
        """Start new polynomials at a time [s] from the present values."""
        self.first[:], self.start = self.values, time
        np.divide(self._all[self._moving], self._factorials, out=self.slopes)

    def evaluate(self, time: float) -> None:
        """Set the values to those of the polynomials at a time [s]."""
        self.values[:] = self.first
        np.add.at(self.values, self.rows, self.slopes * (time - self.start) ** self.orders)


SolverState = tuple[float, float, Floats, Floats]
"""Time and size of the next step [s], states, and their compensation of rounding."""

_HERE = Path(__file__).parent
_RUNTIME = _HERE.parent / "fmu" / "runtime"
_SOURCES = (
    _HERE / "dop853.c",
    HEADER,
    *(_RUNTIME / name for name in ("solver.c", "solver.h")),  # the solver inside our Co-Simulation FMUs
)
_EVENT, _STIFF, _HARD, _REFUSED = range(1, 5)  # as dop853.c has them


_Equations = record_type(_SOURCES[0], "Equations")


def library() -> c.CDLL | None:
    """The compiled library of the solver; None if it cannot be compiled."""
    code = cached_library(_SOURCES, "Model Exchange is solved by CVODE")
    if code is not None:
        code.dop853_room.restype, code.dop853_room.argtypes = c.c_size_t, [c.c_size_t, c.c_size_t]
        code.dop853_step.argtypes = [c.c_void_p, c.c_double]
    return code


@final
class Dop853:
    """Explicit solver with error control.

    :param code: the library of :func:`library`.
    :param instance: address of the FMU's instance.
    :param functions: those of FMI that set the time and the states, and get the derivatives and the event indicators.
    :param signs: event indicators as the caller read them last, shape (indicators,).
    :param tolerance: tolerance relative to states and to their nominal values.
    :ivar states: shape (size,).
    :ivar equations: structure of compiled code, with the last call that the FMU refused.
    :ivar stiff: whether stability limited the last step.
    """

    def __init__(  # noqa: PLR0917 - all of them are needed
        self,
        code: c.CDLL,
        instance: c.c_void_p,
        functions: Sequence[Any],
        size: int,
        signs: Floats,
        tolerance: float,
    ) -> None:
        self._code, self.stiff = code, False
        self.states, self._low, self._size = np.zeros(size), np.zeros(size), np.ones(size)
        addresses = [instance.value, *(c.cast(function, c.c_void_p).value for function in functions)]
        self.equations = _Equations(*addresses, size, signs.size, tolerance)
        self.equations.point(y=self.states, low=self._low, size=self._size, signs=signs)
        self.equations.point(numbers=np.zeros(code.dop853_room(size, signs.size)))
        self._motion: InputMotion | None = None

    def restart(self, time: float, nominals: ArrayLike) -> None:
        """Restart the solver at a time [s] from :attr:`states`, with positive nominal values, shape (size,)."""
        e = self.equations
        self._low[:], self._size[:] = 0.0, nominals
        e.time, e.step, e.met, e.missed, self.stiff = time, 0.0, 0, 0, False

    def set_motion(self, motion: InputMotion | None) -> None:
        """Set the polynomials that inputs follow in the next steps; None: inputs are constant."""
        e = self.equations
        if motion is None:
            e.put = None
            return
        if motion is not self._motion:
            self._motion = motion
            e.inputs, e.terms = motion.values.size, motion.orders.size
            e.point(rows=motion.rows, orders=motion.orders, slopes=motion.slopes)
            e.point(first=motion.first, input=motion.values)
        e.put, e.begin = c.addressof(motion.write.compiled_record()), motion.start

    def step(self, stop: float) -> tuple[float, bool]:
        """Make one step, to ``stop`` [s] at most.

        :returns: its end [s], and whether an indicator has changed its sign there.
        :raises RefusedError: if the FMU refuses a call, see :attr:`equations`, or no step is small enough.
        """
        outcome = self._code.dop853_step(c.byref(self.equations), stop)
        if outcome in {_HARD, _REFUSED}:
            raise RefusedError("no step is small enough")
        self.stiff = outcome == _STIFF
        return self.equations.time, outcome == _EVENT

    def save(self) -> SolverState:
        """State of the solver, for :meth:`restore`."""
        e = self.equations
        return e.time, e.step, self.states.copy(), self._low.copy()

    def restore(self, saved: SolverState) -> None:
        """Return to a saved state."""
        e = self.equations
        e.time, e.step, self.states[:], self._low[:] = saved
        e.met = e.missed = 0

    def close(self) -> None:
        """Do nothing: unlike CVODE, the solver has no memory to release."""
