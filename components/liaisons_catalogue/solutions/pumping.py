"""The pendulum pumped by its length (M 8.1)."""

import numpy as np
from numpy.typing import NDArray
from scipy.special import ellipk

from liaisons.closed_forms import Values, closed_form
from liaisons_catalogue.solutions.integration import integrate


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
    """Return instants [s] of θ = 0 and of turning points, (2 half_swings,), and θ_max [rad], (half_swings + 1,)."""
    growth = crouch_growth(length_low=length_low, length_high=length_high)
    versines = (1 - np.cos(at.theta_0)) * growth ** np.arange(half_swings + 1)
    at.require(versines[-1] < 2, f"it goes over the top; half_swings = {half_swings} is too many")
    quarters = ellipk(versines / 2)  # k² = sin²(θ_max/2)
    falls, rises = quarters[:-1] * np.sqrt(length_low / at.gravity), quarters[1:] * np.sqrt(length_high / at.gravity)
    return np.cumsum(np.column_stack([falls, rises])), np.arccos(1 - versines)


@closed_form(
    "the motion under the length l + amplitude · sin(angular_frequency t): integrated at 1e-13", amplitude="< length"
)
def pumped(t: NDArray, at: Values, *, amplitude: float, angular_frequency: float) -> dict[str, NDArray]:
    def rates(t: float, y: NDArray) -> list[float]:
        """Rates of θ and θ_dot."""
        phase = angular_frequency * t
        length, speed = at.length + amplitude * np.sin(phase), amplitude * angular_frequency * np.cos(phase)
        return [y[1], -(at.gravity * np.sin(y[0]) + 2 * speed * y[1]) / length]

    motion = integrate(at, rates, [at.theta_0, at.theta_dot_0], t)
    return dict(zip(("theta", "theta_dot"), motion, strict=True))


@closed_form(
    "the growth rate [1/s] of small swings under the length l (1 + depth · sin 2Ωt), ¾ Ω · depth", gravity="> 0"
)
def pumping_rate(depth: float, at: Values) -> float:
    """Return the rate in the middle of Mathieu's first tongue, to first order in the depth."""
    return float(0.75 * depth * np.sqrt(at.gravity / at.length))
