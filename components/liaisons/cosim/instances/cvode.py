"""CVODE of SUNDIALS, as FMPy ships it: solves y' = f(t, y), stiff or not, and finds where indicators change sign.

FMPy's own class around it makes no single steps and stops at no time that it is told.
"""

from __future__ import annotations

import ctypes as c
from collections.abc import Callable
from functools import cache
from typing import Any, final

import numpy as np
from fmpy.sundials.libraries import (
    sundials_core,
    sundials_cvode,
    sundials_nvecserial,
    sundials_sunlinsoldense,
    sundials_sunmatrixdense,
)
from numpy.typing import ArrayLike, NDArray

from liaisons.errors import RefusedError

Function = Callable[[float, int, int], int]
"""Of time [s], address of the states, address of the result; returns 0, 1 to try a shorter step, -1 to give up."""

ROOT = 2
"""What :meth:`Cvode.step` returns where an indicator has changed its sign."""

_BDF, _ONE_STEP = 2, 2
_NEGATIVE = -np.finfo(float).tiny
_INT, _LONG, _DOUBLE, _POINTER = c.c_int, c.c_int64, c.c_double, c.c_void_p
_RIGHT_HAND_SIDE = c.CFUNCTYPE(_INT, _DOUBLE, _POINTER, _POINTER, _POINTER)
_COMPLAINT = c.CFUNCTYPE(None, _INT, c.c_char_p, c.c_char_p, c.c_char_p, _INT, _POINTER, _POINTER)


def _declared(library: c.CDLL, name: str, *arguments: type, returns: type | None = _INT) -> Callable[..., Any]:
    function = library[name]  # not the one that FMPy has declared
    function.argtypes, function.restype = arguments, returns
    return function


_create_context = _declared(sundials_core, "SUNContext_Create", _INT, _POINTER)
_clear_handlers = _declared(sundials_core, "SUNContext_ClearErrHandlers", _POINTER)
_push_handler = _declared(sundials_core, "SUNContext_PushErrHandler", _POINTER, _COMPLAINT, _POINTER)
_free_context = _declared(sundials_core, "SUNContext_Free", _POINTER)
_vector = _declared(sundials_nvecserial, "N_VNew_Serial", _LONG, _POINTER, returns=_POINTER)
_matrix = _declared(sundials_sunmatrixdense, "SUNDenseMatrix", _LONG, _LONG, _POINTER, returns=_POINTER)
_linear = _declared(sundials_sunlinsoldense, "SUNLinSol_Dense", *[_POINTER] * 3, returns=_POINTER)
_free_vector = _declared(sundials_core, "N_VDestroy", _POINTER, returns=None)
_free_matrix = _declared(sundials_core, "SUNMatDestroy", _POINTER, returns=None)
_free_linear = _declared(sundials_core, "SUNLinSolFree", _POINTER)
_data = _declared(sundials_core, "N_VGetArrayPointer", _POINTER, returns=_POINTER)
_create = _declared(sundials_cvode, "CVodeCreate", _INT, _POINTER, returns=_POINTER)
_init = _declared(sundials_cvode, "CVodeInit", _POINTER, _RIGHT_HAND_SIDE, _DOUBLE, _POINTER)
_root_init = _declared(sundials_cvode, "CVodeRootInit", _POINTER, _INT, _RIGHT_HAND_SIDE)
_set_linear = _declared(sundials_cvode, "CVodeSetLinearSolver", *[_POINTER] * 3)
_set_tolerances = _declared(sundials_cvode, "CVodeSVtolerances", _POINTER, _DOUBLE, _POINTER)
_set_warnings = _declared(sundials_cvode, "CVodeSetMaxHnilWarns", _POINTER, _INT)
_set_stop = _declared(sundials_cvode, "CVodeSetStopTime", _POINTER, _DOUBLE)
_restart = _declared(sundials_cvode, "CVodeReInit", _POINTER, _DOUBLE, _POINTER)
_step = _declared(sundials_cvode, "CVode", _POINTER, _DOUBLE, _POINTER, _POINTER, _INT)
_free = _declared(sundials_cvode, "CVodeFree", _POINTER)


