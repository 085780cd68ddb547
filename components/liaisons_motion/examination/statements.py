"""Statements of a docstring on the motion: equations between declared symbols, and what is constant."""

from __future__ import annotations

import inspect
import re
import unicodedata
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from itertools import pairwise
from typing import Any, final
from zlib import crc32

import casadi as ca
import numpy as np

from liaisons.language import Mechanism

_TOKEN = re.compile(
    r"(?P<space>[^\S\n]*)(?:(?P<number>\d+(?:\.\d+)?)|(?P<word>[A-Za-z]{2,}(?![A-Za-z_]))"
    r"|(?P<letter>[A-Za-zα-ωΑ-Ω](?:_[0-9A-Za-zα-ω]+)?)|(?P<primes>'+)|(?P<power>[²³⁴])|(?P<mark>.|\n))"
)
_FUNCTIONS = {name: getattr(ca, name) for name in ("sin", "cos", "tan", "sinh", "cosh", "tanh", "exp", "sqrt", "log")}
_LETTERS = {"mass": "m", "length": "l", "radius": "R", "stiffness": "k", "inertia": "I"}
_SQUARES = {"kg": "m", "kg.m2": "rad", "N/m": "m", "N.m/rad": "rad"}
"""Units of the coordinates whose squares, or squares of rates, a parameter multiplies."""
_CONSTANT = re.compile(r"\s*(?:is|are|stays?|remains?)\s+(?:constant|conserved|what it was|as it was)|\s*=\s*const")
_REGIME = re.compile(
    r"\b(small|fixed|rest|if|where|when|constant|linear|limit|above|below|for|near)\b|\bat\s*$", re.IGNORECASE
)
_LARGEST = 4
"""Free coordinates up to which accelerations are solved for symbolically."""


def statements(mechanism: Mechanism) -> dict[str, bool]:
    """Return what the docstring states on energies, momenta and accelerations: text -> whether it holds anywhere.

    What is said of a regime, and what has symbols that are not declared, is left out.
    """
    try:
        symbols = _symbols(mechanism)
        laws = _laws(mechanism, symbols)
    except RuntimeError:  # of CasADi: no accelerations in closed form
        return {}
    forces = dict.fromkeys("τF", ca.SX(0)) if mechanism.free.q_dot.numel() == 1 else {}
    known = forces | {str(law): law for law in laws} | symbols
    reader = _Reader(inspect.getdoc(type(mechanism)) or "", known, mechanism, laws)
    list(reader.equations())  # what is defined after its use
    return {text: _agree(reader.by_law(left), reader.by_law(right)) for text, left, right in reader.equations()}


def odd_factors(m: Mechanism) -> int:
    """Return how many masses, moments of inertia and stiffnesses have another factor than ½ before a square.

    A square is that of a length, an angle, their rates, or the speed of a declared point.  As sums of two parts are odd
    as well, only the difference of two counts says something.
    """
    if not m.has_energies() or m.orientations:
        return 0
    q, rates = ca.vertcat(m.free.q, m.active.s), ca.vertcat(m.free.q_dot, m.active.s_dot)
    units = {item.name: item.unit for item in (*m.coordinates, *m.actives)}
    speeds, ratios = [m.speed_squared(getattr(m, item.name)) for item in m.points], list[ca.SX]()
    for item in m.parameters:
        if item.unit in _SQUARES and item.name in m.symbols:
            is_mass, unit = item.unit.startswith("kg"), _SQUARES[item.unit]
            factor = ca.jacobian(ca.SX(m.kinetic_energy() if is_mass else m.potential_energy()), m.symbols[item.name])
            pairs = zip(ca.vertsplit(rates if is_mass else q), ca.vertsplit(q), strict=True)
            ratios += [ca.jacobian(ca.gradient(factor, x), x) for x, c in pairs if units.get(str(c)) == unit]
            ratios += [2 * factor / speed for speed in speeds if item.unit == "kg"]
    column = ca.vertcat(*ratios)
    symbols = ca.symvar(column)
    evaluate = ca.Function("ratios", symbols, [column])
    first, second = (np.array(evaluate.call(_values(symbols, k))[0]).ravel() for k in (0, 1))
    return int(np.sum((np.abs(first - second) < 1e-9) & (np.abs(first) > 1e-9) & (np.abs(first - 1) > 1e-9)))


