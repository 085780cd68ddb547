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

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.integrate import quad

from liaisons import Result, System, Verdict, fmu_path, run_scenario, slope, verdict

TURN = 2 * np.pi
SPEED = 1.0  # of the bead before and after [m/s]
TIMES = np.array([200.0, 400.0, 800.0])  # of the turn [s]
SLOW = 1600.0  # of the abrupt turn [s]
GRID = np.linspace(0, TURN, 4096, endpoint=False)
HARMONIC = np.fft.fftfreq(GRID.size, 1 / GRID.size)
STARTS = np.arange(150, GRID.size, 512)  # places of the grid


@dataclass(frozen=True)
class Hoop:
    """A hoop as an FMU, and its curve as a sum of waves, OP = Σ c_k e^(iku)."""

    fmu: str
    coordinate: str
    parameters: dict[str, float]
    waves: dict[int, complex]

    def curve(self, u: ArrayLike, order: int = 0) -> NDArray:
        """OP, or its derivatives by u."""
        return np.sum([(1j * k) ** order * c * np.exp(1j * k * np.asarray(u)) for k, c in self.waves.items()], axis=0)

    def speed(self, u: ArrayLike) -> NDArray:
        """dξ/du."""
        return np.abs(self.curve(u, 1))

    def a(self, u: ArrayLike) -> NDArray:
        """r² dθ/dξ = OP × unit tangent."""
        return np.imag(np.conj(self.curve(u)) * self.curve(u, 1)) / self.speed(u)

    def mean(self, values: NDArray) -> float:
        """Mean over the arc length of values on the grid."""
        return float(np.average(values, weights=self.speed(GRID)))

    def primitive(self, values: NDArray) -> NDArray:
        """∫ (values - <values>) dξ with mean zero, spectrally."""
        rate = np.fft.fft((values - self.mean(values)) * self.speed(GRID))
        G = np.real(np.fft.ifft(np.divide(rate, 1j * HARMONIC, where=HARMONIC != 0, out=np.zeros_like(rate))))
        return G - self.mean(G)

    @property
    def shift(self) -> float:
        """-4πA/ℓ."""
        return -TURN * self.mean(self.a(GRID))

    def remainder(self, duration: float) -> NDArray:
        """What the shift lacks at a finite duration of the turn, for a bead that starts at each place of the grid."""
        a, r_squared = self.a(GRID), np.abs(self.curve(GRID)) ** 2
        G = self.primitive(a)
        variance, square = self.mean(r_squared**2) - self.mean(r_squared) ** 2, self.mean(G**2)

        def rate(x: float) -> float:
            beta_dot = TURN / duration * 140 * (x * (1 - x)) ** 3
            beta_ddot = TURN / duration**2 * 420 * (x * (1 - x)) ** 2 * (1 - 2 * x)
            return -(variance / 4 * beta_dot**4 + square * beta_ddot**2) / (SPEED - self.mean(a) * beta_dot) ** 3

        jump = TURN * 840 / duration**4  # of the fourth derivative of β
        G_2 = self.primitive(self.primitive(G))
        return quad(rate, 0, 1, epsabs=0)[0] * duration + jump * duration * G_2 / SPEED**3

    def run(self, u: float, stop_time: float, step_size: float, operator: str, **values: float) -> Result:
        """A bead that starts at u with the given speed."""
        start: dict[str, Any] = {f"{self.coordinate}_0": u, f"{self.coordinate}_dot_0": SPEED / float(self.speed(u))}
        system = System(self.fmu)
        reconstruction: dict[str, Any] = {"input_reconstruction": 2 if operator == "SmoothStep" else 1}
        hoop = system.add("hoop", fmu_path(self.fmu), **reconstruction, **start, **self.parameters)
        system.connect(system.add("operator", fmu_path(operator), **values)["y"], hoop["beta"])
        signals = ["hoop.xi", f"hoop.{self.coordinate}"]
        return system.simulate(stop_time, step_size, tolerance=1e-13, record=signals)


BENT = {"radius": 1.2, "cos_1": 0.25, "sin_2": 0.15, "cos_3": -0.1}
RADIUS = {0: 1.0, 1: 0.125, -1: 0.125, 2: -0.075j, -2: 0.075j, 3: -0.05, -3: -0.05}  # its waves, over 1.2 m
ELLIPSE = Hoop("EllipticHoop", "u", {}, {1: 1.5, -1: 0.5})
HOOPS = (
    Hoop("CircularHoop", "xi", {"offset": 0.5}, {0: 0.5, 1: 1.0}),
    ELLIPSE,
    Hoop("FourierHoop", "theta", BENT, {k + 1: 1.2 * c for k, c in RADIUS.items()}),
)


def lag(result: Result, begin: int, duration: float) -> float:
    """How much further along the hoop the bead is at the end than at its own speed."""
    return float(result["hoop.xi"][-1] - result["hoop.xi"][begin] - SPEED * duration)


