"""Equations to be read: LaTeX that parses, text that fits and is read back, numbers of SymPy."""

from __future__ import annotations

import dataclasses
import math
import re
import sys
from collections.abc import Iterable, Mapping
from functools import cache
from itertools import pairwise

import casadi as ca
import numpy as np
import pytest
from matplotlib.mathtext import MathTextParser

from liaisons import derive, equations
from liaisons.composition import compose
from liaisons.errors import LiaisonsError, ProjectError
from liaisons.language import Mechanism
from liaisons.mechanics import assemble
from liaisons.models import (
    CATALOGUE,
    CartesianPendulum,
    ChargedParticle,
    CircularHoop,
    DoublePendulum,
    EllipticHoop,
    Flywheel,
    ForceRegulator,
    IsokineticOscillator,
    Pendulum,
    PendulumChain,
    PlannedMotion,
    Sinusoid,
    SpatialCat,
    Swing,
)
from liaisons_pages.formulas import DisplayedEquations, Formula, Notation, formula
from liaisons_pages.formulas.latex import LaTeX
from liaisons_pages.formulas.symbolic import expression
from liaisons_pages.formulas.terms import Application, Name
from liaisons_pages.formulas.unicode import Unicode, width

UNCONSTRAINED = [
    c
    for c in CATALOGUE
    if issubclass(c, Mechanism) and not (c.constraints or c.non_holonomic or c.rheonomic_constraints)
]

displayed = cache(equations)  # a component's are written once for all tests


# ---- LaTeX and text ------------------------------------------------------------------------------------------------


_read: set[tuple[str, str]] = set()  # neighbouring signs in lines that were parsed


@pytest.mark.parametrize("every_line", [False, pytest.param(True, marks=pytest.mark.slow)])
@pytest.mark.parametrize("component", CATALOGUE, ids=lambda c: c.__name__)
@pytest.mark.variants(core="Pendulum-False")
def test_latex_is_read_by_mathtext(component, every_line) -> None:
    """Quickly, lines that have two signs side by side that no line before has; the parser takes 80 s for all lines."""
    text, parser = displayed(component).latex(), MathTextParser("path")
    inside = re.findall(r"\\begin\{align\*\}\n(.*?)\n\\end\{align\*\}", text, re.DOTALL)
    lines = [line for block in inside for line in block.split(" \\\\\n")] + re.findall(r"\$(.+?)\$", text)
    assert inside or text.endswith("It is read from a table.")
    for line in lines:
        signs = re.findall(r"\\[A-Za-z]+|\\.|\S", re.sub(r"\d+", "1", line))
        pairs = {*pairwise(signs)}
        if every_line or not pairs <= _read:
            parser.parse(f"${line.replace('&', '')}$")
            _read.update(pairs)


@pytest.mark.parametrize("component", CATALOGUE, ids=lambda c: c.__name__)
def test_text_fits_the_terminal(component) -> None:
    shown = displayed(component)
    for columns in (80, 50):
        lines = shown.text(columns).splitlines()
        assert max(map(width, lines)) <= columns
        assert not {"\u00a0", "\u202f"} & set("".join(lines))


def test_signs_of_equality_stand_below_each_other() -> None:
    lines = displayed(Pendulum)["effective_mass"].text().splitlines()[1:]
    assert len({width(line.partition(" = ")[0]) for line in lines}) == 1


def test_the_terminal_decides_how_wide_the_text_is(monkeypatch) -> None:
    shown = displayed(Pendulum)
    monkeypatch.setenv("COLUMNS", "60")
    assert str(shown) == shown.text(60) != shown.text(90)


