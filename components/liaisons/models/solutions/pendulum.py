"""Closed forms of the pendulum: period, action, small swings, and its response to the operator."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.special import ellipe, ellipk

from liaisons.language import Values, closed_form
from liaisons.models.solutions import elliptic, mathieu
from liaisons.models.solutions.bessel import lengthening_pendulum
from liaisons.models.solutions.integration import integrate
from liaisons.models.solutions.linear import oscillation
from liaisons.models.solutions.validity import require


@closed_form("the motion of Pendulum with a fixed rod, from the angle theta_0 at the rate theta_dot_0", gravity="> 0")
def cartesian(t: NDArray, at: Values, *, theta_0: float = 0.1, theta_dot_0: float = 0.0) -> dict[str, NDArray]:
    theta, rate = elliptic.pendulum(t, theta_0, theta_dot_0, np.sqrt(at.gravity / at.rod))
    x, depth = at.rod * np.sin(theta), at.rod * np.cos(theta)
    lambda_1 = -at.mass * (at.rod * rate**2 + at.gravity * np.cos(theta)) / (2 * at.rod)
    return {"x": x, "z": at.height - depth, "x_dot": depth * rate, "z_dot": x * rate, "lambda_1": lambda_1}


@closed_form("the period [s]: 4 K(k)/Ω of a swing, 2 K(1/k)/kΩ of a full turn, else infinite", gravity="> 0")
def period(at: Values) -> float:
    return elliptic.period(at.theta_0, at.theta_dot_0, np.sqrt(at.gravity / at.length))


@closed_form("the action ∮ p dθ/2π [J.s] of a swing or of a full turn at constant length", gravity="> 0")
def action(theta: ArrayLike, theta_dot: ArrayLike, length: ArrayLike, at: Values) -> NDArray:
    """(8/π) m l² Ω (E(k) - (1 - k²) K(k)), or (4/π) m l² Ω k E(1/k); states of any shape."""
    omega = np.sqrt(at.gravity / np.asarray(length))
    m = np.sin(np.asarray(theta) / 2) ** 2 + (np.asarray(theta_dot) / (2 * omega)) ** 2  # k²
    inside, outside = np.minimum(m, 1.0), 1 / np.maximum(m, 1.0)
    swinging = 2 * (ellipe(inside) - (1 - inside) * ellipk(np.where(m < 1, inside, 0.0)))
    whole = np.where(m < 1, swinging, np.sqrt(m) * ellipe(outside))
    return 4 / np.pi * at.mass * np.asarray(length) ** 2 * omega * whole


@closed_form("the motion for sin θ ≈ θ (K Ex. 3, 6), whose period is short by θ²/16", gravity="> 0")
def small_angle(t: NDArray, at: Values) -> dict[str, NDArray]:
    omega_squared = at.gravity / at.length
    motion = oscillation(t, at.theta_0, at.theta_dot_0, omega_squared=omega_squared, gamma=at.friction)
    return dict(zip(("theta", "theta_dot"), motion, strict=True))


@closed_form(
    "the motion for sin θ ≈ θ while the length grows evenly: Bessel functions", gravity="> 0", length_dot="!= 0"
)
def lengthening(t: NDArray, at: Values) -> dict[str, NDArray]:
    shortest = np.min(at.length + at.length_dot * t)
    require(shortest > 0, f"Pendulum.lengthening: the length falls to {shortest} m; end before it reaches 0")
    lengths = {"length": at.length, "speed": at.length_dot, "gravity": at.gravity}
    motion = lengthening_pendulum(t, at.theta_0, at.theta_dot_0, **lengths)
    return dict(zip(("theta", "theta_dot"), motion, strict=True))


# ---- pumped by its length (M 8.1) ----------------------------------------------------------------------------------


@closed_form(
    "the growth of 1 - cos θ_max in each half swing, by crouching (p_θ is kept) and standing up at once",
    length_low="> 0",
    length_high="> 0",
)
def crouch_growth(*, length_low: float, length_high: float) -> float:
    return (length_low / length_high) ** 3


@closed_form(
    "when to stand up and to crouch, let go at θ_0: quarter periods K √(l/g)",
    gravity="> 0",
    theta_0="> 0",
    length_low="> 0",
    length_high="> 0",
)
def crouch_schedule(half_swings: int, at: Values, *, length_low: float, length_high: float) -> tuple[NDArray, NDArray]:
    """Instants [s] alternately at θ = 0 and at a turning point, (2 half_swings,); θ_max [rad], (half_swings + 1,)."""
    growth = (length_low / length_high) ** 3
    versines = (1 - np.cos(at.theta_0)) * growth ** np.arange(half_swings + 1)
    require(
        versines[-1] < 2, f"Pendulum.crouch_schedule: it goes over the top; half_swings = {half_swings} is too many"
    )
    quarters = ellipk(versines / 2)  # k² = sin²(θ_max/2)
    falls, rises = quarters[:-1] * np.sqrt(length_low / at.gravity), quarters[1:] * np.sqrt(length_high / at.gravity)
    return np.cumsum(np.column_stack([falls, rises])), np.arccos(1 - versines)


@closed_form(
    "the motion under the length l + amplitude · sin(angular_frequency t): integrated at 1e-13", amplitude="< length"
)
def pumped(t: NDArray, at: Values, *, amplitude: float, angular_frequency: float) -> dict[str, NDArray]:
    def rates(t: float, y: NDArray) -> list[float]:
        phase = angular_frequency * t
        length, speed = at.length + amplitude * np.sin(phase), amplitude * angular_frequency * np.cos(phase)
        return [y[1], -(at.gravity * np.sin(y[0]) + 2 * speed * y[1]) / length]

    motion = integrate("Pendulum.pumped", rates, [at.theta_0, at.theta_dot_0], t)
    return dict(zip(("theta", "theta_dot"), motion, strict=True))


@closed_form(
    "the growth rate [1/s] of small swings under the length l (1 + depth · sin 2Ωt), ¾ Ω · depth", gravity="> 0"
)
def pumping_rate(depth: float, at: Values) -> float:
    """To first order in the depth: the first of Mathieu's tongues, at its middle."""
    return float(0.75 * depth * np.sqrt(at.gravity / at.length))


