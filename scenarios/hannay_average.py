"""Averaged over its start position, a bead is shifted by -4πA/ℓ when its hoop turns once, however the turn begins.

M 8.4, eq. 64; A and ℓ are area and length of the hoop.  If the turn begins smoothly, every bead is shifted by this
amount, up to a remainder of order 1/T³.  If the rate jumps to 2π/T and p_ξ stays mv, a bead is shifted by -2πa(ξ_0), a
= r²θ', which differs from bead to bead by metres; the average is again -4πA/ℓ.  With Jacobi's integral ξ'² - β'² r²,
and P the periodic primitive of r², its remainder is

    (2π)² / (2 v² T²) · (<P(ξ_0 + vT - 2πa)> - 2π cov(a, r²)) + O(1/T³)

If instead the speed along the turning hoop is prescribed, there is no shift on average.  Here ensembles integrate the
equations of the FMUs; scenario ``hannay_hoop`` runs the FMUs themselves for some beads.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from liaisons import ensemble
from liaisons.models import CircularHoop, EllipticHoop, Ramp, SmoothStep
from liaisons.scenarios import Claims, panels, scenario, within

TURN, BEADS = 2 * np.pi, 128
TIMES = np.array([100.0, 200.0, 400.0, 800.0])
HOOPS: Any = {"circle": (CircularHoop, "xi", {"offset": 0.5}), "ellipse": (EllipticHoop, "u", {})}


def shifts(hoop: str, start: str, duration: float) -> NDArray:
    """Of every bead at 1 m/s, by the way the hoop is started."""
    component, coordinate, body = HOOPS[hoop]
    turn, rate = component.slow_turn(**body), TURN / duration
    u = turn.spread(BEADS)
    relative = 1.0 - (rate * turn.lever_arm(u) if start == "abrupt" else 0.0)
    values = {f"{coordinate}_0": u, f"{coordinate}_dot_0": relative / turn.speed(u), **body}
    smooth = {"beta.end_value": TURN, "beta.duration": duration}
    found = ensemble(
        component,
        values | (smooth if start == "smooth" else {"beta.rate": rate}),
        stop_time=duration,
        step_size=0.05,
        operators={"beta": SmoothStep if start == "smooth" else Ramp},
        record=["xi"],
        estimate=False,
    )
    return found["xi"][-1] - found["xi"][0] - duration


@scenario
def main(claim: Claims) -> None:
    T = TIMES[-1]
    each, mean = panels(
        (f"shift after one turn in {T:g} s", "ξ$_0$/ℓ", "shift [m]"),
        ("mean over the beads; limits -4πA/ℓ and 0", "T [s]", "|mean - limit| [m]"),
    )
    third = "beyond the predicted remainder: (2π/vT)³ times r⁴ and its derivatives, some tens of m⁴"
    steeper = within(0.25, because="error of the exponent: the factor (v - <a>β')⁻³ changes it by up to 6π<a>/vT")
    for (hoop, (component, _, body)), colour in zip(HOOPS.items(), ("tab:blue", "tab:orange"), strict=True):
        turn = component.slow_turn(**body)
        a, r_squared = turn.lever_arm(turn.spread(BEADS)), turn.r_squared(turn.spread(BEADS))
        smooth, abrupt, relative = (
            np.array([shifts(hoop, start, duration) for duration in TIMES])
            for start in ("smooth", "abrupt", "relative")
        )
        cubic = within((TURN / T) ** 3 * 40, "m", because=third)
        text = f"{hoop}, abrupt start: the mean of {BEADS} shifts is -4πA/ℓ = {turn.shift:.4f} m"
        claim(text, abrupt[-1].mean(), turn.shift + turn.abrupt_mean_remainder(T), cubic)
        spread = TURN**2 * np.ptp(r_squared)
        next_order = within(1.2 * spread / (2 * T), "m", because="(2π)² (<r²> - r²)/(2vT), the next term")
        claim(f"{hoop}, abrupt start: a bead is shifted by -2πa(ξ_0)", abrupt[-1], -TURN * a, next_order)
        off = np.abs(smooth[1:].mean(axis=1) - turn.shift)
        claim.order(f"{hoop}, smooth start: the mean differs from -4πA/ℓ by 1/T³", TIMES[1:], off, -3, steeper)
        why = "the term of order 1/T has the mean 0 over the beads; the rest is of order 1/T²"
        text = f"{hoop}, speed on the turning hoop prescribed: no shift on average"
        claim(text, relative[-1].mean(), 0.0, within(spread * turn.length / T**2, "m", because=why))

        for start, found, style in (("smooth", smooth, "-"), ("abrupt", abrupt, "--"), ("relative", relative, ":")):
            each.plot(np.arange(BEADS) / BEADS, found[-1], style, color=colour, label=f"{hoop}, {start}")
            limit = 0.0 if start == "relative" else turn.shift
            mean.loglog(TIMES, np.abs(found.mean(axis=1) - limit), f"o{style}", color=colour)
        each.axhline(turn.shift, color=colour, linewidth=0.5)