_RAISED = str.maketrans("⁰¹²³⁴⁵⁶⁷⁸⁹⁻", "0123456789-")
_VULGAR = dict(zip("½⅓⅔¼¾⅙⅛⅜", (1 / 2, 1 / 3, 2 / 3, 1 / 4, 3 / 4, 1 / 6, 1 / 8, 3 / 8), strict=True))
_FUNCTIONS = {
    **{name: getattr(math, name) for name in ("sin", "cos", "tan", "exp", "sinh", "cosh", "tanh", "atan2", "floor")},
    **{f"arc{name}": getattr(math, f"a{name}") for name in ("sin", "cos", "tan")},
    "ln": math.log,
    "√": math.sqrt,
    "min": min,
    "max": max,
}
_RELATIONS = {"<": float.__lt__, "≤": float.__le__, "=": float.__eq__, "≠": float.__ne__}


class Reader:
    """Value of a formula for terminals, by a recursive descent that shares nothing with the printer."""

    def __init__(self, text: str, names: Mapping[str, float]) -> None:
        self.names = names
        words = "|".join(map(re.escape, sorted({*names, *_FUNCTIONS}, key=len, reverse=True)))
        self.tokens = re.findall(rf"{words}|\d+\.?\d*|[⁰¹²³⁴⁵⁶⁷⁸⁹⁻]+|\S", text)
        assert "".join(self.tokens) == "".join(text.split())
        self.value = self.sum()
        assert not self.tokens

    def next_is(self, choices: Iterable[str]) -> bool:
        return bool(self.tokens) and self.tokens[0] in choices

    def sum(self) -> float:
        total = 0.0 if self.next_is("−") else self.product()
        while self.next_is("+−"):
            sign = self.tokens.pop(0)
            total += self.product() * (1 if sign == "+" else -1)
        return total

    def product(self) -> float:
        value = self.power()
        while self.tokens and not self.next_is("+−)],|<≤=≠"):
            if self.next_is("/"):
                self.tokens.pop(0)
                value /= self.power()
            else:
                if self.next_is("·"):
                    self.tokens.pop(0)
                value *= self.power()
        return value

    def exponent(self) -> float:
        if self.tokens and set(self.tokens[0]) <= set("⁰¹²³⁴⁵⁶⁷⁸⁹⁻"):
            return float(self.tokens.pop(0).translate(_RAISED))
        if self.next_is("^"):
            self.tokens.pop(0)
            return self.atom()
        return 1.0

    def power(self) -> float:
        value = self.atom()
        return value ** self.exponent()

    def atom(self) -> float:
        token = self.tokens.pop(0)
        if token in self.names:
            return self.names[token]
        if token in _FUNCTIONS:
            power = self.exponent()
            arguments = self.bracketed() if self.next_is("(") else [self.atom()]
            return float(_FUNCTIONS[token](*arguments)) ** power
        if token in "([|":
            self.tokens.insert(0, token)
            return self.bracketed()[0]
        return _VULGAR[token] if token in _VULGAR else float(token)

    def bracketed(self) -> list[float]:
        opened, values = self.tokens.pop(0), [self.sum()]
        while self.next_is(","):
            self.tokens.pop(0)
            values.append(self.sum())
        if opened == "[":
            values = [float(_RELATIONS[self.tokens.pop(0)](values[0], self.sum()))]
        assert self.tokens.pop(0) == {"(": ")", "[": "]", "|": "|"}[opened]
        return [abs(values[0])] if opened == "|" else values


@pytest.mark.parametrize("component", CATALOGUE, ids=lambda c: c.__name__)
@pytest.mark.variants(core="Pendulum")
def test_text_read_back_has_the_values_of_the_symbols(component) -> None:
    shown = displayed(component)
    notation, rng, count = shown.notation, np.random.default_rng(5), 0
    printer = Unicode(notation)
    for equation in shown.equations:
        if (written := formula(equation.right, notation)) is None:
            continue
        symbols = ca.symvar(equation.right)
        values = rng.uniform(0.4, 1.6, len(symbols)).tolist()
        known = {printer.name(s.name()): v for s, v in zip(symbols, values, strict=True)} | {"π": math.pi}
        for name, term in written.where:
            known[printer.name(name.name)] = Reader(printer.row(term), known).value
        expected = float(ca.Function("f", symbols, [ca.densify(equation.right)]).call(values)[0])
        assert Reader(printer.row(written.term), known).value == pytest.approx(expected, rel=1e-9, abs=1e-10), (
            equation.left
        )
        count += 1
    assert count >= len(shown.equations) / 2
    assert count or component in {PlannedMotion, ForceRegulator}  # whose equations read tables


