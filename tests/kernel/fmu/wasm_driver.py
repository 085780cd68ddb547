"""The importer of driver.py for the WebAssembly component of an FMU: the same calls by way of wasmtime.

What its interface (components/liaisons/fmu/wasm/wit) has no words for is skipped: sizes that are wrong, pointers to
nothing, states that stay inside.
"""

from __future__ import annotations

import ctypes as c
import re
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from driver import BOOL, CO_SIMULATION, MODEL_EXCHANGE, OK, REALS, SIGNATURES, Instance, Library, N
from wasmtime import Engine, Store
from wasmtime.component import Component, Linker

_STATUSES = ("ok", "warning", "discard", "error", "fatal")
_ENGINE = Engine()


class Status(int):
    """What a call returns that is refused, or that returns nothing else."""


class WasmLibrary(Library):
    """The component of an FMU, and what its model description says."""

    def __init__(self, fmu: Path) -> None:
        super().__init__(fmu)
        with zipfile.ZipFile(fmu) as archive:
            self.bytes = archive.read(f"binaries/wasm32-wasip2/{self.description.modelName}.wasm")
        self.component = Component(_ENGINE, self.bytes)
        kind = self.component.type
        self.imports, self.exports = set(kind.imports(_ENGINE)), set(kind.exports(_ENGINE))

    def instantiate(self, kind: str = CO_SIMULATION, **options: Any) -> Instance:
        return WasmInstance(self, kind, **options)


