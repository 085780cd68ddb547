"""Components written out by hand, and what is known about their motion: nothing here uses the derivation.

Pendulum of variable length, M 8.1 with one point mass::

    p = m l² θ',   p' = -m g l sin θ - η p + τ,   λ = m l'' - m l θ'² - m g cos θ + η m l'
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.integrate import solve_ivp
from scipy.special import ellipj, ellipk

from liaisons.mechanics.model import ActiveInput, Causality, Experiment, Model, State, Variable

GRAVITY = 9.81
NOTHING = ca.SX(0, 1)


def pendulum() -> Model:
    """Pendulum with states theta, p_theta, work, dissipated; driven through length and theta_force."""
    t, y, u, k, m = (ca.SX.sym(name, size) for name, size in (("t", 1), ("y", 4), ("u", 4), ("k", 5), ("m", 2)))
    theta, p, work, dissipated = ca.vertsplit(y)
    length, length_dot, length_ddot, force = ca.vertsplit(u)
    mass, gravity, friction, theta_0, theta_dot_0 = ca.vertsplit(k)
    energy_start, energy_booked = ca.vertsplit(m)
    theta_dot = p / (mass * length**2)
    p_dot = -mass * gravity * length * ca.sin(theta) - friction * p + force
    operator = mass * (length_ddot - length * theta_dot**2 - gravity * ca.cos(theta) + friction * length_dot)
    kinetic = mass / 2 * (length_dot**2 + (length * theta_dot) ** 2)
    energy = kinetic - mass * gravity * length * ca.cos(theta)
    power = operator * length_dot + force * theta_dot
    dissipation = 2 * friction * kinetic
    booked = work + energy - energy_booked
    y_0 = ca.vertcat(theta_0, mass * length**2 * theta_dot_0, 0, 0)
    energy_0 = ca.substitute(energy, y, y_0)
    z: dict[str, tuple[str, Causality, ca.SX]] = {
        "theta": ("rad", "output", theta),
        "theta_dot": ("rad/s", "output", theta_dot),
        "p_theta": ("kg.m2/s", "output", p),
        "p_theta_dot": ("N.m", "local", p_dot),
        "length_force": ("N", "output", operator),
        "energy": ("J", "output", energy),
        "work": ("J", "output", booked),
        "dissipated": ("J", "output", dissipated),
        "energy_balance": ("J", "output", energy - energy_start - booked + dissipated),
        "power": ("W", "local", power),
        "dissipation": ("W", "local", dissipation),
        "weight": ("N", "calculatedParameter", mass * gravity),
    }
    derivatives = {"theta_dot": "theta", "p_theta_dot": "p_theta", "power": "work", "dissipation": "dissipated"}
    return _model(
        "HandPendulum",
        (t, y, u, k, m),
        z,
        parameters=(
            _parameter("mass", "kg", 1.0, minimum=0.0, strict=True),
            _parameter("gravity", "m/s2", GRAVITY),
            _parameter("friction", "1/s", 0.0, minimum=0.0, tunable=True),
            _parameter("theta_0", "rad", 0.1),
            _parameter("theta_dot_0", "rad/s", 0.0),
        ),
        inputs=(
            Variable("length", "m", "pivot to bob", "input", "continuous", start=1.0, minimum=0.0, strict=True),
            Variable("length_dot", "m/s", "its rate", "input", "continuous", start=0.0),
            Variable("length_ddot", "m/s2", "its acceleration", "input", "continuous", start=0.0),
            Variable("theta_force", "N.m", "torque", "input", "continuous", start=0.0),
        ),
        derivatives=derivatives,
        memory=("energy_start", "energy_booked"),
        start=[y_0, ca.vertcat(energy_0, energy_0)],
        rates=ca.vertcat(theta_dot, p_dot, power, dissipation),
        jump=ca.vertcat(theta, p, booked, dissipated),
        remember=ca.vertcat(energy_start, energy),
        nominals=ca.vertcat(1, mass * length**2, mass, mass),
        active=(ActiveInput("length", "length_dot", "length_ddot"),),
    )


def fall() -> Model:
    """Fall onto a centre, x'' = -1/x² from rest at x = x_0: it ends after t = π (x_0/2)^(3/2), where x = 0."""
    t, y, u, k, m = (ca.SX.sym(name, size) for name, size in (("t", 1), ("y", 2), ("u", 0), ("k", 2), ("m", 0)))
    x, v = ca.vertsplit(y)
    return _model(
        "HandFall",
        (t, y, u, k, m),
        {"x": ("m", "output", x), "v": ("m/s", "output", v), "a": ("m/s2", "local", -1 / x**2)},
        parameters=(_parameter("x_0", "m", 1.0, minimum=0.0, strict=True), _parameter("limit", "m/s", 1e9)),
        derivatives={"v": "x", "a": "v"},
        start=[ca.vertcat(k[0], 0), NOTHING],
        rates=ca.vertcat(v, -1 / x**2),
        conditions={"x must stay > 0": x, "v must stay > -limit": v + k[1]},
    )


def kick() -> Model:
    """x' = 1 until t_1, then x' = 3: x = t + 2 max(t - t_1, 0), not smooth at t_1."""
    t, y, u, k, m = (ca.SX.sym(name, size) for name, size in (("t", 1), ("y", 1), ("u", 0), ("k", 1), ("m", 0)))
    rate = ca.if_else(t >= k, 3.0, 1.0)
    return _model(
        "HandKick",
        (t, y, u, k, m),
        {"x": ("m", "output", y), "x_dot": ("m/s", "output", rate)},
        parameters=(_parameter("t_1", "s", 1.0),),
        derivatives={"x_dot": "x"},
        start=[ca.SX(1, 1), NOTHING],
        rates=rate,
        events=k,
    )


def _parameter(name: str, unit: str, start: float, *, tunable: bool = False, **domain: Any) -> Variable:
    return Variable(name, unit, name, "parameter", "tunable" if tunable else "fixed", start=start, **domain)


def _model(
    name: str,
    vectors: tuple[ca.SX, ...],
    z: Mapping[str, tuple[str, Causality, ca.SX]],
    *,
    parameters: tuple[Variable, ...],
    derivatives: Mapping[str, str],
    start: list[ca.SX],
    rates: ca.SX,
    inputs: tuple[Variable, ...] = (),
    memory: tuple[str, ...] = (),
    jump: ca.SX | None = None,
    remember: ca.SX = NOTHING,
    nominals: ca.SX | None = None,
    conditions: Mapping[str, ca.SX] | None = None,
    events: ca.SX = NOTHING,
    active: tuple[ActiveInput, ...] = (),
) -> Model:
    t, y, u, k, m = vectors
    point = [t, y, u, k]
    conditions = conditions or {}

    def function(title: str, arguments: list[ca.SX], *results: ca.SX) -> ca.Function:
        return ca.Function(title, arguments, [ca.densify(ca.SX(result)) for result in results])

    outputs = tuple(
        Variable(
            variable,
            unit,
            variable,
            causality,
            "fixed" if causality == "calculatedParameter" else "continuous",
            derivative_of=derivatives.get(variable),
        )
        for variable, (unit, causality, _) in z.items()
    )
    return Model(
        name=name,
        description=f"{name}, by hand",
        documentation="By hand.",
        parameters=parameters,
        inputs=inputs,
        outputs=outputs,
        states=tuple(State(state, derivative) for derivative, state in derivatives.items()),
        memory=memory,
        start=function("start", [t, u, k], *start),
        derivatives=function("derivatives", point, rates),
        outputs_function=function("outputs", [*point, m], ca.vertcat(*(e for _, _, e in z.values()))),
        jump=function("jump", [*point, m], y if jump is None else jump),
        remember=function("remember", [*point, m], remember),
        nominals=function("nominals", point, ca.SX.ones(y.shape) if nominals is None else nominals),
        conditions=function("conditions", point, ca.vertcat(*conditions.values()) if conditions else NOTHING),
        condition_texts=tuple(conditions),
        events=function("events", [k], events),
        active=active,
        experiment=Experiment(stop_time=5.0, step_size=0.1, tolerance=1e-8),
    )


# ---- what is known -----------------------------------------------------------------------------------------------


def libration(t: ArrayLike, amplitude: float, length: float = 1.0) -> tuple[NDArray, NDArray]:
    """θ and θ' of the free pendulum, from rest at the amplitude: sin θ/2 = k cd(Ωt), k = sin(amplitude/2)."""
    omega, k = np.sqrt(GRAVITY / length), np.sin(amplitude / 2)
    sn, cn, _, _ = ellipj(omega * np.asarray(t) + ellipk(k**2), k**2)
    return 2 * np.arcsin(k * sn), 2 * k * omega * cn


