"""Components written out by hand, and what is known about their motion: nothing here uses the derivation.

Pendulum of variable length, M 8.1 with one point mass::

    p = m l² θ',   p' = -m g l sin θ - η p + τ,   λ = m l'' - m l θ'² - m g cos θ + η m l'
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.integrate import solve_ivp
from scipy.special import ellipj, ellipk

from liaisons.language import Dimension, Experiment, Variable
from liaisons.mechanics import ActiveInput, Model, State

GRAVITY = 9.81
NOTHING = ca.SX(0, 1)


def pendulum() -> Model:
    """Pendulum with states theta, p_theta, work, dissipated; driven through length and theta_force."""
    t, y, u, k, m = _vectors(4, 4, 5, 2)
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
    z: dict[str, tuple[str, Any, ca.SX]] = {
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
    t, y, u, k, m = _vectors(2, 0, 2, 0)
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
    t, y, u, k, m = _vectors(1, 0, 1, 0)
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


def ring(n: int) -> Model:
    """Masses in a ring, each drawn to an anchor of its own that an operator moves, neighbours bound by springs.

    ::

        x' = p/m,   p' = k sin(a - x) + s - s_right + f  with s = c (x_left - x),   λ = k sin(a - x) + m a''/2

    Arrays of n: x_0, the bonds c to the left, the anchors a with their rates, the forces f, x, p and their rates, λ.
    """
    size = Dimension("n", n, "number of masses")
    y, u, k = ca.MX.sym("y", 2 * n + 1), ca.MX.sym("u", 4 * n), ca.MX.sym("k", 2 + 2 * n)
    t, m = ca.MX.sym("t"), ca.MX.sym("m")
    x, p, work = ca.vertsplit(y, [0, n, 2 * n, 2 * n + 1])
    anchor, anchor_dot, anchor_ddot, force = ca.vertsplit(u, n)
    mass, stiffness, x_0, bond = ca.vertsplit(k, [0, 1, 2, 2 + n, 2 + 2 * n])
    spring = bond * ((ca.vertcat(x[-1], x[:-1]) if n > 1 else x) - x)
    x_dot = p / mass
    p_dot = stiffness * ca.sin(anchor - x) + spring - (ca.vertcat(spring[1:], spring[0]) if n > 1 else spring) + force
    operator = stiffness * ca.sin(anchor - x) + mass / 2 * anchor_ddot
    kinetic = ca.dot(p, p) / (2 * mass) + mass / 2 * ca.dot(anchor_dot, anchor_dot)
    power = ca.dot(operator, anchor_dot) + ca.dot(force, x_dot)
    z: dict[str, tuple[str, Any, ca.MX]] = {
        "x": ("m", "output", x),
        "x_dot": ("m/s", "output", x_dot),
        "p": ("kg.m/s", "output", p),
        "p_dot": ("N", "local", p_dot),
        "anchor_force": ("N", "output", operator),
        "kinetic_energy": ("J", "output", kinetic),
        "work": ("J", "output", work + kinetic - m),
        "power": ("W", "local", power),
        "weights": ("N", "calculatedParameter", GRAVITY * mass * (1 + bond)),
    }
    model = _model(
        "HandRing",
        (t, y, u, k, m),
        z,
        parameters=(
            _parameter("mass", "kg", 1.0, minimum=0.0, strict=True),
            _parameter("stiffness", "N", 2.0, tunable=True),
            replace(_parameter("x_0", "m", 0.0), start=(0.5, -0.25)[:n], dimension=size),
            replace(_parameter("bond", "N/m", 0.75, minimum=0.0), dimension=size),
        ),
        inputs=tuple(
            Variable(name, unit, name, "input", "continuous", start=start, maximum=limit, dimension=size)
            for name, unit, start, limit in (
                ("anchor", "m", 0.125, 10.0),
                ("anchor_dot", "m/s", 0.0, None),
                ("anchor_ddot", "m/s2", 0.0, None),
                ("force", "N", 0.0, None),
            )
        ),
        derivatives={"x_dot": "x", "p_dot": "p", "power": "work"},
        memory=("kinetic_booked",),
        start=[ca.vertcat(x_0, ca.MX.zeros(n), 0), mass / 2 * ca.dot(anchor_dot, anchor_dot)],
        rates=ca.vertcat(x_dot, p_dot, power),
        jump=ca.vertcat(x, p, work + kinetic - m),
        remember=kinetic,
        nominals=ca.MX.ones(2 * n + 1),
        active=(ActiveInput("anchor", "anchor_dot", "anchor_ddot"),),
    )
    of_size = ("x", "x_dot", "p", "p_dot", "anchor_force", "weights")
    outputs = tuple(replace(v, dimension=size) if v.name in of_size else v for v in model.outputs)
    return replace(model, outputs=outputs, dimensions=(size,))


def _vectors(*sizes: int) -> list[ca.SX]:
    """t, and y, u, k, m of these sizes."""
    return [ca.SX.sym(name, size) for name, size in zip("tyukm", (1, *sizes), strict=True)]


def _parameter(name: str, unit: str, start: float, *, tunable: bool = False, **domain: Any) -> Variable:
    return Variable(name, unit, name, "parameter", "tunable" if tunable else "fixed", start=start, **domain)


def _model(
    name: str,
    vectors: Sequence[Any],
    z: Mapping[str, tuple[str, Any, Any]],
    *,
    derivatives: Mapping[str, str],
    start: Sequence[Any],
    rates: Any,
    jump: Any = None,
    remember: Any = NOTHING,
    nominals: Any = None,
    conditions: Mapping[str, ca.SX] | None = None,
    events: ca.SX = NOTHING,
    **more: Any,
) -> Model:
    t, y, u, k, m = vectors
    point = [t, y, u, k]
    conditions = conditions or {}

    kind = type(y)

    def function(title: str, arguments: list[Any], *results: Any) -> ca.Function:
        dense = [kind.zeros(0, 1) if result is NOTHING else ca.densify(kind(result)) for result in results]
        return ca.Function(title, arguments, dense)

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
        outputs=outputs,
        states=tuple(State(state, derivative) for derivative, state in derivatives.items()),
        start=function("start", [t, u, k], *start),
        derivatives=function("derivatives", point, rates),
        outputs_function=function("outputs", [*point, m], ca.vertcat(*(e for _, _, e in z.values()))),
        jump=function("jump", [*point, m], y if jump is None else jump),
        remember=function("remember", [*point, m], remember),
        nominals=function("nominals", point, kind.ones(y.shape) if nominals is None else nominals),
        conditions=function("conditions", point, ca.vertcat(*conditions.values()) if conditions else NOTHING),
        condition_texts=tuple(conditions),
        events=function("events", [k], events),
        experiment=Experiment(stop_time=5.0, step_size=0.1, tolerance=1e-8),
        **{"inputs": (), "memory": (), **more},
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


def breathing_inputs(t: float) -> dict[str, float]:
    """These by the names of the pendulum's inputs."""
    return dict(zip(("length", "length_dot", "length_ddot"), breathing(t), strict=True))
