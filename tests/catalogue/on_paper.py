"""What several tests of the catalogue share: states, references, equality up to rounding, derivatives, signals."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from decimal import Decimal, localcontext
from functools import cache
from typing import Any

import casadi as ca
import numpy as np
import pytest
from numpy.typing import ArrayLike, NDArray

from liaisons.check import max_error
from liaisons.cosim import Result, System, simulate
from liaisons.language import Mechanism
from liaisons.mechanics import derive

HOLD, EXTRAPOLATE, INTERPOLATE = 0, 1, 2  # input_reconstruction
BACKENDS = ["native", "python"]
TURN = 2 * np.pi
Values = dict[str, Any]

equations_of = cache(derive)


def mechanism(component: type[Mechanism]) -> Any:
    """The symbols of its equations."""
    return equations_of(component).mechanism


class State(dict[str, float]):
    """Values of a mechanism's symbols, ``n["x"]`` or ``n.x``; ``n("energy")`` is a quantity or an output there."""

    def __init__(self, component: type[Mechanism], values: Mapping[str, float]) -> None:
        super().__init__(values)
        self.component = component

    def __or__(self, values: Mapping[str, Any]) -> State:  # type: ignore[override]
        return State(self.component, {**self, **values})

    def __getattr__(self, name: str) -> Any:
        if name not in self:
            raise AttributeError(name)
        return self[name]

    def __call__(self, what: str | ca.SX) -> Any:
        """The value of a quantity, of an output or of an expression; a number where it has one element."""
        equations = equations_of(self.component)
        expression: Any = what
        if isinstance(what, str):
            expression = getattr(equations, what, None)
            if not isinstance(expression, ca.SX):  # an output of the mechanism, such as inertia
                expression = getattr(equations.mechanism, what)
        function = ca.Function("value", [*equations.symbols.values()], [ca.densify(equations.in_motion(expression))])
        value = np.asarray(function(*equations.numbers(self).values()))
        return value.item() if value.size == 1 else np.squeeze(value)


def unloaded(component: type[Mechanism]) -> dict[str, float]:
    """No drives and no loads."""
    return {name: 0.0 for name in equations_of(component).symbols if name.endswith(("_load", "_force"))}


def random_states(component: type[Mechanism], count: int = 20, /, **fixed: float) -> list[State]:
    """Seeded random states: every symbol has a value, everything moves, every port is loaded."""
    random, m = np.random.default_rng(20240229), equations_of(component).mechanism
    bounded = (q for q in m.coordinates if q.minimum is not None)
    domains = {item.name: item for item in (*m.parameters, *m.actives, *bounded)}
    parameters = {item.name for item in m.parameters}

    def value(name: str) -> float:
        if name in domains and (domains[name].minimum is not None or domains[name].start):
            return (domains[name].start or 0.3) * random.uniform(0.7, 1.3)  # positive where it has to be
        return random.normal(scale=0.05 if name in parameters else 1.0)  # coefficients of a series are small

    symbols = equations_of(component).symbols
    return [State(component, {name: value(name) for name in symbols} | fixed) for _ in range(count)]


def defaults(component: type[Mechanism]) -> dict[str, float]:
    """Parameters as they are declared."""
    return {parameter.name: parameter.start for parameter in component.parameters}


def run(file: Any, **settings: Any) -> Result:
    """A simulation of 20 s, with interpolated inputs, unless settings say otherwise."""
    usual: Values = {"stop_time": 20.0, "step_size": 0.1, "tolerance": 1e-10}
    if "inputs" in settings:
        usual["input_reconstruction"] = INTERPOLATE
    return simulate(file, **(usual | settings))


def operated(fmu: Any, component: Any, port: str, operator: Any, start: Values, **drive: Any) -> System:
    """A component ``it`` and the operator of one of its ports."""
    system = System("operated")
    system.add("it", fmu(component), **start)
    system.connect(system.add("operator", fmu(operator), **drive)["y"], system.parts["it"][port])
    return system


def assert_follows(
    result: Result, exact: Mapping[str, Any], allowed: float, part: str = "", names: Iterable[str] = ()
) -> None:
    """Each signal, or those of these names, is within this of its closed form."""
    for name in names or exact:
        assert max_error(result[part + name], exact[name]) <= allowed, name


def algebra(value: ArrayLike, rounding: float = 1e-12) -> Any:
    """Equal up to the rounding of an algebraic identity: sums of a few terms, a few roundings of the largest."""
    return pytest.approx(value, rel=rounding, abs=rounding)


def vector(n: Any, form: str = "{}", axes: str = "xyz") -> NDArray:
    """The numbers of one vector: ``vector(n, "{}_dot")`` is the velocity."""
    return np.array([n[form.format(axis)] for axis in axes])


def curl(A: ca.SX, r: ca.SX) -> ca.SX:
    J = ca.jacobian(A, r)
    return ca.vertcat(J[2, 1] - J[1, 2], J[0, 2] - J[2, 0], J[1, 0] - J[0, 1])


def dot(a: Any, b: Any) -> Any:
    """Scalar product of plane vectors x + i z."""
    return np.real(np.conj(a) * b)


def cross(a: Any, b: Any) -> Any:
    """Moment a × b, from x towards z positive."""
    return np.imag(np.conj(a) * b)


def derivative(f: Callable[[float], Any], t: float, h: float = 0.02) -> Any:
    """Central difference of order 10."""
    weights = (5 / 6, -5 / 21, 5 / 84, -5 / 504, 1 / 1260)
    return sum(w * (f(t + i * h) - f(t - i * h)) for i, w in enumerate(weights, 1)) / h


def wave(
    offset: float, amplitude: float, frequency: float, phase: float = 0.0
) -> Callable[[float], tuple[float, float, float]]:
    """offset + amplitude · sin(frequency t + phase) with its two derivatives, as a function of time."""

    def signal(t: float) -> tuple[float, float, float]:
        sine, cosine = amplitude * np.sin(frequency * t + phase), amplitude * np.cos(frequency * t + phase)
        return offset + sine, frequency * cosine, -(frequency**2) * sine

    return signal


def smooth_step(rise: float, begin: float, duration: float) -> Callable[[float], tuple[float, float, float]]:
    """u⁴ (35 - 84 u + 70 u² - 20 u³) and its two derivatives."""
    step = np.polynomial.Polynomial([0, 0, 0, 0, 35, -84, 70, -20])

    def signal(t: float) -> tuple[float, float, float]:
        u = float(np.clip((t - begin) / duration, 0, 1))
        return tuple(rise * float(step.deriv(k)(u)) / duration**k if k else rise * float(step(u)) for k in range(3))  # type: ignore[return-value]

    return signal


def taylor(
    times: NDArray, start: list[Any], rates: Sequence[Mapping[Any, Any]], *, step: str = "0.05", order: int = 32
) -> NDArray:
    """Solution of y_i' = Σ c · y_j · y_k ... by Taylor series with 40 digits: a reference without rounding.

    :param times: increasing.
    :param rates: ``rates[i]`` maps (), (j,) or (j, k) to c.
    :returns: shape (variables, times).
    """
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


def sine_and_cosine(x: float) -> tuple[Decimal, Decimal]:
    """sin x and cos x of a double to 40 digits, which the series of a pendulum start from."""
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


def breathing_pendulum(times: NDArray) -> tuple[NDArray, NDArray]:
    """θ and p_θ = l² θ' for l = 1 + 0.1 sin 2t from θ_0 = 1, to rounding."""
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
