"""A hoop that slowly turns once leaves its bead behind by 4π area/length, at any speed of the bead: Hannay-Berry.

M 8.4, eq. 64.  A SmoothStep turns three hoops by 2π in the time T: a circle about a point off its centre, an ellipse
and a Fourier hoop.  The bead runs at 1 m/s before and after.  Averaging eq. 64 to fourth order gives the error of the
shift.  It is of order 1/T³, and one of its terms depends on the position ξ_0 of the bead at the start, because
SmoothStep is only C³ and its fourth derivative jumps there.

The smooth start is essential.  If the rate itself jumps, p_ξ is continuous and the shift is -2πa(ξ_0).  If instead the
speed of the bead along the turning hoop is prescribed, there is no shift at all.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from liaisons import Result, operator, simulate
from liaisons.models import CircularHoop, EllipticHoop, FourierHoop
from liaisons.scenarios import Claims, panels, scenario, within

TURN = 2 * np.pi
TIMES, SLOW = np.array([200.0, 400.0, 800.0]), 1600.0  # of the smooth turns and of the abrupt one [s]
GRID = np.linspace(0, TURN, 4096, endpoint=False)
STARTS = GRID[150::512]
BENT = {"radius": 1.2, "cos_1": 0.25, "sin_2": 0.15, "cos_3": -0.1}
HOOPS: Any = {"CircularHoop": ("xi", {"offset": 0.5}), "EllipticHoop": ("u", {}), "FourierHoop": ("theta", BENT)}
TURNS = {
    "CircularHoop": CircularHoop.slow_turn(offset=0.5),
    "EllipticHoop": EllipticHoop.slow_turn(),
    "FourierHoop": FourierHoop.slow_turn(**BENT),
}


def run(hoop: str, u: float, stop_time: float, step_size: float, beta: Any) -> Result:
    """A bead that starts at u with 1 m/s."""
    coordinate, body = HOOPS[hoop]
    start = {f"{coordinate}_0": u, f"{coordinate}_dot_0": 1 / TURNS[hoop].speed(u), "beta": beta, **body}
    record = ["xi", coordinate]
    return simulate(hoop, stop_time=stop_time, step_size=step_size, tolerance=1e-13, record=record, **start)


def smooth(hoop: str, T: float) -> NDArray:
    """How much further along the hoop beads are than at their own speed, after one smooth turn."""
    step = operator("SmoothStep", end_value=TURN, duration=T)
    return np.array([np.diff(run(hoop, u, T, T / 400, step)["xi"][[0, -1]])[0] - T for u in STARTS])


@scenario
def main(claim: Claims) -> None:
    shapes, approach = panels(
        ("shift in one slow turn about +", "x [m]", "y [m]"),
        ("the remainder is of order 1/T³ (lines: predicted)", "start u", "T³ (shift + 4πA/ℓ) [m s³]"),
        width_ratios=[2, 3],
    )
    order = within(0.25, because="the factor (v - <a>β')⁻³ changes the exponent by 6 · 2π<a>/vT, 0.2 at T = 200 s")
    relative = within(0.03, because="relative error of the next order in 1/T, about 2π<a>/vT = 0.01")
    T = TIMES[-1]
    for (hoop, turn), colour in zip(TURNS.items(), ("tab:blue", "tab:orange", "tab:green"), strict=True):
        remainders = np.array([smooth(hoop, duration) for duration in TIMES]) - turn.shift
        predicted = turn.smooth_remainder(T, STARTS)
        size = np.max(np.abs(predicted))
        tenth = within(1.1 * size, "m", because="the predicted remainder of order 1/T³, and 10 % for the next order")
        claim(f"{hoop}: ξ is shifted by -4πA/ℓ = {turn.shift:.4f} m (T = {T:g} s)", remainders[-1], 0.0, tenth)
        text = f"{hoop}: the remainder is the predicted one, at {STARTS.size} starts"
        claim(text, remainders[-1] / size, predicted / size, relative)
        claim.order(f"{hoop}: the remainder falls as 1/T³", TIMES, np.abs(remainders.mean(axis=1)), -3, order)
        curve = turn.curve(GRID)
        shapes.plot(np.real(curve), np.imag(curve), color=colour, label=f"{hoop}: {turn.shift:.3f} m")
        approach.plot(GRID, T**3 * turn.smooth_remainder(T, GRID), color=colour, linewidth=0.8)
        for duration, found, marker in zip(TIMES, remainders, "v^o", strict=True):
            label = f"FMU, T = {duration:g} s" if colour == "tab:blue" else None
            approach.plot(STARTS, duration**3 * found, marker, color=colour, markersize=4, label=label)
    shapes.plot(0, 0, "k+")
    shapes.set(aspect="equal")

    ellipse, rate = TURNS["EllipticHoop"], TURN / SLOW
    why = "(2π)² (<r²> - r²)/(2vT), the next term, and a tenth of it for the term after that"
    second = within(1.1 * ellipse.abrupt_bound(SLOW), "m", because=why)
    ramps = {begin: operator("Ramp", rate=rate, start_time=float(begin)) for begin in (0, 1)}
    given, jumping = ([run("EllipticHoop", u, SLOW + b, 1.0, ramp) for u in STARTS] for b, ramp in ramps.items())
    jumped = [bead["xi"][-1] - bead["xi"][1] - SLOW for bead in jumping]
    expected = -TURN * ellipse.lever_arm([bead["u"][1] for bead in jumping])
    claim(f"ellipse, abrupt turn: the shift is -2πa(ξ_0) (T = {SLOW:g} s)", jumped, expected, second)
    kept = [bead["xi"][-1] - bead["xi"][0] - SLOW for bead in given]
    claim(f"ellipse, speed given: no shift (T = {SLOW:g} s)", kept, 0.0, second)
