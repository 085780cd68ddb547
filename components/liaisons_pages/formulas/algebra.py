"""CasADi expressions as sums of products with like terms collected.

A *polynomial* is a sum: a table from monomials to their coefficients.  A *monomial* is a product of powers of *atoms*:
symbols, functions such as ``cos``, and groups, which are sums that stay in brackets.  Atoms are numbered in the order
of their first appearance, so that all results are the same from run to run.

Why not SymPy: with its ``expand``, ``factor_terms`` and ``cse`` and its MathML printer, a page takes 5 (Pendulum) to 38
times (SpatialCat) as long; with ``trigsimp``, without which no cos(θ₁ - θ₂) is found, minutes.  Its formulas are wider
than the page, in nested fractions, with the terms of a bracket in the order of letters.
"""

import math
from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import reduce
from itertools import combinations

import casadi as ca

from liaisons.expressions import interpret, operation_codes

Coefficient = Fraction | float
Exponent = int | Fraction
Monomial = tuple[tuple[int, Exponent], ...]  # (atom, exponent), by atom; no exponent is 0
Polynomial = dict[Monomial, Coefficient]  # no coefficient is 0; never changed once made

GROUP, SYMBOL = "group", "symbol"
PI = "π"
ONE, HALF = Fraction(1), Fraction(1, 2)
_COFUNCTION = {"sin": "cos", "cos": "sin"}


@dataclass(frozen=True, slots=True)
class Atom:
    """A factor: a symbol, a function of polynomials, or a polynomial in brackets."""

    operation: str  # SYMBOL, GROUP, or the name of the function
    name: str  # of a symbol
    arguments: tuple[Polynomial, ...]


