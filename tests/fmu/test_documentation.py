"""The page inside an FMU: what it prints is read back from its MathML and must be what the symbols say."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Mapping
from html import unescape
from xml.etree import ElementTree
from xml.etree.ElementTree import Element

import casadi as ca
import numpy as np
import pytest

from liaisons.fmu.documentation import index_page
from liaisons.fmu.documentation.algebra import Algebra
from liaisons.fmu.documentation.laws import LAWS
from liaisons.fmu.documentation.mathml import LONGEST, Formula, Terms, formula
from liaisons.fmu.documentation.notation import Notation
from liaisons.fmu.documentation.sources import bibliography
from liaisons.fmu.reference_results import trajectory
from liaisons.language import Mechanism, Operator, ParameterArray
from liaisons.mechanics import assemble
from liaisons.mechanics.equations import derive
from liaisons.mechanics.printing import of_mechanism
from liaisons.models import CATALOGUE, IsokineticOscillator, Pendulum, PlanarCat, SpatialCat
from liaisons.models.pendulum_chain import PendulumChain

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
_FIGURE = re.compile(r'<svg class="figure".*?</svg>', re.DOTALL)
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


def read(written: Formula, symbols: Mapping[str, float]) -> float:
    """Value of a formula: its abbreviations one after the other, then its terms put together."""
    known = dict(symbols)
    for name, markup in written.where:
        (key,) = parsed(name)
        known[spelled(key)] = evaluated(markup, known)
    return evaluated(written.terms, known)


def evaluated(terms: Terms, symbols: Mapping[str, float]) -> float:
    return eval(python(parsed("".join(terms)), symbols), {"__builtins__": {}}, FUNCTIONS)


# ---- the formulas ----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("component", CATALOGUE, ids=lambda c: c.__name__)
def test_formulas_read_back_from_mathml_have_the_values_of_the_symbols(component) -> None:
    model = assemble(component)
    written_as, rng = Notation.from_model(model), np.random.default_rng(7)
    printed = 0
    for equation in model.equations:
        written = formula(equation.right, written_as)
        if written is None:
            continue
        printed += 1
        symbols = ca.symvar(equation.right)
        function = ca.Function("f", symbols, [ca.densify(equation.right)])
        for _ in range(3):
            values = rng.uniform(0.4, 1.6, len(symbols)).tolist()  # positive, where roots and logarithms are real
            known = {spelled(parsed(written_as[s.name()])[0]): v for s, v in zip(symbols, values, strict=True)}
            assert len(known) == len(symbols), "two symbols are written alike"
            expected = float(function.call(values)[0])
            # Terms are summed in another order: rounding, magnified where terms of size 1 to 100 cancel.
            assert read(written, known) == pytest.approx(expected, rel=1e-10, abs=1e-11), equation.left
    assert printed >= len(model.equations) / 2


def test_a_wrong_sign_would_be_found() -> None:
    x, y = ca.SX.sym("x"), ca.SX.sym("y")
    written = formula(x - 2 * y / (x + y), Notation(["x", "y"]))
    assert written is not None
    known = {"mi(x)": 0.3, "mi(y)": 1.7}
    assert read(written, known) == pytest.approx(0.3 - 3.4 / 2.0, rel=1e-15)
    turned = type(written)(tuple(term.replace("−", "+") for term in written.terms), written.where, written.operations)
    assert abs(read(turned, known) - read(written, known)) > 1


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
    written = formula(expression(x, y), Notation(["x", "y"]))
    assert written is not None
    text = "".join(t for e in parsed("".join(written.terms)) for t in e.itertext())
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
    assert {name: names[name] for name in expected} == expected
    assert Notation.from_model(assemble(PlanarCat))["arm_1"] == expected["arm_1"]
    alike = Notation(["mass", "m"])
    assert alike["mass"] != alike["m"]


def test_laws_are_shown_as_they_are_written() -> None:
    for law in LAWS.values():
        shown = "".join(text for element in parsed(law.markup) for text in element.itertext())
        assert shown == re.sub(r"[ _^/]", "", law.formula)


def test_equal_atoms_are_one_and_long_formulas_are_left_out() -> None:
    algebra = Algebra(limit=1)
    assert algebra.symbol("x") == algebra.symbol("x")
    x = [ca.SX.sym(f"x_{i}") for i in range(LONGEST + 2)]
    assert formula(sum(x[:3], ca.SX(0)), Notation([])) is not None
    assert formula(sum(x, ca.SX(0)), Notation([])) is None


# ---- the equations: from the Lagrangian anew ---------------------------------------------------------------------


@pytest.mark.parametrize("component", [c for c in CATALOGUE if issubclass(c, Mechanism)], ids=lambda c: c.__name__)
def test_textbook_equations_agree_with_those_that_the_fmu_solves(component) -> None:
    solved = derive(component)
    m, printed = solved.mechanism, of_mechanism(solved)
    turns = [f"{name}_dot" for turn in m.orientations for name in turn.momenta]
    rates = [*(f"p_{q.name}_dot" for q in m.coordinates), *turns]
    known = dict(zip(rates, ca.vertsplit(solved.momentum_rates), strict=True))
    known |= {f"{s.name}_force": solved.operator_forces[i] for i, s in enumerate(m.actives)}
    known |= {f"p_{q.name}": solved.momenta[i] for i, q in enumerate(m.coordinates)}
    pairs = [(equation, known[equation.left]) for equation in printed if equation.left in known]
    assert len(pairs) >= 2 * len(m.coordinates) + len(m.actives) - len(m.rheonomic_constraints)
    both = ca.horzcat(*(solved.in_motion(ca.vertcat(equation.right, other)) for equation, other in pairs))
    symbols = solved.symbols
    function = ca.Function("f", list(symbols.values()), [ca.densify(both)])
    rng = np.random.default_rng(11)
    for _ in range(3):
        anew, solved_for = np.array(function(*rng.uniform(0.4, 1.6, len(symbols))))
        # The solved form divides by the mass matrix and by that of the constraints, condition up to about 1e3.
        np.testing.assert_allclose(anew, solved_for, rtol=1e-9, atol=1e-9)


def test_operators_have_their_signal() -> None:
    for component in CATALOGUE:
        if issubclass(component, Operator) and not any(isinstance(p, ParameterArray) for p in component.parameters):
            assert assemble(component).equations[0].left == "y"


# ---- the page ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("component", CATALOGUE, ids=lambda c: c.__name__)
def test_page_is_whole(component) -> None:
    model = assemble(component)
    page = index_page(model).decode()
    assert page == index_page.__wrapped__(model).decode()  # written anew
    body = re.sub(r" class=\w+", "", page[page.index("<body>") : page.index("</html>")])
    root = ElementTree.fromstring(body)  # every element is closed
    assert "http" not in page  # it needs no network
    text = unescape("".join(root.itertext()))
    rows = [v for v in model.variables if v not in model.drawn[1:]]  # what only the picture needs has one
    for variable in rows:
        assert (variable.name.partition("[")[0] if variable in model.drawn else variable.name) in text
        assert variable.description.split("``")[0] in text
    for port in model.ports:
        assert port.name in text
    symbols = [spelled(row[0][0][0]) for row in root.iter("tr") if row[0].find("math") is not None]
    assert len(set(symbols)) == len(symbols) >= len(rows)


@pytest.mark.parametrize("component", CATALOGUE, ids=lambda c: c.__name__)
def test_page_shows_the_start_and_the_default_experiment(component) -> None:
    model = assemble(component)
    page = index_page(model).decode()
    figures = [(f.get("aria-label"), f) for f in ElementTree.fromstring(f"<all>{''.join(_FIGURE.findall(page))}</all>")]
    drawn = [model.name] if model.picture else []
    assert [label for label, _ in figures] == [*drawn, "the default experiment"]
    for _, figure in figures:
        x, y, width, height = map(float, figure.attrib["viewBox"].split())
        shapes = [shape.attrib["points"].split() for shape in figure if "points" in shape.attrib]
        assert len(shapes) >= 1
        places = np.array([[float(number) for number in place.split(",")] for shape in shapes for place in shape])
        assert (places >= [x, y]).all()
        assert (places <= [x + width, y + height]).all()
    assert (f"liaisons show {model.name}.fmu" in page) == bool(drawn)


def test_a_long_chain_is_not_drawn_into_its_page() -> None:
    assert "<svg" not in index_page(assemble(PendulumChain, 200)).decode()


def test_the_plot_has_the_values_of_the_reference_results() -> None:
    model = assemble(Pendulum)
    results = trajectory(model)
    assert results is not None
    (line,) = re.findall(r'<polyline points="([^"]*)"', index_page(model).decode())
    x, y = np.array([[float(number) for number in place.split(",")] for place in line.split()]).T
    theta = results["theta"][:, 0]
    assert x / x[-1] * results.times[-1] == pytest.approx(results.times, abs=0.05 / 640 * 10)
    assert theta.max() - y / y.max() * np.ptp(theta) == pytest.approx(theta, abs=0.1 / 220 * np.ptp(theta))


def test_page_says_what_the_component_is_checked_against() -> None:
    page = index_page(assemble(Pendulum)).decode()
    assert "Pendulum.exact" in page
    assert "elliptic functions" in page
    assert "input_reconstruction" in page


def test_page_names_its_sources_in_full() -> None:
    page = index_page(assemble(SpatialCat)).decode()
    sources = page[page.index('<section id="sources">') :]
    for words in ("Kneller", "Marle", "falling cat phenomenon", "Das Umdrehen"):
        assert words in sources
    assert "Featherstone" not in sources


def test_every_mark_in_a_docstring_stands_in_the_bibliography() -> None:
    known = bibliography()
    assert {"K", "M", "Kane"} <= set(known)
    marks = {m for c in CATALOGUE for m in re.findall(r"\b([A-Z])(?= (?:eq|Ex)\.)", assemble(c).documentation)}
    assert {"K", "M"} <= marks <= set(known)


def test_a_formula_breaks_before_it_runs_off_the_page() -> None:
    """Between its terms; a wide bracket gets a name, so that a term is a function of narrow ones."""
    names = [f"quantity_{i}" for i in range(12)]
    x = [ca.SX.sym(name) for name in names]
    wide = sum(x[1:], x[0])
    written = formula(
        x[0] ** 2 * wide * ca.sin(x[1]) + x[2] * ca.cos(x[3]) ** 2 + x[4] / x[5] + x[6] ** 3, Notation(names)
    )
    assert written is not None
    assert len(written.terms) == 4
    ((_, bracket),) = written.where
    assert len(bracket) == 12
    page = index_page(assemble(SpatialCat)).decode()
    assert 'accent="true"' not in page  # without a mathematics font accents fall into their letters


def test_each_equation_is_shown_or_named_as_too_long() -> None:
    model = assemble(SpatialCat)  # some of its formulas are too long
    page, written_as = index_page(model).decode(), Notation.from_model(model)
    for equation in model.equations:
        written = formula(equation.right, written_as)
        assert (written.terms[0] if written else written_as[equation.left]) in page
    assert "Too long to be read" in page
    nothing = [equation for equation in assemble(IsokineticOscillator).equations if equation.left == "0"]
    assert nothing
    assert "<mn>0</mn><mo>=</mo>" in index_page(assemble(IsokineticOscillator)).decode()


def test_links_of_a_chain_are_shown_with_their_joints() -> None:
    model = assemble(PendulumChain, 3)
    page = index_page(model).decode()
    assert "One link" in page
    assert "where the link before ends" in page
    assert "theta[1…n]" in page
    assert "that of a link" in index_page(model.flat()).decode()  # theta is no variable there
