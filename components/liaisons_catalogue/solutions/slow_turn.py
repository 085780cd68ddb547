"""Shift of a bead by a slow full turn of its hoop: -4π area/length (Hannay, Berry), and a remainder.

The curve is a sum of waves, OP = Σ c_k e^(iku), in the hoop's plane as complex numbers.  With the arc length ξ, ℓ in
all, <> the mean over it, a = r²θ' and r² = |OP|², a bead that runs at the speed v is shifted in the time T

* by a smooth turn (three continuous derivatives, SmoothStep's)::

      -2π<a> - ∫ (Var(r²)/4 β'⁴ + <G²> β"²)/(v - <a>β')³ dt + T β⁗(0) G_2(ξ_0)/v³ + O(1/T⁴)

  with dG/dξ = a - <a>, d²G_2/dξ² = G, all of mean zero; 2π<a> = 4π area/ℓ;
* by a turn that starts abruptly, where p_ξ = m v is kept, by -2πa(ξ_0) + O(1/T); on the average over ξ_0 by::

      -2π<a> + (2π)²/(2v²T²) · (<P(ξ_0 + vT - 2πa)> - 2π cov(a, r²)) + O(1/T³),    dP/dξ = r² - <r²>

Source: M 8.4, eq. 64, averaged to the orders given.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.integrate import quad

SLOW_TURN = "the shift of the bead in a slow full turn, -4π area/length (Hannay, Berry), and its remainders"
"""Name of the closed form of each hoop."""
_TURN = 2 * np.pi
_GRID = np.linspace(0, _TURN, 4096, endpoint=False)
_HARMONIC = np.fft.fftfreq(_GRID.size, 1 / _GRID.size)


@dataclass(frozen=True)
class SlowTurn:
    """A hoop in its own plane, and the shifts [m] of its bead in a full turn about O within a long ``duration`` [s]."""

    waves: Mapping[int, complex]  # c_k [m] by k

    def curve(self, u: ArrayLike, order: int = 0) -> NDArray:
        """Point OP of the hoop as complex number [m], or its derivative of an ``order`` by u [rad], of any shape."""
        terms = ((1j * k) ** order * c * np.exp(1j * k * np.asarray(u, dtype=float)) for k, c in self.waves.items())
        return np.sum(list(terms), axis=0)

    def speed(self, u: ArrayLike) -> NDArray:
        """Length dξ/du [m/rad]."""
        return np.abs(self.curve(u, 1))

    def lever_arm(self, u: ArrayLike) -> NDArray:
        """Lever arm a = r²θ' of the tangent about O [m]."""
        return np.imag(np.conj(self.curve(u)) * self.curve(u, 1)) / self.speed(u)

    def r_squared(self, u: ArrayLike) -> NDArray:
        """Square of the distance from O, |OP|² [m2]."""
        return np.abs(self.curve(u)) ** 2

    @cached_property
    def length(self) -> float:
        """Length ℓ of the hoop [m]."""
        return float(_TURN * np.mean(self.speed(_GRID)))

    @cached_property
    def shift(self) -> float:
        """Shift -4π area/length [m] in an infinitely slow turn."""
        return float(-_TURN * self._mean(self.lever_arm(_GRID)))

    def spread(self, beads: int) -> NDArray:
        """Coordinates u of beads at equal distances along the hoop, from u = 0 on."""
        lengths, u = self.length * np.arange(beads) / beads, _TURN * np.arange(beads) / beads
        for _ in range(50):
            step = (self._arc_length(u) - lengths) / self.speed(u)
            u = u - step
            if np.max(np.abs(step)) <= 1e-14:
                break
        return u

    def smooth_remainder(self, duration: float, u: ArrayLike, speed: float = 1.0) -> NDArray:
        """Error of :attr:`shift` [m] after a SmoothStep, to order 1/T³, for beads at u with a speed [m/s] before."""
        a, r_squared = self.lever_arm(_GRID), self.r_squared(_GRID)
        G = self._primitive(a)
        variance, square, mean = self._mean(r_squared**2) - self._mean(r_squared) ** 2, self._mean(G**2), self._mean(a)

        def rate(x: float) -> float:
            """Integrand of the remainder at the time x of the turn, from 0 to 1."""
            beta_dot = _TURN / duration * 140 * (x * (1 - x)) ** 3
            beta_ddot = _TURN / duration**2 * 420 * (x * (1 - x)) ** 2 * (1 - 2 * x)
            return -(variance / 4 * beta_dot**4 + square * beta_ddot**2) / (speed - mean * beta_dot) ** 3

        jump = _TURN * 840 / duration**4  # of the fourth derivative of β
        G_2 = _interpolated(np.fft.fft(self._primitive(self._primitive(G))), u)
        return quad(rate, 0, 1, epsabs=0)[0] * duration + jump * duration * G_2 / speed**3

    def abrupt_bound(self, duration: float, speed: float = 1.0) -> float:
        """Bound (2π)² max |<r²> - r²|/2vT [m] of the error of -2πa(ξ_0) after an abrupt turn, to order 1/T."""
        r_squared = self.r_squared(_GRID)
        return float(_TURN**2 * np.max(np.abs(r_squared - self._mean(r_squared))) / (2 * speed * duration))

    def abrupt_mean_remainder(self, duration: float, speed: float = 1.0) -> float:
        """Mean error of :attr:`shift` [m] over all starting points of an abrupt turn, to order 1/T²."""
        a, r_squared = self.lever_arm(_GRID), self.r_squared(_GRID)
        xi, primitive = self._arc_length(_GRID), self._primitive(r_squared)
        end = np.mod(xi + speed * duration - _TURN * a, self.length)
        at_end = np.interp(end, np.append(xi, self.length), np.append(primitive, primitive[0]))
        covariance = self._mean(a * r_squared) - self._mean(a) * self._mean(r_squared)
        return float(_TURN**2 / (2 * speed**2 * duration**2) * (self._mean(at_end) - _TURN * covariance))

    def _arc_length(self, u: NDArray) -> NDArray:
        """Arc length from 0 to u [m]."""
        arc = _primitive_spectrum(self.speed(_GRID))
        return self.length / _TURN * u + _interpolated(arc, u) - _interpolated(arc, 0.0)

    def _mean(self, values: NDArray) -> float:
        """Mean over the arc length of values on the grid."""
        return float(np.average(values, weights=self.speed(_GRID)))

    def _primitive(self, values: NDArray) -> NDArray:
        """Periodic primitive over ξ of values on the grid less their mean; of mean 0."""
        G = np.real(np.fft.ifft(_primitive_spectrum((values - self._mean(values)) * self.speed(_GRID))))
        return G - self._mean(G)


def _primitive_spectrum(values: NDArray) -> NDArray:
    """Fourier coefficients of the periodic primitive over u of values on the grid less their mean."""
    spectrum = np.fft.fft(values)
    return np.divide(spectrum, 1j * _HARMONIC, where=_HARMONIC != 0, out=np.zeros_like(spectrum))


def _interpolated(spectrum: NDArray, u: ArrayLike) -> NDArray:
    """Values at u of a function with these Fourier coefficients; those beyond the 256th are rounding."""
    near = np.abs(_HARMONIC) <= 256
    waves = np.exp(1j * np.multiply.outer(np.asarray(u, dtype=float), _HARMONIC[near]))
    return np.real(waves @ spectrum[near]) / _GRID.size
