"""The printer of straight-line code, against CasADi's own evaluation."""

import ctypes
import doctest
import subprocess
import tempfile
from collections.abc import Callable
from pathlib import Path

import casadi as ca
import numpy as np
import pytest

from liaisons import expressions
from liaisons.base.compiler import system_compiler
from liaisons.errors import ComponentError
from liaisons.expressions import OPERATIONS, Program, c_parts
from liaisons.mechanics import assemble
from liaisons.models import CATALOGUE

POINTS = 200

Scalar = Callable[..., ca.SX]

# Every operation: functions of CasADi by the interval that their arguments are taken from, and what has no name there.
INTERVALS: dict[tuple[float, float], str] = {
    (-3, 3): "exp expm1 atan sinh cosh tanh asinh erf floor ceil fabs sign",
    (-30, 30): "sin cos",
    (-1, 1): "asin acos",
    (0, 3): "sqrt",
    (0.1, 3): "log",
    (-0.5, 3): "log1p",
    (-1.2, 1.2): "tan",
    (1.1, 3): "acosh",
    (-0.9, 0.9): "atanh",
}
UNARY: list[tuple[Scalar, float, float]] = [
    (lambda x: -x, -3, 3),
    (lambda x: x * x, -3, 3),
    (lambda x: 2 * x, -3, 3),
    (lambda x: 1 / x, 0.3, 3),
    (lambda x: x**2.5, 0.1, 3),
    (lambda x: x**3, -3, 3),
    (lambda x: x**-2, 0.3, 3),
    (lambda x: x**0.5, 0, 3),
    (lambda x: ca.logic_not(ca.floor(x)), -3, 3),
    *((getattr(ca, name), low, high) for (low, high), names in INTERVALS.items() for name in names.split()),
]
BINARY: list[Scalar] = [
    *(getattr(ca, name) for name in ["fmod", "remainder", "copysign", "atan2", "hypot", "fmin", "fmax"]),
    lambda x, y: x + y,
    lambda x, y: x - y,
    lambda x, y: x * y,
    lambda x, y: x / (1.5 + y),
    lambda x, y: (2 + x) ** y,
    lambda x, y: ca.floor(4 * x) < ca.floor(4 * y),  # which are equal now and then
    lambda x, y: ca.floor(4 * x) <= ca.floor(4 * y),
    lambda x, y: ca.floor(4 * x) == ca.floor(4 * y),
    lambda x, y: ca.floor(4 * x) != ca.floor(4 * y),
    lambda x, y: ca.logic_and(x < 0, y < 0),
    lambda x, y: ca.logic_or(x < 0, y < 0),
    lambda x, y: ca.if_else(x < y, ca.sin(x), ca.cos(y)),
]


@pytest.fixture(scope="module")
def everything() -> tuple[ca.SX, ca.SX, np.ndarray]:
    """Symbols, one expression an operation, and points, (symbols, POINTS)."""
    random = np.random.default_rng(7)
    x = ca.SX.sym("x", len(UNARY) + 2)
    unary = [make(x[i]) for i, (make, _, _) in enumerate(UNARY)]
    binary = [make(x[len(UNARY)], x[len(UNARY) + 1]) for make in BINARY]
    bounds = [(low, high) for _, low, high in UNARY] + [(-1.0, 1.0)] * 2
    points = np.array([random.uniform(low, high, POINTS) for low, high in bounds])
    return x, ca.vertcat(*unary, *binary), points


def by_casadi(x: ca.SX, expressions: ca.SX, points: np.ndarray) -> np.ndarray:
    return np.array(ca.Function("f", [x], [expressions]).map(points.shape[1])(points))


def by_c(x: ca.SX, expressions: ca.SX, points: np.ndarray) -> np.ndarray:
    """A loop over lanes, compiled with the flags of FMUs."""
    if (compiler := system_compiler()) is None:
        pytest.skip("no C compiler")
    [body], _ = c_parts([(x, f"x[{{}} * {POINTS} + i]")], [(expressions, f"f[{{}} * {POINTS} + i]")])
    loop = f"for (int i = 0; i < {POINTS}; ++i) {{ {' '.join(body)} }}"
    code = (
        f'#include <math.h>\n__attribute__((visibility("default"))) void f(const double *x, double *f) {{ {loop} }}\n'
    )
    found = np.empty((expressions.numel(), POINTS))
    double = ctypes.POINTER(ctypes.c_double)
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as folder:
        Path(folder, "f.c").write_text(code, encoding="utf-8")
        options = ["-std=c99", "-O2", "-ffp-contract=off", "-fPIC", "-shared", "f.c", "-o", "f.so", "-lm"]
        subprocess.run([*compiler, *options], cwd=folder, check=True)
        ctypes.CDLL(f"{folder}/f.so").f(
            np.ascontiguousarray(points).ctypes.data_as(double), found.ctypes.data_as(double)
        )
    return found