def _values(symbols: Sequence[ca.SX], k: int) -> list[float]:
    """Values of symbols by their names, in the k-th state."""
    return [0.4 + crc32(f"{k}{s}".encode()) % 997 / 1994 for s in symbols]


def _symbols(m: Mechanism) -> dict[str, ca.SX]:
    """Scalars of the component by their names and letters."""
    symbols = dict[str, ca.SX]()
    for item in (*m.parameters, *m.coordinates, *m.actives):
        if item.name in m.symbols:
            written = item.symbol or _LETTERS.get(item.name, item.name)
            stem, mark, index = written.partition("_")
            with suppress(KeyError):
                written = unicodedata.lookup(f"GREEK SMALL LETTER {stem}") + mark + index
            symbols |= dict.fromkeys((item.name, written), m.symbols[item.name])
    return symbols


def _laws(m: Mechanism, symbols: Mapping[str, ca.SX]) -> dict[ca.SX, ca.SX]:
    """Energies, momenta, and accelerations where nothing constrains them: symbol -> expression."""
    L, q, q_dot, q_ddot = m.lagrangian(), m.free.q, m.free.q_dot, m.free.q_ddot
    momenta = ca.gradient(L, q_dot)
    laws = {ca.SX.sym("L"): ca.SX(L)}
    for momentum, coordinate in zip(ca.vertsplit(momenta), ca.vertsplit(q_dot), strict=True):
        names = [name for name, symbol in symbols.items() if f"{symbol}_dot" == str(coordinate)]
        laws |= {ca.SX.sym(f"p_{name}"): momentum for name in names}
    if m.has_energies():
        laws |= {ca.SX.sym("T"): ca.SX(m.kinetic_energy()), ca.SX.sym("V"): ca.SX(m.potential_energy())}
    further = (m.orientations, m.passive_constraints, m.rheonomic_constraints, m.contact_formulas, m.internal_states)
    if any(map(len, further)) or q.numel() > _LARGEST:
        return laws
    loss = ca.gradient(ca.SX(m.dissipation_function()), q_dot)
    if m.has_energies():
        loss += m.friction_coefficient() * ca.gradient(ca.SX(m.kinetic_energy()), q_dot)
    equations = m.dot(momenta) - ca.gradient(L, q) + loss
    at_rest = ca.substitute(equations, q_ddot, ca.SX.zeros(q_ddot.shape))
    accelerations = -ca.solve(ca.jacobian(equations, q_ddot), at_rest)
    return laws | dict(zip(ca.vertsplit(q_ddot), ca.vertsplit(accelerations), strict=True))


def _agree(left: ca.SX, right: ca.SX) -> bool:
    """Whether two expressions agree at three states, the same ones for symbols of the same names."""
    symbols = ca.symvar(ca.vertcat(left, right))
    evaluate = ca.Function("sides", symbols, [left, right])
    for k in range(3):
        a, b = map(float, evaluate.call(_values(symbols, k)))
        if not abs(a - b) <= 1e-9 * (abs(a) + abs(b) + 1e-3):
            return False
    return True