# ---- shaken at its pivot, z = amplitude · sin(angular_frequency t): Mathieu's equation, Kapitza's potential ---------


@closed_form(
    "the trace of the map of small swings over a period of the shaken pivot: bounded where it is below 2 in size"
)
def shaken_trace(at: Values, *, amplitude: float, angular_frequency: float) -> float:
    """About θ = 0; with the weight upwards, ``gravity`` < 0, about a bob that stands on its pivot."""
    return mathieu.trace(4 * at.gravity / (at.length * angular_frequency**2), 2 * amplitude / at.length)


@closed_form("whether small swings on a shaken pivot stay bounded: between Mathieu's a_m and b_(m+1)")
def shaken_is_bounded(gravity: ArrayLike, amplitude: ArrayLike, at: Values, *, angular_frequency: float) -> NDArray:
    """``gravity`` [m/s2], of either sign, and ``amplitude`` [m] broadcast."""
    delta = 4 * np.asarray(gravity) / (at.length * angular_frequency**2)
    return mathieu.is_bounded(delta, 2 * np.asarray(amplitude) / at.length)


@closed_form(
    "the gravities [m/s2] at which small swings on a shaken pivot begin to grow: those of a_0, b_1, a_1, ... a_count"
)
def shaken_edges(amplitude: ArrayLike, at: Values, *, angular_frequency: float, count: int = 4) -> NDArray:
    """Shape (2 count + 1, ...) with the shape of ``amplitude`` [m]."""
    return mathieu.edges(2 * np.asarray(amplitude) / at.length, count) * at.length * angular_frequency**2 / 4


@closed_form(
    "the angular frequency [rad/s] beyond which a shaken pivot holds the bob up, √(2gl)/amplitude", gravity="> 0"
)
def upright_from(amplitude: float, at: Values) -> float:
    """Of the averaged potential -mgl cos θ + ¼ m a²ν² sin² θ (Kapitza): the leading order in a/l."""
    return float(np.sqrt(2 * at.gravity * at.length) / amplitude)


@closed_form("the well about the top in the averaged potential -mgl cos θ + ¼ m a²ν² sin² θ (Kapitza)", gravity="> 0")
def upright_well(amplitude: float, angular_frequency: float, at: Values) -> tuple[float, float]:
    """Angular frequency of small swings in it [rad/s], and how far from the top it reaches [rad]."""
    ratio = (amplitude * angular_frequency) ** 2 / (2 * at.gravity * at.length)
    require(ratio > 1, f"Pendulum.upright_well: angular_frequency = {angular_frequency}: so slow it holds nothing up")
    return float(np.sqrt(at.gravity / at.length * (ratio - 1))), float(np.arccos(1 / ratio))
