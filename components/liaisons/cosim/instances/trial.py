"""Starts an FMU in a process of its own, for :mod:`liaisons.cosim.running.probe`; writes each stage to stdout.

Needs little but the standard library, so that it takes some hundredths of a second.  Statuses do not matter: what an
FMU refuses it will refuse again, with a message.
"""

import ctypes as c
import json
import os
import sys
from collections.abc import Callable
from typing import Any

from liaisons.base.processes import die_with_parent

NUMBERS = {
    "Real": c.c_double,
    "Integer": c.c_int,
    "Float32": c.c_float,
    "Float64": c.c_double,
    **{f"Int{bits}": getattr(c, f"c_int{bits}") for bits in (8, 16, 32, 64)},
    **{f"UInt{bits}": getattr(c, f"c_uint{bits}") for bits in (8, 16, 32, 64)},
}
"""Numbers of FMI by the type in the names of its functions."""
_LOG_2 = c.CFUNCTYPE(None, c.c_void_p, c.c_char_p, c.c_int, c.c_char_p, c.c_char_p)  # and what the text is about
_LOG_3 = c.CFUNCTYPE(None, c.c_void_p, c.c_int, c.c_char_p, c.c_char_p)
_ALLOCATE = c.CFUNCTYPE(c.c_void_p, c.c_size_t, c.c_size_t)
_RELEASE = c.CFUNCTYPE(None, c.c_void_p)


def main() -> None:
    """Load, instantiate, initialize, step once; in Model Exchange, the event iteration is the step.

    Stdin is a list: the parent's id, version of FMI, whether it is for Model Exchange, library; name, GUID, resources
    (a URI for FMI 2.0, a path for FMI 3.0); start values as types, references, values, whether they are structural;
    begin and size of the step [s].
    """
    parent, version, is_model_exchange, library, words, *rest = json.load(sys.stdin)
    die_with_parent(parent)
    _say("loaded")
    functions = c.CDLL(library)
    _say("instantiated")
    try:
        made, *_kept = _instantiated(functions, version, is_model_exchange, [word.encode() for word in words])
        if made:
            _say("initialized")
            prefix, pointer = f"fmi{version}", c.c_void_p(made)
            _start(lambda name, *rest: functions[prefix + name](pointer, *rest), version == 2, is_model_exchange, *rest)
    finally:
        _say("released")  # else the FMU has ended the process, whatever its exit status
    os._exit(0)  # some FMUs crash when the process ends, which it does not do in a run


def _say(stage: str) -> None:
    sys.stdout.write(f"\nSTAGE {stage}\n")
    sys.stdout.flush()


Starts = list[tuple[str, list[int], list[Any], bool]]


def _instantiated(library: c.CDLL, version: int, is_model_exchange: bool, words: list[bytes]) -> tuple[Any, ...]:
    """Address of the instance, 0 if it is refused, and what it calls."""
    kind = "" if version == 2 else "ModelExchange" if is_model_exchange else "CoSimulation"
    instantiate = library[f"fmi{version}Instantiate{kind}"]
    instantiate.restype = c.c_void_p
    if version == 3:
        log, no = _LOG_3(lambda *_: None), c.c_bool(False)
        own, last = ((), ()) if is_model_exchange else ((no, no, None, c.c_size_t(0)), (None,))
        return instantiate(*words, no, no, *own, None, log, *last), log
    libc = c.CDLL(None if os.name == "posix" else "msvcrt")
    libc.calloc.restype, libc.calloc.argtypes = c.c_void_p, [c.c_size_t, c.c_size_t]
    libc.free.restype, libc.free.argtypes = None, [c.c_void_p]
    functions = _LOG_2(lambda *_: None), _ALLOCATE(libc.calloc), _RELEASE(libc.free)
    addresses = (c.cast(function, c.c_void_p) for function in functions)
    callbacks = (c.c_void_p * 5)(*addresses, None, None)  # fmi2CallbackFunctions
    name, *others = words
    return instantiate(name, int(not is_model_exchange), *others, c.byref(callbacks), 0, 0), functions, callbacks


def _start(call: Callable[..., int], two: bool, is_model_exchange: bool, starts: Starts, step: list[float]) -> None:
    """Initialize and step by calls of the functions of FMI 2.0 or 3.0."""
    boolean = c.c_int if two else c.c_bool
    no, (begin, size, zero) = boolean(0), map(c.c_double, (*step, 0.0))

    def assign(structural: bool) -> None:
        for kind, references, values, _ in (start for start in starts if start[3] == structural):
            counted = (c.c_uint * len(references))(*references), c.c_size_t(len(references))
            sizes = [] if two else [c.c_size_t(len(values))]
            call(f"Set{kind}", *counted, _buffer(kind, values, boolean), *sizes)

    experiment = no, zero, begin, no, zero
    if two:
        call("SetupExperiment", *experiment)
        experiment = ()
    if any(start[3] for start in starts):
        call("EnterConfigurationMode")
        assign(structural=True)
        call("ExitConfigurationMode")
    assign(structural=False)
    if call("EnterInitializationMode", *experiment) > 1 or call("ExitInitializationMode") > 1:
        return
    _say("stepped")
    flags, last = [c.byref(c.c_bool()) for _ in range(5)], c.byref(c.c_double())
    if not is_model_exchange:
        call("DoStep", begin, size, boolean(1), *(() if two else (*flags[:3], last)))
    elif two:
        call("NewDiscreteStates", c.byref((c.c_double * 8)()))  # room for fmi2EventInfo
    else:
        call("UpdateDiscreteStates", *flags, last)


def _buffer(kind: str, values: list[Any], boolean: type) -> Any:
    if kind == "String":
        return (c.c_char_p * len(values))(*(text.encode() for text in values))
    return (NUMBERS.get(kind, boolean) * len(values))(*values)


if __name__ == "__main__":
    main()
