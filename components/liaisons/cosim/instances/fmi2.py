"""Instances of FMUs of FMI 2.0."""

from __future__ import annotations

import shutil
from abc import ABC
from collections.abc import Callable, Sequence
from contextlib import suppress
from ctypes import CDLL, Array, addressof, byref, c_char_p, c_double, c_int, c_uint32, c_void_p
from functools import cache
from operator import attrgetter
from tempfile import TemporaryDirectory
from typing import Any, ClassVar, final

import fmpy
from fmpy.fmi2 import (
    fmi2CallbackAllocateMemoryTYPE,
    fmi2CallbackFreeMemoryTYPE,
    fmi2CallbackFunctions,
    fmi2CallbackLoggerTYPE,
    fmi2LastSuccessfulTime,
    fmi2Terminated,
)
from fmpy.logging import logging

from liaisons.cosim.compiled.calls import (
    DERIVE_2,
    DISCARD,
    ORDERS_2,
    STEP_2,
    TRANSFER_2,
    Action,
    Call,
    Numbers,
    pointer_to,
)
from liaisons.cosim.instances.buffer_layouts import counted_buffer, value_references
from liaisons.cosim.instances.loading import FMU2CoSimulation, Loaded
from liaisons.cosim.instances.protocol import Scalars
from liaisons.errors import SimulationError

_instances: dict[int, Instance2] = {}  # by their ids, which are the environments of their callbacks


class Instance2(Loaded, ABC):
    """An FMI 2.0 instance."""

    prefix = "fmi2"
    functions: ClassVar = {
        "set": "fmi2SetReal",
        "step": "fmi2DoStep",
        "get": "fmi2GetReal",
        "save": "fmi2GetFMUstate",
        "restore": "fmi2SetFMUstate",
        "derive": "fmi2GetDirectionalDerivative",
        "shape": "fmi2SetRealInputDerivatives",
        "slope": "fmi2GetRealOutputDerivatives",
    }
    types: ClassVar = {"Real": c_double, "Integer": c_int, "Boolean": c_int, "String": c_char_p}
    flag = c_int
    takes_size = False
    transfer_kind = TRANSFER_2

    def _instantiate(self) -> None:
        _instances[id(self)] = self
        self.fmpy_instance.instantiate(callbacks=_callbacks(id(self)), loggingOn=True)

    def directional_derivatives(self, unknowns: Scalars, knowns: Scalars, seed: Numbers, values: Numbers) -> Call:
        rows, columns = _reference_array(unknowns), _reference_array(knowns)
        along, product = pointer_to(seed), pointer_to(values)
        call = self._prepare("derive", *counted_buffer(rows), *counted_buffer(columns), along, product)
        call.buffers = more = (c_void_p * 2)(addressof(columns), addressof(along))
        record = {"source": rows, "count": len(rows), "values": product, "size": len(columns), "more": more}
        return call.set_record(DERIVE_2, self._pointer.value, **record)

    def _close_private(self) -> None:
        _instances.pop(id(self), None)
        with suppress(AttributeError):
            # pythonfmu 0.7 stays loaded, and at the end of the process frees its interpreter twice, unless it has let
            # go of it before; it takes hold of it again when it is needed
            self.fmpy_instance.dll["finalizePythonInterpreter"]()


@final
class CoSimulation2(Instance2):
    """An FMI 2.0 co-simulation instance."""

    fmpy_class = FMU2CoSimulation

    def stepper(self, time: c_double, size: c_double) -> Call:
        self._span = time, size
        call = self._prepare("step", time, size, c_int(1))
        return call.set_record(STEP_2, self._pointer.value)

    def input_derivatives(self, variables: Scalars, orders: Sequence[int], values: Numbers) -> Call:
        return self._derivative_call("shape", variables, orders, values)

    def output_derivatives(self, variables: Scalars, orders: Sequence[int], values: Numbers) -> Call:
        return self._derivative_call("slope", variables, orders, values)

    def _derivative_call(self, action: Action, variables: Scalars, orders: Sequence[int], values: Numbers) -> Call:
        """Call that sets or gets derivatives of variables by time."""
        references, numbers, buffer = _reference_array(variables), (c_int * len(orders))(*orders), pointer_to(values)
        call = self._prepare(action, *counted_buffer(references), numbers, buffer)
        record = {"source": references, "count": len(references), "values": buffer, "more": numbers}
        return call.set_record(ORDERS_2, self._pointer.value, **record)

    def _requested_end_time(self) -> float | None:
        if any(status >= DISCARD for status, _ in self._messages):
            return None  # it refuses, and says why: pythonfmu's wrapper discards no step without asking for the end
        messages, ended, reached = self._messages.copy(), c_int(), c_double()
        with suppress(SimulationError):  # these functions are missing from many an FMU
            self._call("fmi2GetBooleanStatus", fmi2Terminated, byref(ended))
            if ended.value:
                self._call("fmi2GetRealStatus", fmi2LastSuccessfulTime, byref(reached))
                return reached.value
        self._messages = messages
        return None


def _reference_array(variables: Scalars) -> Array[c_uint32]:
    return value_references(tuple(map(attrgetter("reference"), variables)))


@fmi2CallbackLoggerTYPE
def _log(environment: int | None, name: bytes | None, status: int, _category: bytes, message: bytes | None) -> None:
    """Log a message of the instance that the environment, else the name, tells."""
    instance = _instances.get(environment or 0)
    if instance is None:  # an FMU that does not hand the environment back
        instance = next((i for i in _instances.values() if i.name.encode() == name), None)
    if instance is not None:
        instance._log_message(status, message)  # noqa: SLF001 - C cannot call a method


_allocate = fmi2CallbackAllocateMemoryTYPE(fmpy.calloc)
_release = fmi2CallbackFreeMemoryTYPE(fmpy.free)


def _callbacks(environment: int) -> fmi2CallbackFunctions:
    """Callback functions of an instance, whose environment is its id."""
    callbacks = fmi2CallbackFunctions(_log, _allocate, _release, componentEnvironment=environment)
    # The proxy formats the variadic message.  It remembers one logger, the last that was added: hence one logger for
    # all instances, told apart by the environment.
    _add_logger_proxy()(byref(callbacks))
    return callbacks


@cache
def _add_logger_proxy() -> Callable[[Any], None]:
    """FMPy's function that adds the proxy, in a copy of its library: the logger that FMPy remembers stays its own."""
    with TemporaryDirectory(ignore_cleanup_errors=True) as folder:  # not needed once it is loaded
        return CDLL(str(shutil.copy(logging._name, folder))).addLoggerProxy  # noqa: SLF001 - the path of the library
