"""Definitions of units in files, and conversions of values from one unit to another."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import NamedTuple, final

from liaisons.base.units import BASE


@final
@dataclass(frozen=True, slots=True)
class UnitDefinition:
    """SI value = factor * value + offset; exponents of kg, m, s, A, K, mol, cd, rad."""

    exponents: tuple[int, ...]
    factor: float
    offset: float

    @classmethod
    def from_attributes(cls, name: str, attributes: Mapping[str, str]) -> UnitDefinition:
        """Definition of a unit from the attributes of its ``BaseUnit``.

        :raises ValueError: for attributes that are not numbers, and factors and offsets that cannot convert.
        """
        factor, offset = float(attributes.get("factor", 1)), float(attributes.get("offset", 0))
        if factor == 0 or not (math.isfinite(factor) and math.isfinite(offset)):
            raise ValueError(f"the unit {name!r} has the factor {factor!r} and the offset {offset!r}")
        return cls(tuple(int(attributes.get(base, 0)) for base in BASE), factor, offset)

    def conversion_to(self, other: UnitDefinition) -> Conversion:
        """Conversion of values to another unit of the same dimension."""
        if math.isclose(self.factor, other.factor) and self.offset == other.offset:
            return SAME
        return Conversion(self.factor / other.factor, (self.offset - other.offset) / other.factor)


class Conversion(NamedTuple):
    """factor * value + offset."""

    factor: float = 1.0
    offset: float = 0.0

    def apply(self, value: float) -> float:
        """Converted value."""
        return self.factor * value + self.offset

    def then(self, other: Conversion) -> Conversion:
        """Composed conversion: this one, then the other."""
        return Conversion(other.factor * self.factor, other.factor * self.offset + other.offset)


SAME = Conversion()
"""The identity."""