class Algebra:
    """Sums of products over one common set of atoms.

    :param limit: products of sums are expanded up to so many terms; 1: not at all.
    """

    def __init__(self, limit: int) -> None:
        self.limit = limit
        self.atoms: list[Atom] = []
        self._indices: dict[object, int] = {}

    # ---- atoms ------------------------------------------------------------------------------------------------

    def atom(self, operation: str, *arguments: Polynomial, name: str = "") -> Polynomial:
        """Return the atom as a polynomial; equal atoms are one."""
        return {((self._atom_index(operation, arguments, name), 1),): ONE}

    def symbol(self, name: str) -> Polynomial:
        """Return a symbol as a polynomial."""
        return self.atom(SYMBOL, name=name)

    def _atom_index(self, operation: str, arguments: Sequence[Polynomial], name: str = "") -> int:
        """Return the index of an atom; one that is new is added."""
        key = (operation, name, *(tuple(sorted(argument.items())) for argument in arguments))
        if key not in self._indices:
            self._indices[key] = len(self.atoms)
            self.atoms.append(Atom(operation, name, tuple(arguments)))
        return self._indices[key]

    # ---- arithmetic -------------------------------------------------------------------------------------------

    def plus(self, *summands: Polynomial) -> Polynomial:
        """Return the sum."""
        return _sum_of_terms(item for summand in summands for item in summand.items())

    def times(self, a: Polynomial, b: Polynomial) -> Polynomial:
        """Return the product, expanded unless it has more terms than the limit."""
        if len(a) * len(b) > self.limit:
            a, b = (x if is_number(x) or is_number(y) else self.product_form(x) for x, y in ((a, b), (b, a)))
        return _sum_of_terms((_monomial_product(m, n), c * d) for m, c in a.items() for n, d in b.items())

    def power(self, base: Polynomial, exponent: Exponent) -> Polynomial:
        """Return a power, expanded unless it has more terms than the limit."""
        if not base or exponent == 0:
            return {} if exponent else {(): ONE}
        if exponent.denominator != 1:  # no factor leaves a root, since √x² is not x
            index = single_atom_index(base)
            return {((self._atom_index(GROUP, [base]) if index is None else index, exponent),): ONE}
        if len(base) > 1 and exponent > 0 and len(base) ** exponent <= self.limit:
            return reduce(self.times, [base] * int(exponent))
        return {_monomial_power(m, exponent): c**exponent for m, c in self.product_form(base).items()}

    def product_form(self, p: Polynomial) -> Polynomial:
        """Return a sum as one product: the common factor of its terms times the rest in brackets."""
        if len(p) < 2:
            return p
        common, rest = common_factor(p)
        rest = self.simplified(rest)
        return self.times(common, rest if len(rest) < 2 else self.atom(GROUP, rest))

    def nested_form(self, p: Polynomial) -> Polynomial:
        """Return the sum with common factors before brackets, which nest; the most frequent factor comes first."""
        if len(p) < 2:
            return p
        common, rest = common_factor(p)
        if common.keys() != {()}:
            rest = self.nested_form(rest)
            return self.times(common, rest if len(rest) == 1 else self.atom(GROUP, rest))
        uses = Counter(factor for monomial in p for factor in monomial)
        if not uses or (most := max(uses.values())) < 2:
            return p
        most_frequent = min(factor for factor, count in uses.items() if count == most)
        shared = {m: c for m, c in p.items() if most_frequent in m}
        rest = {m: c for m, c in p.items() if m not in shared}
        return self.plus(self.nested_form(shared), self.nested_form(rest))

    # ---- functions --------------------------------------------------------------------------------------------

    def call(self, operation: str, *arguments: Polynomial) -> Polynomial:
        """Return a function of polynomials; signs of angles are taken out of sin and cos, which are numbers at 0."""
        simple = [self.simplified(argument) for argument in arguments]
        if operation in _COFUNCTION:
            (angle,) = simple
            if not angle:
                return {} if operation == "sin" else {(): ONE}
            if angle[min(angle)] < 0:
                call = self.call(operation, scaled(angle, -1))
                return scaled(call, -1) if operation == "sin" else call
        return self.atom(operation, *simple)

    def simplified(self, p: Polynomial) -> Polynomial:
        """Return the sum shortened by sin² + cos² = 1 and the addition theorems, as often as they apply."""
        while (shorter := self._pythagoras(p) or self._addition_theorem(p)) is not None:
            p = shorter
        return p

    def _pythagoras(self, p: Polynomial) -> Polynomial | None:
        """Return the sum shortened by sin² + cos² = 1; None where that is not possible."""
        for index in sorted({atom for monomial in p for atom, exponent in monomial if exponent >= 2}):
            function = self.atoms[index]
            if function.operation not in _COFUNCTION:
                continue
            partner = self._atom_index(_COFUNCTION[function.operation], function.arguments)
            terms: list[tuple[Monomial, Coefficient]] = []
            for monomial, coefficient in p.items():
                if dict(monomial).get(index, 0) >= 2:
                    rest = _monomial_product(monomial, ((index, -2),))
                    terms += [(rest, coefficient), (_monomial_product(rest, ((partner, 2),)), -coefficient)]
                else:
                    terms.append((monomial, coefficient))
            if len(shorter := _sum_of_terms(terms)) < len(p):
                return shorter
        return None

    def _addition_theorem(self, p: Polynomial) -> Polynomial | None:
        """Return the sum shortened by sin(a ± b) or cos(a ± b); None where that is not possible."""
        for monomial, c in p.items():
            waves = [index for index, e in monomial if e >= 1 and self.atoms[index].operation in _COFUNCTION]
            for first, second in combinations(waves, 2):
                a, b = self.atoms[first], self.atoms[second]
                partners = [self._atom_index(_COFUNCTION[x.operation], x.arguments) for x in (a, b)]
                rest = _monomial_product(monomial, ((first, -1), (second, -1)))
                other = _monomial_product(rest, _monomial_product(((partners[0], 1),), ((partners[1], 1),)))
                if other == monomial or abs(p.get(other, 0)) != abs(c):
                    continue
                same, alike = p[other] == c, a.operation == b.operation
                if a.operation == "cos" and not alike:
                    a, b = b, a  # sin a cos b ± cos a sin b = sin(a ± b)
                if a.operation == "sin" and alike and not same:
                    c = -c  # noqa: PLW2901 - cos a cos b ∓ sin a sin b = cos(a ± b): the sign is that of cos cos
                angle = self.plus(a.arguments[0], scaled(b.arguments[0], -1 if same == alike else 1))
                wave = self.call("cos" if alike else "sin", angle)
                rest_of_p = {m: d for m, d in p.items() if m not in (monomial, other)}
                return self.plus(rest_of_p, self.times({rest: c}, wave))
        return None

    # ---- from CasADi ------------------------------------------------------------------------------------------

    def polynomial(self, function: ca.Function, names: Sequence[str]) -> Polynomial:
        """Return the scalar result of a function of scalar symbols with these names."""
        (values,) = interpret(
            function,
            entry=lambda i, _: self.symbol(names[i]),
            constant=self.exact_constant,
            operation=self._operation_result,
        )
        return self.simplified(values[0] if values else {})

    def exact_constant(self, value: float) -> Polynomial:
        """Return a constant as a fraction, a fraction of π or a root, exact to the last bit; else as it is."""
        number = _simple_fraction(value)
        if isinstance(number, float) and math.isfinite(value):
            of_pi, square = _simple_fraction(value / math.pi), Fraction(value * value).limit_denominator(100)
            if not isinstance(of_pi, float):
                return scaled(self.symbol(PI), of_pi)
            if math.sqrt(square) == abs(value):
                return scaled(self.power({(): square}, HALF), 1 if value > 0 else -1)
        return {(): number} if number else {}

    def _operation_result(self, operation: int, x: list[Polynomial]) -> Polynomial:
        """Return the result of an operation on polynomials, by CasADi's code."""
        if operation in _ARITHMETIC:
            return _ARITHMETIC[operation](self, *x)
        if operation in (ca.OP_POW, ca.OP_CONSTPOW):
            exponent = x[1].get((), Fraction(0)) if is_number(x[1]) else None
            if isinstance(exponent, Fraction):
                return self.power(x[0], exponent)
            return self.call("pow", *x)
        return self.call(_FUNCTIONS[operation], *x)