# Elementary functions of different libraries differ in the last bits: 8 units in the last place of numbers up to 30.
CLOSE, SMALL = 8 * 2.3e-16, 4e-16


def test_what_divides_several_numbers_is_inverted_once() -> None:
    x = ca.SX.sym("x", 3)
    quotients = ca.vertcat(x[0] / x[2], x[1] / x[2], 1 / x[2])
    [lines], _ = c_parts([(x, "x[{}]")], [(quotients, "f[{}]")])
    assert sum("/" in line for line in lines) == 1
    points = np.random.default_rng(3).uniform(1.0, 3.0, (3, POINTS))
    # The reciprocal and the product are rounded, the quotient once.
    rounding = 2 * np.finfo(float).eps
    np.testing.assert_allclose(by_c(x, quotients, points), by_casadi(x, quotients, points), rtol=rounding)


def test_every_operation_in_c(everything) -> None:
    np.testing.assert_allclose(by_c(*everything), by_casadi(*everything), rtol=CLOSE, atol=SMALL)


def test_every_operation_by_casadi(everything) -> None:
    x, expressions, points = everything
    np.testing.assert_allclose(
        Program.of([x], [expressions]).evaluate([points])[0], by_casadi(*everything), rtol=CLOSE, atol=SMALL
    )


def test_every_operation_is_among_those_tried(everything) -> None:
    x, expressions, _ = everything
    function = ca.Function("f", [x], [expressions])
    tried = {function.instruction_id(k) for k in range(function.n_instructions())}
    # an assignment occurs only in functions that CasADi has made itself
    assert set(OPERATIONS) - tried <= {ca.OP_ASSIGN, ca.OP_POW if ca.OP_CONSTPOW in tried else -1}


def test_a_minimum_of_a_number_and_not_a_number_is_the_number() -> None:
    x = ca.SX.sym("x", 2)
    found = by_c(x, ca.vertcat(ca.fmin(x[0], x[1]), ca.fmax(x[1], x[0])), np.tile([[np.nan], [2.0]], POINTS))
    assert np.all(found == 2.0)


@pytest.mark.parametrize("component", CATALOGUE, ids=lambda component: component.__name__)
def test_right_hand_sides_of_the_catalogue(component) -> None:
    model = assemble(component)
    function = model.derivatives if model.derivatives.is_a("SXFunction") else model.derivatives.expand()
    random = np.random.default_rng(3)
    symbols = [ca.SX.sym(f"a{i}", function.sparsity_in(i)) for i in range(function.n_in())]
    values = [random.uniform(0.5, 1.5, (function.numel_in(i), 5)) for i in range(function.n_in())]
    found = Program.of(symbols, function.call(symbols, True, False)).evaluate(values)[0]
    for lane in range(5):
        expected, near = (
            np.array(function(*(value[:, lane] * factor for value in values))).reshape(-1) for factor in (1, 1 + 1e-15)
        )
        # Terms that cancel: some hundred roundings of numbers up to the largest one, and what two of the arguments do,
        # of which the inverse mass of a Bricard linkage in some of these states, for instance, makes 1e-12.
        size, condition = (np.max(np.abs(x), initial=0) for x in (expected, near - expected))
        np.testing.assert_allclose(found[:, lane], expected, rtol=1e-12, atol=1e-13 * (1 + size) + 2 * condition)


def test_outputs_may_stand_where_inputs_are_read() -> None:
    x = ca.SX.sym("x", 2)
    [lines], _ = c_parts([(x, "x[{}]")], [(ca.vertcat(x[1], x[0]), "x[{}]")])
    assert [line.split(" = ")[0] for line in lines] == ["const double a0", "const double a1", "x[0]", "x[1]"]


def test_what_occurs_twice_is_calculated_once_and_what_cancels_is_not() -> None:
    x = ca.SX.sym("x", 3)
    product = (2 * x[0]) * ca.cos(x[1]) - x[0] * (2 * ca.cos(x[1]))
    [lines], _ = c_parts([(x, "x[{}]")], [(ca.vertcat(ca.sin(x[2]) + product, ca.sin(x[2])), "f[{}]")])
    assert sum("sin(" in line for line in lines) == 1
    assert not any("cos(" in line for line in lines)