def test_words_are_upright_and_no_products() -> None:
    x, y = ca.SX.sym("spring_rest"), ca.SX.sym("offset_x")
    notation = Notation(["spring_rest", "offset_x", "m"])
    written = formula(x * y * ca.SX.sym("m"), notation)
    assert written is not None
    assert LaTeX(notation).row(written.term) == r"\mathrm{spring}_{\mathrm{rest}} \, \mathrm{offset}_{x} \, m"
    assert (
        Unicode(notation).row(written.term).replace("\u00a0", " ").replace("\u202f", " ") == "spring_rest · offsetₓ · m"
    )


# ---- SymPy ---------------------------------------------------------------------------------------------------------


def values_at_a_state(component: type[Mechanism], seed: int, *, alone: bool = False) -> dict[str, float]:
    """All variables at a random state, by the FMU's functions; without drives and loads if it is alone."""
    rng, model = np.random.default_rng(seed), assemble(component).flat()
    f = model.outputs_function
    t, y, u, k, m = (rng.uniform(0.4, 1.6, f.size1_in(i)) for i in range(5))
    turned = [s.name in {q for o in component.orientations for q in o.quaternion} for s in model.states]
    y[turned] /= np.linalg.norm(y[turned]) if any(turned) else 1.0
    m[["_closed" in name for name in model.memory]] = 0  # gaps are open at such a state
    u[[alone and v.name.partition("[")[0].endswith(("_force", "_load")) for v in model.inputs]] = 0
    names = [v.name for group in (model.parameters, model.inputs, model.outputs) for v in group]
    numbers = np.concatenate([k, u, np.array(f(t, y, u, k, m)).ravel()])
    return dict(zip(names, numbers.tolist(), strict=True)) | {"t": float(t[0])}


def number(sympy, expression, values: Mapping[str, float]) -> float:
    symbols = sorted(expression.free_symbols, key=str)
    return float(sympy.lambdify(symbols, expression, cse=True, dummify=True)(*(values[str(s)] for s in symbols)))


@pytest.mark.parametrize("component", UNCONSTRAINED, ids=lambda c: c.__name__)
@pytest.mark.variants(core="Pendulum")
def test_numbers_of_sympy_are_those_of_the_fmu(component) -> None:
    sympy = pytest.importorskip("sympy", reason="optional: pip install 'liaisons[sympy]'")
    shown, checked = displayed(component), 0
    for part, equation in ((name, equation) for name in shown.parts for equation in shown[name].sympy()):
        for seed in (1, 2):
            values = values_at_a_state(component, seed, alone=part == "accelerations")
            if str(equation.lhs) in values and {str(s) for s in equation.rhs.free_symbols} <= values.keys():
                # Solved for, the FMU's numbers come from divisions by the mass matrix, condition up to about 1e3.
                expected = pytest.approx(values[str(equation.lhs)], rel=1e-8, abs=1e-8)
                assert number(sympy, equation.rhs, values) == expected, equation.lhs
                checked += 1
    by_frames = any(equation.section.startswith("spatial") for equation in shown.equations)  # whose symbols are theirs
    assert checked >= (0 if by_frames else 4 * len(component.coordinates))


@pytest.mark.parametrize("component", [DoublePendulum, Swing, EllipticHoop], ids=lambda c: c.__name__)
def test_accelerations_solve_the_matrix_form(component) -> None:
    sympy = pytest.importorskip("sympy", reason="optional: pip install 'liaisons[sympy]'")
    shown, values = displayed(component), values_at_a_state(component, 3, alone=True)
    names = [q.name for q in component.coordinates]
    found = {str(e.lhs): number(sympy, e.rhs, values) for e in shown["matrix"].sympy()}
    A = [[found.get(f"A[{a},{b}]", found.get(f"A[{b},{a}]", 0.0)) for a in names] for b in names]
    solved = np.linalg.solve(A, [-found[f"h[{name}]"] for name in names])
    assert solved.tolist() == pytest.approx([values[f"{name}_ddot"] for name in names], rel=1e-10)


