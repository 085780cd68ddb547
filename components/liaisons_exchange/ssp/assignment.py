"""Start values from parameter sets: names mapped, values transformed, units converted."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from pathlib import Path
from xml.etree.ElementTree import Element

import numpy as np

from liaisons.base.unit_definitions import SAME, UnitDefinition
from liaisons.base.xml_documents import read_tree
from liaisons.cosim import SystemComponent
from liaisons.errors import SimulationError
from liaisons_exchange.ssp.xml import child_path, tag, unit_definitions

Number = float | int | bool | str
Value = Number | tuple[Number, ...]
"""Value of a parameter; of an array, one for each element."""

Quantity = tuple[tuple[Number, ...], UnitDefinition | str | None]
"""Values of a parameter (several: an array), and their unit; its name where the set does not define it."""


def fmu_start_values(part: SystemComponent, file: Path) -> list[tuple[str, object]]:
    """Names of a component's variables with their start values in a file of a parameter set (SSV).

    :raises SimulationError: for a value that a variable cannot have.
    :raises ValueError: for what is no XML.
    """
    with file.open("rb") as content:
        quantities = parameter_quantities(read_tree(content))
    return [(name, value_for_variable(part, name, quantity)) for name, quantity in quantities]


def parameter_quantities(parameter_set: Element) -> list[tuple[str, Quantity]]:
    """Names, values and units of the parameters in a set; a name may occur twice.

    :raises SimulationError: for a type that is not supported, or a value of another type.
    """
    defined = unit_definitions(parameter_set, "ssv:Units")
    return [
        (name, (_parameter_values(name, element), defined.get(unit, unit or None)))
        for parameter in parameter_set.iterfind(child_path("ssv:Parameters", "ssv:Parameter"))
        for name in [parameter.get("name", "")]
        for element in [child for child in parameter if child.tag != tag("ssc:Dimension")][:1]
        for unit in [element.get("unit", "")]
    ]


def mapped_parameters(
    listed: list[tuple[str, Quantity]], entries: list[Element], *, prefix: str
) -> Iterator[tuple[str, Quantity]]:
    """Yield names and values of parameters, those in mapping entries transformed and with the names of their targets.

    Without entries, names and values as they are listed.
    """
    quantities = {f"{prefix}{name}": quantity for name, quantity in listed}
    if not entries:
        yield from quantities.items()
    for entry in entries:
        if entry.get("source", "") in quantities:
            values, unit = quantities[entry.get("source", "")]
            target = entry.get("target", "")
            suppressed = entry.get("suppressUnitConversion") in {"true", "1"}
            yield target, (tuple(_transformed(target, value, entry) for value in values), None if suppressed else unit)


def value_for_variable(part: SystemComponent, variable: str, quantity: Quantity) -> object:
    """Value of a parameter, converted to the type and the unit of a component's variable.

    :raises SimulationError: for units of different dimensions, or an unknown item of an enumeration.
    """
    owner, fmu = part.name, part.fmu
    entry = fmu.variables.entry(variable)
    scalar, (values, unit) = entry.prototype, quantity
    if isinstance(unit, str):  # not defined in the set: of this name in the FMU
        if unit not in fmu.units and unit != scalar.unit:
            raise SimulationError(
                f"{owner}.{variable} = {values[0]!r} {unit}: this unit has no definition; add it to the parameter "
                "set's Units"
            )
        unit = fmu.units.get(unit)
    if scalar.type == "Real":
        values = tuple(_converted(f"{owner}.{variable}", v, unit, fmu.units.get(scalar.unit)) for v in values)
    elif scalar.type == "Enumeration" and any(isinstance(v, str) for v in values):
        values = _enumeration_values(f"{owner}.{variable}", fmu.items(scalar.name), values)
    elif scalar.type in {"Integer", "Enumeration"}:
        values = tuple(int(v) if isinstance(v, float) and v.is_integer() else v for v in values)
    if entry.shape and len(values) == entry.size:
        return np.array(values, dtype=object).reshape(entry.shape)
    return values[0] if len(values) == 1 else values


def _parameter_values(name: str, element: Element) -> tuple[Number, ...]:
    """Values of the parameter in an XML element."""
    kind, text = element.tag.rpartition("}")[2], element.get("value", "")
    try:
        if kind == "Real" or kind.startswith("Float"):
            return tuple(map(float, text.split()))
        if "Int" in kind:
            return tuple(map(int, text.split()))
        if kind == "Boolean":
            return tuple({"true": True, "1": True, "false": False, "0": False}[word] for word in text.split())
    except (KeyError, ValueError):
        raise SimulationError(f"parameter {name} = {text!r}: that is no {kind}") from None
    if kind in {"String", "Enumeration"}:  # of an enumeration, the name of an item
        return tuple(item.get("value", "") for item in element if item.tag.endswith("}Value")) or (text,)
    raise SimulationError(f"parameter {name} is of type {kind}, which cannot be set here; give a number instead")


def _enumeration_values(label: str, items: Mapping[str, int], values: Iterable[Number]) -> tuple[Number, ...]:
    """Values of an enumeration, given by names of its items or as numbers."""
    for value in values:
        if isinstance(value, str) and value not in items:
            raise SimulationError(f"{label} = {value!r}: it is one of {', '.join(items) or 'no items that have names'}")
    return tuple(items[value] if isinstance(value, str) else value for value in values)


def _transformed(name: str, value: Number, entry: Element) -> Number:
    """Value after the transformation of a mapping entry."""
    for child in entry:
        kind = child.tag.rpartition("}")[2]
        if kind == "LinearTransformation" and not isinstance(value, str):
            value = value * float(child.get("factor", 1)) + float(child.get("offset", 0))
        elif kind in _MAPPINGS:
            table = {item.get("source", ""): item.get("target", "") for item in child}
            word = value if isinstance(value, str) else str(value).lower()
            value = _MAPPINGS[kind](table[word]) if word in table else value  # a table may have gaps
        elif kind.endswith("Transformation"):
            raise SimulationError(f"parameter {name} has an {kind}, which is not done here; give the number instead")
    return value


_MAPPINGS: Mapping[str, Callable[[str], Number]] = {
    "BooleanMappingTransformation": lambda word: word in {"true", "1"},
    "IntegerMappingTransformation": int,
    "EnumerationMappingTransformation": str,
}


def _converted(label: str, value: Number, unit: UnitDefinition | None, target: UnitDefinition | None) -> Number:
    """Value in another unit of the same dimension; unchanged where a unit is not defined."""
    if isinstance(value, str) or unit is None or target is None:
        return value
    if unit.exponents != target.exponents:
        raise SimulationError(f"{label} = {value!r}: the unit of the parameter is of another kind than the variable's")
    return value if (conversion := unit.conversion_to(target)) == SAME else conversion.apply(value)
