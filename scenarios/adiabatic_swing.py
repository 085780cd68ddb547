"""If the rope of a swing is lengthened slowly, the action is constant, although energy and amplitude change.

M 8.1: a SmoothStep takes the length from 1 m to 2 m within the time T.  The action of a pendulum of fixed length is the
area of its orbit in phase space, divided by 2π: (8/π) m l² Ω (E(k) - (1 - k²) K(k)) if it swings, and (4/π) m l² Ω k
E(1/k) per turn if it goes round.  It is the same before and after, up to a power of 1/T that is due to the jump in the
fourth derivative of the length.
"""

from __future__ import annotations

from typing import Any

from liaisons import operator, simulate
from liaisons.models import Pendulum
from liaisons.scenarios import Claims, panels, scenario, within

DURATIONS = (10.0, 20.0, 40.0, 80.0, 160.0)
STARTS = {"swinging": (2.0, 0.0), "going round": (0.0, 20.0)}  # θ, θ'
SETTINGS: Any = {"step_size": 0.05, "tolerance": 1e-12, "record": ["length", "theta", "theta_dot", "energy"]}


@scenario
def main(claim: Claims) -> None:
    early, after = panels(
        ("T = 20 s: relative to the start", "t [s]", "ratio"),
        ("before and after", "T [s]", "relative change of the action"),
    )
    small = within(1e-8, because="relative error 840 (T Ω)⁻⁴, due to the jumps of the fourth derivative at both ends")
    order = within(16.0**-4, because="the order of the lowest derivative of the length that jumps")
    for name, (theta, rate) in STARTS.items():
        changes = []
        for T in DURATIONS:
            length = operator("SmoothStep", start_value=1.0, end_value=2.0, duration=T)
            run = simulate("Pendulum", stop_time=T, theta_0=theta, theta_dot_0=rate, length=length, **SETTINGS)
            J = Pendulum.action(run["theta"], run["theta_dot"], run["length"])
            changes.append(abs(J[-1] / J[0] - 1))
            if T == 20.0:
                early.plot(run.time, J / J[0], label=f"action, {name}")
                early.plot(run.time, run["energy"] / run["energy"][0], "--", label=f"energy, {name}")
        after.loglog(DURATIONS, changes, "o-", label=name)
        claim(f"{name}: the action after T = 160 s is that before", changes[-1], 0.0, small)
        fall = changes[-1] / changes[0]
        claim(f"{name}: the change falls at least as T⁻⁴, from T = 10 s to 160 s", fall, 0.0, order)
