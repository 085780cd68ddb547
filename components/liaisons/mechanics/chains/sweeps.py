"""Expressions of one link, evaluated for all links of a chain at a cost that is linear in their number.

The code that is generated for a sweep grows with the logarithm of the number of links: a sweep over many links is
ten sweeps over a tenth of them.  What is zero by structure is not swept.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from itertools import pairwise

import casadi as ca

_BRANCHES = 10

Pair = tuple[ca.SX, ca.MX]
"""A symbol of one link (r, 1), and its numbers: (r, n), one column a link, or (r, 1), the same for all."""


@dataclass(frozen=True, eq=False)
class Columns:
    """What is known of all n links."""

    n: int
    each: tuple[Pair, ...] = ()  # numbers (r, n)
    shared: tuple[Pair, ...] = ()  # numbers (r, 1)

    def __and__(self, more: Sequence[Pair]) -> Columns:
        """These and more numbers, one column a link."""
        return Columns(self.n, (*self.each, *more), self.shared)


@dataclass(frozen=True, eq=False)
class Carried:
    """A quantity that is carried from link to link."""

    symbol: ca.SX  # (c, 1)
    start: ca.MX  # (c, 1) as the first link meets it
    following: ca.SX  # (c, 1) as the next link meets it


def over_links(known: Columns, *results: ca.SX) -> list[ca.MX]:
    """Each result (r, 1) of one link for all links, (r, n)."""
    wanted = _without_zeros(known, results)
    places = [i for i, result in enumerate(wanted) if not result.is_zero()]
    values = [ca.MX(result.shape[0], known.n) for result in results]
    if places:
        each, shared, expressions = _needed(known, [wanted[i] for i in places])
        link = ca.Function("link", [symbol for symbol, _ in (*each, *shared)], expressions)
        arguments = [*(numbers for _, numbers in each), *(ca.repmat(numbers, 1, known.n) for _, numbers in shared)]
        for i, value in zip(places, link.map(known.n).call(arguments), strict=True):
            values[i] = value
    return values


def along_links(
    known: Columns, carried: Sequence[Carried], *results: ca.SX, inward: bool = False
) -> tuple[list[ca.MX], list[ca.MX], list[ca.MX]]:
    """The same with quantities that are carried from link to link, outward or inward.

    :returns: the carried quantities as each link meets them, (c, n); what the last link hands on, (c, 1); results.
    """
    count, symbols = len(carried), [item.symbol for item in carried]
    wanted = _without_zeros(known, [*(item.following for item in carried), *results])
    if not ca.depends_on(ca.vertcat(*wanted[:count]), ca.vertcat(*symbols)):
        return _shifted(known, carried, wanted, inward)
    each, shared, expressions = _needed(known, [*wanted[:count], *symbols, *wanted[count:]])
    link = ca.Function("link", [*symbols, *(symbol for symbol, _ in (*each, *shared))], expressions)
    arguments = [*(item.start for item in carried), *(numbers for _, numbers in (*each, *shared))]
    values = list(_tree(link, known.n, count, len(each), inward).call(arguments))
    return values[count : 2 * count], values[:count], values[2 * count :]


def _shifted(
    known: Columns, carried: Sequence[Carried], wanted: Sequence[ca.SX], inward: bool
) -> tuple[list[ca.MX], list[ca.MX], list[ca.MX]]:
    """What a link hands on does not depend on what it was handed: no link has to wait for another."""
    count = len(carried)
    handed = over_links(known, *wanted[:count])
    met = [_moved(values, item.start, inward) for values, item in zip(handed, carried, strict=True)]
    meeting = known & [(item.symbol, values) for item, values in zip(carried, met, strict=True)]
    last = 0 if inward else known.n - 1
    return met, [values[:, last] for values in handed], over_links(meeting, *wanted[count:])


def _moved(handed: ca.MX, start: ca.MX, inward: bool) -> ca.MX:
    """What each link meets, where this is what each hands on."""
    if handed.nnz() == 0 and start.nnz() == 0:
        return handed
    edge = start if start.nnz() else _dense_zeros(handed[:, 0])
    return ca.horzcat(handed[:, 1:], edge) if inward else ca.horzcat(edge, handed[:, :-1])


def _dense_zeros(like: ca.MX) -> ca.MX:
    """Zeros that stay dense when they are differentiated; zeros by structure make tables as long as the chain."""
    return ca.fmin(like**2, 0)


def _tree(link: ca.Function, n: int, carried: int, each: int, inward: bool) -> ca.Function:
    """(carried, columns of n links, shared) → (carried after them, as they met it, results): ten branches a level."""

    @cache
    def sweep(n: int) -> ca.Function:
        if n == 1:
            return link
        size = 1
        while size * _BRANCHES < n:
            size *= _BRANCHES
        ends = [*range(0, n, size), n]
        parts = [sweep(end - start) for start, end in pairwise(ends)]
        widths = [1] * carried + [n] * each + [1] * (link.n_in() - carried - each)
        arguments = [ca.MX.sym(link.name_in(i), link.size1_in(i), width) for i, width in enumerate(widths)]
        handed, shared = arguments[:carried], arguments[carried + each :]
        split = [ca.horzsplit(column, ends) for column in arguments[carried : carried + each]]
        results: list[list[ca.MX]] = [[] for _ in parts]
        for i in reversed(range(len(parts))) if inward else range(len(parts)):
            values = list(parts[i].call([*handed, *(column[i] for column in split), *shared]))
            handed, results[i] = values[:carried], values[carried:]
        joined = [ca.horzcat(*pieces) for pieces in zip(*results, strict=True)]
        return ca.Function(f"links_{n}", arguments, [*handed, *joined])

    return sweep(n)


def _without_zeros(known: Columns, expressions: Sequence[ca.SX]) -> list[ca.SX]:
    """The expressions with zeros in the place of what is zero by structure."""
    zero = [symbol for symbol, numbers in known.each if symbol.numel() and numbers.nnz() == 0]
    if not (zero and expressions):
        return list(expressions)
    return list(ca.substitute(list(expressions), zero, [ca.SX.zeros(*symbol.shape) for symbol in zero]))


def _needed(known: Columns, expressions: Sequence[ca.SX]) -> tuple[list[Pair], list[Pair], list[ca.SX]]:
    """The numbers on which the expressions depend, and these, dense and without repetitions."""
    together = ca.vertcat(*(ca.vec(expression) for expression in expressions))
    each, shared = (
        [pair for pair in pairs if pair[0].numel() and ca.depends_on(together, pair[0])]
        for pairs in (known.each, known.shared)
    )
    return each, shared, [ca.densify(expression) for expression in ca.cse(list(expressions))]