@final
class _Reader:
    """Formulas in a text, as authors write them: ``m l² θ'' = -m g l sin θ``."""

    def __init__(self, text: str, known: dict[str, Any], mechanism: Mechanism, laws: dict[ca.SX, ca.SX]) -> None:
        self.text, self.known, self.mechanism, self.laws = text, known, mechanism, laws
        self.tokens = [match for match in _TOKEN.finditer(text) if match.lastgroup]
        self.at = 0

    def by_law(self, expression: Any) -> ca.SX:
        """An expression with energies, momenta and accelerations in place of their symbols."""
        return ca.substitute([ca.SX(expression)], [*self.laws], [*self.laws.values()])[0]

    def equations(self) -> Iterator[tuple[str, Any, Any]]:
        """Yield text, left and right side of what is stated of the motion."""
        self.at = 0
        while self.at < len(self.tokens):
            start = self.at
            if self._is_edge(start - 1, "("):
                try:
                    yield from self._statement(start)
                except ValueError:
                    self.at = start
            self.at = max(self.at, start + 1)

    def _statement(self, start: int) -> Iterator[tuple[str, Any, Any]]:
        """What begins at a token; raises ValueError if it is no formula of known symbols."""
        name = self._text()
        defines = self.tokens[start].lastgroup == "letter" and name not in self.known
        if defines and self._text(start + 1) == "=":
            self.at = start + 2
            self.known[name] = self._sum()
            return
        sides, first = [self._sum()], self.tokens[start].end("space")
        is_constant = _CONSTANT.match(self.text, self._end())
        while not is_constant and self._take("="):
            sides.append(self._sum())
        before = re.split(r"[.;\n]", self.text[:first])[-1]
        after = re.match(r"\s*(\w*)", self.text[self._end() :])
        if _REGIME.search(before) or (after and _REGIME.fullmatch(after[1])) or not self._is_edge(self.at, ")"):
            return
        if is_constant:
            sides = [self._dot(sides[0]), 0]
        for left, right in pairwise(sides):
            if is_constant or any(bool(ca.depends_on(ca.SX(left - right), law)) for law in self.laws):
                yield self.text[first : is_constant.end() if is_constant else self._end()].strip(), left, right

    def _dot(self, expression: Any) -> ca.SX:
        """Rate of an expression; raises ValueError for a third derivative."""
        rates = self.mechanism.free.q_ddot
        if ca.depends_on(ca.SX(expression), rates):
            raise ValueError("a third derivative")
        named = {law: value for law, value in self.laws.items() if not ca.depends_on(rates, law)}
        return self.mechanism.dot(ca.substitute([ca.SX(expression)], [*named], [*named.values()])[0])

    def _end(self) -> int:
        return self.tokens[self.at - 1].end()

    def _text(self, index: int | None = None) -> str:
        index = self.at if index is None else index
        return self.tokens[index].group().strip(" ") if 0 <= index < len(self.tokens) else "\n"

    def _is_edge(self, index: int, bracket: str) -> bool:
        """Whether a token is a word or a punctuation mark, so that no formula goes on there."""
        if not 0 <= index < len(self.tokens) or self.tokens[index].lastgroup == "word":
            return True
        return self._text(index) in {*",.;:\n", bracket} or len(self.tokens[index]["space"]) > 1

    def _take(self, *marks: str) -> str:
        """The next token if it is one of these, which is then passed."""
        text = self._text()
        self.at += text in marks
        return text if text in marks else ""

    def _sum(self) -> Any:
        value = self._product()
        while sign := self._take("+", "-"):
            value = value + self._product() if sign == "+" else value - self._product()
        return value

    def _product(self) -> Any:
        if self._take("-"):
            return -self._product()
        value = self._factor()
        while True:
            if self._take("/"):
                value = value / self._joined()
            elif self._take("·") or self._begins():
                value = value * self._factor()
            else:
                return value

    def _joined(self) -> Any:
        """Factors without spaces between them, as of a denominator or an argument: ``2ω``."""
        value = self._factor()
        while self._begins() and not self.tokens[self.at]["space"]:
            value = value * self._factor()
        return value

    def _begins(self) -> bool:
        """Whether the next token begins a factor."""
        if self.at >= len(self.tokens) or len(self.tokens[self.at]["space"]) > 1:
            return False
        kind, text = self.tokens[self.at].lastgroup, self._text()
        return kind in {"number", "letter"} or text in {"(", "½", "√"} or text in _FUNCTIONS or text in self.known

    def _factor(self) -> Any:
        text = self._text()
        self.at += 1
        if text == "(":
            value = self._sum()
            if not self._take(")"):
                raise ValueError("a bracket is open")
        elif text == "√":
            value = ca.sqrt(self._factor())
        elif text in _FUNCTIONS:
            power = self._power()
            value = _FUNCTIONS[text](self._factor() if self._text() == "(" else self._joined()) ** power
        elif text in self.known:
            value = self.known[text]
        elif text == "½" or text.replace(".", "").isdecimal():
            value = 0.5 if text == "½" else float(text)
        else:
            raise ValueError(f"{text!r} is not declared")
        for _ in range(len(self._text()) if self._text().strip("'") == "" and self._text() else 0):
            value = self._dot(value)
        self.at += self._text()[:1] == "'"
        return value ** self._power()

    def _power(self) -> int:
        text = self._take("²", "³", "⁴")
        return "⁰¹²³⁴".index(text) if text else 1
