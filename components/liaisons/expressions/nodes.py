"""What operations work on."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self, final

from liaisons.expressions.operations import OPERATIONS, Operation

Scaled = tuple[float, int]
"""A number that is not calculated yet: ±2ⁿ times a node."""


@final
@dataclass(frozen=True, slots=True)
class Node:
    """A number: a constant, an entry of an input, or an operation on numbers before it."""

    operation: Operation | None
    arguments: tuple[int, ...]  # numbers of nodes; of an entry: which input, which entry
    constant: float | None = None

    @classmethod
    def of(cls, code: int, *arguments: int) -> Self:
        """The node of an operation of CasADi's."""
        return cls(OPERATIONS[code], arguments)

    def is_a(self, code: int) -> bool:
        """Whether it is this operation."""
        return self.operation is OPERATIONS[code]