def smooth(hoop: Hoop, duration: float) -> NDArray:
    """Shift for each start after one smooth turn."""
    step = {"end_value": TURN, "duration": duration}
    return np.array(
        [lag(hoop.run(u, duration, duration / 400, "SmoothStep", **step), 0, duration) for u in GRID[STARTS]]
    )


def abrupt(hoop: Hoop) -> tuple[NDArray, NDArray]:
    """(u where the rate jumps, shift) for each start, and the shift where the speed on the turning hoop is given."""
    jumping = [hoop.run(u, SLOW + 1, 1.0, "Ramp", rate=TURN / SLOW, start_time=1.0) for u in GRID[STARTS]]
    given = [hoop.run(u, SLOW, 1.0, "Ramp", rate=TURN / SLOW) for u in GRID[STARTS]]
    jumps = np.array([(run[f"hoop.{hoop.coordinate}"][1], lag(run, 1, SLOW)) for run in jumping])
    return jumps.T, np.array([lag(run, 0, SLOW) for run in given])


def main(figure: Path) -> list[Verdict]:
    verdicts, found = [], {}
    for hoop in HOOPS:
        found[hoop.fmu] = remainders = np.array([smooth(hoop, T) for T in TIMES]) - hoop.shift
        predicted = hoop.remainder(TIMES[-1])[STARTS]
        size, off = np.max(np.abs(predicted)), np.max(np.abs(remainders[-1] - predicted))
        verdicts += [
            verdict(
                f"{hoop.fmu}: ξ is shifted by -4πA/ℓ = {hoop.shift:.4f} m (T = {TIMES[-1]:g} s)",
                error=float(np.max(np.abs(remainders[-1]))),
                tolerance=1.1 * float(size),
                unit="m",
                reason="the predicted remainder of order 1/T³, and a tenth for the next order",
            ),
            verdict(
                f"{hoop.fmu}: the remainder is the predicted one, at {STARTS.size} starts",
                error=float(off / size),
                tolerance=0.03,
                reason="relative error of the next order in 1/T: some 2π<a>/vT = 0.01",
            ),
            verdict(
                f"{hoop.fmu}: the remainder falls as 1/T³",
                error=abs(slope(TIMES, np.abs(remainders.mean(axis=1))) + 3),
                tolerance=0.25,
                reason="(v - <a>β')⁻³ makes up for 3 · 2 · 2π<a>/vT, 0.2 at T = 200 s",
            ),
        ]
    (u, jumped), given = abrupt(ELLIPSE)
    r_squared = np.abs(ELLIPSE.curve(GRID)) ** 2
    claims = {"abrupt turn: the shift is -2πa(ξ_0)": jumped + TURN * ELLIPSE.a(u), "speed given: no shift": given}
    for claim, errors in claims.items():
        second_order = TURN**2 * np.max(np.abs(r_squared - ELLIPSE.mean(r_squared))) / (2 * SPEED * SLOW)
        verdicts.append(
            verdict(
                f"ellipse, {claim} (T = {SLOW:g} s)",
                error=float(np.max(np.abs(errors))),
                tolerance=1.1 * float(second_order),
                unit="m",
                reason="(2π)² (<r²> - r²)/(2vT), the next order in the rate, and a tenth for the one after that",
            )
        )
    draw(figure, found)
    return verdicts


def draw(figure: Path, found: dict[str, NDArray]) -> None:
    _, (shapes, approach) = plt.subplots(1, 2, figsize=(11, 4.4), layout="constrained", width_ratios=[2, 3])
    for hoop, colour in zip(HOOPS, ("tab:blue", "tab:orange", "tab:green"), strict=True):
        points = hoop.curve(GRID)
        shapes.plot(np.real(points), np.imag(points), color=colour, label=f"{hoop.fmu}: {hoop.shift:.3f} m")
        approach.plot(GRID, TIMES[-1] ** 3 * hoop.remainder(TIMES[-1]), color=colour, linewidth=0.8)
        for T, remainder, marker in zip(TIMES, found[hoop.fmu], "v^o", strict=True):
            approach.plot(GRID[STARTS], T**3 * remainder, marker, color=colour, markersize=4)
    for T, marker in zip(TIMES, "v^o", strict=True):
        approach.plot([], [], marker, color="tab:gray", markersize=4, label=f"FMU, T = {T:g} s")
    approach.plot([], [], color="tab:gray", linewidth=0.8, label=f"predicted, T = {TIMES[-1]:g} s")
    approach.set(xlabel="start u", ylabel="T³ (shift + 4πA/ℓ) [m s³]", title="the remainder is of order 1/T³")
    shapes.plot(0, 0, "k+")
    shapes.set(aspect="equal", xlabel="x [m]", ylabel="y [m]", ylim=(-1.7, 2.7), title="shift in one slow turn about +")
    shapes.legend(loc="upper center")
    approach.legend()
    plt.savefig(figure, dpi=150)


if __name__ == "__main__":
    raise SystemExit(run_scenario(main))
