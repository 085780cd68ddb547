"""A hoop that is slowly turned once round leaves its bead behind by 4π area/length, however the bead ran: Hannay-Berry.

M 8.4, eq. 64.  A SmoothStep turns three hoops, a circle about a point off its centre, an ellipse and a Fourier hoop, by
2π in the time T; the bead runs at speed v before and after.  Averaging eq. 64 to fourth order gives the approach:

    shift = -4πA/ℓ - ∫ (Var(r²)/4 β'⁴ + <G²> β"²)/(v - <a>β')³ dt + T β⁗(0) G_2(ξ_0)/v³ + O(1/T⁴)

with dG/dξ = a - <a>, d²G_2/dξ² = G, all of mean zero; each term is of order 1/T³.  The last one depends on the place
ξ_0 of the bead at the start, where SmoothStep, which is C³, jumps in its fourth derivative.

The smooth start is essential.  If the rate itself jumps, p_ξ is continuous and the shift is -2πa(ξ_0); if the bead's
speed along the turning hoop is what is prescribed, there is none at all.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
from numpy.typing import NDArray
from scipy.integrate import quad

from liaisons import System, Verdict, fmu_path, run_scenario, slope, verdict

TURN = 2 * np.pi
SPEED = 1.0  # of the bead before and after [m/s]
TIMES = (200.0, 400.0, 800.0)  # of the turn [s]
PHASES = 8
SLOW = 1600.0  # time of the abrupt turn [s]
GRID = np.linspace(0, TURN, 4096, endpoint=False)
HARMONIC = np.fft.fftfreq(GRID.size, 1 / GRID.size)


@dataclass(frozen=True)
class Hoop:
    """A hoop as an FMU, and the same curve as complex numbers OP(u) on a grid of u."""

    title: str
    fmu: str
    coordinate: str
    parameters: dict[str, float]
    curve: Callable[[NDArray], NDArray]

    @cached_property
    def position(self) -> NDArray:
        return self.curve(GRID)

    @cached_property
    def tangent(self) -> NDArray:
        """dOP/du, spectrally."""
        return np.fft.ifft(1j * HARMONIC * np.fft.fft(self.position))

    @cached_property
    def length(self) -> float:
        return float(TURN * np.mean(np.abs(self.tangent)))

    @cached_property
    def moment(self) -> NDArray:
        """a = r² dθ/dξ = OP × unit tangent."""
        return np.imag(np.conj(self.position) * self.tangent) / np.abs(self.tangent)

    @property
    def shift(self) -> float:
        """-4πA/ℓ."""
        return -TURN * self.mean(self.moment)

    def mean(self, values: NDArray) -> float:
        """Mean over the arc length."""
        return float(np.average(values, weights=np.abs(self.tangent)))

    def primitive(self, values: NDArray) -> NDArray:
        """∫ (values - <values>) dξ with mean zero, spectrally."""
        rate = np.fft.fft((values - self.mean(values)) * np.abs(self.tangent))
        G = np.real(np.fft.ifft(np.divide(rate, 1j * HARMONIC, where=HARMONIC != 0, out=np.zeros_like(rate))))
        return G - self.mean(G)

    def remainder(self, duration: float) -> NDArray:
        """What the shift lacks at a finite duration of the turn, for a bead that starts at each place of the grid."""
        G, r_squared = self.primitive(self.moment), np.abs(self.position) ** 2
        G_2 = self.primitive(self.primitive(G))
        variance, square = self.mean(r_squared**2) - self.mean(r_squared) ** 2, self.mean(G**2)

        def rate(u: float) -> float:
            beta_dot = TURN / duration * 140 * (u * (1 - u)) ** 3
            beta_ddot = TURN / duration**2 * 420 * (u * (1 - u)) ** 2 * (1 - 2 * u)
            drift = SPEED - self.mean(self.moment) * beta_dot
            return -(variance / 4 * beta_dot**4 + square * beta_ddot**2) / drift**3

        jump = TURN * 840 / duration**4  # of the fourth derivative of β
        return quad(rate, 0, 1, epsabs=0)[0] * duration + jump * duration * G_2 / SPEED**3

    @cached_property
    def phase(self) -> NDArray:
        """Arc length from A over the length."""
        return np.cumsum(np.abs(self.tangent)) / np.sum(np.abs(self.tangent))

    def starts(self) -> NDArray:
        """Places of the grid that are equally far from one another along the hoop."""
        return np.searchsorted(self.phase, (np.arange(PHASES) + 0.3) / PHASES)

    def run(self, start: int, stop_time: float, step_size: float, operator: str, **values: float) -> NDArray:
        """Arc length of a bead that starts at a place of the grid with the given speed."""
        u, rate = GRID[start], SPEED / abs(self.tangent[start])
        motion: dict[str, Any] = {f"{self.coordinate}_0": u, f"{self.coordinate}_dot_0": rate, **self.parameters}
        reconstruction = 2 if operator == "SmoothStep" else 1
        system = System(self.title)
        hoop = system.add("hoop", fmu_path(self.fmu), input_reconstruction=reconstruction, **motion)
        motor = system.add("operator", fmu_path(operator), **values)
        system.connect(motor["y"], hoop["beta"])
        return system.simulate(stop_time, step_size, tolerance=1e-13, record=["hoop.xi"])["hoop.xi"]


def fourier(theta: NDArray) -> NDArray:
    r = 1.2 * (1 + 0.25 * np.cos(theta) + 0.15 * np.sin(2 * theta) - 0.1 * np.cos(3 * theta))
    return r * np.exp(1j * theta)


CIRCLE = Hoop("circle", "CircularHoop", "xi", {"offset": 0.5}, lambda u: 0.5 + np.exp(1j * u))
ELLIPSE = Hoop("ellipse", "EllipticHoop", "u", {}, lambda u: 2 * np.cos(u) + 1j * np.sin(u))
BENT = {"radius": 1.2, "cos_1": 0.25, "sin_2": 0.15, "cos_3": -0.1}
HOOPS = (CIRCLE, ELLIPSE, Hoop("Fourier hoop", "FourierHoop", "theta", BENT, fourier))


def main(figure: Path) -> list[Verdict]:
    remainders = {hoop.title: np.array([smooth_remainders(hoop, T) for T in TIMES]) for hoop in HOOPS}
    abrupt, prescribed = abrupt_shifts(ELLIPSE)
    verdicts = [item for hoop in HOOPS for item in judge(hoop, remainders[hoop.title])]
    verdicts += judge_abrupt(ELLIPSE, abrupt, prescribed)
    draw(figure, remainders, abrupt, prescribed)
    return verdicts


def smooth_remainders(hoop: Hoop, duration: float) -> NDArray:
    """Shift + 4πA/ℓ for each initial phase, after one smooth turn."""
    shifts = []
    for start in hoop.starts():
        xi = hoop.run(start, duration, duration / 400, "SmoothStep", end_value=TURN, duration=duration)
        shifts.append(xi[-1] - xi[0] - SPEED * duration)
    return np.array(shifts) - hoop.shift


def abrupt_shifts(hoop: Hoop) -> tuple[NDArray, NDArray]:
    """(phase, shift) for a rate that jumps after one second, and for a speed that is prescribed on the turning hoop."""
    jump, prescribed = [], []
    for start in hoop.starts():
        xi = hoop.run(start, SLOW + 1, 1.0, "Ramp", rate=TURN / SLOW, start_time=1.0)
        jump.append((xi[1] / hoop.length % 1, xi[-1] - xi[1] - SPEED * SLOW))
        xi = hoop.run(start, SLOW, 1.0, "Ramp", rate=TURN / SLOW)
        prescribed.append((hoop.phase[start], xi[-1] - xi[0] - SPEED * SLOW))
    return np.array(jump), np.array(prescribed)


def judge(hoop: Hoop, remainders: NDArray) -> list[Verdict]:
    slowest, predicted = TIMES[-1], hoop.remainder(TIMES[-1])[hoop.starts()]
    size = float(np.max(np.abs(predicted)))
    return [
        verdict(
            f"{hoop.title}: ξ is shifted by -4πA/ℓ = {hoop.shift:.4f} m (T = {slowest:g} s)",
            error=float(np.max(np.abs(remainders[-1]))),
            tolerance=1.1 * size,
            unit="m",
            reason="the predicted remainder of order 1/T³, and a tenth for the next order",
        ),
        verdict(
            f"{hoop.title}: the remainder is the predicted one, at {PHASES} phases (T = {slowest:g} s)",
            error=float(np.max(np.abs(remainders[-1] - predicted))) / size,
            tolerance=0.03,
            reason="relative error of the next order in 1/T: some 2π<a>/vT = 0.01",
        ),
        verdict(
            f"{hoop.title}: the remainder falls as 1/T³",
            error=abs(slope(TIMES, np.abs(remainders.mean(axis=1))) + 3),
            tolerance=0.25,
            reason="(v - <a>β')⁻³ makes up for 3 · 2 · 2π<a>/vT, 0.2 at T = 200 s",
        ),
    ]


def judge_abrupt(hoop: Hoop, jump: NDArray, prescribed: NDArray) -> list[Verdict]:
    r_squared = np.abs(hoop.position) ** 2
    second_order = TURN**2 * float(np.max(np.abs(r_squared - hoop.mean(r_squared)))) / (2 * SPEED * SLOW)
    reason = "(2π)² (<r²> - r²)/(2vT), the next order in the rate, and a tenth of it for the one after that"
    return [
        verdict(
            f"{hoop.title}, abrupt turn: the shift is -2πa(ξ_0) (T = {SLOW:g} s)",
            error=float(np.max(np.abs(jump[:, 1] + TURN * np.interp(jump[:, 0], hoop.phase, hoop.moment)))),
            tolerance=1.1 * second_order,
            unit="m",
            reason=reason,
        ),
        verdict(
            f"{hoop.title}, speed prescribed on the turning hoop: no shift (T = {SLOW:g} s)",
            error=float(np.max(np.abs(prescribed[:, 1]))),
            tolerance=1.1 * second_order,
            unit="m",
            reason=reason,
        ),
    ]


def draw(figure: Path, remainders: dict[str, NDArray], jump: NDArray, prescribed: NDArray) -> None:
    _, (shapes, approach, starts) = plt.subplots(1, 3, figsize=(14, 4.4), layout="constrained")
    markers = dict(zip(TIMES, "v^o", strict=True))
    for hoop, color in zip(HOOPS, ("tab:blue", "tab:orange", "tab:green"), strict=True):
        x, y = np.real(hoop.position), np.imag(hoop.position)
        shapes.plot(x, y, color=color, label=f"{hoop.title}: {hoop.shift:.3f} m")
        slowest = TIMES[-1]
        approach.plot(hoop.phase, slowest**3 * hoop.remainder(slowest), color=color, linewidth=0.8)
        for T, remainder in zip(TIMES, remainders[hoop.title], strict=True):
            approach.plot(hoop.phase[hoop.starts()], T**3 * remainder, markers[T], color=color, markersize=4)
    shapes.plot(0, 0, "k+")
    shapes.annotate("O", (0, 0), xytext=(4, 4), textcoords="offset points")
    shapes.set(aspect="equal", xlabel="x [m]", ylabel="y [m]", title="shift -4πA/ℓ in one slow turn", ylim=(-1.7, 2.7))
    shapes.legend(loc="upper center")
    for T, marker in markers.items():
        approach.plot([], [], marker, color="tab:gray", markersize=4, label=f"FMU, T = {T:g} s")
    approach.plot([], [], color="tab:gray", linewidth=0.8, label=f"predicted, T = {TIMES[-1]:g} s")
    approach.set(
        xlabel="ξ$_0$/ℓ", ylabel="T³ (shift + 4πA/ℓ) [m s³]", title="smooth start: the remainder is of order 1/T³"
    )
    approach.legend()
    starts.plot(ELLIPSE.phase, -TURN * ELLIPSE.moment, color="tab:red", linewidth=0.8)
    starts.plot(*jump.T, "s", color="tab:red", label="the rate jumps: -2πa(ξ$_0$)")
    starts.axhline(ELLIPSE.shift, color="tab:orange", linewidth=0.8)
    smooth = ELLIPSE.shift + remainders[ELLIPSE.title][-1]
    starts.plot(ELLIPSE.phase[ELLIPSE.starts()], smooth, "o", color="tab:orange", label="smooth start: -4πA/ℓ")
    starts.axhline(0, color="tab:gray", linewidth=0.8)
    starts.plot(*prescribed.T, "^", color="tab:gray", label="speed on the turning hoop prescribed: 0")
    starts.set(xlabel="ξ$_0$/ℓ", ylabel="shift [m]", title="the ellipse, by the way it is started", ylim=(-14, 5))
    starts.legend(loc="upper right")
    plt.savefig(figure, dpi=150)


if __name__ == "__main__":
    raise SystemExit(run_scenario(main))