@pytest.mark.parametrize("component", [EllipticHoop, Flywheel, ChargedParticle], ids=lambda c: c.__name__)
def test_canonical_equations_follow_from_the_hamiltonian_and_it_from_the_lagrangian(component) -> None:
    sympy = pytest.importorskip("sympy", reason="optional: pip install 'liaisons[sympy]'")
    shown = displayed(component)
    (L,), (H,) = ([e.rhs for e in shown[part].sympy()] for part in ("lagrangian", "hamiltonian"))
    rows = {str(e.lhs): e.rhs for e in shown["canonical"].sympy()}
    names = [item.name for item in (*component.coordinates, *component.actives)]
    symbol = {str(s): s for s in (L + H).free_symbols}
    values = values_at_a_state(component, 3)
    momenta = {f"p_{name}": number(sympy, sympy.diff(L, symbol[f"{name}_dot"]), values) for name in names}
    values |= momenta
    masses = shown["effective_mass"].sympy() if "effective_mass" in shown.parts else []
    values |= {str(e.lhs): number(sympy, e.rhs, values) for e in masses}  # by which H is written
    Legendre = sum(momenta[f"p_{name}"] * values[f"{name}_dot"] for name in names) - number(sympy, L, values)
    assert number(sympy, H, values) == pytest.approx(Legendre, rel=1e-10)
    for name in names:
        by_p = number(sympy, sympy.diff(H, symbol[f"p_{name}"]), values)
        assert by_p == pytest.approx(values[f"{name}_dot"], rel=1e-9)
        assert number(sympy, rows[f"{name}_dot"], values) == pytest.approx(by_p, rel=1e-9)
    for q in component.coordinates:  # with drives, loads and friction, as the FMU has it
        assert number(sympy, rows[f"p_{q.name}_dot"], values) == pytest.approx(values[f"p_{q.name}_dot"], rel=1e-9)


def test_the_hamiltonian_of_a_hoop_shows_its_effective_mass_and_sums_are_operators_in_latex() -> None:
    shown = displayed(CircularHoop)
    assert "H = p_ξ²/(2 m) + (p_ξ (R + d cos(ξ/R)) − pᵦ)²/(2 Θ)" in shown["hamiltonian"].text(200)
    latex = shown["hamiltonian"].latex()
    assert r"\sum p_{k}" in latex
    assert r"\Sigma" not in latex


def test_numbers_of_sympy_are_those_of_the_fmu_on_the_constraints() -> None:
    sympy = pytest.importorskip("sympy", reason="optional: pip install 'liaisons[sympy]'")
    model, f = assemble(CartesianPendulum), assemble(CartesianPendulum).outputs_function
    parameters = {v.name: v.starts[0] for v in model.parameters}
    rod, angle, rate, rod_dot = 1.3, 0.7, 0.9, 0.4
    at = {"x": rod * math.sin(angle), "y": 0.0, "z": parameters["height"] - rod * math.cos(angle)}
    speed = {
        "x": rod_dot * math.sin(angle) + rod * rate * math.cos(angle),
        "y": 0.0,
        "z": rod * rate * math.sin(angle) - rod_dot * math.cos(angle),
    }
    inputs = dict.fromkeys((v.name for v in model.inputs), 0.3) | {"rod": rod, "rod_dot": rod_dot, "rod_ddot": -0.6}
    y = [at.get(s.name, parameters["mass"] * speed.get(s.name[2:], 0.0)) for s in model.states]
    z = np.array(f(0, y, [*inputs.values()], [*parameters.values()], np.zeros(f.size1_in(4)))).ravel()
    values = parameters | inputs | dict(zip((v.name for v in model.outputs), z.tolist(), strict=True))
    shown = [e for e in equations(CartesianPendulum).sympy() if str(e.lhs) in values]
    assert {"p_x", "x_dot", "p_z_dot", "lambda_plane", "rod_force", "rod_power"} <= {str(e.lhs) for e in shown}
    for equation in shown:  # the FMU's have 1e-10 more in their matrix, so that constraints may lose rank
        assert number(sympy, equation.rhs, values) == pytest.approx(values[str(equation.lhs)], rel=1e-8, abs=1e-8)


