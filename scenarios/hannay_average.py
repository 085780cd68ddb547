"""Averaged over the place where the bead starts, a hoop turned once round shifts it by -4πA/ℓ, however it is started.

M 8.4, eq. 64; A and ℓ are area and length of the hoop.  Started smoothly, every bead is shifted by that much, but for a
remainder of order 1/T³.  If the rate jumps to 2π/T and p_ξ stays mv, a bead is shifted by -2πa(ξ_0), a = r²θ', which
differs from bead to bead by metres; the average is again -4πA/ℓ.  With Jacobi's integral ξ'² - β'² r², and P the
periodic primitive of r², its remainder is

    (2π)² / (2 v² T²) · (<P(ξ_0 + vT - 2πa)> - 2π cov(a, r²)) + O(1/T³)

If the speed along the turning hoop is what is prescribed, there is no shift on average.  These are ensembles of the
equations that the FMUs have; scenario ``hannay_hoop`` runs the FMUs themselves for some beads.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from numpy.typing import NDArray
from scipy.special import ellipeinc

from liaisons import Verdict, ensemble, max_error, run_scenario, slope, verdict
from liaisons.models import CircularHoop, EllipticHoop, Ramp, SmoothStep

TURN = 2 * np.pi
SPEED, STEP = 1.0, 0.05  # of the bead [m/s]; of the method [s]
BEADS = 128
TIMES = np.array([100.0, 200.0, 400.0, 800.0])


@dataclass(frozen=True)
class Hoop:
    """Points OP of a hoop and |dOP/du| at beads that are equally far from one another along it."""

    title: str
    component: type[CircularHoop | EllipticHoop]
    coordinate: str
    u: NDArray
    position: NDArray  # complex
    speed: NDArray
    length: float
    area: float

    @property
    def shift(self) -> float:
        return -2 * TURN * self.area / self.length

    @cached_property
    def xi(self) -> NDArray:
        return self.length * np.arange(BEADS) / BEADS

    @cached_property
    def a(self) -> NDArray:
        """r²θ', θ' by differentiating the spectrum of OP(ξ)."""
        return np.imag(np.conj(self.position) * self._spectral(self.position, 1))

    @cached_property
    def r_squared(self) -> NDArray:
        return np.abs(self.position) ** 2

    def remainder(self, duration: float) -> float:
        """Of the average after an abrupt start, to order 1/T²."""
        end = self.xi + SPEED * duration - TURN * self.a
        at_end = np.interp(end, self.xi, np.real(self._spectral(self.r_squared, -1)), period=self.length)
        covariance = np.mean(self.a * self.r_squared) - np.mean(self.a) * np.mean(self.r_squared)
        return float(TURN**2 / (2 * SPEED**2 * duration**2) * (np.mean(at_end) - TURN * covariance))

    def shifts(self, start: str, duration: float) -> NDArray:
        """Of every bead, by the way the hoop is started."""
        rate = TURN / duration
        relative = SPEED - (rate * self.a if start == "abrupt" else 0.0)
        values = {f"{self.coordinate}_0": self.u, f"{self.coordinate}_dot_0": relative / self.speed}
        smooth = {"beta.end_value": TURN, "beta.duration": duration}
        found = ensemble(
            self.component,
            values | (smooth if start == "smooth" else {"beta.rate": rate}),
            stop_time=duration,
            step_size=STEP,
            operators={"beta": SmoothStep if start == "smooth" else Ramp},
            record=["xi"],
            estimate=False,
        )
        return found["xi"][-1] - found["xi"][0] - SPEED * duration

    def _spectral(self, values: NDArray, order: int) -> NDArray:
        """Derivative (1) or periodic primitive of the part without mean (-1) over the arc length."""
        wave = 2j * np.pi * np.fft.fftfreq(BEADS, self.length / BEADS)
        wave[0] = np.inf if order < 0 else 0.0
        return np.fft.ifft(np.fft.fft(values) * wave**order)


def circle() -> Hoop:
    u = TURN * np.arange(BEADS) / BEADS  # radius 1, centre at 0.5
    return Hoop("circle", CircularHoop, "xi", u, 0.5 + np.exp(1j * u), np.ones(BEADS), TURN, np.pi)


def ellipse() -> Hoop:
    u = TURN * np.arange(BEADS) / BEADS  # semi-axes 2 and 1
    length = float(ellipeinc(TURN, -3))
    for _ in range(8):  # Newton: the arc length up to u is E(u | -3)
        u = u - (ellipeinc(u, -3) - length * np.arange(BEADS) / BEADS) / np.sqrt(1 + 3 * np.sin(u) ** 2)
    speed = np.sqrt(1 + 3 * np.sin(u) ** 2)
    return Hoop("ellipse", EllipticHoop, "u", u, 2 * np.cos(u) + 1j * np.sin(u), speed, length, TURN)


def main(figure: Path) -> list[Verdict]:
    hoops = circle(), ellipse()
    shifts = {
        (hoop.title, start): np.array([hoop.shifts(start, duration) for duration in TIMES])
        for hoop in hoops
        for start in ("smooth", "abrupt", "relative")
    }
    draw(figure, hoops, shifts)
    return [
        item
        for hoop in hoops
        for item in judge(hoop, *(shifts[hoop.title, s] for s in ("smooth", "abrupt", "relative")))
    ]


def judge(hoop: Hoop, smooth: NDArray, abrupt: NDArray, relative: NDArray) -> list[Verdict]:
    slowest = TIMES[-1]
    remainder = hoop.remainder(slowest)
    return [
        verdict(
            f"{hoop.title}, abrupt start: the mean of {BEADS} shifts is -4πA/ℓ = {hoop.shift:.4f} m",
            error=abs(abrupt[-1].mean() - hoop.shift - remainder),
            tolerance=(TURN / (SPEED * slowest)) ** 3 * 40,
            unit="m",
            reason="but for the predicted remainder; then (2π/vT)³ times r⁴ and its derivatives, some tens of m⁴",
        ),
        verdict(
            f"{hoop.title}, abrupt start: a bead is shifted by -2πa(ξ_0)",
            error=max_error(abrupt[-1], -TURN * hoop.a),
            tolerance=1.2 * TURN**2 * float(np.ptp(hoop.r_squared)) / (2 * SPEED * slowest),
            unit="m",
            reason="(2π)² (<r²> - r²)/(2vT), the next order in the rate",
        ),
        verdict(
            f"{hoop.title}, smooth start: the mean differs from -4πA/ℓ by 1/T³",
            error=abs(slope(TIMES[1:], np.abs(smooth[1:].mean(axis=1) - hoop.shift)) + 3),
            tolerance=0.25,
            reason="exponent; the factor (v - <a>β')⁻³ makes it up to 6π<a>/vT steeper",
        ),
        verdict(
            f"{hoop.title}, speed on the turning hoop prescribed: no shift on average",
            error=abs(relative[-1].mean()),
            tolerance=TURN**2 * float(np.ptp(hoop.r_squared)) * hoop.length / (SPEED * slowest) ** 2,
            unit="m",
            reason="order 1/T; its mean over the beads is 0, what remains is of order 1/T²",
        ),
    ]


def draw(figure: Path, hoops: tuple[Hoop, ...], shifts: dict[tuple[str, str], NDArray]) -> None:
    _, (beads, means) = plt.subplots(1, 2, figsize=(11, 4.4), layout="constrained")
    for hoop, colour in zip(hoops, ("tab:blue", "tab:orange"), strict=True):
        for start, style in (("smooth", "-"), ("abrupt", "--"), ("relative", ":")):
            found = shifts[hoop.title, start]
            beads.plot(hoop.xi / hoop.length, found[-1], style, color=colour, label=f"{hoop.title}, {start}")
            limit = 0.0 if start == "relative" else hoop.shift
            means.loglog(TIMES, np.abs(found.mean(axis=1) - limit), f"o{style}", color=colour)
        beads.axhline(hoop.shift, color=colour, linewidth=0.5)
    beads.set(xlabel="ξ$_0$/ℓ", ylabel="shift [m]", title=f"shift after one turn in {TIMES[-1]:g} s")
    beads.legend(fontsize="small")
    means.set(xlabel="T [s]", ylabel="|mean - limit| [m]", title="mean over the beads; limits -4πA/ℓ and 0")
    plt.savefig(figure, dpi=150)


if __name__ == "__main__":
    raise SystemExit(run_scenario(main))
