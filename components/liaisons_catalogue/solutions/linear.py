"""The linear oscillator x'' + γ x' + ω_0² x = Re Σ f e^(iωt): its motion in one formula for all regimes.

With the roots λ_1, λ_2 of λ² + γ λ + ω_0² (K eq. 126) the impulse response S and the response D to e^(iωt) from rest
are divided differences of the exponential function,

    S(t) = exp[λ_1, λ_2](t),      D(t) = ∫_0^t S(t - lag) e^(iωτ) dlag = exp[λ_1, λ_2, iω](t).

They are continuous where K eq. 127 and 124 divide by zero: at critical damping (λ_1 = λ_2, K eq. 128) and at the
undamped resonance (iω = λ_1, secular growth).
"""

from collections.abc import Sequence
from itertools import permutations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from liaisons.closed_forms import Values

Modes = tuple[NDArray, NDArray]
"""Frequencies [rad/s], (n,), and modes as columns, (n, n)."""

_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(12)


def oscillation(
    t: ArrayLike,
    position: float,
    rate: float,
    *,
    omega_squared: float,
    gamma: float,
    forces: Sequence[tuple[complex, float]] = (),
) -> tuple[NDArray, NDArray]:
    """Position and rate that solve x'' + γ x' + ω_0² x = Re Σ f e^(iωt).

    :param t: times since the start [s], any shape, >= 0.
    :param position: x(0); ``rate`` is x'(0).
    :param omega_squared: ω_0² >= 0 [1/s²].
    :param gamma: γ >= 0 [1/s].
    :param forces: pairs (f, ω): complex amplitude per unit mass and angular frequency; ω = 0 is a constant force.
    """
    t = np.asarray(t, dtype=float)
    slow, fast = _roots(omega_squared, gamma)
    S = _divided_difference(slow, fast, t)
    S_dot = np.exp(slow * t) + fast * S
    x = position * (S_dot + gamma * S) + rate * S
    v = -position * omega_squared * S + rate * S_dot
    for amplitude, omega in forces:
        D = _second_divided_difference((slow, fast, 1j * omega), t)
        x = x + amplitude * D
        v = v + amplitude * (S + 1j * omega * D)
    return x.real, v.real


def coordinate_motion(
    t: NDArray,
    at: Values,
    name: str,
    *,
    omega_squared: float = 0.0,
    gamma: float = 0.0,
    forces: Sequence[tuple[complex, float]] = (),
) -> dict[str, NDArray]:
    """Value and rate of a coordinate by name, from its start values, as :func:`oscillation` of it."""
    start = at.array(f"{name}_0", f"{name}_dot_0")
    motion = oscillation(t, *start, omega_squared=omega_squared, gamma=gamma, forces=forces)
    return dict(zip((name, f"{name}_dot"), motion, strict=True))


def superposition(
    t: ArrayLike,
    frequencies: NDArray,
    modes: NDArray,
    position: ArrayLike,
    rate: ArrayLike,
    *,
    push: ArrayLike = 0.0,
    forces: Sequence[tuple[complex, float]] = (),
) -> tuple[NDArray, NDArray]:
    """Positions and rates of n undamped degrees of freedom, by superposition of their normal modes.

    :param t: times since the start [s], any shape, >= 0.
    :param frequencies: Ω_k [rad/s], (n,).
    :param modes: columns φ_k, (n, n).
    :param position: x(0), (n,); ``rate`` is x'(0); scalars stand for all.
    :param push: accelerations, (n,), in the direction of which the ``forces`` act; see :func:`oscillation`.
    :returns: x and x', (..., n).
    """
    columns = [np.broadcast_to(np.asarray(part, dtype=float), frequencies.shape) for part in (position, rate, push)]
    starts = np.linalg.solve(modes, np.stack(columns, axis=1))
    moving = [
        oscillation(
            t, a, b, omega_squared=w**2, gamma=0.0, forces=[(f * amplitude, omega) for amplitude, omega in forces]
        )
        for w, (a, b, f) in zip(frequencies, starts, strict=True)
    ]
    x, v = (np.stack(part, axis=-1) @ modes.T for part in zip(*moving, strict=True))
    return x, v


def _roots(omega_squared: float, gamma: float) -> tuple[complex, complex]:
    """Roots of λ² + γ λ + ω_0² (K eq. 126), without cancellation; that of the slower decay is the first."""
    fast = -gamma / 2 - np.emath.sqrt(gamma**2 / 4 - omega_squared)
    return complex(omega_squared / fast if fast else 0), complex(fast)


def _divided_difference(a: complex, b: complex, t: NDArray) -> NDArray:
    """Divided difference exp[a, b](t) = (e^(at) - e^(bt)) / (a - b), without cancellation or overflow."""
    if a.real < b.real:
        a, b = b, a
    z = (b - a) * t
    quotient = np.divide(np.expm1(z), z, out=np.ones_like(z), where=z != 0)
    return np.exp(a * t) * t * quotient


def _second_divided_difference(nodes: tuple[complex, complex, complex], t: NDArray) -> NDArray:
    """Divided difference exp[a, b, c](t) = (exp[a, b](t) - exp[b, c](t)) / (a - c) of three nodes in any order.

    a and c are the nodes that differ most.  While |a - c| t < 1 the quotient loses digits; there the convolution is
    integrated by Gauss's rule, whose twelve points are exact to rounding for so short a piece of an exponential.
    """
    a, b, c = max(permutations(nodes), key=lambda order: abs(order[0] - order[2]))
    short = np.abs(a - c) * t < 1
    lag = np.multiply.outer(np.where(short, t, 0.0), (1 + _NODES) / 2)
    convolved = _divided_difference(a, b, t[..., None] - lag) * np.exp(c * lag)
    integral = np.where(short, t / 2, 0.0) * (convolved @ _WEIGHTS)
    quotient = (_divided_difference(a, b, t) - _divided_difference(b, c, t)) / (a - c or 1)
    return np.where(short, integral, quotient)
