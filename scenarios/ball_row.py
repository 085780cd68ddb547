"""A ball strikes two others: if they touch, both move on together; with a tiny gap, only the last one moves on.

Moreau's rule, v⁺ >= max(0, -e v) with impulses that are not negative, treats the two balls that touch as one body.  A
gap between them, however small, leads to a sequence of impacts, which for equal masses and e = 1 is Newton's cradle.
Both outcomes conserve momentum.  Which of them is right depends on the elasticity of the balls, and rigid bodies have
none.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from liaisons import simulate
from liaisons.models import BallRow
from liaisons.scenarios import Claims, dots, panels, scenario, within

SETTINGS: Any = {"stop_time": 3.0, "step_size": 0.011, "tolerance": 1e-12}
RECORD, HAIR = ("x", "x_dot", "impact_loss", "energy_balance"), 1e-6
ROWS: dict[str, dict[str, Any]] = {
    "equal masses": {},
    "masses 1, 2, 3 kg": {"mass": [1.0, 2.0, 3.0]},
    "equal masses, e = 0.5": {"bounce": 0.5},
}


@scenario
def main(claim: Claims) -> None:
    axes = panels(*((name, "t [s]", "velocity [m/s]") for name in ROWS))
    exact = within(1e-10, "m, m/s", because="uniform motion is integrated exactly up to rounding")
    joules = within(1e-10, "J", because="rounding errors")
    for axis, (name, row) in zip(axes, ROWS.items(), strict=True):
        touching = simulate("BallRow", record=RECORD, start_values=row, **SETTINGS)
        expected = BallRow.exact(touching.time, **row)
        claim(f"{name}, in contact: Moreau's rule", touching, expected, exact)
        apart = simulate("BallRow", record=RECORD, start_values=row | {"x_0": [0.0, 1.0, 1.1 + HAIR]}, **SETTINGS)
        sequence = BallRow.sequence(**row)
        impacts = f"{len(sequence) - 1} impacts one after the other"
        claim(f"{name}, apart: {impacts}", apart["x_dot"][-1], sequence[-1], exact)
        masses = row.get("mass", np.ones(3))
        for run in (touching, apart):
            momentum = run["x_dot"] @ masses
            claim(f"{name}: momentum", momentum, masses[0], within(1e-10, "kg.m/s", because="rounding errors"))
            claim(f"{name}: energy balance", run["energy_balance"], 0.0, joules)
        for i in range(3):
            axis.plot(touching.time, touching["x_dot"][:, i], color=f"C{i}", label=f"ball {i + 1}, touching")
            axis.plot(apart.time, apart["x_dot"][:, i], "--", color=f"C{i}", label=f"ball {i + 1}, apart")
        dots(axis, touching.time, expected["x_dot"][:, 0], label="Moreau's rule")
