"""States, references and FMUs that several tests of the catalogue share."""

from __future__ import annotations

import math
import sys
from collections.abc import Callable
from decimal import Decimal, localcontext
from pathlib import Path

import numpy as np
import pytest

from liaisons.mechanics import Equations

sys.path.insert(0, str(Path(__file__).parent))  # on_paper.py is no test, but theirs

State = dict[str, float]


@pytest.fixture(scope="session")
def random_states() -> Callable[..., list[State]]:
    """Seeded random states of a mechanism: every symbol has a value, everything moves, every port is loaded."""

    def states(equations: Equations, count: int = 20, **fixed: float) -> list[State]:
        random = np.random.default_rng(20240229)
        m = equations.mechanism
        bounded = (q for q in m.coordinates if q.minimum is not None)
        domains = {item.name: item for item in (*m.parameters, *m.actives, *bounded)}

        parameters = {item.name for item in m.parameters}

        def value(name: str) -> float:
            if name in domains and (domains[name].minimum is not None or domains[name].start):
                return (domains[name].start or 0.3) * random.uniform(0.7, 1.3)  # positive where it has to be
            return random.normal(scale=0.05 if name in parameters else 1.0)  # coefficients of a series are small

        return [{name: value(name) for name in equations.symbols} | fixed for _ in range(count)]

    return states


Polynomial = dict[tuple[int, ...], Decimal | float]


@pytest.fixture(scope="session")
def taylor() -> Callable[..., np.ndarray]:
    """Solution of y_i' = Σ c · y_j · y_k ... by Taylor series with 40 digits: a reference without rounding."""

    def solve(
        times: np.ndarray, start: list[Decimal | float], rates: list[Polynomial], *, step: str = "0.05", order: int = 32
    ) -> np.ndarray:
        """Solve at increasing times; ``rates[i]`` maps (), (j,) or (j, k) to c.  Shape (variables, times)."""
        with localcontext() as context:
            context.prec = 40
            y, t, found = [Decimal(value) for value in start], Decimal(0), []
            exact_rates = [{factors: Decimal(c) for factors, c in rate.items()} for rate in rates]
            for instant in map(Decimal, times.tolist()):
                count = math.ceil((instant - t) / Decimal(step))
                for _ in range(count):
                    y = _taylor_step(y, exact_rates, (instant - t) / count, order)
                found.append([float(value) for value in y])
                t = instant
        return np.array(found).T

    return solve


def _taylor_step(
    y: list[Decimal], rates: list[dict[tuple[int, ...], Decimal]], h: Decimal, order: int
) -> list[Decimal]:
    series = [[value] for value in y]
    for n in range(order):
        for i, rate in enumerate(rates):
            coefficient = Decimal(0)
            for factors, c in rate.items():
                if len(factors) == 2:
                    a, b = (series[j] for j in factors)
                    coefficient += c * sum(a[k] * b[n - k] for k in range(n + 1))
                elif factors:
                    coefficient += c * series[factors[0]][n]
                elif n == 0:
                    coefficient += c
            series[i].append(coefficient / (n + 1))
    end = []
    for terms in series:
        value = Decimal(0)
        for term in reversed(terms):
            value = value * h + term
        end.append(value)
    return end


@pytest.fixture(scope="session")
def sine_and_cosine() -> Callable[[float], tuple[Decimal, Decimal]]:
    """sin x and cos x of a double to 40 digits, which the series of a pendulum start from."""

    def both(x: float) -> tuple[Decimal, Decimal]:
        with localcontext() as context:
            context.prec = 50
            small = Decimal(x) / 1024
            sine = term = small
            n = 1
            while abs(term) > Decimal("1e-60"):
                term *= -small * small / ((n + 1) * (n + 2))
                n += 2
                sine += term
            cosine = (1 - sine * sine).sqrt()
            for _ in range(10):
                sine, cosine = 2 * sine * cosine, cosine * cosine - sine * sine
            return sine, cosine

    return both


@pytest.fixture(scope="session")
def breathing_pendulum(taylor, sine_and_cosine) -> Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]]:
    """θ and p_θ = l² θ' for l = 1 + 0.1 sin 2t from θ_0 = 1, to rounding."""

    def reference(times: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        sine, cosine = sine_and_cosine(1.0)
        # θ, ω, s = sin θ, c = cos θ, w = 1/l, a = l'/l, S = sin 2t, C = cos 2t
        rates = [
            {(1,): 1},
            {(4, 2): -Decimal("9.8125"), (5, 1): -2},
            {(3, 1): 1},
            {(2, 1): -1},
            {(5, 4): -1},
            {(6, 4): -Decimal("0.4"), (5, 5): -1},
            {(7,): 2},
            {(6,): -2},
        ]
        start = [1, 0, sine, cosine, 1, Decimal("0.2"), 0, 1]
        theta, omega, *_ = taylor(times, start, rates)
        return theta, (1 + 0.1 * np.sin(2 * times)) ** 2 * omega

    return reference
