"""What is varied: columns of values, on a grid or at random."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from liaisons.base.arguments import check_integer, float_array, name_dictionary, shown
from liaisons.base.arrays import Floats
from liaisons.errors import SweepError

_MOST = 10_000_000
"""Most cases of a sweep: their table takes some gigabytes, their simulation days."""

Distribution: TypeAlias = tuple[float, float] | Any
"""``(low, high)``, uniform between them, or a distribution such as ``scipy.stats.norm(1.0, 0.1)``."""


def checked_cases(columns: Mapping[str, ArrayLike]) -> dict[str, Floats]:
    """Columns of one length by the names of parameters and inputs: the first case has the first values, and so on.

    :raises SweepError: if nothing is varied, a value is no finite number, or columns differ in length.
    """
    arrays = _checked_columns(columns)
    if len(set(map(len, arrays.values()))) > 1:
        lengths = ", ".join(f"{name} {len(column)}" for name, column in arrays.items())
        raise SweepError(f"columns of different lengths: {lengths}; give one value a case, or use grid()")
    return arrays


def grid(over: Mapping[str, ArrayLike]) -> dict[str, Floats]:
    """Cases of all combinations of values as columns by name, in which the last name varies fastest.

    ``column.reshape(len(a), len(b))`` is the column of a result on the grid.

    :raises SweepError: if there is nothing to vary, or a value is no finite number.
    """
    columns = _checked_columns(over)
    _refuse_too_many("grid", math.prod(map(len, columns.values())))
    mesh = np.meshgrid(*columns.values(), indexing="ij")
    return {name: axis.ravel() for name, axis in zip(columns, mesh, strict=True)}


def sample(count: int, over: Mapping[str, Distribution], *, seed: int) -> dict[str, Floats]:
    """Cases of independent random values as columns by name, the same ones for the same seed.

    :param over: name -> ``(low, high)``, or a distribution of ``scipy.stats``.
    :raises SweepError: for an invalid count or seed, nothing to vary, or no distribution.
    """
    check_integer("sample: count", count, SweepError)
    _refuse_too_many("sample", int(count))
    check_integer("sample: seed", seed, SweepError, minimum=0)
    if not name_dictionary("sample: over", over, SweepError):
        raise SweepError("sample: nothing is varied; give at least one name with its distribution")
    probabilities = np.random.default_rng(int(seed)).random((int(count), len(over)))
    columns = zip(over.items(), probabilities.T, strict=True)
    return {name: _distribution_values(name, distribution, q) for (name, distribution), q in columns}


def _refuse_too_many(maker: str, count: int) -> None:
    """Raise a SweepError for more cases than a sweep may have."""
    if count > _MOST:
        raise SweepError(f"{maker}: {count} cases are too many; give {_MOST} at most, and do the rest in another sweep")


def _distribution_values(name: str, distribution: Distribution, probabilities: Floats) -> Floats:
    """Quantiles of a distribution at the probabilities, shape (count,); a SweepError unless they are finite."""
    if ppf := getattr(distribution, "ppf", None):  # quantiles, of a distribution of SciPy
        values = np.array(ppf(probabilities), dtype=float)
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
        values = low + (high - low) * probabilities
    if not np.all(np.isfinite(values)):
        raise SweepError(f"sample: {name} = {shown(distribution)} gives values that are not finite; choose another one")
    return values


def _checked_columns(over: Mapping[str, ArrayLike]) -> dict[str, Floats]:
    """Arrays of the values by name; a SweepError unless they are finite and not empty."""
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
