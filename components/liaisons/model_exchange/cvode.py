"""CVODE of SUNDIALS by FMPy: solves y' = f(t, y), stiff or not, and finds where indicators change sign.

FMPy's solver creates the problem.  The one here also stops exactly at a time, handles refusals and new nominal values,
gives the reason of a failure, and releases all memory.
"""

from __future__ import annotations

import ctypes as c
from collections.abc import Callable
from sys import byteorder
from typing import Any, final

import numpy as np
from fmpy.sundials import CVodeSolver
from fmpy.sundials.cvode import CV_ROOT_RETURN, CVode, CVodeFree, CVodeReInit, CVodeSVtolerances
from fmpy.sundials.libraries import sundials_core, sundials_cvode
from fmpy.sundials.nvector_serial import NV_DATA_S, N_VDestroy_Serial
from fmpy.sundials.sundials_context import SUNContext_PushErrHandler
from fmpy.sundials.sundials_nvector import N_Vector
from numpy.typing import ArrayLike

from liaisons.base.arrays import Floats
from liaisons.errors import RefusedError

Function = Callable[[float, int, int], int]
"""Function of time [s], addresses of the states and of the result; returns 0, 1 for a shorter step, -1 to fail."""

_ONE_STEP = 2
_NEGATIVE = -np.finfo(float).tiny


@final
class _Data(dict[bytes, int]):
    """Address of the numbers of a vector of SUNDIALS, by the address of the vector; neither changes."""

    def __missing__(self, vector: bytes) -> int:
        self[vector] = address = c.addressof(NV_DATA_S(N_Vector.from_buffer_copy(vector)).contents)
        return address


@final
class Cvode(CVodeSolver):
    """Solver by backward differentiation formulas of variable order.

    :param size: number of states; if it is 0, indicators depend on time alone.
    :param count: number of indicators; as in FMI, an indicator of 0 counts as negative.
    :param tolerance: tolerance relative to states and to their nominal values.
    :ivar states: shape (size,).
    :raises RefusedError: if it cannot be created.
    """

    def __init__(self, size: int, count: int, rates: Function, indicators: Function, tolerance: float) -> None:
        self._error_message, self._time = "", c.c_double()
        self._rates, self._indicators = rates, indicators
        self._count = count
        self._data = _Data()
        self._signs: dict[bytes, Floats] = {}  # by their address

        def set_to_one(numbers: Any, count: int) -> None:
            np.ctypeslib.as_array(numbers, (count,))[:] = 1.0

        unused: Any = None
        try:
            super().__init__(
                size,
                count,
                set_to_one,
                unused,
                unused,
                unused,
                set_to_one,
                unused,
                unused,
                0.0,
                relativeTolerance=tolerance,
            )
        except Exception as error:  # FMPy raises nothing more specific
            raise RefusedError(f"CVODE: {error}") from error
        self.states = np.ctypeslib.as_array(self.px, (self.nx,))[:size]
        sundials_core.SUNContext_ClearErrHandlers(self.sunctx)  # the one below FMPy's would write to the terminal
        SUNContext_PushErrHandler(self.sunctx, self.ehfun_, None)
        self._check(sundials_cvode.CVodeSetMaxHnilWarns(c.c_void_p(self.cvode_mem), -1))

    def f(self, t: float, y: Any, ydot: Any, user_data: object) -> Any:  # noqa: ARG002 - FMPy's name
        """Write the derivatives of the states; returns the status."""
        if self.discrete:  # FMPy's only state, which is constant
            NV_DATA_S(ydot)[0] = 0.0
            return 0
        return self._rates(t, self._data[bytes(y)], self._data[bytes(ydot)])

    def g(self, t: float, y: Any, gout: Any, user_data: object) -> Any:  # noqa: ARG002 - likewise
        """Write the indicators; returns the status."""
        key = bytes(gout)
        if key not in self._signs:
            self._signs[key] = np.ctypeslib.as_array(gout, (self._count,))
        status = self._indicators(t, self._data[bytes(y)], int.from_bytes(key, byteorder))
        values = self._signs[key]
        values[values == 0.0] = _NEGATIVE
        return status

    def ehfun(self, line: Any, func: Any, file: Any, msg: Any, *_: Any, **__: Any) -> None:  # noqa: ARG002 - likewise
        """Store the message of an error."""
        self._error_message = msg.decode(errors="replace")

    def restart(self, time: float, nominals: ArrayLike) -> None:
        """Restart the solver at a time [s] from :attr:`states`, with positive nominal values, shape (size,)."""
        self.npabstol[: self.states.size] = np.asarray(nominals) * self.reltol
        self._check(CVodeSVtolerances(self.cvode_mem, self.reltol, self.abstol))
        self._check(CVodeReInit(self.cvode_mem, time, self.x))

    def step(self, stop: float) -> tuple[float, bool]:  # type: ignore[override] - FMPy's copies the states
        """Make one step, to ``stop`` [s] at most.

        :returns: its end [s], and whether an indicator has changed its sign there.
        :raises RefusedError: if no step has an error that is small enough.
        """
        self._check(sundials_cvode.CVodeSetStopTime(c.c_void_p(self.cvode_mem), c.c_double(stop)))
        status = CVode(self.cvode_mem, stop, self.x, c.byref(self._time), _ONE_STEP)
        self._check(status)
        return self._time.value, status == CV_ROOT_RETURN

    def close(self) -> None:
        """Release the memory of the solver; call it once."""
        memory, self.cvode_mem = c.c_void_p(self.cvode_mem), None  # FMPy releases it when it is collected, too
        CVodeFree(c.byref(memory))
        sundials_core.SUNLinSolFree(c.c_void_p(self.LS))
        sundials_core.SUNMatDestroy(c.c_void_p(self.A))
        for vector in (self.x, self.abstol):
            N_VDestroy_Serial(vector)
        sundials_core.SUNContext_Free(c.byref(self.sunctx))

    def _check(self, status: int) -> None:
        """Raise an error if CVODE returned a negative status."""
        if status < 0:
            raise RefusedError(f"CVODE: {self._error_message or status}")
