"""CasADi expressions as formulas in MathML Core."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from fractions import Fraction
from itertools import pairwise

import casadi as ca

from liaisons.fmu.documentation.algebra import (
    GROUP,
    HALF,
    PI,
    SYMBOL,
    Algebra,
    Exponent,
    Monomial,
    Number,
    Polynomial,
    alone,
    is_number,
    is_supported,
)
from liaisons.fmu.documentation.notation import Notation

_PLUS, _MINUS = "<mo>+</mo>", "<mo>−</mo>"
_OPEN, _CLOSE = "<mrow><mo>(</mo>", "<mo>)</mo></mrow>"
_TIMES, _APPLY, _SPACE = "<mo>&#x2062;</mo>", "<mo>&#x2061;</mo>", '<mspace width="0.2em"></mspace>'
_RELATIONS = {"lt": "&lt;", "le": "≤", "eq": "=", "ne": "≠"}
_AROUND = {GROUP: "()", "fabs": "||", **dict.fromkeys(_RELATIONS, "[]")}
_CALLS = {"asin": "arcsin", "acos": "arccos", "atan": "arctan", "log": "ln", "fmin": "min", "fmax": "max"}
_TAG = re.compile(r"<[^>]+>|&#x206[12];")
# A word, which is a name of several letters, at the end of a factor or at its beginning.
_WORD_LAST = re.compile(r"<mi>\w\w+</mi>(?:</\w+>|<mo>[˙¨]</mo>)*$")
_WORD_FIRST = re.compile(r"(?:<\w+[^>]*>)*<mi>\w\w+</mi>")

EXPANSIONS = (1, 12, 60)
"""Ways to write a formula: products of sums left alone, or expanded up to so many terms; the shortest one is taken."""

SHORT, LONGEST = 18, 200
"""Operations up to which a formula is written without abbreviations, and up to which it is written at all."""

ONE_LINE, LOOSER = 22, 1.35
"""Operations that fit on a line, and how many times longer a formula may be if that breaks it between terms."""

WORTH_A_NAME = 4
"""Operations from which on a repeated bracket of a long formula gets a name."""

WIDE = 60
"""Characters from which on a bracket gets a name even if it is not repeated: lines break outside of brackets."""

Terms = tuple[str, ...]
"""A sum: each term with its sign, so that a line may break before it."""


@dataclass(frozen=True, slots=True)
class Formula:
    """A formula in MathML: its terms, the definitions of its abbreviations, and the number of operations in all."""

    terms: Terms
    where: tuple[tuple[str, Terms], ...]
    operations: int


def formula(expression: ca.SX, notation: Notation) -> Formula | None:
    """The shortest form of a scalar expression; None if it takes more than ``LONGEST`` operations."""
    symbols = ca.symvar(expression)
    function = ca.Function("f", symbols, ca.cse([ca.densify(expression)]))
    if function.n_instructions() > 2 * LONGEST or not is_supported(function):
        return None
    names = [symbol.name() for symbol in symbols]
    writers = [_Writer(function, names, Algebra(limit), notation) for limit in EXPANSIONS]
    shortest = min(writers, key=lambda writer: writer.operations)
    return shortest.formula() if shortest.operations <= LONGEST else None


class _Writer:
    """Writes one expression; repeated brackets of a long one get names."""

    def __init__(self, function: ca.Function, names: list[str], algebra: Algebra, notation: Notation) -> None:
        self.algebra = algebra
        self.notation = notation
        self.abbreviations: dict[int, str] = {}
        self.where: list[tuple[str, Terms]] = []
        plain = algebra.value(function, names)
        collected = algebra.collected(plain)
        short, long = self._counted(collected), self._counted(plain)
        # What fits on one line is best short; beyond that, lines break between terms only.
        self.polynomial = collected if short < min(long, ONE_LINE) or LOOSER * short < long else plain
        self.operations = self._counted(self.polynomial)

    def formula(self) -> Formula:
        self._abbreviate()
        return Formula(self._all_terms(self.polynomial), tuple(self.where), self.operations)

    # ---- how long it is ---------------------------------------------------------------------------------------

    def _counted(self, p: Polynomial) -> int:
        """Operations, those of repeated parts once."""
        return _own(p) + sum(sum(map(_own, self.algebra.atoms[index].arguments), 1) for index in self._uses(p))

    def _uses(self, p: Polynomial) -> Counter[int]:
        """How often each function and bracket is written, if its definition is written once."""
        uses: Counter[int] = Counter()
        waiting = [p]
        while waiting:
            for index in (index for monomial in waiting.pop() for index, _ in monomial):
                atom = self.algebra.atoms[index]
                if atom.operation != SYMBOL:
                    uses[index] += 1
                    waiting += atom.arguments if uses[index] == 1 else ()
        return uses

    def _abbreviate(self) -> None:
        """Name what a long formula repeats and what is too wide for a line."""
        long = self.operations > SHORT
        letter = f"<mi>{self.notation.free_letter()}</mi>"
        for index, count in sorted(self._uses(self.polynomial).items()):  # its parts have lower indices
            atom = self.algebra.atoms[index]
            terms = self._all_terms(atom.arguments[0]) if atom.operation == GROUP else (self._factor(index),)
            repeated = long and count > 1 and sum(map(self._counted, atom.arguments)) >= WORTH_A_NAME
            if repeated or len(_TAG.sub("", "".join(terms))) > WIDE:
                name = f"<msub>{letter}<mn>{len(self.abbreviations) + 1}</mn></msub>"
                self.abbreviations[index] = name
                self.where.append((name, terms))

    # ---- sums -------------------------------------------------------------------------------------------------

    def _all_terms(self, p: Polynomial) -> Terms:
        return tuple(self._terms(p)) or ("<mn>0</mn>",)

    def _sum(self, p: Polynomial) -> str:
        return "".join(self._all_terms(p))

    def _terms(self, p: Polynomial) -> Iterator[str]:
        """Terms with their signs, positive ones first, short ones before long ones."""
        ordered = sorted(p.items(), key=lambda item: (item[1] < 0, len(item[0]), self._rank(item[0])))
        for i, (monomial, coefficient) in enumerate(ordered):
            index = alone({monomial: coefficient})
            if index is not None and self._is_open(index):  # a bracket that multiplies nothing
                inner = self._terms(self.algebra.atoms[index].arguments[0])
                yield from (
                    term if k or not i or term.startswith(_MINUS) else _PLUS + term for k, term in enumerate(inner)
                )
            else:
                yield (_MINUS if coefficient < 0 else _PLUS if i else "") + self._product(monomial, abs(coefficient))

    # ---- products ---------------------------------------------------------------------------------------------

    def _product(self, monomial: Monomial, coefficient: Number) -> str:
        factors = sorted(monomial, key=lambda factor: self._rank((factor,)))
        above = [self._power(index, e) for index, e in factors if e > 0]
        below = [self._power(index, -e) for index, e in factors if e < 0]
        top, bottom = coefficient.as_integer_ratio() if isinstance(coefficient, Fraction) else (coefficient, 1)
        if bottom != 1 and not below and above:
            return _joined([_fraction(_number(top), _number(bottom)), *above])
        if top != 1 or not above:
            above.insert(0, _number(top))
        if bottom != 1:
            below.insert(0, _number(bottom))
        return _fraction(_bare(above), _bare(below)) if below else _joined(above)

    def _power(self, index: int, exponent: Exponent) -> str:
        atom = self.algebra.atoms[index]
        if exponent == HALF:
            return f"<msqrt>{self._sum(atom.arguments[0]) if self._is_open(index) else self._factor(index)}</msqrt>"
        if exponent == 1:
            return self._factor(index)
        above = self._product((), Fraction(exponent))
        if atom.operation in ("sin", "cos") and exponent == 2:
            return self._call(f"<msup><mi>{atom.operation}</mi>{above}</msup>", atom.arguments)
        base = self._factor(index)
        if atom.operation not in (SYMBOL, GROUP):
            base = _OPEN + base + _CLOSE
        return f"<msup>{base}{above}</msup>"

    def _factor(self, index: int) -> str:
        """An atom, in brackets where it needs them in a product."""
        atom = self.algebra.atoms[index]
        if index in self.abbreviations:
            return self.abbreviations[index]
        if atom.operation == SYMBOL:
            return self.notation[atom.name]
        inner = [self._sum(argument) for argument in atom.arguments]
        if atom.operation == "pow":
            return f"<msup>{_OPEN}{inner[0]}{_CLOSE}<mrow>{inner[1]}</mrow></msup>"
        around = _AROUND.get(atom.operation)
        if around is None:
            return self._call(f"<mi>{_CALLS.get(atom.operation, atom.operation)}</mi>", atom.arguments)
        relation = _RELATIONS.get(atom.operation, ",")
        return f"<mrow><mo>{around[0]}</mo>{f'<mo>{relation}</mo>'.join(inner)}<mo>{around[1]}</mo></mrow>"

    def _call(self, function: str, arguments: tuple[Polynomial, ...]) -> str:
        first, *rest = arguments
        index = alone(first)
        if not rest and index is not None and self.algebra.atoms[index].operation == SYMBOL:
            argument = _SPACE + self._sum(first)
        else:
            argument = _OPEN + "<mo>,</mo>".join(map(self._sum, arguments)) + _CLOSE
        return f"<mrow>{function}{_APPLY}{argument}</mrow>"

    def _is_open(self, index: int) -> bool:
        """Whether an atom is a bracket without a name."""
        return self.algebra.atoms[index].operation == GROUP and index not in self.abbreviations

    def _rank(self, monomial: Monomial) -> tuple[tuple[int, int], ...]:
        """Order of writing: numbers, symbols in the order of the variables, brackets, functions."""
        ranks = []
        for index, _ in monomial:
            atom = self.algebra.atoms[index]
            if atom.operation == SYMBOL:
                ranks.append((0, -1 if atom.name == PI else self.notation.rank(atom.name)))
            elif atom.operation == GROUP and is_number(atom.arguments[0]):
                ranks.append((-1, index))
            else:
                ranks.append((0 if index in self.abbreviations else 1 if atom.operation == GROUP else 2, index))
        return tuple(sorted(ranks))


def _own(p: Polynomial) -> int:
    """Operations of a sum of products, without those inside of its factors."""
    count = max(len(p) - 1, 0)
    for monomial, coefficient in p.items():
        count += max(len(monomial) - 1, 0) + sum(e not in (1, -1) for _, e in monomial)
        count += 1 if monomial and abs(coefficient) != 1 else 0
    return count


def _joined(factors: list[str]) -> str:
    """A product: nothing between the factors, a space beside words."""
    if not factors:
        return "<mn>1</mn>"
    text = factors[0]
    for before, after in pairwise(factors):
        text += _TIMES + (_SPACE if _WORD_LAST.search(before) or _WORD_FIRST.match(after) else "") + after
    return text


def _bare(factors: list[str]) -> str:
    """A product above or below a line, where a bracket that stands alone needs none."""
    is_bracket = len(factors) == 1 and factors[0].startswith(_OPEN) and factors[0].endswith(_CLOSE)
    return factors[0].removeprefix(_OPEN).removesuffix(_CLOSE) if is_bracket else _joined(factors)


def _fraction(top: str, bottom: str) -> str:
    return f"<mfrac><mrow>{top}</mrow><mrow>{bottom}</mrow></mfrac>"


def _number(value: float) -> str:
    if isinstance(value, int):
        return f"<mn>{value}</mn>"
    mantissa, _, exponent = f"{float(value)!r}".partition("e")
    if not exponent:
        return f"<mn>{mantissa}</mn>"
    return f"<mn>{mantissa}</mn><mo>·</mo><msup><mn>10</mn><mn>{int(exponent)}</mn></msup>"