@final
class Cvode:
    """A solver by backward differentiation formulas of variable order.

    :param size: number of states; without any, indicators depend on time alone.
    :param count: number of indicators; as in FMI, one of 0 counts as negative.
    :param tolerance: relative, of states and of their nominal values.
    :ivar states: shape (size,).
    """

    def __init__(self, size: int, count: int, rates: Function, indicators: Function, tolerance: float) -> None:
        self._said, self._tolerance = "", tolerance
        self._time, address = c.c_double(), cache(_data)
        view = cache(lambda address: _numbers(address, count))

        def right_hand_side(t: float, y: int, result: int, _: object) -> int:
            if not size:  # one that stays as it is
                c.memset(address(result), 0, c.sizeof(c.c_double))
                return 0
            return rates(t, address(y), address(result))

        def signs(t: float, y: int, result: int, _: object) -> int:
            status = indicators(t, address(y), result)
            values = view(result)
            values[values == 0.0] = _NEGATIVE
            return status

        def complain(_: int, __: bytes, ___: bytes, message: bytes, *____: object) -> None:
            self._said = message.decode(errors="replace")

        # kept, for SUNDIALS has their addresses only
        self._functions = _RIGHT_HAND_SIDE(right_hand_side), _RIGHT_HAND_SIDE(signs), _COMPLAINT(complain)
        self._context = c.c_void_p()
        _create_context(0, c.byref(self._context))
        _clear_handlers(self._context)
        _push_handler(self._context, self._functions[2], None)
        rows = max(size, 1)
        self._vector, self._errors = (_vector(rows, self._context) for _ in range(2))
        self._matrix = _matrix(rows, rows, self._context)
        self._linear = _linear(self._vector, self._matrix, self._context)
        self._memory = c.c_void_p(_create(_BDF, self._context))
        values, self._largest = (_numbers(_data(vector), rows) for vector in (self._vector, self._errors))
        values[:], self._largest[:] = 0.0, 1.0
        self.states = values[:size]
        self._check(_init(self._memory, self._functions[0], 0.0, self._vector))
        self._check(_set_warnings(self._memory, -1))  # it would write them to the terminal
        self._check(_set_linear(self._memory, self._linear, self._matrix))
        if count:
            self._check(_root_init(self._memory, count, self._functions[1]))

    def restart(self, time: float, nominals: ArrayLike) -> None:
        """Restart at a time [s] from :attr:`states`, with positive nominal values, shape (size,)."""
        self._largest[: self.states.size] = np.asarray(nominals) * self._tolerance
        self._check(_set_tolerances(self._memory, self._tolerance, self._errors))
        self._check(_restart(self._memory, time, self._vector))

    def step(self, stop: float) -> tuple[float, bool]:
        """One step, not beyond a time [s].

        :returns: where it ends [s], and whether an indicator has changed its sign there.
        :raises RefusedError: if there is none whose error is small enough.
        """
        self._check(_set_stop(self._memory, stop))
        status = _step(self._memory, stop, self._vector, c.byref(self._time), _ONE_STEP)
        self._check(status)
        return self._time.value, status == ROOT

    def close(self) -> None:
        """Release it; once."""
        _free(c.byref(self._memory))
        _free_linear(self._linear)
        _free_matrix(self._matrix)
        for vector in (self._vector, self._errors):
            _free_vector(vector)
        _free_context(c.byref(self._context))

    def _check(self, status: int) -> None:
        if status < 0:
            raise RefusedError(f"CVODE: {self._said or status}")


def _numbers(address: int, count: int) -> NDArray[np.float64]:
    return np.ctypeslib.as_array((c.c_double * count).from_address(address))
