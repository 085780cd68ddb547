"""CasADi expressions as formulas: the shortest of some forms, its terms in the order that people write."""

from collections import Counter
from fractions import Fraction

import casadi as ca

from liaisons_pages.formulas.algebra import (
    GROUP,
    HALF,
    PI,
    SYMBOL,
    Algebra,
    Coefficient,
    Exponent,
    Monomial,
    Polynomial,
    is_number,
    is_supported,
    single_atom_index,
)
from liaisons_pages.formulas.mathml import MathML
from liaisons_pages.formulas.notation import Notation
from liaisons_pages.formulas.terms import (
    Application,
    Formula,
    Name,
    Negative,
    Number,
    Power,
    Quotient,
    Root,
    Term,
    product_term,
    sum_term,
    summands,
)

_FUNCTIONS = {"fabs": "abs", "fmin": "min", "fmax": "max"}

EXPANSIONS = (1, 12, 60)
"""Ways to write a formula: products of sums left alone, or expanded up to so many terms; the shortest one is taken."""

SHORT = 18
"""Operations up to which a formula is written without abbreviations."""
LONGEST = 200
"""Operations up to which a formula is written at all."""

ONE_LINE = 22
"""Operations that fit on a line."""
LOOSER = 1.35
"""How many times longer a formula may be if that breaks it between terms."""

WORTH_A_NAME = 4
"""Operations from which on a repeated bracket of a long formula gets a name."""

WIDE = 60
"""Characters from which on a bracket gets a name even if it is not repeated: lines break outside of brackets."""


def formula(expression: ca.SX, notation: Notation, longest: float = LONGEST, *, breaks: bool = False) -> Formula | None:
    """Return the shortest form of a scalar expression; None if it takes more operations than ``longest``.

    :param breaks: whether a line may break inside of brackets.
    """
    symbols = ca.symvar(expression)
    function = ca.Function("f", symbols, ca.cse([ca.densify(expression)]))
    if function.n_instructions() > 2 * longest or not is_supported(function):
        return None
    names = [symbol.name() for symbol in symbols]
    writers = [_Writer(function, names, Algebra(limit), notation, breaks) for limit in EXPANSIONS]
    shortest = min(writers, key=lambda writer: writer.operations)
    return shortest.formula() if shortest.operations <= longest else None


class _Writer:
    """Writer of one expression, in which repeated brackets of a long one get names."""

    def __init__(
        self, function: ca.Function, names: list[str], algebra: Algebra, notation: Notation, breaks: bool
    ) -> None:
        self.breaks = breaks
        self.algebra = algebra
        self.notation = notation
        self.abbreviations: dict[int, Name] = {}
        self.where: list[tuple[Name, Term]] = []
        plain = algebra.polynomial(function, names)
        nested = algebra.nested_form(plain)
        short, long = self._total_operations(nested), self._total_operations(plain)
        # What fits on one line is best short; beyond that, lines break between terms only.
        looser = 1 if breaks else LOOSER
        self.polynomial = nested if short < min(long, ONE_LINE) or looser * short < long else plain
        self.operations = self._total_operations(self.polynomial)

    def formula(self) -> Formula:
        self._abbreviate()
        return Formula(self._sum(self.polynomial), tuple(self.where))

    # ---- how long it is ---------------------------------------------------------------------------------------

    def _total_operations(self, p: Polynomial) -> int:
        """Return the number of operations; those of a repeated part count once."""
        return _operation_count(p) + sum(
            sum(map(_operation_count, self.algebra.atoms[index].arguments), 1) for index in self._use_counts(p)
        )

    def _use_counts(self, p: Polynomial) -> Counter[int]:
        """Return the number of occurrences of each function and bracket, by atom, if each is defined once."""
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
        """Give names to what a long formula repeats, and to what is too wide for a line."""
        long = self.operations > SHORT
        letter = self.notation.unused_letter()
        for index, count in sorted(self._use_counts(self.polynomial).items()):  # its parts have lower indices
            atom = self.algebra.atoms[index]
            term = self._factor(index)
            repeated = long and count > 1 and sum(map(self._total_operations, atom.arguments)) >= WORTH_A_NAME
            if repeated or (not self.breaks and MathML(self.notation).width(term) > WIDE):
                name = Name(f"{letter}_{len(self.abbreviations) + 1}")
                self.abbreviations[index] = name
                self.where.append((name, term))

    # ---- sums -------------------------------------------------------------------------------------------------

    def _sum(self, p: Polynomial) -> Term:
        """Return a sum as a term: positive summands first, short ones before long ones."""
        ordered = sorted(p.items(), key=lambda item: (item[1] < 0, len(item[0]), self._rank(item[0])))
        return sum_term([term for monomial, coefficient in ordered for term in self._summands(monomial, coefficient)])

    def _summands(self, monomial: Monomial, coefficient: Coefficient) -> tuple[Term, ...]:
        """Return the summands of a monomial: one product, or those of a bracket that has no further factor."""
        if self._is_bare_group({monomial: coefficient}):  # a bracket that multiplies nothing
            return summands(self._factor(monomial[0][0]))
        term = self._product(monomial, abs(coefficient))
        return (Negative(term) if coefficient < 0 else term,)

    def _is_bare_group(self, p: Polynomial) -> bool:
        """Return whether the whole sum is one bracket without an abbreviation."""
        index = single_atom_index(p)
        return index is not None and self.algebra.atoms[index].operation == GROUP and index not in self.abbreviations

    # ---- products ---------------------------------------------------------------------------------------------

    def _product(self, monomial: Monomial, coefficient: Coefficient) -> Term:
        factors = sorted(monomial, key=lambda factor: self._rank((factor,)))
        above = [self._power(index, e) for index, e in factors if e > 0]
        below = [self._power(index, -e) for index, e in factors if e < 0]
        top, bottom = coefficient.as_integer_ratio() if isinstance(coefficient, Fraction) else (coefficient, 1)
        if bottom != 1 and not below and above:
            return product_term([Quotient(Number(top), Number(bottom)), *above])
        if top != 1 or not above:
            above.insert(0, Number(top))
        if bottom != 1:
            below.insert(0, Number(bottom))
        return Quotient(product_term(above), product_term(below)) if below else product_term(above)

    def _power(self, index: int, exponent: Exponent) -> Term:
        base = self._factor(index)
        if exponent == HALF:
            return Root(base)
        return base if exponent == 1 else Power(base, self._product((), Fraction(exponent)))

    def _factor(self, index: int) -> Term:
        """Return the term of an atom."""
        atom = self.algebra.atoms[index]
        if index in self.abbreviations:
            return self.abbreviations[index]
        if atom.operation == SYMBOL:
            return Name(atom.name)
        inner = tuple(self._sum(argument) for argument in atom.arguments)
        if atom.operation == GROUP:
            return inner[0]
        if atom.operation == "pow":
            return Power(*inner)
        return Application(_FUNCTIONS.get(atom.operation, atom.operation), inner)

    def _rank(self, monomial: Monomial) -> tuple[tuple[int, int], ...]:
        """Return a key to sort factors: numbers, symbols in the order of the variables, brackets, functions."""
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


def _operation_count(p: Polynomial) -> int:
    """Return the number of operations of a sum of products, without those inside its factors."""
    count = max(len(p) - 1, 0)
    for monomial, coefficient in p.items():
        count += max(len(monomial) - 1, 0) + sum(e not in (1, -1) for _, e in monomial)
        count += 1 if monomial and abs(coefficient) != 1 else 0
    return count