def rotation(t: ArrayLike, rate: float, length: float = 1.0) -> tuple[NDArray, NDArray]:
    """θ and θ' of the free pendulum, from θ = 0 with a rate > 2Ω: θ = 2 am(rate t/2), k = 2Ω/rate."""
    k = 2 * np.sqrt(GRAVITY / length) / rate
    _, _, dn, amplitude = ellipj(rate * np.asarray(t) / 2, k**2)
    return 2 * amplitude, rate * dn


def driven(times: ArrayLike, length: Callable[[float], tuple[float, float, float]], *, theta_0: float = 0.1) -> NDArray:
    """θ and p at some times for a prescribed length, mass 1, from rest; by SciPy's DOP853 at its tightest."""

    def rates(t: float, y: NDArray) -> list[float]:
        l, _, _ = length(t)  # noqa: E741
        return [y[1] / l**2, -GRAVITY * l * np.sin(y[0])]

    times = np.asarray(times, dtype=float)
    return solve_ivp(rates, (0, times[-1]), [theta_0, 0], method="DOP853", t_eval=times, rtol=1e-13, atol=1e-13).y


def breathing(t: float) -> tuple[float, float, float]:
    """The length 1 + 0.1 sin 2t with its two derivatives."""
    return 1 + 0.1 * np.sin(2 * t), 0.2 * np.cos(2 * t), -0.4 * np.sin(2 * t)
