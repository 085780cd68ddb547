"""``modelDescription.xml`` of FMI 2.0 and 3.0, read in one pass: time and memory stay small for a million variables."""

from __future__ import annotations

import math
from array import array
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import partial
from operator import attrgetter
from typing import IO, final

from liaisons.base import xml_documents as documents
from liaisons.base.array_names import Shape, array_and_index, complete_shape
from liaisons.base.unit_definitions import UnitDefinition
from liaisons.fmu_files.variables import Array, Entry, Scalar, Variables, VariableType

Attributes = Mapping[str, str]

MOST_ELEMENTS = 10_000_000
"""Largest size of an array."""

_MOST_MEMORY = 2**28  # bytes
_BYTES_OF_TAG, _BYTES_OF_VARIABLE, _BYTES_OF_INDEX = 20, 400, 150  # as measured, about
_MOST_REFERENCE = 2**32 - 1

KINDS = ("CoSimulation", "ModelExchange", "ScheduledExecution")
"""Interface types, as their elements are named."""

_BOTH: dict[str, VariableType] = {"Enumeration": "Enumeration", "Boolean": "Boolean", "String": "String"}
_FMI_2: dict[str, VariableType] = {"Real": "Real", "Integer": "Integer", **_BOTH}
_FMI_3: dict[str, VariableType] = {
    **{f"Float{bits}": "Real" for bits in (32, 64)},
    **{f"{sign}Int{bits}": "Integer" for sign in ("", "U") for bits in (8, 16, 32, 64)},
    **_BOTH,
    "Binary": "Binary",
    "Clock": "Clock",
}


Table = dict[int, frozenset[int] | None]
"""Index of an unknown -> indices of the inputs that it depends on directly; None: unspecified, so possibly all."""


def parse(file: IO[bytes], sizes: Mapping[str, int], *, keeps_attributes: bool = False) -> Description:
    """Content of a model description.

    :param sizes: new values of structural parameters.
    :param keeps_attributes: whether :attr:`Description.attributes` and ``items`` are collected, too.
    :raises ValueError: for XML that is not well-formed, missing attributes, invalid numbers and references, and more
        content than fits into memory.
    """
    description = Description(sizes, keeps_attributes=keeps_attributes)
    documents.parse(file, description.read_tag)
    return description.finish()


_Pending = tuple[Scalar, list[tuple[str | None, str | None]], list[str]]
"""An FMI 3.0 variable whose sizes are not known yet, its dimensions (start, value reference), its start values."""


@dataclass(slots=True)
class _Elements:
    """FMI 2.0 scalars ``name[1]``, ``name[2]``, ..., which form an array if none is missing."""

    prototype: Scalar
    references: array[int] = field(default_factory=lambda: array("L"))
    indices: array[int] = field(default_factory=lambda: array("L"))
    starts: list[str | None] = field(default_factory=list)
    shapes: list[Shape] | None = None  # indices, unless these are simply 1, 2, 3, ...

    def add(self, variable: Scalar, index: Shape) -> None:
        """Append an element with its indices in the array."""
        count = len(self.references)
        if self.shapes is None and index != (count + 1,):
            self.shapes = [(k,) for k in range(1, count + 1)]
        if self.shapes is not None:
            self.shapes.append(index)
        self.references.append(variable.reference)
        self.indices.append(variable.index)
        self.starts.append(variable.start)

    def entries(self, *, name_is_free: bool) -> dict[str, Entry]:
        """The array, by its name; or its elements, by theirs, if some are missing or a scalar has its name."""
        count = len(self.references)
        shape = (count,) if self.shapes is None else complete_shape(self.shapes)
        if shape is not None and name_is_free:
            starts = self.starts if any(start is not None for start in self.starts) else ()
            return {
                self.prototype.name: Array(
                    self.prototype, shape, self.references, starts, self.indices, is_variable=False
                )
            }
        shapes = self.shapes or [(k,) for k in range(1, count + 1)]
        members = zip(shapes, self.references, self.starts, self.indices, strict=True)
        return {
            name: replace(self.prototype, name=name, reference=reference, start=start, index=position)
            for index, reference, start, position in members
            for name in [f"{self.prototype.name}[{','.join(map(str, index))}]"]
        }


