"""A satellite that was turned by 180° is held against a push: its wheels absorb the momentum, and its attitude stays.

M 8.3 with a lever d on the axis z, at which a force F acts along the inertial x axis.  The motors turn the satellite
with the least ∫ λ² dt, and feedback along this plan holds it on the way and at its end.  The push adds the angular
momentum H = d ∫ F dt about y, which no wheel can change.  If the wheels were locked, the satellite would turn for ever
at the rate H/J_yy.  Held, it comes to rest where it was, and the wheel along y, which has been turned by 180° with it,
keeps the rate -H/J_w.
"""

from __future__ import annotations

import casadi as ca
import numpy as np

from liaisons import ActiveCoordinate, Parameter, hold, plan, simulate
from liaisons.models import Satellite
from liaisons.scenarios import Claims, panels, scenario, within

WHEELS, J, J_WHEEL = ("wheel_1", "wheel_2", "wheel_3"), 12.0, 0.1
LEVER, FORCE, BEGIN, LASTS, STOP = 0.5, 0.02, 12.0, 4.0, 80.0
MOMENTUM = LEVER * FORCE * LASTS / 2


class PushedSatellite(Satellite):
    """The satellite, and a force at a lever on its axis z."""

    lever = Parameter(LEVER, "m", "distance from the centre of mass to where the force acts")
    push = ActiveCoordinate("N", "force along the inertial x axis")

    def potential_energy(self) -> ca.SX:
        return -self.push * self.lever * self.attitude.matrix[0, 2]


def push(t: float) -> tuple[float, float, float]:
    """F sin² between begin and end, and its rates."""
    w = 2 * np.pi / LASTS
    phase, size = w * (t - BEGIN), FORCE / 2 * (BEGIN <= t < BEGIN + LASTS)
    return size * (1 - np.cos(phase)), size * w * np.sin(phase), size * w**2 * np.cos(phase)


@scenario
def main(claim: Claims) -> None:
    end = {"attitude": (0, 0, 0, 1)} | {f"{wheel}_dot": 0 for wheel in WHEELS}
    regulator = hold(plan(PushedSatellite, WHEELS, end=end, duration=10.0, minimize="effort"))
    claim.verdicts += regulator.verify()
    one = np.abs(regulator.floquet_multipliers[:3])
    claim(f"{', '.join(regulator.conserved)} have the multiplier 1", one, 1.0, within(1e-8, because="error of solver"))

    held = regulator.simulate(STOP, inputs={"push": push})
    free = simulate(PushedSatellite, q_w_0=0.0, q_z_0=1.0, inputs={"push": push}, stop_time=STOP, step_size=0.25)
    name = "PushedSatellite."
    why = "after 64 s the slowest correction has decayed to 1e-5 of what it was"
    kept = held[f"{name}wheel_2_dot"][-1]
    claim("the wheel keeps -H/J_w", kept, -MOMENTUM / J_WHEEL, within(1e-4, "rad/s", because=why))
    vector = np.array([held[f"{name}q_{c}"] for c in "wxy"])
    claim("the satellite is back at its attitude", vector[:, -1], 0.0, within(1e-6, because=why))
    turned = 2 * np.arcsin(np.hypot(free["q_w"], free["q_x"]))
    late = MOMENTUM / J * (STOP - BEGIN - LASTS / 2)
    small = within(1e-5, "rad", because="the lever turns by 7e-3 rad meanwhile, and its cosine enters")
    claim("with locked wheels it turns by H t/J_yy", turned[-1], late, small)

    way, wheels = panels(
        ("a push on a satellite that was turned", "t [s]", "off by [rad]"),
        ("the wheels take its momentum", "t [s]", "wheel along y [rad/s]"),
    )
    way.plot(held.time, 2 * np.linalg.norm(regulator.deviation(held)[:4], axis=0), label="held")
    way.plot(free.time, turned, "--", label="wheels that stand")
    wheels.plot(held.time, held[f"{name}wheel_2_dot"], label="held")
    wheels.axhline(-MOMENTUM / J_WHEEL, linestyle="--", label="-H/J_w")
