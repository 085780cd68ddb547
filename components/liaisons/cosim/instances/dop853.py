"""DOP853 for FMUs of Model Exchange: explicit, of order 8, for equations that are not stiff.

Its whole state can be saved, so that steps are rolled back and repeated to the same bits.
"""

from __future__ import annotations

import ctypes as c
import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any, final

import numpy as np
from numpy.typing import ArrayLike

from liaisons.base.libraries import compiled_library
from liaisons.base.structures import Record, structure_fields
from liaisons.cosim.arrays import Indices, Numbers, Vector, as_indices
from liaisons.cosim.compiled.calls import HEADER, Call
from liaisons.errors import RefusedError


@final
class InputMotion:
    """Taylor polynomials of inputs, from their values at the start of a step.

    :param orders: of the derivatives, each of the input with the number in ``rows``.
    :param derivatives: a buffer, and the indices of the derivatives in it.
    :param places: indices of the inputs among the held ones.
    :ivar values: of the inputs, shape (inputs,).
    :ivar first: these at ``start`` [s].
    :ivar slopes: the factors of the powers of time, shape (orders,).
    :ivar read: a call that reads the inputs into the values; ``write``: one that sets them.
    """

    read: Call
    write: Call

    def __init__(
        self,
        orders: Sequence[int],
        rows: Sequence[int],
        derivatives: tuple[Numbers, Sequence[int]],
        places: Indices,
    ) -> None:
        self.orders, self.rows, self._moving = map(as_indices, (orders, rows, derivatives[1]))
        self._all, self.places = np.asarray(derivatives[0]), places
        self._factorials = np.array([math.factorial(order) for order in orders])
        self.values = np.zeros(places.size)
        self.first, self.slopes, self.start = np.empty(places.size), np.empty(len(orders)), 0.0

    def begin(self, time: float) -> None:
        """Start the polynomials from the present values at a time [s]."""
        self.first[:], self.start = self.values, time
        np.divide(self._all[self._moving], self._factorials, out=self.slopes)

    def evaluate(self, time: float) -> None:
        """Set the values to those at a time [s]."""
        self.values[:] = self.first
        np.add.at(self.values, self.rows, self.slopes * (time - self.start) ** self.orders)


Memory = tuple[float, float, Vector, Vector]
"""Time and size of the next step [s], states, and their compensation of rounding."""

_HERE = Path(__file__).parent
_RUNTIME = _HERE.parents[1] / "fmu" / "runtime"
_SOURCES = (
    _HERE / "dop853.c",
    HEADER,
    *(_RUNTIME / name for name in ("solver.c", "solver.h")),  # the solver inside our Co-Simulation FMUs
)
_EVENT, _STIFF, _HARD, _REFUSED = range(1, 5)  # as dop853.c has them


@final
class _Equations(Record):
    _fields_ = structure_fields(_SOURCES[0], "Equations")


def library() -> c.CDLL | None:
    """The compiled solver; None if it cannot be compiled."""
    code = compiled_library(_SOURCES, "Model Exchange is solved by CVODE")
    if code is not None:
        code.dop853_room.restype, code.dop853_room.argtypes = c.c_size_t, [c.c_size_t, c.c_size_t]
        code.dop853_step.argtypes = [c.c_void_p, c.c_double]
    return code


@final
class Dop853:
    """A solver with error control, for equations that are not stiff.

    :param code: see :func:`library`.
    :param instance: of the FMU; ``functions`` of FMI that set the time and the states, and get their derivatives and
        the event indicators.
    :param signs: event indicators as the caller last read them, shape (indicators,).
    :param tolerance: relative, of states and of their nominal values.
    :ivar states: shape (size,).
    :ivar stiff: whether stability has limited the last step.
    :ivar refusal: which of time, inputs, states, derivatives and indicators the FMU has refused last, counted from 1,
        and the status.
    """

    def __init__(  # noqa: PLR0917 - all of them are needed
        self,
        code: c.CDLL,
        instance: c.c_void_p,
        functions: Sequence[Any],
        size: int,
        signs: Vector,
        tolerance: float,
    ) -> None:
        self._code, self.stiff = code, False
        self.states, self._low, self._size = np.zeros(size), np.zeros(size), np.ones(size)
        addresses = [instance.value, *(c.cast(function, c.c_void_p).value for function in functions)]
        self._equations = _Equations(*addresses, size, signs.size, tolerance)
        self._equations.point(y=self.states, low=self._low, size=self._size, signs=signs)
        self._equations.point(numbers=np.zeros(code.dop853_room(size, signs.size)))
        self._motion: InputMotion | None = None

    @property
    def refusal(self) -> tuple[int, int]:
        return self._equations.function, self._equations.status

    @property
    def last_time(self) -> float:
        """The last time that the FMU was set to [s]."""
        return self._equations.at

    def restart(self, time: float, nominals: ArrayLike) -> None:
        """Restart at a time [s] from :attr:`states`, with positive nominal values, shape (size,)."""
        e = self._equations
        self._low[:], self._size[:] = 0.0, nominals
        e.time, e.step, e.met, e.missed, self.stiff = time, 0.0, 0, 0, False

    def follow(self, motion: InputMotion | None) -> None:
        """Let inputs follow polynomials from now on; None: hold them."""
        e = self._equations
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
        """One step, not beyond a time [s].

        :returns: where it ends [s], and whether an indicator has changed its sign there.
        :raises RefusedError: if the FMU refuses something, see :attr:`refusal`, or no step is small enough.
        """
        outcome = self._code.dop853_step(c.byref(self._equations), stop)
        if outcome in {_HARD, _REFUSED}:
            raise RefusedError("no step is small enough")
        self.stiff = outcome == _STIFF
        return self._equations.time, outcome == _EVENT

    def save(self) -> Memory:
        """The present state, for :meth:`restore`."""
        e = self._equations
        return e.time, e.step, self.states.copy(), self._low.copy()

    def restore(self, memory: Memory) -> None:
        """Restore a state."""
        e = self._equations
        e.time, e.step, self.states[:], self._low[:] = memory
        e.met = e.missed = 0

    def close(self) -> None:
        """Do nothing, as there is no memory to release."""