@pytest.mark.parametrize(
    ("function", "arguments", "value"),
    [
        ("abs", (-2,), 2),
        ("min", (-2, 3), -2),
        ("max", (-2, 3), 3),
        ("ceil", (0.5,), 1),
        ("floor", (0.5,), 0),
        *(("lt", a, float(a[0] < a[1])) for a in ((1, 2), (2, 2), (2, 1))),
        *(("le", a, float(a[0] <= a[1])) for a in ((1, 2), (2, 2), (2, 1))),
        *(("eq", a, float(a[0] == a[1])) for a in ((1, 2), (2, 2))),
        *(("ne", a, float(a[0] != a[1])) for a in ((1, 2), (2, 2))),
    ],
)
def test_functions_have_their_names_in_sympy(function: str, arguments: tuple[float, ...], value: float) -> None:
    pytest.importorskip("sympy", reason="optional: pip install 'liaisons[sympy]'")
    names = tuple(Name(f"x_{i}") for i in range(len(arguments)))
    written = expression(Formula(Application(function, names), ()))
    assert float(written.subs({s: arguments[int(str(s)[2:])] for s in written.free_symbols})) == value


def test_without_sympy_the_error_says_what_to_install(monkeypatch) -> None:
    monkeypatch.setitem(sys.modules, "sympy", None)
    with pytest.raises(ProjectError, match=r"pip install 'liaisons\[sympy\]'"):
        displayed(Pendulum).sympy()


# ---- parts and subjects --------------------------------------------------------------------------------------------


def test_parts_have_names() -> None:
    shown = equations("Pendulum")
    assert isinstance(shown, DisplayedEquations)
    assert shown.parts[:5] == ("lagrangian", "energy", "friction", "momenta", "rates")
    assert (
        shown["momenta"].text() == "Momenta (K eq. 78, M eq. 10): pₖ = ∂L/∂q̇ₖ\n  p_θ = m l (l θ̇ + ẋₚ cos θ + żₚ sin θ)"
    )
    assert "rank 2 in 4 rates" in shown["hamiltonian"].text(200)
    assert shown["motion"]._repr_latex_() == shown["motion"].latex()
    assert shown["motion"]._repr_html_().count("<h3>") == 1
    with pytest.raises(ProjectError, match=r"Pendulum has no equations called 'motin'; did you mean 'motion'\?"):
        shown["motin"]


def test_numbers_of_the_texts_stand_beside_the_parts() -> None:
    shown = equations("Swing")
    titles = {part: shown[part].text(200).splitlines()[0] for part in shown.parts}
    assert titles["forces"].startswith("Forces of the operators (M eq. 27): λ")
    assert titles["effective_mass"].startswith("Effective mass at the active ports (M eq. 50): ")
    assert titles["motion"].startswith("Equations of motion (K eq. 65, M eq. 26, 36): ")
    assert titles["points"] == "Points"


def test_prescribed_coordinates_at_rest_leave_the_formulas() -> None:
    shown = equations("Pendulum").fix("pivot_x", "pivot_z", "length")
    assert shown["accelerations"].text().endswith("  θ̈ = −η θ̇ − g sin θ/l")  # the length is 1 at the start, and stays
    assert shown["matrix"].text().splitlines()[1:] == ["  A_θ,θ = m l²", "    h_θ = m l (g sin θ + η l θ̇)"]
    assert shown["momenta"].text().endswith("p_θ = m l² θ̇")
    assert not {"forces", "power", "effective_mass"} & {*shown.parts}
    one = equations("Pendulum").fix("pivot_x")
    assert [e.left for e in one["forces"].equations] == ["length_force", "pivot_z_force"]
    assert "ẋₚ" not in one.text()
    assert "without --fix" in equations("Swing").fix("rope")["hamiltonian"].text(200)
    with pytest.raises(ProjectError, match="Pendulum prescribes no 'theta'; known: length, pivot_x, pivot_z"):
        equations("Pendulum").fix("theta")
    with pytest.raises(ProjectError, match="prescribes no 'length'"):
        equations("Pendulum").fix("length").fix("length")