def is_supported(function: ca.Function) -> bool:
    """Return whether all operations of a function can be written as formulas; calls of other functions cannot."""
    plain = {ca.OP_INPUT, ca.OP_OUTPUT, ca.OP_CONST, ca.OP_POW, ca.OP_CONSTPOW, *_ARITHMETIC, *_FUNCTIONS}
    return operation_codes(function) <= plain


def is_number(p: Polynomial) -> bool:
    """Return whether a sum is a constant."""
    return p.keys() <= {()}


def single_atom_index(p: Polynomial) -> int | None:
    """Return the index of the atom that equals the whole sum; None if there is none."""
    ((monomial, coefficient),) = p.items() if len(p) == 1 else [((), ONE)]
    return monomial[0][0] if coefficient == 1 and len(monomial) == 1 and monomial[0][1] == 1 else None


def scaled(p: Polynomial, factor: int | Fraction) -> Polynomial:
    """Return the sum times a number that is not 0."""
    return {monomial: coefficient * factor for monomial, coefficient in p.items()}


def common_factor(p: Polynomial) -> tuple[Polynomial, Polynomial]:
    """Return the common factor of all terms, and the remaining sum, whose first term is positive."""
    exponents = [dict(monomial) for monomial in p]
    shared = set.intersection(*map(set, exponents))
    monomial = tuple(sorted((atom, min(e[atom] for e in exponents)) for atom in shared))
    number = ONE
    fractions = [c for c in p.values() if isinstance(c, Fraction)]
    if len(fractions) == len(p):
        number = Fraction(math.gcd(*(f.numerator for f in fractions)), math.lcm(*(f.denominator for f in fractions)))
    if p[min(p)] < 0:
        number = -number
    inverse = _monomial_power(monomial, -1)
    return {monomial: number}, {_monomial_product(m, inverse): c / number for m, c in p.items()}


def _sum_of_terms(terms: Iterable[tuple[Monomial, Coefficient]]) -> Polynomial:
    """Return a polynomial of terms, like ones added up."""
    total: Polynomial = {}
    for monomial, coefficient in terms:
        total[monomial] = total.get(monomial, 0) + coefficient
    return {monomial: coefficient for monomial, coefficient in total.items() if coefficient}


def _monomial_product(a: Monomial, b: Monomial) -> Monomial:
    """Return the product of two monomials."""
    if not a or not b:
        return a or b
    exponents: dict[int, Exponent] = dict(a)
    for atom, exponent in b:
        exponents[atom] = exponents.get(atom, 0) + exponent
    return tuple(sorted((atom, exponent) for atom, exponent in exponents.items() if exponent))


def _monomial_power(monomial: Monomial, exponent: Exponent) -> Monomial:
    """Return a power of a monomial."""
    return tuple((atom, e * exponent) for atom, e in monomial)


def _simple_fraction(value: float) -> Coefficient:
    """Return the fraction with a small denominator that equals a number to the last bit; else the number."""
    if not math.isfinite(value):
        return value
    simple = Fraction(value).limit_denominator(1000)
    return simple if float(simple) == value else value


_ARITHMETIC: Mapping[int, Callable[..., Polynomial]] = {
    ca.OP_ASSIGN: lambda _, x: x,
    ca.OP_ADD: Algebra.plus,
    ca.OP_SUB: lambda a, x, y: a.plus(x, scaled(y, -1)),
    ca.OP_NEG: lambda _, x: scaled(x, -1),
    ca.OP_MUL: Algebra.times,
    ca.OP_DIV: lambda a, x, y: a.times(x, a.power(y, -1)),
    ca.OP_INV: lambda a, x: a.power(x, -1),
    ca.OP_SQ: lambda a, x: a.power(x, 2),
    ca.OP_TWICE: lambda _, x: scaled(x, 2),
    ca.OP_SQRT: lambda a, x: a.power(x, HALF),
    ca.OP_HYPOT: lambda a, x, y: a.power(a.plus(a.power(x, 2), a.power(y, 2)), HALF),
    # [c] is 1 where the condition c holds and 0 elsewhere.
    ca.OP_IF_ELSE_ZERO: Algebra.times,
    ca.OP_NOT: lambda a, x: a.plus({(): ONE}, scaled(x, -1)),
    ca.OP_AND: Algebra.times,
}
_FUNCTIONS: Mapping[int, str] = {
    getattr(ca, f"OP_{name.upper()}"): name
    for name in (
        *("sin", "cos", "tan", "asin", "acos", "atan", "sinh", "cosh", "tanh", "asinh", "acosh", "atanh"),
        *("exp", "log", "atan2", "fabs", "sign", "floor", "ceil", "fmod", "fmin", "fmax", "erf"),
        *("lt", "le", "eq", "ne", "or", "copysign", "expm1", "log1p"),
    )
}