def operations(*expressions: ca.SX) -> int:
    """How many are left of expressions in x and y."""
    return sum(node.operation is not None for node in Program.of([X, Y], [ca.vertcat(*expressions)]).nodes)


X, Y = ca.SX.sym("x", 6), ca.SX.sym("y")
a, b, c, d, e, f = ca.vertsplit(X)


@pytest.mark.parametrize(
    ("expression", "shortest", "left"),
    [
        ((a / 2) * ((b * c + b * c) + (2 * d) * e), a * (b * c + d * e), 4),
        (c * (a * b) - b * (c * a) + d, d, 0),
        (-(a - b) * (-c), (a - b) * c, 2),
        (a * b * ca.sin(d) * ca.sin(d) + b * a * ca.cos(d) ** 2, a * b, 1),
        ((a * ca.sin(d)) ** 2 + (a * ca.cos(d)) ** 2 - a**2 + e, e, 0),
        (c * (a * b - d * e) + f - (b * c) * a + (d * c) * e, f, 0),
        (a * ca.sin(d) ** 2 + b * ca.cos(d) ** 2, a * ca.sin(d) ** 2 + b * ca.cos(d) ** 2, 7),
        (a * ca.sin(d) ** 2 + a * ca.cos(e) ** 2, a * (ca.sin(d) ** 2 + ca.cos(e) ** 2), 6),
        (-a * b * c - d * b * e - f * e * b, -b * (a * c + (d + f) * e), 6),
    ],
)
def test_what_is_left_of_derivatives(expression: ca.SX, shortest: ca.SX, left: int) -> None:
    assert operations(expression) == left
    values = np.random.default_rng(5).uniform(0.5, 1.5, (6, POINTS))
    found = Program.of([X], [expression]).evaluate([values])[0]
    # A few roundings of numbers up to 10.
    np.testing.assert_allclose(found, by_casadi(X, shortest, values), rtol=0, atol=1e-14)


def test_sums_and_products_are_balanced_trees() -> None:
    """Of eight terms, one of them a product: four levels."""

    def height(expression: ca.SX) -> int:
        found = Program.of([X, Y], [expression])
        heights: list[int] = []
        for node in found.nodes:
            under = [heights[number] for number in node.arguments] if node.operation is not None else [-1]
            heights.append(1 + max(under))
        return heights[found.outputs[0][0]]

    assert height(a + (b - (c + (d - (e + (f - (Y - a * b))))))) == 4
    assert height(a * (b * (c * (d * (e * (f * Y)))))) == 3


@pytest.mark.parametrize("links", [10, 2000])
def test_factors_do_not_grow_from_link_to_link(links: int) -> None:
    """e (3/y) (3/y) ... with y = 3: the threes must not wait in front of everything until 3^2000 overflows."""
    x, y = (ca.SX.sym(name) for name in "xy")
    e = x
    for _ in range(links):
        e = (e + e + e) / y
    found = Program.of([x, y], [e])
    assert max(abs(node.constant) for node in found.nodes if node.constant is not None) < 1e6
    assert found.evaluate([[0.7], [3.0]])[0][0] == pytest.approx(0.7, rel=links * 1e-15)  # two roundings a link


def test_parts_hand_on_what_later_ones_need() -> None:
    x = ca.SX.sym("x", 4)
    turned = x
    for _ in range(5):
        turned = ca.vertcat(turned[1] * turned[2], turned[2] + turned[3], ca.sin(turned[0]), turned[1] - turned[0])
    values = np.random.default_rng(6).uniform(-1, 1, 4)
    parts, spill = c_parts([(x, "x[{}]")], [(turned, "f[{}]")], spill="w[{}]", most=3)
    assert len(parts) > 4
    arrays = {"x": values, "w": np.zeros(spill), "f": np.zeros(4), "sin": np.sin}
    for part in parts:  # these statements are Python, too; names of one part are unknown to the next
        exec("\n".join(line.removeprefix("const double ").rstrip(";") for line in part), arrays.copy())
    expected = ca.Function("f", [x], [turned])(values).full()[:, 0]
    np.testing.assert_allclose(arrays["f"], expected, rtol=0, atol=1e-14)


def test_a_call_of_another_function_is_refused() -> None:
    x = ca.SX.sym("x")
    inner = ca.Function("inner", [x], [ca.sin(x)])
    with pytest.raises(ComponentError, match="calls a function"):
        Program.of([x], inner.call([x], False, True))


def test_the_example_of_the_module() -> None:
    assert doctest.testmod(expressions, extraglobs={"ca": ca}).failed == 0