def test_coupled_accelerations_at_rest_are_those_of_textbooks() -> None:
    shown = equations("DoublePendulum").fix("pivot_x", "pivot_z")
    assert shown["matrix"].text(200).splitlines()[1:] == [
        "  A_θ₁,θ₁ = l₁² (m₁ + m₂)",
        "  A_θ₁,θ₂ = m₂ l₁ l₂ cos(θ₁ − θ₂)",
        "  A_θ₂,θ₂ = m₂ l₂²",
        "     h_θ₁ = l₁ (g (m₁ + m₂) sin θ₁ + m₂ l₂ θ̇₂² sin(θ₁ − θ₂))",
        "     h_θ₂ = −m₂ l₂ (l₁ θ̇₁² sin(θ₁ − θ₂) − g sin θ₂)",
    ]
    assert not {"ẋₚ", "żₚ", "ẍₚ"} & {*shown["accelerations"].text().split()}


@pytest.mark.parametrize(
    ("component", "reason"),
    [(SpatialCat, "attitude is not a coordinate"), (CartesianPendulum, "rod is not a coordinate")],
)
def test_without_a_hamiltonian_a_line_says_why(component, reason) -> None:
    shown = displayed(component)
    assert "canonical" not in shown.parts
    assert reason in shown["hamiltonian"].text(200)
    assert reason in shown["hamiltonian"].latex()
    assert reason in shown["hamiltonian"]._repr_html_()


def test_a_reason_in_latex_has_its_underscores_escaped() -> None:
    shown = equations(Flywheel)
    noted = dataclasses.replace(shown, equations=(), notes={"hamiltonian": "hinge_1 is no coordinate."})
    assert noted.latex().endswith("hinge\\_1 is no coordinate.")


def test_multipliers_of_a_non_holonomic_constraint_are_solved_for() -> None:
    assert "multipliers" in equations(IsokineticOscillator).parts


def test_names_classes_files_and_models_are_taken(tmp_path) -> None:
    file = tmp_path / "mine.py"
    file.write_text("from liaisons.models import Flywheel\n\n\nclass Mine(Flywheel):\n    '''A wheel.'''\n")
    assert equations(str(file)).text() == equations(Flywheel).text() == equations("Flywheel").text()
    assert derive(file).name == "Mine"
    assert derive("Pendulum").name == derive(Pendulum).name == "Pendulum"
    assert equations(assemble(PendulumChain, 3))["link"].text()


@pytest.mark.parametrize("subject", ["Pendulim", 3, None, Mechanism, "no_such_file.py"])
def test_what_is_no_component_is_refused(subject) -> None:
    for function in (equations, derive):
        with pytest.raises(LiaisonsError):
            function(subject)


@pytest.mark.parametrize("component", [PendulumChain, Sinusoid])
def test_what_has_no_lagrangian_of_its_own_is_not_derived(component) -> None:
    with pytest.raises(ProjectError, match=f"{component.__name__} is not a Mechanism; equations"):
        derive(component)


def test_a_system_has_the_equations_of_its_parts_and_its_connections() -> None:
    models = {"swing": assemble(Pendulum), "motor": assemble(Sinusoid)}
    model = compose("Pumped", models, {"swing.length": "motor.y", "swing.length_dot": "motor.y_dot"})
    shown = equations(model)
    assert "p_θ,swing = m_swing · l_swing · (ẋ_p,swing · cos θ_swing" in shown["momenta"].text()
    assert "l_swing = y_motor" in shown["connections"].text()
    MathTextParser("path").parse(f"${LaTeX(shown.notation).name('swing.theta_dot')}$")
