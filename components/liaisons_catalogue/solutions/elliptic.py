"""The pendulum equation φ'' = -Ω² sin φ solved by Jacobi's elliptic functions, for any start.

With k² = sin²(φ_0/2) + (φ'_0/2Ω)² (energy over that of the upper equilibrium) the half angle is

* libration, k < 1:    sin(φ/2) = k sn(u | k²),   φ' = 2 Ω k cn(u | k²),     u = u_0 + Ω t
* rotation, k > 1:     φ/2 = ± am(u | 1/k²),      φ' = ± 2 Ω k dn(u | 1/k²), u = u_0 + k Ω t
* separatrix, k = 1:   φ/2 = ± gd(u),             φ' = ± 2 Ω / cosh u,       u = u_0 + Ω t

Near the separatrix everything depends on the complementary parameter m_1 = 1 - m, m = k², which is lost to rounding in
a function of m.  All functions here take m_1, and are accurate to a few rounding errors however small m_1 is.  What
remains is the conditioning of the problem itself: a relative error ε of the data shifts u by about ε / |1 - k²| per
swing, and is amplified by e^Ωt while the motion passes the upper equilibrium.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.special import ellipkm1, elliprf

_EPSILON = float(np.finfo(float).eps)


@dataclass(frozen=True, slots=True)
class _InitialState:
    """Initial state, split into the valley it lies in and the half angle within that valley."""

    valley: float  # φ_0 lies within π of 2π · valley
    sine: float  # of the half angle from the bottom of the valley
    cosine: float  # >= 0
    speed: float  # φ'_0 / 2Ω

    @property
    def modulus(self) -> float:
        """Modulus k."""
        return float(np.hypot(self.sine, self.speed))

    @property
    def complementary_parameter(self) -> float:
        """Complementary parameter 1 - k², as a product that keeps its digits where k is close to 1."""
        return (self.cosine - abs(self.speed)) * (self.cosine + abs(self.speed))

    @property
    def on_separatrix(self) -> bool:
        """Whether 1 - k² is within the rounding of sine, cosine and speed."""
        return abs(self.cosine - abs(self.speed)) <= 2 * _EPSILON * abs(self.speed)


def _initial_state(angle: float, rate: float, frequency: float) -> _InitialState:
    """Initial state with an angle [rad] and a rate [rad/s]; ``frequency`` is Ω [rad/s]."""
    valley = float(np.round(angle / (2 * np.pi)))
    sign = 1 - 2 * (valley % 2)  # sine and cosine of a half angle change sign from one valley to the next
    return _InitialState(valley, sign * np.sin(angle / 2), sign * np.cos(angle / 2), rate / (2 * frequency))


def pendulum(t: ArrayLike, angle: float, rate: float, frequency: float) -> tuple[NDArray, NDArray]:
    """Angle and rate that solve φ'' = -Ω² sin φ.

    :param t: times since the start [s], any shape.
    :param angle: initial angle [rad], any number of turns; ``rate`` the initial rate [rad/s].
    :param frequency: Ω >= 0 [rad/s].
    :returns: φ, not wrapped [rad], and φ' [rad/s], with the shape of ``t``.
    """
    t = np.asarray(t, dtype=float)
    if frequency == 0:
        return angle + rate * t, np.full_like(t, rate)
    start = _initial_state(angle, rate, frequency)
    sense = np.sign(rate)
    k, m_1 = start.modulus, start.complementary_parameter
    phase = frequency * t
    if start.on_separatrix:
        u = np.arcsinh(start.sine / start.cosine) + sense * phase
        half = 2 * np.arctan(np.tanh(u / 2))
        half_rate = sense * 2 * np.exp(-np.abs(u)) / (1 + np.exp(-2 * np.abs(u)))  # sech, without overflow
    elif m_1 > 0:
        _, sn, cn, dn = jacobi(phase + inverse_jacobi(start.sine, start.speed, m_1), m_1)
        half, half_rate = np.arctan2(k * sn, dn), k * cn
    else:
        inverse_square = -m_1 / k**2  # 1 - 1/k²
        u_0 = inverse_jacobi(sense * start.sine, start.cosine, inverse_square)
        am, _, _, dn = jacobi(k * phase + u_0, inverse_square)
        half, half_rate = sense * am, sense * k * dn
    return 2 * half + 2 * np.pi * start.valley, 2 * frequency * half_rate


def period(angle: float, rate: float, frequency: float) -> float:
    """Period [s] of a libration, 4 K(k)/Ω, or of a rotation, 2 K(1/k)/kΩ; infinite on the separatrix."""
    start = _initial_state(angle, rate, frequency)
    k, m_1 = start.modulus, start.complementary_parameter
    if start.on_separatrix:
        return np.inf
    if m_1 > 0:
        return float(4 * ellipkm1(m_1) / frequency)
    return float(2 * ellipkm1(-m_1 / k**2) / (k * frequency))


def duration(start: tuple[float, float], end: tuple[float, float], frequency: float) -> float:
    """Time [s] from one state (angle [rad], rate [rad/s]) to a later one of the same motion, less than a period."""
    first, last = _initial_state(*start, frequency), _initial_state(*end, frequency)
    k, m_1 = first.modulus, first.complementary_parameter
    if m_1 > 0:
        u_0, u_1 = (inverse_jacobi(state.sine, state.speed, m_1) for state in (first, last))
    else:
        sense = np.sign(start[1])
        u_0, u_1 = (inverse_jacobi(sense * state.sine, state.cosine, -m_1 / k**2) / k for state in (first, last))
    return float((u_1 - u_0) / frequency % period(*start, frequency))


def jacobi(u: ArrayLike, m_1: float) -> tuple[NDArray, NDArray, NDArray, NDArray]:
    """Jacobi's elliptic functions am, sn, cn, dn by the arithmetic-geometric mean.

    :param u: argument, any shape, any size.
    :param m_1: complementary parameter 1 - m, with the parameter m = k²; 0 < m_1 <= 1.
    """
    u = np.asarray(u, dtype=float)
    quarter = float(ellipkm1(m_1))
    half_periods = np.round(u / (2 * quarter))
    # Down a ladder of moduli to circular functions of u in [-K, K], and the amplitude back up.
    a, b = 1.0, float(np.sqrt(m_1))
    ladder = []
    while a - b > _EPSILON * a:
        a, b, c = (a + b) / 2, float(np.sqrt(a * b)), (a - b) / 2
        ladder.append((a, b, c))
    amplitude = 2.0 ** len(ladder) * a * (u - 2 * quarter * half_periods)
    for a, b, c in reversed(ladder):
        sine, cosine = np.sin(amplitude), np.cos(amplitude)
        # arcsin(c/a sin φ), with its cosine from a² = b² + c² because an arcsin near ±1 has no digits
        amplitude = (amplitude + np.arctan2(c * sine, np.hypot(a * cosine, b * sine))) / 2
    sine, cosine = np.sin(amplitude), np.cos(amplitude)
    parity = 1 - 2 * (half_periods % 2)
    dn = np.hypot(cosine, np.sqrt(m_1) * sine)
    return amplitude + np.pi * half_periods, parity * sine, parity * cosine, dn


def inverse_jacobi(sine: float, cosine: float, m_1: float) -> float:
    """Argument u, |u| <= 2K, at which sn u : cn u = sine : cosine, by Carlson's form of Legendre's F."""
    length = np.hypot(sine, cosine)
    if length == 0:
        return 0.0
    sn, cn = sine / length, cosine / length
    u = float(sn * elliprf(cn**2, cn**2 + m_1 * sn**2, 1.0))
    return u if cn >= 0 else float(np.copysign(2 * ellipkm1(m_1), sn)) - u
