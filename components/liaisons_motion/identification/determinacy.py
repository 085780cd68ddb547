"""Null space of the information matrix, and sentences that name what measurements do not determine."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Any, final

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import null_space
from scipy.sparse.csgraph import connected_components

Floats = NDArray[np.float64]

_DERIVATIVE_ROUNDING = 1e-9
"""Rounding error of a derivative, relative to the largest one."""
_MEASUREMENT_ROUNDING = 1e-12
"""Rounding error of a derivative, relative to the measurements."""
_SINGULAR = 1e-8
"""Singular values of normalised columns below this one are rounding or integration errors."""
_INVOLVED = 1e-5
"""Components of null directions below this one are 0."""
_LARGEST_EXPONENT = 6
"""Largest exponent, and largest denominator of an exponent, that a product is written with."""


@final
@dataclass(frozen=True, eq=False)
class NullSpace:
    """Changes of unknowns that change no residual.

    :param values: of the unknowns.
    :param directions: orthonormal columns, relative to values that are not 0; shape (unknowns, directions).
    """

    values: Floats
    directions: Floats

    @classmethod
    def from_jacobian(cls, jacobian: Floats, values: Floats, size: float = 0.0) -> NullSpace:
        """Null space of a Jacobian of residuals, shape (residuals, unknowns).

        :param size: norm of all measured values, each divided by its standard deviation.
        """
        relative = jacobian * _scales(values)
        lengths = np.linalg.norm(relative, axis=0)
        lengths[lengths <= max(_DERIVATIVE_ROUNDING * lengths.max(initial=0.0), _MEASUREMENT_ROUNDING * size)] = 0
        unit = np.divide(relative, lengths, out=np.zeros_like(relative), where=lengths > 0)
        directions = null_space(np.linalg.qr(unit, mode="r"), rcond=_SINGULAR)
        directions /= np.where(lengths > 0, lengths, 1)[:, None]
        return cls(values, np.linalg.qr(directions)[0])

    @property
    def undetermined(self) -> NDArray[np.bool_]:
        """Whether each unknown takes part in a null direction, shape (unknowns,)."""
        return np.linalg.norm(self.directions, axis=1) > _INVOLVED

    @property
    def unknowns_to_hold(self) -> list[int]:
        """Indices of unknowns that determine all others when they are held; as far back in the order as possible."""
        return _last_independent_rows(self.directions)


def _scales(values: Floats) -> Floats:
    """Absolute values, with 1 in place of 0."""
    return np.where(values == 0, 1.0, np.abs(values))


def indeterminacy_sentences(
    null_space: NullSpace, nearby: NullSpace, names: Sequence[str], measured: Sequence[str]
) -> Iterator[str]:
    """Yield sentences such as ``"of gravity and length only gravity/length is determined by theta"``.

    :param nearby: null space at other values; only a product that both share is reported.
    :param names: of the unknowns.
    :param measured: names of the signals.
    """
    linked: Any = connected_components(np.abs(null_space.directions @ null_space.directions.T) > _INVOLVED)
    blocks, signals = linked[1], _list_text(measured)
    absent: list[str] = []
    for block in dict.fromkeys(blocks[null_space.undetermined]):
        members = np.flatnonzero(blocks == block).tolist()
        own = [names[i] for i in members]
        combinations = _determined_combinations(null_space, nearby, members, own)
        if combinations:
            verb = "are" if "combinations" in combinations[0] or len(combinations) > 1 else "is"
            yield f"of {_list_text(own)} only {_list_text(combinations)} {verb} determined by {signals}"
        else:
            absent += own
    if absent:
        yield f"{_list_text(absent)}: not determined at all by {signals}"


def _determined_combinations(
    null_space: NullSpace, nearby: NullSpace, members: list[int], names: list[str]
) -> list[str]:
    """Texts of the determined combinations of some unknowns: products, else sums, else their number."""
    for written in (_product_text, _sum_text):
        rows = [
            _integer_exponents(
                space.directions[members] * (_scales(space.values)[members, None] if written is _sum_text else 1)
            )
            for space in (null_space, nearby)
        ]
        if (
            None not in rows
            and rows[0] == rows[1]
            and (written is _sum_text or (null_space.values[members] != 0).all())
        ):
            return [written(row, names) for row in rows[0] or []]
    count = len(members) - np.linalg.matrix_rank(null_space.directions[members], tol=_INVOLVED)
    return [f"{count} combination{'s' if count > 1 else ''} near these values"] if count else []


def _integer_exponents(directions: Floats) -> list[tuple[int, ...]] | None:
    """Integer exponents orthogonal to the null directions; None if they are not small integers."""
    basis = null_space(directions.T, rcond=_INVOLVED)
    rows = []
    for row in (basis @ np.linalg.inv(basis[_last_independent_rows(basis)])).T.tolist():
        fractions = [Fraction(x).limit_denominator(_LARGEST_EXPONENT) for x in row]
        common = math.lcm(*(fraction.denominator for fraction in fractions))
        whole = [int(fraction * common) for fraction in fractions]
        if (
            max(abs(x * common - n) for x, n in zip(row, whole, strict=True)) > _INVOLVED
            or max(whole) > _LARGEST_EXPONENT
        ):
            return None
        first = next(filter(None, whole))
        sign = np.sign(sum(map(np.sign, whole)) or first)
        rows.append(tuple(int(sign) * n for n in whole))
    return rows


def _last_independent_rows(rows: Floats) -> list[int]:
    """Indices of linearly independent rows that span all rows, chosen from the last row backwards."""
    chosen: list[int] = []
    for i in reversed(range(len(rows))):
        if np.linalg.matrix_rank(rows[[*chosen, i]], tol=_INVOLVED) > len(chosen):
            chosen.append(i)
    return sorted(chosen)


def _product_text(exponents: tuple[int, ...], names: list[str]) -> str:
    """Text of a product of powers: ``"gravity/length"``."""

    def factors(sign: int) -> list[str]:
        """Powers with exponents of one sign."""
        return [
            name if abs(n) == 1 else f"{name}**{abs(n)}"
            for name, n in zip(names, exponents, strict=True)
            if n * sign > 0
        ]

    top, bottom = factors(1), factors(-1)
    below = "*".join(bottom)
    return "*".join(top) + (f"/{below}" if len(bottom) == 1 else f"/({below})" if bottom else "")


def _sum_text(weights: tuple[int, ...], names: list[str]) -> str:
    """Text of a weighted sum: ``"x_0 - 2*offset"``."""
    terms = [
        ("-" if n < 0 else "+", name if abs(n) == 1 else f"{abs(n)}*{name}")
        for name, n in zip(names, weights, strict=True)
        if n
    ]
    first, *rest = terms
    return first[1] + "".join(f" {sign} {text}" for sign, text in rest)


def _list_text(words: Sequence[str]) -> str:
    """Text of a list: ``"a, b and c"``."""
    return " and ".join(filter(None, [", ".join(words[:-1]), words[-1]])) if words else ""
