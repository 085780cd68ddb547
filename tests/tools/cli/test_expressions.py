"""Expressions of time and tables: values, exact derivatives, and what is refused without being run."""

import math
from typing import Any

import numpy as np
import pytest

from liaisons.base.knots import knots, piecewise_polynomial
from liaisons.errors import FormulaError, SimulationError
from liaisons.typed_formulas import pulse_instants, time_function


@pytest.mark.parametrize(
    ("text", "rate", "acceleration"),
    [
        ("1 + 0.1*sin(5*t)", "0.5*cos(5*t)", "-2.5*sin(5*t)"),
        ("3", "0", "0"),
        ("-t**3 + +t", "1 - 3*t**2", "-6*t"),
        ("t/(1 + t**2)", "(1 - t**2)/(1 + t**2)**2", "2*t*(t**2 - 3)/(1 + t**2)**3"),
        (
            "exp(-t)*cos(2*pi*t)",
            "-exp(-t)*(cos(2*pi*t) + 2*pi*sin(2*pi*t))",
            "exp(-t)*((1 - 4*pi**2)*cos(2*pi*t) + 4*pi*sin(2*pi*t))",
        ),
        ("e**(t/2) - t**-1.5", "e**(t/2)/2 + 1.5*t**-2.5", "e**(t/2)/4 - 3.75*t**-3.5"),
        (
            "(1 + t)**t",
            "(1 + t)**t*(log(1 + t) + t/(1 + t))",
            "(1 + t)**t*((log(1 + t) + t/(1 + t))**2 + 1/(1 + t) + 1/(1 + t)**2)",
        ),
        (
            "pow(t, 3) + pow(2, sin(t))",
            "3*t**2 + log(2)*cos(t)*2**sin(t)",
            "6*t + 2**sin(t)*(log(2)**2*cos(t)**2 - log(2)*sin(t))",
        ),
        ("abs(t - 2)*abs(t)", "copysign(2*t - 2, (t - 2)*(t - 1))", "copysign(2, t - 2)"),
        (
            "log(t)*sqrt(1 + t)",
            "sqrt(1 + t)/t + log(t)/(2*sqrt(1 + t))",
            "1/(t*sqrt(1 + t)) - sqrt(1 + t)/t**2 - log(t)/(4*(1 + t)**1.5)",
        ),
        (
            "tanh(t) + tan(t/4)",
            "1/cosh(t)**2 + 1/(4*cos(t/4)**2)",
            "tan(t/4)/(8*cos(t/4)**2) - 2*tanh(t)/cosh(t)**2",
        ),
        ("1e-3*t - .5", "1e-3", "0"),
        ("2 ** 3 ** 0.5 - 7 / 2 / 2", "0", "0"),
    ],
    ids=lambda text: text if len(text) < 40 else "",
)
def test_values_and_derivatives_are_those_on_paper(text: str, rate: str, acceleration: str) -> None:
    function, names = time_function(text), {**vars(math), "abs": abs, "pow": pow}
    for instant in (0.25, 1.0, 1.75, 3.0):
        expected = [eval(written, names | {"t": instant}) for written in (text, rate, acceleration)]
        np.testing.assert_allclose(function(instant), expected, rtol=1e-13, atol=1e-13)


def test_where_derivatives_are_missing_the_value_is_there() -> None:
    assert time_function("sqrt(t)")(0.0)[:2] == (0.0, math.inf)
    assert time_function("t**1.5")(0.0)[:2] == (0.0, 0.0)
    assert time_function("abs(t)")(0.0) == (0.0, 1.0, 0.0)  # on the side where time goes
    assert time_function("abs(-t**2)")(0.0) == (0.0, 0.0, 2.0)
    assert time_function("t**2")(0.0) == (0.0, 0.0, 2.0)
    assert time_function("t**0")(0.0) == (1.0, 0.0, 0.0)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("sn(5*t)", "at character 1: there is no function 'sn'; did you mean 'sin'"),
        ("1 + 0.1*length", "at character 9: there is no 'length'; known: abs, atan2, "),
        ("1 + sin", "at character 5: sin is a function: write sin(...)"),
        ("5t", "write 5*t, not 5t"),
        ("5*t^2", "at character 5: powers are written **, not ^"),
        ("sin(t", "at character 4: '(' was never closed"),
        ("", "there is nothing"),
        ("pow(t)", "pow takes 2 arguments, not 1"),
        ("sin(t, t)", "sin takes 1 argument, not 2"),
        ("sin(x=t)", "only numbers"),
        ("sin(*t)", "only numbers"),
        ("__import__('os').system('touch here')", "only numbers"),
        ("(lambda: 0)()", "only numbers"),
        ("[t for t in (1, 2)]", "only numbers"),
        ("t.real", "only numbers"),
        ("t if t else 1", "only numbers"),
        ("t < 1", "only numbers"),
        ("t % 2", "only numbers"),
        ("1j*t", "only numbers"),
        ("True", "only numbers"),
        ("'1'", "only numbers"),
        ("f'{t}'", "only numbers"),
        ("t, t", "only numbers"),
        ("t := 1", "invalid syntax"),
        ("1; 2", "invalid syntax"),
        ("\0", "null bytes"),
        ("9" * 400, "this number is too large"),
        ("(" * 300 + "t" + ")" * 300, "too many nested parentheses"),
        ("-" * 900 + "t", "200 levels"),
        ("1" + "+t" * 400, "200 levels"),
        ("t" + "+t" * 600, "1000 at most"),
    ],
    ids=lambda text: text[:20].replace("\0", "0"),
)
def test_what_is_refused_is_refused_in_one_line(text: str, words: str) -> None:
    with pytest.raises(FormulaError) as caught:
        time_function(text)
    assert words in str(caught.value)
    assert len(str(caught.value)) < 300
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    "text", ["9**9**9", "exp(1000)", "log(t)", "sqrt(-1)", "1/t", "0**(-1 - t)", "(-1)**0.5", "10**400"]
)
def test_what_has_no_value_says_so_and_takes_no_time(text: str) -> None:
    with pytest.raises(FormulaError, match="has no value there"):
        time_function(text)(0.0)


