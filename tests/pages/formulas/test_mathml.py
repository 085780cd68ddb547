"""Formulas in MathML are read back, and must have the values of the symbols."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Mapping
from xml.etree import ElementTree
from xml.etree.ElementTree import Element

import casadi as ca
import numpy as np
import pytest

from liaisons.mechanics import assemble
from liaisons.models import CATALOGUE, PlanarCat
from liaisons_pages.formulas import LAWS, Formula, MathML, Notation, Term, formula
from liaisons_pages.formulas.algebra import Algebra
from liaisons_pages.formulas.terms import Addition, Negative, summands

FUNCTIONS = {
    **{name: getattr(math, name) for name in ("sin", "cos", "tan", "exp", "tanh", "atan2", "sqrt")},
    **{f"arc{name[1:]}": getattr(math, name) for name in ("asin", "acos", "atan")},
    "ln": math.log,
    "min": min,
    "max": max,
    "abs": abs,
    "floor": math.floor,
    "π": math.pi,
}
OPERATORS = {"−": "-", "·": "*", "\u2062": "*", "≤": "<=", "=": "==", "≠": "!=", "[": "(", "]": ")"}


# ---- a reader of MathML that shares nothing with the writer --------------------------------------------------------


def spelled(element: Element) -> str:
    """An element as a key: its tags and letters."""
    inner = "".join(spelled(child) for child in element)
    return f"{element.tag}({(element.text or '').strip()}{inner})"


def python(row: Iterable[Element], symbols: Mapping[str, float]) -> str:
    """A row of MathML as an expression in Python, where two factors with nothing between them are an error."""
    text, left = "", [element for element in row if element.tag != "mspace"]
    while left:
        element = left.pop(0)
        if left and left[0].text == "\u2061":
            _, argument = left.pop(0), left.pop(0)
            inside = list(argument) if argument.tag == "mrow" else [argument]
            if argument.tag == "mrow":
                assert (inside.pop(0).text, inside.pop().text) == ("(", ")")
            function, power = (
                (element.text, "1") if element.tag == "mi" else (element[0].text, python([element[1]], {}))
            )
            text += f"({function}({python(inside, symbols)})**{power})"
        else:
            text += single(element, symbols)
    return text


def single(element: Element, symbols: Mapping[str, float]) -> str:
    if (key := spelled(element)) in symbols:
        return f"({symbols[key]!r})"
    if element.tag == "mo":
        return OPERATORS.get(element.text or "", element.text or "")
    row, parts = python(element, symbols), [python([part], symbols) for part in element]
    size = f"abs({row[1:-1]})" if row.startswith("|") else f"({row})"
    forms = {"mfrac": "(({})/({}))", "msup": "(({})**({}))", "msqrt": f"sqrt({row})", "mrow": size}
    return forms.get(element.tag, f"({element.text})").format(*parts)


def parsed(markup: str) -> list[Element]:
    return list(ElementTree.fromstring(f"<row>{markup}</row>"))


def read(written: Formula, notation: Notation, symbols: Mapping[str, float]) -> float:
    """Value of a formula: its abbreviations one after the other, then its terms put together."""
    known = dict(symbols)
    for name, term in written.where:
        (key,) = parsed(MathML(notation).name(name.name))
        known[spelled(key)] = evaluated(term, notation, known)
    return evaluated(written.term, notation, known)


def evaluated(term: Term, notation: Notation, symbols: Mapping[str, float]) -> float:
    return eval(python(parsed("".join(MathML(notation).terms(term))), symbols), {"__builtins__": {}}, FUNCTIONS)


# ---- the formulas ----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("component", CATALOGUE, ids=lambda c: c.__name__)
def test_formulas_read_back_from_mathml_have_the_values_of_the_symbols(component) -> None:
    model = assemble(component)
    written_as, rng = Notation.from_model(model), np.random.default_rng(7)
    printer, printed = MathML(written_as), 0
    for equation in model.equations:
        written = formula(equation.right, written_as)
        if written is None:
            continue
        printed += 1
        symbols = ca.symvar(equation.right)
        function = ca.Function("f", symbols, [ca.densify(equation.right)])
        for _ in range(3):
            values = rng.uniform(0.4, 1.6, len(symbols)).tolist()  # positive, where roots and logarithms are real
            known = {spelled(parsed(printer.name(s.name()))[0]): v for s, v in zip(symbols, values, strict=True)}
            assert len(known) == len(symbols), "two symbols are written alike"
            expected = float(function.call(values)[0])
            # Terms are summed in another order: rounding, magnified where terms of size 1 to 100 cancel.
            assert read(written, written_as, known) == pytest.approx(expected, rel=1e-10, abs=1e-11), equation.left
    assert printed >= len(model.equations) / 2


def test_a_wrong_sign_would_be_found() -> None:
    x, y = ca.SX.sym("x"), ca.SX.sym("y")
    notation = Notation(["x", "y"])
    written = formula(x - 2 * y / (x + y), notation)
    assert written is not None
    known = {"mi(x)": 0.3, "mi(y)": 1.7}
    assert read(written, notation, known) == pytest.approx(0.3 - 3.4 / 2.0, rel=1e-15)
    turned = Addition(tuple(t.term if isinstance(t, Negative) else t for t in summands(written.term)))
    assert turned != written.term
    assert abs(evaluated(turned, notation, known) - read(written, notation, known)) > 1


@pytest.mark.parametrize(
    ("expression", "expected"),
    [
        (lambda x, _: ca.sin(x) ** 2 + ca.cos(x) ** 2, "1"),
        (lambda x, y: ca.cos(x) * ca.cos(y) + ca.sin(x) * ca.sin(y), "cos(x−y)"),
        (lambda x, y: ca.sin(x) * ca.cos(y) - ca.cos(x) * ca.sin(y), "sin(x−y)"),
        (lambda x, y: ca.sin(x) * ca.sin(y) - ca.cos(x) * ca.cos(y), "−cos(x+y)"),
        (lambda x, y: ca.cos(-x) + ca.sin(-y), "cosx−siny"),
        (lambda x, y: x / 2 * (2 * x * y), "x2y"),
        (lambda x, _: ca.sqrt(x**2), "|x|"),
        (lambda x, y: ca.sqrt(x * x * y) / x, "x2yx"),  # nothing is taken out of a root: x may be negative
        (lambda x, y: y * math.sqrt(3) + math.pi * x / 4, "3y+14πx"),
        (lambda x, _: x + x - 2 * x, "0"),
    ],
)
def test_expressions_become_what_people_write(expression, expected) -> None:
    x, y = ca.SX.sym("x"), ca.SX.sym("y")
    notation = Notation(["x", "y"])
    written = formula(expression(x, y), notation)
    assert written is not None
    text = "".join(t for e in parsed("".join(MathML(notation).terms(written.term))) for t in e.itertext())
    assert text.replace("\u2062", "").replace("\u2061", "") == expected


def test_names_become_letters_dots_and_subscripts() -> None:
    theta, dot = "<mi>θ</mi>", "<mover><mi>{}</mi><mo>{}</mo></mover>"
    expected = {
        "theta": theta,
        "theta_dot": dot.format("θ", "˙"),
        "theta_ddot": dot.format("θ", "¨"),
        "p_theta": f"<msub><mi>p</mi>{theta}</msub>",
        "theta_dot_0": f"<msub>{dot.format('θ', '˙')}<mn>0</mn></msub>",
        "mass_1": "<msub><mi>m</mi><mn>1</mn></msub>",
        "length_force": "<msub><mi>λ</mi><mi>l</mi></msub>",
        "bend": "<mi>κ</mi>",
        "bend_dot": dot.format("κ", "˙"),
        "bend_force": "<msub><mi>λ</mi><mi>κ</mi></msub>",
        "p_bend": "<msub><mi>p</mi><mi>κ</mi></msub>",
        "arm_1": "<msub><mi>c</mi><mn>1</mn></msub>",
        "angle": "<mi>angle</mi>",  # not the sign ∠
    }
    names = Notation([*expected, "length"], {"length", "bend"}, {"bend": "κ", "arm_1": "c_1"})
    assert {name: MathML(names).name(name) for name in expected} == expected
    assert MathML(Notation.from_model(assemble(PlanarCat))).name("arm_1") == expected["arm_1"]
    alike = Notation(["mass", "m"])
    assert alike["mass"] != alike["m"]


def test_laws_are_shown_as_they_are_written() -> None:
    for law in LAWS.values():
        shown = "".join(
            text for element in parsed(law.printed_formula(MathML(Notation([])))) for text in element.itertext()
        )
        assert shown == re.sub(r"[ _^/]", "", law.formula)


def test_equal_atoms_are_one_and_long_formulas_are_left_out() -> None:
    algebra = Algebra(limit=1)
    assert algebra.symbol("x") == algebra.symbol("x")
    x = [ca.SX.sym(f"x_{i}") for i in range(202)]
    assert formula(sum(x[:3], ca.SX(0)), Notation([])) is not None
    assert formula(sum(x, ca.SX(0)), Notation([])) is None


def test_a_formula_breaks_before_it_runs_off_the_page() -> None:
    """Between its terms; a wide bracket gets a name, so that a term is a function of narrow ones."""
    names = [f"quantity_{i}" for i in range(12)]
    x = [ca.SX.sym(name) for name in names]
    wide = sum(x[1:], x[0])
    written = formula(
        x[0] ** 2 * wide * ca.sin(x[1]) + x[2] * ca.cos(x[3]) ** 2 + x[4] / x[5] + x[6] ** 3, Notation(names)
    )
    assert written is not None
    assert len(summands(written.term)) == 4
    ((_, bracket),) = written.where
    assert len(summands(bracket)) == 12
