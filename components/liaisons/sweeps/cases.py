"""What is varied: columns of values, on a grid or at random."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any, Protocol, TypeAlias, final, runtime_checkable

import numpy as np
from numpy.typing import ArrayLike

from liaisons.base.arguments import check_integer, float_array, name_dictionary, shown
from liaisons.base.arrays import Floats
from liaisons.errors import SweepError


@runtime_checkable
class Quantiles(Protocol):
    """A distribution by its quantiles, such as ``scipy.stats.norm(1.0, 0.1)``."""

    def ppf(self, q: Any, /) -> Any:
        """Quantiles at the probabilities q ("percent point function")."""
        ...


_MOST = 10_000_000
"""Most cases of a sweep: their table takes some gigabytes, their simulation days."""

Distribution: TypeAlias = Quantiles | tuple[float, float]
"""``(low, high)`` is uniform between them."""


@final
@dataclass(frozen=True, eq=False, repr=False)
class Cases(Mapping[str, Floats]):
    """Name of a parameter or input -> its value in each case, shape (count,).

    :param columns: all of one length.
    """

    columns: Mapping[str, Floats]

    def __post_init__(self) -> None:
        for column in self.columns.values():
            column.flags.writeable = False

    @classmethod
    def of(cls, columns: Mapping[str, ArrayLike]) -> Cases:
        """Return cases one by one: the first values of all columns, then the second ones, ...

        :raises SweepError: if nothing is varied, or columns differ in length.
        """
        if isinstance(columns, Cases):
            return columns
        arrays = _columns(columns)
        if len(set(map(len, arrays.values()))) > 1:
            lengths = ", ".join(f"{name} {len(column)}" for name, column in arrays.items())
            raise SweepError(f"columns of different lengths: {lengths}; give one value a case, or use grid()")
        return cls(arrays)

    @property
    def count(self) -> int:
        """Number of cases."""
        return len(next(iter(self.columns.values())))

    def case(self, number: int) -> dict[str, float]:
        """The values of one case, by name."""
        return {name: float(column[number]) for name, column in self.columns.items()}

    def __getitem__(self, name: str) -> Floats:
        return self.columns[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self.columns)

    def __len__(self) -> int:
        return len(self.columns)

    def __repr__(self) -> str:
        return f"<Cases: {self.count} of {', '.join(self)}>"


def grid(over: Mapping[str, ArrayLike]) -> Cases:
    """Return the cases of all combinations of values; the last name varies fastest.

    ``column.reshape(len(a), len(b))`` is the column of a result on the grid.

    :raises SweepError: if there is nothing to vary, or a value is no finite number.
    """
    columns = _columns(over)
    _refuse_too_many("grid", math.prod(map(len, columns.values())))
    mesh = np.meshgrid(*columns.values(), indexing="ij")
    return Cases({name: np.ascontiguousarray(axis).reshape(-1) for name, axis in zip(columns, mesh, strict=True)})


def sample(count: int, over: Mapping[str, Distribution], *, seed: int, latin_hypercube: bool = False) -> Cases:
    """Return cases of independent random values; the same ones for the same seed.

    :param over: name -> ``(low, high)``, or a distribution of ``scipy.stats``.
    :param latin_hypercube: spread the values of each name evenly over its quantiles.
    :raises SweepError: for an invalid count or seed, nothing to vary, or no distribution.
    """
    check_integer("sample: count", count, SweepError)
    _refuse_too_many("sample", int(count))
    check_integer("sample: seed", seed, SweepError, minimum=0)
    if not name_dictionary("sample: over", over, SweepError):
        raise SweepError("sample: nothing is varied; give at least one name with its distribution")
    generator = np.random.default_rng(int(seed))
    if latin_hypercube:
        from scipy.stats import qmc

        quantiles = qmc.LatinHypercube(d=len(over), rng=generator).random(int(count))
    else:
        quantiles = generator.random((int(count), len(over)))
    columns = zip(over.items(), quantiles.T, strict=True)
    return Cases({name: _values_at(name, distribution, q) for (name, distribution), q in columns})


def _refuse_too_many(maker: str, count: int) -> None:
    """Raise a SweepError for more cases than a sweep may have."""
    if count > _MOST:
        raise SweepError(f"{maker}: {count} cases are too many; give {_MOST} at most, and do the rest in another sweep")


def _values_at(name: str, distribution: Distribution, quantiles: Floats) -> Floats:
    """Quantiles of a distribution, checked to be finite; shape (count,)."""
    if isinstance(distribution, Quantiles):
        values = np.array(distribution.ppf(quantiles), dtype=float)
    else:
        try:
            low, high = map(float, distribution)
        except (TypeError, ValueError):
            raise SweepError(
                f"sample: {name} = {shown(distribution)}; give (low, high) or a distribution, "
                "e.g. scipy.stats.norm(1, 0.1)"
            ) from None
        if low >= high:
            raise SweepError(f"sample: {name} = {distribution!r}; give (low, high) with low < high")
        values = low + (high - low) * quantiles
    if not np.all(np.isfinite(values)):
        raise SweepError(f"sample: {name} = {shown(distribution)} gives values that are not finite; choose another one")
    return values


def _columns(over: Mapping[str, ArrayLike]) -> dict[str, Floats]:
    """Values by name as arrays, checked to be finite and not empty."""
    if not name_dictionary("cases", over, SweepError):
        raise SweepError("nothing is varied; give at least one name with its values")
    columns = {}
    for name, values in over.items():
        column = np.array(float_array(name, values, SweepError), ndmin=1)
        if column.ndim > 1 or not column.size:
            raise SweepError(f"{name} has values of shape {column.shape}; give at least one number, in one row")
        if not np.all(np.isfinite(column)):
            raise SweepError(f"{name} has values that are not finite; leave them out")
        columns[name] = column
    return columns
