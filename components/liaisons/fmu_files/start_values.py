"""Start values, checked and converted to the types and shapes of an FMU's variables."""

from __future__ import annotations

import math
import numbers
from collections.abc import Mapping
from typing import Any, cast

import numpy as np

from liaisons.base.arguments import shown
from liaisons.base.array_names import array_and_index, element_offset
from liaisons.errors import InvalidValueError, SimulationError, suggestion
from liaisons.fmu_files.fmu import Fmu
from liaisons.fmu_files.variables import Array, Scalar, VariableType

Start = float | int | bool | str
Value = Start | tuple[Start, ...]
"""A start value; of an array, one for each element."""
Starts = Mapping[str, Value]
"""Start values by name."""


def checked_starts(owner: str, fmu: Fmu, starts: Mapping[str, object]) -> dict[str, Value]:
    """Start values by name, checked and converted to the types of their variables.

    An array takes one number for all its elements, or one for each, in their shape; its elements can be given one by
    one, too.  Later values override earlier ones.

    :param owner: name of the component, for messages.
    :returns: by name of a scalar or of an array; arrays of FMI 3.0 are always whole.
    :raises SimulationError: for an unknown variable, one that cannot be set, and a value of wrong type or shape, or
        not finite.
    """
    values: dict[str, Start | list[Start] | tuple[Start, ...]] = {}
    for name, start in starts.items():
        if isinstance(fmu.variables.entries.get(name), Array):
            values[name] = _array_value(owner, fmu, name, start)
            continue
        value = _scalar_value(owner, fmu, name, start)
        variable = fmu.variables[name]
        if variable.is_structural and variable.type == "Integer" and value != int(variable.start or 0):
            raise InvalidValueError(f"{owner}.{name} = {value}: a size is the same in all cases; sweep each on its own")
        base, index = array_and_index(name) if name.endswith("]") else (name, None)
        entry = fmu.variables.entries.get(base)
        if index is None or not isinstance(entry, Array) or not (entry.is_variable or base in values):
            values[name] = value
            continue
        if base not in values:
            values[base] = _array_value(owner, fmu, base, _described_starts(entry))
        whole, position = values[base], element_offset(index, entry.shape)
        assert isinstance(whole, list)
        assert position is not None
        whole[position] = value
    for name, value in values.items():
        if isinstance(value, list):
            values[name] = tuple(value)
    return cast("dict[str, Value]", values)


def structural_sizes(owner: str, fmu: Fmu, starts: Mapping[str, object]) -> dict[str, int]:
    """Values of the structural parameters among start values, which set the sizes of arrays.

    :raises SimulationError: for one that cannot be set, or a value that is not an integer.
    """
    sizes: dict[str, int] = {}
    for name, start in starts.items():
        entry = fmu.variables.entries.get(name)
        if isinstance(entry, Scalar) and entry.is_structural and entry.type == "Integer":
            sizes[name] = int(_scalar_value(owner, fmu, name, start))
    return sizes


def _scalar_value(owner: str, fmu: Fmu, name: str, value: Any) -> Start:
    if name not in fmu.variables:
        raise SimulationError(f"{owner}: {fmu.unknown_variable_message(name)}")
    variable = fmu.variables[name]
    if not variable.settable:
        raise _unsettable_error(owner, fmu, variable, name, value)
    return _convert(f"{owner}.{name}", variable, value)


def _array_value(owner: str, fmu: Fmu, name: str, start: Any) -> list[Start]:
    entry = fmu.variables.entries[name]
    assert isinstance(entry, Array)
    if not entry.prototype.settable:
        raise _unsettable_error(owner, fmu, entry.prototype, name, start)
    label = f"{owner}.{name}"
    elements = np.asarray(start, dtype=object)  # NumPy would convert numbers beside a string to strings
    if elements.ndim == 0:
        return [_convert(label, entry.prototype, elements.item())] * entry.size
    if elements.shape != entry.shape:
        received, wanted = ("×".join(map(str, shape)) for shape in (elements.shape, entry.shape))
        raise InvalidValueError(
            f"{label} = {shown(start)}: {received} values, but the array has {wanted}; give one for each, "
            "or one number for all"
        )
    return [
        _convert(f"{label}[{index}]", entry.prototype, value)
        for index, value in enumerate(elements.reshape(-1).tolist(), start=1)
    ]


def _described_starts(entry: Array) -> Any:
    """Start values of an array in the model description, 0 if it has none."""
    texts = [text or "0" for text in entry.starts] or ["0"]
    read_as = {"Real": float, "Integer": int, "Enumeration": int, "Boolean": lambda text: text in {"true", "1"}}
    try:
        own = [read_as.get(entry.prototype.type, str)(text) for text in texts]
    except ValueError as error:
        raise SimulationError(
            f"{entry.prototype.name}: a start value in the model description is invalid: {error}"
        ) from None
    return own[0] if len(own) == 1 else np.reshape(own, entry.shape)


def _unsettable_error(owner: str, fmu: Fmu, variable: Scalar, name: str, value: object) -> SimulationError:
    """Error for a start value of a variable that cannot have one."""
    settable = [n for n, entry in fmu.variables.entries.items() if entry.prototype.settable]
    why = "is fixed" if variable.is_structural else "is calculated"
    return InvalidValueError(
        f"{owner}.{name} = {shown(value)}: causality {variable.causality!r}, so it {why} and cannot be set"
        f"{suggestion(name, settable)}"
    )


def _convert(label: str, variable: Scalar, value: Any) -> Start:
    """Start value in the type of its variable, checked."""
    kind, problem = variable.type, ""
    takes, convert, words = _TAKES.get(kind, (object, str, ""))
    if kind not in _TAKES:
        problem = f"{kind} variables cannot be set here"
    elif not isinstance(value, takes) or (isinstance(value, bool) and takes is not bool):
        problem = f"expected {words}, got {type(value).__name__}"
    elif kind == "Real" and not math.isfinite(value):
        problem = "expected a finite number"
    elif takes is numbers.Integral:
        least, most = integer_range(variable.base)
        if not least <= value <= most:
            problem = f"outside {variable.base}, {least} to {most}"
    if problem:
        raise InvalidValueError(f"{label} = {shown(value)}: {problem}")
    return convert(value)


_TAKES: dict[VariableType, tuple[type, type, str]] = {
    "Real": (numbers.Real, float, "a number"),
    "Integer": (numbers.Integral, int, "an integer"),
    "Enumeration": (numbers.Integral, int, "an integer"),
    "Boolean": (bool, bool, "True or False"),
    "String": (str, str, "a string"),
}


def integer_range(base: str) -> tuple[int, int]:
    """Smallest and largest number of an integer type, ``Integer``, ``UInt8``, ..., or of ``Boolean``."""
    if base == "Boolean":
        return 0, 1
    limits = np.iinfo("int32" if base == "Integer" else base.lower())
    return int(limits.min), int(limits.max)