@final
class Description:
    """Content of a model description, collected tag by tag; the order of its sections is fixed.

    :ivar kinds: attributes by interface type.
    :ivar states: number of continuous states (FMI 2.0).
    :ivar continuous_states: indices of the derivative of each continuous state, or array of them, and of the state.
    :ivar exact: outputs with ``initial="exact"``.
    :ivar fixed_inputs: inputs that cannot be set in intermediate update mode.
    :ivar nominals: nominal values by name, where the file says one.
    :ivar attributes: attributes of each variable and of its type's element, by name; ``tag`` is the type.
    :ivar items: values of the items of enumeration types, by the name of the type, then of the item.
    """

    def __init__(self, sizes: Mapping[str, int], *, keeps_attributes: bool = False) -> None:
        self._sizes, self._keeps_attributes = sizes, keeps_attributes
        self.root: Attributes = {}
        self.kinds: dict[str, Attributes] = {}
        self.states = 0
        self.continuous_states: tuple[tuple[int, int], ...] = ()
        self.experiment: Attributes = {}
        self.log_categories: list[str] = []
        self.units: dict[str, UnitDefinition] = {}
        self.variables = Variables({})
        self.outputs: Table = {}
        self.initial_unknowns: Table = {}
        self.exact: set[int] = set()
        self.fixed_inputs: set[int] = set()
        self.nominals: dict[str, float] = {}
        self.attributes: dict[str, Attributes] = {}
        self.items: dict[str, dict[str, int]] = {}
        self._unit: Attributes = {}
        self._type: Attributes = {}
        self._type_units: dict[str, str] = {}
        self._table: Table | None = None
        self._derivatives: Table = {}
        self._differentiated: dict[int, int] = {}  # index -> number of the variable whose derivative it is
        self._entries: dict[str, Scalar | _Elements | _Pending] = {}
        self._scalar: Attributes | None = None  # FMI 2.0: a variable before the child with its type
        self._pending: _Pending | None = None  # FMI 3.0: a variable before its dimensions
        self._count = 0
        self._inputs: set[int] = set()
        self._index: dict[int, int] = {}  # FMI 3.0: value reference -> index
        self._input_sets: dict[str, frozenset[int]] = {}  # by the text of the attribute, which many unknowns share
        self._memory = 0
        self._handlers: dict[str, Callable[[Attributes], None]] = {
            "fmiModelDescription": self._read_root,
            **{kind: partial(self.kinds.__setitem__, kind) for kind in KINDS},
            "Category": lambda a: self.log_categories.append(a["name"]),
            "Item": self._add_item,
            "DefaultExperiment": partial(setattr, self, "experiment"),
            "Unit": partial(setattr, self, "_unit"),
            "BaseUnit": self._add_base_unit,
            "ModelVariables": self._begin_variables,
            "ModelStructure": self._end_variables,
        }

    def read_tag(self, tag: str, attributes: Attributes) -> None:
        """Add the content of a start tag."""
        handler = self._handlers.get(tag)
        if handler is not None:
            handler(attributes)
            self._count_memory(_BYTES_OF_TAG)

    def _count_memory(self, size: int) -> None:
        """Add a size in bytes to the estimate of memory.

        :raises ValueError: if the estimate exceeds the limit.
        """
        self._memory += size
        if self._memory > _MOST_MEMORY:
            raise ValueError(f"its content takes more than {_MOST_MEMORY} bytes of memory; put variables into arrays")

    def finish(self) -> Description:
        """Complete the description after the last tag; returns the description itself."""
        self._end_variables({})
        self.states = len(self._derivatives)
        pairs = ((index, self._variable_index(self._differentiated.get(index, -1))) for index in self._derivatives)
        self.continuous_states = tuple((index, state) for index, state in pairs if state >= 0)
        if not self.root:
            raise ValueError("its root is not fmiModelDescription")
        return self

    # ---- header

    def _read_root(self, attributes: Attributes) -> None:
        self.root = dict(attributes)
        version = attributes["fmiVersion"]
        if version.startswith("2."):
            self._handlers |= {"SimpleType": partial(setattr, self, "_type"), "Real": self._add_real_type}
        elif version.startswith("3."):
            self._handlers |= dict.fromkeys(("Float32Type", "Float64Type"), self._add_real_type)
            self._handlers["EnumerationType"] = partial(setattr, self, "_type")
        else:  # its elements mean something else
            self._handlers = {}

    def _add_base_unit(self, attributes: Attributes) -> None:
        name = self._unit["name"]
        self.units[name] = UnitDefinition.from_attributes(name, attributes)

    def _add_item(self, attributes: Attributes) -> None:
        """Add an item to the enumeration type of the enclosing tag."""
        if self._keeps_attributes and "name" in self._type:
            self.items.setdefault(self._type["name"], {})[attributes.get("name", "")] = int(attributes.get("value", 0))

    def _add_real_type(self, attributes: Attributes) -> None:
        """Add a real type with its unit; in FMI 2.0 the enclosing tag has the name."""
        self._type_units[attributes.get("name") or self._type["name"]] = attributes.get("unit", "")

    # ---- variables

    def _begin_variables(self, _: Attributes) -> None:
        if self.root["fmiVersion"].startswith("2."):
            self._handlers["ScalarVariable"] = partial(setattr, self, "_scalar")
            self._handlers |= {tag: partial(self._add_typed_scalar, kind, tag) for tag, kind in _FMI_2.items()}
            return
        self._handlers |= {tag: partial(self._add_variable, kind, tag) for tag, kind in _FMI_3.items()}
        self._handlers |= {
            "Dimension": self._add_dimension,
            "Start": self._read_start_element,
            "Alias": self._add_alias,
        }

    def _add_typed_scalar(self, kind: VariableType, tag: str, attributes: Attributes) -> None:
        """Add the scalar of FMI 2.0 whose type this tag gives."""
        if self._scalar is not None:  # else a tag of the same name elsewhere
            self._add_scalar(self._make_variable(kind, tag, "Integer", self._scalar, attributes))
            self._scalar = None

    def _add_variable(self, kind: VariableType, tag: str, attributes: Attributes) -> None:
        """Add a variable of FMI 3.0, whose dimensions may follow."""
        variable = self._make_variable(kind, tag, "Int64", attributes, attributes)
        self._index[variable.reference] = variable.index
        self._pending = (variable, [], [])
        self._entries[variable.name] = self._pending
        self._count_memory(_BYTES_OF_VARIABLE)

    def _make_variable(
        self, kind: VariableType, tag: str, enumeration_base: str, attributes: Attributes, typed: Attributes
    ) -> Scalar:
        """Scalar with the attributes of a variable and of the element with its type; counts it."""
        index = self._count
        self._count += 1
        reference = int(attributes["valueReference"])
        if not 0 <= reference <= _MOST_REFERENCE:
            raise ValueError(f"{attributes['name']!r} has the value reference {reference}, which exceeds 32 bits")
        if self._keeps_attributes:
            self.attributes[attributes["name"]] = {"causality": "local", **typed, **attributes, "tag": tag}
            self._count_memory(_BYTES_OF_VARIABLE)
        if "nominal" in typed:
            self.nominals[attributes["name"]] = float(typed["nominal"])
            self._count_memory(_BYTES_OF_VARIABLE)
        causality = attributes.get("causality", "local")
        initial, start = attributes.get("initial"), typed.get("start")
        if "derivative" in typed:
            self._differentiated[index] = int(typed["derivative"])
        if causality == "input":
            self._inputs.add(index)
            moves = attributes.get("variability", "continuous") == "continuous"
            if moves and attributes.get("intermediateUpdate", "false") not in {"true", "1"}:
                self.fixed_inputs.add(index)
        if causality == "output" and initial == "exact":
            self.exact.add(index)
        free = causality in {"parameter", "input"} or initial in {"exact", "approx"}
        if causality == "structuralParameter":
            least, most = typed.get("min"), typed.get("max")
            free, start = least is None or least != most, str(self._sizes.get(attributes["name"], start or "0"))
        return Scalar(
            name=attributes["name"],
            reference=reference,
            type=kind,
            base=enumeration_base if kind == "Enumeration" else tag,
            causality=causality,
            settable=free and attributes.get("variability") != "constant",
            start=start,
            unit=typed.get("unit") or self._type_units.get(typed.get("declaredType", ""), ""),
            index=index,
            continuous=kind == "Real" and attributes.get("variability", "continuous") == "continuous",
        )

    def _add_scalar(self, variable: Scalar) -> None:
        """Add a scalar of FMI 2.0, an element of an array if its name has indices."""
        base, index = array_and_index(variable.name)
        if index is not None:
            group = self._entries.get(f"{base}[")  # no variable has such a name
            if group is None:
                group = self._entries[f"{base}["] = _Elements(replace(variable, name=base))
                self._count_memory(_BYTES_OF_VARIABLE)
            if isinstance(group, _Elements) and _KIND(group.prototype) == _KIND(variable):
                group.add(variable, index)
                return
        self._entries[variable.name] = variable
        self._count_memory(_BYTES_OF_VARIABLE)

    def _add_dimension(self, attributes: Attributes) -> None:
        if self._pending is not None:
            self._pending[1].append((attributes.get("start"), attributes.get("valueReference")))

    def _read_start_element(self, attributes: Attributes) -> None:
        """Add the value of a ``<Start>`` element to the variable that is being read."""
        if self._pending is not None:
            self._pending[2].append(attributes["value"])

    def _add_alias(self, attributes: Attributes) -> None:
        if self._pending is not None:
            variable, dimensions, starts = self._pending
            self._entries[attributes["name"]] = replace(variable, name=attributes["name"]), dimensions, starts
            self._count_memory(_BYTES_OF_VARIABLE)

    # ---- structure

    def _end_variables(self, _: Attributes) -> None:
        """Make the variables, whose tags are complete, and set the handlers of the model structure."""
        if "Unknown" in self._handlers or not self.root:
            return
        pending = [entry for entry in self._entries.values() if isinstance(entry, tuple)]
        sizes = {
            variable.reference: int(variable.start or 0)
            for variable, dimensions, _ in pending
            if variable.causality == "structuralParameter" and variable.type == "Integer" and not dimensions
        }
        entries: dict[str, Entry] = {}
        for name, entry in self._entries.items():
            if isinstance(entry, _Elements):
                entries |= entry.entries(name_is_free=entry.prototype.name not in self._entries)
            else:
                entries[name] = (
                    _make_entry(entry, sizes, resized=bool(self._sizes)) if isinstance(entry, tuple) else entry
                )
        self.variables = Variables(entries)
        self._entries, self._pending = {}, None
        for tag in (*_FMI_2, *_FMI_3, "Dimension", "Start", "Alias", "ScalarVariable"):
            self._handlers.pop(tag, None)
        tables = (self.outputs, self._derivatives, self.initial_unknowns)
        two = zip(("Outputs", "Derivatives", "InitialUnknowns"), tables, strict=True)
        three = zip(("Output", "ContinuousStateDerivative", "InitialUnknown"), tables, strict=True)
        self._handlers |= {tag: partial(self._choose_table, table) for tag, table in (*two, ("DiscreteStates", None))}
        self._handlers |= {tag: partial(self._add_unknown, "valueReference", table) for tag, table in three}
        self._handlers["Unknown"] = lambda attributes: self._add_unknown("index", self._table, attributes)

    def _choose_table(self, table: Table | None, _: Attributes) -> None:
        self._table = table

    def _add_unknown(self, number: str, table: Table | None, attributes: Attributes) -> None:
        """Add the dependencies of an unknown to a table; ``number`` is the attribute that tells the variable."""
        dependencies = attributes.get("dependencies")
        if table is not None:
            index = self._variable_index(int(attributes[number]))
            table[index] = None if dependencies is None else self._input_indices(dependencies)

    def _variable_index(self, number: int) -> int:
        """Index of the variable with a value reference or, in FMI 2.0, a position from 1; -1 if there is none."""
        return self._index.get(number, -1) if self._index else number - 1

    def _input_indices(self, dependencies: str) -> frozenset[int]:
        """Indices of the inputs among the variables of an attribute ``dependencies``."""
        if dependencies not in self._input_sets:
            numbers = list(map(int, dependencies.split()))
            self._count_memory(_BYTES_OF_INDEX * len(numbers))
            self._input_sets[dependencies] = frozenset(self._inputs.intersection(map(self._variable_index, numbers)))
        return self._input_sets[dependencies]