def test_many_terms_are_no_problem() -> None:
    function = time_function("0" + "+t" * 190)
    assert function(2.0) == (380.0, 190.0, 0.0)


TIMES = np.sort(np.random.default_rng(12).uniform(0, 2, 30))


@pytest.mark.parametrize("rates", [False, True])
@pytest.mark.parametrize("accelerations", [False, True])
def test_a_table_of_a_quintic_gives_the_quintic(rates: bool, accelerations: bool) -> None:
    x = np.polynomial.Polynomial([1.0, -2.0, 0.5, 3.0, -1.0, 0.25])
    given = x.deriv()(TIMES) if rates else None, x.deriv(2)(TIMES) if accelerations else None
    motion = piecewise_polynomial(knots(TIMES, x(TIMES), *given))
    t = np.linspace(TIMES[0], TIMES[-1], 101)
    for order in range(3):
        # second derivatives of splines lose two steps' worth of digits, 1e-16/0.01²
        np.testing.assert_allclose(motion(t, order), x.deriv(order)(t), rtol=0, atol=1e-8)


@pytest.mark.parametrize("n", [2, 3, 4, 5])
def test_short_tables(n: int) -> None:
    times = np.linspace(0.0, 1.0, n)
    motion = piecewise_polynomial(knots(times, 2 * times))
    assert [motion(0.4, order) for order in range(3)] == pytest.approx((0.8, 2.0, 0.0), abs=1e-12)


def test_a_jump_is_no_slope() -> None:
    """Two parabolas, of which a spline through all points would know nothing."""
    times = np.array([0.0, 0.5, 1.0, 1.0, 1.5, 2.0])
    values = np.where(np.arange(6) < 3, times**2, 3 - times**2)
    motion = piecewise_polynomial(knots(times, values))
    assert motion([0.75, 1.0, 1.25]) == pytest.approx([0.75**2, 2.0, 3 - 1.25**2], abs=1e-12)
    assert motion([0.75, 1.25], 1) == pytest.approx([1.5, -2.5], abs=1e-12)


def test_values_that_agree_to_rounding_at_a_kink_are_equal() -> None:
    table = knots([0, 0.5, 0.5, 1], [1, 1, np.nextafter(1, 2), 1.5], [0, 0, 1, 1], [0] * 4)
    assert table[1:, 1:3].tolist() == [[1, 1], [0, 1], [0, 0]]


@pytest.mark.parametrize(
    ("columns", "words"),
    [
        (([0, 1], [1.0]), "values: 1 numbers for 2 times"),
        (([0], [1.0]), "times: 1 numbers for 1 times; give as many, two at least"),
        (([0, 1, 0.5], [0, 0, 0]), "times: 0.5 after 1 s: they must ascend"),
        (([0, 1, 1, 1], [0, 0, 0, 0]), "times: 1 after 1 s: they must ascend"),
        (([0, 1], [0, np.nan]), "values = [0, nan]: give finite numbers"),
        (([0, 1], "ab"), "values = 'ab': give numbers"),
    ],
)
def test_knots_that_are_none(columns: tuple[Any, Any], words: str) -> None:
    with pytest.raises(SimulationError) as caught:
        knots(*columns)
    assert str(caught.value).startswith(words)


def test_given_rates_are_kept_and_derivatives_belong_to_the_values() -> None:
    """Noisy values with good rates: the rates are those of the table, and what comes out is one motion."""
    times = np.linspace(0.0, 1.0, 10)
    noise = np.array([1e-3, -1e-3] * 5)
    motion = piecewise_polynomial(knots(times, np.sin(times) + noise, np.cos(times), -np.sin(times)))
    np.testing.assert_allclose(motion(times, 1), np.cos(times), rtol=0, atol=1e-13)
    np.testing.assert_allclose(motion(times, 2), -np.sin(times), rtol=0, atol=1e-12)
    h, t = 1e-6, np.array([0.123, 0.456, 0.789])
    np.testing.assert_allclose((motion(t + h) - motion(t - h)) / (2 * h), motion(t, 1), rtol=1e-8)


def test_pulses_are_looked_at_as_finely_as_they_are_short() -> None:
    """exp(-(t/w)²) at 11 points, w/√2 apart; what 500 steps see is left alone."""
    for middle in (0.505, 5.0):  # the latter is one of the points between which it is looked for
        instants = pulse_instants(f"100*exp(-((t-{middle})*2000)**2) + exp(-(t - 2)**2)", 0.0, 10.0)
        np.testing.assert_allclose(instants, middle + np.arange(-5, 6) / 2000 / np.sqrt(2), rtol=0, atol=1e-12)
    for text in ("sin(100*t)", "exp(-t)", "exp(sin(t))", "exp(((t-0.505)*2000)**2)"):
        assert pulse_instants(text, 0.0, 1.0) == []