class WasmInstance(Instance):
    """One instance; dropped with the object."""

    library: WasmLibrary

    def __init__(self, library: WasmLibrary, kind: str, **options: Any) -> None:
        self.library, self.messages, self.log, self.handle = library, [], [], None
        self.store = Store(_ENGINE)
        linker = Linker(_ENGINE)
        with linker.root() as root, root.add_instance("fmi:fmi3/callbacks@3.0.0") as callbacks:
            callbacks.add_func("log-message", self._say)
        self._instance = linker.instantiate(self.store, library.component)
        self._two, self._exchanges = False, kind == MODEL_EXCHANGE
        name, token = options.pop("name", b"it"), options.pop("token", None)
        logging, events, early = (bool(options.pop(key, False)) for key in ("logging", "events", "early"))
        if options or name is None or kind not in (CO_SIMULATION, MODEL_EXCHANGE):
            pytest.skip("components have no intermediate update, no scheduled execution, no files")
        self._kind = "model-exchange" if self._exchanges else "co-simulation"
        texts = [name.decode(), library.token if token is None else token, ""]
        self._name = texts[0]
        flags = [False, logging, *([] if self._exchanges else [events, early, []])]
        self._functions: dict[str, Callable[..., Any]] = {}
        self.handle = self.find(f"[static]{self._kind}-instance.instantiate-{self._kind}")(*texts, *flags)
        self.pointer = None if self.handle is None else 1

    def __del__(self) -> None:
        if self.handle is not None:
            self.handle.drop(self.store)

    def find(self, name: str) -> Callable[..., Any]:
        """A function of the interface; gives back a status or a value."""
        if name not in self._functions:
            self._functions[name] = self._found(name)
        return self._functions[name]

    def _found(self, name: str) -> Callable[..., Any]:
        place = self._instance.get_export_index(self.store, f"fmi:fmi3/{self._kind}@3.0.0")
        index = self._instance.get_export_index(self.store, name, place)
        if index is None:
            pytest.skip(f"{self._kind} has no {name}")
        function = self._instance.get_func(self.store, index)
        assert function is not None

        def called(*arguments: Any) -> Any:
            result = function(self.store, *arguments)
            return Status(_STATUSES.index(result)) if isinstance(result, str) and result in _STATUSES else result

        return called

    def _say(self, _store: Any, name: str, status: str, category: str, message: str) -> None:
        assert name == self._name
        self.messages.append(message)
        self.log.append((_STATUSES.index(status), category, message))

    def ask(self, name: str, *arguments: Any) -> Any:
        """A method by its name in the interface."""
        return self.find(f"[method]{self._kind}-instance.{name}")(self.handle, *arguments)

    def invoke(self, function: str, *arguments: Any) -> int:
        name = re.sub("(?<=[a-z0-9])(?=[A-Z])", "-", function.replace("UInt", "Uint")).lower()
        form = next((form for pattern, form in _FORMS.items() if re.fullmatch(pattern, function)), WasmInstance._call)
        return form(self, function, name, *arguments)

    def _skip(self, function: str, *_: Any) -> int:
        pytest.skip(f"{function}: components have it otherwise, or not at all")

    def _initialize(self, _: str, name: str, *arguments: Any) -> int:
        has_tolerance, tolerance, start, has_stop, stop = arguments
        return self.ask(name, tolerance if has_tolerance else None, float(start), stop if has_stop else None)

    def _log(self, _: str, name: str, on: bool, n: int, categories: Any) -> int:
        return self.ask(name, bool(on), [text.decode() for text in _listed(categories, n)])

    def _set(self, _: str, name: str, references: Any, n: int, values: Any, count: int) -> int:
        return self.ask(name, _listed(references, n), _listed(values, count))

    def _get(self, _: str, name: str, *arguments: Any) -> int:
        """Lists, each a pointer and a count; the last one is returned."""
        *given, result, count = arguments
        _listed(result, count)
        return self._take(self.ask(name, *map(_listed, given[::2], given[1::2])), result, count)

    def _get_output_derivatives(self, _: str, name: str, *arguments: Any) -> int:
        references, n, orders, result, count = arguments
        _listed(result, count)
        pairs = list(zip(_listed(references, n), _listed(orders, n), strict=True))
        return self._take(self.ask(name, pairs), result, count)

    def _set_states(self, _: str, name: str, states: Any, n: int) -> int:
        return self.ask(name, _listed(states, n))

    def _take(self, found: Any, result: Any, count: int) -> int:
        if isinstance(found, Status):
            return found
        if len(found) != count:
            pytest.skip("components know how many values there are")
        if found:
            result[: len(found)] = found
        return OK

    def _call(self, function: str, name: str, *arguments: Any) -> int:
        """What takes numbers, and returns numbers by pointers."""
        types = SIGNATURES["3"][function]
        inward = [kind for kind in types if kind not in (BOOL, REALS, c.POINTER(N))]
        given = [float(a) if kind is c.c_double else _plain(a) for kind, a in zip(inward, arguments, strict=False)]
        found = self.ask(name, *given)
        if len(inward) == len(types) or isinstance(found, Status):
            return found
        fields = list(vars(found).values()) if hasattr(found, "__dict__") else [found]
        if function == "DoStep":
            fields = [*fields[1:], fields[0]]
        for kind, pointer, value in zip(types[len(inward) :], arguments[len(inward) :], fields, strict=True):
            c.cast(pointer, kind)[0] = value
        return OK

    # ---- saved states

    def save(self) -> Any:
        return self.serialize()

    def restore(self, state: Any, /, *expected: Any) -> int:
        return self.expect(self.ask("set-fmu-state", bytes(state)), *expected)

    deserialize = restore

    def drop(self, state: Any) -> None:
        pass

    def serialize(self) -> bytes:
        found = self.ask("get-fmu-state")
        assert isinstance(found, bytes), self.messages
        return found


def _plain(value: Any) -> Any:
    return getattr(value, "value", value)


def _listed(pointer: Any, n: int) -> list[Any]:
    if n and not pointer:
        pytest.skip("components are given no null pointers")
    return [_plain(pointer[i]) for i in range(_plain(n))]


_TYPE = r"(U?Int\d+|Float\d+|Boolean|String)"
_FORMS: dict[str, Callable[..., int]] = {
    ".*FMUState.*|SetUInt8|.*(Binary|Clock|Interval.*|Shift.*)|GetVariableDep.*|ActivateModel.*": WasmInstance._skip,
    "EnterInitializationMode": WasmInstance._initialize,
    "SetDebugLogging": WasmInstance._log,
    "GetNumberOf.*": WasmInstance._call,
    f"Set{_TYPE}": WasmInstance._set,
    f"Get({_TYPE}|(Directional|Adjoint)Derivative|.*ContinuousState.*|EventIndicators)": WasmInstance._get,
    "GetOutputDerivatives": WasmInstance._get_output_derivatives,
    "SetContinuousStates": WasmInstance._set_states,
}
"""What becomes of the arguments of functions, by patterns of their names; of the others see ``_call``."""
