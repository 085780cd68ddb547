"""Starts an FMU in a process of its own, for :mod:`liaisons.cosim.running.probe`; writes each stage to stdout.

Needs little but the standard library, so that it takes some hundredths of a second.  Statuses do not matter: what an
FMU refuses it will refuse again, with a message.
"""

import ctypes as c
import json
import os
import sys
from typing import Any

from liaisons.processes import die_with_parent

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
        (_start_2 if version == 2 else _start_3)(functions, is_model_exchange, [word.encode() for word in words], *rest)
    finally:
        _say("released")  # else the FMU has ended the process, whatever its exit status
    os._exit(0)  # some FMUs crash when the process ends, which it does not do in a run


def _say(stage: str) -> None:
    sys.stdout.write(f"\nSTAGE {stage}\n")
    sys.stdout.flush()


Starts = list[tuple[str, list[int], list[Any], bool]]


def _start_2(functions: c.CDLL, is_model_exchange: bool, words: list[bytes], starts: Starts, step: list[float]) -> None:
    library = c.CDLL(None if os.name == "posix" else "msvcrt")
    library.calloc.restype, library.calloc.argtypes = c.c_void_p, [c.c_size_t, c.c_size_t]
    library.free.restype, library.free.argtypes = None, [c.c_void_p]
    log, allocate, release = _LOG_2(lambda *_: None), _ALLOCATE(library.calloc), _RELEASE(library.free)
    functions_and_environment = *(c.cast(function, c.c_void_p) for function in (log, allocate, release)), None, None
    callbacks = (c.c_void_p * 5)(*functions_and_environment)  # fmi2CallbackFunctions
    functions.fmi2Instantiate.restype = c.c_void_p
    name, guid, resources = words
    made = functions.fmi2Instantiate(name, int(not is_model_exchange), guid, resources, c.byref(callbacks), 0, 0)
    if not made:
        return
    _say("initialized")
    pointer = c.c_void_p(made)
    begin, size = map(c.c_double, step)
    functions.fmi2SetupExperiment(pointer, 0, c.c_double(0), begin, 0, c.c_double(0))
    for kind, references, values, _ in starts:
        buffer = _buffer(kind, values, c.c_int)
        functions[f"fmi2Set{kind}"](pointer, (c.c_uint * len(references))(*references), c.c_size_t(len(values)), buffer)
    if functions.fmi2EnterInitializationMode(pointer) > 1 or functions.fmi2ExitInitializationMode(pointer) > 1:
        return
    _say("stepped")
    if is_model_exchange:
        functions.fmi2NewDiscreteStates(pointer, c.byref((c.c_double * 8)()))  # room for fmi2EventInfo
        return
    functions.fmi2DoStep(pointer, begin, size, 1)


def _start_3(functions: c.CDLL, is_model_exchange: bool, words: list[bytes], starts: Starts, step: list[float]) -> None:
    log, no = _LOG_3(lambda *_: None), c.c_bool(False)
    if is_model_exchange:
        functions.fmi3InstantiateModelExchange.restype = c.c_void_p
        made = functions.fmi3InstantiateModelExchange(*words, no, no, None, log)
    else:
        functions.fmi3InstantiateCoSimulation.restype = c.c_void_p
        nothing = (None, c.c_size_t(0), None)
        made = functions.fmi3InstantiateCoSimulation(*words, no, no, no, no, *nothing, log, None)
    if not made:
        return
    _say("initialized")
    pointer = c.c_void_p(made)

    def assign(structural: bool) -> None:
        for kind, references, values, _ in (start for start in starts if start[3] == structural):
            sizes = c.c_size_t(len(references)), c.c_size_t(len(values))
            value_references = (c.c_uint * len(references))(*references)
            functions[f"fmi3Set{kind}"](pointer, value_references, sizes[0], _buffer(kind, values, c.c_bool), sizes[1])

    if any(start[3] for start in starts):
        functions.fmi3EnterConfigurationMode(pointer)
        assign(structural=True)
        functions.fmi3ExitConfigurationMode(pointer)
    assign(structural=False)
    begin, size, zero = map(c.c_double, (*step, 0.0))
    if functions.fmi3EnterInitializationMode(pointer, no, zero, begin, no, zero) > 1:
        return
    if functions.fmi3ExitInitializationMode(pointer) > 1:
        return
    _say("stepped")
    flags, last = [c.byref(c.c_bool()) for _ in range(3)], c.byref(c.c_double())
    if is_model_exchange:
        functions.fmi3UpdateDiscreteStates(pointer, *(c.byref(c.c_bool()) for _ in range(5)), last)
        return
    functions.fmi3DoStep(pointer, begin, size, c.c_bool(True), *flags, last)


def _buffer(kind: str, values: list[Any], boolean: type) -> Any:
    if kind == "String":
        return (c.c_char_p * len(values))(*(text.encode() for text in values))
    return (NUMBERS.get(kind, boolean) * len(values))(*values)


if __name__ == "__main__":
    main()
