"""A ball bounces once per period of a shaken table, until its period doubles at the acceleration that theory predicts.

With Γ = Aω²/g, bouncing in step exists from Γ = π (1 - e)/(1 + e) on and is stable up to Γ² = (π (1 - e)/(1 + e))² + (2
(1 + e²)/(1 + e)²)².  A sweep of FMUs shows the heights after 200 periods, at the instants at which a ball in step is at
its highest: first one height, then two, then many.  The same heights follow from a map of the impacts, each of which is
the root of a flight.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

from liaisons import System, operator, sweep
from liaisons.models import BouncingBall
from liaisons.scenarios import Claims, panels, scenario, within

BOUNCE, GRAVITY, PERIODS, STEPS, SEEN, NEAR = 0.2, 1.0, 200, 200, 8, 1e-3  # ω = 1 rad/s
RATIOS = np.array([2.15, 2.25, 2.35, 2.45, 2.5, 2.58, 2.65, 2.7, 2.75, 2.78])


def heights_of_fmus(phases: NDArray, starts: NDArray) -> NDArray:
    """Heights [m] at the last periods, (cases, SEEN)."""
    system = System("shaken ball")
    table = operator("Sinusoid", angular_frequency=1.0)
    system.add("ball", "BouncingBall", table=table, bounce=BOUNCE, gravity=GRAVITY)
    cases = {"ball_table.amplitude": RATIOS, "ball_table.phase": phases, "ball.height_0": starts}

    def last(i: int) -> object:
        return lambda run: run["ball.height"][-1 - i * STEPS]

    keep = {f"{i}": last(i) for i in range(SEEN)}
    step = 2 * np.pi / STEPS
    options = {"stop_time": STEPS * PERIODS * step, "step_size": step, "tolerance": 1e-11, "record": "ball.height"}
    table = sweep(system, cases, keep, workers=1, **options)
    return np.column_stack([table[name] for name in keep])


def heights_of_map(ratio: float, phase: float, height: float) -> list[float]:
    """The same by impacts alone, one flight after the other."""
    t, z, v, seen = 0.0, height, 0.0, []

    def above(s: Any) -> Any:
        return z + v * (s - t) - GRAVITY / 2 * (s - t) ** 2 - ratio * np.sin(s + phase)

    while t < 2 * np.pi * PERIODS:
        grid = t + np.linspace(1e-9, 15, 6001)
        first = int(np.argmax(above(grid) < 0))
        end: Any = brentq(above, grid[first - 1], grid[first], xtol=1e-15) if first else grid[0]
        instants = 2 * np.pi * np.arange(np.ceil(t / (2 * np.pi)), np.floor(end / (2 * np.pi)) + 1)
        seen += [z + v * (s - t) - GRAVITY / 2 * (s - t) ** 2 for s in instants]
        v = (1 + BOUNCE) * ratio * np.cos(end + phase) - BOUNCE * (v - GRAVITY * (end - t))
        t, z = end, ratio * np.sin(end + phase)
    return seen[PERIODS - SEEN + 1 : PERIODS + 1][::-1]


def in_step(ratio: float) -> tuple[float, float]:
    """Phase of the table and height of the ball [m] halfway between two impacts."""
    phase, speed = BouncingBall.period_one(bounce=BOUNCE, gravity=GRAVITY, amplitude=ratio, angular_frequency=1.0)
    return phase + np.pi, ratio * np.sin(phase) + speed**2 / (2 * GRAVITY)


@scenario
def main(claim: Claims) -> None:
    _, limit = BouncingBall.period_one_range(bounce=BOUNCE, gravity=GRAVITY)
    phases, highest = np.transpose([in_step(ratio) for ratio in RATIOS])
    heights = heights_of_fmus(phases, highest + NEAR)
    stable = limit > RATIOS
    settled = within(1e-9, "m", because=f"NEAR times multipliers to the power {PERIODS}, and the solver's tolerance")
    text = f"up to Γ = {limit:.4f} it bounces in step"
    claim(text, heights[stable], np.tile(highest[stable, None], SEEN), settled)
    count = [np.unique(np.round(row, 4)).size for row in heights]
    claim("then at two, four, eight heights", count, [1, 1, 1, 1, 1, 2, 2, 2, 4, 8], within(0.0, because="integers"))
    mapped = [heights_of_map(*case) for case in zip(RATIOS, phases, highest + NEAR, strict=True)]
    claim("the heights are those of a map of the impacts", heights, mapped, settled)

    (axis,) = panels(("heights at the instants of one bounce a period", "Γ", "height [g/ω²]"), size=(8, 5))
    for ratio in np.linspace(2.12, 2.9, 157):
        phase, height = in_step(ratio)
        rows = heights_of_map(ratio, phase, height + NEAR)
        axis.plot(
            np.full(SEEN, ratio), rows, ".", color="tab:blue", markersize=2, label="map" if ratio == 2.12 else None
        )
    axis.plot(RATIOS, heights, "k.", markersize=5)
    axis.axvline(limit, color="tab:gray", linewidth=0.8, label="a multiplier is -1")
