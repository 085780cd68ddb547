"""The page inside an FMU: what it prints is what the symbols say."""

from __future__ import annotations

import re
from dataclasses import replace
from html import unescape
from importlib.resources import files
from xml.etree import ElementTree

import casadi as ca
import numpy as np
import pytest

from liaisons.language import Mechanism, Operator, ParameterArray
from liaisons.mechanics import Model, assemble, derive, mechanism_equations
from liaisons.models import CATALOGUE, IsokineticOscillator, Pendulum, SpatialCat
from liaisons.reference_results import trajectory
from liaisons_catalogue.pendulum_chain import PendulumChain
from liaisons_pages.fmu_pages import extras
from liaisons_pages.formulas import MathML, Notation, formula

_FIGURE = re.compile(r'<svg class="figure".*?</svg>', re.DOTALL)


def index_page(model: Model) -> bytes:
    page = extras(model, "2")["documentation/index.html"]
    assert isinstance(page, bytes)
    return page


# ---- the equations: from the Lagrangian anew ---------------------------------------------------------------------


@pytest.mark.parametrize("component", [c for c in CATALOGUE if issubclass(c, Mechanism)], ids=lambda c: c.__name__)
def test_textbook_equations_agree_with_those_that_the_fmu_solves(component) -> None:
    solved = derive(component)
    m, printed = solved.mechanism, mechanism_equations(solved)
    turns = [f"{name}_dot" for turn in m.orientations for name in turn.momenta]
    rates = [*(re.sub(r"(\[.*)?$", r"_dot\1", f"p_{q.name}", count=1) for q in m.coordinates), *turns]
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
        values = dict(zip(symbols, rng.uniform(0.4, 1.6, len(symbols)), strict=True))
        for turn in m.orientations:
            length = np.linalg.norm([values[name] for name in turn.quaternion])
            values |= {name: values[name] / length for name in turn.quaternion}
        anew, solved_for = np.array(function(*values.values()))
        # The solved form divides by the mass matrix and by that of the constraints, condition up to about 1e3.
        np.testing.assert_allclose(anew, solved_for, rtol=1e-9, atol=1e-9)


def test_operators_have_their_signal() -> None:
    operators = [c for c in CATALOGUE if issubclass(c, Operator)]
    of_formulas = [c for c in operators if not any(isinstance(p, ParameterArray) for p in c.parameters)]
    assert len(of_formulas) >= 5
    for component in of_formulas:
        assert assemble(component).equations[0].left == "y"


# ---- the page ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("component", CATALOGUE, ids=lambda c: c.__name__)
def test_page_is_whole(component) -> None:
    model = assemble(component)
    page = index_page(model).decode()
    assert page == index_page(replace(model)).decode()  # written anew
    body = re.sub(r" class=\w+", "", page[page.index("<body>") : page.index("</html>")])
    root = ElementTree.fromstring(body)  # every element is closed
    assert "http" not in page  # it needs no network
    text = unescape("".join(root.itertext()))
    rows = [v for v in model.variables if v not in model.drawn]
    for variable in rows:
        assert variable.name in text
        assert variable.description.split("``")[0] in text
    for port in model.ports:
        assert port.name in text
    symbols = [ElementTree.tostring(row[0][0][0]) for row in root.iter("tr") if row[0].find("math") is not None]
    assert len(set(symbols)) == len(symbols) >= len(rows)


@pytest.mark.parametrize("component", CATALOGUE, ids=lambda c: c.__name__)
def test_page_shows_the_start_and_the_default_experiment(component) -> None:
    model = assemble(component)
    page = index_page(model).decode()
    figures = [(f.get("aria-label"), f) for f in ElementTree.fromstring(f"<all>{''.join(_FIGURE.findall(page))}</all>")]
    drawn = [model.name] if model.picture else []
    plotted = [] if model.contacts or model.sample else ["the default experiment"]  # no integration with events
    assert [label for label, _ in figures] == [*drawn, *plotted]
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
    text = (files("liaisons") / "bibliography.md").read_text(encoding="utf-8")
    known = re.findall(r"(?m)^\* \*\*(\w+)\*\* ", text)
    assert {"K", "M", "Kane"} <= set(known)
    marks = {m for c in CATALOGUE for m in re.findall(r"\b([A-Z])(?= (?:eq|Ex)\.)", assemble(c).documentation)}
    assert {"K", "M"} <= marks <= set(known)


def test_no_accent_falls_into_its_letter() -> None:  # as it does without a mathematics font
    assert 'accent="true"' not in index_page(assemble(SpatialCat)).decode()


def test_each_equation_is_shown_or_named_as_too_long() -> None:
    model = assemble(SpatialCat)  # some of its formulas are too long
    page, notation = index_page(model).decode(), Notation.from_model(model)
    printer = MathML(notation)
    for equation in model.equations:
        written = formula(equation.right, notation)
        assert (printer.terms(written.term)[0] if written else printer.name(equation.left)) in page
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