def _make_entry(pending: _Pending, sizes: Mapping[int, int], *, resized: bool) -> Entry:
    """Scalar or array of a pending variable, by the sizes of structural parameters.

    :param resized: whether these may differ from those of the start values in the file.
    """
    variable, dimensions, texts = pending
    starts = texts or ([] if variable.start is None else variable.start.split())
    if not dimensions:
        return replace(variable, start=starts[0]) if texts else variable
    shape = tuple(_dimension_size(variable.name, start, reference, sizes) for start, reference in dimensions)
    if math.prod(shape) > MOST_ELEMENTS:
        raise ValueError(f"the array {variable.name!r} has {math.prod(shape)} elements, more than {MOST_ELEMENTS}")
    if resized and len(starts) not in {1, math.prod(shape)}:
        starts = []
    return Array(variable, shape, (variable.reference,), starts, (variable.index,), is_variable=True)


def _dimension_size(name: str, start: str | None, reference: str | None, sizes: Mapping[int, int]) -> int:
    """Size of a dimension, from its own start value or from the structural parameter that it refers to."""
    if start is None and int(reference or -1) not in sizes:
        raise ValueError(
            f"a dimension of {name!r} is that of value reference {reference}, which is not a structural parameter"
        )
    size = sizes[int(reference or 0)] if start is None else int(start)
    if size < 0:
        raise ValueError(f"a dimension of {name!r} is {size}")
    return size


_KIND = attrgetter("base", "type", "causality", "settable", "continuous", "unit")
"""Attributes that all elements of an array share."""
