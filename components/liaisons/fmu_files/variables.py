"""Variables of an FMU: scalars, and arrays whose elements are made on access.

FMI 2.0 has scalars only and writes an array as ``theta[1]``, ``theta[2]``, ...; FMI 3.0 has one variable ``theta`` with
dimensions.  In both, ``"theta"`` is an array and ``"theta[2]"`` a scalar.  An element takes a few bytes.  An *entry* is
a scalar or an array; both have ``prototype``, ``size``, ``shape``, ``references`` and ``names()``.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product
from typing import ClassVar, Literal, TypeVar, final

from liaisons.base.array_names import Shape, array_and_index, element_offset

VariableType = Literal["Real", "Integer", "Enumeration", "Boolean", "String", "Binary", "Clock"]

NUMBERS: frozenset[VariableType] = frozenset({"Real", "Integer", "Enumeration", "Boolean"})
"""Types that are numbers in a result; enumerations are integers, Booleans 0 and 1."""

RECORDED: frozenset[VariableType] = frozenset({*NUMBERS, "String"})
"""Types that can be recorded and connected."""

LONGEST = 1000
"""Arrays with more elements are recorded only on request."""

_T = TypeVar("_T")


@final
@dataclass(frozen=True, slots=True)
class Scalar:
    """One scalar variable; ``unit`` is empty where the FMU gives none.

    :param reference: value reference; elements of an FMI 3.0 array share that of the array.
    :param base: type in names of FMI functions: ``Real``, ``Float64``, ``UInt8``, ...
    :param settable: whether it can be set before and during initialization.
    :param index: position in the model description, from 0.
    :param continuous: whether its variability is continuous.
    :param position: flat index in an FMI 3.0 array, from 0, the last index running fastest.
    """

    name: str
    reference: int
    type: VariableType
    base: str
    causality: str
    settable: bool
    start: str | None
    unit: str
    index: int = 0
    position: int = 0
    continuous: bool = True
    shape: ClassVar[Shape] = ()
    size: ClassVar[int] = 1
    is_long: ClassVar[bool] = False

    @property
    def is_structural(self) -> bool:
        """Whether the variable is a structural parameter, which is set in configuration mode."""
        return self.causality == "structuralParameter"

    @property
    def prototype(self) -> Scalar:
        """The scalar with the attributes that all elements share: the scalar itself."""
        return self

    @property
    def references(self) -> Sequence[int]:
        return (self.reference,)

    def names(self) -> Iterator[str]:
        return iter((self.name,))


@final
@dataclass(frozen=True, slots=True)
class Array:
    """An array.

    :param prototype: scalar with the attributes that all elements share, under the name of the array.
    :param references: value reference of each element (FMI 2.0), or of all (FMI 3.0).
    :param starts: start value of each element, of all, or none.
    :param indices: position of each element in the model description, or of all.
    :param is_variable: whether it is one variable of FMI 3.0, which is read and set as a whole.
    """

    prototype: Scalar
    shape: Shape
    references: Sequence[int]
    starts: Sequence[str | None]
    indices: Sequence[int]
    is_variable: bool

    @property
    def size(self) -> int:
        """Number of elements."""
        return math.prod(self.shape)

    @property
    def is_long(self) -> bool:
        """Whether it has more elements than :data:`LONGEST`."""
        return self.size > LONGEST

    def names(self) -> Iterator[str]:
        """Names of the elements, the last index running fastest."""
        return (f"{self.prototype.name}[{index}]" for index in element_indices(self.shape))

    def element(self, name: str, position: int) -> Scalar:
        """Scalar for the element with a name and a flat index."""
        return replace(
            self.prototype,
            name=name,
            reference=_element_value(self.references, position),
            start=_element_value(self.starts, position) if self.starts else None,
            index=_element_value(self.indices, position),
            position=position if self.is_variable else 0,
        )


Entry = Scalar | Array


@final
class Variables(Mapping[str, Scalar]):
    """All scalars and elements of arrays by name, in the order of the file (arrays at their first element)."""

    def __init__(self, entries: Mapping[str, Entry]) -> None:
        self.entries = entries
        self.arrays: Mapping[str, Shape] = {n: entry.shape for n, entry in entries.items() if isinstance(entry, Array)}

    def __getitem__(self, name: str) -> Scalar:
        entry = self.entries.get(name)
        if isinstance(entry, Scalar):
            return entry
        if not name.endswith("]"):
            raise KeyError(name)
        base, index = array_and_index(name)
        array = self.entries.get(base)
        if index is None or not isinstance(array, Array):
            raise KeyError(name)
        position = element_offset(index, array.shape)
        if position is None:
            raise KeyError(name)
        return array.element(name, position)

    def __iter__(self) -> Iterator[str]:
        for entry in self.entries.values():
            yield from entry.names()

    def __len__(self) -> int:
        return sum(entry.size for entry in self.entries.values())

    def entry(self, name: str) -> Entry:
        """The scalar, the element of an array, or the array with a name.

        :raises KeyError: for an unknown name.
        """
        return self.entries.get(name) or self[name]

    def whole_array(self, name: str) -> Array | None:
        """The FMI 3.0 array with a name, or with an element of that name; None if there is none."""
        entry = self.entries.get(name) or self.entries.get(array_and_index(name)[0])
        return entry if isinstance(entry, Array) and entry.is_variable else None


def _element_value(values: Sequence[_T], position: int) -> _T:
    """Value for one element of an array, from one value for each or one for all."""
    return values[position if len(values) > 1 else 0]


def element_indices(shape: Shape) -> Iterator[str]:
    """Yield the indices of all elements of an array: ``"1"``, ``"2"`` or ``"1,1"``, ``"1,2"``, row by row."""
    return (",".join(map(str, index)) for index in product(*(range(1, n + 1) for n in shape)))
